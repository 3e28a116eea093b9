use super::*;
use crate::diagnosis::cause::Cause;
use crate::diagnosis::fit::derivatives;
use crate::diagnosis::registry::Registry;
use crate::diagnosis::supposed::{Supposed, scene_of};
use crate::diagnosis::test_recordings::{FORCE_SD_N, MESH_FACTOR, material, recorded};
use std::sync::Arc;

/// A deterministic number in [-1, 1).
fn pseudo(n: usize) -> f64 {
    let hashed = (n as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    (hashed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A part of what the set-up is believed to do, of every parameter.
fn supposed(cause: Arc<dyn Cause>, from: usize) -> Supposed {
    let values = cause.start().into_iter().zip(cause.parameters()).enumerate();
    let values =
        values.map(|(n, (start, p))| start + pseudo(from + n) * p.believed_sd.unwrap_or(p.scale) * 0.5).collect();
    Supposed { cause, values }
}

/// Element size, as a factor on the standard one.
const FINE: f64 = 2.0;
/// Of each part of the set-up every so many parameters are tested.
const EVERY: usize = 4;

/// Parameters of every part of the set-up, all others away from where they start: the change of the prediction is
/// that of two predictions half a hundredth of the parameter's scale to either side.
#[test]
fn the_set_up_changes_predictions_as_its_derivatives_say() {
    let recording = recorded(&material(), &Scene::default(), MESH_FACTOR);
    let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
    let mut laboratory = Laboratory::new(&observed, &MeshOptions::scaled(&observed.specimen, FINE)).unwrap();
    let parts = Registry::standard().set_up(&observed);
    let causes: Vec<Supposed> = parts.into_iter().enumerate().map(|(n, c)| supposed(c, 100 * n)).collect();
    let material = material();
    let never = || false;
    let prediction = laboratory.predict(&material, &scene_of(&causes), &never).unwrap();
    let columns = derivatives(&mut laboratory, &material, &causes, &prediction).unwrap();
    let num_material = material.parameters().len();
    let mut columns = columns.into_iter().skip(num_material);
    for index in 0..causes.len() {
        for (n, p) in causes[index].cause.parameters().iter().enumerate() {
            let column = columns.next().unwrap();
            if n % EVERY != index % EVERY {
                continue;
            }
            let mut at = |t: f64| {
                let mut moved = causes.clone();
                moved[index].values[n] += t * p.scale;
                laboratory.predict(&material, &scene_of(&moved), &never).unwrap().trace
            };
            let difference = at(5e-3).plus(-1.0, &at(-5e-3)).scaled(100.0);
            let off = difference.plus(-1.0, &column).rms_mm() / column.rms_mm();
            println!("{} {}: {off:.4} of {:.5} mm", causes[index].cause.name(), p.name, column.rms_mm());
            // Elements of an eighth of the block's length carry slopes of third and fourth degree but roughly.
            let degree = p.name.split("_depth_").nth(1).map_or(0, |term| term.trim_end_matches("_mm").len());
            let limit = if degree > 2 { 0.1 } else { 0.05 };
            assert!(off < limit, "{} {}: {off}", causes[index].cause.name(), p.name);
        }
    }
}
