//! Evaluates a specimen: what a scan of it would see and what it would tell about the material.

use super::continuum::largest_principal_stretch;
use super::drives::{DriveSelection, check_drives, solve_for_median};
use super::error::EvaluationError;
use super::evaluation_options::EvaluationOptions;
use super::evaluation_result::{Evaluation, EvaluationNotes, EvaluationStatistics, ForceStep};
use super::fixture::{Fixture, Part};
use super::information::FisherInformation;
use super::joint_information::JointInformation;
use super::observation::{DriveMaps, DrivenState, EvaluationStep, Scanner, SeenBlocks, Unknown};
use super::protocol::{Nuisance, Protocol, SAME_DRIVE_MM};
use super::scan_settings::ScanSettings;
use super::shares::{BestShares, SharedTime, best_shares};
use crate::fem::{Equilibrium, Tangent};
use crate::material::Material;
use crate::provenance::input_hash;
use crate::specimen::Specimen;
use crate::voxel::{Sampling, VoxelMask};

/// What an evaluation holds besides its numbers: for plots and further work.
#[derive(Clone, Debug)]
pub struct EvaluationMaps {
    /// Of each kind of sample, in the order of [`Specimen::samples`].
    pub samples: Vec<SampleMaps>,
    /// Information of all drives together, with the prior if any.
    pub information: FisherInformation,
    /// Information of each drive.
    pub information_by_drive: Vec<FisherInformation>,
    /// What the drives tell, whatever the time that each gets.
    pub time: SharedTime,
}

/// What an evaluation holds of one kind of sample.
#[derive(Clone, Debug)]
pub struct SampleMaps {
    /// How many of the kind are scanned.
    pub num_scanned: u32,
    /// Grid and mask; `None` where none is scanned.
    pub mask: Option<VoxelMask>,
    /// Voxel fields per drive; empty where none is scanned.
    pub drives: Vec<DriveMaps>,
    /// Equilibria per drive, on the model's mesh.
    pub equilibria: Vec<Equilibrium>,
}

impl EvaluationMaps {
    /// Equilibria per drive of each kind of sample.
    pub fn equilibria(&self) -> Vec<Vec<Equilibrium>> {
        self.samples.iter().map(|s| s.equilibria.clone()).collect()
    }
}

/// Meshes, solves and evaluates a specimen.
///
/// # Errors
/// See [`EvaluationError`].
pub fn evaluate(
    specimen: &Specimen,
    material: &Material,
    scan: &ScanSettings,
    drives: &DriveSelection,
    options: &EvaluationOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<(Evaluation, EvaluationMaps), EvaluationError> {
    check_drives(specimen, drives)?;
    let mut fixture = Fixture::new(specimen, scan, options)?;
    evaluate_fixture(&mut fixture, material, drives, &[], options, is_cancelled)
}

/// As [`evaluate`] of samples that are meshed and in the scanner; `options.mesh` only enters the input hash.
/// `neighbours` are equilibria of each part with another material: where one is at a drive asked for, its solution
/// starts there.
///
/// # Errors
/// See [`EvaluationError`].
pub fn evaluate_fixture(
    fixture: &mut Fixture,
    material: &Material,
    drives: &DriveSelection,
    neighbours: &[Vec<Equilibrium>],
    options: &EvaluationOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<(Evaluation, EvaluationMaps), EvaluationError> {
    check_drives(fixture.specimen(), drives)?;
    options.protocol.suits(fixture.specimen(), drives.count())?;
    let (equilibria, num_equilibria) = match drives {
        DriveSelection::DriveMm(drives_mm) => {
            let path = fixture.solve_path(material, drives_mm, neighbours, &options.solve, is_cancelled)?;
            let count = path.iter().map(Vec::len).sum();
            (path, count)
        }
        DriveSelection::MedianStretch(target) => {
            solve_for_median(fixture, material, *target, &options.solve, is_cancelled)?
        }
    };
    let nuisances = options.protocol.nuisances();
    let mut time = SharedTime {
        material: material.clone(),
        voxels: Vec::new(),
        forces: Vec::new(),
        on_the_way: JointInformation::none(material, nuisances.len()),
        unknown_sd: nuisances.iter().map(|n| n.1).collect(),
        bulk_log_prior_sd: options.bulk_log_prior_sd,
    };
    let mut steps = Vec::new();
    let mut samples: Vec<SampleMaps> =
        fixture.parts().iter().zip(&equilibria).map(SampleMaps::without_drives).collect();
    for index in 0..drives.count() {
        let at_drive: Vec<&Equilibrium> = equilibria.iter().filter_map(|path| path.get(index)).collect();
        let drive = Drive { is_scanned: true, nuisances: &nuisances };
        let (seen, at) = drive.see(fixture, material, &at_drive)?;
        time.voxels.push(at.voxels);
        time.forces.push(at.force);
        let drive_mm = at_drive.first().map_or(f64::NAN, |e| e.drive_mm);
        let normal_force_n = fixture.specimen().has_plates().then_some(at.normal_force_n);
        steps.push(seen.step(drive_mm, (&at.forces_n, normal_force_n), at.largest_principal_stretch));
        let scanned = samples.iter_mut().filter(|s| s.num_scanned > 0);
        scanned.zip(seen.kinds).for_each(|(sample, (_, observed))| sample.drives.push(observed.maps));
    }
    let force_steps = add_forces(&mut time.on_the_way, fixture, material, options, &steps, is_cancelled)?;
    let mut evaluation = Evaluation {
        schema: "evaluation/1".into(),
        promised_sd: Vec::new(),
        correlation: Vec::new(),
        condition_number: None,
        detectable: Vec::new(),
        largest_principal_stretch: steps.iter().map(|s| s.largest_principal_stretch).fold(f64::NAN, f64::max),
        steps,
        force_steps,
        blocks_scanned: options.protocol.blocks_scanned,
        scan_share: Vec::new(),
        best_scan_share: None,
        voxel_material_volume_mm3: scanned_volume_mm3(fixture),
        subset_material_area_mm2: seen_area_mm2(fixture),
        scan: *fixture.scan(),
        notes: EvaluationNotes::of(fixture.scan()),
        statistics: EvaluationStatistics::of(fixture, num_equilibria),
        version: env!("CARGO_PKG_VERSION").into(),
        input_hash: hash_of_inputs(fixture.specimen(), material, fixture.scan(), drives, options),
    };
    let information = FisherInformation::none(material);
    let mut maps = EvaluationMaps { samples, information, information_by_drive: Vec::new(), time };
    let (shares, limit) = (&options.protocol.scan_share, options.identifiability_limit);
    maps.promise(&mut evaluation, shares, limit)?;
    if shares.len() > 1
        && let Some(best) = best_shares(&[&maps.time])?
    {
        let promised_sd = maps.time.information(&best)?.covariance().promised_sd(limit);
        evaluation.best_scan_share = Some(BestShares { scan_share: best, promised_sd });
    }
    Ok((evaluation, maps))
}

impl EvaluationMaps {
    /// Fills in what `evaluation`, whose maps these are, promises where its drives get these shares of the time of one
    /// scan (whole scans where there are none); parameters are identifiable below `identifiability_limit`.
    ///
    /// # Errors
    /// [`EvaluationError::Information`].
    pub fn promise(
        &mut self,
        evaluation: &mut Evaluation,
        shares: &[f64],
        identifiability_limit: f64,
    ) -> Result<(), EvaluationError> {
        let of_drives: Vec<f64> = (0..evaluation.steps.len()).map(|k| shares.get(k).copied().unwrap_or(1.0)).collect();
        self.information_by_drive.clear();
        for (index, (step, share)) in evaluation.steps.iter_mut().zip(&of_drives).enumerate() {
            let alone = self.time.information_of_drive(index, *share)?;
            step.promised_sd = alone.covariance().promised_sd(identifiability_limit);
            self.information_by_drive.push(alone);
        }
        self.information = self.time.information(&of_drives)?;
        let covariance = self.information.covariance();
        evaluation.promised_sd = covariance.promised_sd(identifiability_limit);
        evaluation.correlation = covariance.correlation_matrix();
        evaluation.condition_number = covariance.condition_number(&self.information.shear_indices());
        evaluation.scan_share = shares.to_vec();
        Ok(())
    }
}

/// Material volume of the voxels of all scanned blocks, mm³.
fn scanned_volume_mm3(fixture: &Fixture) -> f64 {
    let of_part = |p: &Part| {
        let volume = p.scanner.as_ref().map_or(0.0, |s| s.mask.material_volume_mm3());
        f64::from(p.num_scanned) * volume
    };
    fixture.parts().iter().map(of_part).sum()
}

/// Material area of the subsets of all blocks that are looked at, mm²; `None` where the volume is scanned.
fn seen_area_mm2(fixture: &Fixture) -> Option<f64> {
    let scanned = fixture.parts().iter().filter_map(|p| Some((p, p.scanner.as_ref()?)));
    scanned.map(|(part, scanner)| Some(f64::from(part.num_scanned) * scanner.mask.material_area_mm2()?)).sum()
}

impl EvaluationStatistics {
    /// Sums over the kinds of samples.
    fn of(fixture: &Fixture, num_equilibria: usize) -> EvaluationStatistics {
        let sum = |of: &dyn Fn(&Part) -> usize| fixture.parts().iter().map(of).sum();
        let of_scanner = |p: &Part, of: fn(&Scanner) -> usize| p.scanner.as_ref().map_or(0, of);
        EvaluationStatistics {
            num_elements: sum(&|p| p.model.mesh().num_elements()),
            num_nodes: sum(&|p| p.model.mesh().nodes.len()),
            num_unknowns: sum(&|p| p.model.num_unknowns()),
            num_equilibria,
            num_sample_points: sum(&|p| of_scanner(p, |s| s.operator.num_points())),
            num_dropped_points: sum(&|p| of_scanner(p, |s| s.operator.num_dropped_points())),
        }
    }
}

impl SampleMaps {
    fn without_drives((part, equilibria): (&Part, &Vec<Equilibrium>)) -> SampleMaps {
        SampleMaps {
            num_scanned: part.num_scanned,
            mask: part.scanner.as_ref().map(|s| s.mask.clone()),
            drives: Vec::new(),
            equilibria: equilibria.clone(),
        }
    }
}

/// How a drive is scanned, or its force read.
struct Drive<'a> {
    /// Whether it is scanned, or the force alone is read.
    is_scanned: bool,
    nuisances: &'a [(Nuisance, f64)],
}

/// All samples at one drive.
struct AtDrive {
    /// Force of all samples of each kind, N.
    forces_n: Vec<f64>,
    /// Force of all samples along +y, N.
    normal_force_n: f64,
    largest_principal_stretch: f64,
    /// What the voxels tell in the time of a whole scan.
    voxels: JointInformation,
    /// What the force tells.
    force: JointInformation,
}

impl Drive<'_> {
    /// What the scan sees of the samples at the `equilibria` of a drive, one for each kind, and what that and their
    /// force tell: n blocks of a kind tell n times as much as one.
    fn see(
        &self,
        fixture: &mut Fixture,
        material: &Material,
        equilibria: &[&Equilibrium],
    ) -> Result<(SeenBlocks, AtDrive), EvaluationError> {
        let scan = *fixture.scan();
        let num = material.parameters().len();
        let mut voxels = JointInformation::none(material, self.nuisances.len());
        let (mut by_parameter, mut by_unknown) = (vec![0.0; num], vec![0.0; self.nuisances.len()]);
        let (mut seen, mut forces_n, mut largest) = (SeenBlocks::default(), Vec::new(), f64::NAN);
        let mut normal_force_n = 0.0;
        for (part, equilibrium) in fixture.parts_mut().iter_mut().zip(equilibria) {
            largest = largest.max(largest_principal_stretch(&part.model.quadrature_fields(material, equilibrium)));
            let mut tangent = part.model.tangent(material, equilibrium)?;
            let sensitivities = tangent.material_sensitivities()?;
            let unknowns = unknowns_at(self.nuisances, equilibrium, &mut tangent)?;
            by_parameter.iter_mut().zip(&sensitivities).for_each(|(sum, s)| *sum += s.force_n);
            for ((sum, unknown), (nuisance, _)) in by_unknown.iter_mut().zip(&unknowns).zip(self.nuisances) {
                // The load cell has one zero, however many samples it carries.
                *sum = if *nuisance == Nuisance::ForceZero { unknown.force_n } else { *sum + unknown.force_n };
            }
            forces_n.push(equilibrium.force_n);
            normal_force_n += equilibrium.normal_force_n;
            if let Some(scanner) = part.scanner.as_ref().filter(|_| self.is_scanned) {
                let state = DrivenState {
                    drive_mm: equilibrium.drive_mm,
                    displacement: &equilibrium.displacement,
                    sensitivities: &sensitivities,
                    unknowns: &unknowns,
                };
                let observed = scanner.observe(material, &state)?;
                voxels.add_times(f64::from(part.num_scanned), &observed.joint)?;
                seen.kinds.push((part.num_scanned, observed));
            }
        }
        let mut force = JointInformation::none(material, self.nuisances.len());
        force.add_force(&by_parameter, &by_unknown, scan.force_sd_n);
        Ok((seen, AtDrive { forces_n, normal_force_n, largest_principal_stretch: largest, voxels, force }))
    }
}

/// How the state of a drive changes with each unknown of the set-up that `protocol` states; `tangent` is that of
/// `equilibrium`.
///
/// # Errors
/// [`EvaluationError::Solve`].
pub fn unknowns_of(
    protocol: &Protocol,
    equilibrium: &Equilibrium,
    tangent: &mut Tangent,
) -> Result<Vec<Unknown>, EvaluationError> {
    unknowns_at(&protocol.nuisances(), equilibrium, tangent)
}

fn unknowns_at(
    nuisances: &[(Nuisance, f64)],
    equilibrium: &Equilibrium,
    tangent: &mut Tangent,
) -> Result<Vec<Unknown>, EvaluationError> {
    let of = |&(nuisance, sd): &(Nuisance, f64)| {
        let (displacement, force_n) = match nuisance {
            Nuisance::ForceGain => (None, equilibrium.force_n),
            Nuisance::ForceZero => (None, 1.0),
            Nuisance::DriveZero => {
                let along = tangent.path_sensitivity(&[], None, 1.0)?;
                (Some(along.displacement), along.force_n)
            }
            Nuisance::PlateTilt(axis) => {
                let mut about = [0.0; 3];
                about[axis] = 1.0;
                match tangent.change_of_turning_plate(about) {
                    Some(change) => {
                        let along = tangent.path_sensitivity_of(&[], &change)?;
                        (Some(along.displacement), along.force_n)
                    }
                    // What is mirrored is told as well as if the plate were not turned so.
                    None => (None, 0.0),
                }
            }
        };
        Ok(Unknown { sd, displacement, force_n })
    };
    nuisances.iter().map(of).collect()
}

/// Adds the forces that are read without a scan, and gives them. A drive that is scanned has its force already.
fn add_forces(
    forces: &mut JointInformation,
    fixture: &mut Fixture,
    material: &Material,
    options: &EvaluationOptions,
    scanned: &[EvaluationStep],
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<ForceStep>, EvaluationError> {
    let is_scanned = |drive: &f64| scanned.iter().any(|s| (s.drive_mm - drive).abs() < SAME_DRIVE_MM);
    let mut drives = options.protocol.force_drives_mm();
    drives.retain(|d| !is_scanned(d));
    if drives.is_empty() {
        return Ok(Vec::new());
    }
    check_drives(fixture.specimen(), &DriveSelection::DriveMm(drives.clone()))?;
    let nuisances = options.protocol.nuisances();
    let reading = Drive { is_scanned: false, nuisances: &nuisances };
    let paths = fixture.solve_path(material, &drives, &[], &options.solve, is_cancelled)?;
    let mut steps = Vec::new();
    for (index, drive_mm) in drives.into_iter().enumerate() {
        let at_drive: Vec<&Equilibrium> = paths.iter().filter_map(|path| path.get(index)).collect();
        let (_, at) = reading.see(fixture, material, &at_drive)?;
        forces.add(&at.force)?;
        steps.push(ForceStep { drive_mm, force_n: at.forces_n.iter().sum() });
    }
    Ok(steps)
}

/// SHA-256 over the JSON of all inputs. Field order is fixed by the types, so equal inputs have equal hashes.
fn hash_of_inputs(
    specimen: &Specimen,
    material: &Material,
    scan: &ScanSettings,
    drives: &DriveSelection,
    options: &EvaluationOptions,
) -> String {
    let Sampling { gauss_points, cut_slices } = options.sampling;
    let mut inputs = serde_json::json!({
        "specimen": specimen,
        "material": material,
        "scan": scan,
        "drives": drives,
        "mesh": options.mesh,
        "sampling": { "gauss_points": gauss_points, "cut_slices": cut_slices },
        "solver_tolerance": options.solve.tolerance,
        "identifiability_limit": options.identifiability_limit,
        "bulk_log_prior_sd": options.bulk_log_prior_sd,
    });
    // Left out where there is nothing beside the scans, so that older results can be compared.
    if options.protocol != Protocol::default() {
        inputs["protocol"] = serde_json::json!(options.protocol);
    }
    input_hash(&inputs)
}

#[cfg(test)]
mod tests;
