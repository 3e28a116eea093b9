//! Telling materials apart: each material of a study taken as true in turn, every earlier one fitted to its scan.
//!
//! Materials stand from the simple to the rich: a rich one can imitate a simple one it contains, so that only the simple one's
//! best fit to the rich one's scan says how well a scan decides between them (Atkinson and Fedorov 1975).

use super::response::EvaluationFailure;
use super::study::Study;
use crate::fem::{Equilibrium, ForwardModel, SolveOptions, Tangent};
use crate::material::{Ogden, Parameter};
use crate::sensitivity::{InformationError, MaterialState, Separation, separation_over_quadrature};

/// Most Gauss–Newton steps.
const MAX_STEPS: usize = 10;
/// Converged where a step gains less than this part of the squared distance…
const GAIN: f64 = 1e-5;
/// … or than this many squared standard deviations, which no experiment sees.
const SMALLEST_GAIN: f64 = 1e-4;
/// Largest relative change of a parameter in one step.
const LARGEST_STEP: f64 = 0.4;

/// A material fitted to another's scan.
pub(super) struct Nearest {
    /// Its values there.
    pub material: Ogden,
    /// Its equilibrium.
    pub equilibrium: Equilibrium,
    /// The same as the scan's figures need it.
    pub state: MaterialState,
    /// Its distance from the scan, in noise standard deviations.
    pub distance_sd: f64,
}

/// What a solved material does.
pub(super) fn state_of(equilibrium: &Equilibrium, tangent: &mut Tangent) -> Result<MaterialState, EvaluationFailure> {
    Ok(MaterialState {
        displacement: equilibrium.displacement.clone(),
        force_n: equilibrium.force_n,
        sensitivities: tangent.material_sensitivities()?,
    })
}

/// Distance of `theirs` from what `ours`, of `material`, can do, the mesh's nodes at `positions`.
pub(super) fn separation(
    study: &Study,
    model: &ForwardModel,
    positions: &[[f64; 3]],
    material: &Ogden,
    ours: &MaterialState,
    theirs: &MaterialState,
) -> Result<Separation, InformationError> {
    let fields = model.quadrature_fields_at(material, positions, &ours.displacement);
    let voxel_volume = study.scan.voxel_mm.iter().product();
    separation_over_quadrature(model.mesh(), &fields, ours, theirs, &study.scan.noise(), voxel_volume)
}

/// Fits `material`, whose equilibrium at `drive` is `start`, to the scan of `theirs`. Where a step has no equilibrium, it is
/// halved; where none helps, the distance is that of the linear step from there.
pub(super) fn nearest(
    study: &Study,
    model: &mut ForwardModel,
    material: &Ogden,
    start: &Equilibrium,
    drive: f64,
    theirs: &MaterialState,
    options: &SolveOptions,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Nearest, EvaluationFailure> {
    let positions = model.mesh().nodes.clone();
    let (mut material, mut equilibrium) = (material.clone(), start.clone());
    let mut state = state_of(&equilibrium, &mut model.tangent(&material, &equilibrium)?)?;
    let mut from_here = separation(study, model, &positions, &material, &state, theirs)?;
    for _ in 0..MAX_STEPS {
        if from_here.gained < SMALLEST_GAIN + GAIN * from_here.distance_sd.powi(2) {
            break;
        }
        let misfit = from_here.distance_sd.powi(2) + from_here.gained;
        let mut part = 1.0;
        let better = loop {
            let next = moved(&material, &from_here.steps, part);
            let solved = if next.validate().is_ok() {
                model.solve(&next, drive, Some(&equilibrium), options, is_cancelled).ok()
            } else {
                None
            };
            if is_cancelled() {
                return Err(EvaluationFailure::Cancelled);
            }
            if let Some(found) = solved {
                let reached = state_of(&found, &mut model.tangent(&next, &found)?)?;
                let there = separation(study, model, &positions, &next, &reached, theirs)?;
                if there.distance_sd.powi(2) + there.gained < misfit {
                    break Some((next, found, reached, there));
                }
            }
            part *= 0.5;
            if part < 0.05 {
                break None;
            }
        };
        let Some(better) = better else { break };
        (material, equilibrium, state, from_here) = better;
    }
    Ok(Nearest { material, equilibrium, state, distance_sd: from_here.distance_sd })
}

/// The material after a part of a step, no parameter changed by more than [`LARGEST_STEP`]; κ by its logarithm.
fn moved(material: &Ogden, steps: &[f64], part: f64) -> Ogden {
    let relative: Vec<f64> =
        material.parameters().into_iter().zip(steps).map(|(p, s)| s / material.value(p).abs().max(1e-12)).collect();
    let largest = relative.iter().fold(0.0f64, |s, r| s.max(r.abs()));
    let part = part * (LARGEST_STEP / largest).min(1.0);
    let mut next = material.clone();
    for (parameter, r) in material.parameters().into_iter().zip(relative) {
        let value = material.value(parameter);
        let by = part * r;
        next.set(parameter, if parameter == Parameter::Kappa { value * by.exp() } else { value + by * value.abs() });
    }
    next
}

/// ln of the distance to the nearest; 0 without any.
pub(super) fn log_separation(distances: impl IntoIterator<Item = f64>) -> f64 {
    // Materials that cannot be told apart at all are a thousandth of a standard deviation apart.
    distances.into_iter().reduce(f64::min).map_or(0.0, |d| d.max(1e-3).ln())
}
