//! What a study counts that asks for errors of the experiment to be found: for each parameter of some causes the
//! smallest size that a diagnosis would name.
//!
//! A design's gain in one of them is the base's size over its own. Sizes are compared where both designs have them:
//!
//! * Of several holes the worst counts, the one whose error must be largest to be named. A design without holes has no
//!   hole that could be wrong: it has no gain there, neither good nor bad, and is as good as the base where nothing
//!   else counts.
//! * The third parameter of a hole is its place across, whatever the direction of the hole.
//! * A cause that is looked for at several drives alone is not counted against a base that is scanned at one.
//! * A size that would never be named counts as the largest that it may have.

use super::evaluation_failure::EvaluationFailure;
use super::study::Study;
use crate::diagnosis::{DiagnosisError, DiagnosisOptions, PlannedScan, Registry, detectable};
use crate::material::Material;
use crate::sensitivity::{DetectableSize, DetectionLimit, Evaluation};
use crate::specimen::{Hole, Specimen};

/// The causes that count where a study names none: those that take the largest errors to be named.
const CAUSES: [&str; 3] = ["gain", "hole", "registration"];
/// Element size of the mesh on which a diagnosis is foreseen, as a factor on that of the mesh on which a design is
/// solved: a diagnosis models the whole sample, and its derivatives are differences, of which coarse elements know
/// enough.
const MESH_FACTOR: f64 = 1.5;

/// A parameter of a cause that counts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Counted {
    /// The cause.
    pub(super) cause: String,
    /// Number of the parameter among the cause's.
    pub(super) place: usize,
    /// Its name; of a hole's place across that of the first direction that the study tries.
    pub(super) parameter: String,
}

/// What a study counts, in a fixed order.
///
/// # Errors
/// The first entry of `objective.causes` that is no cause, or no parameter of one, for which every recording of such
/// specimens is tested.
pub(super) fn counted(study: &Study) -> Result<Vec<Counted>, String> {
    let tested = tested_with_a_hole(study);
    let named = &study.objective.causes;
    let names: Vec<&str> = if named.is_empty() { CAUSES.to_vec() } else { named.iter().map(String::as_str).collect() };
    let mut counted: Vec<Counted> = Vec::new();
    for entry in names {
        let (cause, parameter) = entry.split_once('/').map_or((entry, None), |(c, p)| (c, Some(p)));
        let meant = tested.iter().filter(|t| t.cause == cause && parameter.is_none_or(|p| p == t.parameter));
        let mut is_known = false;
        for t in meant {
            is_known = true;
            if !counted.iter().any(|c| c.cause == t.cause && c.place == t.place) {
                counted.push(t.clone());
            }
        }
        if !is_known {
            return Err(entry.into());
        }
    }
    Ok(counted)
}

/// Everything that can be counted: `cause/parameter`.
pub(super) fn countable(study: &Study) -> Vec<String> {
    tested_with_a_hole(study).into_iter().map(|t| format!("{}/{}", t.cause, t.parameter)).collect()
}

/// The parameters of all causes for which every recording is tested, of the base with a hole along each direction that
/// the study tries.
fn tested_with_a_hole(study: &Study) -> Vec<Counted> {
    let mut all: Vec<Counted> = Vec::new();
    for axis in study.axes() {
        // Only that there is a hole matters; nothing is meshed.
        let hole = Hole::circle(axis, [0.0; 2], 1.0);
        let holed = Specimen { holes: vec![hole], ..study.base.clone() };
        for (cause, place, parameter) in Registry::standard().tested_parameters(&holed) {
            let found = Counted { cause: cause.as_str().into(), place, parameter };
            if !all.contains(&found) {
                all.push(found);
            }
        }
    }
    all
}

/// What a diagnosis of a design's evaluated scan would find, foreseen on a mesh that goes with one of `mesh_factor`.
///
/// # Errors
/// [`EvaluationFailure`].
pub(super) fn sizes_of(
    study: &Study,
    specimen: &Specimen,
    material: &Material,
    evaluation: &Evaluation,
    mesh_factor: f64,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<DetectableSize>, EvaluationFailure> {
    let drives_mm: Vec<f64> = evaluation.steps.iter().map(|s| s.drive_mm).collect();
    let forces_n: Vec<f64> = evaluation.steps.iter().map(|s| s.force_n).collect();
    let planned = PlannedScan {
        specimen,
        scan: &study.scan,
        drives_mm: &drives_mm,
        forces_n: &forces_n,
        time_shares: &evaluation.scan_share,
    };
    let options = DiagnosisOptions { mesh_factor: MESH_FACTOR * mesh_factor, ..DiagnosisOptions::default() };
    let found = detectable(&planned, material, &options, is_cancelled).map_err(|error| match error {
        DiagnosisError::Solve(e) => e.into(),
        DiagnosisError::Prepare(e) => e.into(),
        other => EvaluationFailure::Geometry { reason: other.to_string() },
    })?;
    Ok(found.iter().map(|d| d.row()).collect())
}

/// ln of the sizes that count; `None` for what a design does not have.
pub(super) fn log_sizes(counted: &[Counted], rows: &[DetectableSize]) -> Vec<Option<f64>> {
    let is_same = |a: &DetectableSize, b: &DetectableSize| a.cause == b.cause && a.description == b.description;
    let of = |c: &Counted| {
        let suspects = rows.chunk_by(is_same).filter(|suspect| suspect[0].cause == c.cause);
        let own = suspects.filter_map(|suspect| suspect.get(c.place));
        let seen = own.filter(|row| row.limited_by != DetectionLimit::Drives);
        seen.map(|row| row.size.unwrap_or(row.largest).ln()).reduce(f64::max)
    };
    counted.iter().map(of).collect()
}

/// ln of base over own for every size that both have; a gain of 1 where there is none.
pub(super) fn log_gains(own: &[Option<f64>], base: &[Option<f64>]) -> Vec<f64> {
    let gains: Vec<f64> = own.iter().zip(base).filter_map(|(own, base)| Some((*base)? - (*own)?)).collect();
    if gains.is_empty() { vec![0.0] } else { gains }
}

#[cfg(test)]
#[path = "detection_tests.rs"]
mod tests;
