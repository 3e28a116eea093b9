//! The local problem of one structure: evaluations with gradients, in scaled variables.

use super::aim::Combine;
use super::explore::geometry_margins;
use super::local::{LocalModel, LocalProblem};
use super::objective::Reference;
use super::search_run::SearchRun;
use super::space::Subspace;
use std::sync::atomic::{AtomicBool, Ordering};

/// A structure's local problem.
pub(super) struct StructureProblem<'a> {
    pub search: &'a SearchRun<'a>,
    pub reference: &'a Reference<'a>,
    pub subspace: &'a Subspace,
    /// Set when an evaluation was cancelled.
    pub was_stopped: AtomicBool,
    /// Called after each evaluation.
    pub on_evaluation: &'a (dyn Fn() + Sync),
}

/// ln of the factor by which an improvement stays away from force, stretch and guard limits: the search's mesh is
/// coarser than the confirmation's, and a limit that is just met on the one can be broken on the other.
pub(super) const RESERVE: f64 = 2e-3;

impl<'a> StructureProblem<'a> {
    /// A problem of which nothing has been evaluated yet.
    pub fn new(
        search: &'a SearchRun<'a>,
        reference: &'a Reference<'a>,
        subspace: &'a Subspace,
        on_evaluation: &'a (dyn Fn() + Sync),
    ) -> StructureProblem<'a> {
        StructureProblem { search, reference, subspace, was_stopped: AtomicBool::new(false), on_evaluation }
    }
}

impl LocalProblem for StructureProblem<'_> {
    fn model(&self, x: &[f64]) -> Option<LocalModel> {
        let specimen = self.subspace.specimen(x);
        let judged = match self.search.evaluated(&specimen, Some(self.subspace)) {
            None => {
                self.was_stopped.store(true, Ordering::Relaxed);
                None
            }
            Some(Err(_)) => None,
            Some(Ok(evaluated)) => Some(self.reference.judge(&evaluated)),
        };
        (self.on_evaluation)();
        let judged = judged?;
        // From per-millimetre to per-unit of the scaled variables.
        let scaled = |rows: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let count = rows.first().map_or(0, Vec::len);
            (0..count)
                .map(|entry| {
                    rows.iter()
                        .zip(&self.subspace.ranges)
                        .map(|(row, range)| row[entry] * (range.max - range.min))
                        .collect()
                })
                .collect()
        };
        let is_mean = self.search.study.objective.combine != Combine::Maximin;
        Some(LocalModel {
            weights: if is_mean { judged.weights.clone() } else { Vec::new() },
            gain_gradients: scaled(&judged.gain_gradients),
            margin_gradients: scaled(&judged.margin_gradients),
            gains: judged.gains,
            margins: judged.margins.iter().map(|m| m - RESERVE).collect(),
        })
    }

    fn geometry(&self, x: &[f64]) -> Vec<f64> {
        let study = self.search.study;
        geometry_margins(&self.subspace.specimen(x), &study.limits, study.scan.voxel_mm)
    }

    fn is_free(&self, index: usize) -> bool {
        self.subspace.is_continuous(index)
    }
}
