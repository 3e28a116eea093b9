//! What an import is asked for: a recording of raw phases, or files with what they do not say themselves.

use super::import_series::{ScannerForm, check_series};
use crate::acquisition::Anchor;
use crate::acquisition::unwrap::Method;
use crate::field::FieldError;
use crate::recording::{Filter, GridOrigin, ImportOptions, SeriesMap, VectorFrame};
use crate::specimen::Specimen;
use crate::voxel::Surface;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Unit of length of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum LengthUnit {
    /// Millimetres.
    #[default]
    Mm,
    /// Metres.
    M,
    /// Micrometres.
    Um,
}

impl LengthUnit {
    /// Of one of it in millimetres.
    fn in_mm(self) -> f64 {
        match self {
            LengthUnit::Mm => 1.0,
            LengthUnit::M => 1e3,
            LengthUnit::Um => 1e-3,
        }
    }
}

/// What the files hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FileForm {
    /// MATLAB arrays.
    Matlab,
    /// Point clouds as CSV, one file per drive.
    Points,
    /// NIfTI images with a displacement per voxel, and one with the mask.
    Nifti,
    /// DICOM images of phases and magnitudes, single or with many frames: files, or folders of them.
    Dicom,
    /// Reconstructions of Bruker ParaVision with phases and magnitudes: folders of a study, an experiment or a
    /// reconstruction.
    Paravision,
}

impl FileForm {
    /// The scanner's form, of files that hold phases.
    pub(super) fn of_scanner(self) -> Option<ScannerForm> {
        match self {
            FileForm::Dicom => Some(ScannerForm::Dicom),
            FileForm::Paravision => Some(ScannerForm::Paravision),
            FileForm::Matlab | FileForm::Points | FileForm::Nifti => None,
        }
    }
}

/// Body of an import: a `recording` of raw phases, or `files`.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ImportRequest {
    /// A recording of raw phases.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording: Option<String>,
    /// MATLAB files, point clouds (one per drive), NIfTI images, or files and folders of a scanner, in place of a
    /// recording.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 1000)]
    pub files: Vec<String>,
    /// What the files hold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub form: Option<FileForm>,
    /// Which series of a scanner's files are the phases along x, y and z and which the magnitude, at which drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub series: Option<SeriesMap>,
    /// Values of a scanner's phase images, as it rescales them, that stand for −π and π, such as 0,4096 or
    /// -3141.5927,3141.5927. Where they are left out, the known range that the values fill.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 2, max_items = 2)]
    pub phase_range: Option<[f64; 2]>,
    /// Whether the phases of a scanner's files are kept as they are, in a recording of raw phases.
    #[serde(default)]
    #[schema(default = false)]
    pub is_raw: bool,
    /// Name of the recording that is made from files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub name: Option<String>,
    /// The specimen (specimen/1); needed for files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specimen: Option<Specimen>,
    /// Drives in mm, one per step.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 1000)]
    pub drive_mm: Vec<f64>,
    /// The files' unit of length.
    #[serde(default)]
    #[schema(default = LengthUnit::default)]
    pub unit: LengthUnit,
    /// Axes along the indices of MATLAB arrays and images, such as y,z,x or -y,z,-x; of a scanner's images along
    /// columns, rows and slices. Displacement i of MATLAB arrays is the one along index i. Where it is left out, y,z,x
    /// for MATLAB, and for images the axes that their affine leads to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 16)]
    pub axes: Option<String>,
    /// Axes of the three displacement arrays of MATLAB files, such as x,y,z, where they do not follow the indices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 16)]
    pub components: Option<String>,
    /// Where the voxels of MATLAB files and of a scanner lie: the mask's box centred on the specimen, or as the
    /// positions X or the scanner say.
    #[serde(default)]
    #[schema(default = GridOrigin::default)]
    pub origin: GridOrigin,
    /// Frame of the vectors in images; where it is left out, lps for those of the intent 1007, which ITK and ANTs
    /// write, and ras for others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vectors: Option<VectorFrame>,
    /// Voxel size in mm: along the indices of MATLAB arrays, or x,y,z to average points in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 3, max_items = 3)]
    pub voxel_mm: Option<[f64; 3]>,
    /// The face on which the points of a point cloud lie, where cameras measured a surface. The position along its
    /// normal may then be left out of the tables, and for in_plane components the displacement along it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub surface: Option<Surface>,
    /// Which of several separate regions of the mask, counted along the thickness from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 1000)]
    pub region: Option<usize>,
    /// Filter: applied to raw phases after unwrapping; for files the one that they went through.
    #[serde(default)]
    #[schema(default = Filter::default)]
    pub filter: Filter,
    /// Noise of the displacement in mm, where known, of files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 3, max_items = 3)]
    pub noise_sd_mm: Option<[f64; 3]>,
    /// Loading history: the text of a CSV file with the columns time_s, drive_mm, force_n.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 50000000)]
    pub load_csv: Option<String>,
    /// How phases are unwrapped.
    #[serde(default)]
    #[schema(default = Method::default)]
    pub method: Method,
    /// Leave out voxels for which a second method finds another multiple of 2π.
    #[serde(default = "super::defaults::yes")]
    #[schema(default = super::defaults::yes)]
    pub needs_agreement: bool,
    /// Zero of the phase: phase zero is no displacement, take off what the fixed plate shows, or nothing.
    #[serde(default)]
    #[schema(default = Anchor::default)]
    pub anchor: Anchor,
}

impl ImportRequest {
    /// What files need and recordings must not have, and the other way round.
    pub(super) fn check_forms(&self, errors: &mut Vec<FieldError>) {
        let is_of_files = !self.files.is_empty();
        if self.recording.is_some() == is_of_files {
            let error = FieldError::new("/recording", "neither alone nor left out", "given, or files in its place");
            errors.push(error.remedy("give one of the two"));
        }
        if is_of_files && self.specimen.is_none() {
            let error = FieldError::new("/specimen", "", "given");
            errors.push(error.remedy("the files do not say what was scanned"));
        }
        if is_of_files && self.form.is_none() {
            errors.push(FieldError::new("/form", "", "given with files"));
        }
        let is_of_scanner = self.form.and_then(FileForm::of_scanner).is_some();
        for (name, is_given) in
            [("series", self.series.is_some()), ("phase_range", self.phase_range.is_some()), ("is_raw", self.is_raw)]
        {
            if is_given && !is_of_scanner {
                let error = FieldError::new(format!("/{name}"), "given", "left out");
                errors.push(error.remedy("only the files of a scanner have series (form dicom or paravision)"));
            }
        }
        if let Some(surface) = self.surface {
            let error = |allowed: &str| FieldError::new("/surface", surface.face.name(), allowed);
            if self.form != Some(FileForm::Points) {
                let remedy = "tables of points alone can be of a face (form points)";
                errors.push(error("left out where the files hold no points").remedy(remedy));
            }
            if self.filter != Filter::None {
                errors.push(error("left out where the values went through a filter of voxels"));
            }
            if let Some(Err(hidden)) = self.specimen.as_ref().map(|specimen| surface.check(specimen)) {
                errors.push(error("a plane face that cameras can see").remedy(hidden.to_string()));
            }
        }
        if is_of_scanner && !self.drive_mm.is_empty() {
            let error = FieldError::new("/drive_mm", "given", "left out");
            errors.push(error.remedy("the drives of a scanner's files stand with their series"));
        }
        if self.is_raw && self.filter != Filter::None {
            errors.push(FieldError::new("/filter", "hamming2", "none where raw phases are asked for"));
        }
        if let Some([low, high]) = self.phase_range.filter(|[low, high]| !(low < high && (high - low).is_finite())) {
            errors.push(FieldError::new("/phase_range", format!("{low} to {high}"), "two rising numbers"));
        }
        if let Some(map) = &self.series {
            check_series(map, self.specimen.as_ref(), errors);
            if map.scanner_axes.is_some() && self.axes.is_some() {
                let error = FieldError::new("/axes", "given beside series.scanner_axes", "one of the two");
                errors.push(error.remedy("scanner_axes says how the specimen lay, axes what the images' indices are"));
            }
        }
        for error in self.specimen.iter().flat_map(Specimen::field_errors) {
            errors.push(error.below("/specimen"));
        }
        for (pointer, axes) in [("/axes", &self.axes), ("/components", &self.components)] {
            if let Some(axes) = axes.as_ref().filter(|axes| ImportOptions::parse_axes(axes).is_none()) {
                let allowed = "x, y and z once each, such as y,z,x or -y,z,-x";
                errors.push(FieldError::new(pointer, format!("{axes:?}"), allowed));
            }
        }
        for (name, values) in [("voxel_mm", self.voxel_mm), ("noise_sd_mm", self.noise_sd_mm)] {
            for (axis, value) in values.into_iter().flatten().enumerate() {
                if !(value > 0.0 && value <= 1e6) {
                    errors.push(FieldError::new(format!("/{name}/{axis}"), value, "above 0 and at most 1000000"));
                }
            }
        }
    }

    /// How files are read; `None` where the axes make no sense.
    pub(super) fn import_options(&self) -> Option<ImportOptions> {
        let default = ImportOptions::default();
        Some(ImportOptions {
            id: self.name.clone().unwrap_or_else(|| "imported".into()),
            unit_mm: self.unit.in_mm(),
            axes: match &self.axes {
                Some(axes) => ImportOptions::parse_axes(axes)?,
                None => default.axes,
            },
            components: self.components.as_ref().and_then(|text| ImportOptions::parse_axes(text)),
            origin: self.origin,
            voxel_mm_by_index: self.voxel_mm,
            region: self.region,
            drive_mm: self.drive_mm.clone(),
            filter: self.filter,
            noise_sd_mm: self.noise_sd_mm,
        })
    }
}
