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

impl Default for ProofOptions {
    /// Twenty recordings of every cause, ten of every cause that the diagnosis is not told of, a hundred controls.
    fn default() -> Self {
        ProofOptions { per_cause: 20, controls: 100, unknown: 10, seed: 1, mesh_factor: 1.8, only: Vec::new() }
    }
}
