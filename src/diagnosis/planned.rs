//! A scan that is planned, as the recording that would be made of it.

use super::error::DiagnosisError;
use crate::calibration::{CalibrationError, Observed};
use crate::recording::{Filter, RecordedStep, Recording};
use crate::sensitivity::{ScanSettings, ScannedVoxels};
use crate::specimen::Specimen;

/// A scan that is planned: what is scanned, how, at which drives, and which forces are expected there.
#[derive(Clone, Copy, Debug)]
pub struct PlannedScan<'a> {
    /// The specimen; samples of other kinds beside it are no part of its recording.
    pub specimen: &'a Specimen,
    /// Voxels and noise, which is taken to be the same in all. Partly filled voxels count like others, as in a
    /// diagnosis.
    pub scan: &'a ScanSettings,
    /// Drives that are scanned, mm.
    pub drives_mm: &'a [f64],
    /// Force of all samples expected at each of them, N; a drive without an entry has no force. They need be right to
    /// some percent only: they say what is allowed for their errors.
    pub forces_n: &'a [f64],
    /// The part of the time of a whole scan that each drive gets; whole scans where there are none.
    pub time_shares: &'a [f64],
}

impl PlannedScan<'_> {
    /// Its recording with all displacements at rest: of what a diagnosis could find in it, only the voxels, the noise
    /// and the forces matter.
    ///
    /// # Errors
    /// [`DiagnosisError::Calibration`] where no voxel is filled with material.
    pub(super) fn observed(&self) -> Result<Observed, DiagnosisError> {
        let specimen =
            Specimen { drive_mm: self.drives_mm.to_vec(), other_samples: Vec::new(), ..self.specimen.clone() };
        let ScannedVoxels { mask, voxels_each, .. } = self.scan.voxels(&specimen).map_err(CalibrationError::from)?;
        let step = |(n, &drive_mm): (usize, &f64)| RecordedStep {
            drive_mm,
            force_n: self.forces_n.get(n).copied(),
            force_sd_n: Some(self.scan.force_sd_n),
            window_s: None,
            displacement: vec![[0.0; 3]; mask.grid.num_voxels()],
        };
        let recording = Recording {
            id: "planned".into(),
            steps: self.drives_mm.iter().enumerate().map(step).collect(),
            specimen,
            grid: mask.grid.clone(),
            mask: mask.spread(&vec![true; mask.num_voxels()], false),
            noise_sd_mm: Some(self.scan.noise().displacement_sd_mm.map(|sd| sd / voxels_each.sqrt())),
            filter: Filter::None,
            load: None,
            notes: None,
        };
        Ok(Observed::new(&recording, self.scan.force_sd_n)?)
    }
}
