//! Stress and tangent of a [`LawCorrection`] at eight points at a time.
//!
//! With the derivatives ψ₁, ψ₂, ψ₁₁, … of its energy in Ī₁ and Ī₂
//!
//! * P = ψ₁ G₁ + ψ₂ G₂,
//! * ∂P/∂F = ψ₁₁ G₁⊗G₁ + ψ₁₂ (G₁⊗G₂ + G₂⊗G₁) + ψ₂₂ G₂⊗G₂ + ψ₁ ∂G₁/∂F + ψ₂ ∂G₂/∂F,
//!
//! where, with A₁ = 2F, A₂ = 2 (I₁ F − F C), p = 2/3 and 4/3 (the power of J⁻¹ in Ī_n) and H = F⁻ᵀ,
//! G_n = J⁻ᵖ (A_n − p I_n H) is ∂Ī_n/∂F.

use super::law_correction::{LawCorrection, energy_derivatives};
use crate::material::{Lanes, Tensor};

const ZERO_TENSOR: Tensor = [[Lanes::ZERO; 3]; 3];

/// The invariants of a deformation gradient and their derivatives.
struct Invariants {
    /// I₁, I₂.
    value: [Lanes; 2],
    /// J^(−2/3), J^(−4/3).
    power: [Lanes; 2],
    /// ∂I₁/∂F, ∂I₂/∂F.
    slope: [Tensor; 2],
    /// F⁻ᵀ.
    inverse_transposed: Tensor,
    /// C.
    right: Tensor,
    /// b.
    left: Tensor,
}

/// Powers p of J⁻¹ in the isochoric invariants.
const POWERS: [f64; 2] = [2.0 / 3.0, 4.0 / 3.0];

impl Invariants {
    #[inline(always)]
    fn of(f: &Tensor, jacobian: Lanes, cofactor: &Tensor) -> Invariants {
        let (mut right, mut left) = (ZERO_TENSOR, ZERO_TENSOR);
        for i in 0..3 {
            for j in 0..3 {
                for k in 0..3 {
                    right[i][j] += f[k][i] * f[k][j];
                    left[i][j] += f[i][k] * f[j][k];
                }
            }
        }
        let first = right[0][0] + right[1][1] + right[2][2];
        let mut squares = Lanes::ZERO;
        for row in &right {
            for x in row {
                squares += *x * *x;
            }
        }
        let second = (first * first - squares) * 0.5;
        let mut slope = [ZERO_TENSOR; 2];
        let mut inverse_transposed = ZERO_TENSOR;
        for i in 0..3 {
            for j in 0..3 {
                let turned = f[i][0] * right[0][j] + f[i][1] * right[1][j] + f[i][2] * right[2][j];
                slope[0][i][j] = f[i][j] * 2.0;
                slope[1][i][j] = (first * f[i][j] - turned) * 2.0;
                inverse_transposed[i][j] = cofactor[i][j] / jacobian;
            }
        }
        let log = jacobian.ln();
        let power = POWERS.map(|p| (log * -p).exp());
        Invariants { value: [first, second], power, slope, inverse_transposed, right, left }
    }

    /// Ī₁ − 3, Ī₂ − 3.
    #[inline(always)]
    fn excess(&self) -> [Lanes; 2] {
        [0, 1].map(|n| self.value[n] * self.power[n] - 3.0)
    }

    /// G_n.
    #[inline(always)]
    fn isochoric_slope(&self, n: usize) -> Tensor {
        let mut g = ZERO_TENSOR;
        for i in 0..3 {
            for j in 0..3 {
                let own = self.slope[n][i][j] - self.inverse_transposed[i][j] * self.value[n] * POWERS[n];
                g[i][j] = own * self.power[n];
            }
        }
        g
    }

    /// ∂G_n/∂F: component iJkL, given G_n.
    #[inline(always)]
    fn curvature(&self, n: usize, g: &Tensor, [i, j, k, l]: [usize; 4]) -> Lanes {
        let (f, h, p) = (&self.slope[0], &self.inverse_transposed, POWERS[n]);
        let same = i == k;
        // ∂A_n/∂F; the slope of I₁ is 2F.
        let mut of_slope = Lanes::ZERO;
        if n == 0 {
            if same && j == l {
                of_slope += Lanes::splat(2.0);
            }
        } else {
            of_slope += f[k][l] * f[i][j] - f[i][l] * f[k][j] * 0.5;
            if same {
                of_slope -= self.right[l][j] * 2.0;
                if j == l {
                    of_slope += self.value[0] * 2.0;
                }
            }
            if j == l {
                of_slope -= self.left[i][k] * 2.0;
            }
        }
        let of_inverse = h[i][l] * h[k][j] * self.value[n] - h[i][j] * self.slope[n][k][l];
        (of_slope + of_inverse * p) * self.power[n] - h[k][l] * g[i][j] * p
    }
}

/// Adds P of the correction; `cofactor` is J F⁻ᵀ.
#[inline(always)]
pub(super) fn add_law_stress(law: &LawCorrection, f: &Tensor, jacobian: Lanes, cofactor: &Tensor, stress: &mut Tensor) {
    let invariants = Invariants::of(f, jacobian, cofactor);
    let (slopes, _) = energy_derivatives(law, invariants.excess());
    for (n, slope) in slopes.into_iter().enumerate() {
        let g = invariants.isochoric_slope(n);
        for i in 0..3 {
            for j in 0..3 {
                stress[i][j] += g[i][j] * slope;
            }
        }
    }
}

/// Adds ∂P/∂F of the correction.
#[inline(always)]
pub(super) fn add_law_tangent(
    law: &LawCorrection,
    f: &Tensor,
    jacobian: Lanes,
    cofactor: &Tensor,
    tangent: &mut [[Lanes; 9]; 9],
) {
    let invariants = Invariants::of(f, jacobian, cofactor);
    let (slopes, [s11, s12, s22]) = energy_derivatives(law, invariants.excess());
    let g = [0, 1].map(|n| invariants.isochoric_slope(n));
    for i in 0..3 {
        for j in 0..3 {
            // The rows of the outer products.
            let first = g[0][i][j] * s11 + g[1][i][j] * s12;
            let second = g[0][i][j] * s12 + g[1][i][j] * s22;
            for k in 0..3 {
                for l in 0..3 {
                    let mut t = first * g[0][k][l] + second * g[1][k][l];
                    for n in 0..2 {
                        t += invariants.curvature(n, &g[n], [i, j, k, l]) * slopes[n];
                    }
                    tangent[3 * i + j][3 * k + l] += t;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: LawCorrection = LawCorrection { reach: 1.3, coefficients_kpa: [4.0, -3.0, 2.5, 1.5] };

    fn lanes(f: [[f64; 3]; 3]) -> Tensor {
        f.map(|row| row.map(Lanes::splat))
    }

    fn determinant(f: &[[f64; 3]; 3]) -> (f64, [[f64; 3]; 3]) {
        let mut cofactor = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                let (i1, i2, j1, j2) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
                cofactor[i][j] = f[i1][j1] * f[i2][j2] - f[i1][j2] * f[i2][j1];
            }
        }
        ((0..3).map(|j| f[0][j] * cofactor[0][j]).sum(), cofactor)
    }

    fn stress(law: &LawCorrection, f: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
        let (j, cofactor) = determinant(&f);
        let mut p = ZERO_TENSOR;
        add_law_stress(law, &lanes(f), Lanes::splat(j), &lanes(cofactor), &mut p);
        p.map(|row| row.map(|x| x.0[0]))
    }

    const SHEARED: [[f64; 3]; 3] = [[1.1, 0.8, 0.05], [-0.1, 0.95, 0.2], [0.03, -0.15, 0.9]];

    /// P is the slope of the energy, the tangent that of P: central differences of fourth order, whose error over
    /// 10⁻³ is 10⁻¹² of the next derivatives, which are some ten times the stress.
    #[test]
    fn stress_and_tangent_are_derivatives() {
        let energy = |f: [[f64; 3]; 3]| {
            let (j, _) = determinant(&f);
            let c = |a: usize, b: usize| (0..3).map(|k| f[k][a] * f[k][b]).sum::<f64>();
            let first = c(0, 0) + c(1, 1) + c(2, 2);
            let square: f64 = (0..9).map(|n| c(n / 3, n % 3).powi(2)).sum();
            let second = 0.5 * (first * first - square);
            LAW.energy_density([first * j.powf(-2.0 / 3.0), second * j.powf(-4.0 / 3.0)])
        };
        let step = 1e-3;
        let moved = |k: usize, l: usize, by: f64| {
            let mut f = SHEARED;
            f[k][l] += by * step;
            f
        };
        let (j, cofactor) = determinant(&SHEARED);
        let mut tangent = [[Lanes::ZERO; 9]; 9];
        add_law_tangent(&LAW, &lanes(SHEARED), Lanes::splat(j), &lanes(cofactor), &mut tangent);
        let p = stress(&LAW, SHEARED);
        for k in 0..3 {
            for l in 0..3 {
                let weights = [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)];
                let slope = weights.map(|(by, w)| w * energy(moved(k, l, by))).iter().sum::<f64>() / (12.0 * step);
                assert!((slope - p[k][l]).abs() < 1e-9, "P{k}{l}: {slope} {}", p[k][l]);
                for i in 0..3 {
                    for m in 0..3 {
                        let stresses = weights.map(|(by, w)| w * stress(&LAW, moved(k, l, by))[i][m]);
                        let slope = stresses.iter().sum::<f64>() / (12.0 * step);
                        let found = tangent[3 * i + m][3 * k + l].0[0];
                        assert!((slope - found).abs() < 1e-8, "A{i}{m}{k}{l}: {slope} {found}");
                    }
                }
            }
        }
    }

    /// In simple shear γ both invariants exceed 3 by γ²: τ = dψ/dγ = 2 γ r (c₁ t̂ + c₂ t̂²) t̂′ with t = γ², and the
    /// terms of the mode do nothing to it.
    #[test]
    fn simple_shear_is_the_closed_form() {
        let gamma: f64 = 0.7;
        let p = stress(&LAW, [[1.0, gamma, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let (t, r) = (gamma * gamma, LAW.reach);
        let part = t / (r + t);
        let [c1, c2, ..] = LAW.coefficients_kpa;
        let expected = 2.0 * gamma * r * (c1 * part + c2 * part * part) * r / (r + t).powi(2);
        // Rounding.
        assert!((p[0][1] - expected).abs() < 1e-13, "{} {expected}", p[0][1]);
    }

    /// A rotation turns the stress; at rest there is none, and a change of volume alone makes none.
    #[test]
    fn stress_is_objective_and_isochoric() {
        let (sin, cos) = 0.4f64.sin_cos();
        let turn = [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]];
        let product = |a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]| {
            let entry = |i: usize, j: usize| (0..3).map(|k| a[i][k] * b[k][j]).sum::<f64>();
            [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j)))
        };
        let (turned, p) = (stress(&LAW, product(&turn, &SHEARED)), stress(&LAW, SHEARED));
        let expected = product(&turn, &p);
        for i in 0..3 {
            for j in 0..3 {
                assert!((turned[i][j] - expected[i][j]).abs() < 1e-13);
            }
        }
        let swollen = stress(&LAW, [[1.2, 0.0, 0.0], [0.0, 1.2, 0.0], [0.0, 0.0, 1.2]]);
        assert!(swollen.iter().flatten().all(|x| x.abs() < 1e-13), "{swollen:?}");
    }
}
