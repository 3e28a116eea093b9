//! Writing a recording's folder.

use super::nifti::{INTENT_DISPLACEMENT, Image, Samples};
use super::read::{AcquisitionJson, RecordingJson, SCHEMA, StepJson};
use super::{Recording, RecordingError};
use std::fs;
use std::io::BufWriter;
use std::path::Path;

impl Recording {
    /// Writes the recording into `folder`, which is made where it does not exist.
    ///
    /// # Errors
    /// [`RecordingError::File`].
    pub fn write(&self, folder: &Path) -> Result<(), RecordingError> {
        fs::create_dir_all(folder).map_err(|source| RecordingError::File { path: folder.into(), source })?;
        let mask = self.mask.iter().map(|m| f64::from(u8::from(*m))).collect();
        self.write_image(folder, "mask.nii.gz", 1, 0, mask, Samples::Uint8)?;
        let mut steps = Vec::with_capacity(self.steps.len());
        for (n, step) in self.steps.iter().enumerate() {
            let name = format!("u_{}.nii.gz", n + 1);
            let values = (0..3).flat_map(|c| step.displacement.iter().map(move |u| u[c])).collect();
            self.write_image(folder, &name, 3, INTENT_DISPLACEMENT, values, Samples::Float32)?;
            steps.push(StepJson {
                drive_mm: step.drive_mm,
                force_n: step.force_n,
                force_sd_n: step.force_sd_n,
                window_s: step.window_s,
                displacement: Some(name),
                raw: None,
            });
        }
        if let Some(load) = &self.load {
            write_file(&folder.join("load.csv"), load.to_csv().as_bytes())?;
        }
        let specimen = serde_json::to_value(&self.specimen).map_err(|e| RecordingError::Json(e.to_string()))?;
        let json = RecordingJson {
            schema: SCHEMA.into(),
            id: self.id.clone(),
            specimen,
            steps,
            mask: "mask.nii.gz".into(),
            acquisition: AcquisitionJson {
                voxel_mm: self.grid.voxel_mm,
                noise_sd_mm: self.noise_sd_mm,
                filter: self.filter,
            },
            load: self.load.is_some().then(|| "load.csv".into()),
            notes: self.notes.clone(),
        };
        let text = serde_json::to_string_pretty(&json).map_err(|e| RecordingError::Json(e.to_string()))?;
        write_file(&folder.join("recording.json"), text.as_bytes())
    }

    fn write_image(
        &self,
        folder: &Path,
        name: &str,
        components: usize,
        intent: i16,
        values: Vec<f64>,
        samples: Samples,
    ) -> Result<(), RecordingError> {
        let [nx, ny, nz] = self.grid.shape;
        let mut affine = [[0.0; 4]; 3];
        for a in 0..3 {
            affine[a][a] = self.grid.voxel_mm[a];
            affine[a][3] = self.grid.origin_mm[a];
        }
        let image = Image { shape: [nx, ny, nz, 1, components], affine, intent, values };
        let path = folder.join(name);
        let result = fs::File::create(&path).and_then(|file| image.write_gz(BufWriter::new(file), samples));
        result.map_err(|source| RecordingError::File { path, source })
    }
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), RecordingError> {
    fs::write(path, bytes).map_err(|source| RecordingError::File { path: path.into(), source })
}
