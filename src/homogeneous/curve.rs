//! A measured curve of a homogeneous test.

use super::deformation::{Deformation, HomogeneousTest};

/// Largest principal stretch ratio (or shear) that is taken for data of soft matter; beyond it a column or unit is
/// wrong.
const LARGEST_STRETCH: f64 = 50.0;

/// Nominal stresses over homogeneous states.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name in results.
    pub name: String,
    /// The states, in the order of the recording.
    pub states: Vec<Deformation>,
    /// Nominal stress along the axis of each state, kPa.
    pub nominal_stress_kpa: Vec<f64>,
    /// Standard deviation of a stress, kPa, where known. Without it the scatter is taken in proportion to the curve's
    /// root-mean-square stress, and its factor is estimated from the fit.
    pub noise_sd_kpa: Option<f64>,
    /// Which stress of a biaxial test it is; none in other tests.
    pub biaxial: Option<BiaxialStress>,
}

/// One of the stresses of a biaxial test. The states of its curve have its own stretch first: in an isotropic material
/// the stress along y of the stretches (λ₁, λ₂) is that along x of (λ₂, λ₁).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiaxialStress {
    /// The axis that it acts along, 0 or 1.
    pub axis: usize,
    /// Root mean square of all stresses of the test, kPa. Both load cells of a rig are alike: the smaller stress is as
    /// uncertain as the larger one.
    pub test_scale_kpa: f64,
}

/// Why a curve is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CurveError {
    /// No curve, or one without points.
    #[error("curve {name:?} has {count} points; {needed} are needed")]
    TooShort {
        /// The curve.
        name: String,
        /// Its points.
        count: usize,
        /// Least number.
        needed: usize,
    },
    /// Lists of different lengths.
    #[error("curve {name:?}: {found} values of {what} for {expected} points")]
    Length {
        /// The curve.
        name: String,
        /// Which list.
        what: &'static str,
        /// Its length.
        found: usize,
        /// Needed.
        expected: usize,
    },
    /// A state or stress that cannot be.
    #[error("curve {name:?}, point {index}: {what} is {value}; {requirement}")]
    Value {
        /// The curve.
        name: String,
        /// Index of the point.
        index: usize,
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What is needed.
        requirement: &'static str,
    },
    /// Stresses of the sign that no stable material has there.
    #[error(
        "curve {name:?}: at {drive} the stress is {stress_kpa} kPa, and most stresses beside it have that sign, too; tension \
         and what lengthens are positive, compression and what shortens are negative (stretches below 1): turn the sign \
         of the column that has the other one"
    )]
    Sign {
        /// The curve.
        name: String,
        /// The state, in words.
        drive: String,
        /// Its stress, kPa.
        stress_kpa: f64,
    },
}

/// Log stretch, or part of the largest one of a curve, from which on stresses have a sign: nearer to rest a force that
/// was not set to zero decides it.
const LEAST_SIGNED: [f64; 2] = [0.02, 0.1];

impl Curve {
    /// A curve of one test: drives (stretch or shear) and nominal stresses (kPa).
    ///
    /// # Errors
    /// [`CurveError`].
    pub fn new(
        name: &str,
        test: HomogeneousTest,
        drive: &[f64],
        nominal_stress_kpa: &[f64],
    ) -> Result<Curve, CurveError> {
        let states = drive.iter().map(|&d| test.at(d)).collect();
        let nominal_stress_kpa = nominal_stress_kpa.to_vec();
        let curve = Curve { name: name.into(), states, nominal_stress_kpa, noise_sd_kpa: None, biaxial: None };
        curve.validate()?;
        Ok(curve)
    }

    /// The curves of a biaxial test with stretches (λ₁, λ₂): one for each nominal stress (kPa) that was measured, along
    /// the first axis and along the second one, called `name P1` and `name P2`.
    ///
    /// # Errors
    /// [`CurveError`].
    ///
    /// ```
    /// use lambdak::homogeneous::{Curve, CurveFitOptions, fit_curves};
    /// // A neo-Hookean material of 10 kPa, stretched twice as much along x as along y.
    /// let stretches: Vec<[f64; 2]> = (1..20).map(|i| 0.02 * f64::from(i)).map(|e| [1.0 + 2.0 * e, 1.0 + e]).collect();
    /// let along = |axis: usize| -> Vec<f64> {
    ///     stretches.iter().map(|l| 10.0 * (l[axis] - 1.0 / (l[axis].powi(3) * l[1 - axis].powi(2)))).collect()
    /// };
    /// let curves = Curve::biaxial("membrane", &stretches, [Some(&along(0)), Some(&along(1))]).unwrap();
    /// let sequence = fit_curves(&curves, &CurveFitOptions { max_terms: 1, ..CurveFitOptions::default() }).unwrap();
    /// assert!((sequence.chosen().initial_shear_modulus_kpa.value - 10.0).abs() < 1e-3);
    /// ```
    pub fn biaxial(
        name: &str,
        stretches: &[[f64; 2]],
        nominal_stress_kpa: [Option<&[f64]>; 2],
    ) -> Result<Vec<Curve>, CurveError> {
        let all: Vec<f64> = nominal_stress_kpa.iter().flatten().flat_map(|stress| stress.iter().copied()).collect();
        let test_scale_kpa = root_mean_square(&all);
        let of = |(axis, stress): (usize, Option<&[f64]>)| {
            let states = stretches.iter().map(|s| Deformation::Biaxial { stretches: [s[axis], s[1 - axis]] }).collect();
            let curve = Curve {
                name: format!("{name} P{}", axis + 1),
                states,
                nominal_stress_kpa: stress?.to_vec(),
                noise_sd_kpa: None,
                biaxial: Some(BiaxialStress { axis, test_scale_kpa }),
            };
            Some(curve.validate().map(|()| curve))
        };
        let curves: Vec<Curve> = nominal_stress_kpa.into_iter().enumerate().filter_map(of).collect::<Result<_, _>>()?;
        if curves.is_empty() {
            return Err(CurveError::TooShort { name: name.into(), count: 0, needed: 2 });
        }
        Ok(curves)
    }

    /// Checks lengths and ranges.
    ///
    /// # Errors
    /// [`CurveError`].
    pub fn validate(&self) -> Result<(), CurveError> {
        let (n, name) = (self.states.len(), || self.name.clone());
        if n < 2 {
            return Err(CurveError::TooShort { name: name(), count: n, needed: 2 });
        }
        if self.nominal_stress_kpa.len() != n {
            let found = self.nominal_stress_kpa.len();
            return Err(CurveError::Length { name: name(), what: "stress", found, expected: n });
        }
        for (index, (state, &stress)) in self.states.iter().zip(&self.nominal_stress_kpa).enumerate() {
            if !stress.is_finite() {
                let requirement = "leave out points without a stress";
                return Err(CurveError::Value { name: name(), index, what: "stress", value: stress, requirement });
            }
            let (numbers, requirement) = match *state {
                Deformation::Uniaxial { stretch } => ([stretch; 2], "a stretch lies between 0.02 and 50"),
                Deformation::Biaxial { stretches } => (stretches, "a stretch lies between 0.02 and 50"),
                // λ − 1/λ = γ: the same range of stretches.
                Deformation::SimpleShear { shear } => {
                    ([(0.5 * shear).asinh().exp(); 2], "an amount of shear lies between -50 and 50")
                }
            };
            for value in numbers {
                if !(1.0 / LARGEST_STRETCH..=LARGEST_STRETCH).contains(&value) {
                    return Err(CurveError::Value { name: name(), index, what: "stretch", value, requirement });
                }
            }
        }
        self.check_signs()
    }

    /// Checks that stresses have mostly the sign that they have in every stable material: that of ln(λ₁/λ₃), λ₃ being
    /// the stretch of the free face, and in shear that of the shear (Baker and Ericksen 1954). Both sides of rest are
    /// looked at, each of its own.
    fn check_signs(&self) -> Result<(), CurveError> {
        let driven = |state: &Deformation| match *state {
            Deformation::SimpleShear { shear } => 2.0 * (0.5 * shear).asinh(),
            _ => {
                let [along, _, free] = state.log_stretches();
                along - free
            }
        };
        let all: Vec<(f64, f64)> =
            self.states.iter().map(driven).zip(self.nominal_stress_kpa.iter().copied()).collect();
        let largest = all.iter().fold(0.0f64, |a, (d, _)| a.max(d.abs()));
        for side in [1.0, -1.0] {
            let counts = |d: f64| side * d >= LEAST_SIGNED[0].max(LEAST_SIGNED[1] * largest);
            let of_side = || all.iter().enumerate().filter(|(_, (d, _))| counts(*d));
            let sum = |of: &dyn Fn(f64) -> f64| of_side().map(|(_, (d, stress))| of(d * stress)).sum::<f64>();
            // More than three quarters of the products have the wrong sign; noise alone has half of each.
            if sum(&|work| work) < -0.5 * sum(&f64::abs)
                && let Some((index, _)) = of_side().min_by(|(_, a), (_, b)| (a.0 * a.1).total_cmp(&(b.0 * b.1)))
            {
                let drive = self.states[index].in_words();
                return Err(CurveError::Sign { name: self.name.clone(), drive, stress_kpa: all[index].1 });
            }
        }
        Ok(())
    }

    /// Root mean square of the stresses, kPa; never zero.
    pub fn scale_kpa(&self) -> f64 {
        root_mean_square(&self.nominal_stress_kpa)
    }

    /// What a residual is divided by: the noise where known, else the scale, of a biaxial test that of all stresses.
    pub fn weight_kpa(&self) -> f64 {
        let scale_kpa = || self.biaxial.map_or_else(|| self.scale_kpa(), |of| of.test_scale_kpa);
        self.noise_sd_kpa.unwrap_or_else(scale_kpa)
    }
}

/// Never zero.
fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|s| s * s).sum::<f64>() / values.len().max(1) as f64).sqrt().max(1e-300)
}

/// How well a model meets a curve.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CurveMatch {
    /// The curve's name.
    pub name: String,
    /// Points compared.
    pub num_points: usize,
    /// 1 − Σ(data − model)² / Σ(data − mean)².
    pub r_squared: f64,
    /// Root mean square of data − model, kPa.
    pub rms_error_kpa: f64,
    /// The same relative to the root mean square of the data.
    pub relative_rms_error: f64,
    /// Largest |data − model|, kPa.
    pub largest_error_kpa: f64,
}

impl CurveMatch {
    /// Compares `model` (kPa) with the curve.
    pub fn of(curve: &Curve, model: &[f64]) -> CurveMatch {
        CurveMatch::of_values(&curve.name, &curve.nominal_stress_kpa, model)
    }

    /// Compares two lists of stresses (kPa).
    pub fn of_values(name: &str, data: &[f64], model: &[f64]) -> CurveMatch {
        let n = data.len().max(1) as f64;
        let mean = data.iter().sum::<f64>() / n;
        let left: f64 = data.iter().zip(model).map(|(d, m)| (d - m).powi(2)).sum();
        let spread: f64 = data.iter().map(|d| (d - mean).powi(2)).sum();
        let square: f64 = data.iter().map(|d| d * d).sum();
        CurveMatch {
            name: name.into(),
            num_points: data.len(),
            r_squared: 1.0 - left / spread.max(1e-300),
            rms_error_kpa: (left / n).sqrt(),
            relative_rms_error: (left / square.max(1e-300)).sqrt(),
            largest_error_kpa: data.iter().zip(model).map(|(d, m)| (d - m).abs()).fold(0.0, f64::max),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compression written with positive stresses is refused, in a file of its own and below tension; so is a shear
    /// against its stress. A force that is not zero at rest, noise and a tension across which shortens are not.
    #[test]
    fn stresses_of_the_wrong_sign_are_refused() {
        let check = |test: HomogeneousTest, points: &[(f64, f64)]| {
            let (drive, stress): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
            Curve::new("c", test, &drive, &stress)
        };
        let (tension, shear) = (HomogeneousTest::Uniaxial, HomogeneousTest::SimpleShear);
        let compressed = [(1.0, 0.0), (0.9, 3.0), (0.8, 7.0)];
        let Err(error) = check(tension, &compressed) else { panic!() };
        assert!(error.to_string().contains("at a stretch of 0.8 the stress is 7 kPa"), "{error}");
        for (test, points) in [
            (tension, &[(0.8, 7.0), (0.9, 3.0), (1.2, 4.0), (1.5, 9.0)][..]),
            (HomogeneousTest::PureShear, &[(1.2, -4.0), (1.5, -9.0)]),
            (shear, &[(-0.4, 3.0), (0.4, 3.0)]),
        ] {
            assert!(matches!(check(test, points), Err(CurveError::Sign { .. })), "{test:?}");
        }
        for (test, points) in [
            (tension, &[(0.999, 0.3), (1.2, 4.0), (1.5, 9.0)][..]),
            (tension, &[(1.1, -0.5), (1.12, 0.4), (1.5, 9.0)]),
            (tension, &[(0.8, -7.0), (1.2, 4.0)]),
            (shear, &[(-0.4, -3.0), (0.4, 3.0)]),
        ] {
            check(test, points).unwrap();
        }
        // Between uniaxial tension and pure shear the width shortens under tension.
        let stretches = [[1.2, 0.95], [1.5, 0.9]];
        Curve::biaxial("b", &stretches, [Some(&[4.0, 9.0]), Some(&[1.0, 2.0])]).unwrap();
        let turned = Curve::biaxial("b", &stretches, [Some(&[4.0, 9.0]), Some(&[-1.0, -2.0])]);
        assert!(matches!(turned, Err(CurveError::Sign { .. })), "{turned:?}");
    }

    /// Both stresses of a test have one weight; where one is missing, the other one's scale is the test's.
    #[test]
    fn biaxial_stresses_are_curves() {
        let stretches = [[1.2, 1.1], [1.4, 1.2]];
        let both = Curve::biaxial("b", &stretches, [Some(&[3.0, 4.0]), Some(&[0.0, 1.0])]).unwrap();
        assert_eq!(both.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["b P1", "b P2"]);
        assert_eq!(both[1].states[0], Deformation::Biaxial { stretches: [1.1, 1.2] });
        assert!((both[1].weight_kpa() - (26.0f64 / 4.0).sqrt()).abs() < 1e-15);
        let second = Curve::biaxial("b", &stretches, [None, Some(&[0.5, 1.0])]).unwrap();
        assert_eq!((second.len(), second[0].biaxial.unwrap().axis), (1, 1));
        assert_eq!(second[0].weight_kpa(), second[0].scale_kpa());
        assert!(matches!(Curve::biaxial("b", &stretches, [None, None]), Err(CurveError::TooShort { count: 0, .. })));
        let short = Curve::biaxial("b", &stretches, [Some(&[3.0]), None]);
        assert!(matches!(short, Err(CurveError::Length { found: 1, .. })), "{short:?}");
    }
}
