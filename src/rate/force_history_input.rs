//! What a fit of relaxations to a force history takes, and why there may be none.

use super::prony::HistoryError;
use crate::homogeneous::TableError;
use crate::material::ShearTerm;

/// A recorded force history.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceHistory {
    /// Times, s, rising.
    pub time_s: Vec<f64>,
    /// Drive at these times, mm.
    pub drive_mm: Vec<f64>,
    /// Force, N.
    pub force_n: Vec<f64>,
    /// Standard deviation of one reading, N; estimated from the fit where not known.
    pub force_sd_n: Option<f64>,
}

/// A layer sheared between plates, for what relaxes in it. Simo's model convolves the isochoric second Piola–Kirchhoff
/// stress, not the force; from an amount of shear of one half on the two differ. The force's memory is then
/// s (∫ dS_xy + γ ∫ dS_yy) with γ = drive / gap, S of the homogeneous layer and s = F∞ / P_xy.
#[derive(Clone, Debug, PartialEq)]
pub struct ShearLayer {
    /// Distance of the plates, mm.
    pub gap_mm: f64,
    /// The material's terms.
    pub terms: Vec<ShearTerm>,
}

/// Settings of [`super::fit_force_history`].
#[derive(Clone, Debug, PartialEq)]
pub struct ForceHistoryOptions {
    /// Fits with 0 to this many relaxations, at most 4.
    pub max_terms: usize,
    /// Whether the table's scale s is free (the material's stiffness) or 1.
    pub is_scale_free: bool,
    /// Whether a constant offset of the load cell is free or 0.
    pub is_offset_free: bool,
    /// Relaxation by Simo's model of a sheared layer; without it the force itself relaxes.
    pub layer: Option<ShearLayer>,
    /// Samples at smaller |drive| are left out of the fit (their history counts), mm. In a specimen with holes the
    /// state near zero drive after a large one is not homogeneous, and the force there is all memory.
    pub min_drive_mm: f64,
}

impl Default for ForceHistoryOptions {
    fn default() -> Self {
        ForceHistoryOptions { max_terms: 3, is_scale_free: true, is_offset_free: true, layer: None, min_drive_mm: 0.0 }
    }
}

/// Why a history cannot be fitted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ForceHistoryError {
    /// The samples are not usable.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// The table does not reach.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A setting is out of its range.
    #[error("{name} is {value}; {requirement}")]
    Setting {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is needed.
        requirement: &'static str,
    },
    /// Too few samples, or a drive that never moves.
    #[error("{samples} samples whose elastic force ranges over {range_n:.3e} N say nothing; record a loading history")]
    NoInformation {
        /// Samples.
        samples: usize,
        /// Largest minus smallest elastic force, N.
        range_n: f64,
    },
}
