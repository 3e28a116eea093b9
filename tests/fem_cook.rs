//! Cook's membrane at finite strain, nearly incompressible and in plane strain: a panel held along its left edge and
//! sheared by dead loads along its right one (Simo & Armero, Int. J. Numer. Methods Eng. 33, 1992, with μ = 80.1938 and
//! κ = 400889.8 kPa, the Poisson ratio of 0.4999).
//!
//! The corner at which the held edge meets the upper one is singular, so that every code converges slowly; what is
//! compared with is FElupe 11.3 (biquadratic quadrilaterals, three fields), on meshes of its own.
//!
//! `cargo test --test fem_cook -- --nocapture` prints the table of `docs/verification.md`.

mod common;

use common::{Vector, bricks, is_zero, nodes_where, ogden, tight, unit_block};
use lambdak::fem::ForwardModel;
use lambdak::mesh::ElementKind;

/// Shear along the right edge, kPa.
const TRACTION_KPA: f64 = 6.25;
/// Height of the right edge, mm.
const EDGE_MM: f64 = 16.0;

/// Displacement of the upper right corner, mm, by FElupe with n × n elements.
const INDEPENDENT: [(usize, [f64; 2]); 5] = [
    (4, [-5.66136, 6.79730]),
    (8, [-5.75512, 6.87575]),
    (16, [-5.79779, 6.90621]),
    (32, [-5.81754, 6.91995]),
    (64, [-5.82735, 6.92671]),
];

/// Cells along each side of the finest mesh here.
const FINEST: usize = 32;

/// The displacement of the upper right corner, mm, with n × n cells.
fn corner(kind: ElementKind, n: usize) -> [f64; 2] {
    // As deep as an element is high, so that elements are no needles.
    let depth = EDGE_MM / n as f64;
    let place = |p: Vector| [48.0 * p[0], 44.0 * p[0] + p[1] * (44.0 + (16.0 - 44.0) * p[0]), depth * p[2]];
    let (mut mesh, places) = bricks(kind, [n, n, 1], false, place);
    mesh.fixed_nodes = nodes_where(&places, |p| is_zero(p[0]));
    mesh.mirror_z_nodes = nodes_where(&places, |p| is_zero(p[2]) || is_zero(p[2] - 1.0));
    // Simpson's weights are what quadratic shape functions integrate to.
    let weight = |v: f64, cells: usize| {
        let index = (2.0 * v * cells as f64).round() as usize;
        let of_cell = match index {
            i if i % 2 == 1 => 4.0,
            i if i == 0 || i == 2 * cells => 1.0,
            _ => 2.0,
        };
        of_cell / (6.0 * cells as f64)
    };
    let mut load = vec![[0.0; 3]; mesh.nodes.len()];
    for node in nodes_where(&places, |p| is_zero(p[0] - 1.0)) {
        let p = places[node as usize];
        load[node as usize][1] = TRACTION_KPA * EDGE_MM * depth * weight(p[1], n) * weight(p[2], 1);
    }
    let tip = nodes_where(&places, |p| is_zero(p[0] - 1.0) && is_zero(p[1] - 1.0) && is_zero(p[2]))[0];
    let material = ogden(400_889.8, &[(80.1938, 2.0)]);
    let mut displacement = vec![[0.0; 3]; mesh.nodes.len()];
    let mut model = ForwardModel::new(mesh, &unit_block()).unwrap();
    // Rounding of κ ln J leaves a relative residual of 1e-9 at this κ/μ.
    let options = lambdak::fem::SolveOptions { tolerance: 1e-7, max_iterations: 30, ..tight() };
    for part in [0.25, 0.5, 0.75, 1.0] {
        let load: Vec<Vector> = load.iter().map(|f| f.map(|c| part * c)).collect();
        displacement = model.solve_prescribed(&material, &displacement, Some(&load), &options).unwrap().displacement;
    }
    let [x, y, _] = displacement[tip as usize];
    [x, y]
}

/// The limit of values that converge geometrically, by Aitken's extrapolation of the last three.
fn limit(values: &[f64]) -> f64 {
    let [.., a, b, c] = values else { panic!("three values are needed") };
    c - (c - b).powi(2) / (c - 2.0 * b + a)
}

#[test]
fn cooks_membrane_is_that_of_an_independent_code() {
    let text = |[x, y]: [f64; 2]| format!("{x:.4}, {y:.4}");
    let mut heights: [Vec<f64>; 3] = Default::default();
    println!("| n | FElupe: x, y, mm | hexahedra | prisms |");
    for (n, theirs) in INDEPENDENT {
        heights[0].push(theirs[1]);
        let ours = [ElementKind::Hex27, ElementKind::Prism21].map(|kind| (n <= FINEST).then(|| corner(kind, n)));
        for (all, found) in heights[1..].iter_mut().zip(ours) {
            all.extend(found.map(|[_, y]| y));
        }
        let [hexahedra, prisms] = ours.map(|found| found.map(text).unwrap_or_default());
        println!("| {n} | {} | {hexahedra} | {prisms} |", text(theirs));
    }
    let [theirs, hexahedra, prisms] = heights.map(|values| limit(&values));
    println!("| limit of y | {theirs:.4} | {hexahedra:.4} | {prisms:.4} |");
    // A third of what the finest mesh of any of them is off by.
    for ours in [hexahedra, prisms] {
        assert!((ours / theirs - 1.0).abs() < 3e-4, "{ours} against {theirs} mm");
    }
}
