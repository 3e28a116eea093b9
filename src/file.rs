//! Reading files that a user names: regular files only, and never more than a limit.
//!
//! A pipe would block, a device such as `/dev/zero` never ends, and the size that the system tells for some files
//! (those of `/proc`) is not what they hold. So the kind is checked before and after opening, and the limit while
//! reading.

#[cfg(feature = "calibration")]
mod digest;
mod memory;

#[cfg(feature = "calibration")]
pub use digest::{digest_of_file, digest_of_path};
pub use memory::{MemoryError, MemoryLimit, MemoryPool, ReadingMemory, StopFlag, json_bytes};

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Most files of a folder and below it; a study of a scanner has some thousands.
const MAX_FILES: usize = 100_000;

/// Why a file was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// It is a folder, a pipe, a device or a socket.
    #[error("not a regular file; give the path of one, not of a folder, a pipe or a device")]
    NotRegular,
    /// It holds more than allowed.
    #[error("more than {limit} bytes")]
    TooLarge {
        /// Most bytes.
        limit: u64,
    },
    /// A folder has more files than are read.
    #[error("more than {limit} files lie in this folder and below; give a folder of the study alone")]
    TooMany {
        /// Most files.
        limit: usize,
    },
    /// What it holds would take more memory than reading may.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// What the system said.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl ReadError {
    /// The same as an error of the system, for errors that hold one.
    pub fn into_io(self) -> io::Error {
        match self {
            ReadError::Io(error) => error,
            other => io::Error::new(io::ErrorKind::InvalidInput, other),
        }
    }
}

/// Opens a regular file to read from it.
///
/// # Errors
/// [`ReadError::NotRegular`], [`ReadError::Io`].
pub fn open_regular(path: &Path) -> Result<File, ReadError> {
    // Before opening: to open a pipe waits for its other end.
    if !fs::metadata(path)?.is_file() {
        return Err(ReadError::NotRegular);
    }
    let file = File::open(path)?;
    if file.metadata()?.is_file() { Ok(file) } else { Err(ReadError::NotRegular) }
}

/// The content of a regular file of at most `max_bytes`.
///
/// # Errors
/// [`ReadError`].
pub fn read_limited(path: &Path, max_bytes: u64) -> Result<Vec<u8>, ReadError> {
    let file = open_regular(path)?;
    let mut bytes = Vec::new();
    file.take(max_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > max_bytes { Err(ReadError::TooLarge { limit: max_bytes }) } else { Ok(bytes) }
}

/// The text of a regular file of at most `max_bytes`.
///
/// # Errors
/// [`ReadError`]; [`io::ErrorKind::InvalidData`] where the content is not UTF-8.
pub fn read_text_limited(path: &Path, max_bytes: u64) -> Result<String, ReadError> {
    let no_text = |_| io::Error::new(io::ErrorKind::InvalidData, "the file holds no UTF-8 text");
    Ok(String::from_utf8(read_limited(path, max_bytes)?).map_err(no_text)?)
}

/// The text of a table as programs of test machines and cameras write it: in UTF-8, in UTF-16 where it begins with the
/// mark of one, and else in Latin-1, in which `µ`, `ü` and `²` are one byte each. None where the bytes are no text.
pub fn table_text(bytes: Vec<u8>) -> Option<String> {
    let utf16 = |of_pair: fn([u8; 2]) -> u16| {
        let (pairs, rest) = bytes[2..].as_chunks::<2>();
        let text = String::from_utf16(&pairs.iter().map(|pair| of_pair(*pair)).collect::<Vec<_>>());
        text.ok().filter(|_| rest.is_empty())
    };
    match bytes.as_slice() {
        [0xff, 0xfe, ..] => utf16(u16::from_le_bytes),
        [0xfe, 0xff, ..] => utf16(u16::from_be_bytes),
        _ => match String::from_utf8(bytes) {
            Ok(text) => Some(text),
            Err(error) if error.as_bytes().contains(&0) => None,
            Err(error) => Some(error.as_bytes().iter().map(|&byte| char::from(byte)).collect()),
        },
    }
}

/// The text of a table in a regular file of at most `max_bytes` ([`table_text`]).
///
/// # Errors
/// [`ReadError`]; [`io::ErrorKind::InvalidData`] where the content is no text.
pub fn read_table_limited(path: &Path, max_bytes: u64) -> Result<String, ReadError> {
    let no_text = || io::Error::new(io::ErrorKind::InvalidData, "it is not text in UTF-8, UTF-16 or Latin-1");
    Ok(table_text(read_limited(path, max_bytes)?).ok_or_else(no_text)?)
}

/// The JSON text of a regular file of at most `max_bytes`, whose values fit in the memory of a command's reading.
///
/// # Errors
/// [`ReadError`]; [`io::ErrorKind::InvalidData`] where the content is not UTF-8.
pub fn read_json_text(path: &Path, max_bytes: u64) -> Result<String, ReadError> {
    let memory = MemoryLimit::command().begin();
    memory.take("the file", fs::metadata(path)?.len().min(max_bytes))?;
    let text = read_text_limited(path, max_bytes)?;
    memory.take("the file's JSON", json_bytes(text.as_bytes()))?;
    Ok(text)
}

/// The regular files in a folder and below it, sorted by their paths; of a file itself. Links to folders are not
/// followed: they may lead in circles.
///
/// # Errors
/// [`ReadError::TooMany`], [`ReadError::NotRegular`] where `path` is neither, [`ReadError::Io`].
pub fn files_below(path: &Path) -> Result<Vec<PathBuf>, ReadError> {
    let kind = fs::metadata(path)?;
    if !kind.is_dir() {
        return if kind.is_file() { Ok(vec![path.into()]) } else { Err(ReadError::NotRegular) };
    }
    let (mut folders, mut files) = (vec![path.to_path_buf()], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            if entry.file_type()?.is_dir() {
                folders.push(entry.path());
            } else if fs::metadata(entry.path()).is_ok_and(|kind| kind.is_file()) {
                files.push(entry.path());
            }
            if files.len() + folders.len() > MAX_FILES {
                return Err(ReadError::TooMany { limit: MAX_FILES });
            }
        }
    }
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The digest of a folder is that of its files' names and contents, wherever it lies.
    #[test]
    fn a_folder_is_known_by_its_files() {
        let folder = tempfile::tempdir().expect("a folder");
        let place = |name: &str| folder.path().join(name);
        for name in ["a", "b"] {
            fs::create_dir_all(place(name).join("1/pdata")).expect("made");
            fs::write(place(name).join("1/pdata/x"), "one").expect("written");
            fs::write(place(name).join("2"), "two").expect("written");
        }
        let digest = |name: &str| digest_of_path(&place(name)).expect("read");
        assert_eq!(files_below(&place("a")).expect("listed"), [place("a/1/pdata/x"), place("a/2")]);
        assert_eq!(digest("a"), digest("b"));
        assert_eq!(digest("a/2"), digest_of_file(&place("b/2")).expect("read"));
        fs::write(place("b/1/pdata/x"), "One").expect("written");
        assert_ne!(digest("a"), digest("b"));
        fs::write(place("b/1/pdata/x"), "one").expect("written");
        fs::rename(place("b/2"), place("b/3")).expect("renamed");
        assert_ne!(digest("a"), digest("b"));
    }

    /// The same words in every code; what is none of them is no text.
    #[test]
    fn tables_are_text_in_several_codes() {
        let words = "Prüfer;Weg [µm]\n1;2\n";
        let utf16 = |bytes: fn(u16) -> [u8; 2]| format!("\u{feff}{words}").encode_utf16().flat_map(bytes).collect();
        let codes: [Vec<u8>; 4] = [
            words.as_bytes().to_vec(),
            words.chars().map(|c| u8::try_from(c).expect("Latin-1")).collect(),
            utf16(u16::to_le_bytes),
            utf16(u16::to_be_bytes),
        ];
        for bytes in codes {
            let text = table_text(bytes).expect("text");
            assert_eq!(text.trim_start_matches('\u{feff}'), words);
        }
        for bytes in [&b"1;2\n\xff\0"[..], b"\xff\xfea", b"\xff\xfe\0\xd8"] {
            assert_eq!(table_text(bytes.to_vec()), None);
        }
    }

    #[test]
    fn a_regular_file_is_read_up_to_its_limit() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("ten");
        fs::write(&path, "0123456789").expect("written");
        assert_eq!(read_text_limited(&path, 10).expect("it fits"), "0123456789");
        assert!(matches!(read_limited(&path, 9), Err(ReadError::TooLarge { limit: 9 })));
        assert!(matches!(read_limited(&folder.path().join("none"), 9), Err(ReadError::Io(_))));
        fs::write(&path, [0xff, 0xfe]).expect("written");
        assert!(
            matches!(read_text_limited(&path, 10), Err(ReadError::Io(e)) if e.kind() == io::ErrorKind::InvalidData)
        );
    }

    #[cfg(unix)]
    #[test]
    fn pipes_devices_and_folders_are_refused_without_waiting() {
        let folder = tempfile::tempdir().expect("a folder");
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo runs");
        assert!(made.success());
        for path in [pipe.as_path(), folder.path(), Path::new("/dev/zero")] {
            assert!(matches!(read_limited(path, 10), Err(ReadError::NotRegular)), "{}", path.display());
        }
    }

    /// The system says that files of `/proc` are empty; the limit holds all the same.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_of_unknown_size_is_limited_while_reading() {
        let path = Path::new("/proc/self/status");
        assert_eq!(fs::metadata(path).expect("it is there").len(), 0);
        assert!(matches!(read_limited(path, 10), Err(ReadError::TooLarge { limit: 10 })));
        assert!(!read_limited(path, 1 << 20).expect("it fits").is_empty());
    }
}
