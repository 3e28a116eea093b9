//! Which values of phase images stand for −π and π.

use super::error::ScannerError;
use std::f64::consts::PI;

/// Ranges as scanners store them: radians; milliradians; 12 bits without and with a sign, and those of twice the width.
const KNOWN: [[f64; 2]; 5] =
    [[-PI, PI], [-1000.0 * PI, 1000.0 * PI], [0.0, 4096.0], [-4096.0, 4096.0], [-2048.0, 2048.0]];
/// Phases fill a known range at least to this part. No two of the ranges can then be taken for one another: the nearest
/// are those of ±1000π and ±4096, of which the smaller one fills 0.77.
const FILLED: f64 = 0.9;
/// Values may exceed a range by this part of it, as rounding makes them.
const ROUNDING: f64 = 1e-3;

/// The values of phase images that stand for −π and π, a line between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PhaseRange([f64; 2]);

impl PhaseRange {
    /// The range for values from `low` to `high`: the one that was given, or the known one that they fill.
    ///
    /// Noise outside of the sample has all phases, so that images fill their range; those of which the outside was cut
    /// away may not, and then it has to be given.
    pub(super) fn of_values(given: Option<[f64; 2]>, [low, high]: [f64; 2]) -> Result<PhaseRange, ScannerError> {
        let holds = |range: &&[f64; 2]| {
            let margin = ROUNDING * (range[1] - range[0]);
            low >= range[0] - margin && high <= range[1] + margin
        };
        let fills = |range: &&[f64; 2]| high - low >= FILLED * (range[1] - range[0]);
        match given {
            Some(range) if holds(&&range) => Ok(PhaseRange(range)),
            Some(range) => Err(ScannerError::PhaseOutside { low, high, range }),
            None => {
                let found = KNOWN.iter().find(|range| holds(range) && fills(range));
                found.map(|range| PhaseRange(*range)).ok_or(ScannerError::PhaseRange { low, high })
            }
        }
    }

    /// The phase, rad, from −π to π.
    pub(super) fn radians(self, value: f64) -> f64 {
        let [low, high] = self.0;
        ((value - low) / (high - low) * 2.0 - 1.0).clamp(-1.0, 1.0) * PI
    }

    /// The two values.
    pub(super) fn values(self) -> [f64; 2] {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_known_range_is_seen_and_no_other_is_guessed() {
        for range in KNOWN {
            let wide = [0.98 * range[0] + 0.02 * range[1], 0.02 * range[0] + 0.98 * range[1]];
            assert_eq!(PhaseRange::of_values(None, wide).unwrap().values(), range);
            let narrow = [0.9 * range[0] + 0.1 * range[1], 0.1 * range[0] + 0.9 * range[1]];
            let refused = PhaseRange::of_values(None, narrow);
            assert!(matches!(refused, Err(ScannerError::PhaseRange { .. })), "{range:?}");
            assert_eq!(PhaseRange::of_values(Some(range), narrow).unwrap().values(), range);
        }
        assert!(matches!(PhaseRange::of_values(None, [0.0, 65535.0]), Err(ScannerError::PhaseRange { .. })));
        let outside = PhaseRange::of_values(Some([0.0, 4096.0]), [-1.0e3, 10.0]);
        assert!(matches!(outside, Err(ScannerError::PhaseOutside { .. })));
    }

    #[test]
    fn the_ends_of_a_range_are_half_a_turn() {
        let range = PhaseRange::of_values(Some([0.0, 4096.0]), [0.0, 4095.0]).unwrap();
        assert_eq!([0.0, 2048.0, 3072.0, 4096.0].map(|v| range.radians(v)), [-PI, 0.0, 0.5 * PI, PI]);
    }
}
