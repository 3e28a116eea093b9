//! The files of a recording's folder: read up to their limits, with a digest of all that was read.

use super::nifti::Image;
use super::{ReadLimits, RecordingError};
use crate::file::{ReadError, ReadingMemory, json_bytes, open_regular};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufReader, Read, Take};
use std::path::{Path, PathBuf};

/// Texts are read in pieces of so many bytes.
const TEXT_PIECE: u64 = 1 << 18;

/// Reads files of one folder, in whatever order they are asked for; the digest depends on that order.
pub(super) struct FolderReader<'a> {
    folder: PathBuf,
    limits: &'a ReadLimits,
    memory: ReadingMemory,
    digest: Sha256,
}

/// A file that is hashed and counted while it is read.
struct HashedFile {
    file: BufReader<Take<File>>,
    digest: Sha256,
    num_bytes: u64,
}

impl Read for HashedFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.digest.update(&buffer[..count]);
        self.num_bytes += count as u64;
        Ok(count)
    }
}

impl<'a> FolderReader<'a> {
    /// A reader of files in `folder`; nothing is read yet.
    pub(super) fn new(folder: &Path, limits: &'a ReadLimits) -> Self {
        FolderReader { folder: folder.into(), limits, memory: limits.memory.begin(), digest: Sha256::new() }
    }

    /// The path of a file, whose name is a plain one.
    ///
    /// # Errors
    /// [`RecordingError::FileName`].
    pub(super) fn path(&self, name: &str) -> Result<PathBuf, RecordingError> {
        let is_plain = !name.is_empty() && !name.contains(['/', '\\', ':', '\0']) && name != "." && name != "..";
        if is_plain { Ok(self.folder.join(name)) } else { Err(RecordingError::FileName { name: name.into() }) }
    }

    /// The memory of everything that is read from the folder.
    pub(super) fn memory(&self) -> &ReadingMemory {
        &self.memory
    }

    /// The text of a file. Its memory is taken piece by piece and kept taken.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub(super) fn text(&mut self, name: &str) -> Result<String, RecordingError> {
        self.read(name, |path, file, memory| {
            let fail = |source| RecordingError::File { path: path.into(), source };
            let mut bytes = Vec::new();
            loop {
                // A list that grows holds its old place beside the new one.
                memory.take("a text file", 3 * TEXT_PIECE)?;
                if (file.by_ref().take(TEXT_PIECE).read_to_end(&mut bytes).map_err(fail)? as u64) < TEXT_PIECE {
                    break;
                }
            }
            String::from_utf8(bytes).map_err(|e| fail(io::Error::new(io::ErrorKind::InvalidData, e.utf8_error())))
        })
    }

    /// The text of a JSON file whose values fit in the reading's memory.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub(super) fn json_text(&mut self, name: &str) -> Result<String, RecordingError> {
        let text = self.text(name)?;
        self.memory.take("a JSON file", json_bytes(text.as_bytes()))?;
        Ok(text)
    }

    /// An image.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub(super) fn image(&mut self, name: &str) -> Result<Image, RecordingError> {
        self.read(name, |path, file, memory| {
            Image::read(file, memory).map_err(|source| RecordingError::Image { path: path.into(), source })
        })
    }

    fn read<T>(
        &mut self,
        name: &str,
        parse: impl FnOnce(&Path, &mut HashedFile, &ReadingMemory) -> Result<T, RecordingError>,
    ) -> Result<T, RecordingError> {
        let path = self.path(name)?;
        let fail = |source| RecordingError::File { path: path.clone(), source };
        let limit = self.limits.max_file_bytes;
        let file = match open_regular(&path) {
            Ok(file) => BufReader::new(file.take(limit.saturating_add(1))),
            Err(ReadError::Io(source)) => return Err(fail(source)),
            Err(_) => return Err(RecordingError::NotRegular { path }),
        };
        let mut file = HashedFile { file, digest: Sha256::new(), num_bytes: 0 };
        let parsed = parse(&path, &mut file, &self.memory);
        // What stands behind an image's data belongs to the file, too.
        let rest = io::copy(&mut file, &mut io::sink());
        if file.num_bytes > limit {
            return Err(RecordingError::TooLarge { path, limit });
        }
        let parsed = parsed?;
        rest.map_err(fail)?;
        self.digest.update((name.len() as u64).to_le_bytes());
        self.digest.update(name.as_bytes());
        self.digest.update(file.digest.finalize());
        Ok(parsed)
    }

    /// SHA-256 over name and content of every file that was read, hexadecimal, and the memory that what was read holds.
    pub(super) fn finish(self) -> (String, ReadingMemory) {
        (self.digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect(), self.memory)
    }
}
