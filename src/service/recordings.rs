//! Uploaded recordings: a tar file taken apart with bounds, checked by the library's reader, then kept as blobs.
//!
//! Only regular files with plain names are taken; folders before a name are dropped, links and devices refused. The
//! compressed images inside are bounded in what they may unpack to.

use super::problem::Problem;
use super::store::{NewUpload, Store};
use crate::job::{InputFile, JobError, Progress, ScratchFolder, Surroundings, recording_identifier};
use crate::recording::{RawRecording, ReadLimits, ReadRecording, Recording, RecordingError};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Most files of a recording.
const MAX_FILES: usize = 2000;
/// Length of a tar block, bytes.
const BLOCK: usize = 512;

/// What an upload may take.
pub const LIMITS: ReadLimits = ReadLimits { max_file_bytes: 256 << 20, max_values: 40_000_000, max_steps: 200 };

fn unsafe_upload(detail: impl Into<String>) -> Problem {
    Problem::new("unsafe-upload", detail)
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
    let shown: String = name.chars().filter(|c| !c.is_control()).take(60).collect();
    Err(unsafe_upload(format!("the name {shown:?} is not plain; use letters, digits, dots, hyphens and underscores")))
}

fn text_of(field: &[u8]) -> String {
    let end = field.iter().position(|b| *b == 0).unwrap_or(field.len());
    String::from_utf8_lossy(&field[..end]).into_owned()
}

/// Takes a tar file apart.
///
/// # Errors
/// `unsafe-upload`.
pub fn unpack(mut stream: impl Read, max_bytes: usize) -> Result<BTreeMap<String, Vec<u8>>, Problem> {
    let cut = |_| unsafe_upload("the tar file ends in the middle of an entry");
    let mut files = BTreeMap::new();
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
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        total = total.saturating_add(length);
        if total > max_bytes {
            return Err(Problem::new("too-large", format!("the files hold more than {max_bytes} bytes")));
        }
        let mut bytes = Vec::new();
        let padded = length.div_ceil(BLOCK) * BLOCK;
        let read = stream.by_ref().take(padded as u64).read_to_end(&mut bytes).map_err(cut)?;
        if read < padded {
            return Err(unsafe_upload("the tar file ends in the middle of an entry"));
        }
        bytes.truncate(length);
        match header[156] {
            b'0' | 0 => {
                let name = plain_name(&text_of(&header[0..100]))?;
                if files.insert(name.clone(), bytes).is_some() {
                    return Err(unsafe_upload(format!("{name} is there twice")));
                }
                if files.len() > MAX_FILES {
                    return Err(unsafe_upload(format!("more than {MAX_FILES} files")));
                }
            }
            // Folders and extended headers hold nothing that is needed.
            b'5' | b'x' | b'g' => {}
            _ => return Err(unsafe_upload("links and devices are refused")),
        }
    }
    Ok(files)
}

/// A recording as it was uploaded.
enum Uploaded {
    Displacements(Box<ReadRecording>),
    RawPhases(Box<ReadRecording<RawRecording>>),
}

/// Reads a recording from its files.
///
/// # Errors
/// `unsafe-upload` with what the reader says.
fn read(files: &BTreeMap<String, Vec<u8>>) -> Result<Uploaded, Problem> {
    let failed = |e: std::io::Error| Problem::new("internal", format!("scratch: {e}"));
    let scratch = ScratchFolder::new().map_err(failed)?;
    for (name, bytes) in files {
        std::fs::write(scratch.path().join(name), bytes).map_err(failed)?;
    }
    let found = match Recording::read_with_digest(scratch.path(), &LIMITS) {
        Ok(read) => Ok(Uploaded::Displacements(Box::new(read))),
        Err(RecordingError::Raw { .. }) => {
            RawRecording::read_with_digest(scratch.path(), &LIMITS).map(|read| Uploaded::RawPhases(Box::new(read)))
        }
        Err(error) => Err(error),
    };
    found.map_err(|e| {
        // The reader names files by their path here, which is nobody's business.
        let message = e.to_string().replace(&format!("{}/", scratch.path().display()), "");
        unsafe_upload(message)
    })
}

/// An upload to keep, once its files are read without complaint.
///
/// # Errors
/// `unsafe-upload`.
pub fn upload_of(files: BTreeMap<String, Vec<u8>>, owner: String) -> Result<NewUpload, Problem> {
    let force = |drive_mm: f64, force_n: Option<f64>| json!({ "drive_mm": drive_mm, "force_n": force_n });
    let (title, manifest) = match read(&files)? {
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
                "specimen": r.specimen, "shape": r.grid.shape, "voxel_mm": r.grid.voxel_mm, "is_raw": true, "steps": steps,
            });
            (r.id, manifest)
        }
    };
    Ok(NewUpload {
        id: recording_identifier(&files),
        owner,
        title: title.chars().filter(|c| !c.is_control()).take(200).collect(),
        manifest: manifest.to_string(),
        files: files.into_iter().collect(),
    })
}

/// Keeps the recording that job `job` made. Its identifier is a hash of its content.
///
/// # Errors
/// `quota` where recordings fill the service's space.
pub fn keep(store: &Store, job: &str, files: BTreeMap<String, Vec<u8>>) -> Result<String, Problem> {
    let length: usize = files.values().map(Vec::len).sum();
    let kept = usize::try_from(store.uploaded_bytes()?).unwrap_or(0);
    if kept + length > super::limits::Limits::default().max_uploads_bytes {
        return Err(Problem::new("quota", "the recordings fill the service's space"));
    }
    let owner = store.job(job)?.map(|row| row.owner).unwrap_or_default();
    let upload = upload_of(files, owner)?;
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
        let files = self.store.upload_files(name).map_err(|e| JobError::Internal(e.to_string()))?;
        let files: BTreeMap<String, Vec<u8>> = files.into_iter().collect();
        if files.is_empty() {
            return Err(unreadable("the recording is gone; upload it again".into()));
        }
        read(&files).map_err(|problem| unreadable(problem.detail))
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
        let files = unpack(&tar[..], 1000).unwrap();
        assert_eq!(files.keys().collect::<Vec<_>>(), ["recording.json", "u_1.nii.gz"]);
        assert_eq!(files["u_1.nii.gz"], b"xyz");
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
