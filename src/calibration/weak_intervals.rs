//! Intervals of fits whose terms are hardly told apart.
//!
//! Where a modulus is known to a part of its own size only, the estimates of repeated scans scatter along a curved
//! valley, and intervals of the linear model hold the truth too seldom. There the interval of a parameter is that of
//! its profile likelihood: the values at which the objective, all other parameters following, is at most 1.96² above
//! its least. It is found on [`StressResponse`], which follows the valley at no cost.

use super::error::CalibrationError;
use super::interval::{TWO_SIDED_95, linear_ends};
use super::options::FitOptions;
use super::problem::CalibrationProblem;
use super::recording_fit::RecordingFit;
use super::stress_response::{LARGEST_EXPONENT, ResponsePoint, StressResponse};
use crate::material::{MAX_TERMS, Material, Parameter};

/// Of the linear model's intervals the ends are wrong by about half of the relative standard deviation, in standard
/// deviations: beyond this one it matters.
const WEAK_RELATIVE_SD: f64 = 0.1;
/// ln |μ| is not followed further than this.
const LARGEST_LOG_CHANGE: f64 = 15.0;
/// First and largest steps of ln |μ| and of α along a profile.
const FIRST_STEP: f64 = 0.5;
const LARGEST_STEP: f64 = 1.0;
/// Steps along one side of a profile.
const MAX_STEPS: usize = 80;
/// The end of an interval is met to this part of its distance.
const ROOT_TOLERANCE: f64 = 0.005;

/// Ends of the 95 % interval that the noise leaves a parameter; an open side is none.
pub(super) type Ends = [Option<f64>; 2];

/// How far the objective has risen at a place along a profile, as a part of the way to the interval's end in standard
/// deviations, and the material there; it is sought from one near it. None beyond a limit.
type Root<'a> = dyn Fn(f64, &Material) -> Option<(f64, Material)> + 'a;

/// Whether any modulus of a fit of several terms, fewer than the most, is known to a part of its size only.
pub(super) fn is_weak(fit: &RecordingFit) -> bool {
    let is_hardly_known = |p: Parameter| {
        let index = fit.information.index_of(p).ok();
        index.is_some_and(|i| !fit.held.contains(i))
            && !fit.sd(p).is_some_and(|sd| sd <= WEAK_RELATIVE_SD * fit.material.value(p).abs())
    };
    let moduli = |p: &Parameter| matches!(p, Parameter::Mu(_));
    // Without room for a further term no other stresses can be asked for.
    let has_room = (2..MAX_TERMS).contains(&fit.material.terms.len());
    has_room && fit.material.parameters().into_iter().filter(moduli).any(is_hardly_known)
}

/// What the noise leaves the parameters of a fit.
pub(super) struct NoiseEnds {
    /// Per parameter, in the fit's order; none where a parameter was held or nothing is known of it.
    pub(super) ends: Vec<Option<Ends>>,
    /// Whether those of moduli and exponents are of profiles, which hold where parameters are not identifiable, too.
    pub(super) are_of_profiles: bool,
}

impl NoiseEnds {
    fn of_linear_model(fit: &RecordingFit) -> NoiseEnds {
        let ends = fit.material.parameters().into_iter().map(|p| linear(fit, p)).collect();
        NoiseEnds { ends, are_of_profiles: false }
    }

    /// Those that were `found` by profiles; by the linear model where these have no equilibrium, because an estimate is
    /// not lost with its profiles.
    ///
    /// # Errors
    /// Any other error of the profiles.
    pub(super) fn or_linear(
        found: Result<Vec<Option<Ends>>, CalibrationError>,
        fit: &RecordingFit,
    ) -> Result<Self, CalibrationError> {
        match found {
            Ok(ends) => Ok(NoiseEnds { ends, are_of_profiles: true }),
            Err(e) if e.is_of_the_data() => Ok(NoiseEnds::of_linear_model(fit)),
            Err(e) => Err(e),
        }
    }
}

fn linear(fit: &RecordingFit, parameter: Parameter) -> Option<Ends> {
    Some(linear_ends(parameter, fit.material.value(parameter), fit.sd(parameter)?).map(Some))
}

/// What the noise leaves every parameter of `fit`: by the linear model, or by profiles where that does not hold. κ is
/// by the linear model always.
///
/// # Errors
/// [`CalibrationError`].
pub(super) fn ends_by_noise(
    problem: &CalibrationProblem,
    fit: &RecordingFit,
    options: &FitOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<NoiseEnds, CalibrationError> {
    if !is_weak(fit) {
        return Ok(NoiseEnds::of_linear_model(fit));
    }
    NoiseEnds::or_linear(ends_of_profiles(problem, fit, options, is_cancelled), fit)
}

fn ends_of_profiles(
    problem: &CalibrationProblem,
    fit: &RecordingFit,
    options: &FitOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Option<Ends>>, CalibrationError> {
    let response = StressResponse::new(problem, fit, options, is_cancelled)?;
    let least = response.least(fit.material.clone(), options)?;
    let of_parameter = |(index, parameter): (usize, Parameter)| match parameter {
        _ if fit.held.contains(index) => None,
        Parameter::Kappa => linear(fit, parameter),
        _ => Some(ResponseProfile { response: &response, fit, least: &least, options, index }.ends(parameter)),
    };
    Ok(fit.material.parameters().into_iter().enumerate().map(of_parameter).collect())
}

/// The profile of one parameter.
struct ResponseProfile<'a> {
    response: &'a StressResponse,
    fit: &'a RecordingFit,
    least: &'a ResponsePoint,
    options: &'a FitOptions,
    index: usize,
}

impl ResponseProfile<'_> {
    /// Both ends; the estimate is between them also where it is not at the optimum.
    fn ends(&self, parameter: Parameter) -> Ends {
        let estimate = self.fit.material.value(parameter);
        let [inner, outer] = [-1.0, 1.0].map(|side| self.end(parameter, side));
        let [low, high] = if self.is_log(parameter) && estimate < 0.0 { [outer, inner] } else { [inner, outer] };
        [low.map(|v| v.min(estimate)), high.map(|v| v.max(estimate))]
    }

    fn is_log(&self, parameter: Parameter) -> bool {
        matches!(parameter, Parameter::Mu(_))
    }

    /// The increase of the objective at which the interval ends.
    fn level(&self) -> f64 {
        TWO_SIDED_95 * TWO_SIDED_95 * self.fit.objective_per_variance(self.index)
    }

    /// Where the profile passes the level on one side; none where it does not before a limit.
    fn end(&self, parameter: Parameter, side: f64) -> Option<f64> {
        let at_least = &self.least.material;
        let optimum = at_least.value(parameter);
        let is_log = self.is_log(parameter);
        // Coordinates along the profile: ln |μ| over the optimum's, or α less it.
        let value = |t: f64| if is_log { optimum * t.exp() } else { optimum + t };
        let root = |t: f64, near: &Material| {
            let held = self.held_at(parameter, value(t), near)?;
            Some((((held.chi2 - self.least.chi2).max(0.0) / self.level()).sqrt(), held.material))
        };
        let sd = self.fit.sd(parameter).map(|sd| if is_log { sd / optimum.abs() } else { sd });
        let mut step = sd.map_or(FIRST_STEP, |sd| (0.5 * sd).min(FIRST_STEP));
        let (mut inner, mut inner_root, mut near) = (0.0, 0.0, at_least.clone());
        for _ in 0..MAX_STEPS {
            let outer = inner + side * step;
            if is_log && outer.abs() > LARGEST_LOG_CHANGE {
                return None;
            }
            let (outer_root, material) = root(outer, &near)?;
            if outer_root >= 1.0 {
                return self.between([(inner, inner_root), (outer, outer_root)], &near, &root).map(value);
            }
            if outer_root - inner_root < 0.2 {
                step = (1.5 * step).min(LARGEST_STEP);
            }
            (inner, inner_root, near) = (outer, outer_root, material);
        }
        None
    }

    /// Where the root is one, between two places.
    fn between(&self, [mut low, mut high]: [(f64, f64); 2], near: &Material, root: &Root) -> Option<f64> {
        let crossing = |a: (f64, f64), b: (f64, f64)| a.0 + (b.0 - a.0) * (1.0 - a.1) / (b.1 - a.1);
        for _ in 0..6 {
            let place = crossing(low, high);
            let (r, _) = root(place, near)?;
            if (r - 1.0).abs() < ROOT_TOLERANCE {
                return Some(place);
            }
            if r < 1.0 { low = (place, r) } else { high = (place, r) }
        }
        Some(crossing(low, high))
    }

    /// The least objective with the parameter at `value`; none where that is beyond the limits of a fit or of what
    /// [`StressResponse`] knows.
    fn held_at(&self, parameter: Parameter, value: f64, near: &Material) -> Option<ResponsePoint> {
        let mut start = near.clone();
        start.set(parameter, value);
        let options = FitOptions { held: self.options.held.with(self.index), ..*self.options };
        let found = self.response.least(start, &options).ok()?;
        found.material.terms.iter().all(|t| t.alpha.abs() < LARGEST_EXPONENT).then_some(found)
    }
}
