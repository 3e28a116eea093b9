//! What explains a load curve: an elastic baseline, hypotheses added one at a time while BIC and an F-test both call for
//! them, taken out again where they no longer pay, and the proof on what was kept back.

use super::load_curve::{LoadCurve, LoadCurveError};
use super::load_fit::{Fitted, Problem};
use super::model::{Layout, Physics, Prepared};
use super::summary::{describe_cause, material_of_fit, model_name, sentence};
use super::verdict::{
    BeforeAfter, CurveCause, CurveTrace, Hypothesis, HypothesisEvidence, LoadCurveVerdict, MatchBeforeAfter, Verdict,
};
use crate::homogeneous::{
    Curve, CurveFitError, CurveFitOptions, CurveMatch, f_exceedance, fit_curves, independent_count,
    neighbour_correlation,
};

/// BIC must fall by at least this (odds of about 150 to 1).
pub const MIN_DELTA_BIC: f64 = 10.0;
/// Two causes whose BIC differ by less cannot be told apart.
pub const AMBIGUOUS_BIC: f64 = 6.0;
/// Level of the F-test, shared among the hypotheses of a stage.
pub const F_TEST_LEVEL: f64 = 0.01;
/// The causes explain the mismatch where they take away at least this part of its structured variance.
pub const EXPLAINED_PART: f64 = 0.9;

/// Settings of [`analyse_load_curve`].
#[derive(Clone, Debug, PartialEq)]
pub struct LoadCurveOptions {
    /// Most Ogden terms.
    pub max_terms: usize,
    /// Most relaxations, at most 4.
    pub max_relaxations: usize,
    /// Standard deviation of a stress reading, kPa; estimated where not known.
    pub noise_sd_kpa: Option<f64>,
    /// Structured misfit below this part of the curves' root mean square is no mismatch: digitisation, thinning.
    pub floor: f64,
    /// Which hypotheses are tried.
    pub hypotheses: Vec<Hypothesis>,
}

impl Default for LoadCurveOptions {
    fn default() -> Self {
        LoadCurveOptions {
            max_terms: 3,
            max_relaxations: 3,
            noise_sd_kpa: None,
            floor: 0.01,
            hypotheses: Hypothesis::ALL.to_vec(),
        }
    }
}

/// Why load curves could not be analysed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LoadCurveAnalysisError {
    /// A curve is not usable.
    #[error(transparent)]
    Curve(#[from] LoadCurveError),
    /// No elastic material comes near the curves.
    #[error(transparent)]
    Elastic(#[from] CurveFitError),
    /// Nothing to fit.
    #[error("{num_fitted} samples are fitted; at least {needed} are needed (the others are kept back)")]
    TooFewData {
        /// Samples to fit.
        num_fitted: usize,
        /// Least number.
        needed: usize,
    },
    /// A setting is out of its range.
    #[error("{name} is {value}; {requirement}")]
    Setting {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is needed.
        requirement: &'static str,
    },
    /// The caller asked to stop.
    #[error("cancelled after {stages} stages")]
    Cancelled {
        /// Stages done.
        stages: usize,
    },
}

/// Analyses load curves of one material: is there a mismatch to an elastic material, what explains it, and does the
/// explanation predict what was kept back ([`LoadCurve::num_fitted`])?
///
/// Every curve is taken to be of a fresh specimen. Correlated residuals count for fewer data: models are compared by the
/// residuals and by the innovations of a first-order autoregression, intervals widened by the correlation of neighbours.
///
/// # Errors
/// [`LoadCurveAnalysisError`].
pub fn analyse_load_curve(
    curves: &[LoadCurve],
    options: &LoadCurveOptions,
    is_cancelled: &dyn Fn() -> bool,
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
    let problem = Problem {
        curves,
        prepared,
        weight_kpa: scale,
        alpha_range: fit_options.alpha_range,
        min_alpha_gap: fit_options.min_alpha_gap,
    };
    let baseline = baseline(&problem, &elastic_curves, &fit_options)?;
    let search = Search { problem: &problem, options, num_fitted_curves: elastic_curves.len() };
    let (chosen, causes, evidence) = search.run(&baseline, is_cancelled)?;
    Ok(search.report(&baseline, &chosen, &causes, evidence))
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
fn baseline(problem: &Problem, curves: &[Curve], options: &CurveFitOptions) -> Result<Fitted, LoadCurveAnalysisError> {
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

/// The search for causes.
struct Search<'a> {
    problem: &'a Problem<'a>,
    options: &'a LoadCurveOptions,
    num_fitted_curves: usize,
}

impl Search<'_> {
    /// Whether a hypothesis can be added to a model with these data.
    fn is_open(&self, h: Hypothesis, to: &Layout) -> bool {
        let p = to.physics;
        let fitted = || self.problem.curves.iter().filter(|c| c.fitted() > 0);
        let turns = || {
            fitted().any(|c| {
                let d = c.directions();
                let d = &d[..c.fitted()];
                d.iter().any(|v| *v > 0.0) && d.iter().any(|v| *v < 0.0)
            })
        };
        self.options.hypotheses.contains(&h)
            && match h {
                Hypothesis::Relaxation => {
                    p.num_relaxations < self.options.max_relaxations && self.problem.times().is_some()
                }
                Hypothesis::Mullins => !p.has_softening && turns(),
                Hypothesis::Terms => to.signs.len() < self.options.max_terms,
                Hypothesis::Barrelling => {
                    let is_squeezed = |c: &LoadCurve| {
                        c.test == crate::homogeneous::HomogeneousTest::Uniaxial
                            && c.drive[..c.fitted()].iter().any(|d| *d < 0.97)
                    };
                    !p.has_barrelling && fitted().any(is_squeezed)
                }
                Hypothesis::Offset => !p.has_offset,
                Hypothesis::Gain => !p.has_gain && self.num_fitted_curves > 1,
                Hypothesis::Friction => !p.has_friction && turns(),
            }
    }

    /// The fit with a hypothesis added.
    fn with(&self, h: Hypothesis, from: &Fitted) -> Option<Fitted> {
        let gains = vec![1.0; self.num_fitted_curves.saturating_sub(1)];
        match h {
            Hypothesis::Relaxation => self.problem.with_relaxation(from),
            Hypothesis::Mullins => self.problem.with_softening(from),
            Hypothesis::Terms => self.problem.with_term(from),
            Hypothesis::Barrelling => {
                self.problem.with_part(from, |p| p.has_barrelling = true, Layout::barrelling, &[0.02])
            }
            Hypothesis::Offset => self.problem.with_part(from, |p| p.has_offset = true, Layout::offset, &[0.0]),
            Hypothesis::Gain => self.problem.with_part(from, |p| p.has_gain = true, Layout::gains, &gains),
            Hypothesis::Friction => self.problem.with_part(from, |p| p.has_friction = true, Layout::friction, &[0.0]),
        }
    }

    /// The fit with a hypothesis taken out altogether.
    fn without(&self, h: Hypothesis, from: &Fitted) -> Option<Fitted> {
        let mut layout = from.layout.clone();
        let mut x = from.x.clone();
        let l = &from.layout;
        let (at, count) = match h {
            Hypothesis::Relaxation => (l.relaxations(), 2 * l.physics.num_relaxations),
            Hypothesis::Mullins => (l.softening(), 3),
            Hypothesis::Terms => return None,
            Hypothesis::Barrelling => (l.barrelling(), 1),
            Hypothesis::Friction => (l.friction(), 1),
            Hypothesis::Offset => (l.offset(), 1),
            Hypothesis::Gain => (l.gains(), l.num_unknowns() - l.gains()),
        };
        x.drain(at..at + count);
        let p = &mut layout.physics;
        match h {
            Hypothesis::Relaxation => {
                p.num_relaxations = 0;
                p.is_nominal = false;
            }
            Hypothesis::Mullins => p.has_softening = false,
            Hypothesis::Barrelling => p.has_barrelling = false,
            Hypothesis::Friction => p.has_friction = false,
            Hypothesis::Offset => p.has_offset = false,
            Hypothesis::Gain => p.has_gain = false,
            Hypothesis::Terms => {}
        }
        self.problem.fit(&layout, &[x])
    }

    /// BIC of the simpler model − BIC of the richer one, F and its probability.
    ///
    /// Neighbouring residuals may be correlated. Evidence is weighed twice, each time with the number of independent data
    /// that the richer model's values are worth: in the residuals themselves, and in their innovations (see
    /// [`innovations`]), which show what is sharp in time and weak in size. The stronger one counts; for white residuals they
    /// are the same.
    fn delta_bic(&self, simple: &Fitted, rich: &Fitted) -> (f64, f64, f64) {
        let (k0, k1) = (simple.x.len() as f64, rich.x.len() as f64);
        let weigh = |(s0, s1, n): (f64, f64, f64)| {
            let delta = n * (s0 / s1.max(1e-300)).ln() - (k1 - k0) * n.ln();
            let (added, left) = ((k1 - k0).max(1.0), (n - k1).max(1.0));
            let f = ((s0 - s1).max(0.0) / added) / (s1 / left).max(1e-300);
            (delta, f, f_exceedance(f, added, left))
        };
        let [a, b] = self.left_over(simple, rich).map(weigh);
        if a.0 >= b.0 { a } else { b }
    }

    /// Sums of squares of two models and how many independent data the second one's are worth: of the residuals, and of the
    /// innovations.
    fn left_over(&self, first: &Fitted, second: &Fitted) -> [(f64, f64, f64); 2] {
        let least = second.x.len() as f64 + 10.0;
        let levels = independent_count(&self.problem.by_curve(&second.residual), least);
        let split = |f: &Fitted| innovations(&self.problem.by_curve(&f.residual));
        let square = |lists: &[Vec<f64>]| lists.iter().flatten().map(|v| v * v).sum::<f64>();
        let (a, b) = (split(first), split(second));
        let views: Vec<&[f64]> = b.iter().map(Vec::as_slice).collect();
        [
            (first.sum_of_squares, second.sum_of_squares, levels),
            (square(&a), square(&b), independent_count(&views, least)),
        ]
    }

    /// Adds hypotheses while they pay.
    #[allow(clippy::type_complexity)]
    fn run(
        &self,
        baseline: &Fitted,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<(Fitted, Vec<CurveCause>, Vec<HypothesisEvidence>), LoadCurveAnalysisError> {
        let mut current = baseline.clone();
        let mut evidence: Vec<HypothesisEvidence> = Vec::new();
        for stage in 1..=10 {
            let open: Vec<Hypothesis> =
                Hypothesis::ALL.into_iter().filter(|&h| self.is_open(h, &current.layout)).collect();
            let mut tried: Vec<(HypothesisEvidence, Fitted)> = Vec::new();
            for &h in &open {
                if is_cancelled() {
                    return Err(LoadCurveAnalysisError::Cancelled { stages: stage - 1 });
                }
                let Some(fitted) = self.with(h, &current) else { continue };
                let (delta_bic, f_value, f_probability) = self.delta_bic(&current, &fitted);
                let name = h.name().to_string();
                let sum_of_squares = fitted.sum_of_squares;
                let e = HypothesisEvidence {
                    stage,
                    name,
                    delta_bic,
                    f_value,
                    f_probability,
                    sum_of_squares,
                    is_taken: false,
                };
                tried.push((e, fitted));
            }
            tried.sort_by(|a, b| b.0.delta_bic.total_cmp(&a.0.delta_bic));
            let pays = tried.first().is_some_and(|(e, _)| {
                e.delta_bic > MIN_DELTA_BIC && e.f_probability < F_TEST_LEVEL / open.len() as f64
            });
            if pays {
                tried[0].0.is_taken = true;
                current = tried[0].1.clone();
            }
            evidence.extend(tried.into_iter().map(|(e, _)| e));
            if !pays {
                break;
            }
        }
        let (current, causes) = self.prune(current, baseline);
        Ok((current, causes, evidence))
    }

    /// The causes of a model, its terms apart.
    fn causes_in(layout: &Layout) -> Vec<Hypothesis> {
        let p = layout.physics;
        [
            (Hypothesis::Relaxation, p.num_relaxations > 0),
            (Hypothesis::Mullins, p.has_softening),
            (Hypothesis::Barrelling, p.has_barrelling),
            (Hypothesis::Offset, p.has_offset),
            (Hypothesis::Gain, p.has_gain),
            (Hypothesis::Friction, p.has_friction),
        ]
        .into_iter()
        .filter_map(|(h, is_in)| is_in.then_some(h))
        .collect()
    }

    /// Takes out what no longer pays, then asks for each cause what would take its place.
    fn prune(&self, mut current: Fitted, baseline: &Fitted) -> (Fitted, Vec<CurveCause>) {
        let mut causes = Self::causes_in(&current.layout);
        loop {
            let weakest = causes
                .iter()
                .filter(|_| causes.len() > 1)
                .filter_map(|&h| self.without(h, &current).map(|f| (h, self.delta_bic(&f, &current).0, f)))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            match weakest {
                Some((h, delta, fitted)) if delta < MIN_DELTA_BIC => {
                    causes.retain(|c| *c != h);
                    current = fitted;
                }
                _ => break,
            }
        }
        let mut named: Vec<CurveCause> = Vec::new();
        for &h in &causes {
            let Some(without) = self.without(h, &current) else { continue };
            let (delta_bic, _, _) = self.delta_bic(&without, &current);
            let mut ambiguous_with = Vec::new();
            for other in Hypothesis::ALL {
                if causes.contains(&other) || !self.is_open(other, &without.layout) {
                    continue;
                }
                let Some(mut rival) = self.with(other, &without) else { continue };
                // As many relaxations as pay.
                while other == Hypothesis::Relaxation && self.is_open(other, &rival.layout) {
                    match self.with(other, &rival) {
                        Some(next) if self.delta_bic(&rival, &next).0 > MIN_DELTA_BIC => rival = next,
                        _ => break,
                    }
                }
                let added = rival.x.len() as f64 - current.x.len() as f64;
                let gap = self
                    .left_over(&rival, &current)
                    .map(|(s0, s1, n)| n * (s0 / s1.max(1e-300)).ln() + added * n.ln())
                    .into_iter()
                    .fold(f64::NEG_INFINITY, f64::max);
                if gap < AMBIGUOUS_BIC {
                    ambiguous_with.push(other.name().to_string());
                }
            }
            named.push(CurveCause {
                name: h.name().into(),
                category: h.category().into(),
                model: model_name(h, current.layout.physics).into(),
                parameters: describe_cause(h, &current, self.problem),
                delta_bic,
                ambiguous_with,
            });
        }
        if named.is_empty() && current.layout.signs.len() > baseline.layout.signs.len() {
            let (delta_bic, _, _) = self.delta_bic(baseline, &current);
            named.push(CurveCause {
                name: Hypothesis::Terms.name().into(),
                category: Hypothesis::Terms.category().into(),
                model: model_name(Hypothesis::Terms, current.layout.physics).into(),
                parameters: Vec::new(),
                delta_bic,
                ambiguous_with: Vec::new(),
            });
        }
        named.sort_by(|a, b| b.delta_bic.total_cmp(&a.delta_bic));
        (current, named)
    }

    fn report(
        &self,
        baseline: &Fitted,
        chosen: &Fitted,
        causes: &[CurveCause],
        mut hypotheses: Vec<HypothesisEvidence>,
    ) -> LoadCurveVerdict {
        let problem = self.problem;
        let n = problem.num_data() as f64;
        let (split_before, split_after) = (problem.by_curve(&baseline.residual), problem.by_curve(&chosen.residual));
        let noise = self.options.noise_sd_kpa.unwrap_or_else(|| scatter(&split_after) * problem.weight_kpa);
        let noise_square = (noise / problem.weight_kpa).powi(2);
        let chi2 = |f: &Fitted| f.sum_of_squares / (n - f.x.len() as f64).max(1.0) / noise_square.max(1e-300);
        // Weights are the curves' root mean square, so the floor is a part of 1.
        let structured = |f: &Fitted| (f.sum_of_squares / n - noise_square).max(0.0);
        let explained_fraction = if structured(baseline) > 0.0 {
            (1.0 - structured(chosen) / structured(baseline)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        let correlation =
            BeforeAfter { before: neighbour_correlation(&split_before), after: neighbour_correlation(&split_after) };
        let left = (n - chosen.x.len() as f64).max(1.0);
        let is_white = correlation.after * n.sqrt() < 3.3 && chi2(chosen) < 1.0 + 4.0 * (2.0 / left).sqrt();
        let is_clean = is_white || structured(chosen) < self.options.floor.powi(2);
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
            is_noise_estimated: self.options.noise_sd_kpa.is_none(),
            chi2_per_datum: BeforeAfter { before: chi2(baseline), after: chi2(chosen) },
            residual_correlation: correlation,
            explained_fraction,
            fitted,
            kept_back,
            traces,
        }
    }
}

/// Residuals less what their neighbour before predicts, eᵢ = rᵢ − ρ rᵢ₋₁, per list; the first of a list is √(1 − ρ²) r₁.
/// ρ is the correlation of neighbours where noise alone would not show it, else 0.
fn innovations(residuals: &[&[f64]]) -> Vec<Vec<f64>> {
    let n: f64 = residuals.iter().map(|r| r.len() as f64).sum();
    let found = neighbour_correlation(residuals);
    let rho = if found * n.sqrt() > 2.0 { found.min(0.999) } else { 0.0 };
    let first = (1.0 - rho * rho).sqrt();
    residuals
        .iter()
        .map(|r| (0..r.len()).map(|i| if i == 0 { first * r[0] } else { r[i] - rho * r[i - 1] }).collect())
        .collect()
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
