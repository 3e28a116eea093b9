//! Uniaxial: the traditional route, one curve of a strip or a dumb-bell fitted with Ogden terms, or with a law in the
//! first invariant.

use super::curve_files::{
    CurveColumns, CurveFitSettings, CurveReport, add_material, fit_failed, reports_in_words, unfit, unfit_curve,
};
use super::{Context, JobError, Outcome, Progress, Request, ResultSchema, Run, defaults, summary};
use crate::field::FieldError;
use crate::homogeneous::{
    CsvCurve, Curve, CurveFit, CurveFitSequence, CurveParameter, DumbbellFit, DumbbellOptions, HomogeneousTest,
    Interval, LawComparison, compare_laws, fit_curves, fit_dumbbell,
};
use crate::material::{LawKind, Material};
use crate::mesh::MeshSize;
use crate::provenance::VERSION;
use crate::report::{fit_picture, law_picture};
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Most rounds of converting grips to gauge and fitting.
const MAX_ROUNDS: usize = 16;
/// Converged when no gauge strain changes by more than this part of the largest one.
const TOLERANCE: f64 = 1e-3;

/// Body of a fit to one uniaxial curve.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct UniaxialRequest {
    /// The text of the CSV file: stretch or strain and nominal stress, or grip displacement and force of a dumb-bell.
    #[schema(min_length = 1, max_length = 50000000)]
    pub csv: String,
    /// Name in lists; `uniaxial` where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 200)]
    pub name: Option<String>,
    /// Dumb-bell specimen (specimen/1) that displacements belong to; ISO 37 type 4 where it is left out.
    #[serde(default = "defaults::dumbbell")]
    pub specimen: Specimen,
    /// Element size of the dumb-bell's mesh.
    #[serde(default = "search_mesh")]
    #[schema(default = search_mesh)]
    pub mesh: MeshSize,
    /// How columns are understood.
    #[serde(default)]
    pub columns: CurveColumns,
    /// Settings of the fits.
    #[serde(default)]
    pub fit: CurveFitSettings,
}

fn search_mesh() -> MeshSize {
    MeshSize::Search
}

/// Result (`uniaxial/1`): the fields of `calibration/1` for the chosen fit, and all fits.
#[derive(Serialize, ToSchema)]
struct UniaxialResult<'a> {
    schema: &'static str,
    version: &'static str,
    input_hash: &'a str,
    /// The law in the first invariant that is fitted; none with Ogden's terms.
    law: Option<LawKind>,
    num_terms: usize,
    parameters: &'a [CurveParameter],
    initial_shear_modulus_kpa: Interval,
    chi2_per_datum: f64,
    fits: &'a [CurveFitSequence],
    /// All laws side by side; those of a dumb-bell fitted to the gauge's stretches that the fit above found.
    laws: &'a LawComparison,
    conversion: Option<&'a DumbbellFit>,
    /// The chosen fit as a material of its law; none where its parameters are beyond what a material may hold.
    material: Option<Material>,
    /// Whether the material's bulk modulus was held in the fit; else it only stands for the incompressible limit.
    is_bulk_held: bool,
    /// What was read of the file.
    files: [&'a CurveReport; 1],
}

struct CheckedUniaxial {
    request: UniaxialRequest,
    csv: CsvCurve,
    file: CurveReport,
}

/// The fits of the families (free terms; a neo-Hookean term held; a law), their curve, and what converted the grips.
struct Fits {
    families: Vec<CurveFitSequence>,
    curve: Curve,
    conversion: Option<DumbbellFit>,
}

impl Request for UniaxialRequest {
    const COMMAND: &'static str = "uniaxial";
    const COLLECTION: &'static str = "uniaxial-fits";
    const ABOUT: &'static str =
        "The traditional route: one uniaxial curve, of a strip or a dumb-bell, fitted with Ogden terms or another law.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "csv": super::defaults::example_curve(), "fit": { "max_terms": 1 } })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<UniaxialResult>("uniaxial/1")
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let mut errors: Vec<FieldError> =
            self.specimen.field_errors().into_iter().map(|e| e.below("/specimen")).collect();
        match self.columns.read(&self.csv, HomogeneousTest::Uniaxial, "/csv") {
            Ok(csv) if csv.is_displacement && !csv.is_force => {
                let message = "displacements of a dumb-bell come with forces in N; give length_mm for plain strips";
                errors.push(unfit("/csv", &message));
            }
            Ok(csv) if csv.is_force && !csv.is_displacement => {
                errors.push(unfit("/csv", &"the stress is a force; give area_mm2, or a column of nominal stress"));
            }
            Ok(mut csv) if errors.is_empty() => {
                let file = self.fit.elastic_rows(self.name.as_deref().unwrap_or("uniaxial"), &mut csv);
                return Ok(Box::new(CheckedUniaxial { request: self, csv, file }));
            }
            Ok(_) => {}
            Err(error) => errors.push(error),
        }
        Err(errors)
    }
}

impl CheckedUniaxial {
    /// The families of fits: whether a neo-Hookean term is held. A law has no terms, and one family.
    fn families(&self) -> &'static [bool] {
        if self.request.fit.law.is_some() { &[false] } else { &[false, true] }
    }

    fn of_strip(&self) -> Result<Fits, JobError> {
        let curve = Curve::new("uniaxial", HomogeneousTest::Uniaxial, &self.csv.drive, &self.csv.stress)
            .map_err(|e| unfit_curve("/csv", &e))?;
        let family = |&neo_hookean: &bool| {
            let options = self.request.fit.options(neo_hookean);
            fit_curves(std::slice::from_ref(&curve), &options).map_err(|e| fit_failed(&e))
        };
        let families = self.families().iter().map(family).collect::<Result<Vec<_>, _>>()?;
        Ok(Fits { families, curve, conversion: None })
    }

    fn of_dumbbell(&self, context: &Context) -> Result<Fits, JobError> {
        let specimen = &self.request.specimen;
        let mesh = self.request.mesh.options(specimen);
        let mut families = Vec::new();
        let mut first: Option<DumbbellFit> = None;
        for &neo_hookean in self.families() {
            let note = if neo_hookean { ", neo-Hookean term held" } else { "" };
            context.progress(&Progress::stage(&format!("converting grips to gauge and fitting{note}")));
            let fit = self.request.fit.options(neo_hookean);
            let options = DumbbellOptions { mesh, fit, max_rounds: MAX_ROUNDS, tolerance: TOLERANCE };
            let stopped = || context.is_cancelled();
            let found = fit_dumbbell(specimen, &self.csv.drive, &self.csv.stress, &options, &stopped)
                .map_err(|e| context.failed(&e))?;
            families.push(found.sequence.clone());
            first.get_or_insert(found);
        }
        let found = first.ok_or_else(|| JobError::Internal("no fit was made".into()))?;
        let curve = Curve::new("uniaxial", HomogeneousTest::Uniaxial, &found.stretch, &found.nominal_stress_kpa)
            .map_err(|e| unfit_curve("/csv", &e))?;
        Ok(Fits { families, curve, conversion: Some(found) })
    }
}

impl Run for CheckedUniaxial {
    fn title(&self) -> String {
        self.request.name.clone().unwrap_or_else(|| "uniaxial".into())
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let Fits { families, curve, conversion } =
            if self.csv.is_displacement { self.of_dumbbell(context)? } else { self.of_strip()? };
        let chosen = families[0].chosen();
        let laws = compare_laws(std::slice::from_ref(&curve), &families[0], &self.request.fit.options(false))
            .map_err(|e| fit_failed(&e))?;
        let material = chosen.material();
        let result = UniaxialResult {
            schema: "uniaxial/1",
            version: VERSION,
            input_hash: &context.input_hash,
            law: chosen.law,
            num_terms: chosen.num_terms,
            parameters: &chosen.parameters,
            initial_shear_modulus_kpa: chosen.initial_shear_modulus_kpa,
            chi2_per_datum: chosen.chi2_per_datum,
            fits: &families,
            laws: &laws,
            conversion: conversion.as_ref(),
            material: material.as_ref().ok().cloned(),
            is_bulk_held: chosen.bulk_kpa.is_some(),
            files: [&self.file],
        };
        let text = reports_in_words(std::slice::from_ref(&self.file))
            + &summary::uniaxial(&self.title(), &families, &laws, conversion.as_ref());
        let mut outcome = Outcome::new("uniaxial.json", &result, text)?;
        add_material(&mut outcome, &material, result.is_bulk_held);
        for (family, name) in families.iter().zip(["fits", "fits-neo-hookean"]) {
            let mut fits: Vec<&CurveFit> = vec![family.chosen()];
            fits.extend(family.fits.iter().filter(|f| f.num_terms != family.chosen().num_terms));
            let title = match family.law {
                None => "Uniaxial curve: chosen fit (full) and the others (dashed)".to_string(),
                Some(kind) => format!("Uniaxial curve: the law of {}", kind.name()),
            };
            outcome.add(format!("{name}.svg"), fit_picture(&title, &[(&curve, false)], &fits));
        }
        outcome.add("laws.svg", law_picture(&laws));
        Ok(outcome)
    }
}
