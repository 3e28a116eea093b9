//! A corrected law as curves: stress over stretch of homogeneous tests, with the correction and without.

use super::cause_fit::CauseFit;
use crate::fem::LawCorrection;
use crate::homogeneous::{HomogeneousTest, incompressible_stress};
use crate::material::ShearTerm;

/// Points per curve.
const NUM_POINTS: usize = 40;
/// The tests shown.
const TESTS: [HomogeneousTest; 3] =
    [HomogeneousTest::Uniaxial, HomogeneousTest::PureShear, HomogeneousTest::Equibiaxial];

/// A homogeneous test of the corrected material, incompressible.
#[derive(Clone, Debug)]
pub struct LawCurve {
    /// The test.
    pub test: HomogeneousTest,
    /// Stretch, nominal stress of the Ogden terms alone, and with the correction (kPa).
    pub points: Vec<[f64; 3]>,
}

/// The curves of a fit's material, up to the stretch of pure shear at which the correction's reach ends; empty where
/// the fit has no correction of the law.
pub fn law_curves(fitted: &CauseFit) -> Vec<LawCurve> {
    let Some(law) = fitted.scene().law else { return Vec::new() };
    let terms: Vec<ShearTerm> = fitted.material.terms.iter().map(|t| ShearTerm::from(*t)).collect();
    // In pure shear both invariants exceed 3 by (λ − 1/λ)².
    let root = law.reach.sqrt();
    let largest = 0.5 * (root + (root * root + 4.0).sqrt());
    let curve = |test: HomogeneousTest| {
        let point = |n: usize| {
            let stretch = 1.0 + (largest - 1.0) * n as f64 / (NUM_POINTS - 1) as f64;
            let ogden = incompressible_stress(&terms, &test.at(stretch));
            [stretch, ogden, ogden + correction_kpa(&law, test, stretch)]
        };
        LawCurve { test, points: (0..NUM_POINTS).map(point).collect() }
    };
    TESTS.into_iter().map(curve).collect()
}

/// Nominal stress (kPa) of the correction alone: ψ₁ dI₁/dλ + ψ₂ dI₂/dλ for each direction that is pulled.
fn correction_kpa(law: &LawCorrection, test: HomogeneousTest, stretch: f64) -> f64 {
    let l = stretch;
    let (invariants, slopes) = match test {
        HomogeneousTest::Uniaxial => {
            ([l * l + 2.0 / l, 2.0 * l + l.powi(-2)], [2.0 * l - 2.0 * l.powi(-2), 2.0 - 2.0 * l.powi(-3)])
        }
        HomogeneousTest::Equibiaxial => (
            [2.0 * l * l + l.powi(-4), l.powi(4) + 2.0 * l.powi(-2)],
            // Two directions are pulled.
            [2.0 * l - 2.0 * l.powi(-5), 2.0 * l.powi(3) - 2.0 * l.powi(-3)],
        ),
        HomogeneousTest::PureShear => ([l * l + 1.0 + l.powi(-2); 2], [2.0 * l - 2.0 * l.powi(-3); 2]),
        HomogeneousTest::SimpleShear => ([3.0 + l * l; 2], [2.0 * l; 2]),
    };
    let [first, second] = law.slopes_kpa(invariants);
    first * slopes[0] + second * slopes[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The stress is the slope of the energy along the test, for each direction that is pulled.
    #[test]
    fn stresses_are_slopes_of_the_energy() {
        let law = LawCorrection { reach: 0.8, coefficients_kpa: [4.0, -3.0, 2.5, 1.5] };
        let energy = |test: HomogeneousTest, drive: f64| {
            let squares = test.at(drive).log_stretches().map(|e| (2.0 * e).exp());
            let first: f64 = squares.iter().sum();
            law.energy_density([first, squares.iter().map(|s| 1.0 / s).sum()])
        };
        for (test, directions) in [
            (HomogeneousTest::Uniaxial, 1.0),
            (HomogeneousTest::PureShear, 1.0),
            (HomogeneousTest::Equibiaxial, 2.0),
            (HomogeneousTest::SimpleShear, 1.0),
        ] {
            let (at, step) = (1.4, 1e-5);
            let slope = (energy(test, at + step) - energy(test, at - step)) / (2.0 * step * directions);
            let found = correction_kpa(&law, test, at);
            // A central difference over 10⁻⁵ errs by 10⁻¹⁰ of the third derivative, rounding by as much.
            assert!((slope - found).abs() < 1e-8, "{test:?}: {slope} {found}");
        }
    }
}
