//! The compressible Ogden material of `ogden/1` in homogeneous states: the free stretches solved by Newton's method,
//! the nominal stress and its derivatives with respect to κ, μᵢ, αᵢ.
//!
//! With e = ln λ and ē = e − ⅓ Σ e the Kirchhoff stresses are τⱼ = Σᵢ μᵢ (e^{αᵢēⱼ} − ⅓ Σₘ e^{αᵢēₘ}) + κ Σ e; a free
//! face means τ₃ = 0. By the implicit function theorem dP₁/dξ = (∂τ₁/∂ξ − (∂τ₁/∂x)(∂τ₃/∂x)⁻¹ ∂τ₃/∂ξ)/λ₁, x the free log
//! stretch.

use super::deformation::Deformation;
use crate::material::{Lanes, Material, Parameter};

/// Newton stops when the free face's traction is below this part of the shear stiffness.
const TOLERANCE: f64 = 1e-13;
/// Most Newton iterations; from the incompressible state four to eight are enough.
const MAX_ITERATIONS: usize = 60;
/// Largest change of the free log stretch in one iteration.
const LARGEST_STEP: f64 = 0.3;

/// Why a state has no response.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HomogeneousError {
    /// A stretch is not a positive number.
    #[error("{deformation:?} is not a deformation; stretches must be positive and finite")]
    InvalidDeformation {
        /// What was asked for.
        deformation: Deformation,
    },
    /// The free stretch was not found.
    #[error(
        "no free stretch balances {deformation:?} after {iterations} iterations (traction {traction_kpa:.3e} kPa left); the \
         material is unstable there, change its terms or the range"
    )]
    NoBalance {
        /// The state.
        deformation: Deformation,
        /// Iterations made.
        iterations: usize,
        /// Traction left on the free face, kPa.
        traction_kpa: f64,
    },
}

/// The response in one state.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Principal stretches along x, y, z (for simple shear: in the plane, then out of it last; J = 1).
    pub principal_stretches: [f64; 3],
    /// Nominal stresses, kPa: P_xx and P_yy (for simple shear P_xy, 0).
    pub nominal_stress_kpa: [f64; 2],
    /// Derivatives of these in the order of [`Material::parameters`].
    pub derivatives: Vec<[f64; 2]>,
}

/// Kirchhoff principal stresses, their derivatives ∂τⱼ/∂eₖ.
fn kirchhoff(material: &Material, e: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let volume: f64 = e.iter().sum();
    let mut stress = [material.bulk_kpa * volume; 3];
    let mut tangent = [[material.bulk_kpa; 3]; 3];
    for term in material.all_terms() {
        let power = e.map(|v| (term.alpha * (v - volume / 3.0)).exp());
        let mean = power.iter().sum::<f64>() / 3.0;
        for j in 0..3 {
            stress[j] += term.mu_kpa * (power[j] - mean);
            for k in 0..3 {
                let own = if j == k { power[j] } else { 0.0 };
                tangent[j][k] += term.mu_kpa * term.alpha * (own - (power[j] + power[k] - mean) / 3.0);
            }
        }
    }
    if let Some(law) = &material.law {
        let squared = e.map(|v| (2.0 * (v - volume / 3.0)).exp());
        let mean = squared.iter().sum::<f64>() / 3.0;
        let [slope, second] = law.slopes_at(3.0 * mean - 3.0);
        for j in 0..3 {
            stress[j] += 2.0 * slope * (squared[j] - mean);
            for k in 0..3 {
                let own = if j == k { squared[j] } else { 0.0 };
                tangent[j][k] += 4.0 * slope * (own - (squared[j] + squared[k] - mean) / 3.0)
                    + 4.0 * second * (squared[j] - mean) * (squared[k] - mean);
            }
        }
    }
    (stress, tangent)
}

/// ∂τⱼ/∂ξ at fixed stretches, kPa per unit.
fn parameter_derivative(material: &Material, parameter: Parameter, e: [f64; 3]) -> [f64; 3] {
    let volume: f64 = e.iter().sum();
    let bar = e.map(|v| v - volume / 3.0);
    let deviator = |v: [f64; 3]| {
        let mean = v.iter().sum::<f64>() / 3.0;
        v.map(|x| x - mean)
    };
    match parameter {
        Parameter::Kappa => [volume; 3],
        Parameter::Mu(i) => deviator(bar.map(|v| (material.terms[i].alpha * v).exp())),
        Parameter::Alpha(i) => {
            let t = material.terms[i];
            deviator(bar.map(|v| t.mu_kpa * v * (t.alpha * v).exp()))
        }
        Parameter::Law(own) => {
            let squared = bar.map(|v| (2.0 * v).exp());
            let x = squared.iter().sum::<f64>() - 3.0;
            let rate = material.law.map_or(0.0, |law| law.slope_derivative(own, Lanes::splat(x)).0[0]);
            let of_second = material.law.map_or(0.0, |law| law.second_mu_derivative(own));
            let (first, second) = (deviator(squared), deviator(squared.map(|s| 1.0 / s)));
            [0, 1, 2].map(|j| 2.0 * rate * first[j] + of_second * second[j])
        }
    }
}

/// The response of `material` in a homogeneous state.
///
/// # Errors
/// [`HomogeneousError`].
///
/// ```
/// use lambdak::homogeneous::{HomogeneousTest, respond};
/// use lambdak::material::Material;
/// let material = Material::new(2173.0, [(17.0, 1.91)]).unwrap();
/// let response = respond(&material, &HomogeneousTest::Uniaxial.at(1.5)).unwrap();
/// assert!(response.principal_stretches.iter().product::<f64>() > 1.0);
/// ```
pub fn respond(material: &Material, deformation: &Deformation) -> Result<Response, HomogeneousError> {
    if !deformation.is_valid() {
        return Err(HomogeneousError::InvalidDeformation { deformation: *deformation });
    }
    let mut e = deformation.log_stretches();
    let parameters = material.parameters();
    if let Deformation::SimpleShear { .. } = deformation {
        // P_xy = (τ₁ − τ₂) / (λ + 1/λ): pressure has no part in it.
        let weight = 0.5 / e[0].cosh();
        let (stress, _) = kirchhoff(material, e);
        let derivatives = parameters
            .iter()
            .map(|p| {
                let d = parameter_derivative(material, *p, e);
                [weight * (d[0] - d[2]), 0.0]
            })
            .collect();
        return Ok(Response {
            principal_stretches: [e[0].exp(), e[2].exp(), 1.0],
            nominal_stress_kpa: [weight * (stress[0] - stress[2]), 0.0],
            derivatives,
        });
    }
    let is_uniaxial = matches!(deformation, Deformation::Uniaxial { .. });
    let free: &[usize] = if is_uniaxial { &[1, 2] } else { &[2] };
    let of_law = material.law.map_or(0.0, |law| 2.0 * law.initial_shear_modulus_kpa());
    let scale = (material.terms.iter().map(|t| (t.mu_kpa * t.alpha).abs()).sum::<f64>() + of_law).max(1e-300);
    let mut iteration = 0;
    let (stress, tangent, slope) = loop {
        let (stress, tangent) = kirchhoff(material, e);
        let slope: f64 = free.iter().map(|&k| tangent[2][k]).sum();
        let step = -stress[2] / slope;
        let is_balanced = stress[2].abs() <= TOLERANCE * (scale + material.bulk_kpa) || step.abs() < 1e-16;
        if is_balanced && slope > 0.0 {
            break (stress, tangent, slope);
        }
        if iteration == MAX_ITERATIONS || !stress[2].is_finite() {
            return Err(HomogeneousError::NoBalance {
                deformation: *deformation,
                iterations: iteration,
                traction_kpa: stress[2],
            });
        }
        // Where the traction falls with the stretch, walk against its sign until it rises.
        let step = if slope > 0.0 { step } else { -stress[2].signum() * LARGEST_STEP };
        for &k in free {
            e[k] += step.clamp(-LARGEST_STEP, LARGEST_STEP);
        }
        iteration += 1;
    };
    let nominal = |j: usize| stress[j] * (-e[j]).exp();
    let derivatives = parameters
        .iter()
        .map(|p| {
            let d = parameter_derivative(material, *p, e);
            let change = -d[2] / slope;
            let along = |j: usize| {
                let by_free: f64 = free.iter().map(|&k| tangent[j][k]).sum();
                (d[j] + by_free * change) * (-e[j]).exp()
            };
            // Uniaxial: the faces along y are free as well.
            [along(0), if is_uniaxial { 0.0 } else { along(1) }]
        })
        .collect();
    Ok(Response {
        principal_stretches: e.map(f64::exp),
        nominal_stress_kpa: [nominal(0), if is_uniaxial { 0.0 } else { nominal(1) }],
        derivatives,
    })
}

#[cfg(test)]
mod tests {
    use super::super::deformation::{HomogeneousTest, incompressible_stress};
    use super::*;
    use crate::material::laws;
    use crate::material::{OgdenTerm, first_piola_kirchhoff_stress};

    fn material(bulk_kpa: f64) -> Material {
        let terms = vec![
            OgdenTerm { mu_kpa: 12.0, alpha: 2.5 },
            OgdenTerm { mu_kpa: -3.0, alpha: -2.0 },
            OgdenTerm { mu_kpa: 0.01, alpha: 9.0 },
        ];
        Material { bulk_kpa, terms, law: None }
    }

    /// The same bulk modulus with Ogden's terms and with every law in the first invariant.
    fn materials(bulk_kpa: f64) -> Vec<Material> {
        let of_law = |law| Material { bulk_kpa, terms: vec![], law: Some(law) };
        [material(bulk_kpa)].into_iter().chain(laws().map(of_law)).collect()
    }

    fn states() -> Vec<Deformation> {
        let mut all = Vec::new();
        for drive in [0.6, 0.98, 1.0, 1.4, 2.2] {
            for test in [HomogeneousTest::Uniaxial, HomogeneousTest::Equibiaxial, HomogeneousTest::PureShear] {
                all.push(test.at(drive));
            }
            all.push(Deformation::Biaxial { stretches: [drive, 1.3] });
            all.push(Deformation::SimpleShear { shear: drive - 1.0 });
        }
        all
    }

    /// The general first Piola–Kirchhoff stress at the found stretches: free faces free, the others equal; rounding of
    /// κ ln J (1e-13 of κ) over stretches of order one.
    #[test]
    fn agrees_with_the_tensor_form() {
        for m in [60.0, 2000.0, 1e5].into_iter().flat_map(materials) {
            let bulk = m.bulk_kpa;
            for deformation in states() {
                let r = respond(&m, &deformation).unwrap();
                let l = r.principal_stretches;
                let f = match deformation {
                    Deformation::SimpleShear { shear } => [[1.0, shear, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
                    _ => [[l[0], 0.0, 0.0], [0.0, l[1], 0.0], [0.0, 0.0, l[2]]],
                };
                let p = first_piola_kirchhoff_stress(&m, &f);
                let expected = match deformation {
                    Deformation::SimpleShear { .. } => [p[0][1], 0.0],
                    Deformation::Uniaxial { .. } => {
                        assert!(p[1][1].abs() < 1e-11 * bulk);
                        [p[0][0], 0.0]
                    }
                    Deformation::Biaxial { .. } => [p[0][0], p[1][1]],
                };
                if !matches!(deformation, Deformation::SimpleShear { .. }) {
                    assert!(p[2][2].abs() < 1e-11 * bulk, "{deformation:?} {}", p[2][2]);
                }
                for j in 0..2 {
                    assert!((r.nominal_stress_kpa[j] - expected[j]).abs() < 1e-11 * bulk, "{deformation:?}");
                }
            }
        }
    }

    /// Taylor test through the Newton solve: remainder falls with the square of the step.
    #[test]
    fn derivatives_pass_the_taylor_test() {
        for m in [60.0, 2000.0].into_iter().flat_map(materials) {
            for deformation in states() {
                let base = respond(&m, &deformation).unwrap();
                for (i, parameter) in m.parameters().into_iter().enumerate() {
                    let one_side = |h: f64| {
                        let mut moved = m.clone();
                        moved.set(parameter, m.value(parameter) * (1.0 + h));
                        let r = respond(&moved, &deformation).unwrap();
                        (0..2)
                            .map(|j| {
                                let linear = h * m.value(parameter) * base.derivatives[i][j];
                                (r.nominal_stress_kpa[j] - base.nominal_stress_kpa[j] - linear).abs()
                            })
                            .fold(0.0, f64::max)
                    };
                    // Both sides: on one of them the second and third orders may cancel.
                    let remainder = |h: f64| one_side(h) + one_side(-h);
                    let (coarse, fine) = (remainder(2e-2), remainder(2e-3));
                    // Newton's tolerance is 1e-13 of κ.
                    assert!(fine < 0.02 * coarse + 1e-11 * m.bulk_kpa, "{deformation:?} {parameter:?} {coarse} {fine}");
                }
            }
        }
    }

    /// κ → ∞: the difference to the closed form falls as 1/κ (ratio 100 for κ 100 times larger, to a tenth).
    #[test]
    fn incompressible_limit() {
        let terms = material(1.0).shear_terms();
        for deformation in states() {
            let limit = incompressible_stress(&terms, &deformation);
            let gap = |bulk| respond(&material(bulk), &deformation).unwrap().nominal_stress_kpa[0] - limit;
            let (near, far) = (gap(1e4), gap(1e6));
            assert!(far.abs() < 1e-2 * 1.1 * near.abs() + 1e-7, "{deformation:?} {near} {far}");
        }
    }

    #[test]
    fn bad_stretches_are_refused() {
        for drive in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                respond(&material(1e3), &HomogeneousTest::Uniaxial.at(drive)),
                Err(HomogeneousError::InvalidDeformation { .. })
            ));
        }
    }
}
