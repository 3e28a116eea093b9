//! The part of an import that reads the files of a scanner.

use crate::field::FieldError;
use crate::file::{ReadingMemory, files_below};
use crate::recording::{
    DicomFiles, ImportError, ImportOptions, ParavisionStudy, ReadLimits, ScannerError, SeriesLine, SeriesMap,
    VolumeReader,
};
use crate::specimen::Specimen;
use std::path::PathBuf;

/// What is wrong with a list of series for this specimen.
pub(super) fn check_series(map: &SeriesMap, specimen: Option<&Specimen>, errors: &mut Vec<FieldError>) {
    if let Some(axes) = map.scanner_axes.as_ref().filter(|axes| ImportOptions::parse_axes(axes).is_none()) {
        let allowed = "x, y and z once each, such as y,z,x or -y,z,-x";
        errors.push(FieldError::new("/series/scanner_axes", format!("{axes:?}"), allowed));
    }
    let sound = specimen.filter(|s| s.field_errors().is_empty());
    for (n, step) in map.steps.iter().enumerate() {
        let at = |field: &str| format!("/series/steps/{n}/{field}");
        if let Some(specimen) = sound.filter(|s| !s.supports_drive(step.drive_mm)) {
            let limit_mm = specimen.drive_limit_mm();
            let allowed = format!("from 0 (excluded) to {limit_mm:.4}, what is supported for this specimen");
            errors.push(FieldError::new(at("drive_mm"), step.drive_mm, allowed));
        }
        for (axis, value) in step.mm_per_radian.into_iter().enumerate() {
            if !(value > 0.0 && value <= 1e6) {
                let error = FieldError::new(at(&format!("mm_per_radian/{axis}")), value, "above 0 and at most 1000000");
                errors.push(error.remedy("a phase that falls as the displacement rises has is_reversed"));
            }
        }
        if let Some([start, end]) = step.window_s.filter(|[start, end]| !(start < end)) {
            errors.push(FieldError::new(at("window_s"), format!("{start} to {end}"), "two rising times"));
        }
        if let Some(force) = step.force_n.filter(|f| !f.is_finite()) {
            errors.push(FieldError::new(at("force_n"), force, "finite"));
        }
    }
}

/// What the files of a scanner are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScannerForm {
    Dicom,
    Paravision,
}

/// Opens the files of a scanner, those of folders with all that lies below them. Without a list of series the error
/// says which there are.
pub(super) fn open_scanner(
    form: ScannerForm,
    files: &[PathBuf],
    has_series: bool,
    limits: &ReadLimits,
    memory: &ReadingMemory,
) -> Result<Box<dyn VolumeReader>, ImportError> {
    let mut paths = Vec::new();
    for path in files {
        let below = files_below(path).map_err(|source| ScannerError::File { path: path.clone(), source })?;
        memory.take("the list of files", below.iter().map(|p| 2 * p.as_os_str().len() as u64 + 64).sum())?;
        paths.extend(below);
    }
    let opened: Box<dyn VolumeReader> = match form {
        ScannerForm::Dicom => Box::new(DicomFiles::open(paths, limits.max_file_bytes, memory)?),
        ScannerForm::Paravision => Box::new(ParavisionStudy::open(&paths, memory)?),
    };
    if has_series {
        return Ok(opened);
    }
    Err(ScannerError::NoSeriesGiven { listing: SeriesLine::table(&opened.lines()) }.into())
}
