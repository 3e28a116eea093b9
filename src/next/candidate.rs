//! What may be scanned next: every specimen at some drives, and every recording once more.

use super::body::{is_same_body, num_done, readings_of};
use super::options::{NextOptions, Plan};
use crate::calibration::Observed;
use crate::sensitivity::Protocol;
use crate::specimen::Specimen;

/// A scan that may come next.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Candidate {
    /// Its specimen, by its place among [`bodies`].
    pub(super) body: usize,
    /// Drives that are scanned, mm, away from rest.
    pub(super) drives_mm: Vec<f64>,
    /// How often each was scanned before.
    pub(super) num_done: Vec<usize>,
    /// Drives of the forces that were read on the way to its specimen's scans, mm, once for each time.
    read_mm: Vec<f64>,
    /// Whether the specimen of the last recording has to be taken out.
    pub(super) is_change: bool,
}

impl Candidate {
    /// Whether all of it was done before.
    pub(super) fn is_repeat(&self) -> bool {
        self.num_done.iter().all(|n| *n > 0)
    }

    /// How often the force was read at a drive on the way to a scan of its specimen.
    pub(super) fn num_read(&self, drive_mm: f64) -> usize {
        self.read_mm.iter().filter(|read| Protocol::is_same_drive(**read, drive_mm)).count()
    }

    /// Minutes of `num` such scans one after another.
    pub(super) fn minutes(&self, num: f64, options: &NextOptions) -> f64 {
        let change = if self.is_change { options.change_minutes } else { 0.0 };
        change + num * options.scan_minutes * self.drives_mm.len() as f64
    }
}

/// The specimens at hand and those of the recordings, each once.
pub(super) fn bodies(observed: &[Observed], plan: &Plan) -> Vec<Specimen> {
    let mut all: Vec<Specimen> = Vec::new();
    for specimen in plan.specimens.iter().chain(observed.iter().map(|o| &o.specimen)) {
        if !all.iter().any(|known| is_same_body(known, specimen)) {
            all.push(specimen.clone());
        }
    }
    all
}

/// How far every specimen at hand may be driven in the direction of its own drives, mm.
pub(super) fn distances_mm(plan: &Plan, options: &NextOptions) -> Vec<f64> {
    if let Some(drives) = &options.drives_mm {
        let mut drives = drives.clone();
        drives.sort_by(f64::total_cmp);
        return drives;
    }
    let range = plan.study.drive_range();
    let num = options.num_drives.max(1);
    let at = |n: usize| match num {
        1 => range.max,
        _ => range.min + (range.max - range.min) * n as f64 / (num - 1) as f64,
    };
    (0..num).map(at).collect()
}

/// All candidates: the specimens at hand at each drive, and what was recorded once more.
pub(super) fn candidates(
    observed: &[Observed],
    bodies: &[Specimen],
    plan: &Plan,
    options: &NextOptions,
) -> Vec<Candidate> {
    let is_change = |body: &Specimen| observed.last().is_none_or(|last| !is_same_body(&last.specimen, body));
    let new = |index: usize, drives_mm: Vec<f64>| -> Candidate {
        let body = &bodies[index];
        let num_done = drives_mm.iter().map(|d| num_done(observed, body, *d)).collect();
        let read_mm = readings_of(observed, body).collect();
        Candidate { body: index, drives_mm, num_done, read_mm, is_change: is_change(body) }
    };
    let mut all: Vec<Candidate> = Vec::new();
    let mut add = |candidate: Candidate| {
        let is_same = |known: &Candidate| {
            let pairs = || known.drives_mm.iter().zip(&candidate.drives_mm);
            known.body == candidate.body
                && known.drives_mm.len() == candidate.drives_mm.len()
                && pairs().all(|(a, b)| Protocol::is_same_drive(*a, *b))
        };
        if !all.iter().any(is_same) {
            all.push(candidate);
        }
    };
    for (index, _) in bodies.iter().enumerate().filter(|(_, b)| plan.specimens.iter().any(|s| is_same_body(s, b))) {
        for distance in distances_mm(plan, options) {
            add(new(index, vec![distance.copysign(bodies[index].largest_drive_mm())]));
        }
    }
    for recording in observed {
        if let Some(index) = bodies.iter().position(|b| is_same_body(b, &recording.specimen)) {
            let mut drives: Vec<f64> = recording.steps.iter().map(|s| s.drive_mm).collect();
            drives.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
            add(new(index, drives));
        }
    }
    all
}
