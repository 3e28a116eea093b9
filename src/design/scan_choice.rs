//! The end of a search whose scan may vary: the scan that is best for the best design.
//!
//! Voxels and encoding hardly change which specimen is best, and a scan costs no new specimen: it is chosen once the
//! designs are ranked, by the study's objective, and all of them are confirmed in it.

use super::confirm::Confirmed;
use super::fidelity::Fidelity;
use super::search_error::SearchError;
use super::search_run::{Progress, SearchRun};
use super::state::State;
use super::vary_scan::{ChosenScan, VaryScan};
use crate::optimise::Evolution;
use crate::sensitivity::ScanSettings;
use crate::specimen::Specimen;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Standard deviation of the first scans that are tried, as a part of the ranges.
const FIRST_STEP: f64 = 0.2;
/// Scans are stated to so many significant digits: as a protocol is written down.
const DIGITS: i32 = 2;
/// Random numbers of this stage; those of the structures count up from zero.
const STREAM: u64 = u64::MAX;

impl SearchRun<'_> {
    /// The ranked designs in the scan that is best for the best of them, and that scan; as they are where the study's
    /// scan does not vary, or nothing better is found.
    pub(super) fn with_best_scan(
        &self,
        base: &Confirmed,
        ranked: Vec<Confirmed>,
        state: &mut State,
    ) -> Result<(Vec<Confirmed>, Option<ChosenScan>), SearchError> {
        let (Some(vary), Some(best)) = (self.study.vary.scan, ranked.first()) else { return Ok((ranked, None)) };
        let (scan, num_tried) = self.best_scan(&vary, base, &best.specimen, state)?;
        if scan == self.study.scan {
            return Ok((ranked, None));
        }
        let (done, total) = (AtomicUsize::new(0), ranked.len());
        let again: Vec<_> = ranked
            .par_iter()
            .map(|design| {
                let found = self.confirmed_in(&scan, &design.specimen);
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                let (best, leader) = (Some(best.objective), Some(best.specimen.clone()));
                (self.progress)(&Progress { stage: "confirm", done, total, best, leader });
                found
            })
            .collect();
        let mut rescanned = Vec::new();
        for (design, found) in ranked.iter().zip(again) {
            match found {
                None => return Err(state.stopped(self.study, "confirm")),
                Some(Err(cause)) => state.fail(&design.specimen, None, &cause),
                Some(Ok(mut confirmed)) => {
                    confirmed.compare(self.study, base);
                    confirmed.remark.clone_from(&design.remark);
                    rescanned.push(confirmed);
                }
            }
        }
        rescanned.sort_by(Confirmed::by_rank);
        let is_better = |own: &Confirmed| own.is_within_limits && own.objective > best.objective;
        if !rescanned.first().is_some_and(is_better) {
            return Ok((ranked, None));
        }
        let base_objective = match self.confirmed_in(&scan, &base.specimen) {
            None => return Err(state.stopped(self.study, "confirm")),
            Some(Err(_)) => None,
            Some(Ok(mut rescanned)) => {
                rescanned.compare(self.study, base);
                rescanned.is_within_limits.then_some(rescanned.objective)
            }
        };
        Ok((rescanned, Some(ChosenScan { scan, base_objective, num_tried })))
    }

    /// The scan in which `design` is best by the objective on the coarse mesh, and how many were tried: the study's own
    /// where none is better.
    fn best_scan(
        &self,
        vary: &VaryScan,
        base: &Confirmed,
        design: &Specimen,
        state: &mut State,
    ) -> Result<(ScanSettings, usize), SearchError> {
        let study = self.study;
        let reference = self.reference_from(self.estimated(&base.specimen, Fidelity::Coarse), state)?;
        // `None` where it was cancelled.
        let merit = |scan: &ScanSettings| -> Option<f64> {
            if !study.limits.check_geometry(design, scan.voxel_mm).iter().all(|m| m.is_satisfied) {
                return Some(f64::NEG_INFINITY);
            }
            let evaluated = self.estimated_in(scan, design, Fidelity::Coarse)?;
            Some(evaluated.map_or(f64::NEG_INFINITY, |e| reference.merit(&reference.judge(&e))))
        };
        let total = study.budget.scans;
        let (done, leader) = (AtomicUsize::new(1), Some(design.clone()));
        let mut rng = ChaCha8Rng::seed_from_u64(study.seed);
        rng.set_stream(STREAM);
        let mut evolution = Evolution::new(&vary.place_of(&study.scan), FIRST_STEP);
        let mut best = merit(&study.scan).map(|merit| (merit, study.scan));
        while best.is_some() && done.load(Ordering::Relaxed) + evolution.population() <= total {
            let places: Vec<Vec<f64>> = (0..evolution.population())
                .map(|_| evolution.draw(&mut rng).into_iter().map(|at| at.clamp(0.0, 1.0)).collect())
                .collect();
            let tried: Option<Vec<(f64, ScanSettings, Vec<f64>)>> = places
                .into_par_iter()
                .map(|place| {
                    let scan = in_digits(&study.scan, &vary.at(&study.scan, &place));
                    let found = merit(&scan).map(|merit| (merit, scan, place));
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    let (best, leader) = (state.history.last().copied(), leader.clone());
                    (self.progress)(&Progress { stage: "scan", done: done.min(total), total, best, leader });
                    found
                })
                .collect();
            let Some(mut tried) = tried else {
                best = None;
                break;
            };
            tried.sort_by(|a, b| b.0.total_cmp(&a.0));
            best = best.map(|so_far| if tried[0].0 > so_far.0 { (tried[0].0, tried[0].1) } else { so_far });
            let ranked: Vec<Vec<f64>> = tried.into_iter().map(|(_, _, place)| place).collect();
            evolution.learn(&ranked);
        }
        let num_tried = done.load(Ordering::Relaxed);
        state.num_evaluations += num_tried;
        match best {
            Some((_, scan)) => Ok((scan, num_tried)),
            None => Err(state.stopped(study, "scan")),
        }
    }
}

/// A scan of rounded voxels and encoding, as the study's scanner makes it.
fn in_digits(of_study: &ScanSettings, scan: &ScanSettings) -> ScanSettings {
    let rounded = |values: [f64; 3]| values.map(significant);
    of_study.with_voxels(rounded(scan.voxel_mm), scan.mm_per_radian.map(rounded))
}

fn significant(value: f64) -> f64 {
    let step = 10f64.powi(value.log10().floor() as i32 + 1 - DIGITS);
    // A division by a whole number is exact in more digits than a product with a fraction.
    if step < 1.0 { (value / step).round() / (1.0 / step).round() } else { (value / step).round() * step }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_are_stated_in_digits() {
        for (value, expected) in [(0.18754, 0.19), (1.04, 1.0), (0.0996, 0.1), (12.7, 13.0), (0.0123, 0.012)] {
            assert_eq!(significant(value), expected);
        }
        let of_study = ScanSettings { mm_per_radian: Some([0.2; 3]), ..ScanSettings::default() };
        let rounded = in_digits(&of_study, &of_study.with_voxels([1.234, 0.1999, 0.501], Some([0.1234, 0.2, 0.3])));
        assert_eq!((rounded.voxel_mm, rounded.mm_per_radian), ([1.2, 0.2, 0.5], Some([0.12, 0.2, 0.3])));
        // The noise is that of the rounded ones.
        let sd = 0.05 * (1.0 * 0.1875 * 0.75) / (1.2 * 0.2 * 0.5);
        assert!((rounded.noise_sd_mm[1] - sd).abs() < 1e-15 && (rounded.noise_sd_mm[0] - 0.6 * sd).abs() < 1e-15);
    }
}
