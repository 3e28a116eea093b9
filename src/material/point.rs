//! The material at one point: energy, stress, tangent and parameter derivatives with the exact volumetric term κ/2 (ln
//! J)².

use super::{Lanes, Material, Parameter, SpectralState, Tensor};

/// det F.
fn determinant(f: &[[f64; 3]; 3]) -> f64 {
    f[0][0] * (f[1][1] * f[2][2] - f[1][2] * f[2][1]) - f[0][1] * (f[1][0] * f[2][2] - f[1][2] * f[2][0])
        + f[0][2] * (f[1][0] * f[2][1] - f[1][1] * f[2][0])
}

fn splat(f: &[[f64; 3]; 3]) -> Tensor {
    f.map(|row| row.map(Lanes::splat))
}

fn first(t: &Tensor) -> [[f64; 3]; 3] {
    t.map(|row| row.map(|x| x.0[0]))
}

/// Ψ (kPa) for given principal stretches (any order).
pub fn energy_density(material: &Material, principal_stretches: [f64; 3]) -> f64 {
    let ln_j: f64 = principal_stretches.iter().map(|l| l.ln()).sum();
    let mut energy = 0.5 * material.bulk_kpa * ln_j * ln_j;
    for term in material.all_terms() {
        for l in principal_stretches {
            // expm1 keeps the digits of small strains.
            energy += term.mu_kpa / term.alpha * (term.alpha * (l.ln() - ln_j / 3.0)).exp_m1();
        }
    }
    if let Some(law) = &material.law {
        energy += law.energy_density(first_invariant_less_3(principal_stretches.map(|l| l.ln() - ln_j / 3.0)));
    }
    energy
}

/// Ī₁ − 3 of traceless logarithmic principal stretches.
pub(crate) fn first_invariant_less_3(log_stretches: [f64; 3]) -> f64 {
    // expm1 keeps the digits of small strains.
    log_stretches.iter().map(|e| (2.0 * e).exp_m1()).sum()
}

/// P = ∂Ψ/∂F (kPa), row current, column reference; det F must be positive.
pub fn first_piola_kirchhoff_stress(material: &Material, deformation_gradient: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let pressure = material.bulk_kpa * determinant(deformation_gradient).ln();
    first(
        &SpectralState::new(material, &splat(deformation_gradient))
            .first_piola_kirchhoff_stress(Lanes::splat(pressure)),
    )
}

/// ∂P/∂F (kPa), `[3 i + J][3 k + L]`.
pub fn material_tangent(material: &Material, deformation_gradient: &[[f64; 3]; 3]) -> [[f64; 9]; 9] {
    let f = deformation_gradient;
    let pressure = Lanes::splat(material.bulk_kpa * determinant(f).ln());
    let rate = Lanes::splat(material.bulk_kpa);
    let mut lanes = [[Lanes::ZERO; 9]; 9];
    SpectralState::new(material, &splat(f)).material_tangent::<false>(material, pressure, rate, &mut lanes);
    lanes.map(|row| row.map(|x| x.0[0]))
}

/// ∂P/∂ξ at fixed F (kPa per unit of ξ).
pub fn stress_parameter_derivative(
    material: &Material,
    parameter: Parameter,
    deformation_gradient: &[[f64; 3]; 3],
) -> [[f64; 3]; 3] {
    if parameter == Parameter::Kappa {
        // P is affine in κ: P(κ = 1) − P(κ = 0) = ln J F⁻ᵀ.
        let state = SpectralState::new(material, &splat(deformation_gradient));
        let with = first(&state.first_piola_kirchhoff_stress(Lanes::splat(determinant(deformation_gradient).ln())));
        let without = first(&state.first_piola_kirchhoff_stress(Lanes::ZERO));
        let mut out = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                out[i][j] = with[i][j] - without[i][j];
            }
        }
        return out;
    }
    first(&SpectralState::new(material, &splat(deformation_gradient)).stress_parameter_derivative(material, parameter))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::OgdenTerm;
    use crate::material::laws;
    use nalgebra::Matrix3;

    fn materials() -> Vec<Material> {
        let make = |bulk_kpa, terms: &[(f64, f64)]| Material {
            bulk_kpa,
            terms: terms.iter().map(|&(mu_kpa, alpha)| OgdenTerm { mu_kpa, alpha }).collect(),
            law: None,
        };
        let ogden = vec![
            make(2173.0, &[(17.0, 1.91)]),
            make(2200.0, &[(16.0, 1.9), (0.35, 8.0)]),
            make(90.0, &[(12.0, 2.5), (-3.0, -2.0), (0.001, 14.0)]),
        ];
        // Every law in the first invariant goes through the same tests.
        ogden
            .into_iter()
            .chain(laws().map(|law| Material { bulk_kpa: 2100.0, terms: vec![], law: Some(law) }))
            .collect()
    }

    /// At rest, uniaxial with equal stretches, nearly equal, sheared, general.
    fn gradients() -> Vec<[[f64; 3]; 3]> {
        vec![
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            [[1.7, 0.0, 0.0], [0.0, 0.77, 0.0], [0.0, 0.0, 0.77]],
            [[1.2, 0.0, 0.0], [0.0, 1.2 + 1e-7, 0.0], [0.0, 0.0, 0.7]],
            [[1.0, 0.8, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            [[1.1, 0.3, -0.2], [-0.15, 0.9, 0.25], [0.05, -0.4, 1.2]],
            [[1.0003, 1e-4, 0.0], [0.0, 0.9998, 3e-4], [2e-4, 0.0, 1.0001]],
        ]
    }

    fn energy(m: &Material, f: &[[f64; 3]; 3]) -> f64 {
        let f = Matrix3::from_fn(|i, j| f[i][j]);
        let s = f.svd(false, false).singular_values;
        energy_density(m, [s[0], s[1], s[2]])
    }

    /// Central differences with step 1e-5: truncation 1e-10 × third derivatives (≤ 1e3 of the scale), rounding
    /// 1e-11/1e-5.
    #[test]
    fn stress_is_the_derivative_of_the_energy() {
        for m in materials() {
            for f in gradients() {
                let p = first_piola_kirchhoff_stress(&m, &f);
                for i in 0..3 {
                    for j in 0..3 {
                        let h = 1e-5;
                        let (mut a, mut b) = (f, f);
                        a[i][j] += h;
                        b[i][j] -= h;
                        let difference = (energy(&m, &a) - energy(&m, &b)) / (2.0 * h);
                        assert!(
                            (difference - p[i][j]).abs() < 2e-5 * (1.0 + p[i][j].abs()),
                            "{m:?} {f:?} {difference} {p:?}"
                        );
                    }
                }
            }
        }
    }

    /// As above, on the stress, whose own rounding is 1e-13 of κ.
    #[test]
    fn tangent_is_the_derivative_of_the_stress_and_symmetric() {
        for m in materials() {
            for f in gradients() {
                let t = material_tangent(&m, &f);
                for k in 0..3 {
                    for l in 0..3 {
                        let h = 1e-5;
                        let (mut a, mut b) = (f, f);
                        a[k][l] += h;
                        b[k][l] -= h;
                        let (pa, pb) = (first_piola_kirchhoff_stress(&m, &a), first_piola_kirchhoff_stress(&m, &b));
                        for i in 0..3 {
                            for j in 0..3 {
                                let difference = (pa[i][j] - pb[i][j]) / (2.0 * h);
                                let value = t[3 * i + j][3 * k + l];
                                assert!(
                                    (difference - value).abs() < 1e-8 * m.bulk_kpa.max(2000.0),
                                    "{m:?} {f:?}: {difference} {value}"
                                );
                                assert!((value - t[3 * k + l][3 * i + j]).abs() < 1e-10 * m.bulk_kpa);
                            }
                        }
                    }
                }
            }
        }
    }

    /// P is smooth in the parameters; relative step 1e-5, so 1e-10 of truncation.
    #[test]
    fn parameter_derivatives_match_differences() {
        for m in materials() {
            for f in gradients() {
                for parameter in m.parameters() {
                    let d = stress_parameter_derivative(&m, parameter, &f);
                    let value = m.value(parameter);
                    let h = 1e-5 * value.abs();
                    let (mut a, mut b) = (m.clone(), m.clone());
                    a.set(parameter, value + h);
                    b.set(parameter, value - h);
                    let (pa, pb) = (first_piola_kirchhoff_stress(&a, &f), first_piola_kirchhoff_stress(&b, &f));
                    let scale = 1.0 + d.iter().flatten().fold(0.0f64, |s, x| s.max(x.abs()));
                    for i in 0..3 {
                        for j in 0..3 {
                            let difference = (pa[i][j] - pb[i][j]) / (2.0 * h);
                            assert!(
                                (difference - d[i][j]).abs() < 1e-7 * scale,
                                "{parameter:?} {difference} {}",
                                d[i][j]
                            );
                        }
                    }
                }
            }
        }
    }

    /// Zero stress at rest; P(RF) = R P(F): exact up to rounding of κ ln J.
    #[test]
    fn rest_and_objectivity() {
        for m in materials() {
            let rest = first_piola_kirchhoff_stress(&m, &gradients()[0]);
            assert!(rest.iter().flatten().all(|x| x.abs() < 1e-12 * m.bulk_kpa));
            let r = nalgebra::Rotation3::from_euler_angles(0.4, -1.1, 2.0).into_inner();
            for f in gradients() {
                let fm = Matrix3::from_fn(|i, j| f[i][j]);
                let rotated = r * fm;
                let p = first_piola_kirchhoff_stress(&m, &f);
                let q = first_piola_kirchhoff_stress(&m, &[0, 1, 2].map(|i| [0, 1, 2].map(|j| rotated[(i, j)])));
                let expected = r * Matrix3::from_fn(|i, j| p[i][j]);
                for i in 0..3 {
                    for j in 0..3 {
                        assert!((q[i][j] - expected[(i, j)]).abs() < 1e-12 * m.bulk_kpa);
                    }
                }
            }
        }
    }

    /// Closed forms at det F = 1: uniaxial, equibiaxial and pure shear nominal stresses Σ μ (λ₁^(α−1) − …).
    #[test]
    fn closed_forms() {
        let m = &materials()[1];
        for (k, lateral) in [(1.0, -0.5), (0.0, -2.0), (0.5, -1.0)] {
            let l: f64 = 1.6;
            let stretches = match k {
                1.0 => [l, l.powf(-0.5), l.powf(-0.5)],
                0.0 => [l, l, l.powi(-2)],
                _ => [l, 1.0, 1.0 / l],
            };
            let f = [0, 1, 2].map(|i| [0, 1, 2].map(|j| if i == j { stretches[i] } else { 0.0 }));
            let p = first_piola_kirchhoff_stress(m, &f);
            // Eliminate the undetermined pressure with the traction-free third direction.
            let nominal = p[0][0] - p[2][2] * stretches[2] / stretches[0];
            let expected: f64 =
                m.terms.iter().map(|t| t.mu_kpa * (l.powf(t.alpha - 1.0) - l.powf(lateral * t.alpha - 1.0))).sum();
            assert!((nominal - expected).abs() < 1e-10, "{k}: {nominal} {expected}");
        }
    }
}
