//! Whether a material stays stable while a test loads it: the stability of [`crate::material`] in the states between
//! rest and those of the data.

use super::curve_law::CurveLaw;
use super::deformation::{Deformation, HomogeneousTest};

/// Smallest stiffness that still counts as positive, relative to the initial shear modulus.
const MARGIN: f64 = 1e-6;

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
pub fn is_stable(law: &dyn CurveLaw, states: &[Deformation]) -> bool {
    let is_stable_at = |s: Deformation| law.smallest_relative_stiffness(s.log_stretches()) > MARGIN;
    law.initial_shear_modulus_kpa() > 0.0 && states.iter().flat_map(path_to).all(is_stable_at)
}

#[cfg(test)]
mod tests {
    use super::super::curve_law::OgdenTerms;
    use super::*;
    use crate::material::{ShearTerm, laws};

    fn terms<const N: usize>(all: [(f64, f64); N]) -> OgdenTerms {
        OgdenTerms::free(&all.map(|(modulus_kpa, alpha)| ShearTerm { modulus_kpa, alpha }))
    }

    /// At rest every increment meets the same stiffness Σ c, twice the shear modulus. Rounding only.
    #[test]
    fn rest_has_the_initial_stiffness() {
        let rest = HomogeneousTest::Uniaxial.at(1.0).log_stretches();
        let found = terms([(30.0, 2.0), (-4.0, 5.0)]).smallest_relative_stiffness(rest);
        assert!((found - 2.0).abs() < 1e-12);
        for law in laws() {
            assert!((CurveLaw::smallest_relative_stiffness(&law, rest) - 2.0).abs() < 1e-12, "{law:?}");
        }
    }

    /// Products μα > 0 are stable everywhere; a softening pair is stable near rest and not far from it, where the
    /// uniaxial Cauchy stress has a maximum over log strain.
    #[test]
    fn instability_is_found_where_the_cauchy_stress_turns() {
        let states: Vec<Deformation> = [0.3, 0.7, 1.5, 4.0].iter().map(|&l| HomogeneousTest::Uniaxial.at(l)).collect();
        assert!(is_stable(&terms([(30.0, 2.0), (4.0, -5.0)]), &states));
        let soft = terms([(30.0, 2.0), (-4.0, 5.0)]);
        assert!(is_stable(&soft, &[HomogeneousTest::Uniaxial.at(1.2)]));
        assert!(!is_stable(&soft, &[HomogeneousTest::Uniaxial.at(2.5)]));
        // Uniaxial increments are among all increments: h₁ + h₃/2 < 0 implies instability.
        let e = 2.5f64.ln();
        let h = |v: f64| 30.0 * (2.0 * v).exp() - 4.0 * (5.0 * v).exp();
        assert!(h(e) + 0.5 * h(-0.5 * e) < 0.0);
    }
}
