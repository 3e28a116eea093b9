//! Hill's stability of Ogden materials: dτ : d ln V > 0 for every increment of the deformation, with τ the Kirchhoff
//! stress.
//!
//! With e the principal logarithmic stretches, ē = e − ⅓ Σ e, products cᵢ = μᵢαᵢ and hⱼ = Σᵢ cᵢ e^{αᵢ ēⱼ}, the
//! compressible material has τⱼ = Σᵢ μᵢ (e^{αᵢēⱼ} − ⅓ Σₘ e^{αᵢēₘ}) + κ Σ e. An increment splits into two parts that do
//! not couple:
//!
//! * **The principal stretches change.** The stress power is Σⱼ hⱼ (dēⱼ)² + κ (Σ de)²: a form in the traceless part of
//!   the increment, and a volumetric part that is positive wherever κ is. The compressible material is therefore stable
//!   where the incompressible one is (for which Σ de = 0 and the second part is absent), and one formula serves both:
//!   the smaller eigenvalue of Σⱼ hⱼ (dēⱼ)² on the plane Σ dē = 0.
//! * **The principal axes turn** in the plane of axes j and k. The stiffness is (τⱼ − τₖ)/(eⱼ − eₖ), in which κ has no
//!   part; where the two stretches are equal its limit is hⱼ.
//!
//! At rest both stiffnesses are Σ cᵢ, twice the initial shear modulus. Where every product is positive so are all hⱼ,
//! and the material is stable in every state. For one or two terms that is also demanded of a material
//! ([`has_stable_product`]); with three or more terms a product may be negative as long as the stiffness stays positive
//! over the states that a specimen visits.
//!
//! Fits to curves look at both parts ([`smallest_relative_stiffness`]), calibrations at the first alone
//! ([`least_relative_stiffness`]). The first check is the stricter one; each keeps what it has accepted so far.

use super::invariant_law::{InvariantLaw, SECOND_EXPONENT};
use super::point::first_invariant_less_3;
use super::{Lanes, Material, OgdenTerm, ShearTerm, SpectralState, initial_shear_modulus_kpa, power_difference};

/// Up to this many terms every product μα must be positive; with more the visited states decide.
const MAX_TERMS_OF_POSITIVE_PRODUCTS: usize = 2;
/// Log stretches nearer to each other than this count as equal.
const EQUAL_STRETCHES: f64 = 1e-9;
/// Parts of the way to a state at which it is checked: a specimen passes them all while it is loaded.
const PARTS_OF_THE_WAY: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

/// Whether a term may stand in a material with `num_terms` terms: with one or two terms its product μα must be
/// positive.
pub fn has_stable_product(term: &OgdenTerm, num_terms: usize) -> bool {
    num_terms > MAX_TERMS_OF_POSITIVE_PRODUCTS || term.mu_kpa * term.alpha > 0.0
}

/// hⱼ at traceless log stretches, kPa.
fn principal_stiffnesses(terms: &[ShearTerm], log_stretches: [f64; 3]) -> [f64; 3] {
    log_stretches.map(|e| terms.iter().map(|t| t.modulus_kpa * (t.alpha * e).exp()).sum::<f64>())
}

/// The smallest stiffness (kPa) of a state with traceless log stretches over increments that keep the principal axes.
pub fn smallest_principal_stiffness_kpa(terms: &[ShearTerm], log_stretches: [f64; 3]) -> f64 {
    let h = principal_stiffnesses(terms, log_stretches);
    // On the plane Σ de = 0: trace ⅔ Σh, determinant ⅓ (h₁h₂ + h₂h₃ + h₃h₁).
    let half_trace = (h[0] + h[1] + h[2]) / 3.0;
    let determinant = (h[0] * h[1] + h[1] * h[2] + h[2] * h[0]) / 3.0;
    half_trace - (half_trace * half_trace - determinant).max(0.0).sqrt()
}

/// The smallest stiffness (kPa) of a state with traceless log stretches where the principal axes turn.
fn turning_stiffness_kpa(terms: &[ShearTerm], e: [f64; 3]) -> f64 {
    let h = principal_stiffnesses(terms, e);
    let in_plane = |(j, k): (usize, usize)| {
        let apart = e[j] - e[k];
        if apart.abs() < EQUAL_STRETCHES {
            0.5 * (h[j] + h[k])
        } else {
            terms.iter().map(|t| t.modulus_kpa * power_difference(t.alpha, e[j], e[k]).0).sum::<f64>() / apart
        }
    };
    [(0, 1), (1, 2), (0, 2)].map(in_plane).into_iter().fold(f64::INFINITY, f64::min)
}

/// The smallest stiffness of a state with traceless log stretches over all increments, turns of the axes included,
/// relative to the initial shear modulus: 2 at rest, negative where the material is unstable.
pub fn smallest_relative_stiffness(terms: &[ShearTerm], log_stretches: [f64; 3]) -> f64 {
    let e = log_stretches;
    let h = principal_stiffnesses(terms, e);
    // The eigenvalue of `smallest_principal_stiffness_kpa` in the orthonormal basis (1,−1,0)/√2, (1,1,−2)/√6: the same
    // number but for its last digits, which results that are compared to the bit hold.
    let a = 0.5 * (h[0] + h[1]);
    let b = (h[0] - h[1]) / 12f64.sqrt();
    let c = (h[0] + h[1] + 4.0 * h[2]) / 6.0;
    let mut smallest = 0.5 * (a + c) - (0.25 * (a - c).powi(2) + b * b).sqrt();
    smallest = smallest.min(turning_stiffness_kpa(terms, e));
    smallest / initial_shear_modulus_kpa(terms).abs().max(1e-300)
}

/// The same as [`smallest_relative_stiffness`] of a law in the first invariant. It acts like an Ogden term of exponent
/// 2 with c = 4 W′ where the principal axes turn, and its second invariant is one. Minus infinity beyond the states
/// that the law allows.
pub fn smallest_relative_stiffness_of_law(law: &InvariantLaw, log_stretches: [f64; 3]) -> f64 {
    let keeping = smallest_stiffness_of_law_kpa(law, log_stretches);
    if !keeping.is_finite() {
        return f64::NEG_INFINITY;
    }
    let modulus_kpa = 4.0 * law.slopes_at(first_invariant_less_3(log_stretches))[0];
    let mut terms = vec![ShearTerm { modulus_kpa, alpha: 2.0 }];
    terms.extend(second_term(law));
    let turning = turning_stiffness_kpa(&terms, log_stretches);
    keeping.min(turning) / law.initial_shear_modulus_kpa()
}

/// The smallest stiffness in Hill's sense over the initial shear modulus, for given F: 2 at rest, negative where the
/// material is unstable. Increments that turn the principal axes count, too.
pub fn relative_stiffness(material: &Material, deformation_gradient: &[[f64; 3]; 3]) -> f64 {
    let lanes = deformation_gradient.map(|row| row.map(Lanes::splat));
    let log_stretches = SpectralState::new(material, &lanes).centred_logs().map(|x| x.0[0]);
    match &material.law {
        None => smallest_relative_stiffness(&material.shear_terms(), log_stretches),
        Some(law) => smallest_relative_stiffness_of_law(law, log_stretches),
    }
}

/// The smallest stiffness over states with these isochoric principal stretches and on the way to them, as a fraction of
/// its value at rest, Σμα: positive is stable. Only increments that keep the principal axes are looked at.
pub fn least_relative_stiffness(material: &Material, visited: &[[f64; 3]]) -> f64 {
    let terms = material.shear_terms();
    let at_rest = 2.0 * material.initial_shear_modulus_kpa();
    visited
        .iter()
        .flat_map(|stretches| PARTS_OF_THE_WAY.map(|part| stretches.map(|s| s.powf(part))))
        .map(|stretches| {
            let log_stretches = stretches.map(f64::ln);
            match &material.law {
                None => smallest_principal_stiffness_kpa(&terms, log_stretches) / at_rest,
                Some(law) => smallest_stiffness_of_law_kpa(law, log_stretches) / at_rest,
            }
        })
        .fold(1.0, f64::min)
}

/// The term that a law has of the second invariant.
fn second_term(law: &InvariantLaw) -> Option<ShearTerm> {
    law.second_mu_kpa().map(|mu_kpa| ShearTerm { modulus_kpa: SECOND_EXPONENT * mu_kpa, alpha: SECOND_EXPONENT })
}

/// The same as [`smallest_principal_stiffness_kpa`] of a law in the first invariant: with y = λ̄² the stress power is
/// Σⱼ 4 W′ yⱼ (dēⱼ)² + 4 W″ (Σⱼ yⱼ dēⱼ)², and Σⱼ c/yⱼ (dēⱼ)² more of a second term with c = μα. Minus infinity beyond
/// the states that the law allows.
fn smallest_stiffness_of_law_kpa(law: &InvariantLaw, log_stretches: [f64; 3]) -> f64 {
    let x = first_invariant_less_3(log_stretches);
    if x >= law.largest_x() {
        return f64::NEG_INFINITY;
    }
    let [slope, second] = law.slopes_at(x);
    let y = log_stretches.map(|e| (2.0 * e).exp());
    // In the orthonormal basis (1,−1,0)/√2, (1,1,−2)/√6 of the plane Σ dē = 0.
    let basis = [[1.0, -1.0, 0.0].map(|b| b / 2f64.sqrt()), [1.0, 1.0, -2.0].map(|b| b / 6f64.sqrt())];
    let along = basis.map(|b| (0..3).map(|j| b[j] * y[j]).sum::<f64>());
    let form = |m: usize, n: usize| {
        let weighed = |weights: [f64; 3]| (0..3).map(|j| basis[m][j] * basis[n][j] * weights[j]).sum::<f64>();
        let of_second = second_term(law).map_or(0.0, |t| t.modulus_kpa * weighed(y.map(|y| 1.0 / y)));
        4.0 * (slope * weighed(y) + second * along[m] * along[n]) + of_second
    };
    let (a, b, c) = (form(0, 0), form(0, 1), form(1, 1));
    0.5 * (a + c) - (0.25 * (a - c).powi(2) + b * b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::LawKind;

    fn ogden(terms: &[[f64; 2]]) -> Material {
        let terms = terms.iter().map(|&[mu_kpa, alpha]| OgdenTerm { mu_kpa, alpha }).collect();
        Material { bulk_kpa: 1.0, terms, law: None }
    }

    /// The closed form is the curvature of the energy along traceless logarithmic strains.
    #[test]
    fn eigenvalue_is_the_least_curvature() {
        let material = ogden(&[[9.0, 1.7], [0.4, 7.0], [-2.0, 2.5]]);
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
        let exact = smallest_principal_stiffness_kpa(&material.shear_terms(), e);
        assert!((exact - least).abs() < 1e-4 * least.abs(), "{exact} {least}");
    }

    /// Turning the axes is never stiffer than nothing: the smallest stiffness over all increments is at most that over
    /// the increments that keep the axes, in units of ½ Σ c. The trace and the basis give one eigenvalue (rounding
    /// only).
    #[test]
    fn all_increments_hold_those_that_keep_the_axes() {
        let mut is_equal_somewhere = false;
        for terms in [&[[9.0, 1.7], [0.4, 7.0]][..], &[[9.0, 1.7], [0.4, 7.0], [-2.0, 2.5]]] {
            let terms = ogden(terms).shear_terms();
            for e in [[0.0; 3], [0.4, -0.15, -0.25], [0.6, -0.3, -0.3], [0.2, 0.2, -0.4]] {
                let all = smallest_relative_stiffness(&terms, e);
                let keeping = smallest_principal_stiffness_kpa(&terms, e) / initial_shear_modulus_kpa(&terms);
                assert!(all <= keeping + 1e-12 * keeping.abs().max(1.0), "{e:?}: {all} {keeping}");
                is_equal_somewhere |= (all - keeping).abs() < 1e-12;
            }
        }
        assert!(is_equal_somewhere);
    }

    /// A law in the first invariant is as stiff as the Ogden term that it is without its stiffening, and where it
    /// stiffens as the least curvature of its energy along logarithmic strains; beyond its end there is nothing.
    #[test]
    fn laws_have_the_stiffness_of_their_energy() {
        let neo_hookean = LawKind::Yeoh.law(&[8.0, 0.0, 0.0]);
        let term = [ShearTerm { modulus_kpa: 32.0, alpha: 2.0 }];
        for e in [[0.0; 3], [0.4, -0.15, -0.25], [0.2, 0.2, -0.4]] {
            let (found, wanted) =
                (smallest_relative_stiffness_of_law(&neo_hookean, e), smallest_relative_stiffness(&term, e));
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
        }
        let gent = LawKind::Gent.law(&[16.0, 9.0]);
        let softening = LawKind::Yeoh.law(&[8.0, -2.5, 0.0]);
        let invariant = |e: [f64; 3]| e.iter().map(|v| (2.0 * v).exp()).sum::<f64>() - 3.0;
        let e = [0.4f64, -0.15, -0.25];
        // A law that stiffens resists turns of the axes the least, one that softens changes of the stretches.
        for (law, is_turning_least) in [(gent, true), (softening, false)] {
            let keeping = (0..720)
                .map(|n| {
                    let angle = f64::from(n) * std::f64::consts::PI / 720.0;
                    let (c, s) = (angle.cos() / 2f64.sqrt(), angle.sin() / 6f64.sqrt());
                    let (d, h) = ([c + s, s - c, -2.0 * s], 1e-4);
                    let at = |t: f64| law.energy_density(invariant([0, 1, 2].map(|i| e[i] + t * d[i])));
                    (at(h) - 2.0 * at(0.0) + at(-h)) / (h * h)
                })
                .fold(f64::INFINITY, f64::min);
            // τ is 2 W′ λ² but for its mean.
            let stress = e.map(|v| 2.0 * law.slopes_at(invariant(e))[0] * (2.0 * v).exp());
            let turning = (stress[1] - stress[2]) / (e[1] - e[2]);
            assert_eq!(turning < keeping, is_turning_least, "{turning} {keeping}");
            // Truncation h² and the quarter degree between directions.
            let (found, least) = (16.0 * smallest_relative_stiffness_of_law(&law, e), turning.min(keeping));
            assert!((found - least).abs() < 1e-4 * least.abs(), "{found} {least}");
        }
        assert_eq!(smallest_relative_stiffness_of_law(&gent, [1.3, -0.65, -0.65]), f64::NEG_INFINITY);
    }

    /// The volumetric part: for increments that change the volume the compressible material's stress power is that of
    /// their traceless part and κ (Σ de)², by differences of the Kirchhoff stress.
    #[test]
    fn the_volume_adds_its_own_part() {
        let material = Material { bulk_kpa: 150.0, ..ogden(&[[9.0, 1.7], [0.4, 7.0], [-2.0, 2.5]]) };
        let kirchhoff = |e: [f64; 3]| {
            let volume: f64 = e.iter().sum();
            let mut stress = [material.bulk_kpa * volume; 3];
            for t in &material.terms {
                let power = e.map(|v| (t.alpha * (v - volume / 3.0)).exp());
                let mean = power.iter().sum::<f64>() / 3.0;
                (0..3).for_each(|j| stress[j] += t.mu_kpa * (power[j] - mean));
            }
            stress
        };
        let (e, d) = ([0.5, -0.1, -0.3], [0.7, 0.2, -0.4]);
        let step = 1e-5;
        let [ahead, behind] = [step, -step].map(|t| kirchhoff([0, 1, 2].map(|i| e[i] + t * d[i])));
        let power: f64 = (0..3).map(|i| (ahead[i] - behind[i]) / (2.0 * step) * d[i]).sum();
        let [mean, rate] = [e, d].map(|v| v.iter().sum::<f64>() / 3.0);
        let h = principal_stiffnesses(&material.shear_terms(), e.map(|v| v - mean));
        let form: f64 = (0..3).map(|i| h[i] * (d[i] - rate).powi(2)).sum::<f64>() + 150.0 * (3.0 * rate).powi(2);
        // Truncation of the central difference, h².
        assert!((power - form).abs() < 1e-8 * form, "{power} {form}");
    }

    #[test]
    fn positive_products_are_stable_and_negative_ones_need_not_be() {
        let visited = [[2.0, 0.9, 1.0 / 1.8], [1.3, 1.0, 1.0 / 1.3]];
        assert!(least_relative_stiffness(&ogden(&[[9.0, 1.7], [-0.4, -7.0]]), &visited) > 0.0);
        assert!(least_relative_stiffness(&ogden(&[[9.0, 1.7], [0.4, 7.0], [-2.0, 6.0]]), &visited) < 0.0);
    }
}
