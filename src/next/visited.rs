//! The states (λ, k) that recordings have visited, and how far beyond them others lie.

use crate::kinematics::Decomposition;

/// Bins of the mode k from 0 to 1.
const NUM_BINS: usize = 10;
/// A bin of fewer voxels says nothing of its mode.
const LEAST_VOXELS: usize = 20;
/// The stretch that this part of a bin's voxels stays below counts as visited: single voxels at singular edges do not.
const PART: f64 = 0.99;

/// How far the law has been seen to hold.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Visited {
    /// Largest ln λ by mode; zero where none was visited.
    limits: [f64; NUM_BINS],
    /// Largest of all: the range over which the law was fitted.
    range: f64,
}

impl Visited {
    /// Of the voxels of all recordings.
    pub(super) fn of<'a>(states: impl Iterator<Item = &'a Decomposition>) -> Visited {
        let mut seen: [Vec<f64>; NUM_BINS] = Default::default();
        let mut all = Vec::new();
        for state in states.filter(|s| s.is_admissible()) {
            let strain = state.stretch_amplitude.ln();
            all.push(strain);
            if let Some(mode) = state.deformation_mode {
                seen[bin_of(mode)].push(strain);
            }
        }
        let limit = |mut strains: Vec<f64>| -> f64 {
            if strains.len() < LEAST_VOXELS {
                return 0.0;
            }
            strains.sort_by(f64::total_cmp);
            strains[((PART * strains.len() as f64) as usize).min(strains.len() - 1)]
        };
        Visited { limits: seen.map(limit), range: limit(all) }
    }

    /// How far a state lies beyond those visited in its mode or the modes beside it, in units of the visited range of
    /// ln λ: 0 within them.
    pub(super) fn beyond(&self, state: &Decomposition) -> f64 {
        let Some(mode) = state.deformation_mode.filter(|_| state.is_admissible()) else { return 0.0 };
        let bin = bin_of(mode);
        let beside = bin.saturating_sub(1)..=(bin + 1).min(NUM_BINS - 1);
        let limit = self.limits[beside].iter().copied().fold(0.0, f64::max);
        let distance = (state.stretch_amplitude.ln() - limit).max(0.0);
        if self.range > 0.0 { distance / self.range } else { 0.0 }
    }
}

fn bin_of(mode: f64) -> usize {
    ((mode.clamp(0.0, 1.0) * NUM_BINS as f64) as usize).min(NUM_BINS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::{compose, decompose};

    fn state(stretch: f64, mode: f64) -> Decomposition {
        let s = compose(stretch, mode);
        decompose(&[[s[0], 0.0, 0.0], [0.0, s[1], 0.0], [0.0, 0.0, s[2]]])
    }

    /// Shear up to λ = e^0.2 confirms shear up to there, and uniaxial tension not at all.
    #[test]
    fn states_are_beyond_what_their_mode_has_seen() {
        let seen: Vec<Decomposition> = (1..=1000).map(|n| state((2e-4 * f64::from(n)).exp(), 0.5)).collect();
        let visited = Visited::of(seen.iter());
        // The 99th percentile of ln λ is 0.198, and one voxel's step of 0.0002.
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 0.005, "{found} for {expected}");
        near(visited.beyond(&state(0.15f64.exp(), 0.5)), 0.0);
        near(visited.beyond(&state(0.396f64.exp(), 0.5)), 1.0);
        near(visited.beyond(&state(0.198f64.exp(), 1.0)), 1.0);
        near(Visited::of([].iter()).beyond(&state(2.0, 0.5)), 0.0);
    }
}
