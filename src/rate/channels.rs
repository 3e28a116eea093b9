//! Incompressible homogeneous states as channels of reference stress: what the convolution of finite linear
//! viscoelasticity acts on.
//!
//! Simo's model convolves the isochoric second Piola–Kirchhoff stress, whose components live in the reference
//! configuration. A measured nominal stress is P = Σ_c w_c S_c with two channels S_c and weights w_c that depend on the
//! state alone, the undetermined pressure eliminated by the free face: along principal axes S = (S₁, S₃), w = (λ₁,
//! −λ₃²/λ₁); in simple shear S = (S_xy, S_yy), w = (1, γ), where pressure has no part. S_j = (τ_j − mean τ)/λ_j².

use crate::homogeneous::Deformation;
use crate::material::{ShearTerm, power_difference};

/// Two channels, their weights and derivatives at one state.
#[derive(Clone, Debug)]
pub(crate) struct Channels {
    pub(crate) weight: [f64; 2],
    /// Isochoric second Piola–Kirchhoff components, kPa.
    pub(crate) stress: [f64; 2],
    /// Per term: derivatives of the stresses with respect to ln|c| and α.
    pub(crate) by_term: Vec<[[f64; 2]; 2]>,
    /// Ψ, kPa.
    pub(crate) energy: f64,
    /// Per term: derivatives of Ψ with respect to ln|c| and α.
    pub(crate) energy_by_term: Vec<[f64; 2]>,
}

impl Channels {
    /// The nominal stress as the only channel (Fung's quasi-linear model).
    pub(crate) fn nominal(mut self) -> Channels {
        let [a, b] = self.weight;
        self.stress = [a * self.stress[0] + b * self.stress[1], 0.0];
        for term in &mut self.by_term {
            *term = term.map(|s| [a * s[0] + b * s[1], 0.0]);
        }
        self.weight = [1.0, 0.0];
        self
    }
}

/// Σⱼ (e^{αeⱼ} − 1)/α² for Σ e = 0, and its derivative with respect to α.
fn energy_sum(alpha: f64, e: [f64; 3]) -> (f64, f64) {
    let largest = e.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    if (alpha * largest).abs() < 1e-2 {
        // Next terms: α³e⁵/120, relative 1e-8 of the sum at most.
        return e.iter().fold((0.0, 0.0), |(v, d), &x| {
            (
                v + x * x * (0.5 + alpha * x * (1.0 / 6.0 + alpha * x * (1.0 / 24.0 + alpha * x / 120.0))),
                d + x * x * x * (1.0 / 6.0 + alpha * x * (1.0 / 12.0 + alpha * x / 40.0)),
            )
        });
    }
    let square = alpha * alpha;
    e.iter().fold((0.0, 0.0), |(v, d), &x| {
        let power = (alpha * x).exp_m1();
        (v + power / square, d + x * (power + 1.0) / square - 2.0 * power / (square * alpha))
    })
}

/// From Kirchhoff stresses to the two channels.
type Pick = Box<dyn Fn([f64; 3]) -> [f64; 2]>;

/// The channels of an incompressible state.
pub(crate) fn channels(terms: &[ShearTerm], deformation: &Deformation) -> Channels {
    let e = deformation.log_stretches();
    let inverse_square = e.map(|v| (-2.0 * v).exp());
    // Deviatoric Kirchhoff stresses per unit of c, and their derivatives with respect to α.
    let unit = |alpha: f64| {
        let mut value = [0.0; 3];
        let mut slope = [0.0; 3];
        for j in 0..3 {
            for k in 0..3 {
                if j != k {
                    let (v, s) = power_difference(alpha, e[j], e[k]);
                    value[j] += v / 3.0;
                    slope[j] += s / 3.0;
                }
            }
        }
        (value, slope)
    };
    let (weight, pick): ([f64; 2], Pick) = match *deformation {
        Deformation::SimpleShear { shear } => {
            // Material axis of the first stretch λ: (1, λ)/√(1 + λ²).
            let l = e[0].exp();
            let bottom = 1.0 + l * l;
            let [s1, _, s3] = inverse_square;
            let map = move |t: [f64; 3]| {
                let (a, b) = (t[0] * s1, t[2] * s3);
                [(a - b) * l / bottom, (a * l * l + b) / bottom]
            };
            ([1.0, shear], Box::new(map))
        }
        _ => {
            let map = move |t: [f64; 3]| [t[0] * inverse_square[0], t[2] * inverse_square[2]];
            ([e[0].exp(), -(2.0 * e[2] - e[0]).exp()], Box::new(map))
        }
    };
    let mut stress = [0.0; 2];
    let mut by_term = Vec::with_capacity(terms.len());
    let (mut energy, mut energy_by_term) = (0.0, Vec::with_capacity(terms.len()));
    for term in terms {
        let c = term.modulus_kpa;
        let (value, slope) = unit(term.alpha);
        let (own, by_alpha) = (pick(value.map(|v| c * v)), pick(slope.map(|v| c * v)));
        for k in 0..2 {
            stress[k] += own[k];
        }
        by_term.push([own, by_alpha]);
        let (sum, sum_slope) = energy_sum(term.alpha, e);
        energy += c * sum;
        energy_by_term.push([c * sum, c * sum_slope]);
    }
    Channels { weight, stress, by_term, energy, energy_by_term }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::homogeneous::{HomogeneousTest, incompressible_derivative, incompressible_stress};
    use crate::material::{Material, OgdenTerm, energy_density};

    const TESTS: [HomogeneousTest; 4] = [
        HomogeneousTest::Uniaxial,
        HomogeneousTest::Equibiaxial,
        HomogeneousTest::PureShear,
        HomogeneousTest::SimpleShear,
    ];

    /// Σ w S is the elastic nominal stress, with the same derivatives: rounding only.
    #[test]
    fn weighted_channels_are_the_nominal_stress() {
        let terms = [ShearTerm { modulus_kpa: 30.0, alpha: 1.9 }, ShearTerm { modulus_kpa: 4.0, alpha: -3.0 }];
        for test in TESTS {
            for step in [-0.4, -0.001, 0.0, 0.3, 1.5] {
                let state = test.at(test.rest() + step);
                let found = channels(&terms, &state);
                let sum = |s: [f64; 2]| found.weight[0] * s[0] + found.weight[1] * s[1];
                assert!((sum(found.stress) - incompressible_stress(&terms, &state)).abs() < 1e-11, "{state:?}");
                for (t, term) in terms.iter().enumerate() {
                    let [by_c, by_alpha] = incompressible_derivative(term, &state);
                    assert!((sum(found.by_term[t][0]) - by_c * term.modulus_kpa).abs() < 1e-11);
                    assert!((sum(found.by_term[t][1]) - by_alpha).abs() < 1e-11);
                }
            }
        }
    }

    /// The energy is that of the material room; its α derivative passes the Taylor test, through α = 0 too.
    #[test]
    fn energy() {
        for test in TESTS {
            let state = test.at(test.rest() + 0.7);
            for alpha in [2.3, -4.0, 1e-3, 0.012] {
                let term = ShearTerm { modulus_kpa: 10.0, alpha };
                let found = channels(&[term], &state);
                let material =
                    Material { bulk_kpa: 0.0, terms: vec![OgdenTerm { mu_kpa: term.mu_kpa(), alpha }], law: None };
                let exact = energy_density(&material, state.log_stretches().map(f64::exp));
                // The series' error and the cancellation of 1/α² in the general form, 1e-16/1e-6.
                assert!((found.energy - exact).abs() < 1e-7 * exact, "{test:?} {alpha} {} {exact}", found.energy);
                let remainder = |h: f64| {
                    let moved = channels(&[ShearTerm { alpha: alpha + h, ..term }], &state).energy;
                    (moved - found.energy - h * found.energy_by_term[0][1]).abs()
                };
                let (coarse, fine) = (remainder(1e-1), remainder(1e-2));
                assert!(fine < 0.02 * coarse + 1e-6, "{test:?} {alpha} {coarse} {fine}");
            }
        }
    }
}
