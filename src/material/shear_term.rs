//! Ogden terms written with the product c = μα in place of μ.
//!
//! Stresses and stiffnesses hold μ only as μα times functions of α that are smooth through α = 0, where μ itself grows
//! without limit. The products also add up to twice the initial shear modulus (see
//! [`super::initial_shear_modulus_kpa`]).

use super::{Material, OgdenTerm};

/// One Ogden term as curves see it: c = μα and α.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShearTerm {
    /// c = μα, kPa.
    pub modulus_kpa: f64,
    /// α.
    pub alpha: f64,
}

impl ShearTerm {
    /// μ = c/α, kPa; infinite at α = 0.
    pub fn mu_kpa(&self) -> f64 {
        self.modulus_kpa / self.alpha
    }
}

impl From<OgdenTerm> for ShearTerm {
    fn from(term: OgdenTerm) -> ShearTerm {
        ShearTerm { modulus_kpa: term.mu_kpa * term.alpha, alpha: term.alpha }
    }
}

impl Material {
    /// The terms with their products μα, in the order of [`Material::terms`].
    pub fn shear_terms(&self) -> Vec<ShearTerm> {
        self.terms.iter().map(|&t| t.into()).collect()
    }
}

/// D(α; a, b) = (e^{αa} − e^{αb})/α and ∂D/∂α, without loss of digits at small α.
pub fn power_difference(alpha: f64, a: f64, b: f64) -> (f64, f64) {
    let (middle, half) = (0.5 * (a + b), 0.5 * (a - b));
    let z = alpha * half;
    // sinh z / z and its derivative; the series' next term at |z| = 0.03 is below 1e-15.
    let (sinhc, derivative) = if z.abs() < 0.03 {
        let s = z * z;
        (1.0 + s / 6.0 * (1.0 + s / 20.0 * (1.0 + s / 42.0)), z / 3.0 * (1.0 + s / 10.0 * (1.0 + s / 28.0)))
    } else {
        let sinhc = z.sinh() / z;
        (sinhc, (z.cosh() - sinhc) / z)
    };
    let scale = 2.0 * half * (alpha * middle).exp();
    (scale * sinhc, scale * (middle * sinhc + half * derivative))
}
