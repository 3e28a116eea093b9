//! Reading what the commands are given.

use super::error::CliError;
use crate::file::{ReadError, read_json_text, read_limited, table_text};
use serde_json::Value;
use std::path::Path;

/// Largest file that is read as a part of a request: specimens, materials and studies are a few kilobytes, results of
/// sweeps more.
const MAX_FILE_BYTES: u64 = 256 << 20;

/// Text of a file.
///
/// # Errors
/// [`CliError::Read`]; [`CliError::Input`] for a file that is no regular one, too large, or not text.
pub fn read_text(path: &Path) -> Result<String, CliError> {
    let no_text = |_| CliError::Input { path: path.into(), message: "it is not text in UTF-8".into() };
    String::from_utf8(read_bytes(path)?).map_err(no_text)
}

/// Text of a table as programs of test machines write it ([`table_text`]).
///
/// # Errors
/// As [`read_text`].
pub fn read_table(path: &Path) -> Result<String, CliError> {
    let message = "it is not text in UTF-8, UTF-16 or Latin-1";
    table_text(read_bytes(path)?).ok_or_else(|| CliError::Input { path: path.into(), message: message.into() })
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, CliError> {
    read_limited(path, MAX_FILE_BYTES).map_err(|e| match e {
        ReadError::Io(source) => CliError::Read { path: path.into(), source },
        other => CliError::Input { path: path.into(), message: other.to_string() },
    })
}

/// JSON of a file.
///
/// # Errors
/// [`CliError::Input`].
pub fn read_json(path: &Path) -> Result<Value, CliError> {
    let bad = |message: String| CliError::Input { path: path.into(), message };
    let text = read_json_text(path, MAX_FILE_BYTES).map_err(|e| match e {
        ReadError::Io(source) if source.kind() == std::io::ErrorKind::InvalidData => bad(source.to_string()),
        ReadError::Io(source) => CliError::Read { path: path.into(), source },
        other => bad(other.to_string()),
    })?;
    serde_json::from_str(&text).map_err(|e| CliError::Input { path: path.into(), message: format!("not JSON: {e}") })
}

/// A study with the specimen and the materials that it names spelled out, as requests hold them.
///
/// # Errors
/// [`CliError::Input`].
pub fn read_study(path: &Path) -> Result<Value, CliError> {
    let beside = path.parent().unwrap_or(Path::new("."));
    let mut study = read_json(path)?;
    let spell_out = |value: &mut Value| -> Result<(), CliError> {
        if let Value::String(name) = value {
            *value = read_json(&beside.join(name.as_str()))?;
        }
        Ok(())
    };
    if let Some(base) = study.get_mut("base") {
        spell_out(base)?;
    }
    for entry in study.get_mut("materials").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(material) = entry.get_mut("material") {
            spell_out(material)?;
        }
    }
    Ok(study)
}
