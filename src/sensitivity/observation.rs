//! What the scan sees at one drive: voxel states, sensitivities and information of one equilibrium.

use super::covariance::PromisedSd;
use super::error::EvaluationError;
use super::information::{FisherInformation, MeasurementNoise};
use super::integrated::{IntegratedSensitivity, integrate_over_voxels, sensitivity_map, shear_parameters};
use super::joint_information::{JointInformation, NuisanceColumn};
use super::scan_settings::ScanSettings;
use crate::fem::ParameterSensitivity;
use crate::kinematics::{Decomposition, decompose};
use crate::material::{Ogden, Parameter};
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
#[serde(deny_unknown_fields)]
pub struct EvaluationStep {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Force of all samples together, N.
    pub force_n: f64,
    /// Voxels in the mask.
    pub num_voxels: usize,
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

/// Voxel fields at one drive, in the mask's order. For plots.
#[derive(Clone, Debug)]
pub struct DriveMaps {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Voxel averages of the displacement, mm.
    pub displacement: Vec<[f64; 3]>,
    /// J, stretches, λ, k of the averaged F.
    pub states: Vec<Decomposition>,
    /// S_ξ per voxel for every μᵢ and αᵢ.
    pub sensitivities: Vec<(Parameter, Vec<f64>)>,
    /// Numbers of voxels over (λ, k).
    pub histogram: Histogram2d,
}

/// All that one drive yields.
#[derive(Clone, Debug)]
pub struct Observation {
    /// For the report; `promised_sd` is filled from `information` without priors.
    pub step: EvaluationStep,
    /// For plots.
    pub maps: DriveMaps,
    /// Of this drive.
    pub information: FisherInformation,
    /// The same with the unknowns of the set-up.
    pub(super) joint: JointInformation,
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
    /// Force of all samples together, N.
    pub force_n: f64,
    /// Nodal displacements, mm.
    pub displacement: &'a [[f64; 3]],
    /// From [`crate::fem::Tangent::material_sensitivities`].
    pub sensitivities: &'a [ParameterSensitivity],
    /// From [`super::largest_principal_stretch`].
    pub largest_principal_stretch: f64,
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
    weights: Vec<f64>,
}

impl Scanner {
    /// Centred grid, mask and operator. `mesh` is a mesh of `specimen`.
    ///
    /// # Errors
    /// See [`VoxelError`].
    pub fn new(specimen: &Specimen, mesh: &Mesh, scan: &ScanSettings, sampling: Sampling) -> Result<Self, VoxelError> {
        let mask = VoxelMask::covering(specimen, scan.voxel_mm)?;
        let operator = VoxelOperator::new(specimen, mesh, &mask, sampling)?;
        let weights = scan.partial_voxels.weights(&mask);
        Ok(Scanner { mask, operator, noise: scan.noise(), weights })
    }

    /// Median of λ over voxels for nodal displacements in mm; 1 where no voxel is admissible.
    ///
    /// # Errors
    /// [`VoxelError::LengthMismatch`].
    pub fn median_stretch(&self, displacement: &[[f64; 3]]) -> Result<f64, VoxelError> {
        let gradients = self.operator.deformation_gradients(displacement)?;
        Ok(median(gradients.iter().map(|f| decompose(f).stretch_amplitude)).unwrap_or(1.0))
    }

    /// Observes a solved drive.
    ///
    /// # Errors
    /// Lengths that do not match, noise that is not positive: [`EvaluationError::Voxel`],
    /// [`EvaluationError::Information`].
    pub fn observe(
        &self,
        material: &Ogden,
        state: &DrivenState,
        identifiability_limit: f64,
    ) -> Result<Observation, EvaluationError> {
        let states: Vec<Decomposition> =
            self.operator.deformation_gradients(state.displacement)?.iter().map(decompose).collect();
        let displacement = self.operator.average(state.displacement)?;
        let fields = state
            .sensitivities
            .iter()
            .map(|s| self.operator.average(&s.displacement))
            .collect::<Result<Vec<_>, _>>()?;
        let forces: Vec<f64> = state.sensitivities.iter().map(|s| s.force_n).collect();
        let alone = FisherInformation::of_drive(material, &fields, &self.weights, &forces, &self.noise)?;
        let nuisances = state
            .unknowns
            .iter()
            .map(|u| {
                let field = u.displacement.as_ref().map(|d| self.operator.average(d)).transpose()?;
                Ok(NuisanceColumn { field, force_n: u.force_n })
            })
            .collect::<Result<Vec<_>, VoxelError>>()?;
        let joint = JointInformation::of_drive(alone, &fields, &forces, &nuisances, &self.weights, &self.noise);
        let sd: Vec<f64> = state.unknowns.iter().map(|u| u.sd).collect();
        let information = joint.about_material(material, &sd)?;
        let largest = states.iter().map(|s| s.stretch_amplitude).fold(1.0, f64::max);
        let end = ((largest - 1.0) / STRETCH_AXIS_STEP).ceil().max(1.0) * STRETCH_AXIS_STEP + 1.0;
        let histogram = Histogram2d::of(
            states.iter().map(|s| (s.stretch_amplitude, s.deformation_mode)),
            HistogramAxis { low: 1.0, high: end, num_bins: STRETCH_BINS },
            HistogramAxis { low: 0.0, high: 1.0, num_bins: MODE_BINS },
        )?;
        let step = EvaluationStep {
            drive_mm: state.drive_mm,
            force_n: state.force_n,
            num_voxels: states.len(),
            median_stretch: median(states.iter().map(|s| s.stretch_amplitude)).unwrap_or(1.0),
            median_mode: median(states.iter().filter_map(|s| s.deformation_mode)),
            largest_voxel_stretch: largest,
            largest_principal_stretch: state.largest_principal_stretch,
            num_voxels_without_mode: states.iter().filter(|s| s.deformation_mode.is_none()).count(),
            integrated_sensitivity: integrate_over_voxels(material, &states, &self.mask),
            promised_sd: information.covariance().promised_sd(identifiability_limit),
        };
        let sensitivities = shear_parameters(material).map(|p| (p, sensitivity_map(material, p, &states))).collect();
        let maps = DriveMaps { drive_mm: state.drive_mm, displacement, states, sensitivities, histogram };
        Ok(Observation { step, maps, information, joint })
    }
}

#[cfg(test)]
mod tests {
    use super::super::continuum::tests::{block, made_up_sensitivities, quadrature_points};
    use super::super::information::tests::one_term;
    use super::super::{PartialVoxels, largest_principal_stretch};
    use super::*;
    use crate::mesh::{MeshOptions, mesh_specimen};
    use crate::voxel::Sampling;

    /// Homogeneous shear observed through the whole chain.
    #[test]
    fn homogeneous_shear_is_observed_exactly() {
        let specimen = block("observed");
        let mesh = mesh_specimen(&specimen, &MeshOptions::search(&specimen)).unwrap();
        let scan = ScanSettings {
            voxel_mm: [1.0, 0.25, 0.75],
            noise_sd_mm: [0.05; 3],
            force_sd_n: 0.02,
            partial_voxels: PartialVoxels::Uniform,
        };
        let scanner = Scanner::new(&specimen, &mesh, &scan, Sampling::default()).unwrap();
        let displacement: Vec<[f64; 3]> = mesh.nodes.iter().map(|x| [0.6 * x[1], 0.0, 0.0]).collect();
        let state = DrivenState {
            drive_mm: 2.4,
            force_n: 1.5,
            displacement: &displacement,
            sensitivities: &made_up_sensitivities(&mesh),
            largest_principal_stretch: largest_principal_stretch(&quadrature_points(&mesh, &displacement)),
            unknowns: &[],
        };
        let seen = scanner.observe(&one_term(), &state, 0.5).unwrap();
        let lambda = 0.3 + 1.09f64.sqrt();
        assert_eq!(seen.step.num_voxels, 12 * 16 * 12);
        // Affine fields are exact on every mesh; rounding only.
        assert!((seen.step.median_stretch - lambda).abs() < 1e-11);
        assert!((seen.step.median_mode.unwrap() - 0.5).abs() < 1e-10);
        assert!((seen.step.largest_principal_stretch - lambda).abs() < 1e-11);
        let s_mu = super::super::mu_sensitivity(lambda, 0.5, 1.91).value;
        let integrated = &seen.step.integrated_sensitivity[0];
        assert!((integrated.volume_integral / (432.0 * s_mu) - 1.0).abs() < 1e-10);
        assert!((integrated.sum / (2304.0 * s_mu) - 1.0).abs() < 1e-10);
        assert_eq!(seen.maps.histogram.num_voxels(), 2304);
        assert_eq!(seen.maps.sensitivities.len(), 2);
        assert_eq!(seen.step.promised_sd.len(), 3);
        let json = serde_json::to_string(&seen.step).unwrap();
        assert!(json.contains("\"integrated_sensitivity\":[{\"parameter\":\"mu_1\",\"sum\":"));
    }

    #[test]
    fn medians() {
        assert_eq!(median([3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median([4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median([f64::NAN]), None);
    }
}
