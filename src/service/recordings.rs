//! Uploaded recordings: a tar file taken apart into a scratch folder, checked by the library's reader, then kept as
//! blobs.
//!
//! Only regular files with plain names are taken; folders before a name are dropped, links and devices refused. What
//! the files may unpack to is bounded by the memory of a reading; the tar file and its entries are never held as a
//! whole.

use super::problem::{BUSY, Problem};
use super::store::{NewUpload, Store, UploadFile};
use crate::field::{printable, with_short_numbers};
use crate::file::digest_of_file;
use crate::job::{InputFile, JobError, Progress, ScratchFolder, Surroundings, identifier_of_contents};
use crate::recording::{RawRecording, ReadLimits, ReadRecording, Recording, RecordingError};
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Most files of a recording.
const MAX_FILES: usize = 2000;
/// How long a task waits for memory that other readings hold, and how often it looks.
const MEMORY_WAIT: Duration = Duration::from_secs(600);
const MEMORY_PAUSE: Duration = Duration::from_secs(1);
/// Length of a tar block, bytes.
const BLOCK: usize = 512;

fn unsafe_upload(detail: impl Into<String>) -> Problem {
    Problem::new("unsafe-upload", with_short_numbers(&detail.into()))
}

/// A file's own name: letters, digits, `.`, `_`, `-`, not starting with a dot, at most 100.
fn plain_name(name: &str) -> Result<String, Problem> {
    let last = name.rsplit('/').next().unwrap_or_default();
    let is_plain = (1..=100).contains(&last.len())
        && !last.starts_with('.')
        && last.bytes().all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b));
    let climbs = name.starts_with('/') || name.split('/').any(|part| part == "..") || name.contains('\\');
    if is_plain && !climbs {
        return Ok(last.into());
    }
    let shown = printable(name, 60);
    Err(unsafe_upload(format!("the name {shown:?} is not plain; use letters, digits, dots, hyphens and underscores")))
}

fn text_of(field: &[u8]) -> String {
    let end = field.iter().position(|b| *b == 0).unwrap_or(field.len());
    String::from_utf8_lossy(&field[..end]).into_owned()
}

/// Takes a tar file apart into `folder`; the names of its files.
///
/// # Errors
/// `unsafe-upload`, `too-large`.
pub fn unpack(mut stream: impl Read, folder: &Path, max_bytes: usize) -> Result<BTreeSet<String>, Problem> {
    let mut files = BTreeSet::new();
    let mut total = 0usize;
    loop {
        let mut header = [0u8; BLOCK];
        if let Err(error) = stream.read_exact(&mut header) {
            if error.kind() == std::io::ErrorKind::UnexpectedEof && !files.is_empty() {
                break;
            }
            return Err(unsafe_upload("the body is not a tar file"));
        }
        if header.iter().all(|b| *b == 0) {
            break;
        }
        let sum: u64 =
            header.iter().enumerate().map(|(i, b)| u64::from(if (148..156).contains(&i) { b' ' } else { *b })).sum();
        let octal = |field: &[u8]| u64::from_str_radix(text_of(field).trim(), 8).ok();
        if octal(&header[148..156]) != Some(sum) {
            return Err(unsafe_upload("the body is not a tar file: a header's checksum is wrong"));
        }
        let length = octal(&header[124..136]).ok_or_else(|| unsafe_upload("an entry has no length"))?;
        let length = usize::try_from(length).unwrap_or(usize::MAX / 2);
        total = total.saturating_add(length);
        if total > max_bytes {
            return Err(Problem::new("too-large", format!("the files hold more than {max_bytes} bytes")));
        }
        let mut sink: Box<dyn std::io::Write> = match header[156] {
            b'0' | 0 => {
                let name = plain_name(&text_of(&header[0..100]))?;
                if !files.insert(name.clone()) {
                    return Err(unsafe_upload(format!("{name} is there twice")));
                }
                if files.len() > MAX_FILES {
                    return Err(unsafe_upload(format!("more than {MAX_FILES} files")));
                }
                Box::new(std::fs::File::create_new(folder.join(name)).map_err(scratch_failed)?)
            }
            // Folders and extended headers hold nothing that is needed.
            b'5' | b'x' | b'g' => Box::new(std::io::sink()),
            _ => return Err(unsafe_upload("links and devices are refused")),
        };
        let padding = (length.div_ceil(BLOCK) * BLOCK - length) as u64;
        let read = std::io::copy(&mut stream.by_ref().take(length as u64), &mut sink).map_err(scratch_failed)?;
        let skipped =
            std::io::copy(&mut stream.by_ref().take(padding), &mut std::io::sink()).map_err(scratch_failed)?;
        if read < length as u64 || skipped < padding {
            return Err(unsafe_upload("the tar file ends in the middle of an entry"));
        }
    }
    Ok(files)
}

/// A recording as it was uploaded.
enum Uploaded {
    Displacements(Box<ReadRecording>),
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
fn read(folder: &Path, limits: &ReadLimits) -> Result<Uploaded, Problem> {
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
#[derive(Clone, Copy, Debug)]
pub struct Space {
    /// Of all owners together.
    pub all: u64,
    /// Of one owner; as much as of all without it.
    pub of_owner: Option<u64>,
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
    let megabytes = |bytes: u64| bytes as f64 / 1e6;
    let list: Vec<String> = own
        .iter()
        .map(|row| format!("{} ({:?}, {:.1} MB)", row.id, row.title, megabytes(row.num_bytes.unsigned_abs())))
        .collect();
    let which = if list.is_empty() {
        "none of them is yours: ask their owners, or whoever runs the service".to_string()
    } else {
        format!("your largest are {}", list.join(", "))
    };
    Err(Problem::new(
        "no-space",
        format!(
            "{:.1} MB more do not fit: {whose} {:.1} of {:.1} MB. Delete what is no longer needed (DELETE \
             /v1/recordings/ID); {which}",
            megabytes(length),
            megabytes(kept),
            megabytes(most)
        ),
    ))
}

/// Keeps the recording that job `job` made. Its identifier is a hash of its content.
///
/// # Errors
/// `no-space` where recordings fill the service's space.
pub fn keep(store: &Store, job: &str, files: BTreeMap<String, Vec<u8>>) -> Result<String, Problem> {
    let owner = store.job(job)?.map(|row| row.owner).unwrap_or_default();
    let length = files.values().map(|bytes| bytes.len() as u64).sum();
    let all = super::limits::Limits::default().max_uploads_bytes as u64;
    check_space(store, &owner, length, Space { all, of_owner: None })?;
    let scratch = ScratchFolder::new().map_err(scratch_failed)?;
    for (name, bytes) in &files {
        std::fs::write(scratch.path().join(name), bytes).map_err(scratch_failed)?;
    }
    let upload = upload_of(scratch.path(), files.into_keys().collect(), owner, &ReadLimits::job())?;
    store.put_upload(&upload)?;
    Ok(upload.id)
}

/// What a task is given: recordings from the storage, and the runner's progress, checkpoint and cancellation.
pub(super) struct StoredSurroundings<'a> {
    /// Where recordings are kept.
    pub store: &'a Store,
    /// Whether to stop.
    pub is_cancelled: &'a (dyn Fn() -> bool + Sync),
    /// Progress as JSON, for whoever keeps the lease alive.
    pub progress: &'a Mutex<String>,
    /// A file whose content is kept across attempts.
    pub checkpoint: &'a Path,
    /// Most elements of a mesh.
    pub max_elements: usize,
}

impl StoredSurroundings<'_> {
    fn uploaded(&self, name: &str) -> Result<Uploaded, JobError> {
        let unreadable = |message: String| JobError::Unreadable { name: name.into(), message };
        let internal = |e: &dyn std::fmt::Display| JobError::Internal(e.to_string());
        let names = self.store.upload_file_names(name).map_err(|e| internal(&e))?;
        if names.is_empty() {
            return Err(unreadable("the recording is gone; upload it again".into()));
        }
        let scratch = ScratchFolder::new().map_err(|e| internal(&e))?;
        for file in names {
            let bytes = self.store.upload_file(name, &file).map_err(|e| internal(&e))?;
            std::fs::write(scratch.path().join(&file), bytes).map_err(|e| internal(&e))?;
        }
        let begin = Instant::now();
        loop {
            match read(scratch.path(), &ReadLimits::job()) {
                // Other jobs hold the memory for as long as they run.
                Err(problem) if problem.is(BUSY) && begin.elapsed() < MEMORY_WAIT && !self.is_cancelled() => {
                    std::thread::sleep(MEMORY_PAUSE);
                }
                Err(problem) => return Err(unreadable(problem.detail)),
                Ok(found) => return Ok(found),
            }
        }
    }
}

impl Surroundings for StoredSurroundings<'_> {
    fn recording(&self, name: &str) -> Result<ReadRecording, JobError> {
        match self.uploaded(name)? {
            Uploaded::Displacements(read) => Ok(*read),
            Uploaded::RawPhases(_) => {
                let message = "it holds raw phases; import it first".into();
                Err(JobError::Unreadable { name: name.into(), message })
            }
        }
    }

    fn raw_recording(&self, name: &str) -> Result<ReadRecording<RawRecording>, JobError> {
        match self.uploaded(name)? {
            Uploaded::RawPhases(read) => Ok(*read),
            Uploaded::Displacements(_) => {
                let message = "this recording already holds displacements".into();
                Err(JobError::Unreadable { name: name.into(), message })
            }
        }
    }

    fn file(&self, name: &str) -> Result<InputFile, JobError> {
        let message = "the service reads uploaded recordings alone; import other files with the command".into();
        Err(JobError::Unreadable { name: name.into(), message })
    }

    fn progress(&self, progress: &Progress) {
        let text = serde_json::to_string(progress).unwrap_or_default();
        *self.progress.lock().unwrap_or_else(PoisonError::into_inner) = text;
    }

    fn is_cancelled(&self) -> bool {
        (self.is_cancelled)()
    }

    fn checkpoint(&self, _: &str) -> Option<PathBuf> {
        Some(self.checkpoint.to_path_buf())
    }

    fn max_elements(&self) -> usize {
        self.max_elements
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str, kind: u8, bytes: &[u8]) -> Vec<u8> {
        let mut header = [0u8; BLOCK];
        header[..name.len()].copy_from_slice(name.as_bytes());
        header[124..135].copy_from_slice(format!("{:011o}", bytes.len()).as_bytes());
        header[148..156].fill(b' ');
        header[156] = kind;
        let sum: u64 = header.iter().map(|b| u64::from(*b)).sum();
        header[148..154].copy_from_slice(format!("{sum:06o}").as_bytes());
        header[154] = 0;
        let mut out = header.to_vec();
        out.extend_from_slice(bytes);
        out.resize(out.len().div_ceil(BLOCK) * BLOCK, 0);
        out
    }

    #[test]
    fn only_plain_files_are_taken() {
        let tar = [
            entry("a/", b'5', b""),
            entry("a/recording.json", b'0', b"{}"),
            entry("u_1.nii.gz", 0, b"xyz"),
            vec![0; 1024],
        ]
        .concat();
        let unpack = |bytes: &[u8], max| {
            let folder = tempfile::tempdir().unwrap();
            unpack(bytes, folder.path(), max).map(|names| (names, folder))
        };
        let (files, folder) = unpack(&tar[..], 1000).unwrap();
        assert_eq!(files.iter().collect::<Vec<_>>(), ["recording.json", "u_1.nii.gz"]);
        assert_eq!(std::fs::read(folder.path().join("u_1.nii.gz")).unwrap(), b"xyz");
        for name in ["../x", "/etc/passwd", ".hidden", "a/../b", "a\\b", "a b", "", "ü"] {
            assert_eq!(unpack(&entry(name, b'0', b"")[..], 1000).unwrap_err().status, 422, "{name:?}");
        }
        for kind in [b'1', b'2', b'3', b'6'] {
            assert_eq!(unpack(&entry("x", kind, b"")[..], 1000).unwrap_err().status, 422);
        }
        assert_eq!(unpack(&entry("x", b'0', &[0; 2000])[..], 1000).unwrap_err().status, 413);
        assert_eq!(unpack(&entry("x", b'0', &[0; 900])[..700], 1000).unwrap_err().status, 422);
        assert_eq!(unpack(&b"no tar"[..], 1000).unwrap_err().status, 422);
        let twice = [entry("x", b'0', b""), entry("y/x", b'0', b"")].concat();
        assert_eq!(unpack(&twice[..], 1000).unwrap_err().status, 422);
    }
}
