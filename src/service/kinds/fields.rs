//! Fields over a recording's voxels as NIfTI artefacts.

use super::RunError;
use crate::calibration::Observed;
use crate::recording::{RecordingError, write_vectors};
use crate::service::problem::Problem;
use crate::service::recordings::Scratch;
use std::collections::BTreeMap;
use std::path::Path;

/// Files that a job leaves: name, media type, bytes.
pub(super) type Artefacts = Vec<(String, String, Vec<u8>)>;

/// Media type of compressed images.
pub(super) const NIFTI: &str = "application/gzip";

/// What `write` leaves in a fresh folder: name and bytes.
///
/// # Errors
/// [`RunError`] where it cannot be written or read back.
pub(super) fn written(
    write: impl FnOnce(&Path) -> Result<(), RecordingError>,
) -> Result<BTreeMap<String, Vec<u8>>, RunError> {
    let failed = |e: String| RunError::from(Problem::new("internal", format!("scratch: {e}")));
    let scratch = Scratch::new()?;
    write(scratch.path()).map_err(|e| failed(e.to_string()))?;
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(scratch.path()).map_err(|e| failed(e.to_string()))? {
        let entry = entry.map_err(|e| failed(e.to_string()))?;
        let bytes = std::fs::read(entry.path()).map_err(|e| failed(e.to_string()))?;
        files.insert(entry.file_name().to_string_lossy().into_owned(), bytes);
    }
    Ok(files)
}

/// Media type by a file's ending.
pub(super) fn media_type(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("gz") => NIFTI,
        Some("json") => "application/json",
        Some("csv") => "text/csv",
        Some("svg") => "image/svg+xml",
        _ => "application/octet-stream",
    }
}

/// Displacement fields (mm) of the compared voxels as images on the recording's grid, NaN elsewhere: name without ending and
/// values in the mask's order.
///
/// # Errors
/// [`RunError`].
pub(super) fn displacement_images(
    observed: &Observed,
    fields: &[(String, &[[f64; 3]])],
    artefacts: &mut Vec<(String, String, Vec<u8>)>,
) -> Result<(), RunError> {
    let grid = &observed.mask.grid;
    let files = written(|folder| {
        for (name, values) in fields {
            let spread = observed.mask.spread(values, [f64::NAN; 3]);
            write_vectors(folder, &format!("{name}.nii.gz"), grid, &spread)?;
        }
        Ok(())
    })?;
    artefacts.extend(files.into_iter().map(|(name, bytes)| (name, NIFTI.to_string(), bytes)));
    Ok(())
}
