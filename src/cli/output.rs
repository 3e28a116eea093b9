//! Writing: files through a temporary one, JSON or text on stdout.

use super::error::CliError;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes `bytes` to `folder/name` through a temporary file, so that a reader or a crash never sees half of it.
///
/// # Errors
/// [`CliError::Write`].
pub fn write_file(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, CliError> {
    let path = folder.join(name);
    let temporary = folder.join(format!(".{name}.part"));
    let fail = |source| CliError::Write { path: path.clone(), source };
    std::fs::create_dir_all(folder).map_err(fail)?;
    std::fs::write(&temporary, bytes).map_err(fail)?;
    std::fs::rename(&temporary, &path).map_err(fail)?;
    Ok(path)
}

/// Writes `text` to a file that the command line names.
///
/// # Errors
/// [`CliError::Write`].
pub fn write_named(path: &Path, text: &str) -> Result<(), CliError> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    write_file(folder, &name, text.as_bytes()).map(|_| ())
}

/// Pretty JSON with a final newline.
///
/// # Errors
/// [`CliError::Numerics`] for a value that JSON cannot hold.
pub fn to_json<T: Serialize>(value: &T) -> Result<String, CliError> {
    let mut text = serde_json::to_string_pretty(value).map_err(|e| CliError::Numerics(e.to_string()))?;
    text.push('\n');
    Ok(text)
}

/// Prints on stdout; a closed pipe is not an error.
///
/// # Errors
/// [`CliError::Write`].
pub fn print(text: &str) -> Result<(), CliError> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        Err(source) => Err(CliError::Write { path: "stdout".into(), source }),
        Ok(()) => Ok(()),
    }
}
