//! Finite-strain finite elements: the forward problem and its exact derivatives.

use crate::material::{Ogden, Parameter};
use crate::mesh::Mesh;
use crate::specimen::Specimen;

/// Why a forward problem was not solved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// The load step shrank below its limit.
    #[error(
        "no equilibrium found beyond a drive of {reached_mm} mm (asked: {asked_mm} mm): {cause}; reduce the drive or check the material's stability"
    )]
    Diverged {
        /// Last drive with an equilibrium, mm.
        reached_mm: f64,
        /// Drive asked for, mm.
        asked_mm: f64,
        /// What stopped the last attempt.
        cause: StepFailure,
    },
    /// The caller's cancellation check said stop.
    #[error("cancelled at a drive of {reached_mm} mm")]
    Cancelled {
        /// Last drive with an equilibrium, mm.
        reached_mm: f64,
    },
    /// The mesh cannot be used.
    #[error(
        "element {element} of the mesh has a geometry Jacobian of {jacobian:e} mm³ (limit: > 0); use a finer or another mesh"
    )]
    InvalidMesh {
        /// Element index.
        element: usize,
        /// Smallest geometry Jacobian, mm³.
        jacobian: f64,
    },
}

/// Why one load step failed.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StepFailure {
    /// An element would invert.
    #[error("element {element} would invert (det F = {jacobian})")]
    InvertedElement {
        /// Element index.
        element: usize,
        /// det F there.
        jacobian: f64,
    },
}

/// Settings of [`ForwardModel::solve`].
#[derive(Clone, Copy, Debug)]
pub struct SolveOptions {
    /// Newton stops when |residual| / |reactions| falls below this.
    pub tolerance: f64,
}

impl Default for SolveOptions {
    fn default() -> Self {
        SolveOptions { tolerance: 1e-9 }
    }
}

/// An equilibrium at one drive.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Displacement of each node of the mesh, mm.
    pub displacement: Vec<[f64; 3]>,
    /// Pressure coefficients of each element, kPa.
    pub pressure: Vec<[f64; 4]>,
    /// Force along +x on the moved face, N: the whole specimen, times the samples in parallel.
    pub force_n: f64,
}

/// Derivative of an equilibrium with respect to one material parameter.
#[derive(Clone, Debug)]
pub struct ParameterSensitivity {
    /// The parameter ξ.
    pub parameter: Parameter,
    /// ∂u/∂ξ at each node, mm per unit of ξ.
    pub displacement: Vec<[f64; 3]>,
    /// ∂F/∂ξ, N per unit of ξ (as [`Equilibrium::force_n`]).
    pub force_n: f64,
}

/// The state at one quadrature point.
#[derive(Clone, Copy, Debug)]
pub struct QuadraturePoint {
    /// Element index.
    pub element: usize,
    /// Reference position, mm.
    pub position: [f64; 3],
    /// Reference volume that the point stands for, mm³ (of the meshed part; mirrored parts are not counted).
    pub volume_mm3: f64,
    /// F, row current, column reference.
    pub deformation_gradient: [[f64; 3]; 3],
    /// σ, kPa.
    pub cauchy_stress: [[f64; 3]; 3],
}

/// A mesh made ready for solving: boundary conditions, elimination order, symbolic factorisation.
pub struct ForwardModel {
    mesh: Mesh,
}

impl ForwardModel {
    /// Prepares `mesh` of `specimen`.
    ///
    /// # Errors
    /// [`SolveError::InvalidMesh`].
    pub fn new(mesh: Mesh, specimen: &Specimen) -> Result<Self, SolveError> {
        let _ = specimen;
        Ok(ForwardModel { mesh })
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Free displacement unknowns.
    pub fn num_unknowns(&self) -> usize {
        0
    }

    /// Solves at one drive, from rest or from `start`.
    ///
    /// # Errors
    /// [`SolveError::Diverged`], [`SolveError::Cancelled`].
    pub fn solve(
        &mut self,
        _material: &Ogden,
        _drive_mm: f64,
        _start: Option<&Equilibrium>,
        _options: &SolveOptions,
        _is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Equilibrium, SolveError> {
        unimplemented!()
    }

    /// Solves at increasing drives, each from the last.
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub fn solve_path(
        &mut self,
        _material: &Ogden,
        _drives_mm: &[f64],
        _options: &SolveOptions,
        _is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Vec<Equilibrium>, SolveError> {
        unimplemented!()
    }

    /// ∂u/∂ξ and ∂F/∂ξ for every parameter, in the order of [`Ogden::parameters`].
    ///
    /// # Errors
    /// [`SolveError::Diverged`] if the tangent at the equilibrium is not positive definite.
    pub fn material_sensitivities(
        &mut self,
        _material: &Ogden,
        _equilibrium: &Equilibrium,
    ) -> Result<Vec<ParameterSensitivity>, SolveError> {
        unimplemented!()
    }

    /// Deformation and stress at every quadrature point, element after element.
    pub fn quadrature_fields(&self, _material: &Ogden, _equilibrium: &Equilibrium) -> Vec<QuadraturePoint> {
        unimplemented!()
    }
}
