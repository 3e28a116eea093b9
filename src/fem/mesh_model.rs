//! A model of one mesh: an assembler and the linear system that its tangents are assembled in.

use super::assembler::Assembler;
use super::coarse_space::CoarseSpace;
use super::departures::Departures;
use super::equilibrium::Equilibrium;
use super::error::SolveError;
use super::levels::Levels;
use super::linear::LinearSystem;
use super::linearisation::Linearisation;
use super::newton::{KEEP_TANGENT_BELOW, Newton};
use super::options::{SolveOptions, Statistics};
use super::patches::Patches;
use super::tangent::Tangent;
use crate::material::Material;
use crate::mesh::{Mesh, Refinement};
use crate::specimen::Specimen;

/// An assembler with the matrix and factor of its last tangent.
pub(super) struct MeshModel {
    pub(super) assembler: Assembler,
    pub(super) linearisation: Linearisation,
}

impl MeshModel {
    /// For `mesh` of `specimen`; `is_released` as in [`Assembler::new`].
    ///
    /// # Errors
    /// [`SolveError::InvalidMesh`]; [`SolveError::Linear`] where memory does not suffice.
    pub(super) fn new(
        mesh: Mesh,
        specimen: &Specimen,
        is_released: &dyn Fn([f64; 3], bool) -> bool,
    ) -> Result<MeshModel, SolveError> {
        let assembler = Assembler::new(mesh, specimen, is_released)?;
        let system = LinearSystem::new(assembler.topology().clone())?;
        Ok(MeshModel { assembler, linearisation: Linearisation::new(system) })
    }

    /// For the refinement of the mesh of `coarse`, both of `specimen`, with a preconditioner that needs no factor of
    /// the fine mesh.
    ///
    /// # Errors
    /// As [`MeshModel::new`].
    pub(super) fn refining(
        coarse: &MeshModel,
        refinement: &Refinement,
        specimen: &Specimen,
    ) -> Result<MeshModel, SolveError> {
        let assembler = Assembler::new(refinement.mesh.clone(), specimen, &|_, _| false)?;
        let (topology, mesh) = (assembler.topology(), assembler.mesh());
        let levels = |direct| {
            let (coarse_mesh, coarse_topology) = (coarse.assembler.mesh(), coarse.assembler.topology());
            let meshes = [mesh, coarse_mesh];
            let space = CoarseSpace::new(meshes, [topology, coarse_topology], &refinement.nodes, &refinement.parents);
            Levels::new(topology.clone(), Patches::new(mesh, topology), space, direct)
        };
        let system = match LinearSystem::refining(topology.clone(), &coarse.linearisation.system, levels) {
            Some(system) => system,
            None => LinearSystem::new(topology.clone())?,
        };
        Ok(MeshModel { assembler, linearisation: Linearisation::new(system) })
    }

    /// The same mesh with other departures and nothing assembled; all that is made once per mesh is shared.
    pub(super) fn departed(&self, departures: &Departures) -> MeshModel {
        MeshModel {
            assembler: self.assembler.departed(departures),
            linearisation: Linearisation::new(self.linearisation.system.empty_like()),
        }
    }

    /// The same sample while its plates are brought to where they are before any drive, with nothing assembled.
    pub(super) fn pressing(&self) -> MeshModel {
        MeshModel {
            assembler: self.assembler.pressing(),
            linearisation: Linearisation::new(self.linearisation.system.empty_like()),
        }
    }

    /// The same elements with the nodes elsewhere and no departures; the symbolic work is shared.
    ///
    /// # Errors
    /// [`SolveError::InvalidMesh`].
    pub(super) fn moved(&self, nodes: Vec<[f64; 3]>) -> Result<MeshModel, SolveError> {
        let assembler = self.assembler.moved(nodes)?;
        Ok(MeshModel { assembler, linearisation: Linearisation::new(self.linearisation.system.empty_like()) })
    }

    /// A run of Newton's method.
    pub(super) fn newton<'a>(
        &'a mut self,
        material: &'a Material,
        options: &'a SolveOptions,
        is_cancelled: &'a (dyn Fn() -> bool + Sync),
    ) -> Newton<'a> {
        Newton {
            assembler: &self.assembler,
            linearisation: &mut self.linearisation,
            material,
            options,
            is_cancelled,
            statistics: Statistics::default(),
        }
    }

    /// The tangent of an equilibrium of `material`: the one just solved with where it is that equilibrium's, else
    /// assembled, and factorised unless the equilibrium was just found with a factor from nearby.
    ///
    /// # Errors
    /// [`SolveError::Diverged`] where an element is inverted, [`SolveError::Linear`] where there is no factor.
    pub(super) fn tangent<'a>(
        &mut self,
        material: &'a Material,
        equilibrium: &'a Equilibrium,
    ) -> Result<Tangent<'a>, SolveError> {
        let there = &mut self.linearisation;
        let stands_there = equilibrium.serial.is_some() && there.stands_at == equilibrium.serial;
        // A solve that ended with a kept tangent has a factor near enough to be a preconditioner. With one from farther
        // away conjugate gradients stop at the same residual with a larger error.
        let has_factor = stands_there && there.system.has_factor() && there.factorised_at < KEEP_TANGENT_BELOW;
        if !(has_factor && there.has_tangent) {
            self.assembler
                .linearise(material, equilibrium, there)
                .map_err(|cause| SolveError::diverged_at(equilibrium.drive_mm, cause))?;
            if !has_factor {
                there.system.factorise()?;
                there.factorised_at = 0.0;
            }
            there.stands_at = equilibrium.serial;
        }
        Ok(Tangent { assembler: self.assembler.clone(), material, equilibrium, system: there.system.share() })
    }
}
