//! The forward model: a mesh made ready for solving, with a coarse mesh inside a large one.

use super::assembler::Configuration;
use super::departures::Departures;
use super::equilibrium::Equilibrium;
use super::error::{PrepareError, SolveError};
use super::fields::QuadraturePoint;
use super::guide::Guide;
use super::mesh_model::MeshModel;
use super::nesting::Nesting;
use super::options::{SolveOptions, Statistics};
use super::tangent::Tangent;
use crate::material::{MAX_TERMS, Material};
use crate::mesh::{Mesh, MeshOptions, mesh_specimen, refined};
use crate::specimen::Specimen;

/// Meshes of fewer elements are solved from rest.
const WORTH_GUIDING: usize = 300;
/// Meshes of fewer elements are guided by a coarse mesh of their own; larger ones are made by splitting theirs.
const WORTH_NESTING: usize = 1_000;
/// Refined meshes of more nodes are solved without a factor of their own: at 78,000 that takes two thirds of the time
/// and a third of the memory.
const WORTH_LEVELS: usize = 60_000;

/// In how many parts plates are brought to where they are by [`ForwardModel::solve_by_parts`].
const PARTS: i32 = 8;

/// A mesh made ready for solving: boundary conditions, elimination order, symbolic factorisation, workspace.
///
/// The moved plate or grip is displaced by the drive in its direction; the fixed one not at all. A model may depart
/// from this nominal experiment ([`ForwardModel::departed`]). A large mesh made by [`ForwardModel::of_specimen`] has a
/// coarse one inside it, whose equilibria guide the nominal model. What was solved last never changes what is solved
/// next.
pub struct ForwardModel {
    pub(super) fine: MeshModel,
    guide: Option<Guide>,
    statistics: Statistics,
}

impl ForwardModel {
    /// Prepares `mesh` of `specimen`.
    ///
    /// # Errors
    /// [`SolveError::InvalidMesh`]; [`SolveError::Linear`] where memory does not suffice.
    pub fn new(mesh: Mesh, specimen: &Specimen) -> Result<Self, SolveError> {
        Self::with_released(mesh, specimen, &|_, _| false)
    }

    /// As [`Self::new`], with the nodes of the bonded faces for which `is_released`(position, whether on the moved
    /// face) held by springs, whose stiffness is [`Departures::bond_kpa_per_mm`].
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_released(
        mesh: Mesh,
        specimen: &Specimen,
        is_released: &dyn Fn([f64; 3], bool) -> bool,
    ) -> Result<Self, SolveError> {
        let fine = MeshModel::new(mesh, specimen, is_released)?;
        Ok(ForwardModel { fine, guide: None, statistics: Statistics::default() })
    }

    /// Meshes `specimen` and prepares it, with a coarse model for first guesses where the mesh is large.
    ///
    /// # Errors
    /// [`PrepareError`].
    pub fn of_specimen(specimen: &Specimen, options: &MeshOptions) -> Result<ForwardModel, PrepareError> {
        let mesh = mesh_specimen(specimen, options)?;
        // Twice the element size; if split, about the same mesh, with a coarse one inside it.
        let coarser = MeshOptions {
            section_size_mm: 2.0 * options.section_size_mm,
            levels: (options.levels / 2).max(2),
            hole_segments: (options.hole_segments / 2).max(8),
            radial_layers: (options.radial_layers / 2).max(1),
            ..*options
        };
        if mesh.num_elements() < WORTH_GUIDING {
            return Ok(ForwardModel::new(mesh, specimen)?);
        }
        if mesh.num_elements() < WORTH_NESTING {
            let guide = mesh_specimen(specimen, &coarser).ok().and_then(|c| Guide::beside(c, &mesh, specimen));
            return Ok(ForwardModel { guide, ..ForwardModel::new(mesh, specimen)? });
        }
        let nested = mesh_specimen(specimen, &coarser).ok().and_then(|coarse| Some((refined(&coarse)?, coarse)));
        let Some((refinement, coarse)) = nested else {
            return Ok(ForwardModel::new(mesh, specimen)?);
        };
        let coarse = MeshModel::new(coarse, specimen, &|_, _| false)?;
        let is_large = refinement.mesh.nodes.len() > WORTH_LEVELS;
        let fine = match is_large {
            true => MeshModel::refining(&coarse, &refinement, specimen)?,
            false => MeshModel::new(refinement.mesh, specimen, &|_, _| false)?,
        };
        let guide = Guide::new(coarse, refinement.nodes, refinement.parents);
        Ok(ForwardModel { fine, guide: Some(guide), statistics: Statistics::default() })
    }

    /// A model of the same mesh that departs from the nominal experiment in `departures`, and in nothing else
    /// (departures of this model are not kept). Mesh, elimination order and symbolic factorisation are shared; both
    /// models may solve without regard to each other.
    pub fn departed(&self, departures: &Departures) -> ForwardModel {
        ForwardModel {
            fine: self.fine.departed(departures),
            guide: self.guide.as_ref().filter(|_| departures.is_none()).map(Guide::anew),
            statistics: Statistics::default(),
        }
    }

    /// The same model with nothing solved, which shares what [`Self::departed`] shares.
    pub fn another(&self) -> ForwardModel {
        self.departed(self.departures())
    }

    /// A model of the same elements and released nodes with the nodes at other positions (mm), which departs in
    /// nothing. Elimination order and symbolic factorisation are shared.
    ///
    /// # Errors
    /// [`SolveError::InvalidMesh`] where an element is inverted.
    pub fn moved(&self, nodes: Vec<[f64; 3]>) -> Result<ForwardModel, SolveError> {
        Ok(ForwardModel { fine: self.fine.moved(nodes)?, guide: None, statistics: Statistics::default() })
    }

    /// The model while its plates are brought to where they are before any drive: what drives it is the precompression.
    pub(super) fn pressing(&self) -> ForwardModel {
        ForwardModel { fine: self.fine.pressing(), guide: None, statistics: Statistics::default() }
    }

    /// What the model departs from the nominal experiment in.
    pub fn departures(&self) -> &Departures {
        self.fine.assembler.departures()
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        self.fine.assembler.mesh()
    }

    /// How often the meshed part stands in the test: mirrored copies times samples. Forces are those of all of them.
    pub fn multiplicity(&self) -> f64 {
        self.fine.assembler.multiplicity()
    }

    /// Displacement unknowns that can move.
    pub fn num_unknowns(&self) -> usize {
        self.fine.assembler.topology().num_free_unknowns()
    }

    /// What the last solve took.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    /// Factorisations since the model was made, those of its tangents included and those of the coarse model not.
    pub fn num_factorisations(&self) -> usize {
        self.fine.linearisation.system.num_factorisations()
    }

    /// Name of the instruction set in use.
    pub fn instruction_set(&self) -> &'static str {
        self.fine.assembler.kernels().name
    }

    /// Uses the kernels without special instructions: for tests that compare them.
    pub fn use_portable_kernels(&mut self) {
        self.fine.assembler = self.fine.assembler.portable();
    }

    /// Solves at one drive (mm), from rest or from `start` (an equilibrium of this mesh at any drive and material).
    ///
    /// # Errors
    /// [`SolveError::Diverged`] with the drive reached and the cause, [`SolveError::Cancelled`],
    /// [`SolveError::TooManyTerms`], [`SolveError::InvalidDrive`].
    pub fn solve(
        &mut self,
        material: &Material,
        drive_mm: f64,
        start: Option<&Equilibrium>,
        options: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Equilibrium, SolveError> {
        check(material, drive_mm)?;
        let mut newton = self.fine.newton(material, options, is_cancelled);
        // A start at the same drive is nearer than what the coarse mesh finds.
        let guide = self.guide.as_mut().filter(|_| start.is_none_or(|s| s.drive_mm != drive_mm));
        let found = match guide {
            Some(guide) => guide.solve(&mut newton, drive_mm, start),
            None => newton.solve(drive_mm, start),
        };
        self.statistics = newton.statistics;
        found
    }

    /// Solves at several drives, each from the last.
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub fn solve_path(
        &mut self,
        material: &Material,
        drives_mm: &[f64],
        options: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<Equilibrium>, SolveError> {
        let mut path: Vec<Equilibrium> = Vec::with_capacity(drives_mm.len());
        for &drive in drives_mm {
            let next = self.solve(material, drive, path.last(), options, is_cancelled)?;
            path.push(next);
        }
        Ok(path)
    }

    /// A start for [`Self::solve`] from `state`, which `coarse` found of the same sample: what it is on this mesh,
    /// which lies in the other as `nesting` says. With `known`, a state of each of the two for one and the same scene,
    /// what the coarse mesh gets wrong there is taken off.
    pub fn start_from(
        &self,
        coarse: &ForwardModel,
        nesting: &Nesting,
        material: &Material,
        state: &Equilibrium,
        known: Option<[&Equilibrium; 2]>,
    ) -> Equilibrium {
        let transfer = |s: &Equilibrium| nesting.transfer([&coarse.fine.assembler, &self.fine.assembler], material, s);
        let mut start = transfer(state);
        if let Some([coarse, fine]) = known {
            start.add_difference(1.0, fine, &transfer(coarse));
        }
        // It was not solved for on this mesh.
        start.serial = None;
        start
    }

    /// As [`ForwardModel::solve`] from rest, the plates' departures growing in eight parts at the drive asked for: a
    /// plate that is far out of place without any drive is a step that Newton's method does not take from rest at once.
    ///
    /// # Errors
    /// As [`ForwardModel::solve`].
    pub fn solve_by_parts(
        &mut self,
        material: &Material,
        drive_mm: f64,
        options: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Equilibrium, SolveError> {
        check(material, drive_mm)?;
        let mut state = None;
        for part in 0..PARTS {
            let grown = f64::from(part) / f64::from(PARTS);
            let assembler = self.fine.assembler.departed(&self.departures().with_plates_scaled(grown));
            let mut newton = self.fine.newton(material, options, is_cancelled);
            newton.assembler = &assembler;
            let found = newton.solve(drive_mm, state.as_ref());
            self.statistics = newton.statistics;
            state = Some(found?);
        }
        self.solve(material, drive_mm, state.as_ref(), options, is_cancelled)
    }

    /// The tangent of an equilibrium of `material` of this mesh, with the departures of this model. It
    /// costs one assembly and one factorisation; just after the solve that found the equilibrium mostly less.
    ///
    /// # Errors
    /// [`SolveError::Diverged`] where the state inverts an element, [`SolveError::Linear`] if the tangent is not
    /// positive definite.
    pub fn tangent<'a>(
        &mut self,
        material: &'a Material,
        equilibrium: &'a Equilibrium,
    ) -> Result<Tangent<'a>, SolveError> {
        self.fine.tangent(material, equilibrium)
    }

    /// Deformation and stress at every quadrature point, element after element, in the order of
    /// [`crate::mesh::ElementKind::quadrature`].
    pub fn quadrature_fields(&self, material: &Material, equilibrium: &Equilibrium) -> Vec<QuadraturePoint> {
        let at = Configuration { material, positions: &self.mesh().nodes, displacement: &equilibrium.displacement };
        self.fine.assembler.quadrature_fields(&at, Some(&equilibrium.pressure))
    }

    /// As [`Self::quadrature_fields`] with the nodes at other `positions` and any displacement (both mm at each node);
    /// the pressure is the condensed one.
    pub fn quadrature_fields_at(
        &self,
        material: &Material,
        positions: &[[f64; 3]],
        displacement: &[[f64; 3]],
    ) -> Vec<QuadraturePoint> {
        self.fine.assembler.quadrature_fields(&Configuration { material, positions, displacement }, None)
    }

    /// Traction (kPa) of the plates on the sample at each node of the bonded faces, zero elsewhere: nodal force / area.
    ///
    /// # Errors
    /// [`SolveError::Diverged`] where the state is not one of this mesh.
    pub fn plate_tractions(&self, material: &Material, equilibrium: &Equilibrium) -> Result<Vec<[f64; 3]>, SolveError> {
        let at = Configuration { material, positions: &self.mesh().nodes, displacement: &equilibrium.displacement };
        let tractions = self.fine.assembler.plate_tractions(&at);
        tractions.map_err(|cause| SolveError::diverged_at(equilibrium.drive_mm, cause))
    }
}

/// Whether a solution may be asked for.
fn check(material: &Material, drive_mm: f64) -> Result<(), SolveError> {
    if material.terms.len() > MAX_TERMS {
        return Err(SolveError::TooManyTerms { num_terms: material.terms.len(), limit: MAX_TERMS });
    }
    if !drive_mm.is_finite() {
        return Err(SolveError::InvalidDrive { drive_mm });
    }
    Ok(())
}
