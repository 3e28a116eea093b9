//! What the scan sees at one drive: voxel states, sensitivities and information of one equilibrium.

use super::covariance::PromisedSd;
use super::encoding::Encoding;
use super::error::EvaluationError;
use super::information::{FisherInformation, MeasurementNoise};
use super::integrated::{IntegratedSensitivity, integrate_over_voxels, sensitivity_map};
use super::joint_information::{JointInformation, NuisanceColumn};
use super::scan_settings::{ScanSettings, ScannedVoxels};
use crate::fem::ParameterSensitivity;
use crate::kinematics::{Decomposition, Tensor, decompose};
use crate::material::{Material, Parameter};
use crate::mesh::Mesh;
use crate::specimen::Specimen;
use crate::voxel::{Histogram2d, HistogramAxis, Sampling, VoxelError, VoxelMask, VoxelOperator};
use serde::{Deserialize, Serialize};

/// Bins of the (λ, k) histogram.
const STRETCH_BINS: usize = 60;
const MODE_BINS: usize = 50;
/// The histogram's λ axis ends at the next multiple of this above the largest λ.
const STRETCH_AXIS_STEP: f64 = 0.1;

/// One drive of an `evaluation/1`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct EvaluationStep {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Force of all samples together, N.
    pub force_n: f64,
    /// What the mesh may put the force wrong by, N: in 19 of 20 cases no more. Absent where no coarser mesh was
    /// solved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_discretisation_n: Option<f64>,
    /// Where there are several kinds of samples: the force of all samples of each kind, N.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub force_by_kind_n: Vec<f64>,
    /// Force across the plates of a double-lap test, all samples together, N: positive where it pulls them together.
    /// Absent in other tests.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_force_n: Option<f64>,
    /// Voxels in the masks of all blocks that are scanned, on average over the places of the grid where it may lie
    /// anywhere; what follows is over these.
    pub num_voxels: usize,
    /// What encoding costs, where the scan says how it encodes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase_loss: Option<PhaseLoss>,
    /// Median of λ over voxels.
    pub median_stretch: f64,
    /// Median of k over the voxels that have one; null where none has.
    pub median_mode: Option<f64>,
    /// Largest λ of a voxel.
    pub largest_voxel_stretch: f64,
    /// Largest principal stretch in the specimen (quadrature points). Bonded edges are singular: it grows with the
    /// mesh.
    pub largest_principal_stretch: f64,
    /// Voxels without a mode (λ = 1); they count as zero in the sensitivities.
    pub num_voxels_without_mode: usize,
    /// 𝒮 per parameter.
    pub integrated_sensitivity: Vec<IntegratedSensitivity>,
    /// Standard deviations that this drive alone promises.
    pub promised_sd: Vec<PromisedSd>,
}

/// What encoding displacement as a phase costs at one drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PhaseLoss {
    /// Voxels that tell nothing, because a phase of theirs cannot be told from their neighbours' or drowns in noise;
    /// they are counted in `num_voxels`.
    pub num_voxels_lost: usize,
    /// Part of the signal that the other voxels keep on average along x, y and z; 0 where there are none.
    pub mean_signal: [f64; 3],
}

/// Voxel fields at one drive, in the mask's order. For plots.
#[derive(Clone, Debug)]
pub struct DriveMaps {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Voxel averages of the displacement, mm.
    pub displacement: Vec<[f64; 3]>,
    /// J, stretches, λ, k of the averaged F.
    pub states: Vec<Decomposition>,
    /// Where the scan says how it encodes: the part of its signal that each voxel keeps by direction, zeros where it
    /// tells nothing.
    pub signal: Option<Vec<[f64; 3]>>,
    /// S_ξ per voxel for every μᵢ and αᵢ.
    pub sensitivities: Vec<(Parameter, Vec<f64>)>,
    /// Numbers of voxels over (λ, k).
    pub histogram: Histogram2d,
}

/// What the voxels of one block yield at one drive.
#[derive(Clone, Debug)]
pub struct Observation {
    /// For plots.
    pub maps: DriveMaps,
    /// For how many voxels of a scan each of the maps stands.
    pub voxels_each: f64,
    /// 𝒮 per parameter.
    pub integrated_sensitivity: Vec<IntegratedSensitivity>,
    /// What the voxels tell of the material and the unknowns of the set-up; the force is not in it.
    pub joint: JointInformation,
}

/// Median of finite numbers: the middle one, or the mean of the two middle ones; none without any.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    if n == 0 {
        return None;
    }
    Some(if n % 2 == 1 { sorted[n / 2] } else { 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]) })
}

/// A solved drive, as the scan is to see it.
#[derive(Clone, Copy, Debug)]
pub struct DrivenState<'a> {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Nodal displacements, mm.
    pub displacement: &'a [[f64; 3]],
    /// From [`crate::fem::Tangent::material_sensitivities`].
    pub sensitivities: &'a [ParameterSensitivity],
    /// What is not known exactly of the set-up, and how the state changes with it.
    pub unknowns: &'a [Unknown],
}

/// An unknown of the set-up at a solved drive.
#[derive(Clone, Debug)]
pub struct Unknown {
    /// Standard deviation to which it is known beforehand.
    pub sd: f64,
    /// Change of the nodal displacements with it, mm per unit; `None` where they do not change.
    pub displacement: Option<Vec<[f64; 3]>>,
    /// Change of the force with it, N per unit.
    pub force_n: f64,
}

/// The scan of one specimen on one mesh: its mask and how it weighs what it sees.
#[derive(Clone, Debug)]
pub struct Scanner {
    /// Grid and mask.
    pub mask: VoxelMask,
    /// Voxel averages of fields on the mesh.
    pub operator: VoxelOperator,
    noise: MeasurementNoise,
    encoding: Option<Encoding>,
    weights: Vec<f64>,
    /// For how many voxels of a scan each of the mask stands.
    voxels_each: f64,
}

impl Scanner {
    /// The scan's grid, mask and operator. `mesh` is a mesh of `specimen`.
    ///
    /// # Errors
    /// See [`VoxelError`].
    pub fn new(specimen: &Specimen, mesh: &Mesh, scan: &ScanSettings, sampling: Sampling) -> Result<Self, VoxelError> {
        let ScannedVoxels { mask, voxels_each, weights } = scan.voxels(specimen)?;
        let operator = VoxelOperator::new(specimen, mesh, &mask, sampling)?;
        Ok(Scanner { mask, operator, noise: scan.noise(), encoding: Encoding::of(scan), weights, voxels_each })
    }

    /// Weight of each voxel of the mask.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The part of its signal that each voxel keeps by direction where its mean displacement (mm) and deformation
    /// gradient are these; zeros where a voxel tells nothing, `None` where the scan does not say how it encodes.
    pub fn signal_left(&self, displacement: &[[f64; 3]], deformation_gradients: &[Tensor]) -> Option<Vec<[f64; 3]>> {
        self.encoding.map(|encoding| encoding.signal_left(&self.mask, displacement, deformation_gradients))
    }

    /// λ of every voxel for nodal displacements in mm.
    ///
    /// # Errors
    /// [`VoxelError::LengthMismatch`].
    pub(super) fn stretches(&self, displacement: &[[f64; 3]]) -> Result<Vec<f64>, VoxelError> {
        let gradients = self.operator.deformation_gradients(displacement)?;
        Ok(gradients.iter().map(|f| decompose(f).stretch_amplitude).collect())
    }

    /// Observes a solved drive of one block.
    ///
    /// # Errors
    /// Lengths that do not match, noise that is not positive: [`EvaluationError::Voxel`],
    /// [`EvaluationError::Information`].
    pub fn observe(&self, material: &Material, state: &DrivenState) -> Result<Observation, EvaluationError> {
        let gradients = self.operator.deformation_gradients(state.displacement)?;
        let states: Vec<Decomposition> = gradients.iter().map(decompose).collect();
        let displacement = self.operator.average(state.displacement)?;
        let signal = self.signal_left(&displacement, &gradients);
        // A voxel whose noise is larger by some factor tells as much as one that changes less by it.
        let changes = |field: &[[f64; 3]]| -> Result<Vec<[f64; 3]>, VoxelError> {
            let mut changes = self.operator.average(field)?;
            for (change, left) in changes.iter_mut().zip(signal.iter().flatten()) {
                *change = [0, 1, 2].map(|a| change[a] * left[a]);
            }
            Ok(changes)
        };
        let fields = state.sensitivities.iter().map(|s| changes(&s.displacement)).collect::<Result<Vec<_>, _>>()?;
        // The force is that of all samples together: it is not a voxel's.
        let no_forces = vec![0.0; fields.len()];
        let alone = FisherInformation::of_drive(material, &fields, &self.weights, &no_forces, &self.noise)?;
        let nuisances = state
            .unknowns
            .iter()
            .map(|u| {
                let field = u.displacement.as_ref().map(|d| changes(d)).transpose()?;
                Ok(NuisanceColumn { field, force_n: 0.0 })
            })
            .collect::<Result<Vec<_>, VoxelError>>()?;
        let joint = JointInformation::of_drive(alone, &fields, &no_forces, &nuisances, &self.weights, &self.noise);
        let largest = states.iter().map(|s| s.stretch_amplitude).fold(1.0, f64::max);
        let end = ((largest - 1.0) / STRETCH_AXIS_STEP).ceil().max(1.0) * STRETCH_AXIS_STEP + 1.0;
        let histogram = Histogram2d::of(
            states.iter().map(|s| (s.stretch_amplitude, s.deformation_mode)),
            HistogramAxis { low: 1.0, high: end, num_bins: STRETCH_BINS },
            HistogramAxis { low: 0.0, high: 1.0, num_bins: MODE_BINS },
        )?;
        let integrated_sensitivity = integrate_over_voxels(material, &states, &self.mask, self.voxels_each);
        let sensitivities = material.shear_parameters().map(|p| (p, sensitivity_map(material, p, &states))).collect();
        let maps = DriveMaps { drive_mm: state.drive_mm, displacement, states, signal, sensitivities, histogram };
        Ok(Observation { maps, voxels_each: self.voxels_each, integrated_sensitivity, joint })
    }
}

/// What the scan sees of all scanned blocks at one drive.
#[derive(Debug, Default)]
pub(super) struct SeenBlocks {
    /// Of each kind of sample that is scanned: how many of it are, and what one of them shows.
    pub kinds: Vec<(u32, Observation)>,
}

impl SeenBlocks {
    /// The voxels' states, those of every block.
    fn states(&self) -> impl Iterator<Item = &Decomposition> {
        let blocks = self.kinds.iter().flat_map(|(count, seen)| std::iter::repeat_n(seen, *count as usize));
        blocks.flat_map(|seen| &seen.maps.states)
    }

    /// How many voxels of a scan, on average over where its grid lies, show a state that `is_counted`.
    fn num_voxels(&self, is_counted: impl Fn(&Decomposition) -> bool) -> f64 {
        let of_kind = |(count, seen): &(u32, Observation)| {
            f64::from(*count) * seen.voxels_each * seen.maps.states.iter().filter(|s| is_counted(s)).count() as f64
        };
        self.kinds.iter().map(of_kind).sum()
    }

    /// What encoding costs over all of their voxels.
    fn phase_loss(&self) -> Option<PhaseLoss> {
        let (mut num_lost, mut num_kept, mut sum) = (0.0, 0.0, [0.0; 3]);
        for (count, seen) in &self.kinds {
            let each = f64::from(*count) * seen.voxels_each;
            for left in seen.maps.signal.as_ref()? {
                if left.iter().all(|part| *part > 0.0) {
                    num_kept += each;
                    sum.iter_mut().zip(left).for_each(|(sum, part)| *sum += each * part);
                } else {
                    num_lost += each;
                }
            }
        }
        let mean_signal = sum.map(|s| if num_kept > 0.0 { s / num_kept } else { 0.0 });
        Some(PhaseLoss { num_voxels_lost: num_lost.round() as usize, mean_signal })
    }

    /// 𝒮 over all of their voxels.
    fn integrated(&self) -> Vec<IntegratedSensitivity> {
        let mut all: Vec<IntegratedSensitivity> = Vec::new();
        for (count, seen) in &self.kinds {
            for (index, own) in seen.integrated_sensitivity.iter().enumerate() {
                if all.len() <= index {
                    all.push(IntegratedSensitivity::zero_like(own));
                }
                all[index].add_blocks(f64::from(*count), own);
            }
        }
        all.iter_mut().for_each(|s| s.mean_per_voxel = s.sum / self.num_voxels(|_| true));
        all
    }

    /// The report's figures of a drive (mm), but for what it promises, with the force of each kind of sample and that
    /// of all across the plates, where there are any (N), and the largest principal stretch in any of them.
    pub fn step(
        &self,
        drive_mm: f64,
        (forces_n, normal_force_n): (&[f64], Option<f64>),
        largest_principal_stretch: f64,
    ) -> EvaluationStep {
        EvaluationStep {
            drive_mm,
            force_n: forces_n.iter().sum(),
            force_discretisation_n: None,
            force_by_kind_n: if forces_n.len() > 1 { forces_n.to_vec() } else { Vec::new() },
            normal_force_n,
            num_voxels: self.num_voxels(|_| true).round() as usize,
            phase_loss: self.phase_loss().filter(|_| !self.kinds.is_empty()),
            median_stretch: median(self.states().map(|s| s.stretch_amplitude)).unwrap_or(1.0),
            median_mode: median(self.states().filter_map(|s| s.deformation_mode)),
            largest_voxel_stretch: self.states().map(|s| s.stretch_amplitude).fold(1.0, f64::max),
            largest_principal_stretch,
            num_voxels_without_mode: self.num_voxels(|s| s.deformation_mode.is_none()).round() as usize,
            integrated_sensitivity: self.integrated(),
            promised_sd: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::continuum::tests::{block, made_up_sensitivities, quadrature_points};
    use super::super::information::tests::one_term;
    use super::super::largest_principal_stretch;
    use super::*;
    use crate::mesh::{MeshOptions, mesh_specimen};
    use crate::specimen::TestKind;
    use crate::voxel::{Face, MeasuredComponents, Sampling, Surface};

    /// Homogeneous shear observed through the whole chain.
    #[test]
    fn homogeneous_shear_is_observed_exactly() {
        let specimen = block("observed");
        let mesh = mesh_specimen(&specimen, &MeshOptions::search(&specimen)).unwrap();
        let scan = ScanSettings {
            voxel_mm: [1.0, 0.25, 0.75],
            noise_sd_mm: [0.05; 3],
            force_sd_n: 0.02,
            ..ScanSettings::default()
        };
        let scanner = Scanner::new(&specimen, &mesh, &scan, Sampling::default()).unwrap();
        let displacement: Vec<[f64; 3]> = mesh.nodes.iter().map(|x| [0.6 * x[1], 0.0, 0.0]).collect();
        let state = DrivenState {
            drive_mm: 2.4,
            displacement: &displacement,
            sensitivities: &made_up_sensitivities(&mesh),
            unknowns: &[],
        };
        let stretch = largest_principal_stretch(&quadrature_points(&mesh, &displacement));
        let lambda = 0.3 + 1.09f64.sqrt();
        // Affine fields are exact on every mesh; rounding only.
        assert!((stretch - lambda).abs() < 1e-11);
        let seen = scanner.observe(&one_term(), &state).unwrap();
        assert_eq!(seen.maps.histogram.num_voxels(), 2304);
        assert_eq!(seen.maps.sensitivities.len(), 2);
        let stretches = scanner.stretches(&displacement).unwrap();
        assert!((median(stretches).unwrap() - lambda).abs() < 1e-11);
        let alone = SeenBlocks { kinds: vec![(1, seen.clone())] }.step(2.4, (&[1.5], None), stretch);
        assert_eq!(alone.num_voxels, 12 * 16 * 12);
        assert!((alone.median_stretch - lambda).abs() < 1e-11);
        assert!((alone.median_mode.unwrap() - 0.5).abs() < 1e-10);
        let s_mu = super::super::mu_sensitivity(lambda, 0.5, 1.91).value;
        let integrated = &alone.integrated_sensitivity[0];
        assert!((integrated.volume_integral / (432.0 * s_mu) - 1.0).abs() < 1e-10);
        assert!((integrated.sum / (2304.0 * s_mu) - 1.0).abs() < 1e-10);
        // Encoded, the phase of x changes by 0.6 × 0.25 / 0.1 rad over a voxel: its noise is larger by one over the
        // sinc of half of that, and nothing else changes.
        let encoded = ScanSettings { mm_per_radian: Some([0.1; 3]), ..scan };
        let left = 0.75f64.sin() / 0.75;
        let noisier = ScanSettings { noise_sd_mm: [0.05 / left, 0.05, 0.05], ..scan };
        let [encoded, noisier] = [encoded, noisier].map(|scan| {
            let scanner = Scanner::new(&specimen, &mesh, &scan, Sampling::default()).unwrap();
            scanner.observe(&one_term(), &state).unwrap()
        });
        let about = |o: &Observation| o.joint.about_material(&one_term(), &[]).unwrap().matrix().clone();
        // Rounding of sums over 2304 voxels.
        assert!((about(&encoded) - about(&noisier)).norm() < 1e-11 * about(&noisier).norm());
        let loss = SeenBlocks { kinds: vec![(2, encoded)] }.step(2.4, (&[1.5], None), stretch).phase_loss.unwrap();
        assert_eq!(loss.num_voxels_lost, 0);
        assert!((loss.mean_signal[0] - left).abs() < 1e-11 && loss.mean_signal[2] == 1.0, "{loss:?}");
        let json = serde_json::to_string(&alone).unwrap();
        assert!(json.contains("\"integrated_sensitivity\":[{\"parameter\":\"mu_1\",\"sum\":"), "{json}");
        assert!(!json.contains("force_by_kind_n"), "a specimen of one kind of sample is written as ever: {json}");
        assert!(!json.contains("normal_force_n"), "a test without plates has no force across them: {json}");
        // Two blocks and one: sums are three times as large, means the same.
        let three = SeenBlocks { kinds: vec![(2, seen.clone()), (1, seen)] };
        let three = three.step(2.4, (&[3.0, 1.5], Some(0.5)), stretch);
        assert_eq!((three.num_voxels, three.force_n), (3 * alone.num_voxels, 4.5));
        assert_eq!(three.normal_force_n, Some(0.5));
        assert!((three.median_stretch - alone.median_stretch).abs() < 1e-15);
        let of_three = &three.integrated_sensitivity[1];
        let of_one = &alone.integrated_sensitivity[1];
        assert!((of_three.sum / of_one.sum - 3.0).abs() < 1e-12);
        assert!((of_three.mean_per_voxel / of_one.mean_per_voxel - 1.0).abs() < 1e-12);
    }

    /// A bar in homogeneous extension, whose displacement changes with every parameter by c (x, −y/2, −z/2): what
    /// cameras at its face tell is a sum of squares of the subsets' centres, n (n² − 1) h²/12 for n centres h apart,
    /// and of the height where that is measured.
    #[test]
    fn a_face_of_a_homogeneous_bar_tells_a_closed_form() {
        let specimen = Specimen { test: TestKind::Uniaxial, ..block("bar") };
        let mesh = mesh_specimen(&specimen, &MeshOptions::search(&specimen)).unwrap();
        let field =
            |c: f64| mesh.nodes.iter().map(|x| [c * x[0], -0.5 * c * x[1], -0.5 * c * x[2]]).collect::<Vec<_>>();
        let size = [1e-6, 1e-3, 5e-3];
        let sensitivities: Vec<ParameterSensitivity> = one_term()
            .parameters()
            .into_iter()
            .zip(size)
            .map(|(parameter, c)| ParameterSensitivity { parameter, displacement: field(c), force_n: 0.0 })
            .collect();
        let displacement = field(0.4);
        let state =
            DrivenState { drive_mm: 4.8, displacement: &displacement, sensitivities: &sensitivities, unknowns: &[] };
        let (voxel_mm, noise_sd_mm) = ([1.0, 0.25, 0.75], [0.02, 0.01, 0.05]);
        for components in [MeasuredComponents::InPlane, MeasuredComponents::All] {
            let surface = Some(Surface { face: Face::PlusZ, components });
            let scan = ScanSettings { voxel_mm, noise_sd_mm, surface, ..ScanSettings::default() };
            let scanner = Scanner::new(&specimen, &mesh, &scan, Sampling::default()).unwrap();
            let seen = scanner.observe(&one_term(), &state).unwrap();
            // 12 × 4 mm in subsets of 1 × 0.25 mm, 4.5 mm above the middle.
            let squares = |n: f64, h: f64| n * (n * n - 1.0) * h * h / 12.0;
            let mut told = 16.0 * squares(12.0, 1.0) / 4e-4 + 12.0 * squares(16.0, 0.25) / 4e-4;
            if components == MeasuredComponents::All {
                told += 192.0 * (0.5f64 * 4.5).powi(2) / 25e-4;
            }
            let found = seen.joint.about_material(&one_term(), &[]).unwrap();
            for (i, a) in size.iter().enumerate() {
                for (j, b) in size.iter().enumerate() {
                    // Means of linear fields are exact; rounding of 192 products.
                    assert!((found.matrix()[(i, j)] / (a * b * told) - 1.0).abs() < 1e-11);
                }
            }
            let step = SeenBlocks { kinds: vec![(1, seen)] }.step(4.8, (&[1.0], None), 1.4);
            let of_mu = &step.integrated_sensitivity[0];
            assert_eq!((step.num_voxels, of_mu.volume_integral), (192, 0.0));
            assert!((of_mu.surface_integral.unwrap() / (48.0 * of_mu.mean_per_voxel) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn medians() {
        assert_eq!(median([3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median([4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median([f64::NAN]), None);
    }
}
