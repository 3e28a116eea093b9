//! Reading a recording's folder.

use super::folder::FolderReader;
use super::nifti::{INTENT_DISPLACEMENT, Image, NiftiError};
use super::position::check_position;
use super::{Filter, LoadCurve, ReadLimits, RecordedStep, Recording, RecordingError};
use crate::file::ReadingMemory;
use crate::specimen::Specimen;
use crate::voxel::{Surface, VoxelError, VoxelGrid, unbounded_where_unmeasured};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

/// The schema that this version reads and writes.
pub const SCHEMA: &str = "mru-recording/1";
/// Grids of two images agree to this part of a voxel: their affines are stored in single precision.
const GRID_TOLERANCE: f64 = 1e-3;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RecordingJson {
    pub(super) schema: String,
    pub(super) id: String,
    pub(super) specimen: serde_json::Value,
    pub(super) steps: Vec<StepJson>,
    pub(super) mask: String,
    pub(super) acquisition: AcquisitionJson,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) load: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) notes: Option<serde_json::Value>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StepJson {
    pub(super) drive_mm: f64,
    #[serde(default)]
    pub(super) force_n: Option<f64>,
    #[serde(default)]
    pub(super) force_sd_n: Option<f64>,
    #[serde(default)]
    pub(super) window_s: Option<[f64; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) displacement: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) raw: Option<RawJson>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawJson {
    pub(super) phase: [String; 3],
    pub(super) magnitude: String,
    pub(super) mm_per_radian: [f64; 3],
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AcquisitionJson {
    pub(super) voxel_mm: [f64; 3],
    /// Null of a component that is not measured.
    #[serde(default)]
    pub(super) noise_sd_mm: Option<[Option<f64>; 3]>,
    #[serde(default)]
    pub(super) filter: Filter,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) surface: Option<Surface>,
}

impl AcquisitionJson {
    /// The noise, where it is stated: of every component that is measured.
    fn noise_sd_mm(&self) -> Result<Option<[f64; 3]>, RecordingError> {
        let measured = self.surface.map_or([true; 3], Surface::measured);
        let Some(stated) = self.noise_sd_mm else { return Ok(None) };
        let mut sd_mm = [0.0; 3];
        for ((sd, value), _) in sd_mm.iter_mut().zip(stated).zip(measured).filter(|(_, is_measured)| *is_measured) {
            *sd = value.unwrap_or(f64::NAN);
            positive("acquisition.noise_sd_mm", *sd)?;
        }
        Ok(Some(unbounded_where_unmeasured(measured, sd_mm)))
    }
}

/// A recording with a digest of the files that it was read from.
#[derive(Clone, Debug)]
pub struct ReadRecording<T = Recording> {
    /// The recording.
    pub recording: T,
    /// SHA-256, hexadecimal, over name and content of every file that was read: `recording.json`, mask, load curve and
    /// images. Other files of the folder do not enter.
    pub digest: String,
    /// The memory that it holds, given back when all copies of this are dropped.
    pub memory: Arc<ReadingMemory>,
}

impl Recording {
    /// Reads the recording in `path`: a folder with a `recording.json`, or such a JSON file under another name.
    ///
    /// # Errors
    /// [`RecordingError`]: a file that is missing, damaged, too large or not of the format; [`RecordingError::Raw`]
    /// where the steps hold wrapped phases (read those as [`super::RawRecording`]).
    pub fn read(path: &Path, limits: &ReadLimits) -> Result<Recording, RecordingError> {
        Recording::read_with_digest(path, limits).map(|read| read.recording)
    }

    /// As [`Recording::read`], with a digest of the files that were read.
    ///
    /// # Errors
    /// See [`Recording::read`].
    pub fn read_with_digest(path: &Path, limits: &ReadLimits) -> Result<ReadRecording, RecordingError> {
        let mut head = Head::read(path, limits)?;
        let num_voxels = head.mask.iter().filter(|m| **m).count();
        let mut steps = Vec::with_capacity(head.json.steps.len());
        for (n, step) in head.json.steps.iter().enumerate() {
            check_step(n, step, &head.specimen)?;
            let Some(name) = &step.displacement else {
                return Err(RecordingError::Raw { step: n + 1 });
            };
            let mut displacement = read_displacement(&mut head.files, name, &head.grid)?;
            head.grid.fill_unmeasured(&mut displacement, f64::NAN);
            let is_measured = |(m, u): (&bool, &[f64; 3])| *m && head.grid.is_complete(u);
            if !head.mask.iter().zip(&displacement).any(is_measured) {
                return Err(RecordingError::NoDisplacement { step: n + 1, num_voxels });
            }
            steps.push(RecordedStep {
                drive_mm: step.drive_mm,
                force_n: step.force_n,
                force_sd_n: step.force_sd_n,
                window_s: step.window_s,
                displacement,
            });
        }
        let recording = Recording {
            id: head.json.id,
            specimen: head.specimen,
            grid: head.grid,
            mask: head.mask,
            steps,
            noise_sd_mm: head.noise_sd_mm,
            filter: head.json.acquisition.filter,
            load: head.load,
            notes: head.json.notes,
        };
        recording.check_motion()?;
        let (digest, memory) = head.files.finish();
        Ok(ReadRecording { recording, digest, memory: Arc::new(memory) })
    }
}

/// What recordings of both kinds share.
pub(super) struct Head<'a> {
    pub(super) files: FolderReader<'a>,
    pub(super) json: RecordingJson,
    pub(super) specimen: Specimen,
    pub(super) grid: VoxelGrid,
    pub(super) mask: Vec<bool>,
    pub(super) noise_sd_mm: Option<[f64; 3]>,
    pub(super) load: Option<LoadCurve>,
}

impl<'a> Head<'a> {
    pub(super) fn read(path: &Path, limits: &'a ReadLimits) -> Result<Head<'a>, RecordingError> {
        let (folder, name) = if path.is_file() {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            (path.parent().unwrap_or(Path::new("")), name)
        } else {
            (path, "recording.json".to_string())
        };
        let mut files = FolderReader::new(folder, limits);
        let text = files.json_text(&name)?;
        let json: RecordingJson = serde_json::from_str(&text).map_err(|e| RecordingError::Json(e.to_string()))?;
        if json.schema != SCHEMA {
            return Err(RecordingError::Json(format!("schema is '{}'; this version reads {SCHEMA}", json.schema)));
        }
        if json.steps.is_empty() || json.steps.len() > limits.max_steps {
            let value = json.steps.len() as f64;
            return Err(RecordingError::Value {
                name: "the number of steps".into(),
                value,
                requirement: "at least one and not above the limit",
            });
        }
        let specimen = Specimen::from_json(&json.specimen.to_string())?;
        let mask_image = files.image(&json.mask)?;
        let grid = match grid_of(&mask_image, [1, 1]) {
            Ok(grid) => grid?,
            Err(source) => return Err(RecordingError::Image { path: files.path(&json.mask)?, source }),
        };
        let grid = match json.acquisition.surface {
            Some(_) if json.acquisition.filter != Filter::None => return Err(VoxelError::FilteredSurface.into()),
            Some(surface) => grid.on_surface(&specimen, surface)?,
            None => grid,
        };
        let (stated_mm, found_mm) = (json.acquisition.voxel_mm, grid.voxel_mm);
        if (0..3).any(|a| !((stated_mm[a] / found_mm[a] - 1.0).abs() <= GRID_TOLERANCE)) {
            return Err(RecordingError::VoxelMismatch { stated_mm, found_mm });
        }
        let mut mask: Vec<bool> = files.memory().list("the mask", mask_image.values.len() as u64)?;
        mask.extend(mask_image.values.iter().map(|v| *v > 0.5));
        files.memory().give_back_values::<f64>(mask_image.values.len());
        drop(mask_image);
        if !mask.contains(&true) {
            return Err(RecordingError::EmptyMask);
        }
        check_position(&specimen, &grid, &mask)?;
        let noise_sd_mm = json.acquisition.noise_sd_mm()?;
        let load = match &json.load {
            None => None,
            Some(name) => {
                let text = files.text(name)?;
                // Three numbers stand in six characters at least, and a list that grows is there twice.
                files.memory().take("the load curve", 8 * text.len() as u64)?;
                Some(LoadCurve::from_csv(&text, &files.path(name)?)?)
            }
        };
        Ok(Head { files, json, specimen, grid, mask, noise_sd_mm, load })
    }
}

pub(super) fn check_step(n: usize, step: &StepJson, specimen: &Specimen) -> Result<(), RecordingError> {
    if !specimen.supports_drive(step.drive_mm) {
        let limit_mm = specimen.drive_limit_mm();
        return Err(RecordingError::Drive { step: n, drive_mm: step.drive_mm, limit_mm });
    }
    if step.displacement.is_some() && step.raw.is_some() {
        return Err(RecordingError::TwoKinds { step: n });
    }
    let finite = |name: &str, value: f64| {
        let name = format!("steps[{n}].{name}");
        if value.is_finite() { Ok(()) } else { Err(RecordingError::Value { name, value, requirement: "finite" }) }
    };
    step.force_n.map_or(Ok(()), |f| finite("force_n", f))?;
    step.force_sd_n.map_or(Ok(()), |sd| positive(&format!("steps[{n}].force_sd_n"), sd))?;
    if let Some([start, end]) = step.window_s
        && !(start < end)
    {
        let name = format!("steps[{n}].window_s");
        return Err(RecordingError::Value { name, value: end, requirement: "after its start" });
    }
    Ok(())
}

pub(super) fn positive(name: &str, value: f64) -> Result<(), RecordingError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(RecordingError::Value { name: name.into(), value, requirement: "positive and finite" })
    }
}

/// The grid of an image with `[time points, components]`.
fn grid_of(image: &Image, [time, components]: [usize; 2]) -> Result<Result<VoxelGrid, RecordingError>, NiftiError> {
    let [nx, ny, nz, t, c] = image.shape;
    if [t, c] != [time, components] {
        return Err(NiftiError::Shape { found: image.shape, expected_time: time, expected_components: components });
    }
    let edges = [0, 1, 2].map(|a| image.affine[a][a]);
    for i in 0..3 {
        for j in 0..3 {
            let is_off = i != j && !(image.affine[i][j].abs() <= 1e-4 * edges[i].abs().max(1e-12));
            if is_off || !(edges[i] > 0.0) {
                return Err(NiftiError::Orientation);
            }
        }
    }
    let origin = [0, 1, 2].map(|a| image.affine[a][3]);
    Ok(VoxelGrid::new(origin, edges, [nx, ny, nz]).map_err(RecordingError::from))
}

/// A scalar image on the mask's grid.
pub(super) fn read_scalar(
    files: &mut FolderReader,
    name: &str,
    expected: &VoxelGrid,
) -> Result<Vec<f64>, RecordingError> {
    let image = files.image(name)?;
    check_grid(&files.path(name)?, &image, [1, 1], expected)?;
    Ok(image.values)
}

fn check_grid(path: &Path, image: &Image, kind: [usize; 2], expected: &VoxelGrid) -> Result<(), RecordingError> {
    let grid = match grid_of(image, kind) {
        Ok(grid) => grid?,
        Err(source) => return Err(RecordingError::Image { path: path.into(), source }),
    };
    let is_near = (0..3).all(|a| {
        let edge = expected.voxel_mm[a];
        (grid.origin_mm[a] - expected.origin_mm[a]).abs() < GRID_TOLERANCE * edge
            && (grid.voxel_mm[a] - edge).abs() < GRID_TOLERANCE * edge
    });
    if grid.shape != expected.shape || !is_near {
        let words = |g: &VoxelGrid| format!("{:?} at {:?} mm, voxel {:?} mm", g.shape, g.origin_mm, g.voxel_mm);
        return Err(RecordingError::Grid { path: path.into(), found: words(&grid), expected: words(expected) });
    }
    Ok(())
}

fn read_displacement(
    files: &mut FolderReader,
    name: &str,
    expected: &VoxelGrid,
) -> Result<Vec<[f64; 3]>, RecordingError> {
    let (image, path) = (files.image(name)?, files.path(name)?);
    if image.intent != INTENT_DISPLACEMENT {
        return Err(RecordingError::Image { path, source: NiftiError::Intent { found: image.intent } });
    }
    check_grid(&path, &image, [1, 3], expected)?;
    let n = expected.num_voxels();
    let mut displacement: Vec<[f64; 3]> = files.memory().list("a displacement", n as u64)?;
    displacement.extend((0..n).map(|v| [0, 1, 2].map(|c| image.values[v + c * n])));
    files.memory().give_back_values::<f64>(image.values.len());
    Ok(displacement)
}

#[cfg(test)]
#[path = "read_tests.rs"]
mod tests;
