//! The pressures of the elements: condensed before a linear solve, which does not contain them, and recovered after it.

use super::element_data::{ElementOutput, MAX_GROUPS};
use crate::material::{LANES, Lanes};
use crate::mesh::Mesh;

/// What is kept of an element between assembly and the update of its pressure: B, D and the pressure gap
/// (see [`super::kernel`]).
#[derive(Clone)]
pub(super) struct Condensation {
    divergence: [[[Lanes; MAX_GROUPS]; 3]; 4],
    pressure_gap: [f64; 4],
    bulk: [[f64; 4]; 4],
}

impl Condensation {
    /// Nothing kept yet.
    pub(super) fn empty() -> Condensation {
        Condensation { divergence: [[[Lanes::ZERO; MAX_GROUPS]; 3]; 4], pressure_gap: [0.0; 4], bulk: [[0.0; 4]; 4] }
    }

    /// Keeps what the update needs of an element's tangent.
    pub(super) fn keep(&mut self, out: &ElementOutput) {
        self.pressure_gap = out.pressure_gap;
        self.bulk = out.bulk;
        self.divergence = out.divergence;
    }

    /// Keeps the pressure gap of an element's residual; B and D stay those of the last tangent.
    pub(super) fn keep_gap(&mut self, out: &ElementOutput) {
        self.pressure_gap = out.pressure_gap;
    }
}

/// δp of every element from δu at the nodes (mm): D B δu + gap, with the B and D of the last tangent.
pub(super) fn pressure_update(mesh: &Mesh, condensation: &[Condensation], delta: &[[f64; 3]]) -> Vec<[f64; 4]> {
    let mut update = Vec::with_capacity(condensation.len());
    for (e, kept) in condensation.iter().enumerate() {
        let nodes = mesh.element(e);
        let mut p = kept.pressure_gap;
        for m in 0..4 {
            let mut dilation = 0.0;
            for (a, &v) in nodes.iter().enumerate() {
                let d = &delta[v as usize];
                for i in 0..3 {
                    dilation += kept.divergence[m][i][a / LANES].0[a % LANES] * d[i];
                }
            }
            for (n, p) in p.iter_mut().enumerate() {
                *p += kept.bulk[n][m] * dilation;
            }
        }
        update.push(p);
    }
    update
}
