//! Jumps: connected voxels whose residual is one constant far above the noise, as unwrapping leaves them.

use super::location::Location;
use super::trace::Trace;
use crate::calibration::Observed;

/// Smallest number of connected voxels that make a jump.
const MIN_JUMP_VOXELS: usize = 12;
/// Smallest jump, in standard deviations of the noise: a smaller one cannot be told from its edge.
const MIN_JUMP_SD: f64 = 7.0;
/// Largest mean residual beside a jump, relative to the jump.
const MAX_BESIDE: f64 = 0.25;
/// The residual falls by the full jump across an edge where the difference of two neighbours is off by less than this
/// part of the jump. (The noise of two voxels is a fifth of the smallest jump.)
const FULL_STEP: f64 = 0.5;
/// So large a part of a jump's edge must be full.
const MIN_FULL_STEPS: f64 = 0.9;
/// A voxel belongs to a jump where its residual exceeds this many standard deviations of the noise.
const JUMP_SD: f64 = 5.0;
/// Largest spread of the residual within a jump, in standard deviations of the noise.
const MAX_SPREAD_SD: f64 = 1.6;

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
    /// Standard deviation of the noise, mm.
    noise: f64,
}

/// Connected voxels of one sign, and the voxels beside them.
struct Region {
    members: Vec<u32>,
    /// Residuals of the voxels beside it, once per pair of neighbours.
    outside: Vec<f64>,
    /// Residual inside minus residual outside, per pair of neighbours.
    steps: Vec<f64>,
}

impl ComponentField<'_> {
    fn value(&self, place: u32) -> f64 {
        self.field[place as usize][self.component]
    }

    /// 1 or −1 where the residual is far above the noise, else 0.
    fn sign(&self, place: u32) -> i8 {
        let (r, limit) = (self.value(place), JUMP_SD * self.noise);
        if r > limit {
            1
        } else if r < -limit {
            -1
        } else {
            0
        }
    }

    /// Grows the region of `start`'s sign from it; marks what it takes in `is_seen`.
    fn region(&self, start: u32, is_seen: &mut [bool]) -> Region {
        let (mask, grid) = (&self.observed.mask, &self.observed.mask.grid);
        let strides = [1, grid.shape[0], grid.shape[0] * grid.shape[1]];
        let s = self.sign(start);
        is_seen[start as usize] = true;
        let mut region = Region { members: vec![start], outside: Vec::new(), steps: Vec::new() };
        let mut next = 0;
        while next < region.members.len() {
            let member = region.members[next];
            let voxel = mask.voxels[member as usize] as usize;
            next += 1;
            let at = grid.indices(voxel);
            for axis in 0..3 {
                for forward in [false, true] {
                    let is_inside = if forward { at[axis] + 1 < grid.shape[axis] } else { at[axis] > 0 };
                    if !is_inside {
                        continue;
                    }
                    let neighbour = self.place[if forward { voxel + strides[axis] } else { voxel - strides[axis] }];
                    if neighbour == u32::MAX {
                        continue;
                    }
                    if self.sign(neighbour) != s {
                        let beside = self.value(neighbour);
                        region.outside.push(beside);
                        region.steps.push(self.value(member) - beside);
                    } else if !is_seen[neighbour as usize] {
                        is_seen[neighbour as usize] = true;
                        region.members.push(neighbour);
                    }
                }
            }
        }
        region
    }

    /// The size of the jump that a region is, mm; `None` where it is none.
    ///
    /// A jump is one number: what varies inside it is noise. It ends at once: nothing is left beside it. What fades out
    /// over several voxels is no jump.
    fn jump_mm(&self, region: &Region) -> Option<f64> {
        if region.members.len() < MIN_JUMP_VOXELS {
            return None;
        }
        let mut values: Vec<f64> = region.members.iter().map(|&v| self.value(v)).collect();
        values.sort_by(f64::total_cmp);
        let size_mm = values[values.len() / 2];
        let spread = (values.iter().map(|x| (x - size_mm).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
        let beside = region.outside.iter().sum::<f64>() / region.outside.len().max(1) as f64;
        let full = region.steps.iter().filter(|x| (*x / size_mm - 1.0).abs() < FULL_STEP).count();
        let is_sharp = !region.outside.is_empty()
            && beside.abs() < MAX_BESIDE * size_mm.abs()
            && full as f64 >= MIN_FULL_STEPS * region.steps.len() as f64;
        let is_jump = spread <= MAX_SPREAD_SD * self.noise && size_mm.abs() >= MIN_JUMP_SD * self.noise && is_sharp;
        is_jump.then_some(size_mm)
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
            let noise = observed.noise_sd_mm[component];
            let field = ComponentField { observed, field, component, place: &place, noise };
            let mut is_seen = vec![false; num_voxels];
            for start in 0..num_voxels as u32 {
                if field.sign(start) == 0 || is_seen[start as usize] {
                    continue;
                }
                let mut region = field.region(start, &mut is_seen);
                if let Some(size_mm) = field.jump_mm(&region) {
                    let location = field.location(&region.members, step);
                    region.members.sort_unstable();
                    found.push(VoxelJump { step, component, voxels: region.members, size_mm, location });
                }
            }
        }
    }
    found
}
