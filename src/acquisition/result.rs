//! The result of a scan (`scan/1`).

use super::{AcquisitionError, CameraOptions, Filmed, Reconstruction, Scan, ScanOptions, StepReport, hamming_filtered};
use crate::provenance::VERSION;
use crate::recording::Filter;
use serde::Serialize;
use utoipa::ToSchema;

/// What a synthetic scan holds and what it was made from.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ScanResult {
    /// Always `scan/1`.
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// SHA-256 of specimen, material, mesh and scan settings, hexadecimal.
    pub input_hash: String,
    /// Seed of all noise.
    pub seed: u64,
    /// Whether the folder holds raw phases or displacements.
    pub is_raw: bool,
    /// Filter on the displacements.
    pub filter: Filter,
    /// The settings.
    pub options: SettingsOfScan,
    /// Voxels of the mask.
    pub num_voxels: usize,
    /// Unknowns of the forward solution.
    pub num_unknowns: usize,
    /// Noise of a displacement at full signal, mm (before any filter).
    pub noise_at_full_signal_mm: Option<[f64; 3]>,
    /// Noise of the displacements as given, mm: estimated from the magnitude, of cameras as they were told, with null
    /// for a component that they do not measure. Null for raw scans.
    pub noise_sd_mm: Option<[Option<f64>; 3]>,
    /// Per drive.
    pub steps: Vec<ScanStep>,
}

/// The settings of a scanner, or those of cameras.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum SettingsOfScan {
    /// Of a scanner.
    Scanner(ScanOptions),
    /// Of cameras.
    Cameras(CameraOptions),
}

/// One drive of a [`ScanResult`].
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ScanStep {
    /// Drive, mm.
    pub drive_mm: f64,
    /// The load cell's mean over the window, N.
    pub force_n: Option<f64>,
    /// The force without noise, N.
    pub true_force_n: f64,
    /// When the scan was made, s.
    pub window_s: Option<[f64; 2]>,
    /// What became of the voxels; null for raw scans and for cameras.
    pub reconstruction: Option<StepReport>,
    /// Displacements found less those scanned, per direction; null for raw scans and for cameras, whose noise is the
    /// one they were told.
    pub error: Option<[ErrorReport; 3]>,
}

/// How far reconstructed displacements are from those that were scanned.
#[derive(Clone, Copy, Debug, Serialize, ToSchema)]
pub struct ErrorReport {
    /// Root mean square, mm.
    pub rms_mm: f64,
    /// Root mean square of error / estimated standard deviation: one where the noise explains the error.
    pub rms_over_sd: f64,
    /// Kept voxels off by more than half a turn: a wrong multiple of 2π.
    pub num_wrong_turns: usize,
}

impl ScanResult {
    /// Gathers the result; `reconstruction` is none for raw scans.
    ///
    /// # Errors
    /// [`AcquisitionError`] where the reconstruction is not that of the scan.
    pub fn new(
        scan: &Scan,
        options: &ScanOptions,
        reconstruction: Option<&Reconstruction>,
        input_hash: String,
    ) -> Result<ScanResult, AcquisitionError> {
        let mut steps = Vec::with_capacity(scan.raw.steps.len());
        for (n, step) in scan.raw.steps.iter().enumerate() {
            let error = match reconstruction {
                None => None,
                Some(r) => Some(errors(scan, r, n)?),
            };
            steps.push(ScanStep {
                drive_mm: step.drive_mm,
                force_n: step.force_n,
                true_force_n: scan.forces_n[n],
                window_s: step.window_s,
                reconstruction: reconstruction.and_then(|r| r.steps.get(n).cloned()),
                error,
            });
        }
        Ok(ScanResult {
            schema: "scan/1",
            version: VERSION,
            input_hash,
            seed: options.seed,
            is_raw: reconstruction.is_none(),
            filter: reconstruction.map_or(Filter::None, |r| r.recording.filter),
            options: SettingsOfScan::Scanner(options.clone()),
            num_voxels: scan.mask.num_voxels(),
            num_unknowns: scan.num_unknowns,
            noise_at_full_signal_mm: scan.raw.noise_sd_mm,
            noise_sd_mm: reconstruction.and_then(|r| r.recording.noise_sd_mm).map(|sd| sd.map(Some)),
            steps,
        })
    }

    /// Gathers the result of cameras.
    pub fn of_cameras(filmed: &Filmed, options: &CameraOptions, input_hash: String) -> ScanResult {
        let steps = filmed.recording.steps.iter().zip(&filmed.forces_n).map(|(step, true_force_n)| ScanStep {
            drive_mm: step.drive_mm,
            force_n: step.force_n,
            true_force_n: *true_force_n,
            window_s: step.window_s,
            reconstruction: None,
            error: None,
        });
        ScanResult {
            schema: "scan/1",
            version: VERSION,
            input_hash,
            seed: options.seed,
            is_raw: false,
            filter: Filter::None,
            options: SettingsOfScan::Cameras(options.clone()),
            num_voxels: filmed.mask.num_voxels(),
            num_unknowns: filmed.num_unknowns,
            noise_at_full_signal_mm: None,
            noise_sd_mm: filmed.recording.stated_noise_sd_mm(),
            steps: steps.collect(),
        }
    }
}

fn errors(scan: &Scan, found: &Reconstruction, step: usize) -> Result<[ErrorReport; 3], AcquisitionError> {
    let mut truth = scan.mask.spread(&scan.truth[step], [f64::NAN; 3]);
    if found.recording.filter == Filter::Hamming2 {
        let none = vec![[0.0; 3]; truth.len()];
        truth = hamming_filtered(&scan.raw.grid, &scan.raw.mask, &truth, &none)?.displacement;
    }
    let displacement = &found.recording.steps[step].displacement;
    if truth.len() != displacement.len() {
        let (found, expected) = (displacement.len(), truth.len());
        return Err(AcquisitionError::Length { what: "reconstruction", found, expected });
    }
    Ok([0, 1, 2].map(|a| {
        let half_turn = std::f64::consts::PI * scan.raw.steps[step].mm_per_radian[a];
        let (mut sum, mut relative, mut number, mut num_wrong_turns) = (0.0, 0.0, 0.0, 0);
        for ((u, t), sd) in displacement.iter().zip(&truth).zip(&found.sd_mm[step]) {
            let error = u[a] - t[a];
            if error.is_finite() && sd[a] > 0.0 {
                sum += error * error;
                relative += (error / sd[a]).powi(2);
                number += 1.0;
                num_wrong_turns += usize::from(error.abs() > half_turn);
            }
        }
        ErrorReport {
            rms_mm: (sum / f64::max(number, 1.0)).sqrt(),
            rms_over_sd: (relative / f64::max(number, 1.0)).sqrt(),
            num_wrong_turns,
        }
    }))
}
