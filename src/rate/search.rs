//! The search for causes: hypotheses added one at a time, taken out again where they no longer pay, and compared with
//! what would take their place.

use super::analysis_options::{AMBIGUOUS_BIC, F_TEST_LEVEL, LoadCurveAnalysisError, LoadCurveOptions, MIN_DELTA_BIC};
use super::load_curve::LoadCurve;
use super::load_fit::{LoadCurveFit, LoadCurveProblem};
use super::model::Layout;
use super::summary::{describe_cause, model_name};
use super::verdict::{CurveCause, Hypothesis, HypothesisEvidence};
use crate::homogeneous::{f_exceedance, independent_count, neighbour_correlation};

/// What a search found.
pub(super) struct FoundCauses {
    pub(super) fitted: LoadCurveFit,
    pub(super) causes: Vec<CurveCause>,
    pub(super) evidence: Vec<HypothesisEvidence>,
}

/// The search for causes.
pub(super) struct CauseSearch<'a> {
    pub(super) problem: &'a LoadCurveProblem<'a>,
    pub(super) options: &'a LoadCurveOptions,
    pub(super) num_fitted_curves: usize,
}

impl CauseSearch<'_> {
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
    fn with(&self, h: Hypothesis, from: &LoadCurveFit) -> Option<LoadCurveFit> {
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
    fn without(&self, h: Hypothesis, from: &LoadCurveFit) -> Option<LoadCurveFit> {
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
    /// Neighbouring residuals may be correlated. Evidence is weighed twice, each time with the number of independent
    /// data that the richer model's values are worth: in the residuals themselves, and in their innovations (see
    /// [`innovations`]), which show what is sharp in time and weak in size. The stronger one counts; for white
    /// residuals they are the same.
    fn delta_bic(&self, simple: &LoadCurveFit, rich: &LoadCurveFit) -> (f64, f64, f64) {
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

    /// Sums of squares of two models and how many independent data the second one's are worth: of the residuals, and of
    /// the innovations.
    fn left_over(&self, first: &LoadCurveFit, second: &LoadCurveFit) -> [(f64, f64, f64); 2] {
        let least = second.x.len() as f64 + 10.0;
        let levels = independent_count(&self.problem.by_curve(&second.residual), least);
        let split = |f: &LoadCurveFit| innovations(&self.problem.by_curve(&f.residual));
        let square = |lists: &[Vec<f64>]| lists.iter().flatten().map(|v| v * v).sum::<f64>();
        let (a, b) = (split(first), split(second));
        let views: Vec<&[f64]> = b.iter().map(Vec::as_slice).collect();
        [
            (first.sum_of_squares, second.sum_of_squares, levels),
            (square(&a), square(&b), independent_count(&views, least)),
        ]
    }

    /// Adds hypotheses while they pay.
    ///
    /// # Errors
    /// [`LoadCurveAnalysisError::Cancelled`].
    pub(super) fn run(
        &self,
        baseline: &LoadCurveFit,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<FoundCauses, LoadCurveAnalysisError> {
        let mut current = baseline.clone();
        let mut evidence: Vec<HypothesisEvidence> = Vec::new();
        for stage in 1..=10 {
            let open: Vec<Hypothesis> =
                Hypothesis::ALL.into_iter().filter(|&h| self.is_open(h, &current.layout)).collect();
            let mut additions: Vec<(HypothesisEvidence, LoadCurveFit)> = Vec::new();
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
                additions.push((e, fitted));
            }
            additions.sort_by(|a, b| b.0.delta_bic.total_cmp(&a.0.delta_bic));
            let pays = additions.first().is_some_and(|(e, _)| {
                e.delta_bic > MIN_DELTA_BIC && e.f_probability < F_TEST_LEVEL / open.len() as f64
            });
            if pays {
                additions[0].0.is_taken = true;
                current = additions[0].1.clone();
            }
            evidence.extend(additions.into_iter().map(|(e, _)| e));
            if !pays {
                break;
            }
        }
        let (current, causes) = self.prune(current, baseline);
        Ok(FoundCauses { fitted: current, causes, evidence })
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
    fn prune(&self, mut current: LoadCurveFit, baseline: &LoadCurveFit) -> (LoadCurveFit, Vec<CurveCause>) {
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
}

/// Residuals less what their neighbour before predicts, eᵢ = rᵢ − ρ rᵢ₋₁, per list; the first of a list is √(1 − ρ²)
/// r₁. ρ is the correlation of neighbours where noise alone would not show it, else 0.
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
