//! The files of a recording's folder: read up to their limits, with a digest of all that was read.

use super::nifti::Image;
use super::{ReadLimits, RecordingError};
use crate::file::{ReadError, open_regular};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufReader, Read, Take};
use std::path::{Path, PathBuf};

/// Reads files of one folder, in whatever order they are asked for; the digest depends on that order.
pub(super) struct FolderReader<'a> {
    folder: PathBuf,
    limits: &'a ReadLimits,
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
        FolderReader { folder: folder.into(), limits, digest: Sha256::new() }
    }

    /// The path of a file, whose name is a plain one.
    ///
    /// # Errors
    /// [`RecordingError::FileName`].
    pub(super) fn path(&self, name: &str) -> Result<PathBuf, RecordingError> {
        let is_plain = !name.is_empty() && !name.contains(['/', '\\', ':', '\0']) && name != "." && name != "..";
        if is_plain { Ok(self.folder.join(name)) } else { Err(RecordingError::FileName { name: name.into() }) }
    }

    /// The text of a file.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub(super) fn text(&mut self, name: &str) -> Result<String, RecordingError> {
        self.read(name, |path, file| {
            let mut text = String::new();
            file.read_to_string(&mut text).map_err(|source| RecordingError::File { path: path.into(), source })?;
            Ok(text)
        })
    }

    /// An image.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub(super) fn image(&mut self, name: &str) -> Result<Image, RecordingError> {
        let max_values = self.limits.max_values;
        self.read(name, |path, file| {
            Image::read(file, max_values).map_err(|source| RecordingError::Image { path: path.into(), source })
        })
    }

    fn read<T>(
        &mut self,
        name: &str,
        parse: impl FnOnce(&Path, &mut HashedFile) -> Result<T, RecordingError>,
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
        let parsed = parse(&path, &mut file);
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

    /// SHA-256 over name and content of every file that was read, hexadecimal.
    pub(super) fn digest(self) -> String {
        self.digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}
