//! The text of a material for each program.

use super::convention::{Constant, Converted, Shape};
use super::error::ExportError;
use super::label::label;
use super::programs::MaterialFormat;
use crate::homogeneous::StressUnit;
use crate::material::Material;

/// Numbers on a line of Abaqus and CalculiX.
const PER_LINE: usize = 8;
/// Constants of one `TBDATA` command.
const PER_TBDATA: usize = 6;

/// Where a file comes from, for its comments.
#[derive(Clone, Copy, Debug)]
pub struct Origin<'a> {
    /// What is written, such as the material's name.
    pub name: &'a str,
    /// Version of the program.
    pub version: &'a str,
    /// SHA-256 of what went in, hexadecimal.
    pub input_hash: &'a str,
}

/// `material` as the program of `format` reads it, with stresses in `unit`.
///
/// ```
/// use lambdak::export::{MaterialFormat, Origin, material_card};
/// use lambdak::homogeneous::StressUnit;
/// use lambdak::material::Material;
/// let text = r#"{ "schema": "ogden/1", "bulk_kpa": 2000.0, "terms": [{ "mu_kpa": 16.0, "alpha": 2.0 }] }"#;
/// let origin = Origin { name: "silicone", version: "0.1.0", input_hash: "" };
/// let card = material_card(&Material::from_json(text)?, MaterialFormat::Abaqus, StressUnit::MPa, &origin)?;
/// assert!(card.ends_with("*HYPERELASTIC, OGDEN, N=1\n1.6e-2, 2.0e0, 1.0e0\n"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ExportError`].
pub fn material_card(
    material: &Material,
    format: MaterialFormat,
    unit: StressUnit,
    origin: &Origin,
) -> Result<String, ExportError> {
    let converted = format.convert(material, unit)?;
    let lines = comments(&converted, format, material.law_name(), unit, origin);
    Ok(match format {
        MaterialFormat::Abaqus | MaterialFormat::Calculix => {
            commented("** ", &lines) + &keyword_material(&converted, &label(origin.name))
        }
        MaterialFormat::Ansys => commented("! ", &lines) + &commands(&converted),
        MaterialFormat::Comsol => commented("% ", &lines) + &parameters(&converted),
        MaterialFormat::Febio => {
            // Two minus signs end a comment in XML.
            let inner = lines.join("\n  ").replace("--", "- -");
            format!("<!-- {inner} -->\n{}", febio_material(&converted, &label(origin.name), ""))
        }
    })
}

/// What the reader of a card should know.
fn comments(
    converted: &Converted,
    format: MaterialFormat,
    law: &str,
    unit: StressUnit,
    origin: &Origin,
) -> Vec<String> {
    let Origin { name, version, input_hash } = origin;
    let name = name.replace(['\n', '\r'], " ");
    let (convention, program, unit) = (converted.convention, format.program(), unit.symbol());
    let meaning = match convention.shape {
        Shape::Terms { .. } => "l1, l2, l3: principal stretches times J^(-1/3)",
        Shape::Law { .. } if convention.energy.contains("I2") => {
            "I1, I2: sums of the squares of the principal stretches, times J^(-2/3), and of their inverses, times J^(2/3)"
        }
        Shape::Law { .. } => "I1: sum of the squares of the principal stretches, times J^(-2/3)",
    };
    vec![
        format!("{name}: {law} material for {program}, written by lambdak {version} (inputs {input_hash})"),
        format!("Stresses in {unit}. {meaning}."),
        convention.energy.to_string(),
        format!("Volume: {}.", convention.law.meaning()),
    ]
}

fn commented(mark: &str, lines: &[String]) -> String {
    lines.iter().map(|line| format!("{mark}{line}\n")).collect()
}

/// `*MATERIAL` with `*HYPERELASTIC` as Abaqus and CalculiX read it: the constants of the change of shape, then D_1 and
/// further, of which those after the first are no part of the energy.
pub(super) fn keyword_material(converted: &Converted, name: &str) -> String {
    let lines: String = converted.padded().chunks(PER_LINE).map(|line| line.join(", ") + "\n").collect();
    let order = converted.order().map_or(String::new(), |order| format!(", N={order}"));
    format!("*MATERIAL, NAME={name}\n*HYPERELASTIC, {}{order}\n{lines}", converted.convention.keyword)
}

/// Commands of Ansys for the material number 1; d_2 and further are zero where they are not given (no such term).
fn commands(converted: &Converted) -> String {
    let order = converted.order().map_or(String::new(), |order| order.to_string());
    let mut text = format!("TB,HYPER,1,1,{order},{}\n", converted.convention.keyword);
    for (index, part) in converted.constants.chunks(PER_TBDATA).enumerate() {
        let numbers: Vec<String> = part.iter().map(Constant::text).collect();
        text += &format!("TBDATA,{},{}\n", PER_TBDATA * index + 1, numbers.join(","));
    }
    text
}

/// Parameters as COMSOL loads them: name, expression with unit, description.
fn parameters(converted: &Converted) -> String {
    let line = |c: &Constant| {
        // A plain number has no unit there.
        let unit = if c.unit == "1" { String::new() } else { format!("[{}]", c.unit) };
        format!("{} {}{unit} \"{} material\"\n", c.name, c.text(), converted.convention.keyword)
    };
    converted.constants.iter().map(line).collect()
}

/// A `material` of FEBio.
pub(super) fn febio_material(converted: &Converted, name: &str, indent: &str) -> String {
    let kind = converted.convention.keyword;
    let mut text = format!("{indent}<material id=\"1\" name=\"{name}\" type=\"{kind}\">\n");
    for c in &converted.constants {
        let tag = c.name.replace('_', "");
        text += &format!("{indent}  <{tag}>{}</{tag}>\n", c.text());
    }
    text + &format!("{indent}</material>\n")
}
