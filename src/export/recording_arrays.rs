//! The arrays of a recording: displacements, or phases and magnitudes, on its voxels, with drives and forces.

use super::arrays::{Tree, or_nan};
use super::voxel_arrays::{add_grid, scalar_axes, vector_axes, vectors};
use crate::recording::{LoadCurve, RawRecording, Recording};
use crate::specimen::Specimen;

/// The arrays of a recording of displacements.
pub fn recording_arrays(recording: &Recording) -> Tree {
    let (grid, steps) = (&recording.grid, &recording.steps);
    let mut tree = head(&recording.id, &recording.specimen);
    let states = steps.iter().map(|s| State {
        drive_mm: s.drive_mm,
        force_n: s.force_n,
        force_sd_n: s.force_sd_n,
        window_s: s.window_s,
    });
    add_states(&mut tree, states.collect());
    add_grid(&mut tree, grid, recording.mask.clone());
    if let Some(surface) = grid.surface {
        tree.text("face", surface.face.name());
    }
    let displacement = vectors(steps.iter().map(|s| &s.displacement[..]));
    let about = "displacement u of the voxel, or of the subset of the face; NaN where missing or not measured";
    tree.array("displacement_mm", "mm", about, &vector_axes(grid, steps.len()), displacement);
    add_noise(&mut tree, recording.noise_sd_mm);
    add_load(&mut tree, recording.load.as_ref());
    tree
}

/// The arrays of a recording of wrapped phases.
pub fn raw_recording_arrays(recording: &RawRecording) -> Tree {
    let (grid, steps) = (&recording.grid, &recording.steps);
    let mut tree = head(&recording.id, &recording.specimen);
    let states = steps.iter().map(|s| State {
        drive_mm: s.drive_mm,
        force_n: s.force_n,
        force_sd_n: s.force_sd_n,
        window_s: s.window_s,
    });
    add_states(&mut tree, states.collect());
    add_grid(&mut tree, grid, recording.mask.clone());
    let phases = steps.iter().flat_map(|s| s.phase.concat()).collect::<Vec<f64>>();
    let about = "wrapped phase of each direction, above -pi and at most pi";
    tree.array("phase_rad", "rad", about, &vector_axes(grid, steps.len()), phases);
    let magnitudes = steps.iter().flat_map(|s| s.magnitude.iter().copied()).collect::<Vec<f64>>();
    tree.array("magnitude", "1", "magnitude in the scanner's unit", &scalar_axes(grid, steps.len()), magnitudes);
    let slopes = steps.iter().flat_map(|s| s.mm_per_radian).collect::<Vec<f64>>();
    let axes = [("component", 3), ("drive", steps.len())];
    tree.array("mm_per_radian", "mm/rad", "displacement per phase", &axes, slopes);
    add_noise(&mut tree, recording.noise_sd_mm);
    add_load(&mut tree, recording.load.as_ref());
    tree
}

/// What is known of a step beside its images.
struct State {
    drive_mm: f64,
    force_n: Option<f64>,
    force_sd_n: Option<f64>,
    window_s: Option<[f64; 2]>,
}

fn head(id: &str, specimen: &Specimen) -> Tree {
    let mut tree = Tree::default();
    tree.text("id", id);
    tree.text("specimen_json", specimen.to_json());
    tree
}

fn add_states(tree: &mut Tree, states: Vec<State>) {
    let drives = [("drive", states.len())];
    tree.array("drive_mm", "mm", "drive", &drives, states.iter().map(|s| s.drive_mm).collect::<Vec<_>>());
    let forces = or_nan(states.iter().map(|s| s.force_n));
    tree.array("force_n", "N", "mean force, all samples together; NaN where not recorded", &drives, forces);
    let about = "standard deviation of the force; NaN where unknown";
    tree.array("force_sd_n", "N", about, &drives, or_nan(states.iter().map(|s| s.force_sd_n)));
    let windows = or_nan(states.iter().flat_map(|s| s.window_s.map_or([None; 2], |w| w.map(Some))));
    let axes = [("start_end", 2), ("drive", states.len())];
    tree.array("window_s", "s", "when the scan was made; NaN where unknown", &axes, windows);
}

fn add_noise(tree: &mut Tree, noise_sd_mm: Option<[f64; 3]>) {
    if let Some(sd) = noise_sd_mm {
        let about = "standard deviation of a displacement";
        tree.array("noise_sd_mm", "mm", about, &[("component", 3)], sd.to_vec());
    }
}

fn add_load(tree: &mut Tree, load: Option<&LoadCurve>) {
    let Some(load) = load.filter(|l| !l.time_s.is_empty()) else { return };
    let times = [("time", load.time_s.len())];
    let mut history = Tree::default();
    history.array("time_s", "s", "time", &times, load.time_s.clone());
    history.array("drive_mm", "mm", "drive", &times, load.drive_mm.clone());
    history.array("force_n", "N", "force, all samples together", &times, load.force_n.clone());
    tree.tree("load", history);
}
