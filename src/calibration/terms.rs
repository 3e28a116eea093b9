//! How many terms: three rules, all shown, one deciding.
//!
//! * The paper's: a term stays while it lowers ℓ_u + βℓ_F by more than a threshold.
//! * The F-test: F = (Δχ²/2) / (χ²/(n − p)) of the larger model, p-value (1 + 2F/(n − p))^(−(n−p)/2). The exponent of a
//!   term that is not there has no value, so the true p-value is larger by about the number of exponents that could be
//!   told apart.
//! * The Bayesian information criterion: Δχ²/s² against 2 ln n, with s² the misfit per datum of the largest model. It
//!   needs no noise level and, with n in the ten thousands, is the strictest.

use super::recording_fit::{RecordingFit, is_settled};
use crate::material::{Material, OgdenTerm};
use serde::{Deserialize, Serialize};
use std::fmt;
use utoipa::ToSchema;

/// Which rule decides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[schema(as = TermRule)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// The Bayesian information criterion.
    #[default]
    Bic,
    /// The F-test at [`F_TEST_LEVEL`].
    FTest,
    /// The paper's decrement of ℓ.
    Decrement,
}

/// What decided the number of terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DecidedBy {
    /// It was given.
    Fixed,
    /// The Bayesian information criterion.
    Bic,
    /// The F-test.
    FTest,
    /// The paper's decrement.
    Decrement,
}

impl From<Rule> for DecidedBy {
    fn from(rule: Rule) -> DecidedBy {
        match rule {
            Rule::Bic => DecidedBy::Bic,
            Rule::FTest => DecidedBy::FTest,
            Rule::Decrement => DecidedBy::Decrement,
        }
    }
}

impl fmt::Display for DecidedBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            DecidedBy::Fixed => "the number was given",
            DecidedBy::Bic => "BIC",
            DecidedBy::FTest => "the F-test",
            DecidedBy::Decrement => "the decrement",
        })
    }
}

/// Level of the F-test.
pub const F_TEST_LEVEL: f64 = 0.01;
/// Smallest decrement of ℓ that keeps a term: between those that the paper kept and those that it did not (its Table
/// 2).
pub const DECREMENT_THRESHOLD: f64 = 1e-5;
/// A term that nowhere makes a larger part of the stress is faded.
const FADED_SHARE: f64 = 1e-3;
/// |α| below which a term is μα ln λ: only the product is seen.
const SMALL_EXPONENT: f64 = 0.1;
/// Estimates correlated beyond this are one number.
const CORRELATION_LIMIT: f64 = 0.999;

/// One number of terms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TermRow {
    /// Number of terms.
    pub num_terms: usize,
    /// χ² of the best fit.
    pub chi2: f64,
    /// χ² per datum.
    pub chi2_per_datum: f64,
    /// ℓ_u + βℓ_F of the best fit.
    pub paper_loss: f64,
    /// ½ Σμα, kPa.
    pub initial_shear_modulus_kpa: f64,
    /// κ, μ₁, α₁, μ₂, …
    pub values: Vec<f64>,
    /// Decrease of χ² by the last term, over the misfit per datum; null for one term.
    pub chi2_decrease: Option<f64>,
    /// F of the last term.
    pub f_value: Option<f64>,
    /// p-value of F.
    pub f_p_value: Option<f64>,
    /// ΔBIC by the last term: negative keeps it.
    pub bic_change: Option<f64>,
    /// ℓ_N − ℓ_N+1, the paper's F-value.
    pub decrement: Option<f64>,
    /// Starts tried, and how many ended in the best optimum.
    pub num_starts: usize,
    /// Starts that ended within Δχ² = 1 of the best.
    pub num_agreeing: usize,
    /// Whether the best fit converged.
    pub is_converged: bool,
    /// What the linear model at the estimate promises still, in standard deviations.
    pub distance_sd: f64,
    /// Smallest stiffness over the visited states relative to that at rest: positive is stable.
    pub least_relative_stiffness: f64,
    /// Degeneracies: faded terms, exponents near zero, terms that are one.
    pub degeneracies: Vec<String>,
}

/// The choice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TermSelection {
    /// One row per number of terms tried.
    pub rows: Vec<TermRow>,
    /// Number of terms that each rule takes.
    pub by_bic: usize,
    /// By the F-test.
    pub by_f_test: usize,
    /// By the paper's decrement.
    pub by_decrement: usize,
    /// Which rule decided, or that the number was given.
    pub decided_by: DecidedBy,
    /// The number taken.
    pub chosen: usize,
    /// χ² decrease (over the misfit per datum) that the deciding rule asks of a term.
    pub needed_chi2_decrease: Option<f64>,
}

/// Fills the comparisons of each row with the one before. `num_data` values were compared, `beta` is the paper's.
pub(super) fn compare(rows: &mut [TermRow], num_data: usize) {
    for n in 1..rows.len() {
        let before = rows[n - 1].clone();
        let row = &mut rows[n];
        let spread = row.chi2_per_datum.max(f64::MIN_POSITIVE);
        let decrease = (before.chi2 - row.chi2).max(0.0) / spread;
        let freedom = num_data as f64 - row.values.len() as f64;
        let f = 0.5 * decrease;
        row.chi2_decrease = Some(decrease);
        row.f_value = Some(f);
        row.f_p_value = Some((-0.5 * freedom * (2.0 * f / freedom).ln_1p()).exp());
        row.bic_change = Some(2.0 * (num_data as f64).ln() - decrease);
        row.decrement = Some(before.paper_loss - row.paper_loss);
    }
}

/// Whether `row` is worth its last term by a rule; an unstable or unsettled term never is.
pub(super) fn is_kept(row: &TermRow, rule: Rule, threshold: f64) -> bool {
    let is_sound = is_settled(row.is_converged, row.distance_sd) && row.least_relative_stiffness > 0.0;
    is_sound
        && match rule {
            Rule::Bic => row.bic_change.is_some_and(|c| c < 0.0),
            Rule::FTest => row.f_p_value.is_some_and(|p| p < F_TEST_LEVEL),
            Rule::Decrement => row.decrement.is_some_and(|d| d > threshold),
        }
}

/// Number of terms by a rule: terms are added while each is kept.
pub(super) fn choose(rows: &[TermRow], rule: Rule, threshold: f64) -> usize {
    1 + rows.iter().skip(1).take_while(|r| is_kept(r, rule, threshold)).count()
}

/// The largest part that a term has of the stress, over the isochoric principal stretches `visited`: of a term with a
/// large exponent μα may be nothing and the stress at large stretches much.
fn largest_share(material: &Material, term: &OgdenTerm, visited: &[[f64; 3]]) -> f64 {
    let size = |terms: &[OgdenTerm], stretches: &[f64; 3]| {
        let stress = stretches.map(|s| terms.iter().map(|t| t.mu_kpa * s.powf(t.alpha)).sum::<f64>());
        let mean = stress.iter().sum::<f64>() / 3.0;
        stress.iter().map(|t| (t - mean).powi(2)).sum::<f64>().sqrt()
    };
    let at_rest = |terms: &[OgdenTerm]| terms.iter().map(|t| t.mu_kpa * t.alpha).sum::<f64>();
    let one = std::slice::from_ref(term);
    visited
        .iter()
        .map(|s| size(one, s) / size(&material.terms, s).max(f64::MIN_POSITIVE))
        .fold((at_rest(one) / at_rest(&material.terms)).abs(), f64::max)
}

/// What is degenerate about a fit that visits these isochoric principal stretches, in words.
pub(super) fn degeneracies(fit: &RecordingFit, visited: &[[f64; 3]]) -> Vec<String> {
    let terms = &fit.material.terms;
    let mut found = Vec::new();
    for (n, term) in terms.iter().enumerate() {
        let share = largest_share(&fit.material, term, visited);
        if share < FADED_SHARE {
            found.push(format!("term {}: faded (nowhere more than {share:.1e} of the stress)", n + 1));
        }
        if term.alpha.abs() < SMALL_EXPONENT {
            found.push(format!("term {}: α is near zero, only μα is seen", n + 1));
        }
    }
    for i in 0..terms.len() {
        for j in 0..i {
            let (a, b) = (2 * i + 2, 2 * j + 2);
            if fit.covariance.correlation(a - 1, b - 1).is_some_and(|c| c.abs() > CORRELATION_LIMIT) {
                found.push(format!("terms {} and {}: their μ are one number (correlation beyond 0.999)", j + 1, i + 1));
            }
        }
    }
    if !fit.is_converged {
        found.push(format!("not at the optimum: {:.2} standard deviations away by the linear model", fit.distance));
    }
    found.extend(fit.reached_limits.iter().map(|l| format!("at a limit: {l}")));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(num_terms: usize, chi2: f64, loss: f64) -> TermRow {
        TermRow {
            num_terms,
            chi2,
            chi2_per_datum: 1.0,
            paper_loss: loss,
            initial_shear_modulus_kpa: 16.0,
            values: vec![1.0; 2 * num_terms + 1],
            chi2_decrease: None,
            f_value: None,
            f_p_value: None,
            bic_change: None,
            decrement: None,
            num_starts: 1,
            num_agreeing: 1,
            is_converged: true,
            distance_sd: 0.0,
            least_relative_stiffness: 1.0,
            degeneracies: vec![],
        }
    }

    /// Δχ² of 15 over 10⁴ data: the F-test keeps the term (p = e^(−7.5) to first order), BIC (2 ln 10⁴ = 18.4) does
    /// not.
    #[test]
    fn rules_differ_as_they_should() {
        let mut rows = vec![row(1, 10_015.0, 3e-3), row(2, 10_000.0, 2.98e-3), row(3, 9_999.0, 2.98e-3)];
        compare(&mut rows, 10_000);
        let p = rows[1].f_p_value.unwrap();
        // The exponential is the limit of large n; the next order is F²/n.
        assert!((p / (-7.5f64).exp() - 1.0).abs() < 0.01, "{p:e}");
        assert_eq!(choose(&rows, Rule::Bic, 1e-5), 1);
        assert_eq!(choose(&rows, Rule::FTest, 1e-5), 2);
        assert_eq!(choose(&rows, Rule::Decrement, 1e-5), 2);
        rows[1].is_converged = false;
        assert_eq!(choose(&rows, Rule::FTest, 1e-5), 2);
        rows[1].distance_sd = 1.5;
        assert_eq!(choose(&rows, Rule::FTest, 1e-5), 1);
    }
}
