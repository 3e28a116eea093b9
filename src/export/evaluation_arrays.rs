//! The arrays of an evaluation: voxel fields of every scanned sample, and what the scan promises.

use super::arrays::{Tree, or_nan};
use super::voxel_arrays::{add_grid, scalar_axes, vector_axes, vectors};
use crate::kinematics::Decomposition;
use crate::sensitivity::{DriveMaps, Evaluation, EvaluationMaps, SampleMaps};
use crate::voxel::VoxelMask;

/// The arrays of an evaluation. Samples that are not scanned have none.
pub fn evaluation_arrays(evaluation: &Evaluation, maps: &EvaluationMaps) -> Tree {
    let mut tree = Tree::default();
    let steps = &evaluation.steps;
    let drives = ("drive", steps.len());
    tree.array("drive_mm", "mm", "drive", &[drives], steps.iter().map(|s| s.drive_mm).collect::<Vec<_>>());
    let forces: Vec<f64> = steps.iter().map(|s| s.force_n).collect();
    tree.array("force_n", "N", "force, all samples together", &[drives], forces);
    if steps.iter().any(|s| s.normal_force_n.is_some()) {
        let about = "force across the plates, all samples together; positive where it pulls them together";
        tree.array("normal_force_n", "N", about, &[drives], or_nan(steps.iter().map(|s| s.normal_force_n)));
    }
    let promised = &evaluation.promised_sd;
    let parameters = ("parameter", promised.len());
    tree.names("parameters", promised.iter().map(|p| p.parameter.clone()).collect());
    let about = "standard deviation that all drives together promise, in the parameter's unit (kPa, of an exponent 1); \
                 NaN where undetermined";
    tree.array("promised_sd", "kPa or 1", about, &[parameters], or_nan(promised.iter().map(|p| p.value)));
    let about = "promised standard deviation / parameter; NaN where undetermined";
    tree.array("promised_relative_sd", "1", about, &[parameters], or_nan(promised.iter().map(|p| p.relative_sd)));
    let by_drive = steps.iter().flat_map(|s| s.promised_sd.iter().map(|p| p.relative_sd));
    let about = "promised standard deviation of each drive alone / parameter; NaN where undetermined";
    tree.array("promised_relative_sd_of_drive", "1", about, &[parameters, drives], or_nan(by_drive));
    let correlation = or_nan(evaluation.correlation.iter().flatten().copied());
    let about = "correlation of the estimates; NaN where undetermined";
    tree.array("correlation", "1", about, &[parameters, ("other_parameter", promised.len())], correlation);
    if let Some(first) = steps.first() {
        let sensitive = ("sensitive_parameter", first.integrated_sensitivity.len());
        tree.names("sensitive_parameters", first.integrated_sensitivity.iter().map(|s| s.parameter.clone()).collect());
        let sums: Vec<f64> = steps.iter().flat_map(|s| s.integrated_sensitivity.iter().map(|i| i.sum)).collect();
        let about = "sum of the sensitivity over voxels";
        tree.array("integrated_sensitivity", "1 or kPa", about, &[sensitive, drives], sums);
    }
    for (index, sample) in maps.samples.iter().enumerate() {
        if let Some(mask) = &sample.mask {
            tree.tree(format!("sample_{}", index + 1), sample_arrays(sample, mask));
        }
    }
    tree
}

fn sample_arrays(sample: &SampleMaps, mask: &VoxelMask) -> Tree {
    let (grid, drives) = (&mask.grid, &sample.drives);
    let spread = |of: &dyn Fn(&DriveMaps) -> Vec<f64>| -> Vec<f64> {
        drives.iter().flat_map(|drive| mask.spread(&of(drive), f64::NAN)).collect()
    };
    let state = |of: &dyn Fn(&Decomposition) -> f64| spread(&|drive| drive.states.iter().map(of).collect());
    let (scalars, components) = (scalar_axes(grid, drives.len()), vector_axes(grid, drives.len()));
    let mut tree = Tree::default();
    add_grid(&mut tree, grid, mask.spread(&vec![true; mask.num_voxels()], false));
    let fraction = mask.spread(&mask.material_fraction, 0.0);
    tree.array("material_fraction", "1", "filled part of each voxel of the mask", &scalars[..3], fraction);
    let displacement: Vec<Vec<[f64; 3]>> = drives.iter().map(|d| mask.spread(&d.displacement, [f64::NAN; 3])).collect();
    let about = "displacement u, mean over the voxel; NaN outside the mask";
    tree.array("displacement_mm", "mm", about, &components, vectors(displacement.iter().map(Vec::as_slice)));
    tree.array("jacobian", "1", "J of the voxel's mean F", &scalars, state(&|s| s.jacobian));
    let stretches: Vec<Vec<[f64; 3]>> = drives
        .iter()
        .map(|d| mask.spread(&d.states.iter().map(|s| s.principal_stretches).collect::<Vec<_>>(), [f64::NAN; 3]))
        .collect();
    let about = "principal stretches, largest first, with the change of volume";
    tree.array("principal_stretches", "1", about, &components, vectors(stretches.iter().map(Vec::as_slice)));
    let about = "stretch amplitude lambda";
    tree.array("stretch_amplitude", "1", about, &scalars, state(&|s| s.stretch_amplitude));
    let about = "deformation mode k: 0 equibiaxial, 1/2 pure shear, 1 uniaxial; NaN without a stretch";
    tree.array("deformation_mode", "1", about, &scalars, state(&|s| s.deformation_mode.unwrap_or(f64::NAN)));
    let sensitivities = drives.first().map_or(&[][..], |d| &d.sensitivities[..]);
    for (index, (parameter, _)) in sensitivities.iter().enumerate() {
        let values = spread(&|drive| drive.sensitivities.get(index).map(|(_, v)| v.clone()).unwrap_or_default());
        let unit = if parameter.is_modulus() { "1" } else { "kPa" };
        let about = format!("sensitivity of the stress to {}: d2Psi / d{0} dlambda", parameter.name());
        tree.array(format!("sensitivity_{}", parameter.name()), unit, about, &scalars, values);
    }
    tree
}
