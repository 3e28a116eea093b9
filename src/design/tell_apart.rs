//! Telling materials apart: each material of a study taken as true in turn, every earlier one fitted to its scan.
//!
//! Materials stand from the simple to the rich: a rich one can imitate a simple one it contains, so that only the
//! simple one's best fit to the rich one's scan says how well a scan decides between them (Atkinson and Fedorov 1975).

use super::evaluation_failure::EvaluationFailure;
use super::study::Study;
use crate::fem::{Equilibrium, ForwardModel, SolveOptions, Tangent};
use crate::material::{Material, Parameter};
use crate::optimise::{LeastSquares, Rules, Shortening, Step, Stop, descend};
use crate::sensitivity::{InformationError, MaterialState, Separation, separation_over_quadrature};
use nalgebra::DVector;

/// At most ten Gauss–Newton steps, each tried whole, then halved down to a sixteenth.
const RULES: Rules = Rules {
    shortening: Shortening::Halved { num_lengths: 5 },
    tolerated_rise: 0.0,
    stop: Stop { max_steps: 10, ..Stop::NEVER },
};
/// Converged where a step gains less than this part of the squared distance…
const GAIN: f64 = 1e-5;
/// … or than this many squared standard deviations, which no experiment sees.
const SMALLEST_GAIN: f64 = 1e-4;
/// Largest relative change of a parameter in one step.
const LARGEST_STEP: f64 = 0.4;

/// A material fitted to another's scan.
pub(super) struct Nearest {
    /// Its values there.
    pub material: Material,
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
        normal_force_n: equilibrium.normal_force_n,
        sensitivities: tangent.material_sensitivities()?,
    })
}

/// Distance of `theirs` from what `ours`, of `material`, can do, the mesh's nodes at `positions`.
pub(super) fn separation(
    study: &Study,
    model: &ForwardModel,
    positions: &[[f64; 3]],
    material: &Material,
    ours: &MaterialState,
    theirs: &MaterialState,
) -> Result<Separation, InformationError> {
    let fields = model.quadrature_fields_at(material, positions, &ours.displacement);
    let voxel_volume = study.scan.voxel_mm.iter().product();
    separation_over_quadrature(model.mesh(), &fields, ours, theirs, &study.scan.noise(), voxel_volume)
}

/// A scan that other materials imitate as well as they can.
pub(super) struct Imitation<'a> {
    pub study: &'a Study,
    pub model: &'a mut ForwardModel,
    /// What was scanned.
    pub theirs: &'a MaterialState,
    /// The drive of the scan, mm.
    pub drive_mm: f64,
    pub solve: &'a SolveOptions,
    pub is_cancelled: &'a (dyn Fn() -> bool + Sync),
}

/// An imitating material, what it does, and how far that is from the scan.
pub(super) struct Imitator {
    material: Material,
    equilibrium: Equilibrium,
    state: MaterialState,
    separation: Separation,
}

impl Imitation<'_> {
    /// Fits `material`, whose equilibrium at the drive is `start`, to the scan. Where a step has no equilibrium, it is
    /// halved; where none helps, the distance is that of the linear step from there.
    pub fn nearest(mut self, material: &Material, start: &Equilibrium) -> Result<Nearest, EvaluationFailure> {
        let first = self.imitator(material.clone(), start.clone())?;
        let found = descend(&mut self, first, (), &RULES)?.at;
        let Imitator { material, equilibrium, state, separation } = found;
        Ok(Nearest { material, equilibrium, state, distance_sd: separation.distance_sd })
    }

    fn imitator(&mut self, material: Material, equilibrium: Equilibrium) -> Result<Imitator, EvaluationFailure> {
        let state = state_of(&equilibrium, &mut self.model.tangent(&material, &equilibrium)?)?;
        let positions = &self.model.mesh().nodes;
        let separation = separation(self.study, self.model, positions, &material, &state, self.theirs)?;
        Ok(Imitator { material, equilibrium, state, separation })
    }
}

impl LeastSquares for Imitation<'_> {
    type Point = Imitator;
    type Linear = ();
    type Error = EvaluationFailure;

    /// Squared distance from the scan: what a linear step leaves, and what it takes away.
    fn objective(&self, at: &Imitator) -> f64 {
        at.separation.distance_sd.powi(2) + at.separation.gained
    }

    fn linearise(&mut self, _: &Imitator) -> Result<Option<()>, EvaluationFailure> {
        Ok(Some(()))
    }

    fn step(&mut self, at: &Imitator, (): &(), _: f64) -> Result<Option<Step>, EvaluationFailure> {
        let Separation { gained, distance_sd, .. } = at.separation;
        let is_worth_it = !(gained < SMALLEST_GAIN + GAIN * distance_sd.powi(2));
        Ok(is_worth_it.then(|| Step { change: DVector::from_column_slice(&at.separation.steps), promised: gained }))
    }

    fn trial(&mut self, at: &Imitator, (): &(), step: &Step, part: f64) -> Result<Option<Imitator>, EvaluationFailure> {
        let next = moved(&at.material, step.change.as_slice(), part);
        let solved = if next.validate().is_ok() {
            self.model.solve(&next, self.drive_mm, Some(&at.equilibrium), self.solve, self.is_cancelled).ok()
        } else {
            None
        };
        if (self.is_cancelled)() {
            return Err(EvaluationFailure::Cancelled);
        }
        solved.map(|found| self.imitator(next, found)).transpose()
    }
}

/// The material after a part of a step, no parameter changed by more than [`LARGEST_STEP`]; κ by its logarithm.
fn moved(material: &Material, steps: &[f64], part: f64) -> Material {
    let relative: Vec<f64> =
        material.parameters().into_iter().zip(steps).map(|(p, s)| s / material.value(p).abs().max(1e-12)).collect();
    let largest = relative.iter().fold(0.0f64, |s, r| s.max(r.abs()));
    let part = part * (LARGEST_STEP / largest).min(1.0);
    let mut next = material.clone();
    for (parameter, r) in material.parameters().into_iter().zip(relative) {
        let value = material.value(parameter);
        let change = part * r;
        let moved = if parameter == Parameter::Kappa { value * change.exp() } else { value + change * value.abs() };
        next.set(parameter, moved);
    }
    next
}

/// ln of the distance to the nearest; 0 without any.
pub(super) fn log_separation(distances: impl IntoIterator<Item = f64>) -> f64 {
    // Materials that cannot be told apart at all are a thousandth of a standard deviation apart.
    distances.into_iter().reduce(f64::min).map_or(0.0, |d| d.max(1e-3).ln())
}
