//! What a job leaves: a result, a summary in words, and files.

use crate::recording::RecordingError;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;

/// What a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MediaType {
    /// JSON.
    Json,
    /// SVG picture.
    Svg,
    /// HTML page.
    Html,
    /// Comma-separated values.
    Csv,
    /// Apache Parquet table.
    Parquet,
    /// NIfTI image, compressed.
    Nifti,
    /// VTU for ParaView.
    Vtu,
    /// DXF drawing.
    Dxf,
    /// STL solid.
    Stl,
    /// STEP solid.
    Step,
    /// HDF5: arrays for Python, fields for ParaView.
    Hdf5,
    /// MATLAB's variables.
    Matlab,
    /// Plain text.
    Text,
    /// Markdown.
    Markdown,
    /// XML.
    Xml,
    /// Anything else.
    Binary,
}

impl MediaType {
    /// The name as in `Content-Type`.
    pub fn name(self) -> &'static str {
        match self {
            MediaType::Json => "application/json",
            MediaType::Svg => "image/svg+xml",
            MediaType::Html => "text/html",
            MediaType::Csv => "text/csv",
            MediaType::Parquet => "application/vnd.apache.parquet",
            MediaType::Nifti => "application/gzip",
            MediaType::Vtu | MediaType::Xml => "application/xml",
            MediaType::Dxf => "image/vnd.dxf",
            MediaType::Stl => "model/stl",
            MediaType::Step => "model/step",
            MediaType::Hdf5 => "application/x-hdf5",
            MediaType::Matlab => "application/x-matlab-data",
            MediaType::Text => "text/plain",
            MediaType::Markdown => "text/markdown",
            MediaType::Binary => "application/octet-stream",
        }
    }

    /// By the ending of a file's name.
    pub fn of_name(name: &str) -> MediaType {
        match name.rsplit('.').next() {
            Some("json") => MediaType::Json,
            Some("svg") => MediaType::Svg,
            Some("html") => MediaType::Html,
            Some("csv") => MediaType::Csv,
            Some("parquet") => MediaType::Parquet,
            Some("gz") => MediaType::Nifti,
            Some("vtu") => MediaType::Vtu,
            Some("xml" | "feb" | "pvd") => MediaType::Xml,
            Some("dxf") => MediaType::Dxf,
            Some("stl") => MediaType::Stl,
            Some("step") => MediaType::Step,
            Some("h5" | "vtkhdf") => MediaType::Hdf5,
            Some("mat") => MediaType::Matlab,
            Some("inp" | "txt") => MediaType::Text,
            Some("md") => MediaType::Markdown,
            _ => MediaType::Binary,
        }
    }
}

/// A file of an outcome.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    /// Name without folder.
    pub name: String,
    /// What it holds.
    pub media_type: MediaType,
    /// Its content.
    pub bytes: Vec<u8>,
    /// Whether it is part of a recording that the job made: further jobs may name that recording.
    pub is_of_recording: bool,
}

/// Why an outcome cannot be put together: a fault of the program or of the machine.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct OutcomeError(String);

/// What a job leaves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// The result: JSON, indented, with a final line break.
    pub result: String,
    /// Name of the result's file, such as `evaluation.json`.
    pub result_name: &'static str,
    /// SHA-256 of what went in, hexadecimal.
    pub input_hash: String,
    /// What matters of the result, as text for a terminal.
    pub summary: String,
    /// Everything else, in the order in which it was made.
    pub files: Vec<File>,
    /// Whether what was compared is worse: the command ends with exit code 1.
    pub is_worse: Option<String>,
}

impl Outcome {
    /// An outcome of `result` without files.
    ///
    /// # Errors
    /// [`OutcomeError`] for a value that JSON cannot hold.
    pub fn new<T: Serialize>(
        result_name: &'static str,
        result: &T,
        summary: impl Into<String>,
    ) -> Result<Outcome, OutcomeError> {
        let result = to_json(result)?;
        Ok(Outcome { result, result_name, summary: summary.into(), ..Outcome::default() })
    }

    /// Adds a file; what it holds follows from its name.
    pub fn add(&mut self, name: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        let name = name.into();
        let media_type = MediaType::of_name(&name);
        self.files.push(File { name, media_type, bytes: bytes.into(), is_of_recording: false });
    }

    /// Adds pictures by name without ending.
    pub fn add_pictures(&mut self, pictures: impl IntoIterator<Item = (String, String)>) {
        for (name, svg) in pictures {
            self.add(format!("{name}.svg"), svg);
        }
    }

    /// Adds the files that `write` leaves in a fresh folder.
    ///
    /// # Errors
    /// [`OutcomeError`] where they cannot be written or read back.
    pub fn add_written(
        &mut self,
        is_of_recording: bool,
        write: impl FnOnce(&Path) -> Result<(), RecordingError>,
    ) -> Result<(), OutcomeError> {
        for (name, bytes) in written(write)? {
            let media_type = MediaType::of_name(&name);
            self.files.push(File { name, media_type, bytes, is_of_recording });
        }
        Ok(())
    }
}

/// What the field says that [`WithRecording`] adds.
pub(super) const RECORDING_FIELD: &str = "The recording that was made: a hash of its content.";

/// A result that names the recording that was made.
#[derive(Serialize)]
pub(super) struct WithRecording<'a, T: Serialize> {
    #[serde(flatten)]
    pub result: &'a T,
    /// Its identifier: a hash of its content.
    pub recording: String,
}

impl Outcome {
    /// The files of the recording that the job made; empty where it made none.
    pub fn recording(&self) -> BTreeMap<String, Vec<u8>> {
        self.files.iter().filter(|f| f.is_of_recording).map(|f| (f.name.clone(), f.bytes.clone())).collect()
    }
}

/// Identifier of a recording: SHA-256 of its files' names and contents, hexadecimal.
pub fn recording_identifier(files: &BTreeMap<String, Vec<u8>>) -> String {
    let digests: Vec<String> = files.values().map(|bytes| hex(Sha256::new_with_prefix(bytes))).collect();
    let contents = files.iter().zip(&digests).map(|((name, b), sha)| (name.as_str(), b.len() as u64, sha.as_str()));
    identifier_of_contents(contents)
}

/// The identifier of a recording from name, length and SHA-256 (hexadecimal) of its files, in the order of their names.
pub fn identifier_of_contents<'a>(files: impl Iterator<Item = (&'a str, u64, &'a str)>) -> String {
    let mut all = Sha256::new();
    for (name, length, sha) in files {
        all.update(format!("{name}\n{length}\n{sha}\n").as_bytes());
    }
    hex(all)
}

fn hex(hash: Sha256) -> String {
    hash.finalize().iter().map(|b| format!("{b:02x}")).collect()
}

/// JSON, indented, with a final line break.
///
/// # Errors
/// [`OutcomeError`] for a value that JSON cannot hold.
pub fn to_json<T: Serialize>(value: &T) -> Result<String, OutcomeError> {
    let mut text = serde_json::to_string_pretty(value).map_err(|e| OutcomeError(e.to_string()))?;
    text.push('\n');
    Ok(text)
}

/// What `write` leaves in a fresh folder, by name.
fn written(write: impl FnOnce(&Path) -> Result<(), RecordingError>) -> Result<BTreeMap<String, Vec<u8>>, OutcomeError> {
    let failed = |e: &dyn std::fmt::Display| OutcomeError(format!("a temporary folder: {e}"));
    let scratch = super::scratch::ScratchFolder::new().map_err(|e| failed(&e))?;
    write(scratch.path()).map_err(|e| failed(&e))?;
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(scratch.path()).map_err(|e| failed(&e))? {
        let entry = entry.map_err(|e| failed(&e))?;
        let bytes = std::fs::read(entry.path()).map_err(|e| failed(&e))?;
        files.insert(entry.file_name().to_string_lossy().into_owned(), bytes);
    }
    Ok(files)
}
