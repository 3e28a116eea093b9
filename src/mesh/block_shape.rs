//! A block whose six faces are not the planes of the drawing: how far each face lies off, and the smooth map from the
//! drawn to the made block that this makes.
//!
//! A point X of the drawn block comes to x = X + Σ_axes e_i [ (1 − s_i)/2 f_i⁻(X) + (1 + s_i)/2 f_i⁺(X) ], where s_i is
//! X_i in half extents and f_i^± is how far the face across axis i lies off at the low and the high side: a polynomial
//! of fourth degree in the two other coordinates. The map is linear in the coefficients of the polynomials, so that
//! derivatives with respect to them are its terms.

use super::Mesh;
use crate::specimen::Specimen;
use nalgebra::{Matrix3, Vector3};

/// Terms of a face's polynomial: P_i(a) P_j(b) with Legendre polynomials P in the two axes of the face (in order), in
/// half extents, by their degree i + j up to four: 1, a, b, aa, ab, bb, aaa and so on. The first is the mean over the
/// face.
pub const FACE_TERMS: usize = 15;
/// Degrees in a and b of the terms.
const DEGREES: [[usize; 2]; FACE_TERMS] = [
    [0, 0],
    [1, 0],
    [0, 1],
    [2, 0],
    [1, 1],
    [0, 2],
    [3, 0],
    [2, 1],
    [1, 2],
    [0, 3],
    [4, 0],
    [3, 1],
    [2, 2],
    [1, 3],
    [0, 4],
];

/// The letters of a term for names, as `xxz`, where a face has the axes of these letters; none for the mean.
pub fn face_term_name(term: usize, [a, b]: [&str; 2]) -> String {
    let [i, j] = DEGREES[term];
    a.repeat(i) + &b.repeat(j)
}

/// The degree of a term of a face.
pub fn face_term_degree(term: usize) -> usize {
    DEGREES[term][0] + DEGREES[term][1]
}

/// Iterations of the inverse map: the offsets are small against the block, each gains two digits or more.
const INVERSIONS: usize = 12;
/// The inverse map ends where it moves by less than this, mm.
const INVERTED_MM: f64 = 1e-10;

/// How far the faces of a block lie off the drawing, mm along the axis that they lie across.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockShape {
    /// Per axis, side (low, high) and term.
    pub faces_mm: [[[f64; FACE_TERMS]; 2]; 3],
}

impl BlockShape {
    /// Whether the block is that of the drawing.
    pub fn is_nominal(&self) -> bool {
        self.faces_mm.iter().flatten().flatten().all(|c| *c == 0.0)
    }

    /// `factor` × `other` added.
    pub fn plus(&self, factor: f64, other: &BlockShape) -> BlockShape {
        let mut sum = *self;
        for (a, b) in sum.faces_mm.iter_mut().flatten().flatten().zip(other.faces_mm.iter().flatten().flatten()) {
            *a += factor * b;
        }
        sum
    }

    /// How far a point of the drawn block lies off, mm: the map less the identity. Also the velocity of the points as
    /// the coefficients change by `self` per unit of time.
    pub fn offset(&self, half_mm: [f64; 3], x: [f64; 3]) -> [f64; 3] {
        let t = [x[0] / half_mm[0], x[1] / half_mm[1], x[2] / half_mm[2]];
        let polynomials = [legendre(t[0]), legendre(t[1]), legendre(t[2])];
        let mut offset = [0.0; 3];
        for axis in 0..3 {
            let [a, b] = OTHER_AXES[axis];
            let (mut low, mut high) = (0.0, 0.0);
            for n in 0..FACE_TERMS {
                let term = polynomials[a][DEGREES[n][0]] * polynomials[b][DEGREES[n][1]];
                low += self.faces_mm[axis][0][n] * term;
                high += self.faces_mm[axis][1][n] * term;
            }
            offset[axis] = 0.5 * (1.0 - t[axis]) * low + 0.5 * (1.0 + t[axis]) * high;
        }
        offset
    }

    /// ∂x/∂X of the map at a point of the drawn block.
    fn slope(&self, half_mm: [f64; 3], x: [f64; 3]) -> Matrix3<f64> {
        let t = [x[0] / half_mm[0], x[1] / half_mm[1], x[2] / half_mm[2]];
        let polynomials = [legendre(t[0]), legendre(t[1]), legendre(t[2])];
        let rates = [legendre_rates(t[0]), legendre_rates(t[1]), legendre_rates(t[2])];
        let mut slope = Matrix3::identity();
        for axis in 0..3 {
            let [a, b] = OTHER_AXES[axis];
            let (mut along, mut along_a, mut along_b) = (0.0, 0.0, 0.0);
            for n in 0..FACE_TERMS {
                let [i, j] = DEGREES[n];
                let [low, high] = [self.faces_mm[axis][0][n], self.faces_mm[axis][1][n]];
                let between = 0.5 * (1.0 - t[axis]) * low + 0.5 * (1.0 + t[axis]) * high;
                along += 0.5 * (high - low) * (polynomials[a][i] * polynomials[b][j]);
                along_a += between * (rates[a][i] * polynomials[b][j]);
                along_b += between * (polynomials[a][i] * rates[b][j]);
            }
            slope[(axis, axis)] += along / half_mm[axis];
            slope[(axis, a)] += along_a / half_mm[a];
            slope[(axis, b)] += along_b / half_mm[b];
        }
        slope
    }

    /// The way back from the made to the drawn block.
    pub fn inverse(&self, half_mm: [f64; 3]) -> BlockInverse {
        BlockInverse { shape: *self, half_mm, is_nominal: self.is_nominal() }
    }
}

/// From points of the made block to those of the drawn one.
#[derive(Clone, Copy, Debug)]
pub struct BlockInverse {
    shape: BlockShape,
    half_mm: [f64; 3],
    is_nominal: bool,
}

impl BlockInverse {
    /// The point of the drawn block that comes to `x`, cut to the block, and ∂X/∂x there; the rows of cut coordinates
    /// are zero, since they do not change with x. What lies beyond a face is thus taken for what the face does.
    pub fn point_of(&self, x: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
        let drawn = if self.is_nominal { x } else { self.solved(x) };
        let mut cut = [0.0; 3];
        for i in 0..3 {
            cut[i] = drawn[i].clamp(-self.half_mm[i], self.half_mm[i]);
        }
        let mut rows = [[0.0; 3]; 3];
        let back = if self.is_nominal { Matrix3::identity() } else { inverse_of(self.shape.slope(self.half_mm, cut)) };
        for i in (0..3).filter(|&i| (cut[i] - drawn[i]).abs() < f64::MIN_POSITIVE) {
            rows[i] = [back[(i, 0)], back[(i, 1)], back[(i, 2)]];
        }
        (cut, rows)
    }

    /// The root of the map by Newton's method with the slope at the start, which the small offsets hardly change.
    fn solved(&self, x: [f64; 3]) -> [f64; 3] {
        // The polynomials grow fast beyond the block.
        let near = |p: [f64; 3]| {
            let mut cut = p;
            for i in 0..3 {
                cut[i] = p[i].clamp(-1.5 * self.half_mm[i], 1.5 * self.half_mm[i]);
            }
            cut
        };
        let back = inverse_of(self.shape.slope(self.half_mm, near(x)));
        let mut drawn = x;
        for _ in 0..INVERSIONS {
            let offset = self.shape.offset(self.half_mm, near(drawn));
            let mut off = Vector3::zeros();
            for i in 0..3 {
                off[i] = drawn[i] + offset[i] - x[i];
            }
            let step = back * off;
            for i in 0..3 {
                drawn[i] -= step[i];
            }
            if step.amax() < INVERTED_MM {
                break;
            }
        }
        drawn
    }
}

/// The inverse; the identity where there is none, as where faces cross.
fn inverse_of(slope: Matrix3<f64>) -> Matrix3<f64> {
    slope.try_inverse().unwrap_or_else(Matrix3::identity)
}

/// Half extents of a specimen's block, mm.
pub fn half_extents_mm(specimen: &Specimen) -> [f64; 3] {
    let b = specimen.block;
    [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm]
}

/// `mesh`, a mesh of the drawn `specimen`, with its nodes where they are in the made block.
pub fn made_mesh(mesh: &Mesh, specimen: &Specimen, shape: &BlockShape) -> Mesh {
    let mut made = mesh.clone();
    if !shape.is_nominal() {
        let half_mm = half_extents_mm(specimen);
        for x in &mut made.nodes {
            let offset = shape.offset(half_mm, *x);
            *x = [0, 1, 2].map(|i| x[i] + offset[i]);
        }
    }
    made
}

/// The two axes of a face across each axis.
const OTHER_AXES: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

/// P₀ to P₄.
fn legendre(t: f64) -> [f64; 5] {
    let s = t * t;
    [1.0, t, 1.5 * s - 0.5, (2.5 * s - 1.5) * t, (4.375 * s - 3.75) * s + 0.375]
}

/// Their derivatives.
fn legendre_rates(t: f64) -> [f64; 5] {
    let s = t * t;
    [0.0, 1.0, 3.0 * t, 7.5 * s - 1.5, (17.5 * s - 7.5) * t]
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF: [f64; 3] = [12.7, 3.2, 9.5];

    fn shape() -> BlockShape {
        let mut shape = BlockShape::default();
        let faces = [
            [vec![0.3, 0.1, -0.2], vec![-0.2, 0.05, 0.1]],
            [
                vec![0.4, 0.1, -0.1, 0.2, 0.05, -0.1, 0.05, -0.03, 0.02, 0.04],
                vec![-0.5, 0.1, 0.2, -0.1, 0.03, 0.1, 0.0, 0.0, 0.0, 0.0, 0.05, -0.02, 0.03, 0.01, -0.04],
            ],
            [vec![0.1, 0.2, 0.1], vec![0.0, -0.1, 0.1]],
        ];
        for (face, terms) in shape.faces_mm.iter_mut().flatten().zip(faces.iter().flatten()) {
            face[..terms.len()].copy_from_slice(terms);
        }
        shape
    }

    /// Faces come to lie where they are said to, and points go there and back.
    #[test]
    fn the_map_goes_there_and_back() {
        let shape = shape();
        // The middle of the moved face: P₂(0) = −1/2, P₄(0) = 3/8.
        let middle = -0.5 - 0.5 * (-0.1 + 0.1) + 0.375 * (0.05 - 0.04) + 0.25 * 0.03;
        assert!((shape.offset(HALF, [0.0, HALF[1], 0.0])[1] - middle).abs() < 1e-15);
        for x in [[3.0, 1.0, -2.0], [-12.0, -3.0, 9.0], [0.0, 3.1, 0.0]] {
            let offset = shape.offset(HALF, x);
            let made = [0, 1, 2].map(|i| x[i] + offset[i]);
            let (back, slope) = shape.inverse(HALF).point_of(made);
            // The tolerance of the inverse map.
            assert!((0..3).all(|i| (back[i] - x[i]).abs() < 1e-9), "{x:?} {back:?}");
            // The slope against differences, of second order: (1e-4)² and rounding.
            for j in 0..3 {
                let at = |t: f64| {
                    let mut p = made;
                    p[j] += t;
                    shape.inverse(HALF).point_of(p).0
                };
                let (ahead, behind) = (at(1e-4), at(-1e-4));
                for i in 0..3 {
                    let rate = (ahead[i] - behind[i]) / 2e-4;
                    assert!((rate - slope[i][j]).abs() < 1e-5, "{i} {j} {rate} {}", slope[i][j]);
                }
            }
        }
    }

    /// A point beyond a face is taken for the nearest of the face, and does not depend on how far beyond it is.
    #[test]
    fn what_lies_beyond_a_face_is_the_face() {
        let (back, slope) = shape().inverse(HALF).point_of([1.0, 3.1, 2.0]);
        assert!((back[1] - HALF[1]).abs() < 1e-15);
        assert_eq!(slope[1], [0.0; 3]);
        assert!((slope[0][0] - 1.0).abs() < 0.1);
    }
}
