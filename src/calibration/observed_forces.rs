//! The forces of a recording: those of its scans, and those read from its load curve on the way to them.

use super::error::CalibrationError;
use super::force_readings::{ForceOnTheWay, LoadCell, ObservedForce};
use super::observed::Observed;
use crate::recording::Recording;
use crate::sensitivity::Protocol;
use crate::specimen::farthest_from_zero;

impl Observed {
    /// With the forces that `recording`, which this is, has in its load curve at the drives of `protocol`, and a load
    /// cell as unknown as it says. Forces without a standard deviation get `force_sd_n`.
    ///
    /// # Errors
    /// [`CalibrationError::NoForceReading`].
    pub fn with_protocol(
        mut self,
        recording: &Recording,
        protocol: &Protocol,
        force_sd_n: f64,
    ) -> Result<Observed, CalibrationError> {
        self.on_the_way = read_on_the_way(recording, protocol, force_sd_n).collect::<Result<_, _>>()?;
        self.load_cell = LoadCell::of_protocol(protocol);
        Ok(self)
    }

    /// As [`Self::with_protocol`] with those of the forces that are there; why not, of each of the others.
    pub fn with_readings_found(
        mut self,
        recording: &Recording,
        protocol: &Protocol,
        force_sd_n: f64,
    ) -> (Observed, Vec<CalibrationError>) {
        let mut missing = Vec::new();
        self.on_the_way.clear();
        for reading in read_on_the_way(recording, protocol, force_sd_n) {
            match reading {
                Ok(reading) => self.on_the_way.push(reading),
                Err(error) => missing.push(error),
            }
        }
        self.load_cell = LoadCell::of_protocol(protocol);
        (self, missing)
    }

    /// Drives of the scans, then those of the forces read on the way, mm.
    pub fn all_drives_mm(&self) -> Vec<f64> {
        let scanned = self.steps.iter().map(|s| s.drive_mm);
        scanned.chain(self.on_the_way.iter().map(|r| r.drive_mm)).collect()
    }

    /// The same without the forces read on the way.
    pub fn without_readings(&self) -> Observed {
        let mut scans = self.clone();
        scans.on_the_way.clear();
        scans
    }

    /// The force at each drive, those of the scans first, then those read on the way.
    pub fn forces(&self) -> impl Iterator<Item = Option<ObservedForce>> {
        self.steps.iter().map(|s| s.force).chain(self.on_the_way.iter().map(|r| Some(r.force)))
    }

    /// The same, to be changed.
    pub fn forces_mut(&mut self) -> impl Iterator<Item = Option<&mut ObservedForce>> {
        let scanned = self.steps.iter_mut().map(|s| s.force.as_mut());
        scanned.chain(self.on_the_way.iter_mut().map(|r| Some(&mut r.force)))
    }

    /// Forces compared.
    pub(super) fn num_forces(&self) -> usize {
        self.forces().flatten().count()
    }
}

/// The forces that `recording`'s load curve has at the drives at which `protocol` reads the force alone, on the way to
/// the largest drive; readings have the standard deviation of the first step that states one, else `force_sd_n`.
///
/// # Errors
/// Each [`CalibrationError::NoForceReading`]: there is no load curve, or it does not come that far.
pub(super) fn read_on_the_way(
    recording: &Recording,
    protocol: &Protocol,
    force_sd_n: f64,
) -> impl Iterator<Item = Result<ForceOnTheWay, CalibrationError>> {
    let largest_mm = farthest_from_zero(recording.steps.iter().map(|s| s.drive_mm));
    let sd_n = recording.steps.iter().find_map(|s| s.force_sd_n).unwrap_or(force_sd_n);
    let is_scanned = |drive_mm: f64| recording.steps.iter().any(|s| Protocol::is_same_drive(s.drive_mm, drive_mm));
    let drives_mm = protocol.on_the_way_to(largest_mm).force_drives_mm().into_iter();
    drives_mm.filter(move |d| !is_scanned(*d)).map(move |drive_mm| {
        let missing = |reason| CalibrationError::NoForceReading { drive_mm, reason };
        let load = recording.load.as_ref().ok_or(missing("the recording has no load curve"))?;
        let found = load.first_force_n(drive_mm);
        let value_n = found.ok_or(missing("its load curve does not pass that drive"))?;
        Ok(ForceOnTheWay { drive_mm, force: ObservedForce { value_n, sd_n } })
    })
}
