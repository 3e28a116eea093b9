//! Temporary folders that only this user can open, and that do not outlive the process, however it ends.
//!
//! All folders of a process lie in one that it holds locked. A process that crashed holds nothing any more: the next
//! one that needs a folder removes what it left.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Beginning of the names of processes' folders.
const PREFIX: &str = "lambdak-scratch-";
/// The file that a process holds locked.
const LOCK: &str = "lock";
/// A folder without a lock is left alone for so long: its process may be about to take it.
const GRACE: Duration = Duration::from_secs(60);

/// The folder of this process.
struct Root {
    path: PathBuf,
    _lock: File,
    /// Folders in it.
    num_folders: usize,
}

static ROOT: Mutex<Option<Root>> = Mutex::new(None);

/// A folder that is removed when dropped.
pub struct ScratchFolder(PathBuf);

impl ScratchFolder {
    /// A fresh folder that only this user can open.
    ///
    /// # Errors
    /// Where the system gives no random name or no folder.
    pub fn new() -> std::io::Result<ScratchFolder> {
        let mut root = ROOT.lock().unwrap_or_else(PoisonError::into_inner);
        let taken = root.take();
        let mut held = match taken {
            Some(held) => held,
            None => {
                let held = Root::new(&std::env::temp_dir())?;
                remove_orphans(&std::env::temp_dir(), &held.path);
                held
            }
        };
        let made = private_folder(&held.path, "");
        held.num_folders += usize::from(made.is_ok());
        *root = Some(held);
        made.map(ScratchFolder)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for ScratchFolder {
    fn drop(&mut self) {
        // What cannot be removed is left to the next process.
        let _ = std::fs::remove_dir_all(&self.0);
        let mut root = ROOT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(mut held) = root.take() {
            held.num_folders -= 1;
            if held.num_folders == 0 {
                let _ = std::fs::remove_dir_all(&held.path);
            } else {
                *root = Some(held);
            }
        }
    }
}

impl Root {
    fn new(parent: &Path) -> std::io::Result<Root> {
        let path = private_folder(parent, PREFIX)?;
        let lock = File::create(path.join(LOCK))?;
        lock.try_lock().map_err(std::io::Error::from)?;
        Ok(Root { path, _lock: lock, num_folders: 0 })
    }
}

/// A folder with a random name that only this user can open.
fn private_folder(parent: &Path, prefix: &str) -> std::io::Result<PathBuf> {
    let mut name = [0u8; 8];
    getrandom::fill(&mut name).map_err(std::io::Error::other)?;
    let name: String = name.iter().map(|b| format!("{b:02x}")).collect();
    let path = parent.join(format!("{prefix}{name}"));
    let mut builder = std::fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(&path)?;
    Ok(path)
}

/// Removes this user's folders in `parent` whose process is gone. `own` is this process's.
fn remove_orphans(parent: &Path, own: &Path) {
    let Ok(entries) = std::fs::read_dir(parent) else { return };
    for path in entries.flatten().map(|entry| entry.path()) {
        let is_ours = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(PREFIX));
        if is_ours && path != own && has_same_owner(&path, own) && is_orphan(&path) {
            let _ = std::fs::remove_dir_all(&path);
        }
    }
}

/// Whether both are folders (no links) of one user.
fn has_same_owner(path: &Path, own: &Path) -> bool {
    let (Ok(found), Ok(mine)) = (path.symlink_metadata(), own.symlink_metadata()) else { return false };
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        if found.uid() != mine.uid() {
            return false;
        }
    }
    found.is_dir() && mine.is_dir()
}

fn is_orphan(path: &Path) -> bool {
    match File::open(path.join(LOCK)) {
        Ok(lock) => lock.try_lock().is_ok(),
        Err(_) => {
            let age = path.metadata().and_then(|m| m.modified()).ok().and_then(|at| at.elapsed().ok());
            age.is_some_and(|age| age > GRACE)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_private_and_gone_with_its_owner() {
        let folder = ScratchFolder::new().expect("a folder");
        let (path, root) = (folder.path().to_path_buf(), folder.path().parent().expect("a parent").to_path_buf());
        #[cfg(unix)]
        for path in [&path, &root] {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(path.metadata().expect("it is there").permissions().mode() & 0o777, 0o700);
        }
        std::fs::write(path.join("file"), "content").expect("written");
        drop(folder);
        assert!(!path.exists());
    }

    #[test]
    fn what_a_crash_left_is_removed_and_nothing_else() {
        let parent = tempfile::tempdir().expect("a folder");
        let own = Root::new(parent.path()).expect("a folder");
        let running = Root::new(parent.path()).expect("a folder");
        // The lock of a process that is gone is nobody's.
        let crashed = Root::new(parent.path()).expect("a folder");
        std::fs::write(crashed.path.join("big"), "left").expect("written");
        let left = crashed.path.clone();
        drop(crashed);
        let starting = private_folder(parent.path(), PREFIX).expect("a folder");
        let foreign = private_folder(parent.path(), "other-").expect("a folder");
        remove_orphans(parent.path(), &own.path);
        assert!(!left.exists());
        for kept in [&own.path, &running.path, &starting, &foreign] {
            assert!(kept.exists(), "{}", kept.display());
        }
    }
}
