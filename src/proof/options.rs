//! Settings of a proof.

use super::draw::HiddenCause;

/// Settings of [`super::prove`].
#[derive(Clone, Debug)]
pub struct ProofOptions {
    /// Recordings per cause.
    pub per_cause: usize,
    /// Recordings without a cause.
    pub controls: usize,
    /// Recordings per cause that the diagnosis is not told of.
    pub unknown: usize,
    /// Seed of all draws.
    pub seed: u64,
    /// Element size of the diagnosis as a factor on the standard one.
    pub mesh_factor: f64,
    /// Causes hidden; all where empty.
    pub only: Vec<HiddenCause>,
}
