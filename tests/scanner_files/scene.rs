//! A synthetic scan by the program's own code, laid into a scanner in some orientation.

use lambdak::job::{InputFile, Job, JobError, Progress, Surroundings, kind_of_command};
use lambdak::recording::{RawRecording, ReadLimits, ReadRecording, Recording};
use lambdak::voxel::VoxelGrid;
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// Air around the sample, voxels.
const BORDER: usize = 2;
/// Steps of a turn in the files that are written: 12 bits.
pub const LEVELS: f64 = 4096.0;
/// Full signal in the files that are written.
const FULL: f64 = 3500.0;

struct Nothing;

impl Surroundings for Nothing {
    fn recording(&self, name: &str) -> Result<ReadRecording, JobError> {
        Err(JobError::Unreadable { name: name.into(), message: "there is none".into() })
    }

    fn raw_recording(&self, name: &str) -> Result<ReadRecording<RawRecording>, JobError> {
        Err(JobError::Unreadable { name: name.into(), message: "there is none".into() })
    }

    fn file(&self, name: &str) -> Result<InputFile, JobError> {
        Err(JobError::Unreadable { name: name.into(), message: "there is none".into() })
    }

    fn progress(&self, _: &Progress) {}

    fn is_cancelled(&self) -> bool {
        false
    }

    fn checkpoint(&self, _: &str) -> Option<PathBuf> {
        None
    }
}

pub fn specimen() -> Value {
    serde_json::from_str(include_str!("../../geometries/solid-shear.json")).unwrap()
}

/// A scan of a solid block at two drives on a coarse mesh, raw and unwrapped; the folders hold `load.csv`, too.
pub fn scanned(folder: &Path) -> (RawRecording, Recording) {
    let made = |is_raw: bool| {
        let request = json!({
            "specimen": specimen(), "drive_mm": [1.0, 2.0], "mesh": "4", "voxel_mm": [2.0, 0.8, 2.0], "seed": 3,
            "snr": [60.0, 60.0, 60.0], "mm_per_radian": [0.2, 0.1, 0.15], "is_raw": is_raw,
        });
        let job: Job = kind_of_command("scan").unwrap().job(&request).unwrap();
        let place = folder.join(if is_raw { "raw" } else { "unwrapped" });
        std::fs::create_dir_all(&place).unwrap();
        for (name, bytes) in lambdak::job::run(&job, &Nothing).unwrap().recording() {
            std::fs::write(place.join(name), bytes).unwrap();
        }
        place
    };
    let limits = ReadLimits::default();
    let mut raw = RawRecording::read(&made(true), &limits).unwrap();
    let mut unwrapped = Recording::read(&made(false), &limits).unwrap();
    // A scan has air around the sample; an import keeps the box of the mask.
    let (grid, kept) = box_of_mask(&raw.grid, &raw.mask);
    let cut = |values: &[f64]| -> Vec<f64> { kept.iter().map(|&v| values[v]).collect() };
    for step in &mut raw.steps {
        step.phase = [0, 1, 2].map(|c| cut(&step.phase[c]));
        step.magnitude = cut(&step.magnitude);
    }
    for step in &mut unwrapped.steps {
        step.displacement = kept.iter().map(|&v| step.displacement[v]).collect();
    }
    raw.mask = kept.iter().map(|&v| raw.mask[v]).collect();
    (unwrapped.mask, unwrapped.grid, raw.grid) = (raw.mask.clone(), grid.clone(), grid);
    (raw, unwrapped)
}

/// The grid of the box around a mask, and where its voxels lie in the old one.
fn box_of_mask(grid: &VoxelGrid, mask: &[bool]) -> (VoxelGrid, Vec<usize>) {
    let inside: Vec<[usize; 3]> = (0..mask.len()).filter(|&v| mask[v]).map(|v| grid.indices(v)).collect();
    let low = [0, 1, 2].map(|a| inside.iter().map(|n| n[a]).min().unwrap());
    let high = [0, 1, 2].map(|a| inside.iter().map(|n| n[a] + 1).max().unwrap());
    let shape = [0, 1, 2].map(|a| high[a] - low[a]);
    let origin = [0, 1, 2].map(|a| grid.origin_mm[a] + low[a] as f64 * grid.voxel_mm[a]);
    let cut = VoxelGrid::new(origin, grid.voxel_mm, shape).unwrap();
    let places = (0..cut.num_voxels()).map(|v| {
        let n = cut.indices(v);
        grid.index([0, 1, 2].map(|a| n[a] + low[a]))
    });
    let kept = places.collect();
    (cut, kept)
}

/// Along which axis an index runs, and whether backwards.
pub type Along = (usize, bool);

/// How the images lie: the specimen's axis along each of the image's indices, and the specimen's axis along each axis
/// of the patient (right, front, head).
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    pub index: [Along; 3],
    pub patient: [Along; 3],
}

pub const PLAIN: Pose =
    Pose { index: [(0, false), (1, false), (2, false)], patient: [(0, false), (1, false), (2, false)] };

/// A volume of stored numbers with its place in the scanner.
#[derive(Clone)]
pub struct Stored {
    pub size: [usize; 3],
    pub edges: [f64; 3],
    /// Directions of the three indices in the patient's frame (LPS).
    pub directions: [[f64; 3]; 3],
    /// Centre of the first voxel (LPS), mm.
    pub origin: [f64; 3],
    /// First index fastest.
    pub values: Vec<u16>,
}

impl Stored {
    /// Numbers of the slice `k` and the centre of its first voxel.
    pub fn slice(&self, k: usize) -> (&[u16], [f64; 3]) {
        let n = self.size[0] * self.size[1];
        let at = [0, 1, 2].map(|c| self.origin[c] + k as f64 * self.edges[2] * self.directions[2][c]);
        (&self.values[k * n..(k + 1) * n], at)
    }
}

/// Repeatable numbers in [0, 1).
fn noise(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*state >> 33) as f64 / (1u64 << 31) as f64
}

/// The phase x, y, z (0, 1, 2) or the magnitude (3) of a step as a scanner would store it: 12 bits, noise around the
/// sample.
pub fn stored(raw: &RawRecording, step: usize, which: usize, pose: Pose) -> Stored {
    let step_values = &raw.steps[step];
    let full = step_values.magnitude.iter().copied().filter(|m| m.is_finite()).fold(0.0, f64::max);
    let size = pose.index.map(|(axis, _)| raw.grid.shape[axis] + 2 * BORDER);
    let edges = pose.index.map(|(axis, _)| raw.grid.voxel_mm[axis]);
    // The patient's frame is RAS here: each of its axes runs along one of the specimen's.
    let directions = pose.index.map(|(axis, is_back)| {
        let patient = pose.patient.iter().position(|p| p.0 == axis).unwrap();
        let is_back = is_back != pose.patient[patient].1;
        let mut ras = [0.0; 3];
        ras[patient] = if is_back { -1.0 } else { 1.0 };
        [-ras[0], -ras[1], ras[2]]
    });
    let mut state = (97 * step + which) as u64 + 1;
    let mut values = Vec::new();
    for n in 0..size.iter().product::<usize>() {
        let at = [n % size[0], n / size[0] % size[1], n / (size[0] * size[1])];
        let mut inside = [0usize; 3];
        let mut is_air = false;
        for (i, (axis, is_back)) in pose.index.into_iter().enumerate() {
            let along = if is_back { size[i] - 1 - at[i] } else { at[i] };
            is_air |= along < BORDER || along >= size[i] - BORDER;
            inside[axis] = along.saturating_sub(BORDER).min(raw.grid.shape[axis] - 1);
        }
        let v = raw.grid.index(inside);
        let value = match which {
            3 if is_air => 0.05 * FULL * noise(&mut state),
            3 => Some(step_values.magnitude[v]).filter(|m| m.is_finite()).unwrap_or(0.0) / full * FULL,
            _ if is_air => LEVELS * noise(&mut state),
            _ => {
                let phase = Some(step_values.phase[which][v]).filter(|p| p.is_finite()).unwrap_or(0.0);
                // Half a turn up is half a turn down.
                ((phase + PI) / (2.0 * PI) * LEVELS).round() % LEVELS
            }
        };
        values.push(value.min(LEVELS - 1.0) as u16);
    }
    Stored { size, edges, directions, origin: [12.5, -3.0, 40.0], values }
}

/// A folder with all that is needed for steps of three phases and a magnitude; `name` gives series and volume.
pub fn series_map(raw: &RawRecording, name: impl Fn(usize, usize) -> (String, usize)) -> Value {
    let steps: Vec<Value> = raw
        .steps
        .iter()
        .enumerate()
        .map(|(n, step)| {
            let at = |which: usize| {
                let (series, volume) = name(n, which);
                json!({ "series": series, "volume": volume })
            };
            json!({
                "drive_mm": step.drive_mm, "mm_per_radian": step.mm_per_radian, "x": at(0), "y": at(1), "z": at(2),
                "magnitude": at(3),
            })
        })
        .collect();
    json!({ "steps": steps })
}
