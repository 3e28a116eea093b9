//! The study (`study/1`): a base specimen, what may vary, for which materials, how it is scanned, what can be made,
//! what is sought and how hard.

use super::aim::Objective;
use super::range::{AngleRange, CountRange, OffsetRange, Range};
use super::study_limits::{Count, CountOrNone};
use super::vary_scan::VaryScan;
use crate::material::Material;
use crate::sensitivity::{Protocol, ScanSettings};
use crate::specimen::{HoleAxis, HoleKind, ManufacturingLimits, Specimen, TestKind};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A material prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialPrior {
    /// Name in results.
    pub name: String,
    /// Central values.
    pub material: Material,
    /// Relative standard deviation of the prior: each design is also judged with all α raised and all μ lowered by it,
    /// and the reverse (0: at the central values only).
    pub relative_sd: f64,
    /// Weight in averages over materials.
    pub weight: f64,
}

/// How a further sample of the base specimen may vary; what is absent stays.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct VarySample {
    /// Whether length, width and holes are always those of the first sample, so that the two differ in thickness alone.
    pub is_like_first: bool,
    /// Length of the block, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub length_mm: Option<Range>,
    /// Thickness of the block, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub thickness_mm: Option<Range>,
    /// Width of the block, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub width_mm: Option<Range>,
}

/// Outlines of holes that are tried beside circles. All holes of a design are of one kind; each orbit of holes has a
/// length and an angle of its own. A hole that lies on a mirror of the limits' symmetry stands along or across it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct VaryHoleShapes {
    /// Kinds of outlines.
    #[schema(min_items = 1, max_items = 2)]
    pub kinds: Vec<HoleKind>,
    /// How much longer than wide, mm: length less `diameter_mm`.
    pub elongation_mm: Range,
    /// Angle, degrees; any where absent.
    #[serde(default)]
    pub angle_deg: AngleRange,
}

/// What may vary; what is absent stays as in the base specimen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Vary {
    /// Kinds of test.
    #[serde(default)]
    pub tests: Vec<TestKind>,
    /// Numbers of holes.
    pub hole_count: CountRange,
    /// Directions of the holes; where absent, that of the base's holes (along the thickness, where it has none).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub axes: Option<Vec<HoleAxis>>,
    /// The drive, mm.
    pub drive_mm: Range,
    /// Length of the block, mm.
    #[serde(default)]
    pub length_mm: Option<Range>,
    /// Thickness of the block, mm.
    #[serde(default)]
    pub thickness_mm: Option<Range>,
    /// Width of the block, mm.
    #[serde(default)]
    pub width_mm: Option<Range>,
    /// Width of the gauge, mm, where the base is a dumb-bell of free gauge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub gauge_width_mm: Option<Range>,
    /// Length of the gauge between the arcs, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub gauge_length_mm: Option<Range>,
    /// Radius of the arcs between gauge and ends, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub fillet_radius_mm: Option<Range>,
    /// Drive of a further scan before the last one, mm: the two share the time of one scan in the way that is best for
    /// all materials together. The base has one scan in all of the time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub earlier_scan_mm: Option<Range>,
    /// How far the plates of a double-lap test are pressed together before they are driven, and stay so, mm; negative
    /// ones are pulled apart. At most a quarter of the thinnest sample's thickness either way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub precompression_mm: Option<OffsetRange>,
    /// Outlines of holes that are tried beside circles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub hole_shapes: Option<VaryHoleShapes>,
    /// Sides of the block in which round notches are tried: free ones, with a symmetry that mirrors one to the other.
    /// Notches have their centres on the side, and count as holes. None by default.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 2)]
    pub notches: Vec<NotchedSide>,
    /// The base's further samples, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 7)]
    pub other_samples: Vec<VarySample>,
    /// The scan's voxels and encoding: those that are best for the best design are found once designs are ranked. The
    /// base is scanned as the study says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub scan: Option<VaryScan>,
}

/// Sides of a block that notches may open to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum NotchedSide {
    /// Both ends across x.
    Ends,
    /// Both sides along x: across z for holes along the thickness, across y for holes along the width.
    Sides,
}

impl NotchedSide {
    /// The coordinate of the section that the sides lie across: 0 for x, 1 for the other.
    pub fn axis(self) -> usize {
        match self {
            NotchedSide::Ends => 0,
            NotchedSide::Sides => 1,
        }
    }
}

/// How many evaluations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Budget {
    /// Designs solved on the coarse mesh: half of them samples of all structures, the others proposed by what these
    /// have taught.
    #[schema(value_type = Count)]
    pub explore: usize,
    /// Designs improved with gradients, of integrals in place of voxels; 0 for none.
    #[schema(value_type = CountOrNone)]
    pub refine: usize,
    /// Gradient steps of each.
    #[schema(value_type = Count)]
    pub iterations: usize,
    /// Designs of the best structures, solved on the fine mesh, that are proposed by what the designs before have
    /// taught; none where a budget leaves it out.
    #[serde(default, skip_serializing_if = "is_none")]
    #[schema(value_type = CountOrNone, default = 0)]
    pub propose: usize,
    /// Designs confirmed on a finer mesh with the scan's voxels.
    #[schema(value_type = Count)]
    pub confirm: usize,
    /// Scans that are tried for the best design, where the scan may vary.
    #[serde(default = "default_scans", skip_serializing_if = "is_default_scans")]
    #[schema(value_type = Count, default = default_scans)]
    pub scans: usize,
    /// Whether the search judges every design at the priors' stiffer and softer variants too. If not, it is judged at
    /// the central values, three times as many designs are seen in the same time, limits are lowered by what the
    /// confirmation of the base shows for the variants, and the variants themselves enter at confirmation.
    pub variants_in_search: bool,
}

impl Default for Budget {
    fn default() -> Self {
        Budget {
            explore: 160,
            refine: 0,
            iterations: 12,
            propose: 200,
            confirm: 10,
            scans: 80,
            variants_in_search: true,
        }
    }
}

fn default_scans() -> usize {
    Budget::default().scans
}

fn is_default_scans(scans: &usize) -> bool {
    *scans == default_scans()
}

/// Budgets without an evolution are written as they were before there was one.
fn is_none(count: &usize) -> bool {
    *count == 0
}

/// The verification by calibration on synthetic noisy scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct VerificationSettings {
    /// Whether it is done.
    pub is_on: bool,
    /// Noise draws per specimen and material.
    #[schema(value_type = Count)]
    pub draws: usize,
}

impl Default for VerificationSettings {
    fn default() -> Self {
        VerificationSettings { is_on: true, draws: 20 }
    }
}

/// Studies without a protocol are written as they were before there was one.
fn is_plain(protocol: &Protocol) -> bool {
    *protocol == Protocol::default()
}

/// A validated study with its files read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Study {
    /// Free name.
    pub name: String,
    /// What designs are compared with.
    pub base: Specimen,
    /// Material priors; the first is the main one.
    pub materials: Vec<MaterialPrior>,
    /// The scan.
    pub scan: ScanSettings,
    /// Which samples are scanned, of the base as of every design, forces read on the way to the scan, and what is not
    /// known of the load cell.
    #[serde(default, skip_serializing_if = "is_plain")]
    pub protocol: Protocol,
    /// What may vary.
    pub vary: Vary,
    /// What can be made and measured.
    pub limits: ManufacturingLimits,
    /// What is sought.
    pub objective: Objective,
    /// How hard.
    pub budget: Budget,
    /// The proof.
    pub verification: VerificationSettings,
    /// Seed of everything random.
    pub seed: u64,
}

impl Study {
    /// Drives to try, mm: `vary.drive_mm`, never above `limits.max_drive_mm`.
    pub fn drive_range(&self) -> Range {
        let Range { min, max } = self.vary.drive_mm;
        Range { min, max: self.limits.max_drive_mm.map_or(max, |limit| max.min(limit)) }
    }

    /// Directions of holes to try.
    pub fn axes(&self) -> Vec<HoleAxis> {
        match &self.vary.axes {
            Some(axes) if !axes.is_empty() => axes.clone(),
            _ => vec![self.base.hole_axis().unwrap_or(HoleAxis::Thickness)],
        }
    }

    /// Kinds of test to try.
    pub fn tests(&self) -> Vec<TestKind> {
        if self.vary.tests.is_empty() { vec![self.base.test] } else { self.vary.tests.clone() }
    }
}
