//! What structures have in common: how gains and limits go with the block, the drive, how much of the block is cut away
//! and how far out, however many holes do it.
//!
//! When structures begin to compete for evaluations, one of them has been tried some ten times, all others together far
//! more often. What the others teach is therefore the mean of a structure's own processes, which learn what its holes
//! do beside that (in the field's words: kriging with an external trend).

use super::fidelity::Fidelity;
use super::objective::Judged;
use super::space::{Subspace, Variable};
use super::state::State;
use super::surrogate::{Seen, Surrogate};
use crate::sensitivity::{GridPlace, ScanSettings};
use crate::specimen::{HoleAxis, Specimen};
use crate::voxel::VoxelGrid;
use std::sync::Arc;

/// Values below this, and above its negative, are cut: of designs that are far too poor it does not matter by how much,
/// and the surrogate would bend for them.
const LOWEST: f64 = -0.7;
/// What the surrogate learns of whether a design has an equilibrium: this where it has one, its negative where not.
pub(super) const SOLVED: f64 = 0.3;
/// Designs without which nothing is supposed to be common.
const FEWEST: usize = 12;
/// Designs after which a trend is fitted again.
const RENEWED_AFTER: usize = 24;
/// The part of the block that holes take, in ranges of a variable: a quarter of it is as much as a block is varied by.
const PER_PART_CUT: f64 = 4.0;

/// Gains, then margins, cut; last, that there is an equilibrium.
pub(super) fn values_of(judged: &Judged) -> Vec<f64> {
    let values = judged.gains.iter().chain(&judged.margins).map(|v| v.clamp(LOWEST, -LOWEST));
    values.chain([SOLVED]).collect()
}

/// Gains and margins over what all structures share.
pub(super) struct Trend {
    fitted: Surrogate,
    scan: ScanSettings,
    /// Designs of all structures that were known when it was fitted.
    num_known: usize,
}

impl Trend {
    /// By the designs of all other structures that have the same test and holes of the same direction or none; `None`
    /// where there are too few.
    pub fn of_others(state: &State, spaces: &[Subspace], space: usize, scan: ScanSettings) -> Option<Trend> {
        let own = &spaces[space];
        let is_alike = |other: &Subspace| {
            let are_along = |s: &Subspace| s.structure.num_holes() == 0 || s.structure.axis == own.structure.axis;
            other.structure.test == own.structure.test
                && (are_along(other) || own.structure.num_holes() == 0)
                && shared(other).eq(shared(own))
        };
        let (mut seen, mut values) = (Vec::new(), Vec::new());
        for (index, other) in spaces.iter().enumerate().filter(|(index, other)| *index != space && is_alike(other)) {
            for (point, fidelity, judged) in state.seen_of(index) {
                seen.push(Seen { point: features(other, point, &scan), fidelity });
                values.push(values_of(judged));
            }
        }
        if seen.len() < FEWEST {
            return None;
        }
        let fitted = Surrogate::fit(&seen, &values)?;
        Some(Trend { fitted, scan, num_known: state.num_seen() })
    }

    /// Whether so much was learnt since it was fitted that it is worth fitting again.
    pub fn is_outdated(&self, state: &State) -> bool {
        state.num_seen() >= self.num_known + RENEWED_AFTER
    }

    /// What a solution as fine as `at` is expected to give of a design of `space`.
    pub fn means(&self, space: &Subspace, point: &[f64], at: Fidelity) -> Vec<f64> {
        self.fitted.means(&features(space, point, &self.scan), at)
    }
}

/// What is believed of one structure: the trend, if there is one, and its own processes about it.
pub(super) struct Belief {
    trend: Option<Arc<Trend>>,
    own: Surrogate,
    scan: ScanSettings,
}

impl Belief {
    /// From designs of `space` and their values; `None` without any.
    pub fn of(
        trend: Option<Arc<Trend>>,
        space: &Subspace,
        (seen, values): (&[Seen], &[Vec<f64>]),
        scan: ScanSettings,
    ) -> Option<Belief> {
        let over_trend = |(design, values): (&Seen, &Vec<f64>)| match &trend {
            None => values.clone(),
            Some(trend) => {
                let expected = trend.means(space, &design.point, design.fidelity);
                values.iter().zip(expected).map(|(value, expected)| value - expected).collect()
            }
        };
        let over_trend: Vec<Vec<f64>> = seen.iter().zip(values).map(over_trend).collect();
        let described = |s: &Seen| Seen { point: described(space, &s.point, &scan), ..*s };
        let own = Surrogate::fit(&seen.iter().map(described).collect::<Vec<_>>(), &over_trend)?;
        Some(Belief { trend, own, scan })
    }

    /// Mean and standard deviation of what a solution as fine as `at` would give, of each value at a point of `space`.
    pub fn predict(&self, space: &Subspace, point: &[f64], at: Fidelity) -> Vec<(f64, f64)> {
        let mut predicted = self.own.predict(&described(space, point, &self.scan), at);
        if let Some(trend) = &self.trend {
            predicted.iter_mut().zip(trend.means(space, point, at)).for_each(|((mean, _), of_trend)| *mean += of_trend);
        }
        predicted
    }

    /// Whether a solution on the fine mesh is expected to have an equilibrium: above zero where it is.
    pub fn has_fine_equilibrium(&self, space: &Subspace, point: &[f64]) -> f64 {
        let own = self.own.means(&described(space, point, &self.scan), Fidelity::Fine);
        let of_trend = self.trend.as_ref().map_or(0.0, |t| t.means(space, point, Fidelity::Fine).pop().unwrap_or(0.0));
        own.last().copied().unwrap_or(SOLVED) + of_trend
    }

    /// As [`Surrogate::nearest`].
    pub fn nearest(&self, space: &Subspace, point: &[f64], at: Fidelity) -> f64 {
        self.own.nearest(&described(space, point, &self.scan), at)
    }
}

/// The variables that are no hole's.
fn shared(space: &Subspace) -> impl Iterator<Item = Variable> {
    space.variables.iter().copied().filter(|v| !v.is_of_holes())
}

/// How the block's free faces along its length and its width lie among the voxels of a scan: from 0, where a row of
/// voxels has just come in at each side, to 1, where the next ones are about to. Much is seen at free faces: what a
/// scan tells falls as more material lies beyond the voxels, and jumps up where rows come in, alike for all structures.
/// Halfway where it may lie anywhere.
fn beyond_voxels(specimen: &Specimen, scan: &ScanSettings) -> [f64; 2] {
    let spare = VoxelGrid::spare_mm(specimen, scan.voxel_mm).ok().filter(|_| scan.grid == GridPlace::Centred);
    spare.map_or([0.5; 2], |spare_mm| [0, 2].map(|axis| spare_mm[axis] / scan.voxel_mm[axis]))
}

/// A point of `space`, and how its free faces lie among the voxels.
fn described(space: &Subspace, point: &[f64], scan: &ScanSettings) -> Vec<f64> {
    point.iter().copied().chain(beyond_voxels(&space.specimen(point), scan)).collect()
}

/// The block and the drive, how its free faces lie among the voxels, the part of it that is cut away, and how far out
/// along the holes' plane that is: parts that are cut at the ends of an axis and not around the middle.
fn features(space: &Subspace, point: &[f64], scan: &ScanSettings) -> Vec<f64> {
    let specimen = space.specimen(point);
    let block = &specimen.block;
    let part_cut = 1.0 - specimen.volume_mm3() / (block.length_mm * block.thickness_mm * block.width_mm);
    let mut far_out = [0.0; 2];
    for hole in &specimen.holes {
        let across_mm = if hole.axis == HoleAxis::Width { block.thickness_mm } else { block.width_mm };
        let extents_mm = [block.length_mm, across_mm];
        let part = hole.wall().area_mm2() / (extents_mm[0] * extents_mm[1]);
        for (axis, sum) in far_out.iter_mut().enumerate() {
            *sum += part * (2.0 * hole.center_mm[axis] / extents_mm[axis]).powi(2);
        }
    }
    let of_block = space.variables.iter().zip(point).filter(|(v, _)| !v.is_of_holes()).map(|(_, value)| *value);
    let cut = [part_cut, far_out[0], far_out[1]].map(|part| PER_PART_CUT * part);
    of_block.chain(beyond_voxels(&specimen, scan)).chain(cut).collect()
}

#[cfg(test)]
mod tests {
    use super::super::space::subspaces;
    use super::super::study::Study;
    use super::*;
    use std::path::Path;

    fn spaces() -> Vec<Subspace> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
        let text = std::fs::read_to_string(folder.join("two-hole-shear.json")).expect("the study is there");
        subspaces(&Study::from_json(&text, &folder).expect("the study is valid"))
    }

    /// Points with every variable at `holes` or, of the block and the drive, at each of `blocks` in turn.
    fn points(space: &Subspace, holes: f64, blocks: &[f64]) -> Vec<Vec<f64>> {
        let of = |block: f64| space.variables.iter().map(|v| if v.is_of_holes() { holes } else { block }).collect();
        blocks.iter().map(|&block| of(block)).collect()
    }

    /// A gain that grows with the block in every structure and is larger by a twentieth where there is one hole. Of one
    /// hole two small blocks are known, of four holes many: what one hole gains in a large block is then met to a
    /// fiftieth, and without the others it is not.
    #[test]
    fn what_others_show_is_expected_here() {
        let spaces = spaces();
        let of_holes = |number: usize| {
            let found = spaces.iter().find(|s| s.structure.num_holes() == number && !s.structure.orbits[0].on_x);
            found.or(spaces.iter().find(|s| s.structure.num_holes() == number)).expect("the study has it")
        };
        let (one, four) = (of_holes(1), of_holes(4));
        let gain = |space: &Subspace, point: &[f64], own: f64| {
            let block = features(space, point, &ScanSettings::default());
            vec![0.3 * (block[1] + block[3]) - 0.2 * (block[2] - 0.4).powi(2) + own]
        };
        let designs = |space: &Subspace, holes: f64, blocks: &[f64], own: f64| {
            let points = points(space, holes, blocks);
            let values: Vec<Vec<f64>> = points.iter().map(|p| gain(space, p, own)).collect();
            let seen = points.into_iter().map(|point| Seen { point, fidelity: Fidelity::Coarse });
            (seen.collect::<Vec<_>>(), values)
        };
        let everywhere: Vec<f64> = (0..=12).map(|i| f64::from(i) / 12.0).collect();
        let (mut others, mut of_others) = (Vec::new(), Vec::new());
        for holes in [0.0, 0.15] {
            let (seen, values) = designs(four, holes, &everywhere, 0.0);
            let as_features = |s: Seen| Seen { point: features(four, &s.point, &ScanSettings::default()), ..s };
            others.extend(seen.into_iter().map(as_features));
            of_others.extend(values);
        }
        let trend = Surrogate::fit(&others, &of_others)
            .map(|fitted| Arc::new(Trend { fitted, scan: ScanSettings::default(), num_known: 0 }));
        let (seen, values) = designs(one, 0.2, &[0.1, 0.2], 0.05);
        let large = &points(one, 0.2, &[0.9])[0];
        let off = |trend: Option<Arc<Trend>>| {
            let belief = Belief::of(trend, one, (&seen, &values), ScanSettings::default()).expect("there are designs");
            (belief.predict(one, large, Fidelity::Coarse)[0].0 - gain(one, large, 0.05)[0]).abs()
        };
        let (with, without) = (off(trend), off(None));
        assert!(with < 0.02 && without > 0.1, "{with} {without}");
    }
}
