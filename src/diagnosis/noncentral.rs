//! The noncentral χ² distribution, which the fall of the deviance has where a cause is there.
//!
//! A cause whose effect, weighed and freed of what the material can do in its place, has the squared length λ lowers
//! the deviance of a fit with p parameters by T ~ χ²_p(λ): λ + p on average, with the variance 2 p + 4 λ. Its
//! distribution is taken from Sankaran's (1963) approximation: (T/(p + λ))^h is near Gaussian for
//! h = 1 − ⅔ (p + λ)(p + 3λ)/(p + 2λ)². For the p and λ of causes it errs by less than a thousandth in probability (see
//! the tests).

use crate::homogeneous::erf;

/// Halvings of the interval in which a noncentrality is looked for: down to rounding.
const BISECTIONS: usize = 100;

/// Probability that a noncentral χ² variable with `degrees` degrees of freedom and the `noncentrality` λ exceeds
/// `value`.
pub(super) fn exceedance(value: f64, degrees: f64, noncentrality: f64) -> f64 {
    if !(value > 0.0) {
        return 1.0;
    }
    let (k, l) = (degrees, noncentrality);
    let h = 1.0 - 2.0 / 3.0 * (k + l) * (k + 3.0 * l) / (k + 2.0 * l).powi(2);
    let p = (k + 2.0 * l) / (k + l).powi(2);
    let m = (h - 1.0) * (1.0 - 3.0 * h);
    let mean = 1.0 + h * p * (h - 1.0 - 0.5 * (2.0 - h) * m * p);
    let sd = h * (2.0 * p).sqrt() * (1.0 + 0.5 * m * p);
    let z = ((value / (k + l)).powf(h) - mean) / sd;
    0.5 * (1.0 - erf(z / std::f64::consts::SQRT_2))
}

/// The noncentrality λ with which a variable with `degrees` degrees of freedom exceeds `value` with `probability`; 0
/// where it does so without any.
pub(super) fn noncentrality_to_exceed(value: f64, degrees: f64, probability: f64) -> f64 {
    if exceedance(value, degrees, 0.0) >= probability {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, value.max(1.0));
    while exceedance(value, degrees, high) < probability {
        high *= 2.0;
    }
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if exceedance(value, degrees, middle) < probability { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Probability that a central χ² variable with k degrees of freedom is below x: the series of the incomplete gamma
    /// function, all of whose terms are positive.
    fn central(x: f64, k: u32) -> f64 {
        let (a, t) = (0.5 * f64::from(k), 0.5 * x);
        // ln Γ(a) up from Γ(1) = 1 or Γ(½) = √π.
        let first: f64 = if k.is_multiple_of(2) { 1.0 } else { 0.5 };
        let mut ln_gamma = if k.is_multiple_of(2) { 0.0 } else { 0.5 * std::f64::consts::PI.ln() };
        let mut b = first;
        while b < a - 0.1 {
            ln_gamma += b.ln();
            b += 1.0;
        }
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, 0.0);
        while term > 1e-18 * sum {
            n += 1.0;
            term *= t / (a + n);
            sum += term;
        }
        (a * t.ln() - t - ln_gamma).exp() * sum
    }

    /// The noncentral distribution as it is defined: Poisson weights on central ones of k, k + 2, … degrees of freedom.
    fn exact(value: f64, k: u32, noncentrality: f64) -> f64 {
        let (half, mut log_weight, mut below) = (0.5 * noncentrality, -0.5 * noncentrality, 0.0);
        for j in 0..600 {
            below += log_weight.exp() * central(value, k + 2 * j);
            log_weight += half.ln() - f64::from(j + 1).ln();
        }
        1.0 - below
    }

    /// A table of the central distribution: what the exact values rest on.
    #[test]
    fn central_values() {
        for (x, k, p) in [(3.841_459, 1, 0.95), (5.991_465, 2, 0.95), (18.307_038, 10, 0.95), (43.772_972, 30, 0.95)] {
            // To the digits printed.
            assert!((central(x, k) - p).abs() < 1e-7, "{k}: {}", central(x, k));
        }
    }

    /// Against exact values: one parameter to thirty, near the limits of the evidence and at ten times these, below,
    /// at and above the mean.
    #[test]
    fn it_is_near_the_exact_distribution() {
        for k in [1, 3, 6, 30] {
            for limit in [30.0, 100.0, 300.0] {
                let value = limit + 11.0 * f64::from(k);
                for part in [0.7, 1.0, 1.4] {
                    let noncentrality = part * value;
                    let (found, expected) =
                        (exceedance(value, f64::from(k), noncentrality), exact(value, k, noncentrality));
                    // Sankaran's approximation is of third order in 1/√(k + λ), which is a tenth or less here.
                    assert!((found - expected).abs() < 1e-3, "{k} {value} {noncentrality}: {found} {expected}");
                }
            }
        }
    }

    /// Sums of squares of shifted Gaussian numbers exceed the value in nine of ten draws.
    #[test]
    fn draws_exceed_as_often_as_asked() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let (degrees, value, num_draws) = (6, 96.0, 20_000);
        let shift = noncentrality_to_exceed(value, f64::from(degrees), 0.9).sqrt();
        let mut num_above = 0;
        for _ in 0..num_draws {
            let sum: f64 = (0..degrees)
                .map(|n| {
                    let x: f64 = StandardNormal.sample(&mut rng);
                    (x + if n == 0 { shift } else { 0.0 }).powi(2)
                })
                .sum();
            num_above += usize::from(sum > value);
        }
        // Four standard deviations of the count: 4 √(0.9 · 0.1/20,000).
        assert!((num_above as f64 / f64::from(num_draws) - 0.9).abs() < 8.5e-3, "{num_above}");
    }

    #[test]
    fn what_is_exceeded_anyway_needs_nothing() {
        assert_eq!(noncentrality_to_exceed(0.0, 3.0, 0.9), 0.0);
        let needed = noncentrality_to_exceed(40.0, 1.0, 0.9);
        // One Gaussian number of mean √λ: √λ = √40 + 1.2816, to the approximation's error in probability (1e-3) over
        // the density there (0.18).
        assert!((needed.sqrt() - (40f64.sqrt() + 1.2816)).abs() < 6e-3, "{needed}");
    }
}
