//! The equilibria of a body on a finer mesh than that of the fit.

use crate::fem::{Equilibrium, ForwardModel, ModelPool, Nesting, SolveError, SolveOptions, side_by_side};
use crate::material::Material;
use crate::mesh::Mesh;

/// A finer mesh of a specimen beside that of the fit.
pub(super) struct TwoMeshes {
    coarse: ForwardModel,
    fine: ModelPool,
    /// How the fine mesh lies in the coarse one; `None` where it does not.
    nesting: Option<Nesting>,
    /// Equilibria of the drives, last found on the two meshes.
    known: Vec<[Equilibrium; 2]>,
}

impl TwoMeshes {
    /// On the fit's mesh and on the finer one.
    pub(super) fn new(coarse: ForwardModel, fine: ForwardModel) -> TwoMeshes {
        let nesting = Nesting::located(coarse.mesh(), fine.mesh());
        TwoMeshes { coarse, fine: ModelPool::new(fine), nesting, known: Vec::new() }
    }

    /// The finer one.
    pub(super) fn fine_mesh(&self) -> &Mesh {
        self.fine.own().mesh()
    }

    /// The equilibria at `drives_mm` on the two meshes, those of the fit's mesh as far as they are `known`; those of
    /// the finer one from there, with what that mesh got wrong the last time taken off. Where that leads to none, each
    /// from the drive before, the first from rest: drives are best told in the order of their sizes.
    ///
    /// # Errors
    /// As [`ForwardModel::solve`].
    pub(super) fn states(
        &mut self,
        material: &Material,
        drives_mm: &[f64],
        known: &[Option<&Equilibrium>],
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<[Equilibrium; 2]>, SolveError> {
        let options = SolveOptions::trial();
        let mut coarse: Vec<Equilibrium> = Vec::new();
        for (d, &drive_mm) in drives_mm.iter().enumerate() {
            let state = match known.get(d) {
                Some(Some(state)) => (*state).clone(),
                _ => {
                    let near = self.known.get(d).map(|both| &both[0]).or(coarse.last());
                    self.coarse.solve(material, drive_mm, near, &options, is_cancelled)?
                }
            };
            coarse.push(state);
        }
        let TwoMeshes { coarse: coarse_model, fine, nesting, known } = &mut *self;
        let near = side_by_side(coarse.iter().enumerate().collect(), |(d, coarse): (usize, &Equilibrium)| {
            let known = known.get(d).map(|[coarse, fine]| [coarse, fine]);
            let start = fine.own().start_from(coarse_model, nesting.as_ref()?, material, coarse, known);
            fine.with(|model| model.solve(material, drives_mm[d], Some(&start), &options, is_cancelled)).ok()
        });
        let fine = along(fine.own_mut(), near, drives_mm, material, &options, is_cancelled)?;
        *known = coarse.into_iter().zip(fine).map(|(coarse, fine)| [coarse, fine]).collect();
        Ok(known.clone())
    }
}

/// The equilibria of `model` at `drives_mm`, of which those that are `found` are taken as they are: each of the others
/// from that at the drive before, the first from rest.
///
/// # Errors
/// As [`ForwardModel::solve`].
fn along(
    model: &mut ForwardModel,
    found: Vec<Option<Equilibrium>>,
    drives_mm: &[f64],
    material: &Material,
    options: &SolveOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Equilibrium>, SolveError> {
    let mut path: Vec<Equilibrium> = Vec::with_capacity(drives_mm.len());
    for (found, &drive_mm) in found.into_iter().zip(drives_mm) {
        let state = match found {
            Some(state) => state,
            None => {
                let start = path.last().filter(|s| s.drive_mm * drive_mm > 0.0);
                model.solve(material, drive_mm, start, options, is_cancelled)?
            }
        };
        path.push(state);
    }
    Ok(path)
}
