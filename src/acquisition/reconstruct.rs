//! From wrapped phases to displacements.

use super::anchor::{Anchor, AnchorReport, anchored};
use super::noise::NoiseEstimate;
use super::unwrap::{UnwrapOptions, WrappedImage, unwrap};
use super::{AcquisitionError, hamming_filtered};
use crate::recording::{Filter, RawRecording, RawStep, RecordedStep, Recording};
use rayon::prelude::*;
use serde::Serialize;
use utoipa::ToSchema;

/// Settings of [`reconstruct`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ReconstructOptions {
    /// How phases are unwrapped.
    pub unwrap: UnwrapOptions,
    /// What is known of the phase's zero.
    pub anchor: Anchor,
    /// Filter on the displacements afterwards.
    pub filter: Filter,
}

/// A recording from raw phases, with what became of every voxel.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The displacements; voxels that were left out hold NaN. `noise_sd_mm` is the root of the mean estimated variance
    /// over all kept voxels and steps.
    pub recording: Recording,
    /// Estimated standard deviation of every displacement, mm, per step in the recording's grid order; NaN where
    /// missing.
    pub sd_mm: Vec<Vec<[f64; 3]>>,
    /// Per step.
    pub steps: Vec<StepReport>,
}

/// What became of a step.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct StepReport {
    /// Drive, mm.
    pub drive_mm: f64,
    /// The complex images' noise.
    pub noise: NoiseEstimate,
    /// Per direction x, y, z.
    pub components: [ComponentReport; 3],
    /// Voxels of the mask with all three components (before any filter).
    pub num_complete: usize,
}

/// What became of one direction of a step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct ComponentReport {
    /// Voxels of the mask.
    pub num_voxels: usize,
    /// Voxels kept.
    pub num_kept: usize,
    /// Left out: no value, or noise too high to unwrap.
    pub num_low_signal: usize,
    /// Left out: two methods find different multiples of 2π.
    pub num_disputed: usize,
    /// Left out: neighbours disagree about the multiple of 2π.
    pub num_inconsistent: usize,
    /// Left out: not firmly joined to the rest.
    pub num_unconnected: usize,
    /// Median estimated standard deviation of the kept voxels, mm.
    pub median_sd_mm: f64,
    /// What the plates say.
    pub anchor: AnchorReport,
}

/// Unwraps every step of a raw recording.
///
/// # Errors
/// [`AcquisitionError::NothingUnwrapped`], [`AcquisitionError::Voxel`] from the filter, [`AcquisitionError::Value`].
pub fn reconstruct(raw: &RawRecording, options: &ReconstructOptions) -> Result<Reconstruction, AcquisitionError> {
    let limits = [
        ("the largest standard deviation of a phase", options.unwrap.max_phase_sd),
        ("the least margin", options.unwrap.min_margin + f64::MIN_POSITIVE),
    ];
    for (name, value) in limits {
        if !(value.is_finite() && value > 0.0) {
            return Err(AcquisitionError::Value { name, value, requirement: "positive and finite" });
        }
    }
    let mut done = Vec::with_capacity(raw.steps.len());
    for (n, step) in raw.steps.iter().enumerate() {
        done.push(one_step(raw, step, options, n + 1)?);
    }
    let mut sum = [[0.0; 2]; 3];
    let (mut steps, mut reports, mut sds) = (Vec::new(), Vec::new(), Vec::new());
    let (mut grid, mut mask) = (raw.grid.clone(), raw.mask.clone());
    for (step, (mut displacement, mut sd, report)) in raw.steps.iter().zip(done) {
        if options.filter == Filter::Hamming2 {
            let filtered = hamming_filtered(&raw.grid, &raw.mask, &displacement, &sd)?;
            (grid, mask, displacement, sd) = (filtered.grid, filtered.mask, filtered.displacement, filtered.sd_mm);
        }
        for a in 0..3 {
            for sd in sd.iter().filter(|sd| sd[a].is_finite()) {
                sum[a][0] += sd[a] * sd[a];
                sum[a][1] += 1.0;
            }
        }
        steps.push(RecordedStep {
            drive_mm: step.drive_mm,
            force_n: step.force_n,
            force_sd_n: step.force_sd_n,
            window_s: step.window_s,
            displacement,
        });
        reports.push(report);
        sds.push(sd);
    }
    let noise = sum.map(|[variance, number]: [f64; 2]| (variance / number).sqrt());
    let recording = Recording {
        id: raw.id.clone(),
        specimen: raw.specimen.clone(),
        grid,
        mask,
        steps,
        noise_sd_mm: noise.iter().all(|sd| *sd > 0.0 && sd.is_finite()).then_some(noise),
        filter: options.filter,
        load: raw.load.clone(),
        notes: raw.notes.clone(),
    };
    Ok(Reconstruction { recording, sd_mm: sds, steps: reports })
}

type OneStep = (Vec<[f64; 3]>, Vec<[f64; 3]>, StepReport);

fn one_step(
    raw: &RawRecording,
    step: &RawStep,
    options: &ReconstructOptions,
    number: usize,
) -> Result<OneStep, AcquisitionError> {
    let noise = NoiseEstimate::of_step(raw, step);
    let num_voxels = raw.num_voxels();
    let components: Vec<(Vec<f64>, Vec<f64>, ComponentReport)> = (0..3usize)
        .into_par_iter()
        .map(|axis| {
            let sd: Vec<f64> = raw
                .mask
                .iter()
                .zip(&step.magnitude)
                .map(|(is_in, m)| if *is_in { noise.phase_sd(axis, *m) } else { f64::INFINITY })
                .collect();
            let image = WrappedImage { shape: raw.grid.shape, phase: &step.phase[axis], sd: &sd };
            let unwrapped = unwrap(&image, &options.unwrap);
            if unwrapped.num_kept == 0 {
                return Err(AcquisitionError::NothingUnwrapped { step: number, axis: ['x', 'y', 'z'][axis] });
            }
            let scale = step.mm_per_radian[axis];
            let mut u: Vec<f64> = unwrapped.phase.iter().map(|p| p * scale).collect();
            let anchor = anchored(&mut u, &raw.specimen, &raw.grid, scale, options.anchor);
            let sd: Vec<f64> =
                u.iter().zip(&sd).map(|(u, sd)| if u.is_finite() { sd * scale } else { f64::NAN }).collect();
            let mut sorted: Vec<f64> = sd.iter().copied().filter(|sd| sd.is_finite()).collect();
            sorted.sort_by(f64::total_cmp);
            let report = ComponentReport {
                num_voxels,
                num_kept: unwrapped.num_kept,
                num_low_signal: unwrapped.num_low_signal + (num_voxels - unwrapped.num_voxels),
                num_disputed: unwrapped.num_disputed,
                num_inconsistent: unwrapped.num_inconsistent,
                num_unconnected: unwrapped.num_unconnected,
                median_sd_mm: sorted[sorted.len() / 2],
                anchor,
            };
            Ok((u, sd, report))
        })
        .collect::<Result<_, _>>()?;
    let num_image = raw.mask.len();
    let displacement: Vec<[f64; 3]> = (0..num_image).map(|v| [0, 1, 2].map(|a| components[a].0[v])).collect();
    let num_complete = displacement.iter().filter(|u| u.iter().all(|x| x.is_finite())).count();
    let sd = (0..num_image).map(|v| [0, 1, 2].map(|a| components[a].1[v])).collect();
    let reports = [components[0].2, components[1].2, components[2].2];
    let report = StepReport { drive_mm: step.drive_mm, noise, components: reports, num_complete };
    Ok((displacement, sd, report))
}
