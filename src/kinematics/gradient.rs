//! Derivatives of (λ, k) with respect to the deformation gradient.

use super::{MODE_TOLERANCE, Tensor, determinant, principal_frame};

/// ∂λ/∂F and ∂k/∂F, `[current][reference]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateGradient {
    /// ∂λ/∂F_iJ.
    pub stretch_amplitude: Tensor,
    /// ∂k/∂F_iJ.
    pub deformation_mode: Tensor,
}

/// Derivatives of λ and k. None where k is missing or F inadmissible.
///
/// With F = Σ λⱼ nⱼ ⊗ Nⱼ, ∂ ln λⱼ/∂F = nⱼ ⊗ Nⱼ / λⱼ; eⱼ = ln λⱼ less their mean; and from the closed form, with
/// r = √(a² + 4e₂²): dL = ½ (1 + a/r) (de₁ + ½ de₂) + (2 e₂/r) de₂, dk = −de₂/L + e₂ dL/L². At repeated stretches
/// (k = 0 or 1 exactly) k has a kink, and the result is one of its one-sided derivatives.
pub fn state_gradient(deformation_gradient: &Tensor) -> Option<StateGradient> {
    let frame = principal_frame(deformation_gradient)?;
    let is_admissible = determinant(deformation_gradient) > 0.0 && frame.stretches[2] > 0.0;
    if !is_admissible {
        return None;
    }
    let logarithms = frame.stretches.map(f64::ln);
    let mean = (logarithms[0] + logarithms[1] + logarithms[2]) / 3.0;
    let (e1, e2) = (logarithms[0] - mean, logarithms[1] - mean);
    let a = e1 + 0.5 * e2;
    let r = a.hypot(2.0 * e2);
    let log_amplitude = 0.5 * (a + r);
    if log_amplitude <= MODE_TOLERANCE {
        return None;
    }
    let by_a = 0.5 * (1.0 + a / r);
    let by_e = [by_a, 0.5 * by_a + 2.0 * e2 / r, 0.0];
    let amplitude = by_e.map(|d| log_amplitude.exp() * d);
    let mode = [0, 1, 2]
        .map(|j| e2 * by_e[j] / (log_amplitude * log_amplitude) - if j == 1 { 1.0 / log_amplitude } else { 0.0 });
    let tensor = |by_e: [f64; 3]| {
        let mean = (by_e[0] + by_e[1] + by_e[2]) / 3.0;
        let mut gradient = [[0.0; 3]; 3];
        for (j, by_e) in by_e.into_iter().enumerate() {
            // nⱼ / λⱼ = (λⱼ nⱼ) / λⱼ².
            let factor = (by_e - mean) / (frame.stretches[j] * frame.stretches[j]);
            for (row, n) in gradient.iter_mut().zip(frame.stretched_directions[j]) {
                for (entry, direction) in row.iter_mut().zip(frame.reference_directions[j]) {
                    *entry += factor * n * direction;
                }
            }
        }
        gradient
    };
    Some(StateGradient { stretch_amplitude: tensor(amplitude), deformation_mode: tensor(mode) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::{IDENTITY, decompose};

    #[test]
    fn differences() {
        let states = [
            [[1.2, 0.4, 0.0], [0.1, 0.9, -0.2], [0.0, 0.3, 1.1]],
            [[1.0, 0.8, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            [[1.6, 0.0, 0.1], [0.0, 0.85, 0.0], [0.0, 0.05, 0.75]],
            [[1.02, 0.01, 0.0], [0.0, 0.99, 0.015], [0.0, 0.0, 1.0]],
        ];
        let h = 1e-6;
        for f in states {
            let gradient = state_gradient(&f).unwrap();
            for i in 0..3 {
                for j in 0..3 {
                    let at = |step: f64| {
                        let mut moved = f;
                        moved[i][j] += step;
                        let d = decompose(&moved);
                        (d.stretch_amplitude, d.deformation_mode.unwrap())
                    };
                    let (p, m) = (at(h), at(-h));
                    // Rounding 10⁻¹⁵ / h, for k divided by ln λ ≥ 0.02; truncation h² / ln³ λ.
                    assert!(((p.0 - m.0) / (2.0 * h) - gradient.stretch_amplitude[i][j]).abs() < 1e-8);
                    assert!(((p.1 - m.1) / (2.0 * h) - gradient.deformation_mode[i][j]).abs() < 1e-6);
                }
            }
        }
    }

    #[test]
    fn missing_states_have_no_gradient() {
        assert_eq!(state_gradient(&IDENTITY), None);
        assert_eq!(state_gradient(&[[0.0; 3]; 3]), None);
        assert_eq!(state_gradient(&[[f64::NAN; 3]; 3]), None);
    }
}
