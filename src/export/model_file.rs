//! The input file of a model for each program.

use super::card::Origin;
use super::convention::Converted;
use super::error::ExportError;
use super::label::label;
use super::model::{Driven, Model, Numbered, Written};
use super::programs::MaterialFormat;
use super::{febio, keywords};
use crate::homogeneous::StressUnit;
use crate::material::Material;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The program that a model is written for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ModelFormat {
    /// Abaqus/Standard: an input file with hybrid elements (C3D20H, C3D15H).
    Abaqus,
    /// CalculiX: an input file with C3D20R or C3D15 elements, which have no pressure of their own.
    Calculix,
    /// FEBio: a model of version 4 with hex20 or penta15 elements.
    Febio,
}

impl ModelFormat {
    /// All of them.
    pub const ALL: [ModelFormat; 3] = [ModelFormat::Abaqus, ModelFormat::Calculix, ModelFormat::Febio];

    /// The convention of its material.
    fn material(self) -> MaterialFormat {
        match self {
            ModelFormat::Abaqus => MaterialFormat::Abaqus,
            ModelFormat::Calculix => MaterialFormat::Calculix,
            ModelFormat::Febio => MaterialFormat::Febio,
        }
    }

    /// The program, as it is called.
    pub fn program(self) -> &'static str {
        self.material().program()
    }

    /// Whether the program reads `material`.
    ///
    /// # Errors
    /// [`ExportError`].
    pub fn check(self, material: &Material) -> Result<(), ExportError> {
        self.convert(material).map(|_| ())
    }

    /// `material` in the program's convention in MPa, which go with mm and N.
    fn convert(self, material: &Material) -> Result<Converted, ExportError> {
        self.material().convert(material, StressUnit::MPa)
    }

    /// Name of the model's file.
    pub fn file_name(self) -> &'static str {
        match self {
            ModelFormat::Abaqus => "model-abaqus.inp",
            ModelFormat::Calculix => "model-calculix.inp",
            ModelFormat::Febio => "model-febio.feb",
        }
    }
}

/// What the reader of a file should know.
fn comments(model: &Model, origin: &Origin) -> Vec<String> {
    let Origin { name, version, input_hash } = origin;
    let name = name.replace(['\n', '\r'], " ");
    let planes: Vec<&str> = [(model.mesh.mirror.y, "y = 0"), (model.mesh.mirror.z, "z = 0")]
        .into_iter()
        .filter_map(|(is_used, plane)| is_used.then_some(plane))
        .collect();
    let part = match &planes[..] {
        [] => "The mesh is a whole sample.".to_string(),
        [one] => format!("The mesh ends at the mirror plane {one}."),
        several => format!("The mesh ends at the mirror planes {}.", several.join(" and ")),
    };
    let way = match model.direction {
        [x, _, _] if x >= 1.0 => "x".to_string(),
        [x, y, z] => format!("({x:.6}, {y:.6}, {z:.6})"),
    };
    let beside = match model.beside_drive_mm {
        mm if mm.iter().all(|c| *c == 0.0) => String::new(),
        [x, y, z] => format!(" Beside that it is moved by ({x}, {y}, {z}) mm in the first step, and stays there."),
    };
    vec![
        format!("{name}: written by lambdak {version} (inputs {input_hash})"),
        format!(
            "Lengths in mm, forces in N, stresses in MPa. The moved face is driven along {way}, one load step for each drive.{beside}"
        ),
        format!("{part} Forces of the whole test are the reactions on the moved face times {}.", model.multiplicity),
    ]
}

/// The input file of a program.
///
/// # Errors
/// [`ExportError`].
pub fn model_file(model: &Model, format: ModelFormat, origin: &Origin) -> Result<String, ExportError> {
    let numbered = Numbered::new(model.mesh);
    let written = Written {
        kind: model.mesh.element_kind,
        material: format.convert(model.material)?,
        drives_mm: model.drives_mm,
        driven: Driven::of(model),
        comments: comments(model, origin),
        name: label(origin.name),
    };
    Ok(match format {
        ModelFormat::Abaqus => keywords::deck(&written, &numbered, &keywords::ABAQUS),
        ModelFormat::Calculix => keywords::deck(&written, &numbered, &keywords::CALCULIX),
        ModelFormat::Febio => febio::deck(&written, &numbered),
    })
}
