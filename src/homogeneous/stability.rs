//! Whether a material is stable in the states that a test visits: Hill's inequality dτ : d ln V > 0 (for an incompressible
//! material Drucker's condition) for all increments that keep the volume, rotations of the axes included.

use super::deformation::{Deformation, HomogeneousTest, ShearTerm, power_difference};

/// Smallest stiffness that still counts as positive, relative to the initial shear modulus.
const MARGIN: f64 = 1e-6;

/// The smallest tangent stiffness of a state relative to the initial shear modulus: over volume-preserving increments of
/// the principal log stretches, Σ hⱼ (d eⱼ)² with hⱼ = Σᵢ cᵢ λⱼ^αᵢ and Σ d e = 0, and over turns of the axes,
/// (τⱼ − τₖ)/(eⱼ − eₖ). Negative where the material is unstable.
pub fn smallest_stiffness(terms: &[ShearTerm], deformation: &Deformation) -> f64 {
    let e = deformation.log_stretches();
    let h = e.map(|v| terms.iter().map(|t| t.modulus_kpa * (t.alpha * v).exp()).sum::<f64>());
    let modulus = 0.5 * terms.iter().map(|t| t.modulus_kpa).sum::<f64>();
    // On the plane Σ de = 0 with the orthonormal basis (1,−1,0)/√2, (1,1,−2)/√6.
    let a = 0.5 * (h[0] + h[1]);
    let b = (h[0] - h[1]) / 12f64.sqrt();
    let c = (h[0] + h[1] + 4.0 * h[2]) / 6.0;
    let mut smallest = 0.5 * (a + c) - (0.25 * (a - c).powi(2) + b * b).sqrt();
    for (j, k) in [(0, 1), (1, 2), (0, 2)] {
        let apart = e[j] - e[k];
        let stiffness = if apart.abs() < 1e-9 {
            0.5 * (h[j] + h[k])
        } else {
            terms.iter().map(|t| t.modulus_kpa * power_difference(t.alpha, e[j], e[k]).0).sum::<f64>() / apart
        };
        smallest = smallest.min(stiffness);
    }
    smallest / modulus.abs().max(1e-300)
}

/// The states between rest and `state` along straight lines of its drive, ends included.
fn path_to(state: &Deformation) -> impl Iterator<Item = Deformation> + '_ {
    const STEPS: usize = 8;
    (0..=STEPS).map(move |i| {
        let part = i as f64 / STEPS as f64;
        match *state {
            Deformation::Uniaxial { stretch } => HomogeneousTest::Uniaxial.at(1.0 + part * (stretch - 1.0)),
            Deformation::Biaxial { stretches } => {
                Deformation::Biaxial { stretches: stretches.map(|s| 1.0 + part * (s - 1.0)) }
            }
            Deformation::SimpleShear { shear } => Deformation::SimpleShear { shear: part * shear },
        }
    })
}

/// Whether the material is stable on the way to all of `states`.
pub fn is_stable(terms: &[ShearTerm], states: &[Deformation]) -> bool {
    let modulus = terms.iter().map(|t| t.modulus_kpa).sum::<f64>();
    modulus > 0.0 && states.iter().flat_map(path_to).all(|s| smallest_stiffness(terms, &s) > MARGIN)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn term(modulus_kpa: f64, alpha: f64) -> ShearTerm {
        ShearTerm { modulus_kpa, alpha }
    }

    /// At rest every increment meets the same stiffness Σ c, twice the shear modulus. Rounding only.
    #[test]
    fn rest_has_the_initial_stiffness() {
        let found = smallest_stiffness(&[term(30.0, 2.0), term(-4.0, 5.0)], &HomogeneousTest::Uniaxial.at(1.0));
        assert!((found - 2.0).abs() < 1e-12);
    }

    /// Products μα > 0 are stable everywhere; a softening pair is stable near rest and not far from it, where the uniaxial
    /// Cauchy stress has a maximum over log strain.
    #[test]
    fn instability_is_found_where_the_cauchy_stress_turns() {
        let states: Vec<Deformation> = [0.3, 0.7, 1.5, 4.0].iter().map(|&l| HomogeneousTest::Uniaxial.at(l)).collect();
        assert!(is_stable(&[term(30.0, 2.0), term(4.0, -5.0)], &states));
        let soft = [term(30.0, 2.0), term(-4.0, 5.0)];
        assert!(is_stable(&soft, &[HomogeneousTest::Uniaxial.at(1.2)]));
        assert!(!is_stable(&soft, &[HomogeneousTest::Uniaxial.at(2.5)]));
        // Uniaxial increments are among all increments: h₁ + h₃/2 < 0 implies instability.
        let e = 2.5f64.ln();
        let h = |v: f64| 30.0 * (2.0 * v).exp() - 4.0 * (5.0 * v).exp();
        assert!(h(e) + 0.5 * h(-0.5 * e) < 0.0);
    }
}
