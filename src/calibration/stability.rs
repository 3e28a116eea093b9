//! Hill's stability over the states that a specimen visits.
//!
//! In logarithmic strains e (traceless) the stress power of an incompressible Ogden material is the quadratic form
//! Σ_j h_j ė_j² with h_j = Σ_i μ_i α_i λ̄_j^α_i. It is positive definite on Σ ė_j = 0 where its two eigenvalues are positive.
//! With every μ_iα_i > 0 it always is.

use crate::material::Ogden;

/// Parts of the way to each state at which the form is checked: a specimen passes them all while it is loaded.
const PARTS: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

/// Smallest eigenvalue of the form at isochoric principal stretches, kPa.
pub fn smallest_stiffness_kpa(material: &Ogden, stretches: [f64; 3]) -> f64 {
    let h =
        stretches.map(|s| material.terms.iter().map(|t| t.mu_kpa * t.alpha * (t.alpha * s.ln()).exp()).sum::<f64>());
    // On the plane Σ e = 0: trace ⅔ Σh, determinant ⅓ (h₁h₂ + h₂h₃ + h₃h₁).
    let half_trace = (h[0] + h[1] + h[2]) / 3.0;
    let determinant = (h[0] * h[1] + h[1] * h[2] + h[2] * h[0]) / 3.0;
    half_trace - (half_trace * half_trace - determinant).max(0.0).sqrt()
}

/// Smallest eigenvalue over all states and on the way to them, as a fraction of its value at rest, Σμα: positive is stable.
pub fn least_relative_stiffness(material: &Ogden, visited: &[[f64; 3]]) -> f64 {
    let at_rest = material.terms.iter().map(|t| t.mu_kpa * t.alpha).sum::<f64>();
    visited
        .iter()
        .flat_map(|s| PARTS.map(|p| s.map(|x| x.powf(p))))
        .map(|s| smallest_stiffness_kpa(material, s) / at_rest)
        .fold(1.0, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::test_problem::ogden;

    /// The closed form is the curvature of the energy along traceless logarithmic strains.
    #[test]
    fn eigenvalue_is_the_least_curvature() {
        let material = ogden(1.0, &[[9.0, 1.7], [0.4, 7.0], [-2.0, 2.5]]);
        let e = [0.4f64, -0.15, -0.25];
        let energy = |e: [f64; 3]| -> f64 {
            material
                .terms
                .iter()
                .map(|t| t.mu_kpa / t.alpha * e.iter().map(|x| (t.alpha * x).exp() - 1.0).sum::<f64>())
                .sum()
        };
        let least = (0..720)
            .map(|n| {
                let angle = f64::from(n) * std::f64::consts::PI / 720.0;
                let (c, s) = (angle.cos() / 2f64.sqrt(), angle.sin() / 6f64.sqrt());
                let d = [c + s, s - c, -2.0 * s];
                let h = 1e-4;
                let at = |t: f64| energy([0, 1, 2].map(|i| e[i] + t * d[i]));
                (at(h) - 2.0 * at(0.0) + at(-h)) / (h * h)
            })
            .fold(f64::INFINITY, f64::min);
        // Truncation h² and the quarter degree between directions.
        let exact = smallest_stiffness_kpa(&material, e.map(f64::exp));
        assert!((exact - least).abs() < 1e-4 * least.abs(), "{exact} {least}");
    }

    #[test]
    fn positive_products_are_stable_and_negative_ones_need_not_be() {
        let visited = [[2.0, 0.9, 1.0 / 1.8], [1.3, 1.0, 1.0 / 1.3]];
        assert!(least_relative_stiffness(&ogden(1.0, &[[9.0, 1.7], [-0.4, -7.0]]), &visited) > 0.0);
        assert!(least_relative_stiffness(&ogden(1.0, &[[9.0, 1.7], [0.4, 7.0], [-2.0, 6.0]]), &visited) < 0.0);
    }
}
