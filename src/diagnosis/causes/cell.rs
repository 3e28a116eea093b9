//! The load cell: a zero that is off, and friction in the load train.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::load_effect::{EffectParameter, ForceChange, LoadEffect, LoadReadings};
use crate::diagnosis::scene::Scene;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("cell");
/// What a laboratory can do about it.
const REMEDY: &str =
    "Read the load cell unloaded before and after the scan, and calibrate its gain with a known weight.";
/// The zero as the mean forces of the steps tell it.
pub(super) const OF_STEPS: Entry =
    Entry { name: NAME, remedy: REMEDY, origin: Origin::Tested(|_| vec![Arc::new(CellOffset)]) };
/// The zero as a load curve tells it.
pub(super) const OFFSET: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::LoadCurve(&Offset) };
/// Friction, which only a load curve tells.
pub(super) const FRICTION: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::LoadCurve(&Friction) };

const ZERO_IN_WORDS: &str = "the load cell does not read zero at rest";

/// A constant added to the force of every step.
pub struct CellOffset;

impl Cause for CellOffset {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Load
    }

    fn description(&self) -> String {
        ZERO_IN_WORDS.into()
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        vec![CauseParameter::new("offset_n", 0.1, [-1e3, 1e3])]
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.force_offset_n += values[0];
    }

    fn is_read_from_load_curve(&self) -> bool {
        true
    }

    fn changes_sample(&self) -> bool {
        false
    }
}

/// A constant added to every reading of a load curve.
#[derive(Debug)]
pub struct Offset;

impl LoadEffect for Offset {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Load
    }

    fn description(&self) -> &'static str {
        ZERO_IN_WORDS
    }

    fn parameters(&self, _duration_s: f64) -> Vec<EffectParameter> {
        vec![EffectParameter { name: "offset_n", limits: None, largest_step: 1e3, is_logarithm: false }]
    }

    fn starts(&self) -> Vec<Vec<f64>> {
        vec![vec![0.01]]
    }

    fn act(&self, values: &[f64], _: &LoadReadings, change: &mut ForceChange) {
        change.added_n.iter_mut().for_each(|a| *a += values[0]);
    }
}

/// A force of constant size that resists the motion, so that the load cell reads more while the drive rises.
#[derive(Debug)]
pub struct Friction;

impl LoadEffect for Friction {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Load
    }

    fn description(&self) -> &'static str {
        "friction adds to the force in the direction of motion"
    }

    fn parameters(&self, _duration_s: f64) -> Vec<EffectParameter> {
        vec![EffectParameter { name: "friction_n", limits: Some([0.0, 1e3]), largest_step: 1e3, is_logarithm: false }]
    }

    fn starts(&self) -> Vec<Vec<f64>> {
        vec![vec![0.01]]
    }

    fn act(&self, values: &[f64], readings: &LoadReadings, change: &mut ForceChange) {
        change.added_n.iter_mut().zip(&readings.direction).for_each(|(a, d)| *a += values[0] * d);
    }
}
