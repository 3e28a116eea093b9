//! Homogeneous test states and the incompressible Ogden response in them.
//!
//! In the incompressible limit every test's nominal stress has one form,
//! P = w Σᵢ cᵢ D(αᵢ; e₁, e₃) with cᵢ = μᵢαᵢ and D(α; a, b) = (e^{αa} − e^{αb})/α,
//! where e₁ is the log stretch along the test's axis, e₃ that of the direction whose traction vanishes, and w the
//! reference area's factor. Written in (c, α) it is smooth through α = 0, and ½ Σ c is the initial shear modulus.

use crate::material::{ShearTerm, power_difference};
use serde::{Deserialize, Serialize};

/// A homogeneous test: how the drive becomes a deformation and which nominal stress the load cell sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum HomogeneousTest {
    /// Stretch λ along x, free laterally. Stress P_xx.
    Uniaxial,
    /// Stretch λ along x and y, free through the thickness. Stress P_xx (= P_yy).
    Equibiaxial,
    /// Stretch λ along x, none along y, free through the thickness (planar tension). Stress P_xx.
    PureShear,
    /// u_x = γ y; drive γ. Stress P_xy. No volume change, so κ plays no part.
    SimpleShear,
}

impl HomogeneousTest {
    /// `uniaxial`, `equibiaxial`, `pure_shear`, `simple_shear`.
    pub fn name(self) -> &'static str {
        match self {
            HomogeneousTest::Uniaxial => "uniaxial",
            HomogeneousTest::Equibiaxial => "equibiaxial",
            HomogeneousTest::PureShear => "pure_shear",
            HomogeneousTest::SimpleShear => "simple_shear",
        }
    }

    /// The drive at rest: 1 for stretches, 0 for shear.
    pub fn rest(self) -> f64 {
        if self == HomogeneousTest::SimpleShear { 0.0 } else { 1.0 }
    }

    /// The deformation at a drive (stretch, or amount of shear).
    pub fn at(self, drive: f64) -> Deformation {
        match self {
            HomogeneousTest::Uniaxial => Deformation::Uniaxial { stretch: drive },
            HomogeneousTest::Equibiaxial => Deformation::Biaxial { stretches: [drive, drive] },
            HomogeneousTest::PureShear => Deformation::Biaxial { stretches: [drive, 1.0] },
            HomogeneousTest::SimpleShear => Deformation::SimpleShear { shear: drive },
        }
    }
}

/// A homogeneous deformation with its free faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Deformation {
    /// Stretch along x; y and z free.
    Uniaxial {
        /// λ along x.
        stretch: f64,
    },
    /// Stretches along x and y; z free.
    Biaxial {
        /// λ along x and y.
        stretches: [f64; 2],
    },
    /// u_x = γ y between bonded plates.
    SimpleShear {
        /// γ.
        shear: f64,
    },
}

impl Deformation {
    /// Whether the response exists: positive, finite stretches.
    pub fn is_valid(&self) -> bool {
        let good = |v: f64| v > 0.0 && v.is_finite();
        match *self {
            Deformation::Uniaxial { stretch } => good(stretch),
            Deformation::Biaxial { stretches } => good(stretches[0]) && good(stretches[1]),
            Deformation::SimpleShear { shear } => shear.is_finite(),
        }
    }

    /// `a stretch of 1.2`, `stretches of 1.2 and 1.1`, `a shear of 0.4`.
    pub(super) fn in_words(&self) -> String {
        match *self {
            Deformation::Uniaxial { stretch } => format!("a stretch of {stretch}"),
            Deformation::Biaxial { stretches: [a, b] } => format!("stretches of {a} and {b}"),
            Deformation::SimpleShear { shear } => format!("a shear of {shear}"),
        }
    }

    /// Principal log stretches of the incompressible state. For simple shear the first belongs to asinh(γ/2), whatever
    /// its sign.
    pub fn log_stretches(&self) -> [f64; 3] {
        match *self {
            Deformation::Uniaxial { stretch } => [stretch.ln(), -0.5 * stretch.ln(), -0.5 * stretch.ln()],
            Deformation::Biaxial { stretches: [a, b] } => [a.ln(), b.ln(), -(a * b).ln()],
            Deformation::SimpleShear { shear } => {
                let e = (0.5 * shear).asinh();
                [e, 0.0, -e]
            }
        }
    }

    /// (e₁, e₃, w) of the module's formula for the stress along the axis.
    fn form(&self) -> (f64, f64, f64) {
        let [e1, _, e3] = self.log_stretches();
        match *self {
            Deformation::SimpleShear { .. } => (e1, e3, 0.5 / e1.cosh()),
            _ => (e1, e3, (-e1).exp()),
        }
    }
}

/// Nominal stress (kPa) of the incompressible material along the test's axis.
pub fn incompressible_stress(terms: &[ShearTerm], deformation: &Deformation) -> f64 {
    let (e1, e3, weight) = deformation.form();
    terms.iter().map(|t| t.modulus_kpa * weight * power_difference(t.alpha, e1, e3).0).sum()
}

/// [∂P/∂c, ∂P/∂α] of one term (kPa per kPa, kPa).
pub fn incompressible_derivative(term: &ShearTerm, deformation: &Deformation) -> [f64; 2] {
    let (e1, e3, weight) = deformation.form();
    let (value, slope) = power_difference(term.alpha, e1, e3);
    [weight * value, term.modulus_kpa * weight * slope]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::initial_shear_modulus_kpa;

    fn terms() -> Vec<ShearTerm> {
        vec![ShearTerm { modulus_kpa: 30.0, alpha: 1.9 }, ShearTerm { modulus_kpa: 4.0, alpha: -3.0 }]
    }

    fn sample() -> Vec<Deformation> {
        let mut all = Vec::new();
        for drive in [0.6, 0.999, 1.2, 2.5] {
            for test in [HomogeneousTest::Uniaxial, HomogeneousTest::Equibiaxial, HomogeneousTest::PureShear] {
                all.push(test.at(drive));
            }
            all.push(Deformation::Biaxial { stretches: [drive, 1.3] });
            all.push(Deformation::SimpleShear { shear: drive - 1.0 });
        }
        all
    }

    /// Textbook formulas, Σ μ (λ^{α−1} − λ^{bα−1}); simple shear of a neo-Hookean is μγ exactly. Rounding only.
    #[test]
    fn closed_forms() {
        let l: f64 = 1.7;
        for (test, b) in [
            (HomogeneousTest::Uniaxial, -0.5),
            (HomogeneousTest::Equibiaxial, -2.0),
            (HomogeneousTest::PureShear, -1.0),
        ] {
            let expected: f64 =
                terms().iter().map(|t| t.mu_kpa() * (l.powf(t.alpha - 1.0) - l.powf(b * t.alpha - 1.0))).sum();
            assert!((incompressible_stress(&terms(), &test.at(l)) - expected).abs() < 1e-12 * expected);
        }
        let neo_hookean = [ShearTerm { modulus_kpa: 20.0, alpha: 2.0 }];
        for shear in [-0.8, 0.1, 2.0] {
            let found = incompressible_stress(&neo_hookean, &Deformation::SimpleShear { shear });
            assert!((found - 10.0 * shear).abs() < 1e-12);
        }
    }

    /// Small strains: E = 3G uniaxial, 6G equibiaxial, 4G pure shear, G simple shear; second order is of relative size
    /// 1e-6.
    #[test]
    fn initial_slopes() {
        let g = initial_shear_modulus_kpa(&terms());
        for (test, factor) in [
            (HomogeneousTest::Uniaxial, 3.0),
            (HomogeneousTest::Equibiaxial, 6.0),
            (HomogeneousTest::PureShear, 4.0),
            (HomogeneousTest::SimpleShear, 1.0),
        ] {
            let slope = incompressible_stress(&terms(), &test.at(test.rest() + 1e-7)) / 1e-7;
            assert!((slope - factor * g).abs() < 1e-5 * factor * g, "{test:?} {slope}");
        }
    }

    /// Taylor: the remainder of the first-order model falls with the square of the step.
    #[test]
    fn derivatives_pass_the_taylor_test() {
        for deformation in sample() {
            for start in [ShearTerm { modulus_kpa: 5.0, alpha: 1e-9 }, terms()[0], terms()[1]] {
                let d = incompressible_derivative(&start, &deformation);
                let remainder = |h: f64| {
                    let moved = ShearTerm { modulus_kpa: start.modulus_kpa + 3.0 * h, alpha: start.alpha + h };
                    incompressible_stress(&[moved], &deformation)
                        - incompressible_stress(&[start], &deformation)
                        - h * (3.0 * d[0] + d[1])
                };
                let (coarse, fine) = (remainder(1e-2).abs(), remainder(1e-3).abs());
                // A remainder near rounding has no rate.
                let floor = 1e-12;
                assert!(fine < 0.02 * coarse + floor, "{deformation:?} {start:?}: {coarse} {fine}");
            }
        }
    }
}
