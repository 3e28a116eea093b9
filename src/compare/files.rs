//! Which files are compared: two files, or the files of the same name in two folders.

use super::error::CompareError;
use std::path::{Path, PathBuf};

/// Two files to be compared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Name in the output: the file's name without its extension.
    pub name: String,
    /// The base.
    pub base: PathBuf,
    /// The current result.
    pub current: PathBuf,
}

/// Pairs the files. Of two folders every `.json` file must have its counterpart in the other.
///
/// # Errors
/// [`CompareError`].
pub fn pairs(base: &Path, current: &Path) -> Result<Vec<Pair>, CompareError> {
    let stem = |p: &Path| p.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    if !(base.is_dir() && current.is_dir()) {
        for path in [base, current] {
            if path.is_dir() {
                let message = "compare two files or two folders".into();
                return Err(CompareError::Read { path: path.into(), message });
            }
        }
        return Ok(vec![Pair { name: stem(current), base: base.into(), current: current.into() }]);
    }
    let (of_base, of_current) = (json_files(base)?, json_files(current)?);
    for (list, other_folder) in [(&of_base, current), (&of_current, base)] {
        for path in list {
            let other = other_folder.join(path.file_name().unwrap_or_default());
            if !other.exists() {
                return Err(CompareError::NoCounterpart { path: path.clone(), other: other_folder.into() });
            }
        }
    }
    if of_base.is_empty() {
        return Err(CompareError::Read { path: base.into(), message: "the folder has no .json file".into() });
    }
    let pair = |path: PathBuf| Pair {
        name: stem(&path),
        current: current.join(path.file_name().unwrap_or_default()),
        base: path,
    };
    Ok(of_base.into_iter().map(pair).collect())
}

fn json_files(folder: &Path) -> Result<Vec<PathBuf>, CompareError> {
    let fail = |e: std::io::Error| CompareError::Read { path: folder.into(), message: e.to_string() };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        if path.extension().is_some_and(|e| e == "json") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}
