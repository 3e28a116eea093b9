//! Synthetic measurements: the truth solved on a mesh of its own, averaged over the scan's voxels, with noise added.

use super::error::CalibrationError;
use super::force_readings::{ForceOnTheWay, LoadCell, ObservedForce};
use crate::fem::{ForwardModel, SolveOptions};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::recording::{Filter, LoadCurve, RecordedStep, Recording};
use crate::sensitivity::{Encoding, Protocol, ScanSettings, ScannedVoxels};
use crate::specimen::Specimen;
use crate::voxel::{HammingFilter, Sampling, VoxelMask, VoxelOperator};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// What a scan gives: displacements of the mask's voxels and a force, at each drive.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// Drives, mm.
    pub drives_mm: Vec<f64>,
    /// Voxel displacements per drive, mm, in the mask's order.
    pub displacements: Vec<Vec<[f64; 3]>>,
    /// Forces, N.
    pub forces_n: Vec<f64>,
    /// Weight of each voxel (see [`crate::sensitivity::PartialVoxels`]); its noise variance is σ²/weight. A voxel of
    /// equal blocks scanned together is their mean, and weighs as many times as much.
    pub weights: Vec<f64>,
    /// The part of a scan's time that each drive got: its weights are as much smaller. Whole scans where it is empty.
    pub shares: Vec<f64>,
    /// Per drive and voxel, where the scan says how it encodes: the part of the signal that is left by direction, by
    /// which the noise is larger; of voxels that are missing it does not count.
    pub signal: Vec<Vec<[f64; 3]>>,
    /// Forces read at other drives, where nothing was scanned.
    pub on_the_way: Vec<ForceOnTheWay>,
    /// What is unknown of the load cell.
    pub load_cell: LoadCell,
}

impl Measurement {
    /// Drives of the scans, then those of the forces read on the way, mm.
    pub fn all_drives_mm(&self) -> Vec<f64> {
        self.drives_mm.iter().copied().chain(self.on_the_way.iter().map(|r| r.drive_mm)).collect()
    }

    /// Weights of the voxels at one drive, by direction: zero where a component is missing (not finite).
    pub(super) fn weights_of(&self, drive_index: usize) -> Vec<[f64; 3]> {
        let (share, signal) = (self.share(drive_index), self.signal.get(drive_index));
        let of_voxel = |(voxel, (u, w)): (usize, (&[f64; 3], &f64))| {
            let left = signal.map_or([1.0; 3], |signal| signal[voxel]);
            let is_whole = u.iter().all(|x| x.is_finite());
            left.map(|part| if is_whole { w * share * part * part } else { 0.0 })
        };
        self.displacements[drive_index].iter().zip(&self.weights).enumerate().map(of_voxel).collect()
    }

    fn share(&self, drive_index: usize) -> f64 {
        self.shares.get(drive_index).copied().unwrap_or(1.0)
    }

    /// Checks lengths and numbers. Missing voxels are allowed, missing forces are not.
    ///
    /// # Errors
    /// [`CalibrationError::DataLength`], [`CalibrationError::InvalidValue`].
    pub fn check(&self, num_voxels: usize, num_drives: usize) -> Result<(), CalibrationError> {
        let length = |what, found: usize, expected: usize| {
            if found == expected { Ok(()) } else { Err(CalibrationError::DataLength { what, found, expected }) }
        };
        length("list of drives", self.drives_mm.len(), num_drives.max(1))?;
        length("list of displacement fields", self.displacements.len(), num_drives)?;
        length("list of forces", self.forces_n.len(), num_drives)?;
        length("list of voxel weights", self.weights.len(), num_voxels)?;
        let value = |name, value: f64, is_good: bool, requirement| {
            if is_good { Ok(()) } else { Err(CalibrationError::InvalidValue { name, value, requirement }) }
        };
        for &w in &self.weights {
            value("a voxel weight", w, w.is_finite() && w >= 0.0, "finite and not negative")?;
        }
        for reading in &self.on_the_way {
            let force = reading.force.value_n;
            value("a force (N) on the way", force, force.is_finite(), "finite")?;
        }
        for (d, field) in self.displacements.iter().enumerate() {
            length("displacement field", field.len(), num_voxels)?;
            let force = self.forces_n[d];
            value("a force (N)", force, force.is_finite() && force.abs() > 0.0, "finite and not zero")?;
            let num_used = self.weights_of(d).iter().filter(|w| w[0] > 0.0).count() as f64;
            value("the number of voxels with a displacement", num_used, num_used > 0.0, "positive")?;
        }
        Ok(())
    }
}

/// The noiseless scan of a true material, from which noisy measurements are drawn.
#[derive(Clone, Debug)]
pub struct SyntheticScan {
    /// Voxels measured of a sample of the first kind.
    pub mask: VoxelMask,
    /// Those of the other kinds; `None` where none is scanned.
    other_masks: Vec<Option<VoxelMask>>,
    /// Grid and noise.
    pub scan: ScanSettings,
    /// For how many voxels of one scan each of the mask's stands.
    voxels_each: f64,
    truth: Measurement,
}

impl SyntheticScan {
    /// Solves `material` at the specimen's drives on a mesh with `mesh` settings, which should be finer than, and other
    /// than, the one used for fitting. Samples are scanned and forces read as `protocol` says, these on the way to the
    /// largest drive; the drive's own zero is taken to be known.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn new(
        specimen: &Specimen,
        material: &Material,
        scan: &ScanSettings,
        protocol: &Protocol,
        mesh: &MeshOptions,
        solve: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<SyntheticScan, CalibrationError> {
        protocol.suits(specimen, specimen.drive_mm.len())?;
        let is_scanned = |drive_mm: f64| specimen.drive_mm.iter().any(|d| Protocol::is_same_drive(*d, drive_mm));
        let largest_mm = specimen.largest_drive_mm();
        let mut forces_mm = protocol.on_the_way_to(largest_mm).force_drives_mm();
        forces_mm.retain(|d| !is_scanned(*d));
        let reading =
            |&drive_mm: &f64| ForceOnTheWay { drive_mm, force: ObservedForce { value_n: 0.0, sd_n: scan.force_sd_n } };
        let num_drives = specimen.drive_mm.len();
        let mut truth = Measurement {
            drives_mm: specimen.drive_mm.clone(),
            displacements: vec![Vec::new(); num_drives],
            forces_n: vec![0.0; num_drives],
            weights: Vec::new(),
            shares: protocol.scan_share.clone(),
            signal: Encoding::of(scan).map_or(Vec::new(), |_| vec![Vec::new(); num_drives]),
            on_the_way: forces_mm.iter().map(reading).collect(),
            load_cell: LoadCell::of_protocol(protocol),
        };
        let encoding = Encoding::of(scan);
        let mut masks = Vec::new();
        for (sample, count) in specimen.samples().iter().zip(specimen.num_scanned(protocol.blocks_scanned)) {
            let mut model = ForwardModel::of_specimen(sample, &mesh.carried(specimen, sample))?;
            let path = model.solve_path(material, &sample.drive_mm, solve, is_cancelled)?;
            truth.forces_n.iter_mut().zip(&path).for_each(|(sum, state)| *sum += state.force_n);
            for reading in &mut truth.on_the_way {
                let state = model.solve(material, reading.drive_mm, None, solve, is_cancelled)?;
                reading.force.value_n += state.force_n;
            }
            if count == 0 {
                masks.push(None);
                continue;
            }
            let ScannedVoxels { mask, weights, voxels_each } = scan.voxels(sample)?;
            let operator = VoxelOperator::new(sample, model.mesh(), &mask, Sampling::default())?;
            for (voxels, state) in truth.displacements.iter_mut().zip(&path) {
                voxels.extend(operator.average(&state.displacement)?);
            }
            if let Some(encoding) = encoding {
                for (of_drive, state) in truth.signal.iter_mut().zip(&path) {
                    let gradients = operator.deformation_gradients(&state.displacement)?;
                    let averages = operator.average(&state.displacement)?;
                    of_drive.extend(encoding.signal_left(&mask, &averages, &gradients));
                }
            }
            truth.weights.extend(weights.iter().map(|w| f64::from(count) * w));
            masks.push(Some((mask, voxels_each)));
        }
        let other_masks = masks.split_off(1).into_iter().map(|of_kind| Some(of_kind?.0)).collect();
        for (voxels, signal) in truth.displacements.iter_mut().zip(&truth.signal) {
            // What tells nothing is missing.
            let lost = voxels.iter_mut().zip(signal).filter(|(_, left)| left[0] == 0.0);
            lost.for_each(|(u, _)| *u = [f64::NAN; 3]);
        }
        // The first block is always scanned.
        let Some((mask, voxels_each)) = masks.pop().flatten() else {
            let name = "the number of scanned blocks";
            return Err(CalibrationError::InvalidValue { name, value: 0.0, requirement: "positive" });
        };
        Ok(SyntheticScan { mask, other_masks, scan: *scan, voxels_each, truth })
    }

    /// Voxels measured of each kind of sample; `None` where none is scanned.
    pub fn masks(&self) -> Vec<Option<VoxelMask>> {
        std::iter::once(Some(self.mask.clone())).chain(self.other_masks.iter().cloned()).collect()
    }

    /// The measurement without noise.
    pub fn noiseless(&self) -> &Measurement {
        &self.truth
    }

    /// `data` of this scan as a recording of `specimen`, a specimen of one kind of sample, filtered or not. After the
    /// filter the noise stated is that of a mean of eight.
    ///
    /// # Errors
    /// [`CalibrationError::Voxel`] where the filter has nothing to average, or a surface is seen.
    pub fn recording(
        &self,
        id: &str,
        specimen: &Specimen,
        data: &Measurement,
        filter: Filter,
    ) -> Result<Recording, CalibrationError> {
        let hamming = match filter {
            Filter::None => None,
            Filter::Hamming2 => Some(HammingFilter::new(&self.mask)?),
        };
        let mask = hamming.as_ref().map_or(&self.mask, |f| f.mask());
        let mut steps = Vec::with_capacity(data.drives_mm.len());
        for (d, &drive_mm) in data.drives_mm.iter().enumerate() {
            let values = match &hamming {
                None => data.displacements[d].clone(),
                Some(filter) => filter.apply(&data.displacements[d])?,
            };
            let mut displacement = mask.spread(&values, [f64::NAN; 3]);
            mask.grid.fill_unmeasured(&mut displacement, f64::NAN);
            steps.push(RecordedStep {
                drive_mm,
                force_n: Some(data.forces_n[d]),
                force_sd_n: Some(self.scan.force_sd_n),
                window_s: None,
                displacement,
            });
        }
        let num_averaged = if hamming.is_some() { 8.0 } else { 1.0 };
        let noise = self.scan.noise().displacement_sd_mm.map(|sd| sd / (num_averaged * self.voxels_each).sqrt());
        Ok(Recording {
            id: id.into(),
            specimen: specimen.clone(),
            grid: mask.grid.clone(),
            mask: mask.spread(&vec![true; mask.num_voxels()], false),
            steps,
            noise_sd_mm: Some(noise),
            filter,
            load: self.load_curve(data),
            notes: None,
        })
    }

    /// Rest, then all forces in the order of their drives, a second apart; none where forces were read at scans alone.
    fn load_curve(&self, data: &Measurement) -> Option<LoadCurve> {
        let mut readings: Vec<(f64, f64)> = data.on_the_way.iter().map(|r| (r.drive_mm, r.force.value_n)).collect();
        if readings.is_empty() {
            return None;
        }
        readings.push((0.0, 0.0));
        readings.extend(data.drives_mm.iter().copied().zip(data.forces_n.iter().copied()));
        readings.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        let time_s = (0..readings.len()).map(|n| n as f64).collect();
        let (drive_mm, force_n) = readings.into_iter().unzip();
        Some(LoadCurve { time_s, drive_mm, force_n })
    }

    /// A standard normal number for draw `draw`, independent of the noise of all draws.
    pub(super) fn prior_draw(seed: u64, draw: u64) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // Streams of the noise count up from zero, these down from the top.
        rng.set_stream(u64::MAX - draw);
        StandardNormal.sample(&mut rng)
    }

    /// The measurement with noise; the same `seed` and `draw` give the same numbers.
    pub fn draw(&self, seed: u64, draw: u64) -> Measurement {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(draw);
        let mut normal = |sd: f64| {
            let x: f64 = StandardNormal.sample(&mut rng);
            sd * x
        };
        let mut noisy = self.truth.clone();
        for (drive, displacements) in noisy.displacements.iter_mut().enumerate() {
            for (u, weights) in displacements.iter_mut().zip(self.truth.weights_of(drive)) {
                for ((value, sd), weight) in u.iter_mut().zip(self.scan.noise().displacement_sd_mm).zip(weights) {
                    // A voxel without weight, or a component without bound to its noise, is not measured; what stands
                    // there does not count.
                    *value += if weight > 0.0 && sd.is_finite() { normal(sd / weight.sqrt()) } else { 0.0 };
                }
            }
        }
        for force in &mut noisy.forces_n {
            *force += normal(self.scan.force_sd_n);
        }
        for reading in &mut noisy.on_the_way {
            reading.force.value_n += normal(reading.force.sd_n);
        }
        let LoadCell { gain_sd, zero_sd_n } = self.truth.load_cell;
        let (gain, zero_n) = (1.0 + normal(gain_sd), normal(zero_sd_n));
        for force in noisy.forces_n.iter_mut().chain(noisy.on_the_way.iter_mut().map(|r| &mut r.force.value_n)) {
            *force = *force * gain + zero_n;
        }
        noisy
    }
}
