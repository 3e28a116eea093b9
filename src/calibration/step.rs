//! The constrained quadratic step: minimise ½ sᵀ(H + δ diag H) s − gᵀs subject to linear limits.

use super::error::CalibrationError;
use super::options::{Bulk, FitOptions, Held};
use super::system::NormalSystem;
use crate::material::{
    LawParameter, MAX_ALPHA, MAX_CHAIN_LIMIT, MAX_LOCKING_STRETCH, MIN_ALPHA, MIN_CHAIN_LIMIT, MIN_LOCKING_STRETCH,
    Material, Parameter,
};
use crate::optimise::{LinearLimit, NoStep, limited_step};
use nalgebra::{DMatrix, DVector};

/// A step changes an exponent by at most this fraction: it keeps its sign, and with it μα > 0.
const MAX_CHANGE: f64 = 0.5;
/// A step changes ln κ and ln |μ| by at most this.
const MAX_LOG_CHANGE: f64 = 1.0;
/// κ stays between these multiples of the start's shear modulus, between which the elements neither lock nor invert.
const BULK_RATIO: [f64; 2] = [5.0, 1e4];
/// μ comes no nearer to zero than this fraction of the start's: a term that fades stops there and is reported. The
/// stress goes with μ λ^α: a start with another exponent may be wrong by decades.
const SMALLEST_MODULUS: f64 = 1e-9;
/// The same for α.
const SMALLEST_EXPONENT: f64 = 1e-3;
/// |α| stays a little below what a material may have.
const LARGEST_EXPONENT: f64 = 0.99 * MAX_ALPHA;
/// Parameters that the data see less of than this part of the best seen one are scaled like it.
const SMALLEST_SCALE: f64 = 1e-5;
/// Added to the matrix scaled to a unit diagonal, so that directions without information stay where they are.
const RIDGE: f64 = 1e-12;
/// An earlier estimate at the smallest distance of exponents may be a start: its distance is so accurate.
const GAP_ROUNDING: f64 = 1e-6;
/// A limit on a step in scaled parameters, with its name in words.
#[derive(Clone, Debug)]
struct NamedLimit {
    name: String,
    limit: LinearLimit,
}

/// What a fit must keep to.
#[derive(Clone, Debug)]
pub(super) struct Constraints {
    /// κ, kPa.
    bulk_range: [f64; 2],
    /// |ξ| in the order of the parameters; κ's is not used.
    smallest: Vec<f64>,
    /// Pairs (term of larger exponent, term of next smaller one).
    order: Vec<(usize, usize)>,
    min_gap: f64,
    held: Held,
}

/// A step and how far it goes.
#[derive(Clone, Debug)]
pub(super) struct Step {
    /// In scaled parameters.
    pub(super) change: DVector<f64>,
    /// √(2 × the promised decrease of χ²/2): without limits the distance in standard deviations of the worst
    /// combination.
    pub(super) distance: f64,
    /// Limits that it reaches.
    pub(super) reached: Vec<String>,
}

impl Constraints {
    /// The limits of a fit from `start`.
    pub(super) fn new(start: &Material, options: &FitOptions) -> Result<Constraints, CalibrationError> {
        start.validate()?;
        let shear = start.initial_shear_modulus_kpa();
        let mut by_exponent: Vec<usize> = (0..start.terms.len()).collect();
        by_exponent.sort_by(|&a, &b| start.terms[b].alpha.total_cmp(&start.terms[a].alpha));
        let order: Vec<(usize, usize)> = by_exponent.windows(2).map(|w| (w[0], w[1])).collect();
        for &(a, b) in &order {
            let (larger, smaller) = (start.terms[a].alpha, start.terms[b].alpha);
            if !(larger - smaller > options.min_alpha_gap * (1.0 - GAP_ROUNDING)) {
                return Err(CalibrationError::CloseExponents { larger, smaller, min_gap: options.min_alpha_gap });
            }
        }
        Ok(Constraints {
            // A start outside may stay there.
            bulk_range: [(BULK_RATIO[0] * shear).min(start.bulk_kpa), (BULK_RATIO[1] * shear).max(start.bulk_kpa)],
            smallest: start
                .parameters()
                .iter()
                .map(|p| {
                    let value = start.value(*p).abs();
                    match p {
                        Parameter::Alpha(_) => (SMALLEST_EXPONENT * value).max(1.01 * MIN_ALPHA),
                        Parameter::Law(LawParameter::Limit) => MIN_CHAIN_LIMIT,
                        Parameter::Law(LawParameter::LockingStretch) => MIN_LOCKING_STRETCH,
                        _ => SMALLEST_MODULUS * value,
                    }
                })
                .collect(),
            order,
            min_gap: options.min_alpha_gap,
            held: if options.bulk == Bulk::Held { options.held.with(0) } else { options.held },
        })
    }

    fn limits(&self, system: &NormalSystem, is_trusted: bool) -> Vec<NamedLimit> {
        let mut limits = Vec::new();
        let mut limit = |name: String, coefficients: Vec<(usize, f64)>, bound: f64| {
            limits.push(NamedLimit { name, limit: LinearLimit { coefficients, bound } });
        };
        for (i, parameter) in system.parameters.iter().enumerate() {
            let name = parameter.name();
            let trust = if matches!(parameter, Parameter::Alpha(_)) { MAX_CHANGE } else { MAX_LOG_CHANGE };
            if *parameter == Parameter::Kappa {
                let [low, high] = self.bulk_range.map(|limit| (limit / system.values[i]).ln());
                limit(format!("{name}: largest"), vec![(i, 1.0)], high.max(0.0));
                limit(format!("{name}: smallest"), vec![(i, -1.0)], (-low).max(0.0));
            }
            if *parameter != Parameter::Kappa && !parameter.has_any_sign() {
                let part = self.smallest[i] / system.values[i].abs();
                let room = if let Parameter::Alpha(_) = parameter { 1.0 - part } else { -part.ln() }.max(0.0);
                limit(format!("{name}: smallest size"), vec![(i, -1.0)], room);
            }
            let largest = match parameter {
                Parameter::Law(LawParameter::Limit) => Some(MAX_CHAIN_LIMIT),
                Parameter::Law(LawParameter::LockingStretch) => Some(MAX_LOCKING_STRETCH),
                _ => None,
            };
            if let Some(largest) = largest {
                limit(format!("{name}: largest size"), vec![(i, 1.0)], (largest / system.values[i]).ln().max(0.0));
            }
            if let Parameter::Alpha(_) = parameter {
                let room = (LARGEST_EXPONENT / system.values[i].abs() - 1.0).max(0.0);
                limit(format!("{name}: largest size"), vec![(i, 1.0)], room);
            }
            if is_trusted {
                for sign in [1.0, -1.0] {
                    limit(format!("{name}: step"), vec![(i, sign)], trust);
                }
            }
        }
        for &(a, b) in &self.order {
            // In the order κ, μ₁, α₁, μ₂, α₂, … term t has its exponent at 2t + 2.
            let (i, j) = (2 * a + 2, 2 * b + 2);
            let (larger, smaller) = (system.values[i], system.values[j]);
            limit(
                format!("{} - {}: smallest", system.parameters[i].name(), system.parameters[j].name()),
                vec![(i, -larger), (j, smaller)],
                (larger - smaller - self.min_gap).max(0.0),
            );
        }
        limits
    }

    /// The best step; `damping` is δ. With `is_trusted` no parameter changes by more than a fraction.
    ///
    /// # Errors
    /// [`CalibrationError::Subproblem`].
    pub(super) fn step(&self, system: &NormalSystem, damping: f64, is_trusted: bool) -> Result<Step, CalibrationError> {
        let n = system.values.len();
        let free: Vec<usize> = (0..n).filter(|&i| !self.held.contains(i)).collect();
        let m = free.len();
        // Unit diagonal: the two-term matrix has entries over six decades. What is hardly seen, as a faded term, is not
        // scaled up to it: its limits would be those of huge variables.
        let root: Vec<f64> = free.iter().map(|&i| system.matrix[(i, i)].sqrt()).collect();
        let floor = SMALLEST_SCALE * root.iter().fold(0.0f64, |a, r| a.max(*r));
        let root: Vec<f64> = root.into_iter().map(|r| if floor > 0.0 { r.max(floor) } else { 1.0 }).collect();
        let plain = DMatrix::from_fn(m, m, |a, b| system.matrix[(free[a], free[b])] / (root[a] * root[b]));
        let damped = &plain + DMatrix::from_diagonal_element(m, m, damping + RIDGE);
        let gradient = DVector::from_fn(m, |a, _| system.gradient[free[a]] / root[a]);
        let (names, limits): (Vec<String>, Vec<LinearLimit>) = self
            .limits(system, is_trusted)
            .into_iter()
            .filter_map(|NamedLimit { name, limit }| {
                // A held parameter takes no room; a limit on held ones alone is none.
                let mut coefficients: Vec<(usize, f64)> = Vec::new();
                for (i, c) in limit.coefficients {
                    if let Some(a) = free.iter().position(|&f| f == i) {
                        coefficients.push((a, c / root[a]));
                    }
                }
                coefficients.sort_by_key(|(a, _)| *a);
                (!coefficients.is_empty()).then_some((name, LinearLimit { coefficients, bound: limit.bound }))
            })
            .unzip();
        let (x, reached) = limited_step(&damped, &gradient, &limits)
            .map_err(|NoStep { status }| CalibrationError::Subproblem { status })?;
        let decrease = gradient.dot(&x) - 0.5 * x.dot(&(&plain * &x));
        let reached = reached.into_iter().map(|r| names[r].clone()).collect();
        let mut change = DVector::zeros(n);
        for (a, &i) in free.iter().enumerate() {
            change[i] = x[a] / root[a];
        }
        Ok(Step { change, distance: (2.0 * decrease.max(0.0)).sqrt(), reached })
    }
}

#[cfg(test)]
#[path = "step_tests.rs"]
mod tests;
