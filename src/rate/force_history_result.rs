//! What a fit of relaxations to a force history gives.

use super::prony::PronyTerm;
use crate::homogeneous::{Interval, Selection};
use serde::{Deserialize, Serialize};

/// One relaxation with its intervals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FittedRelaxation {
    /// g, relative to the equilibrium response.
    pub strength: Interval,
    /// τ, s. Its interval is symmetric in ln τ.
    pub time_s: Interval,
    /// Whether the data determine both.
    pub identifiable: bool,
}

/// The fit with a number of relaxations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceHistoryFit {
    /// Relaxations, shortest first.
    pub relaxations: Vec<FittedRelaxation>,
    /// s.
    pub scale: Interval,
    /// Offset, N.
    pub offset_n: Interval,
    /// Root mean square of data − model, N.
    pub rms_error_n: f64,
    /// Σ (data − model)² / sd² per datum left; none where the sd is not known.
    pub chi2_per_datum: Option<f64>,
    /// The model's force at every sample, N.
    pub force_n: Vec<f64>,
}

impl ForceHistoryFit {
    /// The relaxations as Prony terms.
    pub fn terms(&self) -> Vec<PronyTerm> {
        self.relaxations.iter().map(|r| PronyTerm { strength: r.strength.value, time_s: r.time_s.value }).collect()
    }
}

/// Fits with 0 to N relaxations and the choice among them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceHistorySequence {
    /// The fits, elastic first.
    pub fits: Vec<ForceHistoryFit>,
    /// Which one the data call for.
    pub selection: Selection,
}

impl ForceHistorySequence {
    /// The chosen fit.
    pub fn chosen(&self) -> &ForceHistoryFit {
        &self.fits[self.selection.chosen().min(self.fits.len() - 1)]
    }
}
