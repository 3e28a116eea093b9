//! Whether the displacements next to the plates are those of the drive: a wrong unit, sign or order of components shows
//! there at once, and nowhere later.

use super::{MistakenUnit, PlateFault, Recording, RecordingError};
use crate::specimen::{Specimen, TestKind};

/// Ratios of plate motion and drive within these bounds are taken as one: mounts give way, and lines to the plates err.
const NEAR_ONE: std::ops::RangeInclusive<f64> = 0.5..=1.6;
/// Voxels this part of the way between the plates from a plate, or nearer, tell of it.
const REACH: f64 = 0.15;
/// Displacements in metres are nowhere above this part of the drive: where a plate slips, what it slips on still moves.
const SMALL_IN_M: f64 = 0.02;
/// The same of centimetres, in which nothing moves further than twice the drive.
const SMALL_IN_CM: f64 = 0.2;
/// Cosine of the angle by which a plate that is driven obliquely may be off: 37°.
const NEAR_DIRECTION: f64 = 0.8;
/// A component below this part of what follows the drive does not follow it.
const STILL: f64 = 0.2;

impl Recording {
    /// Compares the motion of the plates in every step, where its voxels reach both, with the drive.
    ///
    /// # Errors
    /// [`RecordingError::PlateMotion`] where a unit, a sign or the order of components is wrong.
    pub(super) fn check_plate_motion(&self) -> Result<(), RecordingError> {
        for (n, step) in self.steps.iter().enumerate() {
            let Some(mut found_mm) = self.plate_motion_mm(&step.displacement) else { continue };
            for (found, before) in found_mm.iter_mut().zip(self.specimen.displacement_before_drive_mm()) {
                *found -= before;
            }
            let found = match self.specimen.is_driven_along_x() {
                true => fault(found_mm, step.drive_mm, &step.displacement),
                false => oblique_fault(found_mm, step.drive_mm, &self.specimen),
            };
            if let Some(fault) = found {
                return Err(RecordingError::PlateMotion { step: n + 1, drive_mm: step.drive_mm, found_mm, fault });
            }
        }
        Ok(())
    }

    /// Motion of the driven plate against the other one, by component: the median over columns of voxels of the line
    /// through their outermost ones.
    fn plate_motion_mm(&self, displacement: &[[f64; 3]]) -> Option<[f64; 3]> {
        let (axis, extent) = match self.specimen.test {
            TestKind::DoubleLapShear => (1, self.specimen.block.thickness_mm),
            TestKind::Uniaxial => (0, self.specimen.block.length_mm),
        };
        let (grid, taper) = (&self.grid, self.specimen.block.taper());
        let (stride, n) = (grid.stride(axis), grid.shape[axis]);
        let mut motions = [Vec::new(), Vec::new(), Vec::new()];
        for start in (0..grid.num_voxels()).filter(|v| (v / stride).is_multiple_of(n)) {
            let is_measured = |i: &usize| {
                let v = start + i * stride;
                self.mask[v] && self.is_complete(&displacement[v])
            };
            let (Some(first), Some(last)) = ((0..n).find(is_measured), (0..n).rfind(is_measured)) else { continue };
            // The bonded faces of a wedge lie elsewhere in every column.
            let [x, _, _] = grid.center_mm(start);
            let extent = if taper.is_even() { extent } else { extent * taper.at(x) };
            let place = |i: usize| (grid.origin_mm[axis] + i as f64 * grid.voxel_mm[axis]) / extent;
            if place(first) > REACH - 0.5 || place(last) < 0.5 - REACH {
                continue;
            }
            let (low, high) = (displacement[start + first * stride], displacement[start + last * stride]);
            for (c, motion) in motions.iter_mut().enumerate() {
                motion.push((high[c] - low[c]) / (place(last) - place(first)));
            }
        }
        let median = |values: &mut Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied()
        };
        let [x, y, z] = &mut motions;
        Some([median(x)?, median(y)?, median(z)?])
    }
}

fn fault(found_mm: [f64; 3], drive_mm: f64, displacement: &[[f64; 3]]) -> Option<PlateFault> {
    let ratios = found_mm.map(|motion| motion / drive_mm);
    let is_near = |ratio: f64| NEAR_ONE.contains(&ratio);
    let is_below = |part: f64| displacement.iter().flatten().all(|u| !(u.abs() > part * drive_mm.abs()));
    let unit_of = |ratio: f64| {
        MistakenUnit::ALL.into_iter().find(|unit| {
            let is_small = match unit {
                MistakenUnit::Metres => is_below(SMALL_IN_M),
                MistakenUnit::Centimetres => is_below(SMALL_IN_CM),
                MistakenUnit::Micrometres => true,
            };
            is_near(ratio * unit.in_mm()) && is_small
        })
    };
    let component = |axis: usize| ['x', 'y', 'z'][axis];
    let [x, y, z] = ratios.map(f64::abs);
    let most = if x >= y.max(z) {
        0
    } else if y >= z {
        1
    } else {
        2
    };
    let follows = ratios[most].abs();
    let is_permuted = most > 0 && x < STILL * follows;
    match unit_of(follows) {
        unit if is_permuted && (unit.is_some() || is_near(follows)) => {
            return Some(PlateFault::Permuted { component: component(most), unit });
        }
        Some(unit) if most == 0 => return Some(PlateFault::Unit(unit)),
        _ => {}
    }
    if is_near(-ratios[0]) {
        Some(PlateFault::Sign)
    } else if follows > *NEAR_ONE.end() {
        Some(PlateFault::TooFar { component: component(most), times: follows })
    } else {
        None
    }
}

/// The same where the plate moves at an angle: not one component alone should then follow the drive.
fn oblique_fault(found_mm: [f64; 3], drive_mm: f64, specimen: &Specimen) -> Option<PlateFault> {
    let direction = specimen.drive_direction();
    let size = found_mm.iter().map(|m| m * m).sum::<f64>().sqrt() / drive_mm.abs();
    let along = (0..3).map(|i| found_mm[i] * direction[i]).sum::<f64>() / drive_mm;
    let is_near = |ratio: f64| NEAR_ONE.contains(&ratio);
    if let Some(unit) = MistakenUnit::ALL.into_iter().find(|unit| is_near(along * unit.in_mm())) {
        return Some(PlateFault::Unit(unit));
    }
    if is_near(size) && along < NEAR_DIRECTION * size {
        // Where the drive is negative the plate's own angle is that of the opposite motion.
        let [x, _, z] = found_mm.map(|m| m * drive_mm.signum());
        let (found_deg, told_deg) = (z.atan2(x).to_degrees(), specimen.drive_angle_deg);
        return Some(PlateFault::Direction { found_deg, told_deg });
    }
    let most = if found_mm[0].abs() > found_mm[2].abs() { 'x' } else { 'z' };
    (size > *NEAR_ONE.end()).then_some(PlateFault::TooFar { component: most, times: size })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Filter, RecordedStep};
    use crate::voxel::VoxelGrid;

    /// A block in simple shear by 5 mm, each displacement changed by `change`; or by another drive.
    fn sheared(change: impl Fn([f64; 3]) -> [f64; 3]) -> Result<(), RecordingError> {
        driven_to(5.0, change)
    }

    fn driven_to(drive_mm: f64, change: impl Fn([f64; 3]) -> [f64; 3]) -> Result<(), RecordingError> {
        let specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).expect("a specimen");
        let grid = VoxelGrid::covering(&specimen, [2.0, 0.5, 2.0]).expect("a grid");
        let at = |v: usize| [drive_mm * (grid.center_mm(v)[1] / specimen.block.thickness_mm + 0.5), 0.0, 0.1];
        let displacement = (0..grid.num_voxels()).map(|v| change(at(v))).collect();
        let step = RecordedStep { drive_mm, force_n: None, force_sd_n: None, window_s: None, displacement };
        let mask = vec![true; grid.num_voxels()];
        let recording = Recording {
            id: "sheared".into(),
            specimen,
            grid,
            mask,
            steps: vec![step],
            noise_sd_mm: None,
            filter: Filter::None,
            load: None,
            notes: None,
        };
        recording.check_plate_motion()
    }

    #[test]
    fn what_is_wrong_is_named() {
        sheared(|u| u).expect("as it should be");
        driven_to(-5.0, |u| u).expect("the other way");
        let metres = driven_to(-5.0, |u| u.map(|u| u / 1e3));
        assert!(matches!(
            metres,
            Err(RecordingError::PlateMotion { fault: PlateFault::Unit(MistakenUnit::Metres), .. })
        ));
        let flipped = driven_to(-5.0, |[x, y, z]| [-x, y, z]);
        assert!(matches!(flipped, Err(RecordingError::PlateMotion { fault: PlateFault::Sign, .. })));
        sheared(|u| u.map(|u| 0.7 * u)).expect("a mount that gives way");
        sheared(|u| [u[0] + 40.0, u[1], u[2]]).expect("a phase without a zero");
        sheared(|_| [0.0; 3]).expect("nothing moved: that is for the diagnosis");
        sheared(|u| [0.1 * (u[0] - 2.5) + 2.5, u[1], u[2]]).expect("both plates slip on what moves between them");
        let fault = |change: fn([f64; 3]) -> [f64; 3]| match sheared(change) {
            Err(RecordingError::PlateMotion { step: 1, fault, .. }) => fault,
            other => panic!("{other:?}"),
        };
        assert_eq!(fault(|u| u.map(|u| u / 1e3)), PlateFault::Unit(MistakenUnit::Metres));
        assert_eq!(fault(|u| u.map(|u| u / 10.0)), PlateFault::Unit(MistakenUnit::Centimetres));
        assert_eq!(fault(|u| u.map(|u| u * 1e3)), PlateFault::Unit(MistakenUnit::Micrometres));
        assert_eq!(fault(|[x, y, z]| [-x, y, z]), PlateFault::Sign);
        let permuted = |component, unit| PlateFault::Permuted { component, unit };
        assert_eq!(fault(|[x, y, z]| [y, x, z]), permuted('y', None));
        assert_eq!(fault(|[x, y, z]| [y, z, -x]), permuted('z', None));
        for (unit, change) in [
            (MistakenUnit::Metres, (|[x, y, z]| [y / 1e3, x / 1e3, z / 1e3]) as fn([f64; 3]) -> [f64; 3]),
            (MistakenUnit::Centimetres, |[x, y, z]| [y / 10.0, x / 10.0, z / 10.0]),
            (MistakenUnit::Micrometres, |[x, y, z]| [y * 1e3, x * 1e3, z * 1e3]),
        ] {
            assert_eq!(fault(change), permuted('y', Some(unit)));
        }
        let too_far = fault(|u| u.map(|u| 2.0 * u));
        assert!(matches!(too_far, PlateFault::TooFar { component: 'x', times } if (times - 2.0).abs() < 1e-9));
        let too_far = fault(|[x, y, z]| [x, y, 4.0 * x + z]);
        assert!(matches!(too_far, PlateFault::TooFar { component: 'z', times } if (times - 4.0).abs() < 1e-9));
    }
}
