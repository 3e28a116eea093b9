//! Patch test: distorted elements reproduce a homogeneous deformation and its stress.

mod common;

use common::{Matrix, Random, Vector, cube, determinant, ogden, tight, unit_block};
use lambdak::fem::ForwardModel;
use lambdak::material::{Material, first_piola_kirchhoff_stress};
use lambdak::mesh::ElementKind;

/// Stretch, shear and rotation, then almost the largest shear in use; the volume changes by `dilation`.
fn gradients(dilation: f64) -> Vec<Matrix> {
    let base: [Matrix; 2] = [
        [[1.3, 0.4, -0.2], [-0.15, 0.9, 0.25], [0.05, -0.3, 1.1]],
        [[1.0, 1.4, 0.0], [0.0, 1.0, 0.1], [0.0, 0.0, 1.0]],
    ];
    base.iter()
        .map(|f| {
            let scale = ((1.0 + dilation) / determinant(f)).cbrt();
            f.map(|row| row.map(|x| x * scale))
        })
        .collect()
}

fn apply(f: &Matrix, x: &Vector) -> Vector {
    [0, 1, 2].map(|i| (0..3).map(|j| f[i][j] * x[j]).sum::<f64>() - x[i])
}

fn check(kind: ElementKind, material: &Material, f: &Matrix) {
    let mut random = Random::new(7);
    // Every node moves by up to 12 % of an element's edge, those in the middle of edges and faces included.
    let shift = 0.12 / 2.0;
    let mut moves = std::collections::HashMap::new();
    let positions = cube(kind, 2, |p| p);
    for p in &positions.nodes {
        let key = p.map(|v| (v * 1e6).round() as i64);
        let by = [(); 3].map(|()| random.between(-0.5, 0.5) * shift);
        moves.insert(key, [0, 1, 2].map(|i| p[i] + by[i]));
    }
    let mesh = cube(kind, 2, |p| moves.get(&p.map(|v| (v * 1e6).round() as i64)).copied().unwrap_or(p));
    let exact: Vec<Vector> = mesh.nodes.iter().map(|x| apply(f, x)).collect();
    // The start is wrong by up to 1 % of an element in the interior.
    let mut guess = exact.clone();
    for (v, u) in guess.iter_mut().enumerate() {
        if !mesh.fixed_nodes.contains(&(v as u32)) {
            *u = u.map(|x| x + random.between(-0.005, 0.005));
        }
    }
    let mut model = ForwardModel::new(mesh, &unit_block()).unwrap();
    let found = model.solve_prescribed(material, &guess, None, &tight()).unwrap();
    for (u, v) in found.displacement.iter().zip(&exact) {
        for i in 0..3 {
            // Rounding of κ ln J, 1e-16 κ/μ ≤ 1e-12, grows by the condition of the system.
            assert!((u[i] - v[i]).abs() < 1e-9, "{kind:?} {material:?}: {u:?} {v:?}");
        }
    }
    let stress = first_piola_kirchhoff_stress(material, f);
    let j = determinant(f);
    let cauchy: Matrix = [0, 1, 2].map(|i| [0, 1, 2].map(|k| (0..3).map(|c| stress[i][c] * f[k][c]).sum::<f64>() / j));
    let points = model.quadrature_fields(material, &found);
    let volume: f64 = points.iter().map(|p| p.volume_mm3).sum();
    assert!(volume > 0.8 && volume < 1.2);
    for point in points {
        for i in 0..3 {
            for k in 0..3 {
                assert!((point.deformation_gradient[i][k] - f[i][k]).abs() < 1e-8);
                // The pressure amplifies an error of J by κ: 1e-9 × 10 gradients per mm × κ is the worst allowed above.
                assert!(
                    (point.cauchy_stress[i][k] - cauchy[i][k]).abs() < 1e-9 * material.bulk_kpa,
                    "{kind:?} {material:?}: {:?} {cauchy:?}",
                    point.cauchy_stress
                );
            }
        }
    }
}

#[test]
fn homogeneous_deformations_are_exact() {
    for kind in [ElementKind::Hex27, ElementKind::Prism21] {
        for ratio in [5.0, 130.0, 1e4] {
            let shear = 0.5 * (16.0 * 1.9 + 0.35 * 8.0);
            let material = ogden(ratio * shear, &[(16.0, 1.9), (0.35, 8.0)]);
            // The pressure is a quarter of the shear modulus, up to a volume change of 5 %.
            for f in gradients(0.25 / ratio) {
                check(kind, &material, &f);
            }
        }
    }
}
