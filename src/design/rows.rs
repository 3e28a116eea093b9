//! The last steps of a search: the best design with a row of voxels more or less along its block.
//!
//! What a scan on a centred grid promises jumps where a row of voxels comes in at the block's free faces. Between two
//! jumps a search improves a block step by step, across one it has to come by chance. A row is therefore added and
//! taken away in every direction that may vary, all else held, until neither is better: a compass search (Kolda, Lewis
//! and Torczon, SIAM Review 45 (2003) 385) whose steps are voxels.

use super::explore::is_makeable;
use super::search_error::SearchError;
use super::search_run::{Judge, SearchRun};
use super::space::{Subspace, Variable};
use super::state::{State, is_same};

/// Rounds of steps from the best design so far.
const MOST_ROUNDS: usize = 4;

impl SearchRun<'_> {
    /// Steps from the best design of `state` by rows of voxels, judged by `judge`. None where the objective does not
    /// jump by rows, or where the study proposes no designs.
    pub(super) fn step_by_rows(
        &self,
        judge: &Judge,
        spaces: &[Subspace],
        state: &mut State,
    ) -> Result<(), SearchError> {
        let study = self.study;
        if !self.jumps_by_rows() || study.budget.propose == 0 {
            return Ok(());
        }
        for _ in 0..MOST_ROUNDS {
            let Some((space, best)) = state.best_among(&|_| true).cloned() else { break };
            let subspace = &spaces[space];
            let is_new = |point: &Vec<f64>| {
                let specimen = subspace.specimen(point);
                is_makeable(&specimen, &study.limits, study.scan.voxel_mm)
                    && !state.candidates.iter().any(|candidate| is_same(&candidate.specimen, &specimen))
            };
            let steps = steps_by_rows(subspace, &best, study.scan.voxel_mm).into_iter().filter(is_new);
            let batch: Vec<(usize, Vec<f64>)> = steps.map(|point| (space, point)).collect();
            if batch.is_empty() {
                break;
            }
            let total = state.num_evaluations + batch.len();
            self.evaluate_batch(judge, spaces, ("rows", &batch, total), state)?;
        }
        Ok(())
    }
}

/// The points with one row of voxels more or less along each of the lengths and widths that vary, within their ranges.
fn steps_by_rows(space: &Subspace, point: &[f64], voxel_mm: [f64; 3]) -> Vec<Vec<f64>> {
    let mut steps = Vec::new();
    for (index, (variable, range)) in space.variables.iter().zip(&space.ranges).enumerate() {
        let row_mm = match variable {
            Variable::Length | Variable::OtherLength(_) => voxel_mm[0],
            Variable::Width | Variable::OtherWidth(_) => voxel_mm[2],
            _ => continue,
        };
        let step = row_mm / (range.max - range.min);
        for value in [point[index] - step, point[index] + step] {
            if (0.0..=1.0).contains(&value) {
                let mut stepped = point.to_vec();
                stepped[index] = value;
                steps.push(stepped);
            }
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::super::space::subspaces;
    use super::super::study::Study;
    use super::*;
    use std::path::Path;

    /// From a block of 29.5 mm of the range of 20 to 30 mm a row of 1 mm can be taken away and none added; of 19 mm in
    /// the range of 15 to 22 mm both. All else stays.
    #[test]
    fn rows_come_and_go_within_the_ranges() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
        let text = std::fs::read_to_string(folder.join("two-hole-shear.json")).expect("the study is there");
        let study = Study::from_json(&text, &folder).expect("the study is valid");
        let spaces = subspaces(&study);
        let space = spaces.iter().find(|s| s.structure.num_holes() == 2).expect("the study has two holes");
        let mut point = vec![0.5; space.variables.len()];
        for (value, variable) in point.iter_mut().zip(&space.variables) {
            match variable {
                Variable::Length => *value = 0.95,
                Variable::Width => *value = 4.0 / 7.0,
                _ => {}
            }
        }
        let before = space.specimen(&point);
        let steps = steps_by_rows(space, &point, study.scan.voxel_mm);
        let blocks: Vec<[f64; 2]> = steps
            .iter()
            .map(|step| {
                let after = space.specimen(step);
                assert!(after.holes == before.holes && after.drive_mm == before.drive_mm);
                assert_eq!(after.block.thickness_mm, before.block.thickness_mm);
                [after.block.length_mm, after.block.width_mm]
            })
            .collect();
        let expected = [[28.5, 19.0], [29.5, 18.25], [29.5, 19.75]];
        assert_eq!(blocks.len(), expected.len(), "{blocks:?}");
        for (block, expected) in blocks.iter().zip(expected) {
            assert!((0..2).all(|c| (block[c] - expected[c]).abs() < 1e-12), "{block:?} {expected:?}");
        }
    }
}
