//! What the recordings tell, at the estimate: scanned drives, forces read on the way, and the states visited.

use super::error::NextError;
use super::options::Plan;
use super::scanned::{ForceRead, ScannedStep};
use crate::calibration::{CalibrationProblem, Observed, RecordingFit, View};
use crate::fem::Equilibrium;
use crate::kinematics::{Decomposition, IDENTITY, decompose};
use crate::sensitivity::{Unknown, unknowns_of};

/// What the recordings tell, at the estimate.
pub(super) struct Seen {
    /// Per recording and scanned drive.
    pub(super) steps: Vec<Vec<ScannedStep>>,
    /// Per recording and force read on the way.
    pub(super) readings: Vec<Vec<ForceRead>>,
    /// Per recording and scanned drive: the voxels' states.
    pub(super) states: Vec<Vec<Vec<Decomposition>>>,
    /// To what the unknowns of the set-up are known beforehand.
    pub(super) unknown_sd: Vec<f64>,
}

impl Seen {
    /// `num_scans`: of how many scans each recording is the mean.
    ///
    /// # Errors
    /// [`NextError::Calibration`] for unlike samples.
    pub(super) fn of(
        problem: &mut CalibrationProblem,
        fit: &RecordingFit,
        plan: &Plan,
        num_scans: &[usize],
    ) -> Result<Seen, NextError> {
        problem.refuse_unlike_samples("what to scan next")?;
        let observed = problem.observed();
        let (steps, readings, states) = (Vec::new(), Vec::new(), Vec::new());
        let mut seen = Seen { steps, readings, states, unknown_sd: Vec::new() };
        for (r, (model, view)) in problem.models_and_views().enumerate() {
            let (recording, num) = (&observed[r], num_scans[r] as f64);
            let (mut steps, mut readings, mut states) = (Vec::new(), Vec::new(), Vec::new());
            for (d, (equilibrium, force)) in fit.states(r).iter().zip(recording.forces()).enumerate() {
                let mut tangent = model.tangent(&fit.material, equilibrium)?;
                let unknowns = unknowns_of(&plan.study.protocol, equilibrium, &mut tangent)?;
                let force = force.map(|force| ForceRead {
                    force_n: equilibrium.force_n,
                    by_parameter: fit.sensitivities(r, d).1.to_vec(),
                    by_unknown: unknowns.iter().map(|u| u.force_n).collect(),
                    // Of one scan.
                    sd_n: num.sqrt() * force.sd_n,
                    beyond: 0.0,
                });
                if d < recording.steps.len() {
                    let step = ScannedStep { force, ..scanned(recording, fit, (r, d), view, &unknowns, num)? };
                    steps.push(step);
                    states.push(states_of_voxels(view, equilibrium)?);
                } else {
                    readings.extend(force);
                }
                seen.unknown_sd = unknowns.iter().map(|u| u.sd).collect();
            }
            seen.steps.push(steps);
            seen.readings.push(readings);
            seen.states.push(states);
        }
        Ok(seen)
    }
}

/// The voxels' states at an equilibrium.
fn states_of_voxels(view: &View, equilibrium: &Equilibrium) -> Result<Vec<Decomposition>, NextError> {
    let of_slope = |g: &[[f64; 3]; 3]| decompose(&[0, 1, 2].map(|i| [0, 1, 2].map(|j| IDENTITY[i][j] + g[i][j])));
    Ok(view.gradients(&equilibrium.displacement)?.iter().map(of_slope).collect())
}

/// What the voxels of scanned drive `s` of recording `r`, the mean of `num` scans, tell.
fn scanned(
    recording: &Observed,
    fit: &RecordingFit,
    (r, s): (usize, usize),
    view: &View,
    unknowns: &[Unknown],
    num: f64,
) -> Result<ScannedStep, NextError> {
    let (fields, _) = fit.sensitivities(r, s);
    let is_whole = |u: &[f64; 3]| u.iter().all(|x| x.is_finite());
    let measured = recording.steps[s].displacement.iter().zip(&fields[0]);
    let weights: Vec<f64> = measured.map(|(u, f)| f64::from(u8::from(is_whole(u) && is_whole(f)))).collect();
    // What is missing must not enter a product.
    let filled = |field: &[[f64; 3]]| -> Vec<[f64; 3]> {
        field.iter().map(|u| if is_whole(u) { *u } else { [0.0; 3] }).collect()
    };
    let by_unknown = unknowns
        .iter()
        .map(|u| u.displacement.as_ref().map(|d| view.average(d).map(|f| filled(&f))).transpose())
        .collect::<Result<Vec<_>, _>>()?;
    Ok(ScannedStep {
        by_parameter: fields.iter().map(|f| filled(f)).collect(),
        by_unknown,
        // The states that the law was fitted to are those visited.
        beyond: vec![0.0; weights.len()],
        weights,
        signal: None,
        // Of one scan.
        noise_mm2: recording.noise_sd_mm.map(|sd| num * sd * sd * recording.noise_correlation()),
        voxel_mm3: recording.mask.grid.voxel_volume_mm3(),
        force: None,
    })
}
