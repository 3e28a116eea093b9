//! The arrays of a calibration: parameters with their covariance, and what was compared, voxel by voxel.

use super::arrays::{Tree, or_nan};
use super::voxel_arrays::{add_grid, vector_axes, vectors};
use crate::calibration::{Calibration, Observed};

/// The arrays of a calibration on `observed`, named `names`.
pub fn calibration_arrays(found: &Calibration, observed: &[Observed], names: &[String]) -> Tree {
    let mut tree = Tree::default();
    let estimates = &found.estimates;
    let parameters = ("parameter", estimates.len());
    tree.names("parameters", estimates.iter().map(|e| e.parameter.name()).collect());
    let values: Vec<f64> = estimates.iter().map(|e| e.value).collect();
    let about = "parameters of the fitted material (kPa, of an exponent 1); see is_identifiable";
    tree.array("value", "kPa or 1", about, &[parameters], values);
    let about = "standard deviation from the noise; NaN where undetermined";
    tree.array("sd", "kPa or 1", about, &[parameters], or_nan(estimates.iter().map(|e| e.sd)));
    let ends = (0..2).flat_map(|side| estimates.iter().map(move |e| e.interval_95[side]));
    let about = "95 % interval from noise, discretisation and misfit; NaN where open";
    tree.array("interval_95", "kPa or 1", about, &[parameters, ("low_high", 2)], or_nan(ends));
    let identifiable: Vec<bool> = estimates.iter().map(|e| e.is_identifiable).collect();
    let about = "whether the standard deviation is below half of the value";
    tree.array("is_identifiable", "1", about, &[parameters], identifiable);
    let n = estimates.len();
    let entry = |i: usize, j: usize| found.fit.covariance_of(estimates[i].parameter, estimates[j].parameter);
    let entries = or_nan((0..n * n).map(|k| entry(k % n, k / n)));
    let about = "covariance of the estimates, sd^2 on its diagonal, in the parameters' units; NaN where undetermined";
    let axes = [parameters, ("other_parameter", n)];
    tree.array("covariance", "kPa and 1", about, &axes, entries);
    for (index, recording) in observed.iter().enumerate() {
        let name = names.get(index).map_or("", String::as_str);
        tree.tree(format!("recording_{}", index + 1), recording_arrays(found, index, recording, name));
    }
    tree
}

/// What was compared in the recording of this index.
fn recording_arrays(found: &Calibration, index: usize, recording: &Observed, name: &str) -> Tree {
    let (grid, steps) = (&recording.mask.grid, &recording.steps);
    let mut tree = Tree::default();
    tree.text("id", name);
    let drives = [("drive", steps.len())];
    tree.array("drive_mm", "mm", "drive", &drives, steps.iter().map(|s| s.drive_mm).collect::<Vec<_>>());
    let forces = or_nan(steps.iter().map(|s| s.force.map(|f| f.value_n)));
    tree.array("force_n", "N", "recorded force, all samples together; NaN where not recorded", &drives, forces);
    let forces = or_nan((0..steps.len()).map(|s| found.has_force.then(|| found.fit.force_n(index, s))));
    tree.array("model_force_n", "N", "force of the model; NaN where no force determines it", &drives, forces);
    let mask = &recording.mask;
    add_grid(&mut tree, grid, mask.spread(&vec![true; mask.num_voxels()], false));
    let axes = vector_axes(grid, steps.len());
    let mut add = |name: &str, about: &str, of_step: &dyn Fn(usize) -> Vec<[f64; 3]>| {
        let all: Vec<Vec<[f64; 3]>> = (0..steps.len()).map(|s| mask.spread(&of_step(s), [f64::NAN; 3])).collect();
        tree.array(name, "mm", about, &axes, vectors(all.iter().map(Vec::as_slice)));
    };
    add("measured_mm", "measured displacement; NaN where missing or not compared", &|s| steps[s].displacement.clone());
    add("model_mm", "displacement of the model", &|s| found.fit.predicted(index, s).to_vec());
    add("misfit_mm", "measured - model", &|s| found.fit.misfit(index, s, &steps[s].displacement));
    tree
}
