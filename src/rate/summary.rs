//! Parameters and sentences of a verdict.

use super::load_fit::{LoadCurveFit, LoadCurveProblem};
use super::model::Physics;
use super::verdict::{CauseParameter, CurveCause, CurveMaterial, Hypothesis, MatchBeforeAfter, Verdict};
use crate::homogeneous::{Interval, independent_count, t_quantile};
use crate::material::initial_shear_modulus_kpa;
use crate::optimise::covariance;
use nalgebra::DMatrix;

/// Singular values of the scaled Jacobian below this part of the largest count as none.
const CUTOFF: f64 = 1e-6;

/// Half-widths of the 95 % intervals of all unknowns, the covariance and which unknowns the data determine.
struct Uncertainty {
    half: Vec<f64>,
    covariance: DMatrix<f64>,
    is_determined: Vec<bool>,
    t95: f64,
}

fn uncertainty(fitted: &LoadCurveFit, problem: &LoadCurveProblem) -> Uncertainty {
    let (n, k) = (fitted.residual.len() as f64, fitted.x.len() as f64);
    let independent = independent_count(&problem.by_curve(&fitted.residual), k + 2.0);
    let variance = fitted.sum_of_squares / (n - k).max(1.0) * (n / independent);
    let (covariance, is_determined) = covariance(&fitted.jacobian, variance, CUTOFF);
    let t95 = t_quantile(0.05, (independent - k).max(1.0));
    let half = (0..fitted.x.len()).map(|i| t95 * covariance[(i, i)].max(0.0).sqrt()).collect();
    Uncertainty { half, covariance, is_determined, t95 }
}

/// The fitted model of a cause in words.
pub(super) fn model_name(hypothesis: Hypothesis, physics: Physics) -> &'static str {
    match hypothesis {
        Hypothesis::Relaxation if physics.is_nominal => "Prony series of the nominal stress (quasi-linear)",
        Hypothesis::Relaxation => "Prony series of the isochoric second Piola-Kirchhoff stress (Simo)",
        Hypothesis::Mullins => "Ogden-Roxburgh softening",
        Hypothesis::Terms => "further Ogden terms",
        Hypothesis::Barrelling => "stiffening 1 + b / stretch^3 in compression",
        Hypothesis::Offset => "constant offset of the stress",
        Hypothesis::Gain => "gain of each curve relative to the first",
        Hypothesis::Friction => "constant friction against the motion",
    }
}

/// The parameters of a cause in a fit.
pub(super) fn describe_cause(
    hypothesis: Hypothesis,
    fitted: &LoadCurveFit,
    problem: &LoadCurveProblem,
) -> Vec<CauseParameter> {
    let u = uncertainty(fitted, problem);
    let l = &fitted.layout;
    let linear = |name: String, i: usize| {
        let value = fitted.x[i];
        let interval_95 = u.is_determined[i].then(|| [value - u.half[i], value + u.half[i]]);
        CauseParameter { name, value, interval_95 }
    };
    let logarithmic = |name: String, i: usize| {
        let is_known = u.is_determined[i] && u.half[i] < 9.0;
        let interval_95 = is_known.then(|| [(fitted.x[i] - u.half[i]).exp(), (fitted.x[i] + u.half[i]).exp()]);
        CauseParameter { name, value: fitted.x[i].exp(), interval_95 }
    };
    match hypothesis {
        Hypothesis::Relaxation => (0..l.physics.num_relaxations)
            .flat_map(|r| {
                let at = l.relaxations() + 2 * r;
                [linear(format!("g_{}", r + 1), at), logarithmic(format!("tau_{}_s", r + 1), at + 1)]
            })
            .collect(),
        Hypothesis::Mullins => {
            let at = l.softening();
            let rho = linear(String::new(), at);
            // r = 1/ρ: the ends change places.
            let r = CauseParameter {
                name: "r".into(),
                value: 1.0 / rho.value.max(1e-300),
                interval_95: rho.interval_95.filter(|i| i[0] > 0.0).map(|[low, high]| [1.0 / high, 1.0 / low]),
            };
            vec![r, logarithmic("m_kpa".into(), at + 1), linear("beta".into(), at + 2)]
        }
        Hypothesis::Terms => Vec::new(),
        Hypothesis::Barrelling => {
            let mut all = vec![linear("stiffening".into(), l.barrelling())];
            let shape = problem.curves.iter().filter(|c| c.fitted() > 0).find_map(|c| c.shape_factor);
            if let Some(s) = shape {
                let full = 2.0 * s * s;
                all.push(CauseParameter {
                    name: "bonding".into(),
                    value: all[0].value / full,
                    interval_95: all[0].interval_95.map(|i| i.map(|v| v / full)),
                });
            }
            all
        }
        Hypothesis::Friction => vec![linear("friction_kpa".into(), l.friction())],
        Hypothesis::Offset => vec![linear("offset_kpa".into(), l.offset())],
        Hypothesis::Gain => {
            (l.gains()..l.num_unknowns()).enumerate().map(|(i, at)| linear(format!("gain_{}", i + 2), at)).collect()
        }
    }
}

/// The material of a fit with its intervals.
pub(super) fn material_of_fit(fitted: &LoadCurveFit, problem: &LoadCurveProblem) -> CurveMaterial {
    let u = uncertainty(fitted, problem);
    let terms = fitted.layout.terms(&fitted.x);
    let mut parameters = Vec::new();
    for (t, term) in terms.iter().enumerate() {
        let (c, a) = (2 * t, 2 * t + 1);
        // μ = c/α: dμ = μ (d ln c − dα/α).
        let relative =
            u.covariance[(c, c)] + u.covariance[(a, a)] / term.alpha.powi(2) - 2.0 * u.covariance[(c, a)] / term.alpha;
        let mu = term.mu_kpa();
        let half = u.t95 * mu.abs() * relative.max(0.0).sqrt();
        let is_known = u.is_determined[c] && u.is_determined[a];
        parameters.push(CauseParameter {
            name: format!("mu_{}", t + 1),
            value: mu,
            interval_95: is_known.then_some([mu - half, mu + half]),
        });
        parameters.push(CauseParameter {
            name: format!("alpha_{}", t + 1),
            value: term.alpha,
            interval_95: u.is_determined[a].then_some([term.alpha - u.half[a], term.alpha + u.half[a]]),
        });
    }
    let value = initial_shear_modulus_kpa(&terms);
    let mut variance = 0.0;
    for (i, a) in terms.iter().enumerate() {
        for (j, b) in terms.iter().enumerate() {
            variance += 0.25 * a.modulus_kpa * b.modulus_kpa * u.covariance[(2 * i, 2 * j)];
        }
    }
    let half = u.t95 * variance.max(0.0).sqrt();
    CurveMaterial {
        parameters,
        initial_shear_modulus_kpa: Interval { value, interval_95: [value - half, value + half] },
    }
}

/// The verdict in words.
pub(super) fn sentence(
    verdict: Verdict,
    causes: &[CurveCause],
    explained: f64,
    kept_back: &[MatchBeforeAfter],
) -> String {
    let names = causes.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(" and ");
    let mut text = match verdict {
        Verdict::NoMismatch => "An elastic material meets the curves up to their scatter.".to_string(),
        Verdict::Explained => format!("The mismatch is explained by {names} ({:.1} % of it).", 100.0 * explained),
        Verdict::ExplainedAmbiguously => {
            let rivals: Vec<String> = causes
                .iter()
                .filter(|c| !c.ambiguous_with.is_empty())
                .map(|c| format!("{} or {}", c.name, c.ambiguous_with.join(" or ")))
                .collect();
            format!(
                "The mismatch is explained by {names} ({:.1} % of it), but these curves cannot tell {}.",
                100.0 * explained,
                rivals.join("; ")
            )
        }
        Verdict::Unexplained if causes.is_empty() => "There is a mismatch that no hypothesis explains.".to_string(),
        Verdict::Unexplained => {
            format!("{names} takes away {:.1} % of the mismatch; what is left is not explained.", 100.0 * explained)
        }
    };
    for k in kept_back {
        text += &format!(
            " Kept-back {}: error {:.1} % elastic, {:.1} % with the causes.",
            k.before.name,
            100.0 * k.before.relative_rms_error,
            100.0 * k.after.relative_rms_error
        );
    }
    text
}
