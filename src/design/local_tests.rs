//! The local search where its optimum is known.

use super::*;
use std::cell::Cell;

type Function = fn(&[f64]) -> Option<LocalModel>;
type Geometry = fn(&[f64]) -> Vec<f64>;

struct Problem {
    function: Function,
    geometry: Geometry,
    broken: Cell<usize>,
}

impl Problem {
    fn new(function: Function, geometry: Geometry) -> Self {
        Problem { function, geometry, broken: Cell::new(0) }
    }
}

impl LocalProblem for Problem {
    fn model(&self, x: &[f64]) -> Option<LocalModel> {
        if (self.geometry)(x).iter().any(|m| *m < 0.0) {
            self.broken.set(self.broken.get() + 1);
        }
        (self.function)(x)
    }
    fn geometry(&self, x: &[f64]) -> Vec<f64> {
        (self.geometry)(x)
    }
    fn is_free(&self, _: usize) -> bool {
        true
    }
}

fn linear_model(gain: f64, gradient: Vec<f64>) -> LocalModel {
    LocalModel {
        gains: vec![gain],
        weights: Vec::new(),
        margins: Vec::new(),
        gain_gradients: vec![gradient],
        margin_gradients: Vec::new(),
    }
}

fn patient() -> LocalSettings {
    LocalSettings { max_evaluations: 80, radius: 0.15, smallest_radius: 1e-7 }
}

/// Two discs that want to meet but must stay 0.4 apart: no evaluation ever breaks the distance.
#[test]
fn geometry_is_never_broken() {
    fn pull(x: &[f64]) -> Option<LocalModel> {
        let target = [0.5, 0.45, 0.5, 0.5];
        let weight = [1.0, 2.0, 1.0, 1.0];
        let gain = -(0..4).map(|i| weight[i] * (x[i] - target[i]).powi(2)).sum::<f64>();
        Some(linear_model(gain, (0..4).map(|i| -2.0 * weight[i] * (x[i] - target[i])).collect()))
    }
    let problem = Problem::new(pull, |x| vec![(x[2] - x[0]).hypot(x[3] - x[1]) - 0.4]);
    let found = improve(&problem, &[0.1, 0.2, 0.9, 0.7], &patient()).expect("the start evaluates");
    assert_eq!(problem.broken.get(), 0);
    // Apart along x: (0.3, y), (0.7, y) costs 0.08 and the difference of the two y targets at most 0.0025 more.
    assert!(found.merit > -0.085, "{found:?}");
}

/// max x + y with x² + y² ≤ ½ (a response margin), from a start that breaks it.
#[test]
fn a_start_beyond_a_limit_comes_back() {
    fn disc(x: &[f64]) -> Option<LocalModel> {
        let mut model = linear_model(x[0] + x[1], vec![1.0, 1.0]);
        model.margins = vec![0.5 - x[0] * x[0] - x[1] * x[1]];
        model.margin_gradients = vec![vec![-2.0 * x[0], -2.0 * x[1]]];
        Some(model)
    }
    let found = improve(&Problem::new(disc, |_| Vec::new()), &[0.95, 0.8], &patient()).expect("it evaluates");
    // Where a merit without derivative bends, steps along the circle are short: a per mille is left.
    assert!((found.merit - 1.0).abs() < 2e-3, "{found:?}");
}

/// Evaluations fail beyond 0.6, where the gain would grow: steps shorten and the border is approached.
#[test]
fn failures_shorten_steps() {
    fn wall(x: &[f64]) -> Option<LocalModel> {
        (x[0] <= 0.6).then(|| linear_model(x[0], vec![1.0]))
    }
    let found = improve(&Problem::new(wall, |_| Vec::new()), &[0.3], &patient()).expect("the start evaluates");
    assert!(found.x[0] > 0.59 && found.x[0] <= 0.6, "{found:?}");
    assert!(improve(&Problem::new(|_| None, |_| Vec::new()), &[0.3], &patient()).is_none());
}

/// A corner of the box.
#[test]
fn bounds_hold() {
    let problem = Problem::new(|x| Some(linear_model(2.0 * x[0] - x[1], vec![2.0, -1.0])), |_| Vec::new());
    let found = improve(&problem, &[0.5, 0.5], &patient()).expect("it evaluates");
    assert!((found.x[0] - 1.0).abs() < 1e-6 && found.x[1].abs() < 1e-6, "{found:?}");
}

/// Values that are no numbers count as failures: the search neither stops nor settles there.
#[test]
fn not_a_number_is_no_step() {
    fn broken(x: &[f64]) -> Option<LocalModel> {
        Some(linear_model(if x[0] > 0.6 { f64::NAN } else { x[0] }, vec![1.0]))
    }
    let found = improve(&Problem::new(broken, |_| Vec::new()), &[0.3], &patient()).expect("the start evaluates");
    assert!(found.x[0] > 0.59 && found.x[0] <= 0.6 && found.merit.is_finite(), "{found:?}");
}
