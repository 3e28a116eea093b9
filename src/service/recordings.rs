//! Recordings as they are kept: the files of a folder, checked by the library's reader, then stored as blobs. What they
//! may unpack to is bounded by the memory of a reading.

use super::access::Caller;
use super::app::App;
use super::problem::Problem;
use super::store::{NewUpload, Store, UploadFile};
use crate::field::{printable, with_short_numbers};
use crate::file::digest_of_file;
use crate::job::{RecordingOutline, ScratchFolder, identifier_of_contents};
use crate::recording::{RawRecording, ReadLimits, ReadRecording, Recording, RecordingError};
use crate::report::plain_number;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// An upload that is no recording, or no safe one.
pub fn unsafe_upload(detail: impl Into<String>) -> Problem {
    Problem::new("unsafe-upload", with_short_numbers(&detail.into()))
}

/// A recording as it was uploaded.
pub enum Uploaded {
    /// Displacements.
    Displacements(Box<ReadRecording>),
    /// Wrapped phases.
    RawPhases(Box<ReadRecording<RawRecording>>),
}

/// What the scratch folder said.
pub fn scratch_failed(error: std::io::Error) -> Problem {
    super::log::error("scratch", &error.to_string());
    Problem::new("internal", "the service's scratch folder cannot be written; tell whoever runs the service")
}

/// Reads a recording from a folder of its files.
///
/// # Errors
/// `unsafe-upload` with what the reader says; `busy` where other readings hold the memory.
pub fn read(folder: &Path, limits: &ReadLimits) -> Result<Uploaded, Problem> {
    let found = match Recording::read_with_digest(folder, limits) {
        Ok(read) => Ok(Uploaded::Displacements(Box::new(read))),
        Err(RecordingError::Raw { .. }) => {
            RawRecording::read_with_digest(folder, limits).map(|read| Uploaded::RawPhases(Box::new(read)))
        }
        Err(error) => Err(error),
    };
    found.map_err(|e| {
        // The reader names files by their path here, which is nobody's business.
        let message = e.to_string().replace(&format!("{}/", folder.display()), "");
        match e.memory() {
            Some(memory) => Problem { detail: message, ..Problem::from(memory.clone()) },
            None => unsafe_upload(message),
        }
    })
}

/// An upload to keep: the files `names` of `folder`, once they are read without complaint.
///
/// # Errors
/// `unsafe-upload`, `too-large`, `busy`.
pub fn upload_of(
    folder: &Path,
    names: BTreeSet<String>,
    owner: String,
    limits: &ReadLimits,
) -> Result<NewUpload, Problem> {
    let force = |drive_mm: f64, force_n: Option<f64>| json!({ "drive_mm": drive_mm, "force_n": force_n });
    let (title, manifest) = match read(folder, limits)? {
        Uploaded::Displacements(read) => {
            let r = read.recording;
            let steps: Vec<_> = r.steps.iter().map(|s| force(s.drive_mm, s.force_n)).collect();
            let manifest = json!({
                "specimen": r.specimen, "shape": r.grid.shape, "voxel_mm": r.grid.voxel_mm,
                "num_voxels": r.num_voxels(), "steps": steps,
            });
            (r.id, manifest)
        }
        Uploaded::RawPhases(read) => {
            let r = read.recording;
            let steps: Vec<_> = r.steps.iter().map(|s| force(s.drive_mm, s.force_n)).collect();
            let manifest = json!({
                "specimen": r.specimen, "shape": r.grid.shape, "voxel_mm": r.grid.voxel_mm,
                "num_voxels": r.num_voxels(), "is_raw": true, "steps": steps,
            });
            (r.id, manifest)
        }
    };
    let mut files = Vec::new();
    for name in names {
        let path = folder.join(&name);
        let num_bytes = std::fs::metadata(&path).map_err(scratch_failed)?.len();
        let sha = digest_of_file(&path).map_err(|e| scratch_failed(e.into_io()))?;
        files.push(UploadFile { name, path, num_bytes, sha });
    }
    let contents = files.iter().map(|f| (f.name.as_str(), f.num_bytes, f.sha.as_str()));
    Ok(NewUpload {
        id: identifier_of_contents(contents),
        owner,
        title: printable(&title, 200),
        manifest: manifest.to_string(),
        files,
    })
}

/// Space for recordings, bytes.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Space {
    /// Of all owners together.
    pub all: u64,
    /// Of one owner; as much as of all without it.
    pub of_owner: Option<u64>,
}

impl Default for Space {
    /// No limit.
    fn default() -> Self {
        Space { all: u64::MAX, of_owner: None }
    }
}

impl Space {
    /// What a caller may fill.
    pub fn of(app: &App, caller: &Caller) -> Space {
        Space { all: app.limits.max_uploads_bytes as u64, of_owner: caller.max_recordings_bytes }
    }
}

/// What is known of a recording, from what was kept of it beside its files; none where another version kept it.
pub fn outline_of(manifest: &str) -> Option<RecordingOutline> {
    let manifest: serde_json::Value = serde_json::from_str(manifest).ok()?;
    Some(RecordingOutline {
        specimen: Specimen::deserialize(&manifest["specimen"]).ok()?,
        num_voxels: usize::try_from(manifest["num_voxels"].as_u64()?).ok()?,
        num_drives: manifest["steps"].as_array()?.len(),
    })
}

/// Whether `length` more bytes fit beside the recordings that are kept; where not, what could be deleted.
///
/// # Errors
/// `no-space`.
pub fn check_space(store: &Store, owner: &str, length: u64, space: Space) -> Result<(), Problem> {
    let held = |owner: &str| -> Result<u64, Problem> { Ok(store.uploaded_bytes(owner)?.unsigned_abs()) };
    let of_all = (held("")?, space.all, "recordings hold");
    let of_owner = match space.of_owner {
        Some(most) => (held(owner)?, most, "your recordings hold"),
        None => of_all,
    };
    let full = [of_owner, of_all].into_iter().find(|(kept, most, _)| kept.saturating_add(length) > *most);
    let Some((kept, most, whose)) = full else { return Ok(()) };
    let own = store.largest_uploads(owner, 5)?;
    let megabytes = |bytes: u64| plain_number(bytes as f64 / 1e6, 3);
    let list: Vec<String> = own
        .iter()
        .map(|row| format!("{} ({:?}, {} MB)", row.id, row.title, megabytes(row.num_bytes.unsigned_abs())))
        .collect();
    let which = if list.is_empty() {
        "none of them is yours: ask their owners, or whoever runs the service".to_string()
    } else {
        format!("your largest are {}", list.join(", "))
    };
    Err(Problem::new(
        "no-space",
        format!(
            "{} MB more do not fit: {whose} {} of {} MB. Delete what is no longer needed (DELETE \
             /v1/recordings/ID); {which}",
            megabytes(length),
            megabytes(kept),
            megabytes(most)
        ),
    ))
}

/// Keeps the recording that a job of `owner` made. Its identifier is a hash of its content.
///
/// # Errors
/// `no-space` where recordings fill the service's space, or the owner's.
pub fn keep(store: &Store, owner: &str, space: Space, files: BTreeMap<String, Vec<u8>>) -> Result<String, Problem> {
    let scratch = ScratchFolder::new().map_err(scratch_failed)?;
    for (name, bytes) in &files {
        std::fs::write(scratch.path().join(name), bytes).map_err(scratch_failed)?;
    }
    let names = files.into_keys().collect();
    let upload = upload_of(scratch.path(), names, owner.into(), &ReadLimits::job())?;
    put(store, &upload, space)?;
    Ok(upload.id)
}

/// Keeps an upload, where there is space for it. One that is kept already takes no more.
///
/// # Errors
/// `no-space`, `storage`.
pub fn put(store: &Store, upload: &NewUpload, space: Space) -> Result<(), Problem> {
    if store.upload(&upload.id)?.is_none() {
        let length = upload.files.iter().map(|f| f.num_bytes).sum();
        check_space(store, &upload.owner, length, space)?;
    }
    Ok(store.put_upload(upload)?)
}
