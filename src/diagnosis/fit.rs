//! Full, nonlinear fits of a material and causes to a recording.

use super::cause::CauseParameter;
use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::laboratory::{Laboratory, Prediction, Starts};
use super::metric::{Metric, Weighed};
use super::prior::{FitSettings, shear_modulus};
use super::supposed::{Path, Supposed, paths_of, scene_of};
use super::trace::Trace;
use crate::material::{Material, Parameter};
use crate::optimise::{Damping, End, LeastSquares, Raise, Rules, Shortening, Step, Stop, descend};
use nalgebra::{DMatrix, DVector};

/// Standard deviation of the prior of a cause's parameter around its start, in scales of the parameter. It is wide: it
/// only keeps a fit in bounds where the data say nothing.
const PRIOR_SCALES: f64 = 100.0;
/// Standard deviation of what is known of a parameter before a fit, in its scales.
pub(super) fn prior_scales(parameter: &CauseParameter) -> f64 {
    parameter.believed_sd.map_or(PRIOR_SCALES, |sd| sd / parameter.scale)
}

/// Half width of the differences from which derivatives are taken, in scales of a parameter.
pub const STEP: f64 = 0.02;
/// Largest relative change of a material parameter in one step.
const LARGEST_STEP: f64 = 0.4;
/// Largest change of a cause's parameter in one step, in scales of the parameter.
const LARGEST_CAUSE_STEP: f64 = 6.0;
/// A fit lowers the deviance by so many times what its next step promises at most: a step may be shortened, or the way
/// bend, but what promises less than a tenth of what is called for does not lead there.
const MOST_OF_PROMISED: f64 = 10.0;

/// Changes of the prediction with each scaled parameter: with ln κ, with the relative change of each other material
/// parameter, and with each parameter of the causes in its scales.
pub fn derivatives(
    laboratory: &mut Laboratory,
    material: &Material,
    causes: &[Supposed],
    prediction: &Prediction,
) -> Result<Vec<Trace>, DiagnosisError> {
    derivatives_beyond(laboratory, material, causes, prediction, &[])
}

/// As [`derivatives`], with the `known` changes for as many parameters as these are (none, or the material's and those
/// of the first causes).
fn derivatives_beyond(
    laboratory: &mut Laboratory,
    material: &Material,
    causes: &[Supposed],
    prediction: &Prediction,
    known: &[Trace],
) -> Result<Vec<Trace>, DiagnosisError> {
    let scene = scene_of(causes);
    let paths = paths_of(causes);
    let with_material = known.is_empty();
    let num_known_paths = known.len().saturating_sub(material.parameters().len());
    let paths: Vec<&Path> = paths[num_known_paths..].iter().collect();
    let mut columns = laboratory.derivatives(material, &scene, prediction, with_material, &paths, STEP)?;
    if with_material {
        for (trace, parameter) in columns.iter_mut().zip(material.parameters()) {
            *trace = trace.scaled(material.value(parameter));
        }
    }
    Ok(known.iter().cloned().chain(columns).collect())
}

/// Fits `material` and `causes` from where they are.
///
/// # Errors
/// [`DiagnosisError`]: the start has no equilibrium, or the work was cancelled.
pub fn fit(
    laboratory: &mut Laboratory,
    metric: &Metric,
    measured: &Trace,
    material: &Material,
    causes: &[Supposed],
    settings: &FitSettings,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<CauseFit, DiagnosisError> {
    let places = (0..scales(material, causes).len()).collect();
    let causes = causes.to_vec();
    fit_member(
        Member { laboratory, metric, measured, causes, settings: *settings, known: &[], places },
        material,
        is_cancelled,
    )
}

/// Fits `material` and the causes of one recording, whose parameters have their places in order.
///
/// # Errors
/// As [`fit`].
pub(super) fn fit_member(
    member: Member,
    material: &Material,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<CauseFit, DiagnosisError> {
    let mut found = fit_members(&mut [member], material, is_cancelled)?;
    // One member, one fit.
    Ok(found.swap_remove(0))
}

/// A recording in a fit of several with one material.
pub struct Member<'a, 'b> {
    /// Predicts it.
    pub laboratory: &'a mut Laboratory<'b>,
    /// The weights of its misfit.
    pub metric: &'a Metric,
    /// What was recorded.
    pub measured: &'a Trace,
    /// Its causes.
    pub causes: Vec<Supposed>,
    /// Priors. How many iterations are made, and when they end, the first member's settings say for all.
    pub settings: FitSettings,
    /// Changes of its prediction with its first parameters (all of the material and those of some causes), near
    /// enough to be taken as they are; empty where all are worked out at every step. The fit then ends where it would
    /// have ended, after a few more but far shorter steps.
    pub known: &'a [Trace],
    /// For each of its parameters (the material's, then the causes') its place among the parameters of the whole fit. A
    /// parameter that members share has the same place in each. All places together are 0, 1, … without a gap.
    pub places: Vec<usize>,
}

/// Where a fit stands: the material, and of each member its causes, what they predict and the deviance.
struct Point {
    material: Material,
    causes: Vec<Vec<Supposed>>,
    predictions: Vec<Prediction>,
    deviances: Vec<f64>,
}

impl Point {
    fn deviance(&self) -> f64 {
        self.deviances.iter().sum()
    }
}

/// Fits one material to all members. Each member has its own causes, whose parameters may be shared. Gives one result
/// per member.
///
/// # Errors
/// As [`fit`].
pub fn fit_members(
    members: &mut [Member],
    material: &Material,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<CauseFit>, DiagnosisError> {
    let Some(settings) = members.first().map(|m| m.settings) else { return Ok(Vec::new()) };
    let num = members.iter().flat_map(|m| &m.places).max().map_or(0, |last| last + 1);
    let causes: Vec<Vec<Supposed>> = members.iter().map(|m| m.causes.clone()).collect();
    let mut at = evaluate(members, material.clone(), causes, Starts::Any, is_cancelled)?;
    let columns = match columns_at(members, &at) {
        Ok(columns) => columns,
        // A state reached from another material's may be an unstable one; from rest the stable branch is followed.
        Err(_) if !is_cancelled() => {
            members.iter_mut().for_each(|m| m.laboratory.forget());
            at = evaluate(members, at.material, at.causes, Starts::Any, is_cancelled)?;
            columns_at(members, &at)?
        }
        Err(error) => return Err(error),
    };
    let linear = whole_system(members, &at, &columns, num);
    let num_data = members.iter().map(|m| m.metric.num_data() as f64).sum();
    let mut problem = MembersProblem { members, num_parameters: num, num_data, settings, is_cancelled };
    let rules = Rules {
        shortening: Shortening::Damped(Damping { small_gain: 0.2 * settings.tolerance, ..DAMPING }),
        tolerated_rise: 0.0,
        stop: Stop::after_trials(settings.max_iterations),
    };
    let found = descend(&mut problem, at, linear, &rules)?;
    // Where no direction helps any more, the iterations count as used up.
    let iterations = if found.end == End::Stuck { settings.max_iterations } else { found.num_trials };
    Ok(fitted_members(members, found.at, &found.linear.0, iterations))
}

/// The damping of these fits: none as long as steps help.
const DAMPING: Damping = Damping {
    start: 0.0,
    good_part: 0.0,
    negligible: 1e-3,
    least: 0.0,
    small_gain: 0.0,
    poor_part: 0.0,
    after_poor: Raise { factor: 10.0, at_least: 1e-2 },
    after_rejection: Raise { factor: 10.0, at_least: 1e-2 },
    largest: 1e6,
};

/// The fit of all members as [`descend`] sees it.
struct MembersProblem<'f, 'a, 'b> {
    members: &'f mut [Member<'a, 'b>],
    num_parameters: usize,
    num_data: f64,
    settings: FitSettings,
    is_cancelled: &'f (dyn Fn() -> bool + Sync),
}

impl LeastSquares for MembersProblem<'_, '_, '_> {
    type Point = Point;
    /// Half the Hessian of the deviance, and its negative half gradient.
    type Linear = (DMatrix<f64>, DVector<f64>);
    type Error = DiagnosisError;

    fn objective(&self, at: &Point) -> f64 {
        at.deviance()
    }

    /// A state without a definite tangent is on the verge of instability: no better place to be.
    fn linearise(&mut self, at: &Point) -> Result<Option<Self::Linear>, DiagnosisError> {
        let columns = columns_at(self.members, at).ok();
        Ok(columns.map(|c| whole_system(self.members, at, &c, self.num_parameters)))
    }

    fn step(
        &mut self,
        at: &Point,
        (matrix, gradient): &Self::Linear,
        damping: f64,
    ) -> Result<Option<Step>, DiagnosisError> {
        let num = self.num_parameters;
        let mut damped = matrix.clone();
        for i in 0..num {
            damped[(i, i)] += damping * matrix[(i, i)].max(1e-12);
        }
        let change = damped.cholesky().map(|c| c.solve(gradient)).unwrap_or_else(|| DVector::zeros(num));
        let promised = 2.0 * gradient.dot(&change) - change.dot(&(matrix * &change));
        let beyond_noise = (at.deviance() - self.num_data).max(0.0);
        let tolerance = self.settings.tolerance.max(self.settings.relative_tolerance * beyond_noise);
        let is_hopeless = self.settings.goal.is_some_and(|goal| at.deviance() - MOST_OF_PROMISED * promised > goal);
        Ok(if promised < tolerance || is_hopeless { None } else { Some(Step { change, promised }) })
    }

    fn trial(&mut self, at: &Point, _: &Self::Linear, step: &Step, part: f64) -> Result<Option<Point>, DiagnosisError> {
        let (material, causes) = moved(self.members, at, &(&step.change * part));
        match evaluate(self.members, material, causes, Starts::FoundLast, self.is_cancelled) {
            Ok(next) => Ok(Some(next)),
            Err(_) if !(self.is_cancelled)() => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// The deviance of a material and causes as they are.
///
/// # Errors
/// As [`fit`].
pub(super) fn deviance_at(
    laboratory: &mut Laboratory,
    metric: &Metric,
    measured: &Trace,
    material: &Material,
    causes: &[Supposed],
    settings: &FitSettings,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<f64, DiagnosisError> {
    let prediction = laboratory.predict(material, &scene_of(causes), is_cancelled)?;
    Ok(deviance_of(metric, measured, &prediction, material, causes, settings))
}

fn evaluate(
    members: &mut [Member],
    material: Material,
    causes: Vec<Vec<Supposed>>,
    starts: Starts,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Point, DiagnosisError> {
    let (mut predictions, mut deviances) = (Vec::new(), Vec::new());
    for (m, causes) in members.iter_mut().zip(&causes) {
        let prediction = m.laboratory.predict_from(&material, &scene_of(causes), starts, is_cancelled)?;
        deviances.push(deviance_of(m.metric, m.measured, &prediction, &material, causes, &m.settings));
        predictions.push(prediction);
    }
    Ok(Point { material, causes, predictions, deviances })
}

fn columns_at(members: &mut [Member], at: &Point) -> Result<Vec<Vec<Trace>>, DiagnosisError> {
    members
        .iter_mut()
        .zip(at.causes.iter().zip(&at.predictions))
        .map(|(m, (causes, prediction))| derivatives_beyond(m.laboratory, &at.material, causes, prediction, m.known))
        .collect()
}

/// The sum of the members' normal systems, each parameter at its place.
fn whole_system(members: &[Member], at: &Point, columns: &[Vec<Trace>], num: usize) -> (DMatrix<f64>, DVector<f64>) {
    let (mut matrix, mut gradient) = (DMatrix::zeros(num, num), DVector::zeros(num));
    for (n, m) in members.iter().enumerate() {
        let (own, slope) = normal_system(
            m.metric,
            m.measured,
            &at.predictions[n],
            &at.material,
            &at.causes[n],
            &m.settings,
            &columns[n],
        );
        for (i, &p) in m.places.iter().enumerate() {
            gradient[p] += slope[i];
            for (j, &q) in m.places.iter().enumerate() {
                matrix[(p, q)] += own[(i, j)];
            }
        }
    }
    (matrix, gradient)
}

fn fitted_members(members: &[Member], at: Point, matrix: &DMatrix<f64>, iterations: usize) -> Vec<CauseFit> {
    let covariance = matrix.clone().try_inverse();
    let Point { material, causes, predictions, deviances } = at;
    members
        .iter()
        .zip(causes.into_iter().zip(predictions).zip(deviances))
        .map(|(m, ((causes, prediction), deviance))| {
            let variance = |place: usize| covariance.as_ref().map_or(f64::INFINITY, |c| c[(place, place)]);
            let sd = scales(&material, &causes)
                .into_iter()
                .zip(&m.places)
                .map(|(scale, &place)| {
                    let v = variance(place);
                    if v > 0.0 { scale * v.sqrt() } else { f64::INFINITY }
                })
                .collect();
            let residual = m.measured.plus(-1.0, &prediction.trace);
            CauseFit { material: material.clone(), causes, deviance, residual, prediction, sd, iterations }
        })
        .collect()
}

/// Half the Hessian of the deviance in scaled parameters and its negative half gradient, where `columns` are the
/// changes of the prediction.
pub(super) fn normal_system(
    metric: &Metric,
    measured: &Trace,
    prediction: &Prediction,
    material: &Material,
    causes: &[Supposed],
    settings: &FitSettings,
    columns: &[Trace],
) -> (DMatrix<f64>, DVector<f64>) {
    let residual = metric.weigh(&measured.plus(-1.0, &prediction.trace));
    let weighed = metric.weigh_all(columns);
    let matrix = normal_matrix(metric, &weighed, material, causes, settings);
    let mut gradient = metric.products(&weighed, &[residual]).column(0).into_owned();
    gradient[0] += settings.bulk.log_sd.powi(-2) * (settings.bulk.center_kpa / material.bulk_kpa).ln();
    if let Some(shear) = &settings.shear {
        let (_, slope, pull) = shear.terms(material);
        for (g, s) in gradient.iter_mut().zip(slope) {
            *g += pull * s;
        }
    }
    let mut i = material.parameters().len();
    for supposed in causes {
        let (parameters, start) = (supposed.cause.parameters(), supposed.cause.start());
        for n in 0..parameters.len() {
            let away = (supposed.values[n] - start[n]) / parameters[n].scale;
            gradient[i] -= prior_scales(&parameters[n]).powi(-2) * away;
            i += 1;
        }
    }
    (matrix, gradient)
}

/// Half the Hessian of the deviance in scaled parameters (Gauss–Newton: without second derivatives of the prediction),
/// priors included.
pub fn normal_matrix(
    metric: &Metric,
    weighed: &[Weighed],
    material: &Material,
    causes: &[Supposed],
    settings: &FitSettings,
) -> DMatrix<f64> {
    let mut matrix = metric.products(weighed, weighed);
    // Symmetric but for rounding.
    matrix.fill_upper_triangle_with_lower_triangle();
    matrix[(0, 0)] += settings.bulk.log_sd.powi(-2);
    if let Some(shear) = &settings.shear {
        let (_, slope, _) = shear.terms(material);
        let weight = shear.log_sd.powi(-2);
        for a in 0..slope.len() {
            for b in 0..slope.len() {
                matrix[(a, b)] += weight * slope[a] * slope[b];
            }
        }
    }
    let first = material.parameters().len();
    for (i, parameter) in causes.iter().flat_map(|c| c.cause.parameters()).enumerate() {
        matrix[(first + i, first + i)] += prior_scales(&parameter).powi(-2);
    }
    matrix
}

fn deviance_of(
    metric: &Metric,
    measured: &Trace,
    prediction: &Prediction,
    material: &Material,
    causes: &[Supposed],
    settings: &FitSettings,
) -> f64 {
    let residual = metric.weigh(&measured.plus(-1.0, &prediction.trace));
    let mut sum = metric.inner(&residual, &residual);
    sum += ((settings.bulk.center_kpa / material.bulk_kpa).ln() / settings.bulk.log_sd).powi(2);
    sum += settings.shear.map_or(0.0, |shear| shear.terms(material).0);
    for supposed in causes {
        let (parameters, start) = (supposed.cause.parameters(), supposed.cause.start());
        for n in 0..parameters.len() {
            let sd = prior_scales(&parameters[n]) * parameters[n].scale;
            sum += ((supposed.values[n] - start[n]) / sd).powi(2);
        }
    }
    sum
}

/// How the prediction of `fitted` changes, to first order, where it is fitted again: to `measured` as `metric` weighs
/// it. `columns` are its [`derivatives`].
pub(super) fn first_order_refit(
    metric: &Metric,
    measured: &Trace,
    fitted: &CauseFit,
    settings: &FitSettings,
    columns: &[Trace],
) -> Trace {
    let CauseFit { material, causes, prediction, .. } = fitted;
    let (matrix, gradient) = normal_system(metric, measured, prediction, material, causes, settings, columns);
    // What determines nothing changes nothing.
    let change = matrix.cholesky().map_or_else(|| DVector::zeros(columns.len()), |c| c.solve(&gradient));
    let num_of_material = material.parameters().len();
    let part = change.iter().enumerate().map(|(i, c)| largest_step(i, num_of_material) / c.abs().max(1e-12));
    let part = part.fold(1.0, f64::min);
    let none = prediction.trace.scaled(0.0);
    columns.iter().zip(&change).fold(none, |sum, (column, change)| sum.plus(part * change, column))
}

/// The largest change in one step of a scaled parameter, the first of which are the material's.
fn largest_step(index: usize, num_of_material: usize) -> f64 {
    if index == 0 {
        1.0
    } else if index < num_of_material {
        LARGEST_STEP
    } else {
        LARGEST_CAUSE_STEP
    }
}

/// The material and the members' causes after a scaled step, shortened to the largest allowed and cut to the ranges.
fn moved(members: &[Member], at: &Point, step: &DVector<f64>) -> (Material, Vec<Vec<Supposed>>) {
    let parameters = at.material.parameters();
    let mut part = 1.0f64;
    for m in members {
        for (i, &place) in m.places.iter().enumerate() {
            part = part.min(largest_step(i, parameters.len()) / step[place].abs().max(1e-12));
        }
    }
    let mut next = at.material.clone();
    // The material is every member's.
    let places = members.first().map_or(&[][..], |m| &m.places);
    for (&parameter, &place) in parameters.iter().zip(places) {
        let value = at.material.value(parameter);
        let s = part * step[place];
        let moved = if parameter == Parameter::Kappa { value * s.exp() } else { value * (1.0 + s) };
        // With κ/μ below about five neither the elements nor the theory of a soft solid hold.
        let floor = if parameter == Parameter::Kappa { 5.0 * shear_modulus(&at.material) } else { f64::NEG_INFINITY };
        next.set(parameter, moved.max(floor));
    }
    let causes = members
        .iter()
        .zip(&at.causes)
        .map(|(m, causes)| {
            let mut places = m.places[parameters.len()..].iter();
            causes
                .iter()
                .map(|c| {
                    let mut values = c.values.clone();
                    for ((value, p), &place) in values.iter_mut().zip(c.cause.parameters()).zip(&mut places) {
                        *value = (*value + part * step[place] * p.scale).clamp(p.range[0], p.range[1]);
                    }
                    Supposed { cause: c.cause.clone(), values }
                })
                .collect()
        })
        .collect();
    (next, causes)
}

/// The size of one unit of each scaled parameter, in the parameter's own units; for ln κ that is κ.
pub fn scales(material: &Material, causes: &[Supposed]) -> Vec<f64> {
    let of_material = material.parameters().into_iter().map(|p| material.value(p).abs());
    of_material.chain(causes.iter().flat_map(|c| c.cause.parameters()).map(|p| p.scale)).collect()
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
