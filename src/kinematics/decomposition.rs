//! The decomposition of an isochoric stretch into an amplitude λ and a mode k between equibiaxial and uniaxial tension.
//!
//! Nikolov et al., Phil. Trans. R. Soc. A 2022, equation for Λ_arb: λ̄ⱼ = λ^gⱼ(k). The inverse in closed form: with
//! eⱼ = ln λ̄ⱼ, d = k − ½ and L = ln λ one has e₂ = −d L and a = e₁ + e₂/2 = L (1 − d²), hence L² − a L − e₂² = 0.

use super::{Tensor, determinant, principal_stretches};

/// Below this ln λ the mode k is reported as missing. Singular values carry a relative error of about 10⁻¹⁵, so k is
/// good to 10⁻⁹ at the limit.
pub const MODE_TOLERANCE: f64 = 1e-6;

/// A deformation gradient seen as volume change, amplitude and mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decomposition {
    /// J = det F.
    pub jacobian: f64,
    /// λ₁ ≥ λ₂ ≥ λ₃, with the volume change.
    pub principal_stretches: [f64; 3],
    /// λ ≥ 1 of the isochoric part. NaN where J ≤ 0 or F is not finite.
    pub stretch_amplitude: f64,
    /// k ∈ [0, 1]: 0 equibiaxial, ½ pure shear, 1 uniaxial. Missing where ln λ is below [`MODE_TOLERANCE`] and where λ
    /// is NaN.
    pub deformation_mode: Option<f64>,
}

impl Decomposition {
    /// False where J ≤ 0 or F was not finite.
    pub fn is_admissible(&self) -> bool {
        self.stretch_amplitude.is_finite()
    }
}

/// Decomposes a deformation gradient.
///
/// ```
/// let shear = lambdak::kinematics::decompose(&[[1.0, 0.8, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
/// assert!((shear.stretch_amplitude - (0.4 + 1.16f64.sqrt())).abs() < 1e-14);
/// assert!((shear.deformation_mode.unwrap() - 0.5).abs() < 1e-14);
/// ```
pub fn decompose(deformation_gradient: &Tensor) -> Decomposition {
    let jacobian = determinant(deformation_gradient);
    let stretches = principal_stretches(deformation_gradient);
    let is_admissible = jacobian > 0.0 && stretches[2] > 0.0;
    if !is_admissible {
        return Decomposition {
            jacobian,
            principal_stretches: stretches,
            stretch_amplitude: f64::NAN,
            deformation_mode: None,
        };
    }
    let (amplitude, mode) = stretch_amplitude_and_mode(stretches);
    Decomposition { jacobian, principal_stretches: stretches, stretch_amplitude: amplitude, deformation_mode: mode }
}

/// (λ, k) of three positive principal stretches, largest first; a common factor (volume change) does not matter.
pub fn stretch_amplitude_and_mode(principal_stretches: [f64; 3]) -> (f64, Option<f64>) {
    let logarithms = principal_stretches.map(f64::ln);
    let mean = (logarithms[0] + logarithms[1] + logarithms[2]) / 3.0;
    let (e1, e2) = (logarithms[0] - mean, logarithms[1] - mean);
    let a = e1 + 0.5 * e2;
    let log_amplitude = 0.5 * (a + a.hypot(2.0 * e2));
    let mode = (log_amplitude > MODE_TOLERANCE).then(|| (0.5 - e2 / log_amplitude).clamp(0.0, 1.0));
    (log_amplitude.max(0.0).exp(), mode)
}

/// g(k) = (−k² + 3k/2 + ½, −k + ½, k² − k/2 − 1), the exponents of λ; they sum to zero.
pub fn mode_exponents(deformation_mode: f64) -> [f64; 3] {
    let k = deformation_mode;
    [-k * k + 1.5 * k + 0.5, 0.5 - k, k * k - 0.5 * k - 1.0]
}

/// dg/dk.
pub fn mode_exponent_derivatives(deformation_mode: f64) -> [f64; 3] {
    let k = deformation_mode;
    [1.5 - 2.0 * k, -1.0, 2.0 * k - 0.5]
}

/// Isochoric principal stretches λ^g(k), largest first for λ ≥ 1 and k ∈ [0, 1].
pub fn compose(stretch_amplitude: f64, deformation_mode: f64) -> [f64; 3] {
    mode_exponents(deformation_mode).map(|g| stretch_amplitude.powf(g))
}

#[cfg(test)]
mod tests {
    use super::super::stretches::tests::{diagonal, product, rotation};
    use super::*;
    use proptest::prelude::*;

    fn assert_state(f: &Tensor, amplitude: f64, mode: f64) {
        let d = decompose(f);
        // Logarithms and their differences: a few ulp over ln λ ≥ 0.04 in these cases.
        assert!((d.stretch_amplitude - amplitude).abs() < 1e-13 * amplitude, "{d:?}");
        assert!((d.deformation_mode.unwrap() - mode).abs() < 1e-13, "{d:?}");
    }

    #[test]
    fn closed_forms() {
        for s in [1.05, 1.7, 3.0f64] {
            assert_state(&diagonal([s, s.powf(-0.5), s.powf(-0.5)]), s, 1.0);
            assert_state(&diagonal([s.powf(0.5), s.powf(0.5), 1.0 / s]), s, 0.0);
            assert_state(&diagonal([s, 1.0, 1.0 / s]), s, 0.5);
            // Uniaxial compression is equibiaxial tension across.
            assert_state(&diagonal([1.0 / s, s.powf(0.5), s.powf(0.5)]), s, 0.0);
        }
    }

    /// Simple shear γ is pure shear with λ = γ/2 + √(1 + γ²/4).
    #[test]
    fn simple_shear() {
        for gamma in [0.1, 0.8, 1.5f64] {
            let f = [[1.0, gamma, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            assert_state(&f, 0.5 * gamma + (1.0 + 0.25 * gamma * gamma).sqrt(), 0.5);
        }
    }

    #[test]
    fn rest_has_no_mode() {
        for f in [diagonal([1.0; 3]), diagonal([1.3; 3]), rotation([1.0, 2.0, 3.0], 1.0)] {
            let d = decompose(&f);
            // Rounding of the rotation's entries.
            assert!((d.stretch_amplitude - 1.0).abs() < 1e-14);
            assert_eq!(d.deformation_mode, None);
            assert!(d.is_admissible());
        }
    }

    #[test]
    fn inverted_states_are_reported() {
        let d = decompose(&diagonal([1.0, 1.0, -1.0]));
        assert!(!d.is_admissible() && d.deformation_mode.is_none());
        assert!(!decompose(&[[0.0; 3]; 3]).is_admissible());
        assert!(!decompose(&[[f64::NAN; 3]; 3]).is_admissible());
    }

    #[test]
    fn exponents_and_their_derivatives() {
        for n in 0..=10 {
            let (k, h) = (0.1 * f64::from(n), 1e-6);
            let g = mode_exponents(k);
            assert!((g[0] + g[1] + g[2]).abs() < 1e-15);
            let (p, m) = (mode_exponents(k + h), mode_exponents(k - h));
            for j in 0..3 {
                // Quadratics: central differences are exact up to rounding / h.
                assert!(((p[j] - m[j]) / (2.0 * h) - mode_exponent_derivatives(k)[j]).abs() < 1e-9);
            }
        }
    }

    proptest! {
        /// Round trip (λ, k) → F → (λ, k) under any rotations and any volume change.
        #[test]
        fn round_trip(amplitude in 1.001f64..6.0, mode in 0.0f64..=1.0, volume in 0.5f64..2.0,
                      a in -3.0f64..3.0, b in -3.0f64..3.0) {
            let scale = volume.cbrt();
            let d = diagonal(compose(amplitude, mode).map(|s| scale * s));
            let f = product(&product(&rotation([1.0, a, 0.5], b), &d), &rotation([a, 0.3, b], a));
            let found = decompose(&f);
            // 10 ulp of the largest stretch in each singular value; k divides that by ln λ ≥ 10⁻³, and a stretch 36
            // times smaller than the largest loses that factor.
            prop_assert!((found.stretch_amplitude - amplitude).abs() < 1e-12 * amplitude);
            prop_assert!((found.deformation_mode.unwrap() - mode).abs() < 1e-11);
            prop_assert!((found.jacobian - volume).abs() < 1e-11);
        }
    }
}
