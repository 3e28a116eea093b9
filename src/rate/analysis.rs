//! What explains a load curve: an elastic baseline, hypotheses added one at a time while BIC and an F-test both call
//! for them, taken out again where they no longer pay, and the proof on what was kept back.

use super::analysis_options::{EXPLAINED_PART, LoadCurveAnalysisError, LoadCurveOptions};
use super::load_curve::LoadCurve;
use super::load_fit::{LoadCurveFit, LoadCurveProblem};
use super::model::{Layout, Physics, Prepared};
use super::search::{CauseSearch, FoundCauses};
use super::summary::{material_of_fit, sentence};
use super::verdict::{BeforeAfter, CurveTrace, LoadCurveVerdict, MatchBeforeAfter, Verdict};
use crate::homogeneous::{Curve, CurveFitError, CurveFitOptions, CurveMatch, fit_curves, neighbour_correlation};

/// Analyses load curves of one material: is there a mismatch to an elastic material, what explains it, and does the
/// explanation predict what was kept back ([`LoadCurve::num_fitted`])?
///
/// ```
/// use lambdak::homogeneous::HomogeneousTest;
/// use lambdak::rate::{LoadCurve, LoadCurveOptions, PronyTerm, Verdict, analyse_load_curve, relax};
///
/// // A neo-Hookean adhesive layer of 10 kPa in shear, up and down at two rates, that relaxes: in shear of a
/// // neo-Hookean material the stress is linear, so `relax` makes the data.
/// let curve = |name: &str, rate: f64| {
///     let time: Vec<f64> = (1..=80).map(|i| f64::from(i) / 40.0 / rate).collect();
///     let shear: Vec<f64> = time.iter().map(|t| 0.2 * (1.0 - (1.0 - rate * t).abs())).collect();
///     let elastic: Vec<f64> = shear.iter().map(|g| 10.0 * g).collect();
///     let mut stress = relax(&time, &elastic, &[PronyTerm { strength: 0.6, time_s: 5.0 }]).unwrap().values;
///     // A ripple in place of noise.
///     for (i, s) in stress.iter_mut().enumerate() {
///         *s += 0.01 * (5.1 * (i * i) as f64).sin();
///     }
///     LoadCurve::new(name, HomogeneousTest::SimpleShear, &time, &shear, &stress).unwrap()
/// };
/// let curves = [curve("slow", 0.02), curve("fast", 0.5), curve("held", 0.1).kept_back()];
/// let verdict = analyse_load_curve(&curves, &LoadCurveOptions::default(), &|| false).unwrap();
/// assert_eq!(verdict.verdict, Verdict::Explained);
/// assert_eq!(verdict.causes[0].name, "relaxation");
/// assert!(verdict.kept_back[0].after.rms_error_kpa < 0.1 * verdict.kept_back[0].before.rms_error_kpa);
/// ```
///
/// Every curve is taken to be of a fresh specimen. Correlated residuals count for fewer data: models are compared by
/// the residuals and by the innovations of a first-order autoregression, intervals widened by the correlation of
/// neighbours.
///
/// # Errors
/// [`LoadCurveAnalysisError`].
pub fn analyse_load_curve(
    curves: &[LoadCurve],
    options: &LoadCurveOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<LoadCurveVerdict, LoadCurveAnalysisError> {
    check(curves, options)?;
    let (elastic_curves, order): (Vec<Curve>, Vec<usize>) =
        curves.iter().enumerate().filter_map(|(i, c)| c.elastic_part().map(|e| (e, i))).unzip();
    let square: f64 = elastic_curves.iter().map(|c| c.scale_kpa().powi(2) * c.states.len() as f64).sum();
    let num_data: usize = elastic_curves.iter().map(|c| c.states.len()).sum();
    let scale = (square / num_data as f64).sqrt();
    let fit_options = CurveFitOptions { max_terms: options.max_terms, num_starts: 2, ..CurveFitOptions::default() };
    // Gains are counted over the fitted curves; a curve kept back as a whole has the first one's.
    let prepared = curves
        .iter()
        .enumerate()
        .map(|(i, c)| Prepared::new(order.iter().position(|&o| o == i).unwrap_or(0), c))
        .collect();
    let problem = LoadCurveProblem {
        curves,
        prepared,
        weight_kpa: scale,
        alpha_range: fit_options.alpha_range,
        min_alpha_gap: fit_options.min_alpha_gap,
    };
    let baseline = baseline(&problem, &elastic_curves, &fit_options)?;
    let search = CauseSearch { problem: &problem, options, num_fitted_curves: elastic_curves.len() };
    let found = search.run(&baseline, is_cancelled)?;
    Ok(report(&problem, options, &baseline, found))
}

fn check(curves: &[LoadCurve], options: &LoadCurveOptions) -> Result<(), LoadCurveAnalysisError> {
    for curve in curves {
        curve.validate()?;
    }
    let setting = |name, value: f64, is_good: bool, requirement| {
        if is_good { Ok(()) } else { Err(LoadCurveAnalysisError::Setting { name, value, requirement }) }
    };
    setting("max_relaxations", options.max_relaxations as f64, options.max_relaxations <= 4, "give at most 4")?;
    setting("floor", options.floor, (0.0..0.5).contains(&options.floor), "give 0 to 0.5")?;
    if let Some(sd) = options.noise_sd_kpa {
        setting("noise_sd_kpa", sd, sd > 0.0 && sd.is_finite(), "a standard deviation must be positive")?;
    }
    let num_fitted = curves.iter().map(LoadCurve::fitted).sum();
    let needed = 12;
    if num_fitted < needed {
        return Err(LoadCurveAnalysisError::TooFewData { num_fitted, needed });
    }
    Ok(())
}

/// The elastic material that the fitted samples call for.
fn baseline(
    problem: &LoadCurveProblem,
    curves: &[Curve],
    options: &CurveFitOptions,
) -> Result<LoadCurveFit, LoadCurveAnalysisError> {
    // One weight for all curves: they share the load cell.
    let curves: Vec<Curve> =
        curves.iter().map(|c| Curve { noise_sd_kpa: Some(problem.weight_kpa), ..c.clone() }).collect();
    let sequence = fit_curves(&curves, options)?;
    let terms = sequence.chosen().terms();
    let layout = Layout {
        signs: terms.iter().map(|t| t.modulus_kpa.signum()).collect(),
        physics: Physics::default(),
        num_curves: curves.len(),
    };
    let x: Vec<f64> = terms.iter().flat_map(|t| [t.modulus_kpa.abs().ln(), t.alpha]).collect();
    let none = CurveFitError::NoFit { num_terms: terms.len() };
    problem.fit(&layout, &[x]).ok_or_else(|| none.into())
}

/// The verdict on what a search found.
fn report(
    problem: &LoadCurveProblem,
    options: &LoadCurveOptions,
    baseline: &LoadCurveFit,
    found: FoundCauses,
) -> LoadCurveVerdict {
    let FoundCauses { fitted: chosen, causes, evidence: mut hypotheses } = found;
    let (chosen, causes) = (&chosen, causes.as_slice());
    let n = problem.num_data() as f64;
    let (split_before, split_after) = (problem.by_curve(&baseline.residual), problem.by_curve(&chosen.residual));
    let noise = options.noise_sd_kpa.unwrap_or_else(|| scatter(&split_after) * problem.weight_kpa);
    let noise_square = (noise / problem.weight_kpa).powi(2);
    let chi2 = |f: &LoadCurveFit| f.sum_of_squares / (n - f.x.len() as f64).max(1.0) / noise_square.max(1e-300);
    // Weights are the curves' root mean square, so the floor is a part of 1.
    let structured = |f: &LoadCurveFit| (f.sum_of_squares / n - noise_square).max(0.0);
    let explained_fraction = if structured(baseline) > 0.0 {
        (1.0 - structured(chosen) / structured(baseline)).clamp(0.0, 1.0)
    } else {
        1.0
    };
    let correlation =
        BeforeAfter { before: neighbour_correlation(&split_before), after: neighbour_correlation(&split_after) };
    let left = (n - chosen.x.len() as f64).max(1.0);
    let is_white = correlation.after * n.sqrt() < 3.3 && chi2(chosen) < 1.0 + 4.0 * (2.0 / left).sqrt();
    let is_clean = is_white || structured(chosen) < options.floor.powi(2);
    let is_ambiguous = causes.iter().any(|c| !c.ambiguous_with.is_empty());
    let verdict = match (causes.is_empty(), is_clean) {
        (true, true) => Verdict::NoMismatch,
        (true, false) => Verdict::Unexplained,
        (false, clean) if clean || explained_fraction >= EXPLAINED_PART => {
            if is_ambiguous {
                Verdict::ExplainedAmbiguously
            } else {
                Verdict::Explained
            }
        }
        _ => Verdict::Unexplained,
    };
    let (before, after) = (problem.stresses(baseline), problem.stresses(chosen));
    let (mut fitted, mut kept_back, mut traces) = (Vec::new(), Vec::new(), Vec::new());
    for (i, curve) in problem.curves.iter().enumerate() {
        let split = curve.fitted();
        for (range, list) in [(0..split, &mut fitted), (split..curve.drive.len(), &mut kept_back)] {
            if !range.is_empty() {
                let data = &curve.nominal_stress_kpa[range.clone()];
                list.push(MatchBeforeAfter {
                    before: CurveMatch::of_values(&curve.name, data, &before[i][range.clone()]),
                    after: CurveMatch::of_values(&curve.name, data, &after[i][range]),
                });
            }
        }
        traces.push(CurveTrace {
            name: curve.name.clone(),
            time_s: curve.time_s.clone(),
            drive: curve.drive.clone(),
            measured_kpa: curve.nominal_stress_kpa.clone(),
            before_kpa: before[i].clone(),
            after_kpa: after[i].clone(),
            num_fitted: split,
        });
    }
    hypotheses.sort_by(|a, b| a.stage.cmp(&b.stage).then(b.delta_bic.total_cmp(&a.delta_bic)));
    LoadCurveVerdict {
        schema: "load_curve_diagnosis/1".into(),
        verdict,
        summary: sentence(verdict, causes, explained_fraction, &kept_back),
        causes: causes.to_vec(),
        hypotheses,
        naive_material: material_of_fit(baseline, problem),
        material: material_of_fit(chosen, problem),
        noise_sd_kpa: noise,
        is_noise_estimated: options.noise_sd_kpa.is_none(),
        chi2_per_datum: BeforeAfter { before: chi2(baseline), after: chi2(chosen) },
        residual_correlation: correlation,
        explained_fraction,
        fitted,
        kept_back,
        traces,
    }
}

/// Standard deviation of the scatter of residuals about the line through their neighbours (so that structure does not
/// count), by the median, which a few kinks do not disturb.
fn scatter(residuals: &[&[f64]]) -> f64 {
    let mut size: Vec<f64> = residuals
        .iter()
        .flat_map(|r| r.windows(3))
        .map(|w| (w[1] - 0.5 * (w[0] + w[2])).abs() / 1.5f64.sqrt())
        .collect();
    if size.is_empty() {
        return 0.0;
    }
    size.sort_by(f64::total_cmp);
    // The median of |normal| is 0.6745 standard deviations.
    size[size.len() / 2] / 0.6745
}

/// Modelled stresses for synthetic curves: used where tests make data.
#[cfg(test)]
pub(crate) fn synthetic_stress(layout: &Layout, x: &[f64], curve: &LoadCurve, index: usize) -> Vec<f64> {
    super::model::model(layout, x, &Prepared::new(index, curve)).stress_kpa
}

#[cfg(test)]
#[path = "analysis_tests.rs"]
mod tests;
