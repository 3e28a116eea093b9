//! Compares two results of the same kind: evaluations, sweeps or design searches.
//!
//! First whether they can be compared at all (same schema, inputs, scan, mesh, normalisation), then figure by figure:
//! integrated sensitivities should not fall, promised standard deviations should not grow, forces and stretches should
//! stay.

mod error;
mod figure;
mod files;
mod output;
mod read;
mod verdict;

pub use error::CompareError;
pub use figure::{Direction, Figure, Judgement, Line};
pub use files::{Pair, pairs};
pub use output::{to_junit, to_markdown, to_text};
pub use read::{Subject, read, subject_of};
pub use verdict::{CompareOptions, Comparison, compare};
