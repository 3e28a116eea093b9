//! Why a calibration has no result.

use crate::fem::{PrepareError, SolveError};
use crate::material::MaterialError;
use crate::optimise::SolverStatus;
use crate::sensitivity::{InformationError, ProtocolMismatch};
use crate::voxel::VoxelError;

/// Why a calibration has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// No model of the specimen.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// No equilibrium at the start, or the work was cancelled.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// The protocol does not suit the specimen.
    #[error(transparent)]
    Protocol(#[from] ProtocolMismatch),
    /// The load cell carries unlike samples, for which something is not done.
    #[error("{what}: not supported where the force is that of unlike samples (other_samples); leave it out")]
    UnlikeSamples {
        /// What is not supported.
        what: &'static str,
    },
    /// Grid and specimen do not fit.
    #[error(transparent)]
    Voxel(#[from] VoxelError),
    /// Noise or sensitivities are unusable.
    #[error(transparent)]
    Information(#[from] InformationError),
    /// The material to start from is not valid.
    #[error("the start of the fit: {0}")]
    InvalidStart(#[from] MaterialError),
    /// The exponents at the start are closer than the fit allows.
    #[error(
        "at the start the exponents {larger} and {smaller} differ by less than {min_gap}; start further apart or lower \
         `min_alpha_gap`"
    )]
    CloseExponents {
        /// The larger exponent.
        larger: f64,
        /// The next smaller one.
        smaller: f64,
        /// [`super::FitOptions::min_alpha_gap`].
        min_gap: f64,
    },
    /// Displacements of a face were given to what needs those of the volume.
    #[error("{what} needs displacements of the volume, and the recording is of the face {face} alone; scan the volume")]
    NeedsVolume {
        /// What was asked for.
        what: &'static str,
        /// The face.
        face: &'static str,
    },
    /// What was measured at the boundary cannot be imposed.
    #[error("the measured boundary cannot be imposed: {reason}; take the plates as commanded")]
    NoMeasuredBoundary {
        /// Why.
        reason: &'static str,
    },
    /// A force that was to be read on the way to a scan is not in the recording.
    #[error("the force at {drive_mm} mm cannot be read: {reason}; give the load curve, or drives that it passes")]
    NoForceReading {
        /// The drive, mm.
        drive_mm: f64,
        /// Why.
        reason: &'static str,
    },
    /// Lists of the measurement do not belong together.
    #[error("the measurement's {what} has {found} entries, {expected} are needed")]
    DataLength {
        /// Which list.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length it must have.
        expected: usize,
    },
    /// A number of the measurement or of the settings cannot be used.
    #[error("{name} is {value}; it must be {requirement}")]
    InvalidValue {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is needed.
        requirement: &'static str,
    },
    /// The quadratic subproblem has no usable solution.
    #[error("the constrained step could not be found (solver status {status:?}); start closer or use a prior on kappa")]
    Subproblem {
        /// What Clarabel said.
        status: SolverStatus,
    },
    /// No trial had an equilibrium before the iterations ran out.
    #[error("the fit stopped after {iterations} iterations without an equilibrium at its trials: {source}")]
    NoEquilibrium {
        /// Iterations made.
        iterations: usize,
        /// Why the last trial had none.
        source: SolveError,
    },
    /// The fit did not settle.
    #[error(
        "the fit did not converge in {iterations} iterations ({distance:.2e} standard deviations from the optimum of its \
         linear model, limit {limit:.2e}); start closer or raise the limit"
    )]
    NotConverged {
        /// Iterations made.
        iterations: usize,
        /// Distance left, in standard deviations.
        distance: f64,
        /// [`super::FitOptions::tolerance`].
        limit: f64,
    },
}

impl CalibrationError {
    /// Whether this is an outcome of one set of data, which another draw of noise need not share. All others are
    /// mistakes of the set-up or a cancellation.
    pub fn is_of_the_data(&self) -> bool {
        match self {
            CalibrationError::NotConverged { .. }
            | CalibrationError::NoEquilibrium { .. }
            | CalibrationError::Subproblem { .. } => true,
            CalibrationError::Solve(cause) => !matches!(cause, SolveError::Cancelled { .. }),
            _ => false,
        }
    }
}
