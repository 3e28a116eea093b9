//! What may vary of a study's scan, and what a scan is that was found.

use super::aim::ObjectiveKind;
use super::range::{EdgeRange, Range};
use super::study_limits::{MAX_LENGTH_MM, MIN_LENGTH_MM};
use crate::field::{FieldError, FieldPath};
use crate::sensitivity::ScanSettings;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A study's voxels may become smaller or larger by these factors at most.
pub(super) const MOST_VOXELS: [f64; 2] = [0.25, 10.0];

/// What may vary of the scan. Scanner and scan time stay as they are, so that the noise of a voxel's displacement goes
/// with the displacement per phase and with one over the voxel's volume.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct VaryScan {
    /// Edges of a voxel, from a quarter to ten times the scan's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub voxel_mm: Option<EdgeRange>,
    /// Displacement per phase, of every direction by itself, mm/rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub mm_per_radian: Option<Range>,
}

impl VaryScan {
    /// The scan that lies at `place` of the ranges: in logarithms, each number from 0 to 1, three for the edges if they
    /// vary, then three for the displacement per phase.
    pub(super) fn at(&self, scan: &ScanSettings, place: &[f64]) -> ScanSettings {
        let (mut voxel_mm, mut mm_per_radian) = (scan.voxel_mm, scan.mm_per_radian);
        for (&at, (range, slot)) in place.iter().zip(self.ranges()) {
            let value = range.min * (range.max / range.min).powf(at.clamp(0.0, 1.0));
            match (slot, &mut mm_per_radian) {
                (Slot::Edge(axis), _) => voxel_mm[axis] = value,
                (Slot::Phase(axis), Some(scale)) => scale[axis] = value,
                (Slot::Phase(_), None) => {}
            }
        }
        scan.with_voxels(voxel_mm, mm_per_radian)
    }

    /// Where `scan` lies in the ranges, or the nearest place.
    pub(super) fn place_of(&self, scan: &ScanSettings) -> Vec<f64> {
        let of = |(range, slot): (Range, Slot)| {
            let value = match slot {
                Slot::Edge(axis) => scan.voxel_mm[axis],
                Slot::Phase(axis) => scan.mm_per_radian.map_or(range.max, |scale| scale[axis]),
            };
            let width = (range.max / range.min).ln();
            if width > 0.0 { ((value / range.min).ln() / width).clamp(0.0, 1.0) } else { 0.0 }
        };
        self.ranges().into_iter().map(of).collect()
    }

    /// Everything that is wrong with it, with pointers into it, for a study with this scan and objective.
    pub(super) fn field_errors(&self, scan: &ScanSettings, kind: ObjectiveKind) -> Vec<FieldError> {
        let mut errors = Vec::new();
        let mut refuse = |pointer: &str, found: &str, allowed: &str, remedy: &str| {
            errors.push(FieldError::new(pointer, found, allowed).remedy(remedy));
        };
        if self.voxel_mm.is_none() && self.mm_per_radian.is_none() {
            refuse("", "without any range", "voxel_mm, mm_per_radian or both", "or leave vary.scan out");
        }
        if scan.mm_per_radian.is_none() {
            let remedy = "give scan.mm_per_radian: where no phase can be lost, larger voxels are always better";
            refuse("", "given", "left out where the scan has no displacement per phase", remedy);
        }
        if !kind.is_of_promises_alone() {
            let remedy = "sums over voxels do not compare between voxels of different sizes";
            let allowed = "left out unless objective.kind is d_optimal, a_optimal, e_optimal or worst_relative_sd";
            refuse("", "given", allowed, remedy);
        }
        let mut check = |pointer: FieldPath, value: f64, [low, high]: [f64; 2]| {
            if !(low..=high).contains(&value) {
                errors.push(FieldError::new(pointer.pointer(), value, format!("from {low} to {high}")));
            }
        };
        if let Some(edges) = self.voxel_mm {
            let path = |end: &str, axis: usize| FieldPath::of("voxel_mm").name(end).index(axis);
            for axis in 0..3 {
                let [low, high] = MOST_VOXELS.map(|factor| factor * scan.voxel_mm[axis]);
                check(path("min", axis), edges.min[axis], [low, high]);
                check(path("max", axis), edges.max[axis], [edges.min[axis].max(low), high]);
            }
        }
        if let Some(range) = self.mm_per_radian {
            let path = |end: &str| FieldPath::of("mm_per_radian").name(end);
            check(path("min"), range.min, [MIN_LENGTH_MM, MAX_LENGTH_MM]);
            check(path("max"), range.max, [range.min.max(MIN_LENGTH_MM), MAX_LENGTH_MM]);
        }
        errors
    }

    fn ranges(&self) -> Vec<(Range, Slot)> {
        let of_axis = |r: EdgeRange, axis: usize| Range { min: r.min[axis], max: r.max[axis] };
        let edges = self.voxel_mm.map(|r| [0, 1, 2].map(|axis| (of_axis(r, axis), Slot::Edge(axis))));
        let phases = self.mm_per_radian.map(|range| [0, 1, 2].map(|axis| (range, Slot::Phase(axis))));
        edges.into_iter().chain(phases).flatten().collect()
    }
}

/// What of a scan a number of a place is.
#[derive(Clone, Copy)]
enum Slot {
    Edge(usize),
    Phase(usize),
}

/// The scan that was found for the best design.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ChosenScan {
    /// The scan, in the same time on the same scanner as the study's.
    pub scan: ScanSettings,
    /// Objective of the base scanned so over the base scanned as the study says; null where it has no equilibrium or
    /// breaks a limit so.
    pub base_objective: Option<f64>,
    /// Scans that were tried.
    pub num_tried: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What cannot vary is refused where it stands.
    #[test]
    fn ranges_are_checked() {
        let scan = ScanSettings { mm_per_radian: Some([0.2; 3]), ..ScanSettings::default() };
        let pointers = |vary: &VaryScan, scan: &ScanSettings, kind| {
            vary.field_errors(scan, kind).into_iter().map(|e| e.pointer).collect::<Vec<_>>()
        };
        let edges = EdgeRange { min: [0.5, 0.1, 0.5], max: [2.0, 0.5, 1.0] };
        let good = VaryScan { voxel_mm: Some(edges), mm_per_radian: Some(Range { min: 0.1, max: 0.4 }) };
        assert!(pointers(&good, &scan, ObjectiveKind::DOptimal).is_empty());
        assert_eq!(pointers(&good, &scan, ObjectiveKind::SensitivityAndPromisedSd), [""]);
        assert_eq!(pointers(&good, &ScanSettings::default(), ObjectiveKind::AOptimal), [""]);
        let nothing = VaryScan { voxel_mm: None, mm_per_radian: None };
        assert_eq!(pointers(&nothing, &scan, ObjectiveKind::DOptimal), [""]);
        let edges = EdgeRange { min: [0.5, 0.01, 0.5], max: [2.0, 0.5, 0.4] };
        let bad = VaryScan { voxel_mm: Some(edges), mm_per_radian: Some(Range { min: 0.1, max: f64::NAN }) };
        let expected = ["/voxel_mm/min/1", "/voxel_mm/max/2", "/mm_per_radian/max"];
        assert_eq!(pointers(&bad, &scan, ObjectiveKind::DOptimal), expected);
    }

    /// Ends and middle of the ranges, and back.
    #[test]
    fn places_are_logarithmic() {
        let scan = ScanSettings { mm_per_radian: Some([0.2; 3]), ..ScanSettings::default() };
        let edges = EdgeRange { min: [0.5, 0.125, 0.375], max: [2.0, 0.5, 1.5] };
        let vary = VaryScan { voxel_mm: Some(edges), mm_per_radian: Some(Range { min: 0.1, max: 0.4 }) };
        let same = vary.at(&scan, &[0.5; 6]);
        // The geometric mean of an edge's bounds is twice the smaller; rounding alone.
        let expected = [1.0, 0.25, 0.75];
        assert!(same.voxel_mm.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{same:?}");
        let volume_ratio = 0.1875 / 0.25;
        assert!(same.noise_sd_mm.iter().all(|sd| (sd - 0.05 * volume_ratio).abs() < 1e-12), "{same:?}");
        let place = [0.0, 1.0, 0.25, 0.5, 0.75, 1.0];
        let back = vary.place_of(&vary.at(&scan, &place));
        assert!(back.iter().zip(place).all(|(a, b)| (a - b).abs() < 1e-12), "{back:?}");
        let fixed = VaryScan { voxel_mm: None, mm_per_radian: None };
        assert_eq!(fixed.at(&scan, &[]), scan);
    }
}
