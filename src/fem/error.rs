//! Why a mesh could not be made ready, a linear system not be solved or an equilibrium not be found.

use crate::mesh::MeshError;

/// Why a linear system was not solved.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinearError {
    /// The matrix is not positive definite.
    #[error("the tangent stiffness is not positive definite (pivot {index})")]
    NotPositiveDefinite {
        /// Pivot, in elimination order.
        index: usize,
    },
    /// Out of memory in the factorisation.
    #[error("not enough memory to factorise {num_unknowns} unknowns; use a coarser mesh")]
    OutOfMemory {
        /// Size of the system.
        num_unknowns: usize,
    },
    /// Conjugate gradients did not reach what was asked.
    #[error(
        "conjugate gradients stopped after {iterations} iterations short of a relative residual of {tolerance:.1e}"
    )]
    NotConverged {
        /// Iterations made.
        iterations: usize,
        /// Relative residual asked for.
        tolerance: f64,
    },
}

/// Why one load step failed.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StepFailure {
    /// An element would invert.
    #[error("element {element} would invert (smallest det F = {jacobian:.3e})")]
    InvertedElement {
        /// Element index.
        element: usize,
        /// Smallest det F there.
        jacobian: f64,
    },
    /// Newton's method did not reach the tolerance.
    #[error("Newton's method stopped after {iterations} iterations at a relative residual of {residual:.3e}")]
    NotConverged {
        /// Iterations made.
        iterations: usize,
        /// Residual relative to the reactions.
        residual: f64,
    },
    /// The tangent lost positive definiteness (instability of the specimen or of the material).
    #[error("{0}")]
    Linear(LinearError),
}

/// Why a forward problem was not solved.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// The load step shrank below its limit.
    #[error(
        "no equilibrium found beyond a drive of {reached_mm} mm (asked: {asked_mm} mm): {cause}; reduce the drive, \
         refine the mesh or check the material's stability"
    )]
    Diverged {
        /// Last drive with an equilibrium, mm.
        reached_mm: f64,
        /// Drive asked for, mm.
        asked_mm: f64,
        /// What stopped the last attempt.
        cause: StepFailure,
    },
    /// The plates could not be brought to where they are before the drive.
    #[error(
        "no equilibrium found beyond a precompression of {reached_mm:.4} mm (asked: {asked_mm} mm): {cause}; change \
         precompression_mm towards 0, leave out holes, whose edges fail first, or check the material's stability"
    )]
    NotPrecompressed {
        /// Last precompression with an equilibrium, mm.
        reached_mm: f64,
        /// Precompression asked for, mm.
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
        "element {element} of the mesh has a geometry Jacobian of {jacobian:e} (limit: > 0); use another mesh size"
    )]
    InvalidMesh {
        /// Element index.
        element: usize,
        /// Smallest geometry Jacobian.
        jacobian: f64,
    },
    /// More terms than supported.
    #[error("the material has {num_terms} Ogden terms (limit: {limit})")]
    TooManyTerms {
        /// Terms given.
        num_terms: usize,
        /// Most terms supported.
        limit: usize,
    },
    /// The drive is not a finite number.
    #[error("the drive is {drive_mm} mm; it must be finite")]
    InvalidDrive {
        /// Drive given, mm.
        drive_mm: f64,
    },
    /// The linear system could not be solved at an equilibrium.
    #[error(transparent)]
    Linear(#[from] LinearError),
}

impl SolveError {
    /// An assembly that failed at a given drive (mm): nothing was to be reached but that drive itself.
    pub(super) fn diverged_at(drive_mm: f64, cause: StepFailure) -> SolveError {
        SolveError::Diverged { reached_mm: drive_mm, asked_mm: drive_mm, cause }
    }
}

/// A specimen could not be meshed, or its mesh not be solved on.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// No mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// No model.
    #[error(transparent)]
    Solve(#[from] SolveError),
}
