//! An experiment with hidden causes: its material, its noise, and everything that was not as it was told.

use super::draw::{Draw, Hidden, HiddenCause, draw_cause};
use crate::material::{Material, OgdenTerm};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = HiddenExperiment)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Seed of its noise.
    pub seed: u64,
    /// Whether its block has no holes; else it has two.
    pub is_solid: bool,
    /// The material.
    pub material: Material,
    /// Noise of the displacement, mm.
    pub noise_sd_mm: f64,
    /// Whether the recording states its noise.
    pub is_noise_stated: bool,
    /// The share of voxels that show nothing of the sample.
    pub lost_share: f64,
    /// What is hidden; nothing in a control.
    pub hidden: Vec<Hidden>,
}

impl Experiment {
    /// One cause alone, with the material and the noise that were drawn with it.
    pub fn of_one(hidden: &Hidden) -> Experiment {
        Experiment {
            seed: hidden.seed,
            is_solid: false,
            material: hidden.material.clone(),
            noise_sd_mm: hidden.noise_sd_mm,
            is_noise_stated: true,
            lost_share: 0.0,
            hidden: vec![hidden.clone()],
        }
    }

    /// All that is hidden of one cause.
    pub(super) fn of(&self, cause: HiddenCause) -> impl Iterator<Item = &Hidden> {
        self.hidden.iter().filter(move |h| h.cause == cause)
    }

    /// The same with nothing hidden; a compressible material becomes one with `bulk_ratio` as κ over shear modulus.
    pub(super) fn nominal(&self, bulk_ratio: f64) -> Experiment {
        let mut nominal = Experiment { hidden: Vec::new(), ..self.clone() };
        if self.of(HiddenCause::Compressibility).next().is_some() {
            nominal.material.bulk_kpa = bulk_ratio * nominal.material.initial_shear_modulus_kpa();
        }
        nominal
    }

    /// The same without the cause at a place of the list.
    pub(super) fn without(&self, place: usize, bulk_ratio: f64) -> Experiment {
        let mut other = self.clone();
        if other.hidden.remove(place).cause == HiddenCause::Compressibility {
            other.material.bulk_kpa = bulk_ratio * other.material.initial_shear_modulus_kpa();
        }
        other
    }
}

/// How the plates hold and move the sample, and how it is made.
const OF_MOUNT: [HiddenCause; 9] = [
    HiddenCause::Tilt,
    HiddenCause::Offaxis,
    HiddenCause::Mount,
    HiddenCause::Slack,
    HiddenCause::Compliance,
    HiddenCause::Travel,
    HiddenCause::Layer,
    HiddenCause::Debond,
    HiddenCause::Bond,
];
/// What the sample is made of.
const OF_MATERIAL: [HiddenCause; 5] = [
    HiddenCause::Gradient,
    HiddenCause::Inclusion,
    HiddenCause::Fibre,
    HiddenCause::Swelling,
    HiddenCause::Compressibility,
];
/// What the scan and the load cell make of it.
const OF_MEASUREMENT: [HiddenCause; 6] = [
    HiddenCause::Gain,
    HiddenCause::Background,
    HiddenCause::Registration,
    HiddenCause::Wrap,
    HiddenCause::Cell,
    HiddenCause::Relaxation,
];
/// How it is made.
const OF_SHAPE: [HiddenCause; 2] = [HiddenCause::Outline, HiddenCause::Hole];
/// Causes that may be kept from a diagnosis: none is a special case of another that it knows.
const UNKNOWN: [HiddenCause; 4] =
    [HiddenCause::Inclusion, HiddenCause::Debond, HiddenCause::Hole, HiddenCause::Gradient];

/// The shares of materials with one, two and three terms, added up.
const UP_TO_TERMS: [f64; 3] = [0.5, 0.85, 1.0];
/// The share of recordings that state their noise, and of those with lost voxels.
const STATED: f64 = 0.7;
const WITH_LOST: f64 = 0.2;

/// An experiment of a material of one to three terms and noise from 6 to 60 μm, without a cause.
fn draw_plain(d: &mut Draw, seed: u64) -> Experiment {
    let pick = d.within(0.0, 1.0);
    let num_terms = 1 + UP_TO_TERMS.iter().filter(|up_to| pick >= **up_to).count();
    let mut terms = vec![OgdenTerm { mu_kpa: d.within(12.0, 22.0), alpha: d.within(1.5, 2.8) }];
    let shear_kpa = 0.5 * terms[0].mu_kpa * terms[0].alpha;
    // A term that stiffens under stretch, then one that stiffens under compression.
    for [low, high] in [[4.0, 9.0], [-6.0, -2.0]].into_iter().take(num_terms - 1) {
        let alpha = d.within(low, high);
        terms.push(OgdenTerm { mu_kpa: 2.0 * shear_kpa * d.within(0.05, 0.25) / alpha, alpha });
    }
    let mut material = Material { bulk_kpa: 1.0, terms, law: None };
    material.bulk_kpa = material.initial_shear_modulus_kpa() * d.log_within(90.0, 180.0);
    Experiment {
        seed,
        is_solid: d.within(0.0, 1.0) < 0.5,
        material,
        noise_sd_mm: d.log_within(0.006, 0.06),
        is_noise_stated: d.within(0.0, 1.0) < STATED,
        lost_share: if d.within(0.0, 1.0) < WITH_LOST { d.log_within(0.002, 0.02) } else { 0.0 },
        hidden: Vec::new(),
    }
}

impl Experiment {
    /// Hides one more cause, drawn from a seed.
    fn hide(&mut self, cause: HiddenCause, seed: u64) {
        let mut hidden = draw_cause(cause, seed);
        if cause == HiddenCause::Compressibility {
            self.material.bulk_kpa = hidden.strength * self.material.initial_shear_modulus_kpa();
        }
        hidden.material = self.material.clone();
        hidden.noise_sd_mm = self.noise_sd_mm;
        self.hidden.push(hidden);
    }

    /// Whether it could hide a cause: a solid block has no holes.
    fn allows(&self, cause: &HiddenCause) -> bool {
        !(self.is_solid && *cause == HiddenCause::Hole)
    }

    fn hide_one_of(&mut self, causes: &[HiddenCause], d: &mut Draw, seed: u64) {
        let allowed: Vec<HiddenCause> = causes.iter().copied().filter(|c| self.allows(c)).collect();
        self.hide(allowed[d.below(allowed.len())], seed);
    }
}

/// Two to four causes of different kinds at once; one is of the mount, one of the material.
pub fn draw_several(seed: u64) -> Experiment {
    let mut d = Draw::new(seed, 3);
    let mut experiment = draw_plain(&mut d, seed);
    let num = 2 + d.below(3);
    let mut kinds: Vec<&[HiddenCause]> = vec![&OF_MOUNT, &OF_MATERIAL];
    if d.below(2) == 0 {
        kinds.extend([&OF_MEASUREMENT[..], &OF_SHAPE]);
    } else {
        kinds.extend([&OF_SHAPE[..], &OF_MEASUREMENT]);
    }
    for (n, kind) in kinds.into_iter().take(num).enumerate() {
        experiment.hide_one_of(kind, &mut d, seed.wrapping_add(7_919 * (n as u64 + 1)));
    }
    experiment
}

/// A mount that is not perfect, by less than does any harm: a turn, a drift and a zero too small to be seen.
pub fn draw_harmless(seed: u64) -> Experiment {
    const HARMLESS: [(HiddenCause, f64); 3] =
        [(HiddenCause::Tilt, 0.03), (HiddenCause::Offaxis, 0.004), (HiddenCause::Mount, 0.003)];
    let mut d = Draw::new(seed, 4);
    let mut experiment = draw_plain(&mut d, seed);
    for (cause, strength) in HARMLESS {
        experiment.hide(cause, seed);
        if let Some(last) = experiment.hidden.last_mut() {
            last.which %= 2;
            last.strength = d.within(-strength, strength);
        }
    }
    experiment
}

/// A cause that the diagnosis knows and then one that it is not told of.
pub fn draw_with_unknown(seed: u64) -> Experiment {
    let mut d = Draw::new(seed, 5);
    let mut experiment = draw_plain(&mut d, seed);
    let known = [HiddenCause::Tilt, HiddenCause::Offaxis, HiddenCause::Mount, HiddenCause::Slack, HiddenCause::Gain];
    experiment.hide_one_of(&known, &mut d, seed.wrapping_add(7_919));
    experiment.hide_one_of(&UNKNOWN, &mut d, seed.wrapping_add(15_838));
    experiment
}
