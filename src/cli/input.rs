//! Reading what the commands are given.

use super::error::CliError;
use crate::file::{ReadError, read_text_limited};
use crate::material::Ogden;
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;
use std::path::Path;

/// Largest file that is read: specimens, materials and studies are a few kilobytes.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// Text of a small file.
///
/// # Errors
/// [`CliError::Read`], [`CliError::Input`] for what is no regular file or too large.
pub fn read_text(path: &Path) -> Result<String, CliError> {
    read_text_limited(path, MAX_FILE_BYTES).map_err(|error| match error {
        ReadError::Io(source) => CliError::Read { path: path.into(), source },
        other => {
            let message = format!("{other}; this is not a specimen, material or study");
            CliError::Input { path: path.into(), message }
        }
    })
}

/// A specimen file.
///
/// # Errors
/// [`CliError`].
pub fn read_specimen(path: &Path) -> Result<Specimen, CliError> {
    Specimen::from_json(&read_text(path)?).map_err(|e| CliError::Input { path: path.into(), message: e.to_string() })
}

/// A material file; without one, Ecoflex 00-20 as calibrated in the paper (κ 2173 kPa, μ₁ 17.0 kPa, α₁ 1.91).
///
/// # Errors
/// [`CliError`].
pub fn read_material(path: Option<&Path>) -> Result<Ogden, CliError> {
    let Some(path) = path else {
        let text = include_str!("../../geometries/materials/ecoflex-0020.json");
        return Ogden::from_json(text).map_err(|e| CliError::Numerics(e.to_string()));
    };
    Ogden::from_json(&read_text(path)?).map_err(|e| CliError::Input { path: path.into(), message: e.to_string() })
}

/// `search`, `standard`, `fine`, or a factor on the standard element size.
///
/// # Errors
/// [`CliError::Option`].
pub fn mesh_options(text: &str, specimen: &Specimen, use_mirror: bool) -> Result<MeshOptions, CliError> {
    let options = match text {
        "search" => MeshOptions::search(specimen),
        "standard" => MeshOptions::standard(specimen),
        "fine" => MeshOptions::fine(specimen),
        other => match other.parse::<f64>() {
            Ok(factor) if (0.2..=5.0).contains(&factor) => MeshOptions::scaled(specimen, factor),
            _ => {
                return Err(CliError::Option {
                    option: "mesh",
                    message: format!("'{other}' is not search, standard, fine or a size factor from 0.2 to 5"),
                });
            }
        },
    };
    Ok(MeshOptions { use_mirror: options.use_mirror && use_mirror, ..options })
}

/// The same names as a factor on the standard element size.
///
/// # Errors
/// [`CliError::Option`].
pub fn mesh_factor(text: &str) -> Result<f64, CliError> {
    match text {
        "search" => Ok(1.8),
        "standard" => Ok(1.0),
        "fine" => Ok(0.6),
        other => match other.parse::<f64>() {
            Ok(factor) if (0.2..=5.0).contains(&factor) => Ok(factor),
            _ => Err(CliError::Option {
                option: "mesh",
                message: format!("'{other}' is not search, standard, fine or a size factor from 0.2 to 5"),
            }),
        },
    }
}

/// Three comma-separated numbers, or one for all three.
///
/// # Errors
/// [`CliError::Option`].
pub fn triple(option: &'static str, text: &str) -> Result<[f64; 3], CliError> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|s| s.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some([a]) => Ok([*a; 3]),
        Some([a, b, c]) => Ok([*a, *b, *c]),
        _ => Err(CliError::Option {
            option,
            message: format!("'{text}' is not one number or three, such as 1,0.1875,0.75"),
        }),
    }
}
