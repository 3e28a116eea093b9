//! Which of several nested models the data call for: the decrement of the misfit, an F-test and the Bayesian
//! information criterion, side by side.

use super::statistics::f_exceedance;
use serde::{Deserialize, Serialize};

/// A further model must lower the misfit by at least this part to pass the decrement rule.
pub const MIN_DECREMENT: f64 = 0.1;
/// Level of the F-test.
pub const F_LEVEL: f64 = 0.01;

/// One model of the sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ModelEvidence {
    /// What the model is called.
    pub name: String,
    /// Free parameters.
    pub num_parameters: usize,
    /// Σ (residual / weight)².
    pub sum_of_squares: f64,
    /// 1 − this sum of squares / the one before.
    pub decrement: Option<f64>,
    /// F statistic against the model before.
    pub f_value: Option<f64>,
    /// Probability of so large an F without a real improvement.
    pub f_probability: Option<f64>,
    /// n ln(Σ/n) + k ln n with n the number of independent data; smaller is better.
    pub bic: f64,
}

/// Which model each rule takes, and the one that decides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Selection {
    /// The models, each nested in the next.
    pub models: Vec<ModelEvidence>,
    /// Index of the model that the decrement rule takes.
    pub by_decrement: usize,
    /// Index of the model that the F-test takes.
    pub by_f_test: usize,
    /// Index of the model with the smallest BIC.
    pub by_bic: usize,
    /// The rule that decides: `bic`.
    pub decides: String,
    /// Data points, and how many independent ones they are worth given the correlation of the richest model's
    /// residuals.
    pub num_data: usize,
    /// See `num_data`.
    pub num_independent: f64,
}

impl Selection {
    /// The chosen model's index.
    pub fn chosen(&self) -> usize {
        self.by_bic
    }
}

/// BIC without its constant, for Σ squares of `n` independent data with unknown variance.
pub fn bic(sum_of_squares: f64, num_parameters: usize, n: f64) -> f64 {
    n * (sum_of_squares.max(1e-300) / n).ln() + num_parameters as f64 * n.ln()
}

/// Compares models given as (name, parameters, Σ squares), simplest first.
pub fn compare(models: &[(String, usize, f64)], num_data: usize, num_independent: f64) -> Selection {
    let n = num_independent;
    let mut evidence: Vec<ModelEvidence> = Vec::with_capacity(models.len());
    for (i, (name, k, sum)) in models.iter().enumerate() {
        let before = (i > 0).then(|| (models[i - 1].1, models[i - 1].2));
        let f_value = before.and_then(|(k0, sum0)| {
            let (added, left) = ((*k as f64) - (k0 as f64), n - *k as f64);
            (added > 0.0 && left > 0.0).then(|| ((sum0 - sum).max(0.0) / added) / (sum / left).max(1e-300))
        });
        let f_probability =
            f_value.zip(before).map(|(f, (k0, _))| f_exceedance(f, *k as f64 - k0 as f64, n - *k as f64));
        evidence.push(ModelEvidence {
            name: name.clone(),
            num_parameters: *k,
            sum_of_squares: *sum,
            decrement: before.map(|(_, sum0)| 1.0 - sum / sum0.max(1e-300)),
            f_value,
            f_probability,
            bic: bic(*sum, *k, n),
        });
    }
    // The sequential rules stop at the first model that does not pay.
    let stop = |pays: &dyn Fn(&ModelEvidence) -> bool| {
        evidence.iter().skip(1).position(|m| !pays(m)).unwrap_or(evidence.len().saturating_sub(1))
    };
    let by_decrement = stop(&|m| m.decrement.is_some_and(|d| d >= MIN_DECREMENT));
    let by_f_test = stop(&|m| m.f_probability.is_some_and(|p| p < F_LEVEL));
    let by_bic = (0..evidence.len()).min_by(|&a, &b| evidence[a].bic.total_cmp(&evidence[b].bic)).unwrap_or(0);
    Selection { models: evidence, by_decrement, by_f_test, by_bic, decides: "bic".into(), num_data, num_independent }
}

/// Correlation of neighbouring residuals within each list (each in the order of its recording).
pub fn neighbour_correlation(residuals: &[&[f64]]) -> f64 {
    let products: f64 = residuals.iter().flat_map(|r| r.windows(2)).map(|w| w[0] * w[1]).sum();
    let pairs: f64 = residuals.iter().map(|r| r.len().saturating_sub(1) as f64).sum();
    let squares: f64 = residuals.iter().flat_map(|r| r.iter()).map(|v| v * v).sum();
    let count: f64 = residuals.iter().map(|r| r.len() as f64).sum();
    if squares > 0.0 && pairs > 0.0 { (products / pairs) / (squares / count) } else { 0.0 }
}

/// How many independent data the residuals are worth, n (1 − ρ)/(1 + ρ) for a correlation ρ of neighbours that noise
/// alone would not show (more than two standard deviations 1/√n); at least `least`.
pub fn independent_count(residuals: &[&[f64]], least: f64) -> f64 {
    let n: f64 = residuals.iter().map(|r| r.len() as f64).sum();
    let rho = neighbour_correlation(residuals);
    if rho * n.sqrt() <= 2.0 {
        return n;
    }
    (n * (1.0 - rho) / (1.0 + rho)).clamp(least.min(n), n)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White residuals count in full; pairs of equal residuals count for about half and less.
    #[test]
    fn correlated_data_count_less() {
        let white: Vec<f64> = (0..100).map(|i: i32| f64::from((i * 7919 + 13) % 101) - 50.0).collect();
        assert!((independent_count(&[&white], 5.0) - 100.0).abs() < 1e-12);
        let slow: Vec<f64> = (0..100).map(|i| (f64::from(i) * 0.05).sin()).collect();
        assert!(independent_count(&[&slow], 5.0) < 10.0);
    }

    /// A second parameter that halves the misfit of 100 data pays by all rules; one that takes 1 % pays by none: BIC's
    /// price is ln 100 = 4.6 against 100 ln(1/0.99) = 1.0.
    #[test]
    fn rules_agree_on_clear_cases() {
        let models = [("a".to_string(), 1, 2.0), ("b".to_string(), 2, 1.0), ("c".to_string(), 3, 0.99)];
        let s = compare(&models, 100, 100.0);
        assert_eq!((s.by_decrement, s.by_f_test, s.by_bic), (1, 1, 1));
        assert!(s.models[1].f_probability.unwrap() < 1e-10 && s.models[2].f_probability.unwrap() > 0.05);
    }
}
