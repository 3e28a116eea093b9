//! The protocol of an experiment beside its scans: forces read on the way, and what is not known exactly of the set-up.

use crate::field::schema::{number_above, number_within, numbers, schema_type};
use crate::field::{FieldError, FieldPath};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

schema_type! {
    /// Drives, mm, each above 0.
    ForceDrivesMm = numbers(number_above(0.0), 0..=1000);
    /// A standard deviation of at most 1000, or 0 for what is known exactly.
    SdOrZero = number_within(0.0..=1000.0);
}

/// Drives closer than this are one, mm.
pub(super) const SAME_DRIVE_MM: f64 = 1e-9;

/// Forces that are read beside those at the scans, and what is known of the set-up no better than by a standard
/// deviation. Such unknowns are common to all drives; they are estimated together with the material, so that a promise
/// does not rest on a perfect load cell or drive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = ProtocolSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Protocol {
    /// Drives at which the force alone is read, mm: on the way to a scan they take no time in the scanner.
    #[schema(value_type = ForceDrivesMm)]
    pub force_drive_mm: Vec<f64>,
    /// Standard deviation of the load cell's gain, as a part of the force.
    #[schema(value_type = SdOrZero)]
    pub force_gain_sd: f64,
    /// Standard deviation of the load cell's zero, N.
    #[schema(value_type = SdOrZero)]
    pub force_zero_sd_n: f64,
    /// Standard deviation of the drive's zero, mm: every drive is as much too large or too small.
    #[schema(value_type = SdOrZero)]
    pub drive_zero_sd_mm: f64,
}

/// An unknown of the set-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Nuisance {
    /// The load cell's gain.
    ForceGain,
    /// The load cell's zero.
    ForceZero,
    /// The drive's zero.
    DriveZero,
}

impl Protocol {
    /// The unknowns, each with the standard deviation to which it is known beforehand.
    pub(super) fn nuisances(&self) -> Vec<(Nuisance, f64)> {
        [
            (Nuisance::ForceGain, self.force_gain_sd),
            (Nuisance::ForceZero, self.force_zero_sd_n),
            (Nuisance::DriveZero, self.drive_zero_sd_mm),
        ]
        .into_iter()
        .filter(|(_, sd)| *sd > 0.0)
        .collect()
    }

    /// The same without the forces that are not on the way to `drive_mm`: those at it or beyond.
    pub fn on_the_way_to(&self, drive_mm: f64) -> Protocol {
        let mut own = self.clone();
        own.force_drive_mm.retain(|d| *d < drive_mm - SAME_DRIVE_MM);
        own
    }

    /// The drives at which the force alone is read, in order and each once, mm.
    pub fn force_drives_mm(&self) -> Vec<f64> {
        let mut drives = self.force_drive_mm.clone();
        drives.sort_by(f64::total_cmp);
        drives.dedup_by(|a, b| (*a - *b).abs() < SAME_DRIVE_MM);
        drives
    }

    /// Every number that is not what it must be.
    pub fn field_errors(&self) -> Vec<FieldError> {
        let mut errors = Vec::new();
        for (index, drive_mm) in self.force_drive_mm.iter().enumerate() {
            if !(*drive_mm > 0.0 && drive_mm.is_finite()) {
                let path = FieldPath::of("force_drive_mm").index(index);
                errors.push(FieldError::new(path.pointer(), *drive_mm, "a finite number above 0"));
            }
        }
        let sds = [
            ("force_gain_sd", self.force_gain_sd),
            ("force_zero_sd_n", self.force_zero_sd_n),
            ("drive_zero_sd_mm", self.drive_zero_sd_mm),
        ];
        for (name, sd) in sds {
            if !(sd >= 0.0 && sd.is_finite()) {
                errors.push(FieldError::new(FieldPath::of(name).pointer(), sd, "a finite number, 0 or above"));
            }
        }
        errors
    }
}
