//! Jumps: connected voxels whose residual differs by one constant from that of all voxels around them, as unwrapping
//! leaves them.
//!
//! What else is left of a recording varies smoothly: between neighbours it changes by little, and a jump by all of
//! itself. Voxels are joined where neighbours differ by less than a limit; what the limit cuts off from the bulk is a
//! jump if the difference to the voxels around it is the same everywhere. Jumps are of any size, and a limit must be
//! above noise and slope and below the jump: some are tried, the smallest first.

use super::location::Location;
use super::trace::Trace;
use crate::calibration::Observed;

/// Smallest number of connected voxels that make a jump.
const MIN_JUMP_VOXELS: usize = 12;
/// Smallest jump, in standard deviations of the noise: a smaller one cannot be told from its edge.
const MIN_JUMP_SD: f64 = 7.0;
/// Neighbours are joined where they differ by less than these multiples of the noise's standard deviation.
const JOINED_BELOW_SD: [f64; 5] = [3.5, 6.0, 10.0, 20.0, 40.0];
/// The residual falls by the full jump across an edge where the difference of two neighbours is off by less than this
/// part of the jump. (The noise of two voxels is a fifth of the smallest jump.)
const FULL_STEP: f64 = 0.5;
/// So large a part of a jump's edge must be full.
const MIN_FULL_STEPS: f64 = 0.9;
/// Largest spread of the full steps: standard deviations of the noise of a difference, and a part of the jump for what
/// else varies there.
const MAX_SPREAD_SD: f64 = 1.6;
const MAX_SPREAD_OF_JUMP: f64 = 0.1;
/// Largest mean change of the residual from one voxel to the next beside a jump's edge: what noise makes of it, in its
/// standard deviations (2/√π), and a part of the jump.
const NOISE_OF_DIFFERENCE: f64 = std::f64::consts::FRAC_2_SQRT_PI;
const MAX_BESIDE: f64 = 0.15;
/// Voxels that are more than this part of all are the bulk.
const BULK: f64 = 0.4;

/// Connected voxels of one component at one step that are off by a constant.
pub struct VoxelJump {
    /// Which step.
    pub step: usize,
    /// Which component.
    pub component: usize,
    /// Places in the compared mask, rising.
    pub voxels: Vec<u32>,
    /// The constant, mm.
    pub size_mm: f64,
    /// The box that holds them.
    pub location: Location,
}

/// One component of a residual at one step, with the neighbours of every voxel.
struct ComponentField<'a> {
    observed: &'a Observed,
    field: &'a [[f64; 3]],
    component: usize,
    /// Per voxel of the grid: its place in the compared mask, `u32::MAX` outside.
    place: &'a [u32],
    step: usize,
}

/// Connected voxels, and how they differ from those around them.
struct Region {
    members: Vec<u32>,
    /// Residual inside minus residual outside, per pair of neighbours.
    steps: Vec<f64>,
    /// How much the residual changes from these pairs on to the next voxel, away from the edge on either side.
    beside: Vec<f64>,
}

impl ComponentField<'_> {
    fn value(&self, place: u32) -> f64 {
        self.field[place as usize][self.component]
    }

    /// Variance of the noise, mm².
    fn noise_mm2(&self, place: u32) -> f64 {
        self.observed.noise_mm2(self.step, place as usize)[self.component]
    }

    /// The next voxel along an axis, forward or backward; `None` outside of the sample.
    fn next(&self, place: u32, axis: usize, forward: bool) -> Option<u32> {
        let (mask, grid) = (&self.observed.mask, &self.observed.mask.grid);
        let mut at = grid.indices(mask.voxels[place as usize] as usize);
        at[axis] = if forward { at[axis] + 1 } else { at[axis].checked_sub(1)? };
        let is_inside = at[axis] < grid.shape[axis];
        is_inside.then(|| self.place[grid.index(at)]).filter(|place| *place != u32::MAX)
    }

    /// The voxels that are joined to `start`, neighbours differing by less than `limit_sd` standard deviations of the
    /// noise; marks what it takes in `is_seen`.
    fn region(&self, start: u32, limit_sd: f64, is_seen: &mut [bool]) -> Region {
        is_seen[start as usize] = true;
        let mut region = Region { members: vec![start], steps: Vec::new(), beside: Vec::new() };
        let mut at = 0;
        while at < region.members.len() {
            let member = region.members[at];
            at += 1;
            let limit_mm = limit_sd * self.noise_mm2(member).sqrt();
            for (axis, forward) in (0..3).flat_map(|axis| [(axis, false), (axis, true)]) {
                let Some(neighbour) = self.next(member, axis, forward) else { continue };
                let step = self.value(member) - self.value(neighbour);
                if step.abs() < limit_mm {
                    if !is_seen[neighbour as usize] {
                        is_seen[neighbour as usize] = true;
                        region.members.push(neighbour);
                    }
                } else if step.is_finite() {
                    region.steps.push(step);
                    let change = |from: u32, forward: bool| {
                        let next = self.next(from, axis, forward)?;
                        Some((self.value(next) - self.value(from)).abs()).filter(|x| x.is_finite())
                    };
                    region.beside.extend(change(member, !forward));
                    region.beside.extend(change(neighbour, forward));
                }
            }
        }
        region
    }

    /// The size of the jump that a region is, mm; `None` where it is none.
    ///
    /// A jump is one number, and it ends at once: the steps across its edge are all alike, and beside them hardly
    /// anything changes. What fades out over several voxels is no jump.
    fn jump_mm(&self, region: &Region) -> Option<f64> {
        if region.members.len() < MIN_JUMP_VOXELS || region.steps.is_empty() {
            return None;
        }
        let noise_mm2 = region.members.iter().map(|&member| self.noise_mm2(member)).sum::<f64>();
        let noise = (noise_mm2 / region.members.len() as f64).sqrt();
        let mut steps = region.steps.clone();
        steps.sort_by(f64::total_cmp);
        let size_mm = steps[steps.len() / 2];
        let full: Vec<f64> = steps.iter().copied().filter(|x| (x / size_mm - 1.0).abs() < FULL_STEP).collect();
        let is_sharp = full.len() as f64 >= MIN_FULL_STEPS * steps.len() as f64;
        let spread = (full.iter().map(|x| (x - size_mm).powi(2)).sum::<f64>() / full.len().max(1) as f64).sqrt();
        let largest = (MAX_SPREAD_SD * std::f64::consts::SQRT_2 * noise).hypot(MAX_SPREAD_OF_JUMP * size_mm);
        let beside = region.beside.iter().sum::<f64>() / region.beside.len().max(1) as f64;
        let is_flat_beside = beside < NOISE_OF_DIFFERENCE * noise + MAX_BESIDE * size_mm.abs();
        let is_jump = is_sharp && is_flat_beside && spread <= largest && size_mm.abs() >= MIN_JUMP_SD * noise;
        is_jump.then_some(size_mm)
    }

    /// All jumps, by the limit that shows them and first voxel.
    fn jumps(&self) -> Vec<(Vec<u32>, f64)> {
        let num_voxels = self.observed.mask.num_voxels();
        let mut is_of_jump = vec![false; num_voxels];
        let mut found: Vec<(Vec<u32>, f64)> = Vec::new();
        for limit_sd in JOINED_BELOW_SD {
            let mut is_seen = is_of_jump.clone();
            for start in 0..num_voxels as u32 {
                if is_seen[start as usize] || !self.value(start).is_finite() {
                    continue;
                }
                let region = self.region(start, limit_sd, &mut is_seen);
                if region.members.len() as f64 > BULK * num_voxels as f64 {
                    continue;
                }
                if let Some(size_mm) = self.jump_mm(&region)
                    && region.members.iter().all(|v| !is_of_jump[*v as usize])
                {
                    region.members.iter().for_each(|v| is_of_jump[*v as usize] = true);
                    found.push((region.members, size_mm));
                }
            }
        }
        found
    }

    /// The box that holds voxels.
    fn location(&self, members: &[u32], step: usize) -> Location {
        let (mask, grid) = (&self.observed.mask, &self.observed.mask.grid);
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for &v in members {
            let x = grid.center_mm(mask.voxels[v as usize] as usize);
            for a in 0..3 {
                low[a] = low[a].min(x[a] - 0.5 * grid.voxel_mm[a]);
                high[a] = high[a].max(x[a] + 0.5 * grid.voxel_mm[a]);
            }
        }
        Location {
            region: format!("u_{} at step {}", ["x", "y", "z"][self.component], step + 1),
            center_mm: [0, 1, 2].map(|a| 0.5 * (low[a] + high[a])),
            extent_mm: [0, 1, 2].map(|a| high[a] - low[a]),
        }
    }
}

/// All jumps of a residual, by step, component and first voxel.
pub fn voxel_jumps(observed: &Observed, residual: &Trace) -> Vec<VoxelJump> {
    let num_voxels = observed.mask.num_voxels();
    let places: Vec<u32> = (0..num_voxels as u32).collect();
    let place = observed.mask.spread(&places, u32::MAX);
    let mut found = Vec::new();
    for (step, field) in residual.displacement.iter().enumerate() {
        for component in 0..3 {
            let field = ComponentField { observed, field, step, component, place: &place };
            for (mut members, size_mm) in field.jumps() {
                let location = field.location(&members, step);
                members.sort_unstable();
                found.push(VoxelJump { step, component, voxels: members, size_mm, location });
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::test_recordings::{FORCE_SD_N, MESH_FACTOR, NOISE_MM, material, recorded};
    use super::*;
    use crate::diagnosis::scene::Scene;

    /// A residual of noise, of a smooth field many times as large, and of a block of voxels that is off by `size_mm`
    /// along z at the second step.
    fn residual(observed: &Observed, size_mm: f64) -> Trace {
        let mut trace = observed.steps.iter().map(|s| s.displacement.clone()).collect::<Vec<_>>();
        let noise: Vec<[f64; 3]> = {
            // Noise of the recording: what its voxels differ from the mean of themselves and the next one.
            let of = |v: usize, c: usize| ((v * 7919 + c * 104_729) % 1000) as f64 / 1000.0 - 0.5;
            (0..observed.mask.num_voxels()).map(|v| [0, 1, 2].map(|c| NOISE_MM * 3.4 * of(v, c))).collect()
        };
        for (step, field) in trace.iter_mut().enumerate() {
            for (v, u) in field.iter_mut().enumerate() {
                let x = observed.mask.grid.center_mm(observed.mask.voxels[v] as usize);
                let smooth = 8.0 * NOISE_MM * (x[0] / 12.0 + x[2] / 9.0);
                *u = noise[v].map(|n| n + smooth);
                if step == 1 && x[0] > 0.0 && x[0] < 8.0 && x[2] > -6.0 && x[2] < 0.0 {
                    u[2] += size_mm;
                }
            }
        }
        Trace { displacement: trace, force: vec![0.0; observed.steps.len()] }
    }

    #[test]
    fn a_jump_is_found_on_a_slope_larger_than_the_noise() {
        let observed = Observed::new(&recorded(&material(), &Scene::default(), MESH_FACTOR), FORCE_SD_N).unwrap();
        for size_mm in [0.2, -0.3, 1.0] {
            let found = voxel_jumps(&observed, &residual(&observed, size_mm));
            let [jump] = &found[..] else { panic!("{} jumps for {size_mm} mm", found.len()) };
            assert_eq!((jump.step, jump.component), (1, 2));
            // The slope changes by half of its 0.08 mm across two voxels at most.
            assert!((jump.size_mm - size_mm).abs() < 0.04, "{} for {size_mm}", jump.size_mm);
            assert!((jump.location.center_mm[0] - 4.0).abs() < 1.5 && (jump.location.center_mm[2] + 3.0).abs() < 1.5);
        }
    }

    /// A debonded corner: what is left rises over two or three voxels, most steeply at its edge.
    #[test]
    fn a_steep_slope_is_no_jump() {
        let observed = Observed::new(&recorded(&material(), &Scene::default(), MESH_FACTOR), FORCE_SD_N).unwrap();
        let mut steep = residual(&observed, 0.0);
        for (v, u) in steep.displacement[1].iter_mut().enumerate() {
            let x = observed.mask.grid.center_mm(observed.mask.voxels[v] as usize);
            u[0] += 0.8 * (1.0 + (-(x[0] + 8.0) / 1.5).exp()).recip();
        }
        assert!(voxel_jumps(&observed, &steep).is_empty());
    }

    #[test]
    fn what_is_smooth_has_no_jumps() {
        let observed = Observed::new(&recorded(&material(), &Scene::default(), MESH_FACTOR), FORCE_SD_N).unwrap();
        assert!(voxel_jumps(&observed, &residual(&observed, 0.0)).is_empty());
        // A jump below seven standard deviations cannot be told from its edge.
        assert!(voxel_jumps(&observed, &residual(&observed, 4.0 * NOISE_MM)).is_empty());
    }
}
