//! Where results go: each command has a folder of its own under the name of its input, `results/NAME/COMMAND`.
//!
//! Beside the files lies a list of them (`COMMAND-job.json`). Files of another command are never replaced; files of an
//! earlier run of the same command are, and where its inputs were others, that is said.

use super::error::CliError;
use super::output::{to_json, write_file};
use crate::job::Outcome;
use crate::provenance::VERSION;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A folder of results.
#[derive(Clone, Debug)]
pub(super) struct ResultsFolder {
    path: PathBuf,
    command: String,
}

/// The list of a job's files.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileList {
    schema: String,
    command: String,
    version: String,
    input_hash: String,
    files: Vec<String>,
}

const SCHEMA: &str = "job/1";
/// End of the name of a list of files.
const LIST: &str = "-job.json";

/// `--out`, else `results/NAME/COMMAND` with `NAME` from the stem of `input`.
pub(super) fn default_path(out: Option<&Path>, input: &Path, command: &str) -> PathBuf {
    out.map_or_else(|| Path::new("results").join(stem(input)).join(command), Path::to_path_buf)
}

/// A file's name without folder and ending; of a compressed file (`u.nii.gz`) without both endings.
pub(super) fn stem(path: &Path) -> String {
    let inner = if path.extension().is_some_and(|e| e == "gz") { path.with_extension("") } else { path.to_path_buf() };
    inner.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

impl ResultsFolder {
    /// The folder at `path` for results of `command`, made where it is not there.
    ///
    /// # Errors
    /// [`CliError::Write`]; [`CliError::FolderTaken`] where it holds the results of another command.
    pub(super) fn open(path: PathBuf, command: &str) -> Result<ResultsFolder, CliError> {
        std::fs::create_dir_all(&path).map_err(|source| CliError::Write { path: path.clone(), source })?;
        let folder = ResultsFolder { path, command: command.into() };
        match folder.lists()?.into_iter().find(|l| l.command != command) {
            Some(other) => Err(CliError::FolderTaken { path: folder.path, command: other.command }),
            None => Ok(folder),
        }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The lists of files that lie here.
    fn lists(&self) -> Result<Vec<FileList>, CliError> {
        let fail = |source| CliError::Write { path: self.path.clone(), source };
        let mut lists = Vec::new();
        for entry in std::fs::read_dir(&self.path).map_err(fail)? {
            let entry = entry.map_err(fail)?;
            if entry.file_name().to_string_lossy().ends_with(LIST)
                && let Ok(text) = super::input::read_text(&entry.path())
                && let Ok(list) = serde_json::from_str::<FileList>(&text)
            {
                lists.push(list);
            }
        }
        Ok(lists)
    }

    /// Writes an outcome in place of what an earlier run of the command left.
    ///
    /// # Errors
    /// [`CliError::Write`].
    pub(super) fn write(&self, outcome: &Outcome) -> Result<(), CliError> {
        let mut files: Vec<String> = outcome.files.iter().map(|f| f.name.clone()).collect();
        files.push(outcome.result_name.into());
        for earlier in self.lists()? {
            if earlier.input_hash != outcome.input_hash {
                eprintln!(
                    "{}: replacing the results of an earlier {} with other inputs (input hash {})",
                    self.path.display(),
                    self.command,
                    earlier.input_hash.get(..12).unwrap_or_default()
                );
            }
            for name in earlier.files.iter().filter(|name| !files.contains(name) && is_plain(name)) {
                // It may be gone already.
                let _ = std::fs::remove_file(self.path.join(name));
            }
        }
        for file in &outcome.files {
            write_file(&self.path, &file.name, &file.bytes)?;
        }
        write_file(&self.path, outcome.result_name, outcome.result.as_bytes())?;
        let list = FileList {
            schema: SCHEMA.into(),
            command: self.command.clone(),
            version: VERSION.into(),
            input_hash: outcome.input_hash.clone(),
            files,
        };
        write_file(&self.path, &format!("{}{LIST}", self.command), to_json(&list)?.as_bytes())?;
        Ok(())
    }
}

/// Whether a name is that of a file in the folder itself: a list could have been changed by hand.
fn is_plain(name: &str) -> bool {
    Path::new(name).components().count() == 1 && Path::new(name).file_name().is_some()
}

/// What was written where, for the end of every command.
pub(super) fn said_where(folder: &Path, outcome: &Outcome) -> String {
    let is_page = |name: &&str| name.ends_with(".html");
    let names: Vec<&str> = outcome.files.iter().map(|f| f.name.as_str()).collect();
    let mut text = format!("\nfiles: {} ({} and {} more)\n", folder.display(), outcome.result_name, names.len());
    for page in names.iter().copied().filter(is_page) {
        text += &format!("report: {}\n", folder.join(page).display());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(hash: &str, names: &[&str]) -> Outcome {
        let mut outcome = Outcome::new("solve.json", &1, "").unwrap();
        outcome.input_hash = hash.into();
        names.iter().for_each(|name| outcome.add(*name, *name));
        outcome
    }

    #[test]
    fn compressed_files_lose_both_endings() {
        let names = ["a/u_1.nii.gz", "u_1.nii", "b/study.json", "folder", "v1.2"].map(|n| stem(Path::new(n)));
        assert_eq!(names, ["u_1", "u_1", "study", "folder", "v1"]);
    }

    #[test]
    fn another_commands_files_stay_and_ones_own_are_replaced() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("x");
        let solve = ResultsFolder::open(path.clone(), "solve").unwrap();
        solve.write(&outcome("a", &["one.svg", "two.svg"])).unwrap();
        let taken = ResultsFolder::open(path.clone(), "evaluate").unwrap_err();
        assert!(matches!(taken, CliError::FolderTaken { ref command, .. } if command == "solve"), "{taken}");
        solve.write(&outcome("b", &["two.svg", "three.svg"])).unwrap();
        let mut names: Vec<_> =
            std::fs::read_dir(&path).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        assert_eq!(names, ["solve-job.json", "solve.json", "three.svg", "two.svg"]);
        assert!(!is_plain("../x") && !is_plain("/x") && is_plain("x.svg"));
    }
}
