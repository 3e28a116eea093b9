//! The preconditioner of large refined meshes: solutions on patches of the fine mesh and one on the coarse mesh, added.
//!
//! A direct factor of N unknowns takes memory in proportion to N^(4/3) and time to N²; this takes both in proportion to
//! N, but for the coarse mesh, which has an eighth of the unknowns.

use super::coarse_space::{CoarseSpace, Continuation};
use super::crew::{Crew, Seat};
use super::direct::{Direct, DirectFactor, Workspace};
use super::error::LinearError;
use super::patches::Patches;
use super::topology::Topology;
use std::sync::Arc;

/// What is made once per mesh.
pub(super) struct Levels {
    topology: Arc<Topology>,
    patches: Patches,
    space: CoarseSpace,
    coarse: Arc<Direct>,
}

/// What is made for every matrix.
pub(super) struct LevelsFactor {
    /// Of the patches.
    inverses: Vec<f32>,
    /// Of coarse fields into the coarse elements.
    continuation: Continuation,
    /// Of the matrix of the coarse space.
    coarse: DirectFactor,
}

impl Levels {
    /// Of the numbering and the patches of the fine mesh, how the coarse one lies in it, and the direct method there.
    pub(super) fn new(topology: Arc<Topology>, patches: Patches, space: CoarseSpace, coarse: Arc<Direct>) -> Levels {
        Levels { topology, patches, space, coarse }
    }

    /// The preconditioner of the matrix of these `blocks`; memory of an `old` one is used again.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`].
    pub(super) fn factorise(
        &self,
        blocks: &[[f64; 9]],
        old: Option<LevelsFactor>,
        workspace: &mut Workspace,
    ) -> Result<LevelsFactor, LinearError> {
        let _seat = Seat::take();
        let crew = Crew::gather();
        let (old_inverses, old_coarse) = old.map(|f| (f.inverses, f.coarse)).unzip();
        let inverses = self.patches.invert(&self.topology, blocks, old_inverses, &crew)?;
        let (matrix, continuation) = self.space.condense(blocks, &crew)?;
        drop(crew);
        let coarse = self.coarse.factorise(&matrix, old_coarse, workspace)?;
        Ok(LevelsFactor { inverses, continuation, coarse })
    }

    /// x ← (preconditioner) x for several right-hand sides, one after the other.
    pub(super) fn solve(&self, factor: &LevelsFactor, x: &mut [f64], crew: &Crew) {
        for column in x.chunks_exact_mut(self.topology.num_unknowns()) {
            let mut coarse = self.space.restrict(&factor.continuation, column);
            self.coarse.solve(&factor.coarse, &mut coarse, crew);
            let mut sum = vec![0.0; column.len()];
            self.patches.add_solutions(&factor.inverses, column, &mut sum, crew);
            self.space.prolong(&factor.continuation, &coarse, &mut sum);
            column.copy_from_slice(&sum);
        }
    }
}
