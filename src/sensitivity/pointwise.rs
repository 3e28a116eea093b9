//! Pointwise sensitivities S_ξ = ∂²Ψ/∂ξ∂λ of the Ogden energy as functions of (λ, k).
//!
//! From Ψ(λ, k) = Σᵢ μᵢ/αᵢ (Σⱼ λ^(αᵢ gⱼ) − 3): ∂Ψ/∂λ = Σᵢ μᵢ Σⱼ gⱼ λ^(αᵢ gⱼ − 1), so
//!
//! * S_μᵢ = Σⱼ gⱼ λ^(αᵢ gⱼ − 1), dimensionless;
//! * S_αᵢ = μᵢ ln λ Σⱼ gⱼ² λ^(αᵢ gⱼ − 1), kPa.
//!
//! Limits at λ = 1, where k is undefined: Σⱼ gⱼ(k) = 0 for every k gives S_μ → 0, and ln λ → 0 gives S_α → 0. Both hold
//! for all k, so points without a mode count as zero by continuity. S_κ = 0 because λ and k leave the volume alone.
//!
//! The code published with the paper drops the bracket of S_α, so that it is not zero at λ = 1; the forms here follow
//! from the energy and are checked against its differences.

use crate::kinematics::{mode_exponent_derivatives, mode_exponents};

/// A sensitivity and its derivatives with respect to the deformation state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointwiseSensitivity {
    /// S.
    pub value: f64,
    /// ∂S/∂λ.
    pub by_stretch_amplitude: f64,
    /// ∂S/∂k.
    pub by_deformation_mode: f64,
    /// ∂S/∂α of the same term.
    pub by_alpha: f64,
}

/// S_μ(λ, k; α), dimensionless (kPa of ∂Ψ/∂λ per kPa of μ), with its derivatives.
pub fn mu_sensitivity(stretch_amplitude: f64, deformation_mode: f64, alpha: f64) -> PointwiseSensitivity {
    let (lambda, log) = (stretch_amplitude, stretch_amplitude.ln());
    let (g, dg) = (mode_exponents(deformation_mode), mode_exponent_derivatives(deformation_mode));
    let mut s = PointwiseSensitivity::default();
    for j in 0..3 {
        let power = ((alpha * g[j] - 1.0) * log).exp();
        s.value += g[j] * power;
        s.by_stretch_amplitude += g[j] * (alpha * g[j] - 1.0) * power / lambda;
        s.by_deformation_mode += dg[j] * (1.0 + alpha * g[j] * log) * power;
        s.by_alpha += g[j] * g[j] * log * power;
    }
    s
}

/// S_α(λ, k; μ, α), kPa per unit of α, with its derivatives.
pub fn alpha_sensitivity(
    stretch_amplitude: f64,
    deformation_mode: f64,
    mu_kpa: f64,
    alpha: f64,
) -> PointwiseSensitivity {
    let (lambda, log) = (stretch_amplitude, stretch_amplitude.ln());
    let (g, dg) = (mode_exponents(deformation_mode), mode_exponent_derivatives(deformation_mode));
    let mut s = PointwiseSensitivity::default();
    for j in 0..3 {
        let power = mu_kpa * ((alpha * g[j] - 1.0) * log).exp();
        s.value += log * g[j] * g[j] * power;
        s.by_stretch_amplitude += g[j] * g[j] * (1.0 + log * (alpha * g[j] - 1.0)) * power / lambda;
        s.by_deformation_mode += log * g[j] * dg[j] * (2.0 + alpha * g[j] * log) * power;
        s.by_alpha += log * log * g[j] * g[j] * g[j] * power;
    }
    s
}

/// S_ξ(λ, k) of a parameter of a law W(x), x = Ī₁ − 3, whose ∂W′/∂ξ at x is `slope_derivative`, with the value alone:
/// with ∂Ī₁/∂λ = 2 Σⱼ gⱼ λ^(2 gⱼ − 1) it is ∂W′/∂ξ ∂Ī₁/∂λ.
pub fn law_sensitivity(
    stretch_amplitude: f64,
    deformation_mode: f64,
    slope_derivative: &dyn Fn(f64) -> f64,
) -> PointwiseSensitivity {
    let g = mode_exponents(deformation_mode);
    // expm1 keeps the digits of small strains.
    let x = g.iter().map(|g| (2.0 * g * stretch_amplitude.ln()).exp_m1()).sum();
    let rate = 2.0 * mu_sensitivity(stretch_amplitude, deformation_mode, 2.0).value;
    PointwiseSensitivity { value: slope_derivative(x) * rate, ..PointwiseSensitivity::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::compose;

    /// Isochoric energy of one term, from the principal stretches.
    fn energy(lambda: f64, k: f64, mu: f64, alpha: f64) -> f64 {
        mu / alpha * (compose(lambda, k).map(|s| s.powf(alpha)).iter().sum::<f64>() - 3.0)
    }

    const STATES: [(f64, f64, f64, f64); 6] = [
        (1.7, 0.535, 17.0, 1.91),
        (1.2, 0.0, 17.0, -2.0),
        (2.5, 1.0, 0.35, 8.0),
        (1.01, 0.3, 16.0, 1.9),
        (1.5, 0.5, -3.0, -4.0),
        (3.0, 0.8, 5.0, 0.7),
    ];

    /// S_μ = ∂²Ψ/∂μ∂λ and S_α = ∂²Ψ/∂α∂λ by central differences of the energy.
    #[test]
    fn second_derivatives_of_the_energy() {
        let h = 1e-4;
        for (lambda, k, mu, alpha) in STATES {
            let mixed = |dm: f64, da: f64| {
                let slope = |m: f64, a: f64| (energy(lambda + h, k, m, a) - energy(lambda - h, k, m, a)) / (2.0 * h);
                (slope(mu + dm, alpha + da) - slope(mu - dm, alpha - da)) / (2.0 * h)
            };
            let (s_mu, s_alpha) =
                (mu_sensitivity(lambda, k, alpha).value, alpha_sensitivity(lambda, k, mu, alpha).value);
            // Truncation h²/6 × third derivatives (below 10³ here) and rounding ε Ψ/h² ~ 1e-6 at Ψ ~ 100.
            let tolerance = |s: f64| 3e-6 * (1.0 + s.abs() + energy(lambda, k, mu, alpha).abs() / 10.0);
            assert!((mixed(h, 0.0) - s_mu).abs() < tolerance(s_mu), "{} {s_mu}", mixed(h, 0.0));
            assert!((mixed(0.0, h) - s_alpha).abs() < tolerance(s_alpha), "{} {s_alpha}", mixed(0.0, h));
        }
    }

    #[test]
    fn derivatives_by_differences() {
        let h = 1e-5;
        for (lambda, k, mu, alpha) in STATES {
            let at = |l: f64, k: f64, a: f64| [mu_sensitivity(l, k, a), alpha_sensitivity(l, k, mu, a)];
            let pairs = [
                (at(lambda + h, k, alpha), at(lambda - h, k, alpha)),
                (at(lambda, k + h, alpha), at(lambda, k - h, alpha)),
                (at(lambda, k, alpha + h), at(lambda, k, alpha - h)),
            ];
            for which in 0..2 {
                let s = at(lambda, k, alpha)[which];
                let exact = [s.by_stretch_amplitude, s.by_deformation_mode, s.by_alpha];
                for (direction, (plus, minus)) in pairs.iter().enumerate() {
                    let difference = (plus[which].value - minus[which].value) / (2.0 * h);
                    // Truncation h²/6 × third derivative (below 10⁴) plus rounding ε S/h ~ 1e-9.
                    assert!((difference - exact[direction]).abs() < 1e-6 * (1.0 + exact[direction].abs()));
                }
            }
        }
    }

    /// Both vanish at λ = 1 for every mode.
    #[test]
    fn zero_at_rest() {
        for n in 0..=10 {
            let k = 0.1 * f64::from(n);
            // Sum of three numbers of order one.
            assert!(mu_sensitivity(1.0, k, 1.91).value.abs() < 1e-15);
            assert!(alpha_sensitivity(1.0, k, 17.0, 1.91).value.abs() < 1e-15);
        }
    }

    /// The paper's k = 0.535: it maximises the smallest normalised S_α(k)/max_k S_α over −2 < α < 5 at λ = 1.7.
    /// Grids: k in steps of 10⁻⁴ on [0, 1]; α in steps of 0.01 on [−2, 5] (the interval's ends as limits; they decide).
    #[test]
    fn mode_that_serves_every_alpha() {
        let num_modes = 10_001;
        let mode = |n: usize| n as f64 / (num_modes - 1) as f64;
        let mut smallest = vec![f64::INFINITY; num_modes];
        for m in 0..=700 {
            let alpha = -2.0 + 0.01 * f64::from(m);
            let s: Vec<f64> = (0..num_modes).map(|n| alpha_sensitivity(1.7, mode(n), 1.0, alpha).value).collect();
            let largest = s.iter().copied().fold(0.0, f64::max);
            for (low, value) in smallest.iter_mut().zip(s) {
                *low = low.min(value / largest);
            }
        }
        let best = (0..num_modes).max_by(|&a, &b| smallest[a].total_cmp(&smallest[b])).unwrap();
        // Printed to three digits.
        assert!((mode(best) - 0.535).abs() < 0.0005, "k = {}", mode(best));
    }
}
