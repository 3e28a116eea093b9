//! Principal stretches as singular values of the deformation gradient.

use super::Tensor;

/// det F.
pub fn determinant(tensor: &Tensor) -> f64 {
    let [a, b, c] = tensor;
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// Inverse of a tensor; none where its determinant is zero, subnormal or not finite.
pub fn inverse(tensor: &Tensor) -> Option<Tensor> {
    let determinant = determinant(tensor);
    if !determinant.is_normal() {
        return None;
    }
    let mut inverse = [[0.0; 3]; 3];
    for (i, row) in inverse.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            let (a, b, c, d) = ((j + 1) % 3, (j + 2) % 3, (i + 1) % 3, (i + 2) % 3);
            *entry = (tensor[a][c] * tensor[b][d] - tensor[a][d] * tensor[b][c]) / determinant;
        }
    }
    Some(inverse)
}

/// Principal stretches λ₁ ≥ λ₂ ≥ λ₃ ≥ 0: the singular values of F.
///
/// One-sided Jacobi: columns of F are rotated in pairs until they are orthogonal; their lengths are then the singular
/// values. C = FᵀF is never squared into existence, so small stretches keep full relative accuracy, and repeated
/// stretches need no special case. Entries that are not finite give NaN.
pub fn principal_stretches(deformation_gradient: &Tensor) -> [f64; 3] {
    if deformation_gradient.iter().flatten().any(|x| !x.is_finite()) {
        return [f64::NAN; 3];
    }
    let f = deformation_gradient;
    let mut columns = [0, 1, 2].map(|j| [f[0][j], f[1][j], f[2][j]]);
    // Convergence is quadratic: 3x3 matrices need three to five sweeps; the limit only guards against rounding cycles.
    for _ in 0..20 {
        let mut is_orthogonal = true;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (a, b, c) = (dot(columns[p], columns[p]), dot(columns[q], columns[q]), dot(columns[p], columns[q]));
            if c.abs() <= f64::EPSILON * (a * b).sqrt() {
                continue;
            }
            is_orthogonal = false;
            let zeta = (b - a) / (2.0 * c);
            let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
            let cosine = 1.0 / (1.0 + t * t).sqrt();
            let sine = cosine * t;
            for i in 0..3 {
                let (x, y) = (columns[p][i], columns[q][i]);
                columns[p][i] = cosine * x - sine * y;
                columns[q][i] = sine * x + cosine * y;
            }
        }
        if is_orthogonal {
            break;
        }
    }
    let mut stretches = columns.map(|c| dot(c, c).sqrt());
    stretches.sort_by(|x, y| y.total_cmp(x));
    stretches
}

/// Isochoric principal stretches λ̄ᵢ = J^(−1/3) λᵢ, largest first. NaN where J ≤ 0 or F is not finite.
pub fn isochoric_principal_stretches(deformation_gradient: &Tensor) -> [f64; 3] {
    let jacobian = determinant(deformation_gradient);
    if jacobian.is_nan() || jacobian <= 0.0 {
        return [f64::NAN; 3];
    }
    let stretches = principal_stretches(deformation_gradient);
    // The product of the stretches is J to rounding; taking it from them makes the three exactly consistent.
    let scale = (stretches[0] * stretches[1] * stretches[2]).cbrt();
    stretches.map(|s| s / scale)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Rotation about `axis` (normalised here) by `angle`, Rodrigues' formula.
    pub(crate) fn rotation(axis: [f64; 3], angle: f64) -> Tensor {
        let norm = dot(axis, axis).sqrt();
        let [x, y, z] = axis.map(|a| a / norm);
        let (s, c) = angle.sin_cos();
        let v = 1.0 - c;
        [
            [c + x * x * v, x * y * v - z * s, x * z * v + y * s],
            [x * y * v + z * s, c + y * y * v, y * z * v - x * s],
            [x * z * v - y * s, y * z * v + x * s, c + z * z * v],
        ]
    }

    pub(crate) fn product(a: &Tensor, b: &Tensor) -> Tensor {
        let mut c = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                c[i][j] = (0..3).map(|m| a[i][m] * b[m][j]).sum();
            }
        }
        c
    }

    pub(crate) fn diagonal(d: [f64; 3]) -> Tensor {
        [[d[0], 0.0, 0.0], [0.0, d[1], 0.0], [0.0, 0.0, d[2]]]
    }

    /// F = R diag(d) Q has the stretches d, also when they are repeated or nearly so, or far apart.
    #[test]
    fn rotated_diagonals_give_back_their_stretches() {
        let cases = [
            [1.0, 1.0, 1.0],
            [2.0, 2.0, 0.25],
            [4.0, 0.5, 0.5],
            [1.0 + 1e-9, 1.0, 1.0 - 1e-9],
            [1.3, 1.3 * (1.0 - 1e-13), 0.6],
            [30.0, 1.0, 1e-4],
        ];
        for d in cases {
            for n in 0..12 {
                let t = f64::from(n);
                let f = product(
                    &product(&rotation([1.0, 0.3 * t, -0.7], 0.4 * t), &diagonal(d)),
                    &rotation([t - 4.0, 1.0, 0.2], 1.1 * t + 0.1),
                );
                let s = principal_stretches(&f);
                for i in 0..3 {
                    // Forming F rounds at 4 ulp of its largest entry; the Jacobi sweeps add a few ulp of each value.
                    assert!((s[i] - d[i]).abs() < 8.0 * f64::EPSILON * d[0], "{d:?}: {s:?}");
                }
                let volume = d[0] * d[1] * d[2];
                // Cancellation in the determinant of entries as large as d₁: relative to d₁ d₂ max(d₂, d₃).
                assert!((determinant(&f) - volume).abs() < 1e-14 * d[0] * d[0] * d[0]);
            }
        }
    }

    /// Isochoric stretches do not see a volume change.
    #[test]
    fn isochoric_stretches_ignore_volume() {
        let f = [[1.2, 0.4, 0.0], [0.1, 0.9, -0.2], [0.0, 0.3, 1.1]];
        let scaled = f.map(|row| row.map(|x| 1.7 * x));
        let (a, b) = (isochoric_principal_stretches(&f), isochoric_principal_stretches(&scaled));
        for i in 0..3 {
            // Rounding of a few operations on numbers of order one.
            assert!((a[i] - b[i]).abs() < 1e-14);
        }
        assert!((a[0] * a[1] * a[2] - 1.0).abs() < 1e-14);
    }

    #[test]
    fn inverse_inverts() {
        let f = [[1.2, 0.4, 0.0], [0.1, 0.9, -0.2], [0.0, 0.3, 1.1]];
        let one = product(&f, &inverse(&f).unwrap());
        for i in 0..3 {
            for j in 0..3 {
                // A few operations on numbers of order one.
                assert!((one[i][j] - if i == j { 1.0 } else { 0.0 }).abs() < 1e-15);
            }
        }
        assert_eq!(inverse(&[[1.0; 3]; 3]), None);
    }

    /// Bad input is NaN, never a panic.
    #[test]
    fn inadmissible_gradients_give_nan() {
        assert!(principal_stretches(&[[f64::NAN; 3]; 3])[0].is_nan());
        assert!(principal_stretches(&[[f64::INFINITY; 3]; 3])[0].is_nan());
        assert!(isochoric_principal_stretches(&diagonal([1.0, 1.0, -1.0]))[0].is_nan());
        assert!(isochoric_principal_stretches(&[[0.0; 3]; 3])[0].is_nan());
    }
}
