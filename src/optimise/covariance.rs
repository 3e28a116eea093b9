//! The covariance of fitted parameters.

use nalgebra::DMatrix;

/// Covariance of the parameters, s² (JᵀJ)⁻¹ in the directions that the data determine, and for every parameter whether
/// they do. A direction counts as undetermined where its scaled singular value is below `cutoff` of the largest.
pub fn covariance(jacobian: &DMatrix<f64>, variance: f64, cutoff: f64) -> (DMatrix<f64>, Vec<bool>) {
    let n = jacobian.ncols();
    let root: Vec<f64> = (0..n).map(|i| jacobian.column(i).norm()).collect();
    let scale = |i: usize| if root[i] > 0.0 { root[i] } else { 1.0 };
    let scaled = DMatrix::from_fn(n, n, |a, b| jacobian.column(a).dot(&jacobian.column(b)) / (scale(a) * scale(b)));
    let eigen = scaled.symmetric_eigen();
    let limit = cutoff * cutoff * eigen.eigenvalues.amax();
    let mut matrix = DMatrix::zeros(n, n);
    let mut is_determined: Vec<bool> = root.iter().map(|r| *r > 0.0).collect();
    for k in 0..n {
        let (value, vector) = (eigen.eigenvalues[k], eigen.eigenvectors.column(k));
        if value > limit {
            matrix += vector * vector.transpose() * (variance / value);
        } else {
            for i in 0..n {
                // A parameter with a tenth of the direction's length is not determined either.
                is_determined[i] &= vector[i].abs() < 0.1;
            }
        }
    }
    (DMatrix::from_fn(n, n, |a, b| matrix[(a, b)] / (scale(a) * scale(b))), is_determined)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A column that repeats another one: both are undetermined, the third is not.
    #[test]
    fn undetermined_directions_are_named() {
        let j = DMatrix::from_row_slice(3, 3, &[1.0, 2.0, 0.0, 1.0, 2.0, 1.0, 2.0, 4.0, -1.0]);
        let (c, is_determined) = covariance(&j, 1.0, 1e-7);
        assert_eq!(is_determined, [false, false, true]);
        // Normal equations without the repeated column: [[6, -1], [-1, 2]], inverse entry 6/11.
        assert!((c[(2, 2)] - 6.0 / 11.0).abs() < 1e-12);
    }
}
