//! `lambdak curves`: joint fits to homogeneous tests, and the prediction of a test kept back.

use super::curve_input::{ColumnArguments, FitArguments, read_stretch_curve};
use super::curve_tables::{fit_table, sequence_table};
use super::error::CliError;
use super::{Common, output};
use crate::homogeneous::{Curve, CurveFit, CurveFitSequence, CurveMatch, HomogeneousTest, fit_curves, matches_of};
use crate::provenance::{VERSION, input_hash};
use crate::report::fit_picture;
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

#[derive(Args)]
pub(super) struct CurvesArguments {
    /// Tests and their curves (CSV): uniaxial=FILE equibiaxial=FILE pure-shear=FILE simple-shear=FILE.
    #[arg(required = true, value_name = "TEST=FILE")]
    curves: Vec<String>,
    /// Tests that are predicted, not fitted, comma-separated.
    #[arg(long, value_delimiter = ',', value_name = "TEST")]
    keep_back: Vec<String>,
    /// Hold one term neo-Hookean (alpha = 2).
    #[arg(long)]
    neo_hookean: bool,
    /// Print and predict with exactly --terms terms instead of the number that BIC takes.
    #[arg(long)]
    exact: bool,
    #[command(flatten)]
    columns: ColumnArguments,
    #[command(flatten)]
    fit: FitArguments,
    #[command(flatten)]
    common: Common,
}

/// Result of `lambdak curves` (`curves/1`): the fields of `calibration/1` for the fit that is used, and all fits.
#[derive(Serialize)]
struct CurvesResult<'a> {
    schema: &'static str,
    version: &'static str,
    input_hash: String,
    num_terms: usize,
    parameters: &'a [crate::homogeneous::CurveParameter],
    initial_shear_modulus_kpa: crate::homogeneous::Interval,
    chi2_per_datum: f64,
    fits: &'a CurveFitSequence,
    kept_back: Vec<CurveMatch>,
}

pub(super) fn test_of(name: &str, option: &'static str) -> Result<HomogeneousTest, CliError> {
    match name.replace('_', "-").as_str() {
        "uniaxial" => Ok(HomogeneousTest::Uniaxial),
        "equibiaxial" => Ok(HomogeneousTest::Equibiaxial),
        "pure-shear" | "planar" => Ok(HomogeneousTest::PureShear),
        "simple-shear" => Ok(HomogeneousTest::SimpleShear),
        other => Err(CliError::Option {
            option,
            message: format!("'{other}' is not uniaxial, equibiaxial, pure-shear or simple-shear"),
        }),
    }
}

pub(super) fn run(a: &CurvesArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let options = a.columns.options()?;
    let kept: Vec<HomogeneousTest> = a.keep_back.iter().map(|n| test_of(n, "keep-back")).collect::<Result<_, _>>()?;
    let (mut fitted, mut kept_back) = (Vec::new(), Vec::new());
    let mut first: Option<PathBuf> = None;
    for argument in &a.curves {
        let Some((name, file)) = argument.split_once('=') else {
            let message = format!("'{argument}' is not TEST=FILE, such as uniaxial=ut.csv");
            return Err(CliError::Option { option: "curves", message });
        };
        let test = test_of(name, "curves")?;
        let path = PathBuf::from(file);
        let curve = read_stretch_curve(&path, test, &options)?;
        first.get_or_insert(path);
        if kept.contains(&test) { kept_back.push(curve) } else { fitted.push(curve) }
    }
    let path = first.unwrap_or_default();
    if fitted.is_empty() {
        return Err(CliError::Option { option: "keep-back", message: "no test is left to fit".into() });
    }
    let bad = |message: String| CliError::Input { path: path.clone(), message };
    let mut options = a.fit.options(a.neo_hookean);
    options.also_stable_at = kept_back.iter().flat_map(|c| c.states.iter().copied()).collect();
    let sequence = fit_curves(&fitted, &options).map_err(|e| bad(e.to_string()))?;
    let used = if a.exact {
        sequence
            .fits
            .iter()
            .find(|f| f.num_terms == a.fit.terms)
            .ok_or_else(|| CliError::Numerics(format!("no stable material with {} terms was found", a.fit.terms)))?
    } else {
        sequence.chosen()
    };
    let predicted = matches_of(&used.terms(), used.bulk_kpa, &kept_back)
        .ok_or_else(|| CliError::Numerics("the fitted material has no response in a state kept back".into()))?;
    let result = CurvesResult {
        schema: "curves/1",
        version: VERSION,
        input_hash: input_hash(&serde_json::json!({
            "curves": fitted.iter().chain(&kept_back).map(|c| (&c.name, &c.nominal_stress_kpa)).collect::<Vec<_>>(),
            "kept_back": a.keep_back, "terms": a.fit.terms, "neo_hookean": a.neo_hookean
        })),
        num_terms: used.num_terms,
        parameters: &used.parameters,
        initial_shear_modulus_kpa: used.initial_shear_modulus_kpa,
        chi2_per_datum: used.chi2_per_datum,
        fits: &sequence,
        kept_back: predicted,
    };
    if let Some(folder) = output::folder(a.common.out.as_deref(), a.common.json, &path) {
        output::write_file(&folder, "curves.json", output::to_json(&result)?.as_bytes())?;
        let all: Vec<(&Curve, bool)> =
            fitted.iter().map(|c| (c, false)).chain(kept_back.iter().map(|c| (c, true))).collect();
        let mut fits: Vec<&CurveFit> = vec![used];
        fits.extend(sequence.fits.iter().filter(|f| f.num_terms != used.num_terms));
        let svg = fit_picture("Curves: the fit (full) and the others (dashed)", &all, &fits);
        output::write_file(&folder, "curves.svg", svg.as_bytes())?;
    }
    if a.common.json {
        return output::print(&output::to_json(&result)?);
    }
    let mut text = sequence_table(&sequence);
    text += &format!("\n{} terms\n", used.num_terms);
    text += &fit_table(used);
    for m in &result.kept_back {
        text += &format!(
            "  predicted, kept back: {}: R² {:.5}, rms error {:.3} kPa ({:.2} %), largest {:.3} kPa\n",
            m.name,
            m.r_squared,
            m.rms_error_kpa,
            100.0 * m.relative_rms_error,
            m.largest_error_kpa
        );
    }
    output::print(&text)
}
