//! Lifting: how a change of what the plates impose is carried into the sample, as the first guess of a load step.
//!
//! Were the plates' nodes moved alone, the elements next to them would take the whole change, and Newton's method would
//! start from elements that are all but inverted. What the plates still lack of where they are to be is carried through
//! the sample linearly instead: all of it at its plate, nothing at the other. A plate's rigid motion, by any angle, is
//! affine in the position, so that the whole of it is carried; of a face's own displacement it is the best affine part.

use nalgebra::{Matrix2, Vector2};

/// An affine map of the plane of a plate into displacements, mm.
pub(super) struct AffineMap {
    center: [f64; 2],
    at_center: [f64; 3],
    /// Derivatives of each component with respect to the two coordinates.
    slope: [[f64; 2]; 3],
}

impl AffineMap {
    /// The best fit by least squares to `values` (mm) at `points` of the plane (mm); `None` where there is nothing to
    /// carry. Of points on one line only the mean is carried.
    pub(super) fn fitted(points: &[[f64; 2]], values: &[[f64; 3]]) -> Option<AffineMap> {
        if !values.iter().flatten().any(|v| v.abs() > 0.0) {
            return None;
        }
        let num = points.len() as f64;
        let mut center = [0.0; 2];
        let mut at_center = [0.0; 3];
        for (x, u) in points.iter().zip(values) {
            center.iter_mut().zip(x).for_each(|(c, x)| *c += x / num);
            at_center.iter_mut().zip(u).for_each(|(c, u)| *c += u / num);
        }
        let mut moments = Matrix2::<f64>::zeros();
        let mut right = [Vector2::<f64>::zeros(); 3];
        for (x, u) in points.iter().zip(values) {
            let x = Vector2::new(x[0] - center[0], x[1] - center[1]);
            moments += x * x.transpose();
            for (right, (u, mean)) in right.iter_mut().zip(u.iter().zip(at_center)) {
                *right += x * (u - mean);
            }
        }
        let inverse = moments.try_inverse().filter(|_| is_well_posed(&moments)).unwrap_or_default();
        let slope = right.map(|r| (inverse * r).into());
        Some(AffineMap { center, at_center, slope })
    }

    /// The displacement (mm) at a point of the plane (mm).
    pub(super) fn at(&self, x: [f64; 2]) -> [f64; 3] {
        let [a, b] = [x[0] - self.center[0], x[1] - self.center[1]];
        let mut u = self.at_center;
        for (u, slope) in u.iter_mut().zip(&self.slope) {
            *u += slope[0] * a + slope[1] * b;
        }
        u
    }
}

/// Whether points of these second moments span a plane, not a line.
fn is_well_posed(moments: &Matrix2<f64>) -> bool {
    moments.determinant() > 1e-9 * moments.trace().powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate turned by a right angle is carried whole; a constant is carried from points on a line.
    #[test]
    fn rigid_motions_are_affine() {
        let points = [[0.0, 0.0], [3.0, 0.5], [-1.0, 2.0], [2.0, -4.0]];
        let turned = |x: [f64; 2]| [0.2 - x[0] - x[1], 0.1, x[0] - x[1]];
        let map = AffineMap::fitted(&points, &points.map(turned)).unwrap();
        for x in [[5.0, 1.0], [-3.0, -2.0]] {
            for (found, asked) in map.at(x).iter().zip(turned(x)) {
                assert!((found - asked).abs() < 1e-12, "{found} {asked}");
            }
        }
        let on_line = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]];
        let map = AffineMap::fitted(&on_line, &[[0.0, 0.3, 0.0]; 3]).unwrap();
        assert!((map.at([7.0, 5.0])[1] - 0.3).abs() < 1e-12);
        assert!(AffineMap::fitted(&on_line, &[[0.0; 3]; 3]).is_none());
    }
}
