//! What the objective is near an estimate, by the stresses that a material makes.
//!
//! Displacements and forces depend on the parameters through the stresses alone, and are far more nearly linear in the
//! stresses than in the parameters ([`super::stress_path`]). What the material of an estimate and one near it differ by
//! is written as a combination of stresses whose effect is known: those of every term of the estimate, their
//! derivatives by its exponent, and those of further terms over the whole range of exponents. The objective is then a
//! quadratic form in the combination. Along a valley, where the parameters change by factors and the stresses hardly,
//! it holds where the linear model has long left it. It costs a few predictions at the equilibria of the estimate and
//! none afterwards.

use super::descend::DAMPING;
use super::error::CalibrationError;
use super::options::{Bulk, FitOptions};
use super::problem::CalibrationProblem;
use super::recording_fit::RecordingFit;
use super::step::Constraints;
use super::stress_path::StressPath;
use super::system::{NormalSystem, raw_sums, scales_of};
use crate::material::{Material, OgdenTerm};
use crate::optimise::{self, LeastSquares, Rules, Shortening, Step, Stop};
use nalgebra::{DMatrix, DVector};

/// Exponents of the further terms, close enough that stresses of exponents between them are nearly combinations of
/// theirs.
const EXPONENTS: [f64; 15] = [-24.0, -16.0, -11.0, -7.5, -5.0, -3.0, -1.5, 1.0, 2.5, 4.0, 6.0, 8.5, 12.0, 17.0, 24.0];
/// Beyond the largest of them nothing is promised.
pub(super) const LARGEST_EXPONENT: f64 = 25.0;
/// Combinations that are smaller than this part of the largest one are rounding.
const SMALLEST_PART: f64 = 1e-9;
/// A step that promises less than this of χ² is not taken.
const NEGLIGIBLE: f64 = 1e-6;
/// Damped steps, which cost nothing: many.
const RULES: Rules =
    Rules { shortening: Shortening::Damped(DAMPING), tolerated_rise: 0.0, stop: Stop::after_trials(200) };

/// The objective near an estimate.
pub(super) struct StressResponse {
    path: StressPath,
    /// The normal system of the estimate, for names and number of its parameters.
    system: NormalSystem,
    bulk: Bulk,
    bulk_kpa: f64,
    /// From stresses over the visited states to their combination.
    combination: DMatrix<f64>,
    /// The combination of the estimate.
    origin: DVector<f64>,
    /// ½ ∂²χ² and −½ ∂χ² by κ (first) and the combination.
    curvature: DMatrix<f64>,
    slope: DVector<f64>,
    /// Of the estimate, without what is known of κ beforehand.
    chi2: f64,
}

/// A material and its objective.
#[derive(Clone, Debug)]
pub(super) struct ResponsePoint {
    pub(super) material: Material,
    pub(super) chi2: f64,
}

impl StressResponse {
    /// Around `fit`, a fit of two or more of Ogden's terms on `problem`.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub(super) fn new(
        problem: &CalibrationProblem,
        fit: &RecordingFit,
        options: &FitOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<StressResponse, CalibrationError> {
        let material = &fit.material;
        let num_old = material.parameters().len();
        let path = problem.stress_path(material, &fit.predictions);
        let all = problem.with_further_terms(fit, &EXPONENTS, is_cancelled)?;
        let targets = problem.targets()?;
        let plain = NormalSystem::new(&fit.predictions, &targets, Bulk::Free, options.held)?;
        let (mut curvature, mut slope) = raw_sums(&all, &targets);
        // Of the estimate's own parameters in the scale of their stresses.
        for (i, parameter) in material.parameters().into_iter().enumerate().skip(1) {
            let value = material.value(parameter);
            curvature.row_mut(i).scale_mut(value);
            curvature.column_mut(i).scale_mut(value);
            slope[i] *= value;
        }
        let (origin, own) = path.stresses(material);
        let further = EXPONENTS.map(|alpha| {
            let unit = Material { terms: vec![OgdenTerm { mu_kpa: 1.0, alpha }], ..material.clone() };
            path.stresses(&unit).0
        });
        let columns: Vec<DVector<f64>> = (1..num_old).map(|i| own.column(i).into_owned()).chain(further).collect();
        let lengths: Vec<f64> = columns.iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
        let unit = DMatrix::from_columns(&columns.iter().zip(&lengths).map(|(c, l)| c / *l).collect::<Vec<_>>());
        let mut combination = unit.pseudo_inverse(SMALLEST_PART).map_err(|_| CalibrationError::InvalidValue {
            name: "the smallest part of a combination of stresses",
            value: SMALLEST_PART,
            requirement: "positive",
        })?;
        for (mut row, length) in combination.row_iter_mut().zip(&lengths) {
            row /= *length;
        }
        Ok(StressResponse {
            origin: &combination * origin,
            chi2: plain.chi2,
            system: plain,
            bulk: options.bulk,
            bulk_kpa: material.bulk_kpa,
            path,
            combination,
            curvature,
            slope,
        })
    }

    /// Where a material stands, and the derivatives of that by its scaled parameters. The effect of κ goes as 1/κ.
    fn place(&self, material: &Material) -> (DVector<f64>, DMatrix<f64>) {
        let (stresses, slopes) = self.path.stresses(material);
        let combined = &self.combination * stresses - &self.origin;
        let mut slopes = (&self.combination * slopes).insert_row(0, 0.0);
        slopes[(0, 0)] = self.bulk_kpa * self.bulk_kpa / material.bulk_kpa;
        (combined.insert_row(0, self.bulk_kpa * (1.0 - self.bulk_kpa / material.bulk_kpa)), slopes)
    }

    /// What is known of κ beforehand: its misfit in standard deviations, and their reciprocal.
    fn prior(&self, material: &Material) -> (f64, f64) {
        match self.bulk {
            Bulk::LogPrior { center_kpa, log_sd } => ((center_kpa / material.bulk_kpa).ln() / log_sd, 1.0 / log_sd),
            Bulk::Free | Bulk::Held => (0.0, 0.0),
        }
    }

    /// The objective of a material.
    pub(super) fn at(&self, material: Material) -> ResponsePoint {
        let place = self.place(&material).0;
        let chi2 = self.chi2 - 2.0 * self.slope.dot(&place) + place.dot(&(&self.curvature * &place));
        ResponsePoint { chi2: chi2 + self.prior(&material).0.powi(2), material }
    }

    /// The least objective from `start` on, what `options` hold being held.
    ///
    /// # Errors
    /// [`CalibrationError::CloseExponents`], [`CalibrationError::Subproblem`].
    pub(super) fn least(&self, start: Material, options: &FitOptions) -> Result<ResponsePoint, CalibrationError> {
        let limits = Constraints::new(&start, options)?;
        let mut problem = ResponseFit { response: self, limits };
        let start = self.at(start);
        let system = problem.system(&start);
        Ok(optimise::descend(&mut problem, start, system, &RULES)?.at)
    }
}

/// The descent to the least objective.
struct ResponseFit<'a> {
    response: &'a StressResponse,
    limits: Constraints,
}

impl ResponseFit<'_> {
    fn system(&self, at: &ResponsePoint) -> NormalSystem {
        let response = self.response;
        let (place, slopes) = response.place(&at.material);
        let mut matrix = slopes.tr_mul(&(&response.curvature * &slopes));
        let mut gradient = slopes.tr_mul(&(&response.slope - &response.curvature * place));
        let (misfit, weight) = response.prior(&at.material);
        matrix[(0, 0)] += weight * weight;
        gradient[0] += misfit * weight;
        NormalSystem {
            values: response.system.parameters.iter().map(|p| at.material.value(*p)).collect(),
            scales: scales_of(&at.material),
            matrix,
            gradient,
            chi2: at.chi2,
            ..response.system.clone()
        }
    }
}

impl LeastSquares for ResponseFit<'_> {
    type Point = ResponsePoint;
    type Linear = NormalSystem;
    type Error = CalibrationError;

    fn objective(&self, at: &ResponsePoint) -> f64 {
        at.chi2
    }

    fn linearise(&mut self, at: &ResponsePoint) -> Result<Option<NormalSystem>, CalibrationError> {
        Ok(Some(self.system(at)))
    }

    fn step(
        &mut self,
        _: &ResponsePoint,
        linear: &NormalSystem,
        damping: f64,
    ) -> Result<Option<Step>, CalibrationError> {
        let step = self.limits.step(linear, damping, true)?;
        let promised = step.distance * step.distance;
        Ok((promised > NEGLIGIBLE).then_some(Step { change: step.change, promised }))
    }

    fn trial(
        &mut self,
        at: &ResponsePoint,
        linear: &NormalSystem,
        step: &Step,
        part: f64,
    ) -> Result<Option<ResponsePoint>, CalibrationError> {
        Ok(Some(self.response.at(linear.moved(&at.material, &(&step.change * part)))))
    }
}

#[cfg(test)]
#[path = "stress_response_tests.rs"]
mod tests;
