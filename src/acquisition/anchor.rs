//! The whole turns that unwrapping leaves open, from the plate that does not move.

use crate::specimen::{Specimen, TestKind};
use crate::voxel::VoxelGrid;
use serde::Serialize;
use std::f64::consts::TAU;
use utoipa::ToSchema;

/// Layers of voxels next to a plate from which the displacement is carried on to it.
const LAYERS: usize = 4;
/// Beyond this part of a turn the nearest whole number of turns is not certain.
const CERTAIN: f64 = 0.25;

/// What is known of the phase's zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, serde::Deserialize, utoipa::ToSchema)]
#[schema(as = PhaseAnchor)]
#[serde(rename_all = "snake_case")]
pub enum Anchor {
    /// Phase zero is displacement zero; only whole turns are open, and the fixed plate decides them.
    #[default]
    WholeTurns,
    /// The phase's zero is arbitrary: the displacement found at the fixed plate is taken off.
    FixedPlate,
    /// As unwrapped: nothing is added.
    None,
}

/// What was found at the plates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct AnchorReport {
    /// What was added to the unwrapped displacement, mm.
    pub added_mm: f64,
    /// Median displacement at the fixed plate afterwards, mm; null where no column of voxels reaches it.
    pub fixed_plate_mm: Option<f64>,
    /// Median displacement at the moved plate afterwards, mm.
    pub moved_plate_mm: Option<f64>,
    /// Columns of voxels that reach the fixed plate.
    pub num_columns: usize,
    /// The nearest whole number of turns is not certain: the fixed plate seems to move by more than a quarter turn.
    pub is_ambiguous: bool,
}

/// Anchors one component in place. `displacement` (mm, grid order, NaN where missing) is known up to whole turns of
/// 2π × `mm_per_radian`.
pub(super) fn anchored(
    displacement: &mut [f64],
    specimen: &Specimen,
    grid: &VoxelGrid,
    mm_per_radian: f64,
    anchor: Anchor,
) -> AnchorReport {
    let (fixed, num_columns) = at_plate(displacement, specimen, grid, false);
    let turn = TAU * mm_per_radian;
    let (added_mm, is_ambiguous) = match (anchor, fixed) {
        (Anchor::None, _) => (0.0, false),
        (_, None) => (0.0, true),
        (Anchor::FixedPlate, Some(u)) => (-u, false),
        (Anchor::WholeTurns, Some(u)) => {
            let turns = (u / turn).round();
            (-turns * turn, (u / turn - turns).abs() > CERTAIN)
        }
    };
    displacement.iter_mut().for_each(|u| *u += added_mm);
    AnchorReport {
        added_mm,
        fixed_plate_mm: fixed.map(|u| u + added_mm),
        moved_plate_mm: at_plate(displacement, specimen, grid, true).0,
        num_columns,
        is_ambiguous,
    }
}

/// Median over columns of the displacement carried on to a plate's face by a line through the nearest voxels.
fn at_plate(displacement: &[f64], specimen: &Specimen, grid: &VoxelGrid, is_moved: bool) -> (Option<f64>, usize) {
    let (axis, extent) = match specimen.test {
        TestKind::DoubleLapShear => (1, specimen.block.thickness_mm),
        TestKind::Uniaxial => (0, specimen.block.length_mm),
    };
    let face = if is_moved { 0.5 * extent } else { -0.5 * extent };
    let taper = specimen.block.taper();
    let stride = grid.stride(axis);
    let n = grid.shape[axis];
    let mut values = Vec::new();
    for start in (0..grid.num_voxels()).filter(|v| (v / stride).is_multiple_of(n)) {
        // The bonded faces of a wedge lie elsewhere in every column.
        let [x, _, _] = grid.center_mm(start);
        let face = if taper.is_even() { face } else { face * taper.at(x) };
        let layers = (0..n).map(|i| if is_moved { n - 1 - i } else { i });
        let mut points = Vec::with_capacity(LAYERS);
        for i in layers {
            let u = displacement[start + i * stride];
            if u.is_finite() {
                points.push([grid.origin_mm[axis] + i as f64 * grid.voxel_mm[axis] - face, u]);
                if points.len() == LAYERS {
                    break;
                }
            }
        }
        // The column must reach the plate: its voxels lie within twice the layers that are used.
        let reach = 2.0 * LAYERS as f64 * grid.voxel_mm[axis];
        if points.len() == LAYERS && points.iter().all(|p| p[0].abs() <= reach) {
            values.push(line_at_zero(&points));
        }
    }
    let num_columns = values.len();
    values.sort_by(f64::total_cmp);
    (values.get(num_columns / 2).copied(), num_columns)
}

/// Value at zero of the least-squares line.
fn line_at_zero(points: &[[f64; 2]]) -> f64 {
    let n = points.len() as f64;
    let mean = |i: usize| points.iter().map(|p| p[i]).sum::<f64>() / n;
    let (x, y) = (mean(0), mean(1));
    let (mut xx, mut xy) = (0.0, 0.0);
    for p in points {
        xx += (p[0] - x).powi(2);
        xy += (p[0] - x) * (p[1] - y);
    }
    if xx > 0.0 { y - x * xy / xx } else { y }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheared(constant: f64) -> (Specimen, VoxelGrid, Vec<f64>) {
        let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
        let grid = VoxelGrid::new([-2.0, -3.0, -2.0], [1.0, 0.25, 1.0], [5, 25, 5]).unwrap();
        let u = (0..grid.num_voxels()).map(|v| 0.7 * (grid.center_mm(v)[1] + 3.2) + constant).collect();
        (specimen, grid, u)
    }

    #[test]
    fn whole_turns_come_from_the_fixed_plate() {
        let (specimen, grid, mut u) = sheared(3.05);
        let report = anchored(&mut u, &specimen, &grid, 1.0 / TAU, Anchor::WholeTurns);
        // A turn is 1 mm: three of them go, the rest of 0.05 mm stays. Rounding of a line through four points.
        assert!((report.added_mm + 3.0).abs() < 1e-12 && !report.is_ambiguous);
        assert!((report.fixed_plate_mm.unwrap() - 0.05).abs() < 1e-12);
        assert!((report.moved_plate_mm.unwrap() - (0.7 * 6.4 + 0.05)).abs() < 1e-12);
        assert_eq!(report.num_columns, 25);
    }

    #[test]
    fn doubt_is_said() {
        let (specimen, grid, mut u) = sheared(0.4);
        assert!(anchored(&mut u, &specimen, &grid, 1.0 / TAU, Anchor::WholeTurns).is_ambiguous);
        let report = anchored(&mut u, &specimen, &grid, 1.0 / TAU, Anchor::FixedPlate);
        assert!(!report.is_ambiguous && report.fixed_plate_mm.unwrap().abs() < 1e-12);
        let mut nothing = vec![f64::NAN; u.len()];
        let report = anchored(&mut nothing, &specimen, &grid, 1.0 / TAU, Anchor::WholeTurns);
        assert!(report.is_ambiguous && report.fixed_plate_mm.is_none());
    }
}
