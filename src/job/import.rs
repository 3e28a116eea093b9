//! Import: raw phases, MATLAB files, point clouds, images and the files of scanners become a recording.

use super::import_result::{ImportResult, ImportStep};
use super::import_series::{ScannerForm, check_series, open_scanner};
use super::input_use::{InputForm, InputUse};
use super::outcome::{RECORDING_FIELD, WithRecording, recording_identifier, to_json};
use super::{Context, JobError, Outcome, Request, ResultSchema, Run, summary};
use crate::acquisition::unwrap::{Method, UnwrapOptions};
use crate::acquisition::{Anchor, ReconstructOptions, StepReport, reconstruct};
use crate::field::FieldError;
use crate::file::ReadingMemory;
use crate::provenance::VERSION;
use crate::recording::{
    Filter, GridOrigin, Image, ImportOptions, LoadCurve, NamedImage, PointTable, RawRecording, Recording, SeriesMap,
    VectorFrame, axes_of_affine, mat, raw_recording_from_series, read_points, recording_from_images,
    recording_from_mat, recording_from_points, unused_variables, write_vectors,
};
use crate::report::{displacement_picture, raw_picture};
use crate::specimen::Specimen;
use crate::voxel::Surface;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
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
    fn of_scanner(self) -> Option<ScannerForm> {
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

/// A recording, the standard deviations of its voxels, and how its phases were unwrapped.
type Imported = (Recording, Vec<Vec<[f64; 3]>>, Vec<StepReport>);

struct CheckedImport {
    request: ImportRequest,
    load: Option<LoadCurve>,
}

impl ImportRequest {
    /// What files need and recordings must not have, and the other way round.
    fn check_forms(&self, errors: &mut Vec<FieldError>) {
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

    fn import_options(&self) -> Option<ImportOptions> {
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

impl Request for ImportRequest {
    const COMMAND: &'static str = "import";
    const COLLECTION: &'static str = "imports";
    const ABOUT: &'static str =
        "Raw phases, MATLAB files, point clouds, images or the files of a scanner as a recording.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "recording": super::defaults::EXAMPLE_RECORDING, "filter": "hamming2" })
    }

    fn result() -> ResultSchema {
        ResultSchema::with::<ImportResult>("import/1", &[("recording", RECORDING_FIELD)])
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let mut errors = Vec::new();
        self.check_forms(&mut errors);
        let mut load = None;
        if let Some(text) = &self.load_csv {
            match LoadCurve::from_csv(text, Path::new("load_csv")) {
                Ok(curve) => load = Some(curve),
                Err(error) => {
                    let unfit = FieldError::new("/load_csv", "a table that cannot be read", "a loading history");
                    errors.push(unfit.remedy(error.to_string()));
                }
            }
        }
        if errors.is_empty() { Ok(Box::new(CheckedImport { request: self, load })) } else { Err(errors) }
    }
}

/// A file that cannot be used.
fn unfit(pointer: &str, path: &Path, error: &dyn std::fmt::Display) -> JobError {
    FieldError::new(pointer, path.display(), "a file that can be read").remedy(error.to_string()).into()
}

impl CheckedImport {
    fn unwrapped(&self, raw: &RawRecording, pointer: &str, context: &Context) -> Result<Imported, JobError> {
        let unwrap = UnwrapOptions {
            method: self.request.method,
            needs_agreement: self.request.needs_agreement,
            ..UnwrapOptions::default()
        };
        let settings = ReconstructOptions { unwrap, anchor: self.request.anchor, filter: self.request.filter };
        let found = reconstruct(raw, &settings).map_err(|e| context.failed(&e))?;
        let named = || FieldError::new(pointer, &raw.id, "phases that move the plates as the drive says");
        found.recording.check_motion().map_err(|e| named().remedy(e.to_string()))?;
        Ok((found.recording, found.sd_mm, found.steps))
    }

    /// The raw recording that the request names, or that the files of a scanner make; `None` for other files.
    fn raw(&self, context: &Context) -> Result<Option<RawRecording>, JobError> {
        if self.request.recording.is_some() {
            let missing = || JobError::Internal("the raw recording was not read".into());
            let mut raw = context.raw_recordings.first().map(|read| read.recording.clone()).ok_or_else(missing)?;
            if let Some(specimen) = &self.request.specimen {
                raw.specimen.clone_from(specimen);
            }
            return Ok(Some(raw));
        }
        let Some(form) = self.request.form.and_then(FileForm::of_scanner) else { return Ok(None) };
        let missing = || JobError::Internal("a checked import has a specimen and files".into());
        let specimen = self.request.specimen.as_ref().ok_or_else(missing)?;
        let options = self.request.import_options().ok_or_else(missing)?;
        let first = context.files.first().ok_or_else(missing)?;
        let limits = context.surroundings.read_limits();
        let memory = limits.memory.begin();
        let map = self.request.series.as_ref();
        let opened = open_scanner(form, &context.files, map.is_some(), &limits, &memory);
        let axes = self.request.axes.as_ref().map(|_| options.axes);
        let made = opened.and_then(|files| match map {
            Some(map) => {
                let range = self.request.phase_range;
                raw_recording_from_series(files.as_ref(), map, range, axes, specimen, &options, &memory).map(Some)
            }
            None => Ok(None),
        });
        made.map_err(|e| unfit("/files", first, &e))
    }

    fn read_images(&self, files: &[PathBuf], memory: &ReadingMemory) -> Result<Vec<NamedImage>, JobError> {
        let read = |(index, path): (usize, &PathBuf)| {
            let fail = |e: &dyn std::fmt::Display| unfit(&format!("/files/{index}"), path, e);
            let file = crate::file::open_regular(path).map_err(|e| fail(&e))?;
            let image = Image::read_any_unit(file, memory).map_err(|e| fail(&e))?;
            Ok(NamedImage { path: path.clone(), image })
        };
        files.iter().enumerate().map(read).collect()
    }

    /// The recording that files of a laboratory hold, and the names in them that were not used.
    fn read_files(&self, context: &Context) -> Result<(Recording, Vec<String>), JobError> {
        let files = &context.files;
        let missing = || JobError::Internal("a checked import has a specimen and a form".into());
        let specimen = self.request.specimen.as_ref().ok_or_else(missing)?;
        let options = self.request.import_options().ok_or_else(missing)?;
        let limits = context.surroundings.read_limits();
        let memory = limits.memory.begin();
        let first = files.first().ok_or_else(missing)?;
        match self.request.form.ok_or_else(missing)? {
            FileForm::Matlab => {
                // Positions and masks may lie in files of their own.
                let mut variables = Vec::new();
                for (index, path) in files.iter().enumerate() {
                    let found =
                        mat::read_mat(path, &memory).map_err(|e| unfit(&format!("/files/{index}"), path, &e))?;
                    variables.extend(found);
                }
                let unused = unused_variables(&variables).into_iter().map(str::to_owned).collect();
                let made = recording_from_mat(&variables, specimen, &options, &memory);
                made.map(|recording| (recording, unused)).map_err(|e| unfit("/files", first, &e))
            }
            FileForm::Nifti => {
                let images = self.read_images(files, &memory)?;
                let unfit = |e: &dyn std::fmt::Display| unfit("/files", first, e);
                let axes = match (&self.request.axes, images.first()) {
                    (None, Some(image)) => axes_of_affine(image).map_err(|e| unfit(&e))?,
                    _ => options.axes,
                };
                let options = ImportOptions { axes, ..options };
                let made = recording_from_images(&images, specimen, self.request.vectors, &options, &memory);
                made.map(|recording| (recording, Vec::new())).map_err(|e| unfit(&e))
            }
            FileForm::Dicom | FileForm::Paravision => Err(missing()),
            FileForm::Points => {
                let (mut steps, mut unused) = (Vec::new(), Vec::new());
                for (index, path) in files.iter().enumerate() {
                    let fail = |e: &dyn std::fmt::Display| unfit(&format!("/files/{index}"), path, e);
                    let num_bytes = std::fs::metadata(path).map_err(|e| fail(&e))?.len();
                    // Of a file in another code the bytes stand beside the text, whose letters may take twice as many.
                    let num_bytes_taken = 3 * num_bytes;
                    memory.take("a table of points", num_bytes_taken).map_err(|e| fail(&e))?;
                    let text = crate::file::read_table_limited(path, num_bytes).map_err(|e| fail(&e))?;
                    let table = read_points(&text, path, self.request.surface, options.unit_mm, &memory);
                    let PointTable { points, unused_columns } = table.map_err(|e| fail(&e))?;
                    steps.push(points);
                    // Tables of the same make have the same columns.
                    unused.extend(unused_columns);
                    unused.sort();
                    unused.dedup();
                    memory.give_back(num_bytes_taken);
                }
                let voxel = options.voxel_mm_by_index;
                let made = recording_from_points(&steps, specimen, voxel, self.request.surface, &options, &memory);
                made.map(|recording| (recording, unused)).map_err(|e| unfit("/files", first, &e))
            }
        }
    }
}

impl CheckedImport {
    /// Phases as they are.
    fn raw_outcome(&self, raw: &RawRecording, context: &Context) -> Result<Outcome, JobError> {
        let steps = raw.steps.iter().map(|s| ImportStep {
            drive_mm: s.drive_mm,
            force_n: s.force_n,
            num_complete: raw.num_voxels(),
            reconstruction: None,
        });
        let result = ImportResult {
            schema: "import/1",
            version: VERSION,
            input_hash: context.input_hash.clone(),
            id: raw.id.clone(),
            is_raw: true,
            num_voxels: raw.num_voxels(),
            noise_sd_mm: raw.noise_sd_mm.map(|sd| sd.map(Some)),
            surface: None,
            left_aside: Vec::new(),
            steps: steps.collect(),
        };
        let mut outcome = Outcome { summary: summary::import(&result), ..Outcome::default() };
        outcome.add_written(true, |folder| raw.write(folder))?;
        let named = WithRecording { result: &result, recording: recording_identifier(&outcome.recording()) };
        (outcome.result, outcome.result_name) = (to_json(&named)?, "import.json");
        for n in 0..raw.steps.len() {
            outcome.add(format!("raw_{}.svg", n + 1), raw_picture(raw, n));
        }
        Ok(outcome)
    }
}

impl Run for CheckedImport {
    fn title(&self) -> String {
        let named = self.request.name.as_ref().or(self.request.recording.as_ref());
        named.map_or_else(|| "import".into(), |name| format!("import of {name}"))
    }

    fn inputs(&self) -> Vec<InputUse> {
        match &self.request.recording {
            Some(name) => {
                vec![InputUse { pointer: "/recording".into(), name: name.clone(), form: InputForm::RawPhases }]
            }
            None => InputUse::of_list("/files", &self.request.files, InputForm::File),
        }
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        context.step("import", 0, 1);
        let mut raw = self.raw(context)?;
        if let (Some(raw), Some(load)) = (&mut raw, &self.load) {
            raw.load = Some(load.clone());
            for step in &mut raw.steps {
                step.force_n = step.force_n.or_else(|| load.force_at_n(step.drive_mm, step.window_s));
            }
        }
        if let Some(raw) = raw.as_ref().filter(|_| self.request.is_raw) {
            return self.raw_outcome(raw, context);
        }
        let (mut recording, sd, reports, left_aside) = match raw {
            Some(raw) => {
                let pointer = if self.request.recording.is_some() { "/recording" } else { "/files" };
                let (recording, sd, reports) = self.unwrapped(&raw, pointer, context)?;
                (recording, sd, reports, Vec::new())
            }
            None => {
                let (recording, left_aside) = self.read_files(context)?;
                (recording, Vec::new(), Vec::new(), left_aside)
            }
        };
        if let Some(load) = &self.load {
            recording.load = Some(load.clone());
            for step in &mut recording.steps {
                step.force_n = step.force_n.or_else(|| load.force_at_n(step.drive_mm, step.window_s));
            }
        }
        let mut reports = reports.into_iter();
        let is_complete = |u: &&[f64; 3]| recording.is_complete(u);
        let steps = recording.steps.iter().map(|s| ImportStep {
            drive_mm: s.drive_mm,
            force_n: s.force_n,
            num_complete: s.displacement.iter().filter(is_complete).count(),
            reconstruction: reports.next(),
        });
        let result = ImportResult {
            schema: "import/1",
            version: VERSION,
            input_hash: context.input_hash.clone(),
            id: recording.id.clone(),
            is_raw: false,
            num_voxels: recording.num_voxels(),
            noise_sd_mm: recording.stated_noise_sd_mm(),
            surface: recording.grid.surface,
            left_aside,
            steps: steps.collect(),
        };
        let mut outcome = Outcome { summary: summary::import(&result), ..Outcome::default() };
        outcome.add_written(true, |folder| recording.write(folder))?;
        let named = WithRecording { result: &result, recording: recording_identifier(&outcome.recording()) };
        (outcome.result, outcome.result_name) = (to_json(&named)?, "import.json");
        for (n, sd) in sd.iter().enumerate() {
            let name = format!("sd_{}.nii.gz", n + 1);
            outcome.add_written(false, |folder| write_vectors(folder, &name, &recording.grid, sd))?;
        }
        for n in 0..recording.steps.len() {
            outcome.add(format!("displacement_{}.svg", n + 1), displacement_picture(&recording, n));
        }
        Ok(outcome)
    }
}
