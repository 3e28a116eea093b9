//! Raw recordings: wrapped phases and magnitudes, from which displacements are unwrapped.

use super::read::{Head, ReadRecording, check_step, positive, read_scalar};
use super::{Filter, LoadCurve, ReadLimits, RecordingError};
use crate::specimen::Specimen;
use crate::voxel::VoxelGrid;
use std::path::Path;
use std::sync::Arc;

/// A recording as the scanner gives it. The fields are those of [`super::Recording`].
#[derive(Clone, Debug)]
pub struct RawRecording {
    /// Its name.
    pub id: String,
    /// The specimen as drawn.
    pub specimen: Specimen,
    /// The images' grid.
    pub grid: VoxelGrid,
    /// Which voxels hold material, in the grid's order (x fastest).
    pub mask: Vec<bool>,
    /// One step per drive.
    pub steps: Vec<RawStep>,
    /// Noise of a displacement at full signal, per component, mm; `None` where unknown.
    pub noise_sd_mm: Option<[f64; 3]>,
    /// The whole loading history.
    pub load: Option<LoadCurve>,
    /// Free remarks of whoever recorded.
    pub notes: Option<serde_json::Value>,
}

/// One drive of a raw recording.
#[derive(Clone, Debug)]
pub struct RawStep {
    /// What the actuator was told, mm.
    pub drive_mm: f64,
    /// Mean force over the window, all samples together, N.
    pub force_n: Option<f64>,
    /// Standard deviation of the load cell's slow drift, N.
    pub force_sd_n: Option<f64>,
    /// When the scan was made, s: start and end.
    pub window_s: Option<[f64; 2]>,
    /// Phase of each direction, rad in (−π, π], in the grid's order; NaN where missing.
    pub phase: [Vec<f64>; 3],
    /// Magnitude in the scanner's unit, in the grid's order; NaN where missing.
    pub magnitude: Vec<f64>,
    /// Displacement per phase of each direction, mm/rad.
    pub mm_per_radian: [f64; 3],
}

/// Phases stored in single precision may exceed π by this much, rad.
const PHASE_MARGIN: f64 = 1e-5;

impl RawRecording {
    /// Reads the raw recording in `path`: a folder with a `recording.json`, or such a JSON file under another name.
    ///
    /// # Errors
    /// [`RecordingError`], as for [`super::Recording::read`]; [`RecordingError::NotRaw`] where a step holds
    /// displacements.
    pub fn read(path: &Path, limits: &ReadLimits) -> Result<RawRecording, RecordingError> {
        RawRecording::read_with_digest(path, limits).map(|read| read.recording)
    }

    /// As [`RawRecording::read`], with a digest of the files that were read.
    ///
    /// # Errors
    /// See [`RawRecording::read`].
    pub fn read_with_digest(path: &Path, limits: &ReadLimits) -> Result<ReadRecording<RawRecording>, RecordingError> {
        let mut head = Head::read(path, limits)?;
        let mut steps = Vec::with_capacity(head.json.steps.len());
        if head.json.acquisition.filter != Filter::None {
            return Err(RecordingError::Json(
                "acquisition.filter: raw phases are not filtered; it must be none".into(),
            ));
        }
        if head.grid.surface.is_some() {
            let told = "acquisition.surface: cameras measure displacements and no phases; leave it out";
            return Err(RecordingError::Json(told.into()));
        }
        for (n, step) in head.json.steps.iter().enumerate() {
            check_step(n, step, &head.specimen)?;
            let Some(raw) = &step.raw else {
                return Err(RecordingError::NotRaw { step: n + 1 });
            };
            for value in raw.mm_per_radian {
                positive(&format!("steps[{n}].raw.mm_per_radian"), value)?;
            }
            let mut phase = [Vec::new(), Vec::new(), Vec::new()];
            for (axis, name) in raw.phase.iter().enumerate() {
                let values = read_scalar(&mut head.files, name, &head.grid)?;
                if let Some(&value) = values.iter().find(|p| p.abs() > std::f64::consts::PI + PHASE_MARGIN) {
                    return Err(RecordingError::Value {
                        name: name.clone(), value, requirement: "a phase in (−π, π]"
                    });
                }
                phase[axis] = values;
            }
            let magnitude = read_scalar(&mut head.files, &raw.magnitude, &head.grid)?;
            if let Some(&value) = magnitude.iter().find(|m| **m < 0.0) {
                return Err(RecordingError::Value { name: raw.magnitude.clone(), value, requirement: "not negative" });
            }
            let is_measured =
                |v: usize| head.mask[v] && magnitude[v].is_finite() && phase.iter().all(|p| p[v].is_finite());
            if !(0..head.mask.len()).any(is_measured) {
                let num_voxels = head.mask.iter().filter(|m| **m).count();
                return Err(RecordingError::NoDisplacement { step: n + 1, num_voxels });
            }
            steps.push(RawStep {
                drive_mm: step.drive_mm,
                force_n: step.force_n,
                force_sd_n: step.force_sd_n,
                window_s: step.window_s,
                phase,
                magnitude,
                mm_per_radian: raw.mm_per_radian,
            });
        }
        let recording = RawRecording {
            id: head.json.id,
            specimen: head.specimen,
            grid: head.grid,
            mask: head.mask,
            steps,
            noise_sd_mm: head.noise_sd_mm,
            load: head.load,
            notes: head.json.notes,
        };
        let (digest, memory) = head.files.finish();
        Ok(ReadRecording { recording, digest, memory: Arc::new(memory) })
    }

    /// Number of voxels in the mask.
    pub fn num_voxels(&self) -> usize {
        self.mask.iter().filter(|m| **m).count()
    }
}
