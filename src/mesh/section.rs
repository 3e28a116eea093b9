//! A section: quadratic quadrilaterals or triangles in the plane.

use super::domain::Domain;

/// Quadratic cells in section coordinates (a, b), counter-clockwise.
#[derive(Clone, Debug)]
pub(super) struct Section {
    /// 9 (node i + 3j at (i − 1, j − 1)) or 7 (corners, edge middles 01, 12, 20, centroid).
    pub nodes_per_cell: usize,
    pub points: Vec<[f64; 2]>,
    pub cells: Vec<u32>,
}

impl Section {
    pub fn num_cells(&self) -> usize {
        self.cells.len() / self.nodes_per_cell
    }

    pub fn cell(&self, cell: usize) -> &[u32] {
        &self.cells[cell * self.nodes_per_cell..(cell + 1) * self.nodes_per_cell]
    }

    /// Smallest scaled Jacobian and the cell that has it.
    pub fn min_scaled_jacobian(&self) -> (f64, usize) {
        let mut worst = (f64::INFINITY, 0);
        for cell in 0..self.num_cells() {
            let points: Vec<[f64; 2]> = self.cell(cell).iter().map(|&n| self.points[n as usize]).collect();
            let quality = scaled_jacobian(&points);
            if quality.is_nan() || quality < worst.0 {
                worst = (quality, cell);
            }
        }
        worst
    }

    /// Mean over the cells of the shape 2 det J / |J|² at the centre: 1 for squares, small for slivers.
    pub fn mean_shape(&self) -> f64 {
        let sum: f64 = (0..self.num_cells())
            .map(|cell| {
                let p = |i: usize| self.points[self.cell(cell)[i] as usize];
                let (u, v) = (sub(p(5), p(3)), sub(p(7), p(1)));
                2.0 * cross(u, v) / (dot(u, u) + dot(v, v))
            })
            .sum();
        sum / self.num_cells().max(1) as f64
    }
}

pub(super) fn sub(p: [f64; 2], q: [f64; 2]) -> [f64; 2] {
    [p[0] - q[0], p[1] - q[1]]
}

pub(super) fn cross(u: [f64; 2], v: [f64; 2]) -> f64 {
    u[0] * v[1] - u[1] * v[0]
}

pub(super) fn dot(u: [f64; 2], v: [f64; 2]) -> f64 {
    u[0] * v[0] + u[1] * v[1]
}

/// Scaled Jacobian of a curved cell: the smallest sine of the angle between the two parametric directions over the
/// nodes of a quadrilateral, or at the corners of a triangle det J over the largest product of two sides, times 2/√3 so
/// that the equilateral triangle has 1. Negative if the cell is folded.
pub(super) fn scaled_jacobian(points: &[[f64; 2]]) -> f64 {
    let mut worst = f64::INFINITY;
    if points.len() == 9 {
        // Derivatives at the nodes of a line of three: one-sided at the ends, central in the middle.
        let line = |p: [[f64; 2]; 3], i: usize| -> [f64; 2] {
            let w = [[-1.5, 2.0, -0.5], [-0.5, 0.0, 0.5], [0.5, -2.0, 1.5]][i];
            [w[0] * p[0][0] + w[1] * p[1][0] + w[2] * p[2][0], w[0] * p[0][1] + w[1] * p[1][1] + w[2] * p[2][1]]
        };
        for j in 0..3 {
            for i in 0..3 {
                let u = line([points[3 * j], points[3 * j + 1], points[3 * j + 2]], i);
                let v = line([points[i], points[i + 3], points[i + 6]], j);
                worst = least(worst, cross(u, v) / (dot(u, u) * dot(v, v)).sqrt());
            }
        }
    } else {
        for k in 0..3 {
            let (next, previous) = ((k + 1) % 3, (k + 2) % 3);
            // Tangents at corner k of the two quadratic sides that meet there.
            let tangent = |middle: usize, end: usize| {
                [0, 1].map(|c| 4.0 * points[middle][c] - 3.0 * points[k][c] - points[end][c])
            };
            let (u, v) = (tangent(3 + k, next), tangent(3 + previous, previous));
            let w = sub(points[next], points[previous]);
            let (uu, vv, ww) = (dot(u, u), dot(v, v), dot(w, w));
            let largest = (uu * vv).max(vv * ww).max(ww * uu).sqrt();
            worst = least(worst, 2.0 / 3f64.sqrt() * cross(u, v) / largest);
        }
    }
    worst
}

/// The smaller of two numbers; NaN counts as −1.
fn least(a: f64, b: f64) -> f64 {
    if b.is_nan() { -1.0f64.min(a) } else { a.min(b) }
}

/// Collects points and merges those that coincide.
pub(super) struct PointMerger {
    pub points: Vec<[f64; 2]>,
    bins: std::collections::HashMap<(i64, i64), Vec<u32>>,
    tolerance: f64,
    domain_half: [f64; 2],
    bottom: f64,
}

impl PointMerger {
    /// Merges within 10⁻⁷ of the section's size.
    pub fn new(domain: &Domain) -> Self {
        PointMerger {
            points: Vec::new(),
            bins: Default::default(),
            tolerance: 1e-7 * domain.scale(),
            domain_half: domain.half,
            bottom: domain.bottom,
        }
    }

    /// Index of the point at `p`, new or known. A point within the tolerance of an outer edge or the mirror line is put
    /// exactly on it.
    pub fn insert(&mut self, mut p: [f64; 2]) -> u32 {
        let [a, b] = self.domain_half;
        for (c, value) in [(0, -a), (0, a), (1, self.bottom), (1, b)] {
            if (p[c] - value).abs() < self.tolerance {
                p[c] = value;
            }
        }
        let size = 4.0 * self.tolerance;
        let key = [p[0] / size, p[1] / size].map(|v| v.round() as i64);
        for i in -1..=1 {
            for j in -1..=1 {
                for &known in self.bins.get(&(key[0] + i, key[1] + j)).into_iter().flatten() {
                    let q = self.points[known as usize];
                    if (q[0] - p[0]).abs() < self.tolerance && (q[1] - p[1]).abs() < self.tolerance {
                        return known;
                    }
                }
            }
        }
        let index = self.points.len() as u32;
        self.points.push(p);
        self.bins.entry((key[0], key[1])).or_default().push(index);
        index
    }
}
