//! The next scan: which drive, protocol or specimen should come next, what it is worth, and whether it is needed.
//!
//! A law is fitted to what has been recorded so far, with the coarse mesh's own error taken off. What the fit leaves
//! beyond noise is a discrepancy that neighbouring voxels share; it weighs what has been recorded and, grown with the
//! distance from the states visited so far, what a candidate promises. Candidates are compared by what the posterior
//! and they together promise, on average over materials that the posterior leaves possible, per minute.

mod advise;
mod body;
mod candidate;
mod correction;
mod discrepancy;
mod error;
mod error_left;
mod options;
mod posterior;
mod result;
mod scanned;
mod seen;
mod trial;
mod two_meshes;
mod visited;
mod worth;

pub use advise::advise;
pub use error::NextError;
pub use options::{NextOptions, Plan, Precision};
pub use result::{CandidateResult, LeftOut, MisfitResult, NextParameter, NextResult, Stop, StopVerdict};
