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
const BOXES: [usize; 3] = [7, 3, 6];
/// Radii of the balls that are tried, as parts of the sample's smallest extent.
const BALL_RADII: [f64; 3] = [0.25, 0.35, 0.5];
/// Points per edge of a box that say which part of it lies in a ball.
const POINTS_PER_EDGE: usize = 3;
/// Most stiff and most soft balls from which a fit may start; each explains at least this part of what the best does.
const MAX_STARTS: usize = 4;
const LEAST_OF_BEST: f64 = 0.3;
/// Factors of a ball at the start, ln.
const LARGEST_START: f64 = 1.8;

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

    /// Parts that a ball meets, each with the part of it that lies in the ball.
    fn parts_in_ball(&self, center_mm: [f64; 3], radius_mm: f64) -> Vec<(usize, f64)> {
        let size = [0, 1, 2].map(|a| 2.0 * self.half_mm[a] / self.counts[a] as f64);
        let range = [0, 1, 2].map(|a| {
            let low = ((center_mm[a] - radius_mm + self.half_mm[a]) / size[a]).floor().max(0.0) as usize;
            let high = ((center_mm[a] + radius_mm + self.half_mm[a]) / size[a]).ceil().max(0.0) as usize;
            low..high.min(self.counts[a])
        });
        let mut found = Vec::new();
        let points = POINTS_PER_EDGE.pow(3);
        for k in range[2].clone() {
            for j in range[1].clone() {
                for i in range[0].clone() {
                    let inside = (0..points)
                        .filter(|p| {
                            let n = [
                                p % POINTS_PER_EDGE,
                                p / POINTS_PER_EDGE % POINTS_PER_EDGE,
                                p / POINTS_PER_EDGE.pow(2),
                            ];
                            let square: f64 = (0..3)
                                .map(|a| {
                                    let part = (n[a] as f64 + 0.5) / POINTS_PER_EDGE as f64;
                                    let x = ([i, j, k][a] as f64 + part) * size[a] - self.half_mm[a];
                                    (x - center_mm[a]).powi(2)
                                })
                                .sum();
                            square < radius_mm * radius_mm
                        })
                        .count();
                    if inside > 0 {
                        found.push((i + self.counts[0] * (j + self.counts[1] * k), inside as f64 / points as f64));
                    }
                }
            }
        }
        found
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

    /// The block of parts whose sum explains most.
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
                        best = Some(Block { explained, ranges: [x, y, z] });
                    }
                }
            }
        }
        best
    }
}

struct Block {
    explained: f64,
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

/// Map of modulus changes, and inclusions that explain much: the best first, apart from each other, with what each explains.
///
/// # Errors
/// [`DiagnosisError`].
pub fn inclusion_map(
    laboratory: &mut Laboratory,
    material: &Ogden,
    prediction: &Prediction,
    test: &ScoreTest,
) -> Result<(ScoreMap, Vec<(f64, Inclusion)>), DiagnosisError> {
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
    let balls = best_balls(&map);
    Ok((map, balls))
}

/// Balls by what they explain to first order, the modulus of each box changed in proportion to its part in the ball.
fn best_balls(map: &ScoreMap) -> Vec<(f64, Inclusion)> {
    let division = map.division;
    let half = division.half_mm;
    let smallest = half.iter().fold(f64::INFINITY, |s, h| s.min(2.0 * h));
    let mut all: Vec<(f64, Inclusion)> = Vec::new();
    for radius in BALL_RADII.map(|part| part * smallest) {
        let steps = half.map(|h| (4.0 * h / radius).ceil() as usize);
        let at = |a: usize, i: usize| half[a] * ((2 * i + 1) as f64 / steps[a] as f64 - 1.0);
        for k in 0..steps[2] {
            for j in 0..steps[1] {
                for i in 0..steps[0] {
                    let center_mm = [at(0, i), at(1, j), at(2, k)];
                    let members = division.parts_in_ball(center_mm, radius);
                    let (explained, coefficient) = map.prepared.of_weighted(&members);
                    let log_factor = log_factor_of_ball(coefficient);
                    all.push((explained, Inclusion { center_mm, radius_mm: radius, log_factor, half_mm: half }));
                }
            }
        }
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<(f64, Inclusion)> = Vec::new();
    for (explained, ball) in all {
        let is_new = chosen.iter().all(|(_, o)| {
            let distance: f64 = (0..3).map(|a| (o.center_mm[a] - ball.center_mm[a]).powi(2)).sum::<f64>().sqrt();
            distance > o.radius_mm.max(ball.radius_mm) || o.log_factor * ball.log_factor < 0.0
        });
        let best = chosen.first().map_or(0.0, |c| c.0);
        let alike = chosen.iter().filter(|(_, o)| o.log_factor * ball.log_factor > 0.0).count();
        if explained > 0.0 && explained >= LEAST_OF_BEST * best && is_new && alike < MAX_STARTS {
            chosen.push((explained, ball));
        }
    }
    chosen
}

/// ln of the stiffness factor f of a ball whose first-order change is `change`: a ball of an incompressible solid takes
/// 5/(3 + 2 f) of the strain around it (Eshelby 1957), so that its effect is 5 (f − 1)/(3 + 2 f) and no more than 5/2.
pub(super) fn log_factor_of_ball(change: f64) -> f64 {
    let change = change.clamp(-1.6, 2.4);
    ((5.0 + 3.0 * change) / (5.0 - 2.0 * change)).ln().clamp(-LARGEST_START, LARGEST_START)
}

/// The other way round.
pub(super) fn change_of_ball(log_factor: f64) -> f64 {
    let f = log_factor.exp();
    5.0 * (f - 1.0) / (3.0 + 2.0 * f)
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
