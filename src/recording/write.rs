//! Writing a recording's folder.

use super::nifti::{INTENT_DISPLACEMENT, Image, Samples};
use super::read::{AcquisitionJson, RawJson, RecordingJson, SCHEMA, StepJson};
use super::{Filter, LoadCurve, RawRecording, Recording, RecordingError, stated_noise};
use crate::specimen::Specimen;
use crate::voxel::VoxelGrid;
use std::fs;
use std::io::BufWriter;
use std::path::Path;

impl Recording {
    /// Writes the recording into `folder`, which is made where it does not exist.
    ///
    /// # Errors
    /// [`RecordingError::File`].
    pub fn write(&self, folder: &Path) -> Result<(), RecordingError> {
        make(folder)?;
        let mut steps = Vec::with_capacity(self.steps.len());
        for (n, step) in self.steps.iter().enumerate() {
            let name = format!("u_{}.nii.gz", n + 1);
            write_vectors(folder, &name, &self.grid, &step.displacement)?;
            steps.push(StepJson {
                drive_mm: step.drive_mm,
                force_n: step.force_n,
                force_sd_n: step.force_sd_n,
                window_s: step.window_s,
                displacement: Some(name),
                raw: None,
            });
        }
        let rest = Rest {
            id: &self.id,
            specimen: &self.specimen,
            grid: &self.grid,
            mask: &self.mask,
            noise_sd_mm: self.noise_sd_mm,
            filter: self.filter,
            load: self.load.as_ref(),
            notes: self.notes.as_ref(),
        };
        rest.write(folder, steps)
    }
}

impl RawRecording {
    /// Writes the recording into `folder`, which is made where it does not exist.
    ///
    /// # Errors
    /// [`RecordingError::File`].
    pub fn write(&self, folder: &Path) -> Result<(), RecordingError> {
        make(folder)?;
        let mut steps = Vec::with_capacity(self.steps.len());
        for (n, step) in self.steps.iter().enumerate() {
            let phase = ["x", "y", "z"].map(|axis| format!("p{axis}_{}.nii.gz", n + 1));
            let magnitude = format!("mag_{}.nii.gz", n + 1);
            for (name, values) in phase.iter().zip(&step.phase) {
                write_scalars(folder, name, &self.grid, values)?;
            }
            write_scalars(folder, &magnitude, &self.grid, &step.magnitude)?;
            steps.push(StepJson {
                drive_mm: step.drive_mm,
                force_n: step.force_n,
                force_sd_n: step.force_sd_n,
                window_s: step.window_s,
                displacement: None,
                raw: Some(RawJson { phase, magnitude, mm_per_radian: step.mm_per_radian }),
            });
        }
        let rest = Rest {
            id: &self.id,
            specimen: &self.specimen,
            grid: &self.grid,
            mask: &self.mask,
            noise_sd_mm: self.noise_sd_mm,
            filter: Filter::None,
            load: self.load.as_ref(),
            notes: self.notes.as_ref(),
        };
        rest.write(folder, steps)
    }
}

/// What both kinds of recording share.
struct Rest<'a> {
    id: &'a str,
    specimen: &'a Specimen,
    grid: &'a VoxelGrid,
    mask: &'a [bool],
    noise_sd_mm: Option<[f64; 3]>,
    filter: Filter,
    load: Option<&'a LoadCurve>,
    notes: Option<&'a serde_json::Value>,
}

impl Rest<'_> {
    fn write(&self, folder: &Path, steps: Vec<StepJson>) -> Result<(), RecordingError> {
        let mask = self.mask.iter().map(|m| f64::from(u8::from(*m))).collect();
        write_image(folder, "mask.nii.gz", self.grid, [1, 0], mask, Samples::Uint8)?;
        if let Some(load) = self.load {
            write_file(&folder.join("load.csv"), load.to_csv().as_bytes())?;
        }
        let specimen = serde_json::to_value(self.specimen).map_err(|e| RecordingError::Json(e.to_string()))?;
        let json = RecordingJson {
            schema: SCHEMA.into(),
            id: self.id.into(),
            specimen,
            steps,
            mask: "mask.nii.gz".into(),
            acquisition: AcquisitionJson {
                voxel_mm: self.grid.voxel_mm,
                noise_sd_mm: self.noise_sd_mm.map(stated_noise),
                filter: self.filter,
                surface: self.grid.surface,
            },
            load: self.load.is_some().then(|| "load.csv".into()),
            notes: self.notes.cloned(),
        };
        let text = serde_json::to_string_pretty(&json).map_err(|e| RecordingError::Json(e.to_string()))?;
        write_file(&folder.join("recording.json"), text.as_bytes())
    }
}

/// Writes one vector per voxel (grid order) as a displacement image, float32.
///
/// # Errors
/// [`RecordingError::File`].
pub fn write_vectors(folder: &Path, name: &str, grid: &VoxelGrid, vectors: &[[f64; 3]]) -> Result<(), RecordingError> {
    let values = (0..3).flat_map(|c| vectors.iter().map(move |u| u[c])).collect();
    write_image(folder, name, grid, [3, INTENT_DISPLACEMENT as usize], values, Samples::Float32)
}

/// Writes one number per voxel (grid order), float32.
///
/// # Errors
/// [`RecordingError::File`].
pub fn write_scalars(folder: &Path, name: &str, grid: &VoxelGrid, values: &[f64]) -> Result<(), RecordingError> {
    write_image(folder, name, grid, [1, 0], values.to_vec(), Samples::Float32)
}

fn write_image(
    folder: &Path,
    name: &str,
    grid: &VoxelGrid,
    [components, intent]: [usize; 2],
    values: Vec<f64>,
    samples: Samples,
) -> Result<(), RecordingError> {
    let [nx, ny, nz] = grid.shape;
    let path = folder.join(name);
    if let Some(&longest) = grid.shape.iter().max()
        && longest > i16::MAX as usize
    {
        let value = longest as f64;
        return Err(RecordingError::Value {
            name: format!("{}: the number of voxels along an axis", path.display()),
            value,
            requirement: "at most 32767 in NIfTI-1",
        });
    }
    let mut affine = [[0.0; 4]; 3];
    for a in 0..3 {
        affine[a][a] = grid.voxel_mm[a];
        affine[a][3] = grid.origin_mm[a];
    }
    let image = Image { shape: [nx, ny, nz, 1, components], affine, intent: intent as i16, values, unit_mm: Some(1.0) };
    let result = fs::File::create(&path).and_then(|file| image.write_gz(BufWriter::new(file), samples));
    result.map_err(|source| RecordingError::File { path, source })
}

fn make(folder: &Path) -> Result<(), RecordingError> {
    fs::create_dir_all(folder).map_err(|source| RecordingError::File { path: folder.into(), source })
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), RecordingError> {
    fs::write(path, bytes).map_err(|source| RecordingError::File { path: path.into(), source })
}
