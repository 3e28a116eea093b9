//! Export of a recording: its images, drives and forces as arrays for other tools, and as tables of points.

use super::array_files::add_arrays;
use super::input_use::{InputForm, InputUse};
use super::{Context, JobError, Outcome, Request, ResultSchema, Run, defaults, summary};
use crate::export::{ArrayFormat, RecordingFormat, Tree, raw_recording_arrays, recording_arrays, recording_points};
use crate::field::FieldError;
use crate::provenance::VERSION;
use crate::recording::Recording;
use crate::voxel::VoxelGrid;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Body of the export of a recording.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ExportRecordingRequest {
    /// The recording (mru-recording/1).
    pub recording: String,
    /// Whether the recording holds wrapped phases and magnitudes in place of displacements.
    #[serde(default)]
    pub is_raw: bool,
    /// Files that it is written as; all where the list is left out, without tables of points where it holds phases.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 3)]
    pub formats: Option<Vec<RecordingFormat>>,
}

/// Result (`export-recording/1`).
#[derive(Serialize, ToSchema)]
struct ExportRecordingResult {
    schema: &'static str,
    version: &'static str,
    input_hash: String,
    /// Name of the recording.
    id: String,
    /// Voxels along x, y, z; one along the normal of a face that cameras saw.
    shape: [usize; 3],
    drive_mm: Vec<f64>,
    /// The files.
    files: Vec<String>,
}

impl Request for ExportRecordingRequest {
    const COMMAND: &'static str = "export-recording";
    const COLLECTION: &'static str = "recording-exports";
    const ABOUT: &'static str =
        "A recording's displacements or phases, drives and forces for MATLAB and Python, and as tables of points.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "recording": defaults::EXAMPLE_RECORDING, "formats": ["mat"] })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<ExportRecordingResult>("export-recording/1")
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        if self.is_raw && self.formats.as_ref().is_some_and(|formats| formats.contains(&RecordingFormat::Points)) {
            let error = FieldError::new("/formats", "points", "formats of arrays where the recording holds phases");
            return Err(vec![error.remedy("tables of points hold displacements; import the phases first")]);
        }
        Ok(Box::new(self))
    }
}

impl ExportRecordingRequest {
    fn formats(&self) -> &[RecordingFormat] {
        self.formats.as_deref().unwrap_or(&RecordingFormat::ALL)
    }

    fn array_formats(&self) -> Vec<ArrayFormat> {
        let wanted: Vec<ArrayFormat> = self.formats().iter().filter_map(|f| f.of_arrays()).collect();
        ArrayFormat::ALL.into_iter().filter(|f| wanted.contains(f)).collect()
    }

    /// Tables of points, name and text: one per drive.
    fn tables(&self, context: &Context) -> Vec<(String, String)> {
        if !self.formats().contains(&RecordingFormat::Points) {
            return Vec::new();
        }
        let of_steps = |recording: &Recording| {
            let steps = recording.steps.iter().enumerate();
            steps.map(|(n, step)| (format!("{STEM}-{}.csv", n + 1), recording_points(recording, step))).collect()
        };
        context.recordings.first().map_or_else(Vec::new, |read| of_steps(&read.recording))
    }

    /// What is written of the recording that was read.
    fn content(&self, context: &Context) -> Result<Content, JobError> {
        let of_displacements = context.recordings.first().map(|read| {
            let recording = &read.recording;
            let drive_mm = recording.steps.iter().map(|s| s.drive_mm).collect();
            (recording.id.clone(), recording.grid.clone(), drive_mm, recording_arrays(recording))
        });
        let of_phases = || {
            let recording = &context.raw_recordings.first()?.recording;
            let drive_mm = recording.steps.iter().map(|s| s.drive_mm).collect();
            Some((recording.id.clone(), recording.grid.clone(), drive_mm, raw_recording_arrays(recording)))
        };
        of_displacements.or_else(of_phases).ok_or_else(|| JobError::Internal("the recording was not read".into()))
    }
}

/// Name, grid, drives (mm) and arrays of a recording.
type Content = (String, VoxelGrid, Vec<f64>, Tree);

impl Run for ExportRecordingRequest {
    fn title(&self) -> String {
        format!("arrays of {}", self.recording)
    }

    fn inputs(&self) -> Vec<InputUse> {
        let form = if self.is_raw { InputForm::RawPhases } else { InputForm::Displacements };
        vec![InputUse { pointer: "/recording".into(), name: self.recording.clone(), form }]
    }

    fn takes_surfaces(&self) -> bool {
        true
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let (id, grid, drive_mm, tree) = self.content(context)?;
        let (formats, tables) = (self.array_formats(), self.tables(context));
        let files = formats.iter().map(|f| f.file_name(STEM)).chain(tables.iter().map(|(name, _)| name.clone()));
        let result = ExportRecordingResult {
            schema: "export-recording/1",
            version: VERSION,
            input_hash: context.input_hash.clone(),
            id,
            shape: grid.shape,
            drive_mm,
            files: files.collect(),
        };
        let text = summary::export_recording(&result.id, result.shape, result.drive_mm.len(), &result.files);
        let mut outcome = Outcome::new("export-recording.json", &result, text)?;
        add_arrays(&mut outcome, STEM, tree, &formats, context)?;
        for (name, text) in tables {
            outcome.add(name, text);
        }
        Ok(outcome)
    }
}

/// Name of the files without ending.
const STEM: &str = "recording";
