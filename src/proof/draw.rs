//! What is hidden in a recording, drawn from a seed.

use crate::diagnosis::CauseName;
use crate::material::{Material, OgdenTerm};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A cause that can be hidden.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum HiddenCause {
    /// Nothing.
    None,
    /// The material relaxes.
    Relaxation,
    /// It softens with its largest load.
    Mullins,
    /// It is strongly compressible.
    Compressibility,
    /// It is stiffer along one direction.
    Fibre,
    /// Its stiffness changes along x, y or z.
    Gradient,
    /// A ball in it is stiffer or softer.
    Inclusion,
    /// It has swollen.
    Swelling,
    /// A patch of a bonded face is free.
    Debond,
    /// The moved plate turns.
    Tilt,
    /// The moved plate drifts off its axis.
    Offaxis,
    /// The load train gives way.
    Compliance,
    /// The load cell does not read zero at rest.
    Cell,
    /// A hole is not of its drawn size or place.
    Hole,
    /// The encoding is off by a factor.
    Gain,
    /// A smooth phase is left.
    Background,
    /// A block of voxels is a turn of phase off.
    Wrap,
    /// The image is shifted.
    Registration,
    /// The drive's zero is off.
    Slack,
    /// The moved plate sits out of place, alike at every step.
    Mount,
    /// The bonds of the faces give way.
    Bond,
    /// Stiff layers lie at the bonded faces.
    Layer,
    /// The moved plate strays from its course, neither alike at all drives nor in proportion to them.
    Travel,
    /// The block is longer or wider than drawn, or a wedge.
    Outline,
}

impl HiddenCause {
    /// All that are hidden alone.
    pub const ALL: [HiddenCause; 20] = [
        HiddenCause::Relaxation,
        HiddenCause::Mullins,
        HiddenCause::Compressibility,
        HiddenCause::Fibre,
        HiddenCause::Gradient,
        HiddenCause::Inclusion,
        HiddenCause::Swelling,
        HiddenCause::Debond,
        HiddenCause::Tilt,
        HiddenCause::Offaxis,
        HiddenCause::Compliance,
        HiddenCause::Cell,
        HiddenCause::Hole,
        HiddenCause::Gain,
        HiddenCause::Background,
        HiddenCause::Wrap,
        HiddenCause::Registration,
        HiddenCause::Slack,
        HiddenCause::Mount,
        HiddenCause::Bond,
    ];

    /// Those that are hidden only beside others: alone each is one of several causes that look alike.
    pub const IN_COMPANY: [HiddenCause; 3] = [HiddenCause::Layer, HiddenCause::Travel, HiddenCause::Outline];

    /// Whether it is to be seen in the displacement.
    pub fn acts_on_displacement(self) -> bool {
        !matches!(self, HiddenCause::None | HiddenCause::Relaxation | HiddenCause::Mullins | HiddenCause::Cell)
    }

    /// The cause that the diagnosis should name; `None` where nothing is hidden.
    pub fn diagnosed(self) -> Option<CauseName> {
        (self != HiddenCause::None).then(|| CauseName::new(self.name()))
    }

    /// The name that the diagnosis gives it.
    pub fn name(self) -> &'static str {
        match self {
            HiddenCause::None => "none",
            HiddenCause::Relaxation => "relaxation",
            HiddenCause::Mullins => "mullins",
            HiddenCause::Compressibility => "compressibility",
            HiddenCause::Fibre => "fibre",
            HiddenCause::Gradient => "gradient",
            HiddenCause::Inclusion => "inclusion",
            HiddenCause::Swelling => "swelling",
            HiddenCause::Debond => "debond",
            HiddenCause::Tilt => "tilt",
            HiddenCause::Offaxis => "offaxis",
            HiddenCause::Compliance => "compliance",
            HiddenCause::Cell => "cell",
            HiddenCause::Hole => "hole",
            HiddenCause::Gain => "gain",
            HiddenCause::Background => "background",
            HiddenCause::Wrap => "wrap",
            HiddenCause::Registration => "registration",
            HiddenCause::Slack => "slack",
            HiddenCause::Mount => "mount",
            HiddenCause::Bond => "bond",
            HiddenCause::Layer => "layer",
            HiddenCause::Travel => "travel",
            HiddenCause::Outline => "outline",
        }
    }
}

/// What is hidden in one recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Hidden {
    /// The cause.
    pub cause: HiddenCause,
    /// Seed of this draw.
    pub seed: u64,
    /// The material.
    pub material: Material,
    /// Noise of the displacement, mm.
    pub noise_sd_mm: f64,
    /// How strong: the cause's own measure (see [`draw_cause`]).
    pub strength: f64,
    /// Axis, face or hole.
    pub which: usize,
    /// Where, mm: centre of an inclusion or a patch, and its size along x, y, z.
    pub center_mm: [f64; 3],
    /// Diameter of an inclusion, extent of a patch or of a jump.
    pub extent_mm: [f64; 3],
    /// A direction.
    pub direction: [f64; 3],
}

/// Numbers from a seed.
pub(super) struct Draw(ChaCha8Rng);

impl Draw {
    pub(super) fn new(seed: u64, stream: u64) -> Draw {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Draw(rng)
    }

    /// Uniform in [low, high).
    pub(super) fn within(&mut self, low: f64, high: f64) -> f64 {
        // 53 random bits.
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(super) fn log_within(&mut self, low: f64, high: f64) -> f64 {
        self.within(low.ln(), high.ln()).exp()
    }

    pub(super) fn sign(&mut self) -> f64 {
        if self.within(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 }
    }

    pub(super) fn below(&mut self, n: usize) -> usize {
        (self.within(0.0, n as f64) as usize).min(n - 1)
    }

    /// A standard normal number (Box and Muller).
    pub(super) fn normal(&mut self) -> f64 {
        let (u, v) = (self.within(1e-300, 1.0), self.within(0.0, std::f64::consts::TAU));
        (-2.0 * u.ln()).sqrt() * v.cos()
    }
}

/// Draws place, size, material and noise of `cause` in the two-hole shear specimen. Sizes range from what can hardly be
/// seen to what is plain. `strength` is: g of a relaxation; ρ of softening; κ/μ; fibre modulus / shear modulus;
/// relative change from the centre to a face; ln of an inclusion's stiffness factor; ln of the swelling's volume ratio;
/// 1 for a debond; degrees of tilt at full drive; mm off axis at full drive; mm/N; N; mm of a hole's diameter or place;
/// relative gain error; mm of background; mm of a jump; mm of shift; mm of slack; mm or degrees of the plate (along y,
/// z; about x, y, z); mm/kPa of the bonds (fixed, moved, both); mm of a layer's depth (that of the moved plate's
/// layer and its slope along x stand in `extent_mm`); mm off course at full drive along `direction`, growing with the
/// power `extent_mm[0]` of the drive; mm of the block's length, width or, as a wedge, of its width from end to end.
pub fn draw_cause(cause: HiddenCause, seed: u64) -> Hidden {
    let mut d = Draw::new(seed, 1);
    let mu_kpa = d.within(12.0, 22.0);
    let alpha = d.within(1.5, 2.8);
    let ratio = d.log_within(90.0, 180.0);
    let bulk_kpa = 0.5 * mu_kpa * alpha * ratio;
    let mut hidden = Hidden {
        cause,
        seed,
        material: Material { bulk_kpa, terms: vec![OgdenTerm { mu_kpa, alpha }], law: None },
        noise_sd_mm: d.within(0.015, 0.035),
        strength: 0.0,
        which: 0,
        center_mm: [0.0; 3],
        extent_mm: [0.0; 3],
        direction: [0.0; 3],
    };
    match cause {
        HiddenCause::None => {}
        HiddenCause::Relaxation => {
            hidden.strength = d.log_within(0.03, 0.5);
            hidden.center_mm[0] = d.log_within(4.0, 40.0); // τ, s
        }
        HiddenCause::Mullins => hidden.strength = d.log_within(0.05, 0.5),
        HiddenCause::Compressibility => {
            hidden.strength = d.log_within(5.0, 25.0);
            hidden.material.bulk_kpa = 0.5 * mu_kpa * alpha * hidden.strength;
        }
        HiddenCause::Fibre => {
            hidden.strength = d.log_within(0.1, 1.5);
            let raw = [d.normal(), d.normal(), d.normal()];
            let norm = raw.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-9);
            hidden.direction = raw.map(|x| x / norm);
        }
        HiddenCause::Gradient => {
            hidden.strength = d.sign() * d.log_within(0.05, 0.4);
            hidden.which = d.below(3);
        }
        HiddenCause::Inclusion => {
            hidden.strength = d.sign() * d.log_within(0.3, 1.6);
            let radius = d.within(1.5, 3.0);
            hidden.extent_mm = [2.0 * radius; 3];
            // Beside the holes, inside the block.
            let side = d.sign();
            hidden.center_mm = [d.within(-9.0, 9.0), d.within(-1.0, 1.0), side * d.within(4.0, 7.0)];
        }
        HiddenCause::Swelling => hidden.strength = d.sign() * d.log_within(0.005, 0.06),
        HiddenCause::Debond => {
            hidden.strength = 1.0;
            hidden.which = d.below(2);
            let (length, width) = (d.within(2.0, 6.0), d.within(6.0, 19.1));
            let end = d.sign();
            let low_z = d.within(-9.55, 9.55 - width);
            hidden.center_mm =
                [end * (12.7 - 0.5 * length), if hidden.which == 1 { 3.2 } else { -3.2 }, low_z + 0.5 * width];
            hidden.extent_mm = [length, 0.0, width];
        }
        HiddenCause::Tilt => {
            hidden.strength = d.sign() * d.log_within(0.3, 4.0);
            hidden.which = d.below(3);
        }
        HiddenCause::Offaxis => {
            hidden.strength = d.sign() * d.log_within(0.03, 0.5);
            hidden.which = 1 + d.below(2);
        }
        HiddenCause::Compliance => hidden.strength = d.log_within(0.003, 0.05),
        HiddenCause::Cell => hidden.strength = d.sign() * d.log_within(0.05, 0.8),
        HiddenCause::Hole => {
            hidden.which = d.below(2);
            hidden.strength = d.sign() * d.log_within(0.15, 0.9);
            // 0: diameter, 1: along x, 2: across.
            hidden.direction[d.below(3)] = 1.0;
        }
        HiddenCause::Gain => {
            hidden.strength = d.sign() * d.log_within(0.005, 0.08);
            hidden.which = d.below(3);
        }
        HiddenCause::Background => {
            hidden.strength = d.sign() * d.log_within(0.01, 0.2);
            hidden.which = d.below(3);
            hidden.direction = [d.normal(), d.normal(), d.normal()];
        }
        HiddenCause::Wrap => {
            hidden.strength = d.sign() * d.log_within(0.5, 4.0);
            hidden.which = d.below(3);
            hidden.center_mm = [d.within(-8.0, 8.0), 0.0, d.within(-7.0, 7.0)];
            hidden.extent_mm = [d.within(3.0, 6.0), 6.4, d.within(3.0, 6.0)];
        }
        HiddenCause::Registration => {
            hidden.strength = d.sign() * d.log_within(0.05, 0.8);
            hidden.which = [0, 2][d.below(2)];
        }
        HiddenCause::Slack => hidden.strength = d.sign() * d.log_within(0.02, 0.4),
        HiddenCause::Mount => {
            hidden.which = d.below(5);
            hidden.strength =
                d.sign() * if hidden.which < 2 { d.log_within(0.03, 0.5) } else { d.log_within(0.3, 4.0) };
        }
        HiddenCause::Bond => {
            hidden.which = d.below(3);
            hidden.strength = d.log_within(1e-3, 3e-2);
        }
        HiddenCause::Layer => {
            hidden.strength = d.log_within(0.05, 0.6);
            hidden.extent_mm = [d.log_within(0.05, 0.6), d.within(-0.15, 0.15), 0.0];
        }
        HiddenCause::Travel => {
            hidden.strength = d.sign() * d.log_within(0.03, 0.4);
            hidden.extent_mm[0] = [0.4, 2.0][d.below(2)];
            let raw = [d.normal(), d.normal(), d.normal()];
            let norm = raw.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-9);
            hidden.direction = raw.map(|x| x / norm);
        }
        HiddenCause::Outline => {
            hidden.strength = d.sign() * d.log_within(0.1, 1.2);
            hidden.which = d.below(3);
        }
    }
    hidden
}

#[cfg(test)]
mod tests {
    use super::HiddenCause;
    use crate::diagnosis::cause_names;

    /// Every cause that can be hidden is one that the diagnosis can name.
    #[test]
    fn hidden_causes_are_causes_of_the_registry() {
        let known = cause_names();
        for cause in HiddenCause::ALL {
            assert!(cause.diagnosed().is_some_and(|name| known.contains(&name)), "{cause:?}");
        }
        assert_eq!(HiddenCause::None.diagnosed(), None);
    }
}
