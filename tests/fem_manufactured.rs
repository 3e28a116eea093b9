//! Order of convergence on a manufactured finite-strain solution.
//!
//! The deformation is a composition of three shears (each with determinant 1) after a slight dilation of size μ/κ, so
//! that displacement gradients are about 0.4, F is nearly isochoric for every κ/μ, and the pressure κ ln J is smooth
//! and of the size of μ. The load is ∫ P(F_exact) : ∇N dV by quadrature of much higher degree: the weak form of the
//! exact solution, so that no divergence of P is needed.

mod common;

use common::fine_quadrature::{displacement_errors, fine_quadrature, integrate};
use common::{Matrix, Vector, cube, determinant, multiply, ogden, tight, unit_block};
use lambdak::fem::{Equilibrium, ForwardModel, QuadraturePoint};
use lambdak::material::{Material, first_piola_kirchhoff_stress};
use lambdak::mesh::ElementKind;
use std::fmt::Write;

/// Position and deformation gradient; `compliance` = μ/κ scales the dilation.
fn deformation(x: &Vector, compliance: f64) -> (Vector, Matrix) {
    let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut p = *x;
    let mut f = unit;
    let a = compliance;
    // Dilation: x_i += μ/κ · sin(2 x_i + x_j)/2 …
    let mut g = unit;
    for i in 0..3 {
        let j = (i + 1) % 3;
        let phase = 2.0 * x[i] + x[j];
        p[i] += 0.5 * a * phase.sin();
        g[i][i] += a * phase.cos();
        g[i][j] += 0.5 * a * phase.cos();
    }
    f = multiply(&g, &f);
    // … then shears: component i moves with a function of one other coordinate.
    for (i, j, amplitude, wave) in [(0, 1, 0.15, 2.5), (1, 2, 0.12, 3.0), (2, 0, -0.14, 2.8)] {
        let mut g = unit;
        g[i][j] = amplitude * wave * (wave * p[j]).cos();
        p[i] += amplitude * (wave * p[j]).sin();
        f = multiply(&g, &f);
    }
    (p, f)
}

/// Errors of displacement, of its gradient and of the pressure κ ln J / J over the shear modulus, L2.
fn errors(kind: ElementKind, n: usize, material: &Material, compliance: f64, is_curved: bool) -> [f64; 3] {
    let curve = |p: Vector| {
        let s = |v: f64| (std::f64::consts::PI * v).sin();
        [p[0] + 0.06 * s(2.0 * p[1]) * s(p[2]), p[1] - 0.07 * s(2.0 * p[0]), p[2] + 0.05 * s(p[0]) * s(2.0 * p[1])]
    };
    let mesh = cube(kind, n, |p| if is_curved { curve(p) } else { p });
    let exact: Vec<Vector> = mesh
        .nodes
        .iter()
        .map(|x| {
            let (p, _) = deformation(x, compliance);
            [0, 1, 2].map(|i| p[i] - x[i])
        })
        .collect();
    let mut load = vec![[0.0; 3]; mesh.nodes.len()];
    integrate(&mesh, |e, x, w, _, gradient| {
        let stress = first_piola_kirchhoff_stress(material, &deformation(&x, compliance).1);
        for (&v, g) in mesh.element(e).iter().zip(gradient) {
            for i in 0..3 {
                load[v as usize][i] += w * (0..3).map(|j| stress[i][j] * g[j]).sum::<f64>();
            }
        }
    });
    let mut model = ForwardModel::new(mesh.clone(), &unit_block()).unwrap();
    // Rounding of κ ln J leaves a relative residual of 1e-9 at κ/μ = 10⁴; errors here are above 1e-5.
    let options = lambdak::fem::SolveOptions { tolerance: 1e-7, ..tight() };
    let found = model.solve_prescribed(material, &exact, Some(&load), &options).unwrap();
    let [u, gradient] = displacement_errors(&mesh, &found, |x| deformation(x, compliance));
    [u, gradient, pressure_error(&model, material, &found, compliance)]
}

/// Error of the pressure (the mean Cauchy stress) over the shear modulus, L2 by the quadrature of the elements.
fn pressure_error(model: &ForwardModel, material: &Material, found: &Equilibrium, compliance: f64) -> f64 {
    let square = |point: &QuadraturePoint| {
        let trace: f64 = (0..3).map(|i| point.cauchy_stress[i][i]).sum();
        let jacobian = determinant(&deformation(&point.position, compliance).1);
        point.volume_mm3 * (trace / 3.0 - material.bulk_kpa * jacobian.ln() / jacobian).powi(2)
    };
    let sum: f64 = model.quadrature_fields(material, found).iter().map(square).sum();
    sum.sqrt() / material.initial_shear_modulus_kpa()
}

#[test]
fn the_deformation_is_what_it_says() {
    let x = [0.3, 0.7, 0.45];
    let (_, f) = deformation(&x, 1e-3);
    for j in 0..3 {
        let h = 1e-5;
        let (mut a, mut b) = (x, x);
        a[j] += h;
        b[j] -= h;
        let (p, m) = (deformation(&a, 1e-3).0, deformation(&b, 1e-3).0);
        for i in 0..3 {
            // Central differences: third derivatives ≤ 5, times h²/6.
            assert!(((p[i] - m[i]) / (2.0 * h) - f[i][j]).abs() < 1e-9);
        }
    }
    assert!((determinant(&f) - 1.0).abs() < 5e-3);
    let volume: f64 = fine_quadrature(ElementKind::Prism21).iter().map(|q| q.1).sum();
    assert!((volume - 1.0).abs() < 1e-13);
}

/// Full order: 3 in displacement, 2 in its gradient and in the pressure, the same from κ/μ = 5 to 10⁴, on straight and
/// on curved elements.
#[test]
fn elements_have_their_full_order() {
    let stored = include_str!("data/manufactured.txt");
    let shear = 0.5 * (16.0 * 1.9 + 0.35 * 8.0);
    let meshes = [2, 4, 6];
    let mut table =
        String::from("element kappa/mu shape cells error_u error_gradient error_p order_u order_gradient order_p\n");
    let mut failures = Vec::new();
    for kind in [ElementKind::Hex27, ElementKind::Prism21] {
        for ratio in [5.0, 130.0, 1e4] {
            for is_curved in [false, true] {
                let material = ogden(ratio * shear, &[(16.0, 1.9), (0.35, 8.0)]);
                let shape = if is_curved { "curved" } else { "straight" };
                let mut before: Option<(usize, [f64; 3])> = None;
                for n in meshes {
                    let now = errors(kind, n, &material, 1.0 / ratio, is_curved);
                    let order = before
                        .map(|(m, e)| [0, 1, 2].map(|k: usize| (e[k] / now[k]).ln() / (n as f64 / m as f64).ln()));
                    let text = order.map_or("- - -".into(), |o| format!("{:.2} {:.2} {:.2}", o[0], o[1], o[2]));
                    let [u, gradient, pressure] = now;
                    let line = format!("{kind:?} {ratio} {shape} {n} {u:.4e} {gradient:.4e} {pressure:.4e} {text}");
                    println!("{line}");
                    writeln!(table, "{line}").unwrap();
                    if n == meshes[2] {
                        // On curved prisms the pressure comes near its order more slowly than all others do.
                        let [u, gradient, pressure] = order.unwrap();
                        if u < 2.8 || gradient < 1.85 || pressure < 1.7 {
                            failures.push(line);
                        }
                    }
                    before = Some((n, now));
                }
            }
        }
    }
    assert!(failures.is_empty(), "below full order:\n{}", failures.join("\n"));
    // The stored table is reviewed; another machine rounds differently, and nothing else may change by 2 %.
    for (new, old) in table.lines().zip(stored.lines()).skip(1) {
        let (new, old): (Vec<_>, Vec<_>) = (new.split(' ').collect(), old.split(' ').collect());
        assert_eq!(new[..4], old[..4]);
        for k in 4..7 {
            let (a, b): (f64, f64) = (new[k].parse().unwrap(), old[k].parse().unwrap());
            assert!((a - b).abs() < 0.02 * b, "{new:?}, stored: {old:?}");
        }
    }
    assert_eq!(table.lines().count(), stored.lines().count(), "new table:\n{table}");
}
