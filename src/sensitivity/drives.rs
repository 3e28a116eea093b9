//! At which drives a specimen is evaluated, and the search for the drive that reaches a median stretch.

use super::error::EvaluationError;
use super::fixture::Fixture;
use super::observation::median;
use crate::fem::{Equilibrium, SolveOptions};
use crate::material::Material;
use crate::specimen::{Specimen, TestKind, leads_on};
use serde::{Deserialize, Serialize};

/// Largest median stretch that may be asked for.
const MAX_MEDIAN_STRETCH: f64 = 5.0;
/// Accuracy of the median stretch reached.
const MEDIAN_TOLERANCE: f64 = 1e-5;
/// Equilibria in the search for a drive. Safeguarded secant steps need about six.
const MAX_DRIVE_SOLVES: usize = 30;

/// At which drives to evaluate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveSelection {
    /// These, mm: away from rest in one direction.
    DriveMm(Vec<f64>),
    /// The one at which the median of λ over voxels has this value.
    MedianStretch(f64),
}

impl DriveSelection {
    /// How many drives are evaluated.
    pub fn count(&self) -> usize {
        match self {
            DriveSelection::DriveMm(drives_mm) => drives_mm.len(),
            DriveSelection::MedianStretch(_) => 1,
        }
    }
}

/// Refuses empty, unordered and unreachable selections, and drives the other way than the specimen's own.
pub(super) fn check_drives(specimen: &Specimen, drives: &DriveSelection) -> Result<(), EvaluationError> {
    match drives {
        DriveSelection::DriveMm(drives_mm) => {
            if drives_mm.is_empty() {
                return Err(EvaluationError::NoDrive);
            }
            let mut previous_mm = 0.0;
            for &drive_mm in drives_mm {
                if !drive_mm.is_finite() || !leads_on(previous_mm, drive_mm) {
                    return Err(EvaluationError::InvalidDrive { drive_mm, previous_mm });
                }
                if specimen.is_other_way(drive_mm) {
                    let specimen_mm = specimen.largest_drive_mm();
                    return Err(EvaluationError::OtherWay { drive_mm, specimen_mm });
                }
                previous_mm = drive_mm;
            }
            Ok(())
        }
        &DriveSelection::MedianStretch(value) => {
            if value > 1.0 + MEDIAN_TOLERANCE && value <= MAX_MEDIAN_STRETCH {
                Ok(())
            } else {
                Err(EvaluationError::InvalidMedianStretch { value, limit: MAX_MEDIAN_STRETCH })
            }
        }
    }
}

/// The drive at which a homogeneous specimen has stretch amplitude λ, in the direction of its own drives: shear
/// γ = λ − 1/λ over the thickness, or λ − 1 over the length, which in compression (k = 0) is 1/λ − 1.
fn homogeneous_drive_mm(specimen: &Specimen, stretch: f64) -> f64 {
    match specimen.test {
        TestKind::Uniaxial if specimen.is_compressed() => (1.0 / stretch - 1.0) * specimen.block.length_mm,
        TestKind::DoubleLapShear if specimen.largest_drive_mm() < 0.0 => {
            (1.0 / stretch - stretch) * specimen.block.harmonic_thickness_mm()
        }
        TestKind::DoubleLapShear => (stretch - 1.0 / stretch) * specimen.block.harmonic_thickness_mm(),
        TestKind::Uniaxial => (stretch - 1.0) * specimen.block.length_mm,
    }
}

/// Equilibria of each part of a fixture, and how many were solved for.
type Paths = (Vec<Vec<Equilibrium>>, usize);

/// Solves for the drive at which the median of λ over all scanned voxels is `target`, each equilibrium from the last.
pub(super) fn solve_for_median(
    fixture: &mut Fixture,
    material: &Material,
    target: f64,
    options: &SolveOptions,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Paths, EvaluationError> {
    let mut last: Vec<Option<Equilibrium>> = fixture.parts().iter().map(|_| None).collect();
    let mut count = 0;
    let guess_mm = homogeneous_drive_mm(fixture.specimen(), target);
    find_drive(guess_mm, target, |drive_mm| {
        let mut stretches = Vec::new();
        for (part, last) in fixture.parts_mut().iter_mut().zip(&mut last) {
            let found = part.model.solve(material, drive_mm, last.as_ref(), options, is_cancelled)?;
            if let Some(scanner) = &part.scanner {
                let own = scanner.stretches(&found.displacement)?;
                (0..part.num_scanned).for_each(|_| stretches.extend(&own));
            }
            *last = Some(found);
            count += 1;
        }
        Ok(median(stretches).unwrap_or(1.0))
    })?;
    // `find_drive` succeeds only after at least one solve.
    let found: Option<Vec<Vec<Equilibrium>>> = last.into_iter().map(|e| Some(vec![e?])).collect();
    found.map(|paths| (paths, count)).ok_or(EvaluationError::NoDrive)
}

/// Finds the drive at which a function `median_at(drive)` that rises away from rest, where it is 1, has the value
/// `target`: secant steps inside a bracket, else bisection. The last call is at the drive returned.
fn find_drive(
    guess_mm: f64,
    target: f64,
    mut median_at: impl FnMut(f64) -> Result<f64, EvaluationError>,
) -> Result<f64, EvaluationError> {
    // Ends of the bracket: drive and median less target.
    let (mut low, mut high): ((f64, f64), Option<(f64, f64)>) = ((0.0, 1.0 - target), None);
    let mut was_below = None;
    let (mut drive_mm, mut found) = (guess_mm, 1.0);
    for _ in 0..MAX_DRIVE_SOLVES {
        found = median_at(drive_mm)?;
        let excess = found - target;
        if excess.abs() <= MEDIAN_TOLERANCE {
            return Ok(drive_mm);
        }
        let is_below = excess < 0.0;
        // Regula falsi stalls on curved functions; the value at an end that is kept twice is halved (Illinois).
        let is_repeated = was_below == Some(is_below);
        was_below = Some(is_below);
        if is_below {
            low = (drive_mm, excess);
            if let Some(end) = high.as_mut().filter(|_| is_repeated) {
                end.1 *= 0.5;
            }
        } else {
            high = Some((drive_mm, excess));
            if is_repeated {
                low.1 *= 0.5;
            }
        }
        drive_mm = match high {
            // Still below: along the chord from rest, at most doubling.
            None => drive_mm * ((target - 1.0) / (found - 1.0).max(1e-9)).clamp(1.02, 2.0),
            Some((end, value)) => low.0 + (end - low.0) * (low.1 / (low.1 - value)).clamp(0.02, 0.98),
        };
    }
    Err(EvaluationError::MedianStretchNotReached { target, found, drive_mm, num_solves: MAX_DRIVE_SOLVES })
}

#[cfg(test)]
mod tests;
