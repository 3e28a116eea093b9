//! Maps of where a misfit may come from.
//!
//! Two changes are tested to first order, each in every part of the sample alone: a compliance of each part of a bonded
//! face, and a change of the modulus in each box of the block. Fits of debonds start from the rectangle of a face that
//! explains most, fits of inclusions from balls that cover boxes (see [`super::balls`]).

use super::balls::{Ball, best_balls};
use super::division::Division;
use super::error::DiagnosisError;
use super::laboratory::{Laboratory, Prediction};
use super::scene::Scene;
use super::score::{Prepared, ScoreTest};
use super::supposed::Path;
use super::trace::Trace;
use crate::fem::Field;
use crate::material::Material;
use crate::specimen::TestKind;

/// Parts of a bonded face along its longer and its shorter axis.
const FACE_PARTS: [usize; 2] = [8, 4];
/// Boxes of the sample along x, y, z.
const BOXES: [usize; 3] = [7, 3, 6];

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

/// The rectangle of a bonded face that explains most where it is free.
#[derive(Clone, Debug)]
pub struct FacePatch {
    /// Fall of the deviance to first order.
    pub explained: f64,
    /// Whether on the moved face.
    pub is_moved_face: bool,
    /// The two axes in the face.
    pub axes: [usize; 2],
    /// The axis across the face and where the face lies on it, mm.
    pub face: (usize, f64),
    /// Low and high edge along the two axes, mm; an edge on the face's own boundary is put past it.
    pub edges_mm: [[f64; 2]; 2],
    /// Half extents of the face along the two axes, mm.
    pub half_mm: [f64; 2],
}

/// Map of the compliance of a bonded face.
pub struct BondMap {
    /// The map.
    pub map: ScoreMap,
    /// The free patch that explains most; `None` where no patch with a positive compliance explains anything.
    pub patch: Option<FacePatch>,
    /// Change of the recording with the compliance (mm/kPa) of the whole face.
    pub whole: Trace,
}

impl BondMap {
    /// Tests every part of the fixed or the moved face.
    ///
    /// # Errors
    /// [`DiagnosisError`].
    pub fn new(
        laboratory: &mut Laboratory,
        material: &Material,
        scene: &Scene,
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
        let directions =
            laboratory.bond_derivatives(material, scene, prediction, is_moved_face, division.num_parts(), &|x| {
                division.part_of(x)
            })?;
        let whole = directions[1..].iter().fold(directions[0].clone(), |sum, part| sum.plus(1.0, part));
        let map = ScoreMap::new(division, test, &directions);
        let patch = map.best_block(|compliance| compliance > 0.0).map(|block| {
            let side = if is_moved_face { 1.0 } else { -1.0 };
            FacePatch {
                explained: block.explained,
                is_moved_face,
                axes,
                face: (face_axis, side * division.half_mm[face_axis]),
                edges_mm: axes.map(|a| {
                    let [low, high] = division.edges(a, block.ranges[a][0], block.ranges[a][1]);
                    let half = division.half_mm[a];
                    [
                        if low <= -half + 1e-9 { -half - 0.4 } else { low },
                        if high >= half - 1e-9 { half + 0.4 } else { high },
                    ]
                }),
                half_mm: axes.map(|a| division.half_mm[a]),
            }
        });
        Ok(BondMap { map, patch, whole })
    }
}

/// Map of modulus changes.
pub struct StiffnessMap {
    /// The map.
    pub map: ScoreMap,
    /// Balls that explain much, the best first, apart from each other.
    pub balls: Vec<Ball>,
}

impl StiffnessMap {
    /// Tests every box of the block.
    ///
    /// # Errors
    /// [`DiagnosisError`].
    pub fn new(
        laboratory: &mut Laboratory,
        material: &Material,
        scene: &Scene,
        prediction: &Prediction,
        test: &ScoreTest,
    ) -> Result<StiffnessMap, DiagnosisError> {
        let division = Division::of(&laboratory.observed().specimen, BOXES);
        let paths: Vec<Path> = (0..division.num_parts())
            .map(|part| {
                Path::of_sample(move |t: f64| {
                    let mut changed = scene.clone();
                    let factor = move |x| if division.part_of(x) == part { 1.0 + t } else { 1.0 };
                    changed.stiffness.push(Field::new(factor));
                    changed
                })
            })
            .collect();
        let paths: Vec<&Path> = paths.iter().collect();
        let directions = laboratory.derivatives(material, scene, prediction, false, &paths, 0.02)?;
        let map = ScoreMap::new(division, test, &directions);
        let balls = best_balls(&division, &map.prepared);
        Ok(StiffnessMap { map, balls })
    }
}
