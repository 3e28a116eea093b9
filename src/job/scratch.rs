//! A temporary folder.

use std::path::{Path, PathBuf};

/// A folder that is removed when dropped.
pub struct ScratchFolder(PathBuf);

impl ScratchFolder {
    /// A fresh folder that only this user can open.
    ///
    /// # Errors
    /// Where the system gives no random name or no folder.
    pub fn new() -> std::io::Result<ScratchFolder> {
        let mut name = [0u8; 8];
        getrandom::fill(&mut name).map_err(std::io::Error::other)?;
        let name: String = name.iter().map(|b| format!("{b:02x}")).collect();
        let path = std::env::temp_dir().join(format!("lambdak-{name}"));
        let mut builder = std::fs::DirBuilder::new();
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        builder.create(&path)?;
        Ok(ScratchFolder(path))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for ScratchFolder {
    fn drop(&mut self) {
        // What cannot be removed is left to the system's own cleaning.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
