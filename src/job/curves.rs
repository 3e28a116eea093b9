//! Curves: joint fits to homogeneous tests, and the prediction of a test kept back.

use super::curve_files::{
    CurveColumns, CurveFitSettings, CurveReport, SecondAxisColumns, TestCurve, add_material, fit_failed,
    reports_in_words,
};
use super::{Context, JobError, Outcome, Request, ResultSchema, Run, summary};
use crate::field::FieldError;
use crate::homogeneous::{
    Curve, CurveFit, CurveFitSequence, CurveMatch, CurveParameter, Interval, LawComparison, compare_laws, fit_curves,
};
use crate::material::{LawKind, Material};
use crate::provenance::VERSION;
use crate::report::{fit_picture, law_picture};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Body of a joint fit.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CurvesRequest {
    /// Tests and their curves.
    #[schema(min_items = 1, max_items = 64)]
    pub curves: Vec<TestCurve>,
    /// Hold one term neo-Hookean (alpha = 2).
    #[serde(default)]
    pub has_neo_hookean_term: bool,
    /// Print and predict with exactly `fit.max_terms` terms instead of the number that BIC takes.
    #[serde(default)]
    pub is_exact: bool,
    /// How columns are understood.
    #[serde(default)]
    pub columns: CurveColumns,
    /// How those of the second axis of biaxial tests are understood.
    #[serde(default)]
    pub second_axis: SecondAxisColumns,
    /// Settings of the fits.
    #[serde(default)]
    pub fit: CurveFitSettings,
}

/// Result (`curves/1`): the fields of `calibration/1` for the fit that is used, and all fits.
#[derive(Serialize, ToSchema)]
struct CurvesResult<'a> {
    schema: &'static str,
    version: &'static str,
    input_hash: &'a str,
    /// The law in the first invariant that is used; none with Ogden's terms.
    law: Option<LawKind>,
    num_terms: usize,
    parameters: &'a [CurveParameter],
    initial_shear_modulus_kpa: Interval,
    chi2_per_datum: f64,
    fits: &'a CurveFitSequence,
    /// All laws side by side.
    laws: &'a LawComparison,
    kept_back: Vec<CurveMatch>,
    /// The fit that is used as a material of its law; none where its parameters are beyond what a material may hold.
    material: Option<Material>,
    /// Whether the material's bulk modulus was held in the fit; else it only stands for the incompressible limit.
    is_bulk_held: bool,
    /// What was read of the files, fitted curves first.
    files: &'a [CurveReport],
}

struct CheckedCurves {
    request: CurvesRequest,
    fitted: Vec<Curve>,
    kept_back: Vec<Curve>,
    /// What was read, fitted curves first.
    files: Vec<CurveReport>,
}

impl CurvesRequest {
    /// What an entry is called in results: its test, with its own name or number where there are several of the test.
    fn name_of(&self, index: usize) -> String {
        let entry = &self.curves[index];
        let test = entry.test.name();
        if self.curves.iter().filter(|other| other.test == entry.test).count() == 1 {
            return test.into();
        }
        entry.name.as_ref().map_or_else(|| format!("{test} {}", index + 1), |name| format!("{test} {name}"))
    }
}

impl Request for CurvesRequest {
    const COMMAND: &'static str = "curves";
    const COLLECTION: &'static str = "curve-fits";
    const ABOUT: &'static str = "Ogden terms, or another law, fitted to curves of several homogeneous tests together.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "curves": [{ "test": "uniaxial", "csv": super::defaults::example_curve() }], "fit": { "max_terms": 1 } })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<CurvesResult>("curves/1")
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let (mut fitted, mut kept_back, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        let (mut files, mut kept_files) = (Vec::new(), Vec::new());
        for (index, entry) in self.curves.iter().enumerate() {
            match entry.curves(
                &self.name_of(index),
                (&self.columns, &self.second_axis),
                &self.fit,
                &format!("/curves/{index}"),
            ) {
                Ok((mut curves, report)) if entry.is_kept_back => {
                    kept_back.append(&mut curves);
                    kept_files.push(report);
                }
                Ok((mut curves, report)) => {
                    fitted.append(&mut curves);
                    files.push(report);
                }
                Err(error) => errors.push(error),
            }
        }
        let is_biaxial = |entry: &TestCurve| entry.test.with_one_drive().is_none();
        if self.second_axis != SecondAxisColumns::default() && !self.curves.iter().any(is_biaxial) {
            errors.push(FieldError::new("/second_axis", "given", "left out where no test is biaxial"));
        }
        if errors.is_empty() && fitted.is_empty() {
            errors.push(FieldError::new("/curves", "all kept back", "at least one curve that is fitted"));
        }
        if let Some(kind) = self.fit.law {
            let settings = [("/has_neo_hookean_term", self.has_neo_hookean_term), ("/is_exact", self.is_exact)];
            for (pointer, _) in settings.iter().filter(|(_, is_asked)| *is_asked) {
                let remedy = format!("the law of {} has no terms; leave out one of the two", kind.name());
                errors.push(FieldError::new(*pointer, true, "left out beside a law").remedy(remedy));
            }
        }
        files.append(&mut kept_files);
        if errors.is_empty() {
            Ok(Box::new(CheckedCurves { request: self, fitted, kept_back, files }))
        } else {
            Err(errors)
        }
    }
}

impl Run for CheckedCurves {
    fn title(&self) -> String {
        format!("fit of {} curves", self.fitted.len())
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let settings = &self.request.fit;
        let mut options = settings.options(self.request.has_neo_hookean_term);
        options.also_stable_at = self.kept_back.iter().flat_map(|c| c.states.iter().copied()).collect();
        context.step("fit", 0, 1);
        let sequence = fit_curves(&self.fitted, &options).map_err(|e| fit_failed(&e))?;
        let used = if self.request.is_exact {
            let wanted = |f: &&CurveFit| f.num_terms == settings.max_terms;
            let missing = || fit_failed(&format!("no stable material with {} terms was found", settings.max_terms));
            sequence.fits.iter().find(wanted).ok_or_else(missing)?
        } else {
            sequence.chosen()
        };
        let laws = compare_laws(&self.fitted, &sequence, &options).map_err(|e| fit_failed(&e))?;
        let predicted = used
            .matches(&self.kept_back)
            .ok_or_else(|| fit_failed(&"the fitted material has no response in a state kept back"))?;
        let material = used.material();
        let result = CurvesResult {
            schema: "curves/1",
            version: VERSION,
            input_hash: &context.input_hash,
            law: used.law,
            num_terms: used.num_terms,
            parameters: &used.parameters,
            initial_shear_modulus_kpa: used.initial_shear_modulus_kpa,
            chi2_per_datum: used.chi2_per_datum,
            fits: &sequence,
            laws: &laws,
            kept_back: predicted,
            material: material.as_ref().ok().cloned(),
            is_bulk_held: used.bulk_kpa.is_some(),
            files: &self.files,
        };
        let text = reports_in_words(&self.files) + &summary::curves(&sequence, used, &laws, &result.kept_back);
        let mut outcome = Outcome::new("curves.json", &result, text)?;
        add_material(&mut outcome, &material, result.is_bulk_held);
        let all: Vec<(&Curve, bool)> =
            self.fitted.iter().map(|c| (c, false)).chain(self.kept_back.iter().map(|c| (c, true))).collect();
        let mut fits: Vec<&CurveFit> = vec![used];
        fits.extend(sequence.fits.iter().filter(|f| f.num_terms != used.num_terms));
        let title = match used.law {
            None => "Curves: the fit (full) and the others (dashed)".to_string(),
            Some(kind) => format!("Curves: the law of {}", kind.name()),
        };
        outcome.add("curves.svg", fit_picture(&title, &all, &fits));
        outcome.add("laws.svg", law_picture(&laws));
        Ok(outcome)
    }
}
