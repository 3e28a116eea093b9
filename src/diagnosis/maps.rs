//! Maps of where a misfit may come from: a compliance in every part of each bonded face, a modulus change in every box of
//! the sample, each tested to first order. Their best rectangles and boxes are where fits of debonds and inclusions start.

use super::causes::{Debond, Inclusion, Location, Wrap};
use super::error::DiagnosisError;
use super::laboratory::{Laboratory, Prediction};
use super::scene::Scene;
use super::score::{Prepared, ScoreTest};
use super::trace::Trace;
use crate::calibration::Observed;
use crate::fem::Field;
use crate::material::Ogden;
use crate::specimen::{Specimen, TestKind};
use std::sync::Arc;

/// Parts of a bonded face along its longer and its shorter axis.
const FACE_PARTS: [usize; 2] = [8, 4];
/// Boxes of the sample along x, y, z.
const BOXES: [usize; 3] = [6, 2, 5];

/// A regular division of the block.
#[derive(Clone, Copy, Debug)]
pub struct Division {
    /// Numbers of parts along x, y, z.
    pub counts: [usize; 3],
    /// Half extents of the block, mm.
    pub half_mm: [f64; 3],
}

impl Division {
    fn of(specimen: &Specimen, counts: [usize; 3]) -> Division {
        let b = specimen.block;
        Division { counts, half_mm: [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm] }
    }

    /// Number of parts.
    pub fn num_parts(&self) -> usize {
        self.counts.iter().product()
    }

    /// The part that holds a position.
    pub fn part_of(&self, x: [f64; 3]) -> usize {
        let n = [0, 1, 2].map(|a| {
            let t = (0.5 * (x[a] / self.half_mm[a] + 1.0) * self.counts[a] as f64).floor().max(0.0);
            (t as usize).min(self.counts[a] - 1)
        });
        n[0] + self.counts[0] * (n[1] + self.counts[1] * n[2])
    }

    /// Low and high edges (mm) of parts `first` to `last` along axis `a`.
    fn edges(&self, a: usize, first: usize, last: usize) -> [f64; 2] {
        let width = 2.0 * self.half_mm[a] / self.counts[a] as f64;
        [first as f64 * width - self.half_mm[a], (last + 1) as f64 * width - self.half_mm[a]]
    }
}

/// A map of first-order tests.
pub struct ScoreMap {
    /// How the sample is divided.
    pub division: Division,
    /// Per part: signed square root of the deviance that it alone explains.
    pub significance: Vec<f64>,
    pub(super) prepared: Prepared,
}

impl ScoreMap {
    fn new(division: Division, test: &ScoreTest, directions: &[Trace]) -> ScoreMap {
        let prepared = test.prepare(directions);
        let significance = (0..division.num_parts())
            .map(|i| {
                let h = prepared.gram[(i, i)];
                if h > 0.0 { prepared.gradient[i] / h.sqrt() } else { 0.0 }
            })
            .collect();
        ScoreMap { division, significance, prepared }
    }

    /// The block of parts whose sum explains most: deviance, coefficient, first and last part along each axis.
    fn best_block(&self, is_allowed: impl Fn(f64) -> bool) -> Option<Block> {
        let counts = self.division.counts;
        let mut best: Option<Block> = None;
        let ranges: Vec<Vec<[usize; 2]>> =
            counts.iter().map(|&n| (0..n).flat_map(|a| (a..n).map(move |b| [a, b])).collect()).collect();
        for &x in &ranges[0] {
            for &y in &ranges[1] {
                for &z in &ranges[2] {
                    let mut members = Vec::new();
                    for k in z[0]..=z[1] {
                        for j in y[0]..=y[1] {
                            for i in x[0]..=x[1] {
                                members.push(i + counts[0] * (j + counts[1] * k));
                            }
                        }
                    }
                    // Everything is no place.
                    if 2 * members.len() > self.division.num_parts() {
                        continue;
                    }
                    let (explained, coefficient) = self.prepared.of_sum(&members);
                    if is_allowed(coefficient) && best.as_ref().is_none_or(|b| explained > b.explained) {
                        best = Some(Block { explained, coefficient, ranges: [x, y, z] });
                    }
                }
            }
        }
        best
    }
}

struct Block {
    explained: f64,
    coefficient: f64,
    ranges: [[usize; 2]; 3],
}

/// Map of the compliance of a bonded face.
pub struct BondMap {
    /// The map.
    pub map: ScoreMap,
    /// The debond that explains most, and its deviance.
    pub debond: Option<(f64, Debond)>,
    /// Change of the recording with the compliance (mm/kPa) of the whole face.
    pub whole: Trace,
}

/// Map of the compliance of a bonded face, and the debond that explains most.
///
/// # Errors
/// [`DiagnosisError`].
pub fn debond_map(
    laboratory: &mut Laboratory,
    material: &Ogden,
    prediction: &Prediction,
    test: &ScoreTest,
    is_moved_face: bool,
) -> Result<BondMap, DiagnosisError> {
    let specimen = laboratory.observed().specimen.clone();
    let (counts, face_axis, axes) = match specimen.test {
        TestKind::DoubleLapShear => ([FACE_PARTS[0], 1, FACE_PARTS[1]], 1, [0, 2]),
        TestKind::Uniaxial => ([1, FACE_PARTS[1], FACE_PARTS[1]], 0, [1, 2]),
    };
    let division = Division::of(&specimen, counts);
    let directions = laboratory
        .bond_derivatives(material, prediction, is_moved_face, division.num_parts(), &|x| division.part_of(x))?;
    let whole = directions[1..].iter().fold(directions[0].clone(), |sum, part| sum.plus(1.0, part));
    let map = ScoreMap::new(division, test, &directions);
    let debond = map.best_block(|compliance| compliance > 0.0).map(|block| {
        let side = if is_moved_face { 1.0 } else { -1.0 };
        let cause = Debond {
            is_moved_face,
            axes,
            face: (face_axis, side * division.half_mm[face_axis]),
            edges_mm: axes.map(|a| {
                let [low, high] = division.edges(a, block.ranges[a][0], block.ranges[a][1]);
                let half = division.half_mm[a];
                // An edge on the face's own boundary is put past it.
                [
                    if low <= -half + 1e-9 { -half - 0.4 } else { low },
                    if high >= half - 1e-9 { half + 0.4 } else { high },
                ]
            }),
            half_mm: axes.map(|a| division.half_mm[a]),
        };
        (block.explained, cause)
    });
    Ok(BondMap { map, debond, whole })
}

/// Map of modulus changes, and the inclusion that explains most.
///
/// # Errors
/// [`DiagnosisError`].
pub fn inclusion_map(
    laboratory: &mut Laboratory,
    material: &Ogden,
    prediction: &Prediction,
    test: &ScoreTest,
) -> Result<(ScoreMap, Option<(f64, Inclusion)>), DiagnosisError> {
    let specimen = laboratory.observed().specimen.clone();
    let division = Division::of(&specimen, BOXES);
    let paths: Vec<Box<dyn Fn(f64) -> Scene>> = (0..division.num_parts())
        .map(|part| {
            Box::new(move |t: f64| Scene {
                stiffness: vec![Field::new(move |x| if division.part_of(x) == part { 1.0 + t } else { 1.0 })],
                ..Scene::default()
            }) as _
        })
        .collect();
    let paths: Vec<(&dyn Fn(f64) -> Scene, bool)> = paths.iter().map(|p| (&**p, true)).collect();
    let directions = laboratory.derivatives(material, &Scene::default(), prediction, false, &paths, 0.02)?;
    let map = ScoreMap::new(division, test, &directions);
    let found = map.best_block(|_| true).map(|block| {
        let edges = [0, 1, 2].map(|a| division.edges(a, block.ranges[a][0], block.ranges[a][1]));
        let volume: f64 = edges.iter().map(|e| e[1] - e[0]).product();
        let cause = Inclusion {
            center_mm: edges.map(|e| 0.5 * (e[0] + e[1])),
            // A ball of the same volume.
            radius_mm: (0.75 * volume / std::f64::consts::PI).cbrt(),
            log_factor: (1.0 + block.coefficient).clamp(0.2, 5.0).ln(),
            half_mm: division.half_mm,
        };
        (block.explained, cause)
    });
    Ok((map, found))
}

/// Smallest number of connected voxels that make a jump.
const MIN_JUMP_VOXELS: usize = 12;
/// Smallest jump, in standard deviations of the noise: a smaller one cannot be told from its edge.
const MIN_JUMP_SD: f64 = 7.0;
/// Largest mean residual beside a jump, relative to the jump.
const MAX_BESIDE: f64 = 0.25;
/// A step across a jump's edge is full where it differs from the jump by less than this part of it (noise of two voxels at the
/// smallest jump is a fifth); so many of them must be.
const FULL_STEP: f64 = 0.5;
const MIN_FULL_STEPS: f64 = 0.9;
/// A voxel belongs to a jump where its residual exceeds this many standard deviations of the noise.
const JUMP_SD: f64 = 5.0;

/// Connected voxels of one component whose residual is a constant far above the noise.
pub fn jumps(observed: &Observed, residual: &Trace) -> Vec<Wrap> {
    let mask = &observed.mask;
    let places: Vec<u32> = (0..mask.num_voxels() as u32).collect();
    let place = mask.spread(&places, u32::MAX);
    let grid = &mask.grid;
    let strides = [1, grid.shape[0], grid.shape[0] * grid.shape[1]];
    let mut found = Vec::new();
    for (step, field) in residual.displacement.iter().enumerate() {
        for component in 0..3 {
            let limit = JUMP_SD * observed.noise_sd_mm[component];
            let sign = |v: u32| {
                let r = field[v as usize][component];
                if r > limit {
                    1i8
                } else if r < -limit {
                    -1
                } else {
                    0
                }
            };
            let mut is_seen = vec![false; mask.num_voxels()];
            for start in 0..mask.num_voxels() as u32 {
                let s = sign(start);
                if s == 0 || is_seen[start as usize] {
                    continue;
                }
                is_seen[start as usize] = true;
                let mut members = vec![start];
                // Voxels beside it, and the step to each from the voxel inside.
                let mut outside = Vec::new();
                let mut steps = Vec::new();
                let mut next = 0;
                while next < members.len() {
                    let voxel = mask.voxels[members[next] as usize] as usize;
                    next += 1;
                    let at = grid.indices(voxel);
                    for axis in 0..3 {
                        for forward in [false, true] {
                            let is_inside = if forward { at[axis] + 1 < grid.shape[axis] } else { at[axis] > 0 };
                            if !is_inside {
                                continue;
                            }
                            let neighbour = place[if forward { voxel + strides[axis] } else { voxel - strides[axis] }];
                            if neighbour == u32::MAX {
                                continue;
                            }
                            if sign(neighbour) != s {
                                let beside = field[neighbour as usize][component];
                                outside.push(beside);
                                steps.push(field[members[next - 1] as usize][component] - beside);
                            } else if !is_seen[neighbour as usize] {
                                is_seen[neighbour as usize] = true;
                                members.push(neighbour);
                            }
                        }
                    }
                }
                if members.len() < MIN_JUMP_VOXELS {
                    continue;
                }
                let mut values: Vec<f64> = members.iter().map(|&v| field[v as usize][component]).collect();
                values.sort_by(f64::total_cmp);
                let size_mm = values[values.len() / 2];
                let spread = (values.iter().map(|x| (x - size_mm).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
                // A jump is one number, what varies inside is noise; and it ends at once: beside it nothing is left. What fades
                // out over several voxels is no jump.
                let noise = observed.noise_sd_mm[component];
                let beside = outside.iter().sum::<f64>() / outside.len().max(1) as f64;
                let full = steps.iter().filter(|x| (*x / size_mm - 1.0).abs() < FULL_STEP).count();
                let is_sharp = !outside.is_empty()
                    && beside.abs() < MAX_BESIDE * size_mm.abs()
                    && full as f64 >= MIN_FULL_STEPS * steps.len() as f64;
                if spread > 1.6 * noise || size_mm.abs() < MIN_JUMP_SD * noise || !is_sharp {
                    continue;
                }
                let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
                for &v in &members {
                    let x = grid.center_mm(mask.voxels[v as usize] as usize);
                    for a in 0..3 {
                        low[a] = low[a].min(x[a] - 0.5 * grid.voxel_mm[a]);
                        high[a] = high[a].max(x[a] + 0.5 * grid.voxel_mm[a]);
                    }
                }
                let location = Location {
                    region: format!("u_{} at step {}", ["x", "y", "z"][component], step + 1),
                    center_mm: [0, 1, 2].map(|a| 0.5 * (low[a] + high[a])),
                    extent_mm: [0, 1, 2].map(|a| high[a] - low[a]),
                };
                members.sort_unstable();
                found.push(Wrap { step, component, voxels: Arc::new(members), size_mm, location });
            }
        }
    }
    found
}
