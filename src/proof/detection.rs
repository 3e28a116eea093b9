//! Probability of detection against size, as in the testing of materials without destroying them (MIL-HDBK-1823A):
//! whether a flaw of size a is found follows a logistic curve in ln a, fitted to hits and misses; a90/95 is the size
//! that is found with 90 % probability with 95 % confidence.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Iterations of the fit (Newton's method on a concave function; it settles in ten).
const ITERATIONS: usize = 100;
/// A fit has settled where a step moves both coefficients by less than this.
const SETTLED: f64 = 1e-10;
/// Strength of the prior that keeps the slope finite where hits and misses do not overlap: a logistic distribution of
/// the slope of this scale (Firth's remedy in its simplest form).
const SLOPE_SD: f64 = 10.0;
/// Of a standard normal distribution: 95 % lie below.
const ONE_SIDED_95: f64 = 1.645;
/// ln(0.9/0.1).
const LOGIT_90: f64 = 2.197_224_577_336_219_6;
/// Fewer hits or misses than this say nothing of a curve.
const FEWEST: usize = 3;

/// A fitted curve: P(found) = 1 / (1 + exp(−(b₀ + b₁ ln a))).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DetectionCurve {
    /// b₀ and b₁ for a in mm.
    pub coefficients: [f64; 2],
    /// Variances of both and their covariance.
    pub covariance: [f64; 3],
    /// Size found with 50 % probability, mm.
    pub a50_mm: f64,
    /// Size found with 90 % probability, mm.
    pub a90_mm: f64,
    /// Size found with 90 % probability with 95 % confidence, mm; null where the data do not bound it.
    pub a90_95_mm: Option<f64>,
}

impl DetectionCurve {
    /// The curve of sizes (mm) that were found or not; `None` where there are too few of either.
    pub fn fitted(sizes: &[(f64, bool)]) -> Option<DetectionCurve> {
        let usable: Vec<(f64, f64)> = sizes
            .iter()
            .filter(|(a, _)| *a > 0.0)
            .map(|(a, is_found)| (a.ln(), f64::from(u8::from(*is_found))))
            .collect();
        let num_found = usable.iter().filter(|(_, y)| *y > 0.5).count();
        if num_found < FEWEST || usable.len() - num_found < FEWEST {
            return None;
        }
        let center = usable.iter().map(|(x, _)| x).sum::<f64>() / usable.len() as f64;
        let mut b = Vector2::new(0.0, 1.0);
        let mut information = Matrix2::identity();
        for _ in 0..ITERATIONS {
            let prior = SLOPE_SD.powi(-2);
            let mut gradient = Vector2::new(0.0, -prior * b[1]);
            information = Matrix2::new(0.0, 0.0, 0.0, prior);
            for (x, y) in &usable {
                let row = Vector2::new(1.0, x - center);
                let p = 1.0 / (1.0 + (-b.dot(&row)).exp());
                gradient += (y - p) * row;
                information += p * (1.0 - p) * row * row.transpose();
            }
            let step = information.try_inverse()? * gradient;
            // A step of more than two would leave the curve's range.
            let part = (2.0 / step.amax().max(2.0)).min(1.0);
            b += part * step;
            if step.amax() < SETTLED {
                break;
            }
        }
        let inverse = information.try_inverse()?;
        if b[1] <= 0.0 {
            return None;
        }
        let at = |logit: f64| ((logit - b[0]) / b[1] + center).exp();
        // Back from sizes about the centre.
        let turn = Matrix2::new(1.0, -center, 0.0, 1.0);
        let (b_plain, c) = (turn * b, turn * inverse * turn.transpose());
        let mut curve = DetectionCurve {
            coefficients: [b_plain[0], b_plain[1]],
            covariance: [c[(0, 0)], c[(1, 1)], c[(0, 1)]],
            a50_mm: at(0.0),
            a90_mm: at(LOGIT_90),
            a90_95_mm: None,
        };
        curve.a90_95_mm = curve.confident_size_mm();
        Some(curve)
    }

    /// Probability that a size (mm) is found.
    pub fn probability(&self, size_mm: f64) -> f64 {
        1.0 / (1.0 + (-self.coefficients[0] - self.coefficients[1] * size_mm.ln()).exp())
    }

    /// The same, exceeded with 95 % confidence.
    pub fn lower_bound(&self, size_mm: f64) -> f64 {
        1.0 / (1.0 + (-self.lower_logit(size_mm.ln())).exp())
    }

    fn lower_logit(&self, x: f64) -> f64 {
        let [v0, v1, cross] = self.covariance;
        let variance = (v0 + 2.0 * x * cross + x * x * v1).max(0.0);
        self.coefficients[0] + self.coefficients[1] * x - ONE_SIDED_95 * variance.sqrt()
    }

    /// Where the lower bound reaches 90 %, within a factor of 100 above a90.
    fn confident_size_mm(&self) -> Option<f64> {
        const STEPS: usize = 2000;
        let (from, width) = (self.a90_mm.ln(), 100f64.ln());
        let at = |n: usize| from + width * n as f64 / STEPS as f64;
        (0..=STEPS).map(at).find(|x| self.lower_logit(*x) >= LOGIT_90).map(f64::exp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hits and misses drawn at even quantiles of a known curve: the fit finds it again, and more of them say more.
    #[test]
    fn a_known_curve_is_found() {
        let drawn = |repeats: usize| -> Vec<(f64, bool)> {
            let mut all = Vec::new();
            for n in 0..40 {
                let a = 0.001 * 1.15f64.powi(n);
                let p = 1.0 / (1.0 + (-(3.0 * (a.ln() - 0.02f64.ln()))).exp());
                for k in 0..10 * repeats {
                    all.push((a, (k as f64 + 0.5) / (10 * repeats) as f64 <= p));
                }
            }
            all
        };
        let curve = DetectionCurve::fitted(&drawn(10)).unwrap();
        // Quantised to a hundredth at each size.
        assert!((curve.a50_mm / 0.02 - 1.0).abs() < 0.02, "{curve:?}");
        assert!((curve.coefficients[1] - 3.0).abs() < 0.15, "{curve:?}");
        assert!((curve.probability(curve.a90_mm) - 0.9).abs() < 1e-9);
        let (few, many) = (DetectionCurve::fitted(&drawn(1)).unwrap().a90_95_mm, curve.a90_95_mm);
        assert!(few > many && many > Some(curve.a90_mm), "{few:?} {many:?}");
        assert!((curve.lower_bound(many.unwrap()) - 0.9).abs() < 0.01);
    }

    /// Nothing is said where nothing was missed, or where the larger are found less often.
    #[test]
    fn too_little_says_nothing() {
        assert_eq!(DetectionCurve::fitted(&[(0.1, true), (0.2, true), (0.3, true), (0.4, true)]), None);
        let against: Vec<(f64, bool)> = (1..20).map(|n| (0.01 * f64::from(n), n < 10)).collect();
        assert_eq!(DetectionCurve::fitted(&against), None);
    }
}
