use super::*;

type Function = fn(&[f64]) -> Result<LocalPoint, &'static str>;
type Geometry = fn(&[f64]) -> Vec<Linear>;

struct Problem {
    n: usize,
    function: Function,
    geometry: Geometry,
    broken: std::cell::Cell<usize>,
}

impl Problem {
    fn new(n: usize, function: Function, geometry: Geometry) -> Self {
        Problem { n, function, geometry, broken: std::cell::Cell::new(0) }
    }
}

impl LocalProblem for Problem {
    type Failure = &'static str;
    fn dimension(&self) -> usize {
        self.n
    }
    fn is_free(&self, _index: usize) -> bool {
        true
    }
    fn margins(&self, x: &[f64]) -> Vec<Linear> {
        (self.geometry)(x)
    }
    fn evaluate(&self, x: &[f64]) -> Result<LocalPoint, &'static str> {
        if (self.geometry)(x).iter().any(|g| g.value < 0.0) {
            self.broken.set(self.broken.get() + 1);
        }
        (self.function)(x)
    }
}

fn linear(value: f64, gradient: &[f64]) -> Linear {
    Linear { value, gradient: gradient.to_vec() }
}

fn free(_: &[f64]) -> Vec<Linear> {
    Vec::new()
}

fn options() -> LocalOptions {
    LocalOptions { max_evaluations: 80, min_radius: 1e-7, min_gain: 1e-10, ..LocalOptions::default() }
}

/// Rosenbrock's valley, its floor at (0.7, 0.49).
fn valley(x: &[f64]) -> Result<LocalPoint, &'static str> {
    let r = x[1] - x[0] * x[0];
    let value = -(20.0 * r * r + (x[0] - 0.7).powi(2));
    let gradient = [80.0 * r * x[0] - 2.0 * (x[0] - 0.7), -40.0 * r];
    Ok(LocalPoint { components: vec![linear(value, &gradient)], constraints: vec![] })
}

#[test]
fn smooth_valley() {
    let found = maximise(&Problem::new(2, valley, free), &[0.1, 0.9], &options());
    // BFGS converges superlinearly; the bound is far above what is left.
    assert!((found.best[0] - 0.7).abs() < 1e-3 && (found.best[1] - 0.49).abs() < 1e-3, "{found:?}");
}

/// Two paraboloids: the least is largest where they meet, at the kink (½, 0.3).
#[test]
fn maximin_ends_at_the_kink() {
    fn two(x: &[f64]) -> Result<LocalPoint, &'static str> {
        let f = |a: f64| {
            linear(-(x[0] - a).powi(2) - (x[1] - 0.3).powi(2), &[-2.0 * (x[0] - a), -2.0 * (x[1] - 0.3)])
        };
        Ok(LocalPoint { components: vec![f(0.2), f(0.8)], constraints: vec![] })
    }
    let found = maximise(&Problem::new(2, two, free), &[0.05, 0.9], &options());
    assert!((found.best[0] - 0.5).abs() < 1e-4 && (found.best[1] - 0.3).abs() < 1e-3, "{found:?}");
    assert!((found.value + 0.09).abs() < 1e-6);
}

/// max x + y with x² + y² ≤ ½ (soft, from the evaluation): (½, ½), from a start that violates it.
#[test]
fn infeasible_start_reaches_the_constrained_optimum() {
    fn disc(x: &[f64]) -> Result<LocalPoint, &'static str> {
        Ok(LocalPoint {
            components: vec![linear(x[0] + x[1], &[1.0, 1.0])],
            constraints: vec![linear(0.5 - x[0] * x[0] - x[1] * x[1], &[-2.0 * x[0], -2.0 * x[1]])],
        })
    }
    let found = maximise(&Problem::new(2, disc, free), &[0.95, 0.8], &options());
    // The tolerance on the constraint moves the optimum by 1e-4 / 2√½.
    assert!((found.best[0] - 0.5).abs() < 3e-3 && (found.value - 1.0).abs() < 3e-4, "{found:?}");
    assert!(found.violation <= 1e-4);
}

/// Two discs that want to meet but must stay apart: a convex distance as hard margin, kept by every evaluation.
#[test]
fn geometry_is_never_broken() {
    fn pull(x: &[f64]) -> Result<LocalPoint, &'static str> {
        let value = -(x[0] - 0.5).powi(2) - (x[2] - 0.5).powi(2) - 2.0 * (x[1] - 0.45).powi(2) - (x[3] - 0.5).powi(2);
        let gradient = [-2.0 * (x[0] - 0.5), -4.0 * (x[1] - 0.45), -2.0 * (x[2] - 0.5), -2.0 * (x[3] - 0.5)];
        Ok(LocalPoint { components: vec![linear(value, &gradient)], constraints: vec![] })
    }
    fn apart(x: &[f64]) -> Vec<Linear> {
        let (dx, dy) = (x[2] - x[0], x[3] - x[1]);
        let r = dx.hypot(dy);
        vec![linear(r - 0.4, &[-dx / r, -dy / r, dx / r, dy / r])]
    }
    let problem = Problem::new(4, pull, apart);
    let found = maximise(&problem, &[0.1, 0.2, 0.9, 0.7], &options());
    assert_eq!(problem.broken.get(), 0);
    assert!(apart(&found.best)[0].value >= 0.0);
    // Apart by 0.4 in the cheapest direction, along x: (0.3, 0.45), (0.7, 0.5) or close to it.
    assert!((apart(&found.best)[0].value) < 1e-3, "{found:?}");
    assert!(found.value > -0.085, "{found:?}");
}

/// A region where evaluations fail (or give NaN) shrinks steps, no more.
#[test]
fn failures_shrink_the_region() {
    fn hole(x: &[f64]) -> Result<LocalPoint, &'static str> {
        if x[0] > 0.6 && x[0] < 0.65 {
            return Err("no mesh");
        }
        if x[0] >= 0.65 {
            return Ok(LocalPoint { components: vec![linear(f64::NAN, &[1.0])], constraints: vec![] });
        }
        Ok(LocalPoint { components: vec![linear(x[0], &[1.0])], constraints: vec![] })
    }
    let found = maximise(&Problem::new(1, hole, free), &[0.3], &options());
    assert!(found.best[0] > 0.599 && found.best[0] <= 0.6, "{found:?}");
    assert!(found.num_failures > 0);
}

#[test]
fn bad_starts_are_typed() {
    let outside = maximise(&Problem::new(1, |_| Err("never"), |_| vec![linear(-1.0, &[0.0])]), &[0.5], &options());
    assert_eq!((outside.end, outside.num_evaluations), (LocalEnd::BadStart, 0));
    let failed = maximise(&Problem::new(1, |_| Err("never"), free), &[0.5], &options());
    assert_eq!((failed.end, failed.num_failures), (LocalEnd::BadStart, 1));
    let beyond = maximise(&Problem::new(1, |_| Err("never"), free), &[1.5], &options());
    assert_eq!(beyond.end, LocalEnd::BadStart);
}

/// An optimum in a corner of the box.
#[test]
fn bounds_hold() {
    fn slope(x: &[f64]) -> Result<LocalPoint, &'static str> {
        Ok(LocalPoint { components: vec![linear(2.0 * x[0] - x[1], &[2.0, -1.0])], constraints: vec![] })
    }
    let found = maximise(&Problem::new(2, slope, free), &[0.5, 0.5], &options());
    assert!((found.best[0] - 1.0).abs() < 1e-6 && found.best[1].abs() < 1e-6);
    assert_eq!(found.end, LocalEnd::Converged);
}
