//! Weighted least-squares unwrapping with congruence.
//!
//! Minimises Σ w (ψ_b − ψ_a − δ)² over the smooth phase ψ, δ being the wrapped differences and w one over their
//! variance (Ghiglia & Romero 1994), by conjugate gradients with the diagonal as preconditioner. A few rounds with w /
//! (|residual| + ε) move the solution towards least absolute deviations (Ghiglia & Romero 1996), so that a cut with
//! wrong differences is not smeared over its surroundings. Congruence then adds to each wrapped phase the whole turns
//! that bring it closest to ψ.

use super::graph::Graph;
use super::quality::Groups;
use std::f64::consts::TAU;

/// Rounds with new weights after the first solution.
const REWEIGHTINGS: usize = 6;
/// Residuals below this count alike, rad.
const SOFTNESS: f64 = 0.2;
/// Conjugate gradients stop at this relative residual: phases are then good to far less than half a turn.
const TOLERANCE: f64 = 1e-5;
/// Conjugate-gradient iterations per round.
const MAX_ITERATIONS: usize = 4000;

pub(super) fn congruent(graph: &Graph) -> Vec<f64> {
    let base: Vec<f64> = graph.edges.iter().map(|e| 1.0 / (e.sd * e.sd).max(1e-4)).collect();
    let mut weights = base.clone();
    let mut smooth = vec![0.0; graph.len()];
    for round in 0..=REWEIGHTINGS {
        solve(graph, &weights, &mut smooth);
        if round < REWEIGHTINGS {
            for ((w, b), e) in weights.iter_mut().zip(&base).zip(&graph.edges) {
                let residual = smooth[e.b as usize] - smooth[e.a as usize] - e.difference;
                *w = b / (residual.abs() + SOFTNESS);
            }
        }
    }
    let mut groups = Groups::new(graph.len());
    for e in &graph.edges {
        groups.join(e.a, e.b, 0);
    }
    // ψ is known up to a constant per group: the circular mean of what separates it from the wrapped phase.
    let roots: Vec<usize> = (0..graph.len()).map(|n| groups.find(n as u32).0 as usize).collect();
    let mut mean = vec![[0.0; 2]; graph.len()];
    for n in 0..graph.len() {
        let (sin, cos) = (smooth[n] - graph.phase[n]).sin_cos();
        let w = 1.0 / graph.variance[n].max(1e-4);
        mean[roots[n]][0] += w * cos;
        mean[roots[n]][1] += w * sin;
    }
    (0..graph.len())
        .map(|n| {
            let [cos, sin] = mean[roots[n]];
            let aligned = smooth[n] - sin.atan2(cos);
            graph.phase[n] + TAU * ((aligned - graph.phase[n]) / TAU).round()
        })
        .collect()
}

/// y = Σ w (x_b − x_a) over the edges, with signs: the weighted Laplacian.
fn laplacian(graph: &Graph, weights: &[f64], x: &[f64], y: &mut [f64]) {
    y.fill(0.0);
    for (e, w) in graph.edges.iter().zip(weights) {
        let flow = w * (x[e.b as usize] - x[e.a as usize]);
        y[e.b as usize] += flow;
        y[e.a as usize] -= flow;
    }
}

/// Conjugate gradients from `x`. The Laplacian is singular for constants, the right-hand side is orthogonal to them.
fn solve(graph: &Graph, weights: &[f64], x: &mut [f64]) {
    let n = graph.len();
    let (mut diagonal, mut rhs) = (vec![0.0; n], vec![0.0; n]);
    for (e, w) in graph.edges.iter().zip(weights) {
        diagonal[e.a as usize] += w;
        diagonal[e.b as usize] += w;
        rhs[e.b as usize] += w * e.difference;
        rhs[e.a as usize] -= w * e.difference;
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let precondition = |r: &[f64], z: &mut [f64]| {
        for ((z, r), d) in z.iter_mut().zip(r).zip(&diagonal) {
            *z = if *d > 0.0 { r / d } else { 0.0 };
        }
    };
    let (mut product, mut z) = (vec![0.0; n], vec![0.0; n]);
    precondition(&rhs, &mut z);
    let scale = dot(&rhs, &z);
    if !(scale > 0.0) {
        return;
    }
    laplacian(graph, weights, x, &mut product);
    let mut r: Vec<f64> = rhs.iter().zip(&product).map(|(b, p)| b - p).collect();
    precondition(&r, &mut z);
    let (mut direction, mut rho) = (z.clone(), dot(&r, &z));
    for _ in 0..MAX_ITERATIONS {
        if rho <= TOLERANCE * TOLERANCE * scale {
            return;
        }
        laplacian(graph, weights, &direction, &mut product);
        let curvature = dot(&direction, &product);
        if !(curvature > 0.0) {
            return;
        }
        let step = rho / curvature;
        for i in 0..n {
            x[i] += step * direction[i];
            r[i] -= step * product[i];
        }
        precondition(&r, &mut z);
        let next = dot(&r, &z);
        let ratio = next / rho;
        for i in 0..n {
            direction[i] = z[i] + ratio * direction[i];
        }
        rho = next;
    }
}
