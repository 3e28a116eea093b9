//! Import: raw phases, MATLAB files, point clouds, images and the files of scanners become a recording.

use super::import_request::{FileForm, ImportRequest};
use super::import_result::{ImportResult, ImportStep};
use super::import_series::open_scanner;
use super::input_use::{InputForm, InputUse};
use super::outcome::{RECORDING_FIELD, WithRecording, recording_identifier, to_json};
use super::{Context, JobError, Outcome, Request, ResultSchema, Run, summary};
use crate::acquisition::unwrap::UnwrapOptions;
use crate::acquisition::{ReconstructOptions, StepReport, reconstruct};
use crate::field::FieldError;
use crate::file::ReadingMemory;
use crate::provenance::VERSION;
use crate::recording::{
    Image, ImportOptions, LoadCurve, NamedImage, PointTable, RawRecording, Recording, axes_of_affine, mat,
    raw_recording_from_series, read_points, recording_from_images, recording_from_mat, recording_from_points,
    unused_variables, write_vectors,
};
use crate::report::{displacement_picture, raw_picture};
use std::path::{Path, PathBuf};

/// A recording, the standard deviations of its voxels, and how its phases were unwrapped.
type Imported = (Recording, Vec<Vec<[f64; 3]>>, Vec<StepReport>);

struct CheckedImport {
    request: ImportRequest,
    load: Option<LoadCurve>,
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
