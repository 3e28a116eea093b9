//! Causes that were looked at, whatever came of it.

use super::cause::CauseIdentity;

/// A suspect that was tested.
#[derive(Clone, Debug)]
pub struct Ranked {
    /// What tells it from other suspects.
    pub identity: CauseIdentity,
    /// In words.
    pub description: String,
    /// Fall of the deviance to first order.
    pub score: f64,
    /// Fall of the deviance in a full fit, less ln n per parameter; none where not fitted.
    pub fitted: Option<f64>,
    /// The round in which it was tested, from 1.
    pub round: usize,
}
