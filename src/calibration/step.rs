//! The constrained quadratic step: minimise ½ sᵀ(H + δ diag H) s − gᵀs subject to linear limits, with Clarabel.

use super::error::CalibrationError;
use super::fit::{Bulk, FitOptions, Held};
use super::system::NormalSystem;
use crate::material::{MAX_ALPHA, MIN_ALPHA, Ogden, Parameter};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};
use nalgebra::{DMatrix, DVector};

/// A step changes an exponent by at most this fraction: it keeps its sign, and with it μα > 0.
const MAX_CHANGE: f64 = 0.5;
/// A step changes ln κ and ln |μ| by at most this.
const MAX_LOG_CHANGE: f64 = 1.0;
/// κ stays between these multiples of the start's shear modulus, between which the elements neither lock nor invert.
const BULK_RATIO: [f64; 2] = [5.0, 1e4];
/// μ comes no nearer to zero than this fraction of the start's: a term that fades stops there and is reported. The stress goes
/// with μ λ^α: a start with another exponent may be wrong by decades.
const SMALLEST_MODULUS: f64 = 1e-9;
/// The same for α.
const SMALLEST_EXPONENT: f64 = 1e-3;
/// |α| stays a little below what a material may have.
const LARGEST_EXPONENT: f64 = 0.99 * MAX_ALPHA;
/// Parameters that the data see less of than this part of the best seen one are scaled like it.
const SMALLEST_SCALE: f64 = 1e-5;
/// Added to the matrix scaled to a unit diagonal, so that directions without information stay where they are.
const RIDGE: f64 = 1e-12;
/// Tried in turn where the limited problem cannot be solved.
const LARGER_RIDGES: [f64; 3] = [1e-9, 1e-7, 1e-5];
/// A limit counts as reached where less than this is left of it (scaled parameters).
const REACHED: f64 = 1e-6;
/// An earlier estimate at the smallest distance of exponents may be a start: its distance is so accurate.
const GAP_ROUNDING: f64 = 1e-6;
/// A violation of a limit below this is rounding (scaled parameters).
const ROUNDING: f64 = 1e-12;
/// An objective this little above that of rest is none: 10⁻⁹ is 4·10⁻⁵ standard deviations.
const NO_ASCENT: f64 = 1e-9;
/// Largest violation of a limit that a solution of Clarabel's may have before it is drawn back (scaled parameters).
const FEASIBILITY: f64 = 1e-5;

/// One linear limit Σ coefficient·s ≤ room.
#[derive(Clone, Debug)]
struct Limit {
    name: String,
    coefficients: Vec<(usize, f64)>,
    room: f64,
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
    /// √(2 × the promised decrease of χ²/2): without limits the distance in standard deviations of the worst combination.
    pub(super) distance: f64,
    /// Limits that it reaches.
    pub(super) reached: Vec<String>,
}

impl Constraints {
    /// The limits of a fit from `start`.
    pub(super) fn new(start: &Ogden, options: &FitOptions) -> Result<Constraints, CalibrationError> {
        start.validate()?;
        let shear = 0.5 * start.terms.iter().map(|t| t.mu_kpa * t.alpha).sum::<f64>();
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
                        _ => SMALLEST_MODULUS * value,
                    }
                })
                .collect(),
            order,
            min_gap: options.min_alpha_gap,
            held: if options.bulk == Bulk::Held { options.held.with(0) } else { options.held },
        })
    }

    fn limits(&self, system: &NormalSystem, is_trusted: bool) -> Vec<Limit> {
        let mut limits = Vec::new();
        for (i, parameter) in system.parameters.iter().enumerate() {
            let name = parameter.name();
            let trust = if matches!(parameter, Parameter::Alpha(_)) { MAX_CHANGE } else { MAX_LOG_CHANGE };
            if *parameter == Parameter::Kappa {
                let [low, high] = self.bulk_range.map(|limit| (limit / system.values[i]).ln());
                limits.push(Limit {
                    name: format!("{name}: largest"),
                    coefficients: vec![(i, 1.0)],
                    room: high.max(0.0),
                });
                limits.push(Limit {
                    name: format!("{name}: smallest"),
                    coefficients: vec![(i, -1.0)],
                    room: (-low).max(0.0),
                });
            }
            if *parameter != Parameter::Kappa {
                let part = self.smallest[i] / system.values[i].abs();
                let room = if let Parameter::Mu(_) = parameter { -part.ln() } else { 1.0 - part }.max(0.0);
                limits.push(Limit { name: format!("{name}: smallest size"), coefficients: vec![(i, -1.0)], room });
            }
            if let Parameter::Alpha(_) = parameter {
                let room = (LARGEST_EXPONENT / system.values[i].abs() - 1.0).max(0.0);
                limits.push(Limit { name: format!("{name}: largest size"), coefficients: vec![(i, 1.0)], room });
            }
            if is_trusted {
                for sign in [1.0, -1.0] {
                    limits.push(Limit { name: format!("{name}: step"), coefficients: vec![(i, sign)], room: trust });
                }
            }
        }
        for &(a, b) in &self.order {
            // In the order κ, μ₁, α₁, μ₂, α₂, … term t has its exponent at 2t + 2.
            let (i, j) = (2 * a + 2, 2 * b + 2);
            let (larger, smaller) = (system.values[i], system.values[j]);
            limits.push(Limit {
                name: format!("{} - {}: smallest", system.parameters[i].name(), system.parameters[j].name()),
                coefficients: vec![(i, -larger), (j, smaller)],
                room: (larger - smaller - self.min_gap).max(0.0),
            });
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
        let limits: Vec<(Vec<f64>, f64, String)> = self
            .limits(system, is_trusted)
            .into_iter()
            .filter_map(|l| {
                let mut row = vec![0.0; m];
                // A held parameter takes no room; a limit on held ones alone is none.
                let mut is_any = false;
                for (i, c) in l.coefficients {
                    if let Some(a) = free.iter().position(|&f| f == i) {
                        row[a] = c / root[a];
                        is_any = true;
                    }
                }
                is_any.then_some((row, l.room, l.name))
            })
            .collect();
        let used = |row: &[f64], x: &DVector<f64>| row.iter().zip(x.iter()).map(|(r, x)| r * x).sum::<f64>();
        let unlimited = damped.clone().cholesky().map(|c| c.solve(&gradient));
        let x = match unlimited {
            // Where no limit is reached the normal equations give the step to more digits.
            Some(x) if limits.iter().all(|(row, room, _)| used(row, &x) <= *room) => x,
            _ => {
                // A nearly singular matrix may be beyond the interior point's accuracy: a larger ridge then.
                let mut found = solve_limited(&damped, &gradient, &limits);
                for ridge in LARGER_RIDGES {
                    if found.is_ok() {
                        break;
                    }
                    let ridged = &damped + DMatrix::from_diagonal_element(m, m, ridge);
                    found = solve_limited(&ridged, &gradient, &limits);
                }
                let mut x = found?;
                // Rest is within all limits, so drawing back towards it is too. A violation by rounding is let be: where no
                // room is left it would draw the whole step back.
                let part = limits
                    .iter()
                    .filter(|(row, room, _)| used(row, &x) > *room + ROUNDING)
                    .map(|(row, room, _)| room / used(row, &x))
                    .fold(1.0, f64::min);
                x *= part;
                x
            }
        };
        let decrease = gradient.dot(&x) - 0.5 * x.dot(&(&plain * &x));
        let reached = limits
            .iter()
            .filter(|(row, room, _)| room - used(row, &x) < REACHED)
            .map(|(_, _, name)| name.clone())
            .collect();
        let mut change = DVector::zeros(n);
        for (a, &i) in free.iter().enumerate() {
            change[i] = x[a] / root[a];
        }
        Ok(Step { change, distance: (2.0 * decrease.max(0.0)).sqrt(), reached })
    }
}

/// The same optimum to rounding: the limits that `x` reaches taken as equations. `None` where that is not the optimum
/// after all (another limit broken, a multiplier of the wrong sign, limits that depend on each other).
fn polished(
    matrix: &DMatrix<f64>,
    gradient: &DVector<f64>,
    limits: &[(Vec<f64>, f64, String)],
    x: &DVector<f64>,
) -> Option<DVector<f64>> {
    let used = |row: &[f64], x: &DVector<f64>| row.iter().zip(x.iter()).map(|(r, x)| r * x).sum::<f64>();
    let active: Vec<usize> = (0..limits.len()).filter(|&r| limits[r].1 - used(&limits[r].0, x) < REACHED).collect();
    let (m, n) = (gradient.len(), gradient.len() + active.len());
    // Multipliers are measured against the gradient, rows have the height of their largest coefficient.
    let heights: Vec<f64> = active.iter().map(|&r| limits[r].0.iter().fold(1e-300f64, |s, c| s.max(c.abs()))).collect();
    let mut kkt = DMatrix::zeros(n, n);
    let mut right = DVector::zeros(n);
    kkt.view_mut((0, 0), (m, m)).copy_from(matrix);
    right.rows_mut(0, m).copy_from(gradient);
    for (k, (&r, height)) in active.iter().zip(&heights).enumerate() {
        for (j, c) in limits[r].0.iter().enumerate() {
            kkt[(m + k, j)] = c / height;
            kkt[(j, m + k)] = c / height;
        }
        right[m + k] = limits[r].1 / height;
    }
    let solution = kkt.lu().solve(&right).filter(|s| s.iter().all(|v| v.is_finite()))?;
    let exact = solution.rows(0, m).into_owned();
    let is_feasible = limits.iter().all(|(row, room, _)| used(row, &exact) <= *room + ROUNDING);
    let smallest = -1e-8 * gradient.amax().max(1.0);
    let has_signs = solution.rows(m, active.len()).iter().all(|multiplier| *multiplier >= smallest);
    (is_feasible && has_signs).then_some(exact)
}

/// The optimum within `limits`. Limits enter as they are broken: an optimum within some
/// of them that breaks none of the others is that of all, and limits far away, whose rooms are larger by decades, would
/// spoil the interior point's accuracy.
fn solve_limited(
    matrix: &DMatrix<f64>,
    gradient: &DVector<f64>,
    limits: &[(Vec<f64>, f64, String)],
) -> Result<DVector<f64>, CalibrationError> {
    let Some(cholesky) = matrix.clone().cholesky() else {
        return solve_among(matrix, gradient, limits);
    };
    let mut x = cholesky.solve(gradient);
    let mut chosen: Vec<usize> = Vec::new();
    loop {
        let broken: Vec<usize> = (0..limits.len())
            .filter(|r| !chosen.contains(r))
            .filter(|&r| {
                let (row, room, _) = &limits[r];
                row.iter().zip(x.iter()).map(|(r, x)| r * x).sum::<f64>() > room + ROUNDING
            })
            .collect();
        if broken.is_empty() {
            return Ok(x);
        }
        chosen.extend(broken);
        chosen.sort_unstable();
        let some: Vec<_> = chosen.iter().map(|&r| limits[r].clone()).collect();
        x = match solve_among(matrix, gradient, &some) {
            Ok(x) => x,
            Err(_) => return solve_among(matrix, gradient, limits),
        };
    }
}

fn solve_among(
    matrix: &DMatrix<f64>,
    gradient: &DVector<f64>,
    limits: &[(Vec<f64>, f64, String)],
) -> Result<DVector<f64>, CalibrationError> {
    let m = gradient.len();
    // A scale of one: interior-point tolerances are partly absolute.
    let size = gradient.amax().max(1.0);
    let (mut pointers, mut rows, mut entries) = (vec![0], Vec::new(), Vec::new());
    for j in 0..m {
        for i in 0..=j {
            rows.push(i);
            entries.push(matrix[(i, j)]);
        }
        pointers.push(rows.len());
    }
    let p = CscMatrix::new(m, m, pointers, rows, entries);
    let q: Vec<f64> = gradient.iter().map(|g| -g / size).collect();
    let (mut pointers, mut rows, mut entries) = (vec![0], Vec::new(), Vec::new());
    // Each row to a unit largest coefficient.
    let heights: Vec<f64> =
        limits.iter().map(|(row, _, _)| row.iter().fold(1e-300f64, |s, x| s.max(x.abs()))).collect();
    for j in 0..m {
        for (r, (row, _, _)) in limits.iter().enumerate() {
            if row[j].abs() > 0.0 {
                rows.push(r);
                entries.push(row[j] / heights[r]);
            }
        }
        pointers.push(rows.len());
    }
    let a = CscMatrix::new(limits.len(), m, pointers, rows, entries);
    let b: Vec<f64> = limits.iter().zip(&heights).map(|((_, room, _), h)| room / (h * size)).collect();
    let unsolved = || CalibrationError::Subproblem { status: SolverStatus::Unsolved };
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(1e-13)
        .tol_gap_rel(1e-11)
        .tol_feas(1e-11)
        .build()
        .map_err(|_| unsolved())?;
    let mut solver =
        DefaultSolver::new(&p, &q, &a, &b, &[NonnegativeConeT(limits.len())], settings).map_err(|_| unsolved())?;
    solver.solve();
    let x = DVector::from_iterator(m, solver.solution.x.iter().map(|x| x * size));
    let x = polished(matrix, gradient, limits, &x).unwrap_or(x);
    let is_feasible = limits
        .iter()
        .all(|(row, room, _)| row.iter().zip(x.iter()).map(|(r, x)| r * x).sum::<f64>() <= room + FEASIBILITY);
    let model = 0.5 * x.dot(&(matrix * &x)) - gradient.dot(&x);
    let is_descent = model.is_finite() && model <= NO_ASCENT * size;
    let status = solver.solution.status;
    let is_answer = match status {
        SolverStatus::Solved | SolverStatus::AlmostSolved => true,
        // Small problems may end so at full accuracy; what counts is the step itself.
        SolverStatus::InsufficientProgress
        | SolverStatus::MaxIterations
        | SolverStatus::MaxTime
        | SolverStatus::NumericalError => true,
        // Rest is feasible and the matrix is positive definite: an "infeasible" is a failure like the others.
        SolverStatus::PrimalInfeasible
        | SolverStatus::DualInfeasible
        | SolverStatus::AlmostPrimalInfeasible
        | SolverStatus::AlmostDualInfeasible
        | SolverStatus::Unsolved
        | SolverStatus::CallbackTerminated => false,
    };
    if is_answer && is_feasible && is_descent { Ok(x) } else { Err(CalibrationError::Subproblem { status }) }
}

#[cfg(test)]
#[path = "step_tests.rs"]
mod tests;
