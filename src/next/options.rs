//! What is asked of the next scan.

use crate::design::Study;
use crate::specimen::Specimen;
use std::collections::BTreeMap;

/// What may be scanned.
#[derive(Clone, Debug)]
pub struct Plan<'a> {
    /// Its scan, protocol, largest drive and limits hold for every candidate.
    pub study: &'a Study,
    /// The specimens at hand, the study's base among them where it is one.
    pub specimens: Vec<Specimen>,
}

/// How well the parameters are to be known: largest relative standard deviations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Precision {
    /// Of every μ and α that is not named below; none where only those count.
    pub of_all: Option<f64>,
    /// By name: `mu_1`, `alpha_1`, …
    pub by_parameter: BTreeMap<String, f64>,
}

impl Precision {
    /// Whether nothing is asked for.
    pub fn is_empty(&self) -> bool {
        self.of_all.is_none() && self.by_parameter.is_empty()
    }

    /// The largest relative standard deviation of a parameter; infinite where it may be any.
    pub fn of(&self, parameter: &str) -> f64 {
        self.by_parameter.get(parameter).copied().or(self.of_all).unwrap_or(f64::INFINITY)
    }
}

/// Settings of [`super::advise()`].
#[derive(Clone, Debug, PartialEq)]
pub struct NextOptions {
    /// Number of Ogden terms; chosen by BIC, at most three, where it is left out.
    pub num_terms: Option<usize>,
    /// Element size relative to standard.
    pub mesh_factor: f64,
    /// Whether the error of that mesh is extrapolated from a finer one and taken off the recordings.
    pub has_mesh_correction: bool,
    /// Candidates' drives, mm, in the direction of each specimen's own; where left out `num_drives` from
    /// the study's smallest to its largest.
    pub drives_mm: Option<Vec<f64>>,
    /// Number of those.
    pub num_drives: usize,
    /// Minutes of one scanned drive.
    pub scan_minutes: f64,
    /// Minutes for another specimen than the last recording's.
    pub change_minutes: f64,
    /// When it is enough.
    pub precision: Precision,
}

impl Default for NextOptions {
    /// A mesh for answers while the sample is in the scanner, three drives, 12 minutes a scan, 20 a change of the
    /// specimen (a block unclamped, the next one glued beforehand and clamped), no end.
    fn default() -> Self {
        NextOptions {
            num_terms: None,
            mesh_factor: 2.5,
            has_mesh_correction: true,
            drives_mm: None,
            num_drives: 3,
            scan_minutes: 12.0,
            change_minutes: 20.0,
            precision: Precision::default(),
        }
    }
}
