//! The two elements: shape functions, their gradients and quadrature.

/// A quadratic element extruded from a section cell.
///
/// Reference coordinates (ξ, η, ζ): (ξ, η) in the section, ζ ∈ [−1, 1] along the extrusion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ElementKind {
    /// 27-node hexahedron, ξ, η, ζ ∈ [−1, 1]; node `i + 3j + 9k` sits at (i − 1, j − 1, k − 1).
    Hex27,
    /// 21-node prism: 7-node triangle (P2 + cubic bubble) × 3 levels; node `s + 7k` at ζ = k − 1, where s = 0, 1, 2
    /// are the corners (0,0), (1,0), (0,1); s = 3, 4, 5 the middles of the edges 01, 12, 20; s = 6 the centroid (⅓, ⅓).
    Prism21,
}

impl ElementKind {
    /// Number of displacement nodes.
    pub fn num_nodes(self) -> usize {
        match self {
            ElementKind::Hex27 => 27,
            ElementKind::Prism21 => 21,
        }
    }

    /// Shape functions at `reference_coordinates`; entries past [`Self::num_nodes`] are zero. They sum to 1.
    pub fn shape_functions(self, reference_coordinates: [f64; 3]) -> [f64; 27] {
        let [xi, eta, zeta] = reference_coordinates;
        let (c, _) = lagrange(zeta);
        let mut n = [0.0; 27];
        match self {
            ElementKind::Hex27 => {
                let (a, _) = lagrange(xi);
                let (b, _) = lagrange(eta);
                for k in 0..3 {
                    for j in 0..3 {
                        for i in 0..3 {
                            n[i + 3 * j + 9 * k] = a[i] * b[j] * c[k];
                        }
                    }
                }
            }
            ElementKind::Prism21 => {
                let (t, _) = triangle(xi, eta);
                for k in 0..3 {
                    for s in 0..7 {
                        n[s + 7 * k] = t[s] * c[k];
                    }
                }
            }
        }
        n
    }

    /// Derivatives of the shape functions with respect to (ξ, η, ζ), `[node][coordinate]`.
    pub fn shape_gradients(self, reference_coordinates: [f64; 3]) -> [[f64; 3]; 27] {
        let [xi, eta, zeta] = reference_coordinates;
        let (c, dc) = lagrange(zeta);
        let mut g = [[0.0; 3]; 27];
        match self {
            ElementKind::Hex27 => {
                let (a, da) = lagrange(xi);
                let (b, db) = lagrange(eta);
                for k in 0..3 {
                    for j in 0..3 {
                        for i in 0..3 {
                            g[i + 3 * j + 9 * k] = [da[i] * b[j] * c[k], a[i] * db[j] * c[k], a[i] * b[j] * dc[k]];
                        }
                    }
                }
            }
            ElementKind::Prism21 => {
                let (t, dt) = triangle(xi, eta);
                for k in 0..3 {
                    for s in 0..7 {
                        g[s + 7 * k] = [dt[s][0] * c[k], dt[s][1] * c[k], t[s] * dc[k]];
                    }
                }
            }
        }
        g
    }

    /// Reference coordinates of the nodes.
    pub fn node_coordinates(self) -> Vec<[f64; 3]> {
        let section: Vec<[f64; 2]> = match self {
            ElementKind::Hex27 => (0..9).map(|n| [f64::from(n % 3) - 1.0, f64::from(n / 3) - 1.0]).collect(),
            ElementKind::Prism21 => {
                let third = 1.0 / 3.0;
                vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5], [third, third]]
            }
        };
        (0..3).flat_map(|k| section.iter().map(move |p| [p[0], p[1], f64::from(k) - 1.0])).collect()
    }

    /// Local nodes of each face: first the two ends of the extrusion (ζ = −1, ζ = 1), then the sides.
    pub fn faces(self) -> Vec<Vec<usize>> {
        let per_level = self.num_nodes() / 3;
        let sides: Vec<[usize; 3]> = match self {
            ElementKind::Hex27 => vec![[0, 1, 2], [2, 5, 8], [8, 7, 6], [6, 3, 0]],
            ElementKind::Prism21 => vec![[0, 3, 1], [1, 4, 2], [2, 5, 0]],
        };
        let ends = [0, 2].map(|k| (k * per_level..(k + 1) * per_level).collect());
        let walls = sides.iter().map(|s| (0..3).flat_map(|k| s.map(|n| n + k * per_level)).collect());
        ends.into_iter().chain(walls).collect()
    }

    /// Quadrature points and weights in reference coordinates: 3×3×3 Gauss points for the hexahedron (degree 5 in each
    /// coordinate), Radon's 7-point rule (degree 5) × 3 Gauss points for the prism.
    pub fn quadrature(self) -> Vec<([f64; 3], f64)> {
        let g = 0.6f64.sqrt();
        let line = [(-g, 5.0 / 9.0), (0.0, 8.0 / 9.0), (g, 5.0 / 9.0)];
        let mut points = Vec::new();
        match self {
            ElementKind::Hex27 => {
                for (z, wz) in line {
                    for (y, wy) in line {
                        for (x, wx) in line {
                            points.push(([x, y, z], wx * wy * wz));
                        }
                    }
                }
            }
            ElementKind::Prism21 => {
                let s = 15.0f64.sqrt();
                let mut section = vec![([1.0 / 3.0, 1.0 / 3.0], 9.0 / 80.0)];
                for (a, w) in [((6.0 - s) / 21.0, (155.0 - s) / 2400.0), ((6.0 + s) / 21.0, (155.0 + s) / 2400.0)] {
                    section.extend([([a, a], w), ([1.0 - 2.0 * a, a], w), ([a, 1.0 - 2.0 * a], w)]);
                }
                for (z, wz) in line {
                    for &([x, y], w) in &section {
                        points.push(([x, y, z], w * wz));
                    }
                }
            }
        }
        points
    }
}

/// Section shape functions and gradients at (ξ, η): the first 9 or 7 entries.
pub(super) fn section_shape(kind: ElementKind, [xi, eta]: [f64; 2]) -> ([f64; 9], [[f64; 2]; 9]) {
    let (mut n, mut g) = ([0.0; 9], [[0.0; 2]; 9]);
    match kind {
        ElementKind::Hex27 => {
            let ((a, da), (b, db)) = (lagrange(xi), lagrange(eta));
            for j in 0..3 {
                for i in 0..3 {
                    n[i + 3 * j] = a[i] * b[j];
                    g[i + 3 * j] = [da[i] * b[j], a[i] * db[j]];
                }
            }
        }
        ElementKind::Prism21 => {
            let (t, dt) = triangle(xi, eta);
            n[..7].copy_from_slice(&t);
            g[..7].copy_from_slice(&dt);
        }
    }
    (n, g)
}

/// Quadratic Lagrange polynomials at −1, 0, 1 and their derivatives.
pub(super) fn lagrange(x: f64) -> ([f64; 3], [f64; 3]) {
    ([0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)], [x - 0.5, -2.0 * x, x + 0.5])
}

/// P2 + bubble on the unit triangle and its gradient. The bubble is subtracted from the P2 functions so that all seven
/// are nodal: N_corner = L(2L − 1) + 3b, N_middle = 4LL' − 12b, N_centre = 27b with b = L₀L₁L₂.
fn triangle(x: f64, y: f64) -> ([f64; 7], [[f64; 2]; 7]) {
    let l = [1.0 - x - y, x, y];
    let dl = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
    let b = l[0] * l[1] * l[2];
    let mut db = [0.0; 2];
    for c in 0..2 {
        db[c] = dl[0][c] * l[1] * l[2] + l[0] * dl[1][c] * l[2] + l[0] * l[1] * dl[2][c];
    }
    let (mut n, mut g) = ([0.0; 7], [[0.0; 2]; 7]);
    for s in 0..3 {
        let e = (s + 1) % 3;
        n[s] = l[s] * (2.0 * l[s] - 1.0) + 3.0 * b;
        n[3 + s] = 4.0 * l[s] * l[e] - 12.0 * b;
        for c in 0..2 {
            g[s][c] = (4.0 * l[s] - 1.0) * dl[s][c] + 3.0 * db[c];
            g[3 + s][c] = 4.0 * (dl[s][c] * l[e] + l[s] * dl[e][c]) - 12.0 * db[c];
        }
    }
    n[6] = 27.0 * b;
    g[6] = [27.0 * db[0], 27.0 * db[1]];
    (n, g)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Partition of unity, gradients by central differences, nodal property and the exact volume of the reference cell.
    #[test]
    fn shape_functions_are_consistent() {
        for kind in [ElementKind::Hex27, ElementKind::Prism21] {
            let volume: f64 = kind.quadrature().iter().map(|q| q.1).sum();
            assert!((volume - if kind == ElementKind::Hex27 { 8.0 } else { 1.0 }).abs() < 1e-14);
            for (x, _) in kind.quadrature() {
                let n = kind.shape_functions(x);
                assert!((n.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                let g = kind.shape_gradients(x);
                for c in 0..3 {
                    let h = 1e-5;
                    let (mut p, mut m) = (x, x);
                    p[c] += h;
                    m[c] -= h;
                    let (np, nm) = (kind.shape_functions(p), kind.shape_functions(m));
                    for a in 0..27 {
                        // Third derivatives are below 60, so central differences err by 60 h²/6 = 1e-9.
                        assert!(((np[a] - nm[a]) / (2.0 * h) - g[a][c]).abs() < 2e-9);
                    }
                }
            }
        }
    }
    /// Each shape function is 1 at its own node and 0 at the others; a face's nodes lie on one side of the cell.
    #[test]
    fn nodes_and_faces_are_consistent() {
        for kind in [ElementKind::Hex27, ElementKind::Prism21] {
            let nodes = kind.node_coordinates();
            for (a, &x) in nodes.iter().enumerate() {
                for (b, n) in kind.shape_functions(x).iter().enumerate() {
                    assert!((n - if a == b { 1.0 } else { 0.0 }).abs() < 1e-14);
                }
            }
            for face in kind.faces() {
                // All cross products of the face's edges with its plane vanish: rank of the differences is 2.
                let [p, q] = [nodes[face[0]], nodes[*face.last().unwrap()]];
                let r = nodes[face[if face.len() == 9 { 2 } else { 1 }]];
                let d = |x: [f64; 3]| [x[0] - p[0], x[1] - p[1], x[2] - p[2]];
                let (u, v) = (d(q), d(r));
                let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
                assert!(normal.iter().any(|n| n.abs() > 0.1));
                for &n in &face {
                    let w = d(nodes[n]);
                    assert!((w[0] * normal[0] + w[1] * normal[1] + w[2] * normal[2]).abs() < 1e-14);
                }
            }
        }
    }
}
