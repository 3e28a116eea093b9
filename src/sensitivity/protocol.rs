//! The protocol of an experiment: which samples are scanned, how the time is shared out, forces read on the way, and
//! what is not known exactly of the set-up.

#[cfg(feature = "schema")]
use crate::field::schema::{integer_within, number, number_within, numbers, schema_type};
use crate::field::{FieldError, FieldPath};
use crate::specimen::{MAX_OTHER_SAMPLES, MAX_SAMPLES_IN_PARALLEL, Specimen, leads_on};
use serde::{Deserialize, Serialize};

#[cfg(feature = "schema")]
schema_type! {
    /// Drives, mm, none of them 0.
    ForceDrivesMm = numbers(number(), 0..=1000);
    /// A standard deviation of at most 1000, or 0 for what is known exactly.
    SdOrZero = number_within(0.0..=1000.0);
    /// A standard deviation of an angle, degrees, or 0 for what is known exactly.
    PlateTiltSdDeg = number_within(0.0..=MAX_TILT_SD_DEG);
    /// A number of samples.
    BlocksScanned = integer_within(1..=MAX_BLOCKS_SCANNED as usize);
    /// Shares of the time of one scan, each above 0, together at most 1.
    ScanShares = numbers(number_within(LEAST_SHARE..=1.0), 0..=1000);
}

/// Most samples that a scan can see: as many as a specimen can have.
const MAX_BLOCKS_SCANNED: u32 = MAX_SAMPLES_IN_PARALLEL + MAX_OTHER_SAMPLES as u32;
/// Largest standard deviation of a plate's angles, degrees: what they change is told to first order.
const MAX_TILT_SD_DEG: f64 = 10.0;
/// Smallest share of the time that a scan may get: less is none.
const LEAST_SHARE: f64 = 1e-6;
/// Rounding that shares which use up all of the time may have.
const SHARE_SLACK: f64 = 1e-9;

/// Drives closer than this are one, mm.
pub(super) const SAME_DRIVE_MM: f64 = 1e-9;

/// Which samples are scanned and for how long, forces that are read beside those at the scans, and what is known of the
/// set-up no better than by a standard deviation. Such unknowns are common to all drives; they are estimated together
/// with the material, so that a promise does not rest on a perfect load cell or drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = ProtocolSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Protocol {
    /// Drives at which the force alone is read, mm, in the direction of the specimen's: on the way to a scan they take
    /// no time in the scanner.
    #[cfg_attr(feature = "schema", schema(value_type = ForceDrivesMm))]
    pub force_drive_mm: Vec<f64>,
    /// Standard deviation of the load cell's gain, as a part of the force.
    #[cfg_attr(feature = "schema", schema(value_type = SdOrZero))]
    pub force_gain_sd: f64,
    /// Standard deviation of the load cell's zero, N.
    #[cfg_attr(feature = "schema", schema(value_type = SdOrZero))]
    pub force_zero_sd_n: f64,
    /// Standard deviation of the drive's zero, mm: every drive is as much too large or too small.
    #[cfg_attr(feature = "schema", schema(value_type = SdOrZero))]
    pub drive_zero_sd_mm: f64,
    /// Standard deviation of the angles by which the moved plate or grip is turned about x, y and z, each, degrees: at
    /// every drive alike, about the centre of its bonded face.
    #[serde(skip_serializing_if = "is_exact")]
    #[cfg_attr(feature = "schema", schema(value_type = PlateTiltSdDeg))]
    pub plate_tilt_sd_deg: f64,
    /// How many of the specimen's samples are scanned, the first ones of those listed. They lie in the scanner
    /// together, so that each has the voxels and the noise of the scan, and another one takes no time.
    #[serde(skip_serializing_if = "is_one")]
    #[cfg_attr(feature = "schema", schema(value_type = BlocksScanned))]
    pub blocks_scanned: u32,
    /// Shares of the time of one scan that the scanned drives get, one for each in their order, together at most 1:
    /// noise grows as 1/√share. Without any, every drive gets the time of a whole scan.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[cfg_attr(feature = "schema", schema(value_type = ScanShares))]
    pub scan_share: Vec<f64>,
}

fn is_exact(sd: &f64) -> bool {
    !(sd.abs() > 0.0)
}

fn is_one(blocks: &u32) -> bool {
    *blocks == 1
}

impl Default for Protocol {
    /// The first sample scanned for a whole scan at every drive, forces at the scans alone, nothing unknown.
    fn default() -> Self {
        Protocol {
            force_drive_mm: Vec::new(),
            force_gain_sd: 0.0,
            force_zero_sd_n: 0.0,
            drive_zero_sd_mm: 0.0,
            plate_tilt_sd_deg: 0.0,
            blocks_scanned: 1,
            scan_share: Vec::new(),
        }
    }
}

/// Why a protocol does not suit a specimen.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProtocolMismatch {
    /// More samples are to be scanned than there are.
    #[error("blocks_scanned is {value}, and the specimen has {num_samples} samples; scan at most so many")]
    BlocksScanned {
        /// Samples to be scanned.
        value: u32,
        /// Samples of the specimen.
        num_samples: usize,
    },
    /// There is not one share of the time for each scanned drive.
    #[error("scan_share has {count} entries for {num_drives} scanned drives; give one for each, or none")]
    Shares {
        /// Shares.
        count: usize,
        /// Scanned drives.
        num_drives: usize,
    },
    /// A force is to be read on a way that the specimen does not go.
    #[error(
        "force_drive_mm[{index}] is {drive_mm} mm, and the specimen is driven to {specimen_mm} mm; read forces on that way"
    )]
    OtherWay {
        /// Which drive of the protocol.
        index: usize,
        /// The drive, mm.
        drive_mm: f64,
        /// The specimen's largest, mm.
        specimen_mm: f64,
    },
}

impl ProtocolMismatch {
    /// The same as an error of a field of the protocol.
    pub fn field_error(&self) -> FieldError {
        match self {
            ProtocolMismatch::BlocksScanned { value, num_samples } => {
                FieldError::new("/blocks_scanned", *value, format!("at most the specimen's {num_samples} samples"))
            }
            ProtocolMismatch::Shares { count, num_drives } => {
                let value = format!("a list of {count}");
                FieldError::new("/scan_share", value, format!("one share for each of {num_drives} scanned drives"))
                    .remedy("or leave it out: every drive then gets the time of a whole scan")
            }
            ProtocolMismatch::OtherWay { index, drive_mm, specimen_mm } => {
                let path = FieldPath::of("force_drive_mm").index(*index);
                FieldError::new(path.pointer(), *drive_mm, format!("on the way from 0 to {specimen_mm} mm"))
            }
        }
    }
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
    /// The moved plate's angle about an axis.
    PlateTilt(usize),
}

impl Nuisance {
    /// Whether it is one of the load cell, which voxels do not see.
    pub(super) fn is_of_load_cell(self) -> bool {
        match self {
            Nuisance::ForceGain | Nuisance::ForceZero => true,
            Nuisance::DriveZero | Nuisance::PlateTilt(_) => false,
        }
    }
}

impl Protocol {
    /// The unknowns, each with the standard deviation to which it is known beforehand.
    pub(super) fn nuisances(&self) -> Vec<(Nuisance, f64)> {
        let tilts = [0, 1, 2].map(|axis| (Nuisance::PlateTilt(axis), self.plate_tilt_sd_deg.to_radians()));
        [
            (Nuisance::ForceGain, self.force_gain_sd),
            (Nuisance::ForceZero, self.force_zero_sd_n),
            (Nuisance::DriveZero, self.drive_zero_sd_mm),
        ]
        .into_iter()
        .chain(tilts)
        .filter(|(_, sd)| *sd > 0.0)
        .collect()
    }

    /// Whether a specimen that is scanned at `num_drives` drives can be measured so.
    ///
    /// # Errors
    /// [`ProtocolMismatch`].
    pub fn suits(&self, specimen: &Specimen, num_drives: usize) -> Result<(), ProtocolMismatch> {
        let num_samples = specimen.num_samples();
        if self.blocks_scanned as usize > num_samples {
            return Err(ProtocolMismatch::BlocksScanned { value: self.blocks_scanned, num_samples });
        }
        if !self.scan_share.is_empty() && self.scan_share.len() != num_drives {
            return Err(ProtocolMismatch::Shares { count: self.scan_share.len(), num_drives });
        }
        if let Some(index) = self.force_drive_mm.iter().position(|d| specimen.is_other_way(*d)) {
            let (drive_mm, specimen_mm) = (self.force_drive_mm[index], specimen.largest_drive_mm());
            return Err(ProtocolMismatch::OtherWay { index, drive_mm, specimen_mm });
        }
        Ok(())
    }

    /// The part of a scan's time that the scanned drive with this index gets.
    pub fn share(&self, drive_index: usize) -> f64 {
        self.scan_share.get(drive_index).copied().unwrap_or(1.0)
    }

    /// Whether two drives (mm) are one.
    pub fn is_same_drive(a_mm: f64, b_mm: f64) -> bool {
        (a_mm - b_mm).abs() < SAME_DRIVE_MM
    }

    /// The same without the forces that are not on the way to `drive_mm`: those at it or beyond.
    pub fn on_the_way_to(&self, drive_mm: f64) -> Protocol {
        let mut own = self.clone();
        own.force_drive_mm.retain(|d| leads_on(*d, drive_mm) && !Protocol::is_same_drive(*d, drive_mm));
        own
    }

    /// The drives at which the force alone is read, away from rest and each once, mm.
    pub fn force_drives_mm(&self) -> Vec<f64> {
        let mut drives = self.force_drive_mm.clone();
        drives.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        drives.dedup_by(|a, b| Protocol::is_same_drive(*a, *b));
        drives
    }

    /// Every number that is not what it must be.
    pub fn field_errors(&self) -> Vec<FieldError> {
        let mut errors = Vec::new();
        for (index, drive_mm) in self.force_drive_mm.iter().enumerate() {
            if !(drive_mm.abs() > 0.0 && drive_mm.is_finite()) {
                let path = FieldPath::of("force_drive_mm").index(index);
                errors.push(FieldError::new(path.pointer(), *drive_mm, "a finite number, above or below 0"));
            }
        }
        if !(1..=MAX_BLOCKS_SCANNED).contains(&self.blocks_scanned) {
            let allowed = format!("from 1 to {MAX_BLOCKS_SCANNED}");
            errors.push(FieldError::new("/blocks_scanned", self.blocks_scanned, allowed));
        }
        for (index, share) in self.scan_share.iter().enumerate() {
            if !(LEAST_SHARE..=1.0).contains(share) {
                let path = FieldPath::of("scan_share").index(index);
                errors.push(FieldError::new(path.pointer(), *share, format!("from {LEAST_SHARE} to 1")));
            }
        }
        let total: f64 = self.scan_share.iter().sum();
        if total > 1.0 + SHARE_SLACK {
            let found = format!("shares of {total} together");
            errors.push(FieldError::new("/scan_share", found, "shares of at most 1 together"));
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
        if !(0.0..=MAX_TILT_SD_DEG).contains(&self.plate_tilt_sd_deg) {
            let allowed = format!("from 0 to {MAX_TILT_SD_DEG}");
            errors.push(FieldError::new("/plate_tilt_sd_deg", self.plate_tilt_sd_deg, allowed));
        }
        errors
    }
}
