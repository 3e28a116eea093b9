//! What an effect on the load curve is: a change of the elastic force with parameters of its own.

use super::cause::{Category, CauseName};

/// The readings of a load curve and the elastic force that belongs to them, all of one length.
#[derive(Clone, Debug)]
pub struct LoadReadings {
    /// Times, s, rising.
    pub time_s: Vec<f64>,
    /// The readings, N.
    pub measured_n: Vec<f64>,
    /// 1 while the drive rises, −1 while it falls; the last motion's while it rests.
    pub direction: Vec<f64>,
    /// Elastic force of the nominal material, N.
    pub elastic_n: Vec<f64>,
    /// Its derivatives with respect to scaled material parameters, N.
    pub derivatives: Vec<Vec<f64>>,
    /// Elastic work of the whole sample at the drive of each reading, N mm.
    pub work: Vec<f64>,
    /// The largest of these works, N mm.
    pub largest_work: f64,
}

/// What effects make of an elastic force, reading by reading.
#[derive(Clone, Debug)]
pub struct ForceChange {
    /// Factor on the elastic force.
    pub factor: Vec<f64>,
    /// Added to it, N.
    pub added_n: Vec<f64>,
    /// Relaxations of it: strength and time (s).
    pub relaxations: Vec<(f64, f64)>,
}

/// A parameter of an effect, as it is fitted.
#[derive(Clone, Debug)]
pub struct EffectParameter {
    /// Name with its unit.
    pub name: &'static str,
    /// Smallest and largest value; `None` where any value may be.
    pub limits: Option<[f64; 2]>,
    /// Largest change in one step of a fit.
    pub largest_step: f64,
    /// Whether its logarithm is what is fitted; limits, steps and starts are then those of the logarithm.
    pub is_logarithm: bool,
}

/// An effect on the load curve: the part of a cause that load curves tell of.
pub trait LoadEffect: Sync + std::fmt::Debug {
    /// The cause that it is a part of.
    fn name(&self) -> CauseName;
    /// Its kind.
    fn category(&self) -> Category;
    /// In words, for people.
    fn description(&self) -> &'static str;
    /// Its parameters in a load curve of this duration (s).
    fn parameters(&self, duration_s: f64) -> Vec<EffectParameter>;
    /// Values, as fitted, from which fits start.
    fn starts(&self) -> Vec<Vec<f64>>;
    /// How many times it may act at once, with different parameters.
    fn max_count(&self) -> usize {
        1
    }
    /// Changes the force as the effect does with these values of its parameters, as fitted.
    fn act(&self, values: &[f64], readings: &LoadReadings, change: &mut ForceChange);
}

/// A fitted effect.
#[derive(Clone, Debug)]
pub struct FittedEffect {
    /// Which.
    pub effect: &'static dyn LoadEffect,
    /// Which one of its kind, from 0: an effect may act several times.
    pub ordinal: usize,
    /// Names of its parameters.
    pub names: Vec<&'static str>,
    /// Their values, in the units of their names.
    pub values: Vec<f64>,
    /// Standard deviations.
    pub sd: Vec<f64>,
    /// Fall of the deviance when it was added.
    pub gained: f64,
}
