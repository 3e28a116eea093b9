//! Export of a material: its card for other programs, each in that program's own convention.
//!
//! It reads a material and writes files, without solving anything; that it is a kind of job all the same gives it the
//! same check, provenance and two doors as every other result.

use super::export_result::Card;
use super::{Context, JobError, Outcome, Request, ResultSchema, Run, summary};
use crate::export::{Converted, ExportError, MaterialFormat, Origin, material_card};
use crate::field::FieldError;
use crate::homogeneous::StressUnit;
use crate::material::Material;
use crate::provenance::VERSION;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Body of the export of a material.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ExportMaterialRequest {
    /// The material, Ogden's or another law, such as the `material.json` of a fit.
    pub material: Material,
    /// Name of the material in the files; that of its law, such as `ogden`, where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub name: Option<String>,
    /// Programs that it is written for; all that have its law and read so many terms where the list is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 5)]
    pub formats: Option<Vec<MaterialFormat>>,
    /// Unit of stress in the files. With lengths in mm and forces in N it is MPa.
    #[serde(default = "stress_unit")]
    #[schema(default = stress_unit)]
    pub stress_unit: StressUnit,
}

pub(super) fn stress_unit() -> StressUnit {
    StressUnit::MPa
}

/// Result (`export-material/1`).
#[derive(Serialize, ToSchema)]
struct ExportMaterialResult<'a> {
    schema: &'static str,
    version: &'static str,
    input_hash: &'a str,
    name: &'a str,
    material: &'a Material,
    stress_unit: StressUnit,
    cards: &'a [Card],
}

impl ExportMaterialRequest {
    fn name(&self) -> String {
        self.name.clone().unwrap_or_else(|| self.material.law_name().to_lowercase())
    }

    fn card(&self, format: MaterialFormat) -> Result<Card, ExportError> {
        let Converted { convention, constants } = format.convert(&self.material, self.stress_unit)?;
        Ok(Card {
            format,
            program: format.program(),
            file: format.file_name(),
            constants,
            energy: convention.energy,
            volumetric_law: convention.law,
            manual: convention.manual,
        })
    }

    /// The cards that are asked for.
    fn cards(&self) -> Result<Vec<Card>, FieldError> {
        match &self.formats {
            None => Ok(MaterialFormat::ALL.into_iter().filter_map(|f| self.card(f).ok()).collect()),
            Some(formats) => {
                let unfit = |(index, e): (usize, ExportError)| {
                    FieldError::new(format!("/formats/{index}"), formats[index].program(), "left out")
                        .remedy(e.to_string())
                };
                let card = |(index, &f): (usize, &MaterialFormat)| self.card(f).map_err(|e| unfit((index, e)));
                formats.iter().enumerate().map(card).collect()
            }
        }
    }
}

impl Request for ExportMaterialRequest {
    const COMMAND: &'static str = "export-material";
    const COLLECTION: &'static str = "material-exports";
    const ABOUT: &'static str = "A material as Abaqus, Ansys, CalculiX, COMSOL and FEBio read it.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "material": super::defaults::ecoflex(), "stress_unit": "kpa" })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<ExportMaterialResult>("export-material/1")
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let mut errors: Vec<FieldError> =
            self.material.field_errors().into_iter().map(|e| e.below("/material")).collect();
        errors.extend(self.cards().err());
        if errors.is_empty() { Ok(Box::new(self)) } else { Err(errors) }
    }
}

impl Run for ExportMaterialRequest {
    fn title(&self) -> String {
        format!("cards of {}", self.name())
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let (cards, name) = (self.cards()?, self.name());
        let result = ExportMaterialResult {
            schema: "export-material/1",
            version: VERSION,
            input_hash: &context.input_hash,
            name: &name,
            material: &self.material,
            stress_unit: self.stress_unit,
            cards: &cards,
        };
        let mut outcome = Outcome::new("export-material.json", &result, summary::export_material(&name, &cards))?;
        let origin = Origin { name: &name, version: VERSION, input_hash: &context.input_hash };
        for card in &cards {
            let text = material_card(&self.material, card.format, self.stress_unit, &origin)
                .map_err(|e| context.failed(&e))?;
            outcome.add(card.file, text);
        }
        Ok(outcome)
    }
}
