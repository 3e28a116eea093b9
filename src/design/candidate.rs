//! A design that a search has seen.

use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};

/// One design that the search has seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// The design; its drives are those it is scanned at.
    pub specimen: Specimen,
    /// Gain over the base at search fidelity.
    pub objective: f64,
    /// ln of the objective less penalties.
    pub merit: f64,
    /// Whether force, stretch and guard limits hold at search fidelity.
    pub is_within_limits: bool,
    /// Where it came from.
    pub stage: String,
}
