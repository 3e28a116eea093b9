//! Integrals over meshes and lines by quadrature of a much higher degree than the elements use.

use super::{Matrix, Vector, determinant, inverse};
use lambdak::fem::Equilibrium;
use lambdak::mesh::{ElementKind, Mesh};

/// Gauss–Legendre points and weights on [−1, 1] by Newton's method on the Legendre polynomial.
pub fn gauss(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..60 {
                let (mut p0, mut p1) = (1.0, x);
                for k in 2..=n {
                    let k = k as f64;
                    (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
                }
                slope = n as f64 * (x * p1 - p0) / (x * x - 1.0);
                x -= p1 / slope;
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Five Gauss points per direction (triangles by the collapsed square).
pub fn fine_quadrature(kind: ElementKind) -> Vec<(Vector, f64)> {
    let line = gauss(5);
    let mut points = Vec::new();
    for &(z, wz) in &line {
        for &(y, wy) in &line {
            for &(x, wx) in &line {
                let w = wx * wy * wz;
                points.push(match kind {
                    ElementKind::Hex27 => ([x, y, z], w),
                    ElementKind::Prism21 => {
                        let (s, t) = (0.5 * (1.0 + x), 0.5 * (1.0 + y));
                        ([s, t * (1.0 - s), z], 0.25 * w * (1.0 - s))
                    }
                });
            }
        }
    }
    points
}

/// Calls `work(element, position, weight, N, ∇N)` at every fine quadrature point.
pub fn integrate(mesh: &Mesh, mut work: impl FnMut(usize, Vector, f64, &[f64; 27], &[Vector])) {
    let kind = mesh.element_kind;
    let n = kind.num_nodes();
    let tables: Vec<_> =
        fine_quadrature(kind).into_iter().map(|(x, w)| (kind.shape_functions(x), kind.shape_gradients(x), w)).collect();
    for e in 0..mesh.num_elements() {
        let nodes = mesh.element(e);
        for (shape, gradient, w) in &tables {
            let (mut position, mut map) = ([0.0; 3], [[0.0; 3]; 3]);
            for a in 0..n {
                let x = mesh.nodes[nodes[a] as usize];
                for i in 0..3 {
                    position[i] += shape[a] * x[i];
                    for c in 0..3 {
                        map[i][c] += x[i] * gradient[a][c];
                    }
                }
            }
            let back = inverse(&map);
            let physical: Vec<Vector> =
                (0..n).map(|a| [0, 1, 2].map(|j| (0..3).map(|c| gradient[a][c] * back[c][j]).sum())).collect();
            work(e, position, w * determinant(&map), shape, &physical);
        }
    }
}

/// Errors of the displacement and of its gradient in L2, where `exact` gives the position (mm) and F of a reference
/// position.
pub fn displacement_errors(mesh: &Mesh, found: &Equilibrium, exact: impl Fn(&Vector) -> (Vector, Matrix)) -> [f64; 2] {
    let mut sums = [0.0; 2];
    integrate(mesh, |e, x, w, shape, gradient| {
        let (p, f) = exact(&x);
        for i in 0..3 {
            let (mut u, mut slope) = (0.0, [0.0; 3]);
            for (a, &v) in mesh.element(e).iter().enumerate() {
                let nodal = found.displacement[v as usize][i];
                u += shape[a] * nodal;
                for j in 0..3 {
                    slope[j] += gradient[a][j] * nodal;
                }
            }
            sums[0] += w * (u - p[i] + x[i]).powi(2);
            for j in 0..3 {
                sums[1] += w * (slope[j] - f[i][j] + if i == j { 1.0 } else { 0.0 }).powi(2);
            }
        }
    });
    sums.map(f64::sqrt)
}
