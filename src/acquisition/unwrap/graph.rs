//! Voxels in use, their neighbours, and how well each difference is known.

use super::image::{WrappedImage, wrapped};
use std::f64::consts::PI;

/// No voxel in use.
const NONE: u32 = u32::MAX;

/// Steps to one side of the 13 lines through a voxel.
const LINES: [[isize; 3]; 13] = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1, 1, 0],
    [1, -1, 0],
    [1, 0, 1],
    [1, 0, -1],
    [0, 1, 1],
    [0, 1, -1],
    [1, 1, 1],
    [1, 1, -1],
    [1, -1, 1],
    [1, -1, -1],
];

/// Floor of a phase's variance, rad²: keeps noiseless images in order.
const LEAST_VARIANCE: f64 = 1e-12;

/// Two neighbours.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    /// Places in the list of voxels in use.
    pub a: u32,
    pub b: u32,
    /// Wrapped phase of b less that of a, rad.
    pub difference: f64,
    /// Standard deviation of the difference, rad.
    pub sd: f64,
}

impl Edge {
    /// Distance from half a turn in standard deviations.
    pub fn margin(&self) -> f64 {
        (PI - self.difference.abs()) / self.sd
    }
}

/// Voxels in use and the differences between neighbours that share a face.
pub(super) struct Graph {
    /// Wrapped phases of the voxels in use.
    pub phase: Vec<f64>,
    /// Variance of each phase, rad²: the larger of what the magnitude says and what second differences show.
    pub variance: Vec<f64>,
    /// Mean square of the wrapped second differences, rad²; infinite where no line of three exists.
    pub roughness: Vec<f64>,
    /// Edges in the order of the voxels, x before y before z.
    pub edges: Vec<Edge>,
}

impl Graph {
    pub fn new(image: &WrappedImage, used: &[u32]) -> Graph {
        let [nx, ny, nz] = image.shape;
        let mut place = vec![NONE; nx * ny * nz];
        for (n, &voxel) in used.iter().enumerate() {
            place[voxel as usize] = n as u32;
        }
        let neighbour = |voxel: u32, step: [isize; 3], sign: isize| -> Option<u32> {
            let v = voxel as usize;
            let at = [v % nx, v / nx % ny, v / (nx * ny)];
            let mut to = [0; 3];
            for a in 0..3 {
                to[a] = at[a].checked_add_signed(sign * step[a]).filter(|&n| n < image.shape[a])?;
            }
            let n = place[to[0] + nx * (to[1] + ny * to[2])];
            (n != NONE).then_some(n)
        };
        let phase: Vec<f64> = used.iter().map(|&v| image.phase[v as usize]).collect();
        let mut roughness = Vec::with_capacity(used.len());
        for (n, &voxel) in used.iter().enumerate() {
            let (mut sum, mut count) = (0.0, 0);
            for line in LINES {
                if let (Some(before), Some(after)) = (neighbour(voxel, line, -1), neighbour(voxel, line, 1)) {
                    let first = wrapped(phase[n] - phase[before as usize]);
                    let second = wrapped(phase[after as usize] - phase[n]);
                    sum += (second - first).powi(2);
                    count += 1;
                }
            }
            roughness.push(if count > 0 { sum / f64::from(count) } else { f64::INFINITY });
        }
        // White noise of variance σ² has second differences of variance 6σ².
        let variance: Vec<f64> = used
            .iter()
            .zip(&roughness)
            .map(|(&voxel, rough)| {
                let told = image.sd[voxel as usize].powi(2).max(LEAST_VARIANCE);
                if rough.is_finite() { told.max(rough / 6.0) } else { told }
            })
            .collect();
        let mut edges = Vec::with_capacity(3 * used.len());
        for (n, &voxel) in used.iter().enumerate() {
            for step in [[1, 0, 0], [0, 1, 0], [0, 0, 1]] {
                if let Some(b) = neighbour(voxel, step, 1) {
                    let difference = wrapped(phase[b as usize] - phase[n]);
                    let sd = (variance[n] + variance[b as usize]).sqrt();
                    edges.push(Edge { a: n as u32, b, difference, sd });
                }
            }
        }
        Graph { phase, variance, roughness, edges }
    }

    pub fn len(&self) -> usize {
        self.phase.len()
    }
}
