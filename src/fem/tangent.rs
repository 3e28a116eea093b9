//! The factorised tangent of an equilibrium, as a value.

use super::assembler::{Assembler, Configuration};
use super::equilibrium::Equilibrium;
use super::error::{SolveError, StepFailure};
use super::linear::{LinearSystem, MAX_COLUMNS};
use crate::material::Material;

/// The tangent stiffness K of one equilibrium with a factor: what every derivative of that equilibrium is solved with.
///
/// Made by [`ForwardModel::tangent`](super::ForwardModel::tangent). It holds the matrix, the factor and the departures
/// of the model that made it, shared and not copied; that model may go on solving while a tangent is held, and takes
/// other memory for that. Derivatives of one equilibrium are cheapest from one tangent. To save memory, drop it before
/// the model solves again.
pub struct Tangent<'a> {
    pub(super) assembler: Assembler,
    pub(super) material: &'a Material,
    pub(super) equilibrium: &'a Equilibrium,
    pub(super) system: LinearSystem,
}

impl<'a> Tangent<'a> {
    /// The same tangent once more, for another thread: matrix and factor are shared.
    pub fn shared(&self) -> Tangent<'a> {
        Tangent { assembler: self.assembler.clone(), system: self.system.share(), ..*self }
    }

    /// Where the tangent was assembled.
    pub(super) fn configuration(&self) -> Configuration<'_> {
        Configuration {
            material: self.material,
            positions: &self.assembler.mesh().nodes,
            displacement: &self.equilibrium.displacement,
        }
    }

    /// K x = b for all right-hand sides, to a relative accuracy.
    ///
    /// # Errors
    /// [`SolveError::Linear`].
    pub(super) fn solve_all(&mut self, right: &[Vec<f64>], accuracy: f64) -> Result<Vec<Vec<f64>>, SolveError> {
        let mut all = Vec::with_capacity(right.len());
        for chunk in right.chunks(MAX_COLUMNS) {
            all.extend(self.system.solve(chunk, accuracy)?);
        }
        Ok(all)
    }

    /// An assembly near the equilibrium that failed.
    pub(super) fn diverged(&self, cause: StepFailure) -> SolveError {
        SolveError::diverged_at(self.equilibrium.drive_mm, cause)
    }
}
