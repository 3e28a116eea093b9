//! Manufacturability: what the mould maker, the scanner and the actuator allow.

use super::json::JsonProblem;
use super::{LigamentKind, LimitsError, MAX_HOLES, MIRROR_TOLERANCE_MM, Specimen};
#[cfg(feature = "schema")]
use crate::field::schema::{integer_within, number_above, schema_type};
use crate::field::{FieldError, FieldPath};
use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::openapi::schema::ArrayBuilder;

/// A largest stretch must be above this: the undeformed body has it.
const UNDEFORMED_STRETCH: f64 = 1.0;

#[cfg(feature = "schema")]
schema_type! {
    /// A length, mm, above 0.
    PositiveMm = number_above(0.0);
    /// A force, N, above 0.
    PositiveForceN = number_above(0.0);
    /// A number above 0.
    PositiveNumber = number_above(0.0);
    /// A stretch above that of the undeformed body.
    LargestStretch = number_above(UNDEFORMED_STRETCH);
    /// Diameters of punches, mm.
    Punches = ArrayBuilder::new().items(number_above(0.0)).min_items(Some(1));
    /// A number of holes.
    NumHoles = integer_within(0..=MAX_HOLES);
}

/// How far a diameter may be off a punch, mm.
const PUNCH_TOLERANCE_MM: f64 = 1e-6;
/// Rounding by which a value may miss its limit and still satisfy it, relative to the limit.
const ROUNDING: f64 = 1e-9;

/// Diameters that can be made, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct DiameterRange {
    /// Smallest, mm.
    #[cfg_attr(feature = "schema", schema(value_type = PositiveMm))]
    pub min: f64,
    /// Largest, mm.
    #[cfg_attr(feature = "schema", schema(value_type = PositiveMm))]
    pub max: f64,
}

/// Mirror planes through the origin that the geometry must have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Symmetry {
    /// Free.
    #[default]
    None,
    /// x → −x.
    MirrorX,
    /// y → −y.
    MirrorY,
    /// z → −z.
    MirrorZ,
    /// x → −x and z → −z.
    MirrorXAndZ,
    /// x → −x and y → −y.
    MirrorXAndY,
    /// Half a turn about the holes' direction: every hole has its image through the centre of the section.
    Point,
}

impl Symmetry {
    /// The mirrors (for `Point` the half turn), as the signs of (x, y, z).
    pub fn mirrors(self) -> &'static [[f64; 3]] {
        const X: [f64; 3] = [-1.0, 1.0, 1.0];
        const Y: [f64; 3] = [1.0, -1.0, 1.0];
        const Z: [f64; 3] = [1.0, 1.0, -1.0];
        match self {
            Symmetry::None => &[],
            Symmetry::MirrorX => &[X],
            Symmetry::MirrorY => &[Y],
            Symmetry::MirrorZ => &[Z],
            Symmetry::MirrorXAndZ => &[X, Z],
            Symmetry::MirrorXAndY => &[X, Y],
            // The sign along the holes' direction means nothing.
            Symmetry::Point => &[[-1.0, -1.0, -1.0]],
        }
    }
}

/// Limits that a proposed design must keep.
///
/// ```
/// use lambdak::specimen::ManufacturingLimits;
/// let limits = ManufacturingLimits::from_json(
///     r#"{ "min_ligament_hole_hole_mm": 2.0, "min_ligament_hole_edge_mm": 2.0, "punches_mm": [3.0, 4.0, 5.0] }"#,
/// )?;
/// assert_eq!(limits.max_holes, None);
/// # Ok::<(), lambdak::specimen::LimitsError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ManufacturingLimits {
    /// Thinnest ligament between two holes, mm.
    #[cfg_attr(feature = "schema", schema(value_type = PositiveMm))]
    pub min_ligament_hole_hole_mm: f64,
    /// Thinnest ligament between a hole and a side of the section, mm.
    #[cfg_attr(feature = "schema", schema(value_type = PositiveMm))]
    pub min_ligament_hole_edge_mm: f64,
    /// Continuous range of diameters, mm. Exactly one of this and `punches_mm` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<DiameterRange>, nullable = false))]
    pub diameter_mm: Option<DiameterRange>,
    /// Diameters of the punches or pins at hand, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<Punches>, nullable = false))]
    pub punches_mm: Option<Vec<f64>>,
    /// Fewest voxels across any ligament, counted as [`ManufacturingLimits::voxels_across`] does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<PositiveNumber>, nullable = false))]
    pub min_voxels_across_ligament: Option<f64>,
    /// Largest force of the actuator or load cell, all samples together and either way, N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<PositiveForceN>, nullable = false))]
    pub max_force_n: Option<f64>,
    /// Largest force across the plates of a double-lap test, N: what pulls them together or pushes them apart at the
    /// largest drive, all samples together and either way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<PositiveForceN>, nullable = false))]
    pub max_normal_force_n: Option<f64>,
    /// Largest travel of the actuator either way, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<PositiveMm>, nullable = false))]
    pub max_drive_mm: Option<f64>,
    /// Largest principal stretch anywhere, against tearing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<LargestStretch>, nullable = false))]
    pub max_local_stretch: Option<f64>,
    /// Most holes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<NumHoles>, nullable = false))]
    pub max_holes: Option<usize>,
    /// Mirror planes that the geometry must have.
    #[serde(default)]
    pub symmetry: Symmetry,
    /// What a mould maker works to, mm: designs are given in multiples of it, but for punches; 0.1 where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<PositiveMm>, nullable = false))]
    pub dimension_step_mm: Option<f64>,
}

/// What a test does at its largest drive, as far as it is limited.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestResponse {
    /// The drive, mm.
    pub drive_mm: f64,
    /// Force of all samples along the drive, N.
    pub force_n: f64,
    /// Force of all samples across the plates, N; `None` of a test without plates.
    pub normal_force_n: Option<f64>,
    /// Largest principal stretch anywhere.
    pub local_stretch: f64,
}

impl TestResponse {
    /// What must be at most its limit, in the order of [`ManufacturingLimits::of_response`].
    pub fn limited(&self) -> [Option<f64>; 4] {
        let across = self.normal_force_n.map(f64::abs);
        [Some(self.drive_mm.abs()), Some(self.force_n.abs()), across, Some(self.local_stretch)]
    }
}

/// How far a value is from its limit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LimitMargin {
    /// Name of the limit, with its unit, as in [`ManufacturingLimits`].
    pub name: String,
    /// The value, in the limit's unit.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// Distance from the limit relative to the limit (to 1 where the limit is below 1 in a count); negative where
    /// violated. A limit that is met or not, without a distance (punches, symmetry), has 1 where met.
    pub margin_relative: f64,
    /// Whether the limit is kept, to rounding.
    pub is_satisfied: bool,
}

impl LimitMargin {
    /// `value` must be at least `limit`. A NaN violates.
    pub fn at_least(name: &str, value: f64, limit: f64) -> Self {
        Self::from_difference(name, value, limit, value - limit)
    }

    /// `value` must be at most `limit`. A NaN violates.
    pub fn at_most(name: &str, value: f64, limit: f64) -> Self {
        Self::from_difference(name, value, limit, limit - value)
    }

    /// What is limited, as people say it; the name itself where it is none of [`ManufacturingLimits`].
    pub fn plain_name(&self) -> &str {
        match self.name.as_str() {
            "min_ligament_hole_hole_mm" => "wall between two holes",
            "min_ligament_hole_edge_mm" => "wall between a hole and a side",
            "diameter_mm.min" => "smallest hole",
            "diameter_mm.max" => "largest hole",
            "punches_mm" => "hole without a punch",
            "min_voxels_across_ligament" => "voxels across the thinnest wall",
            "max_force_n" => "largest force",
            "max_normal_force_n" => "force across the plates",
            "max_drive_mm" => "drive",
            "max_local_stretch" => "largest local stretch",
            "max_holes" => "number of holes",
            "symmetry" => "symmetry",
            other => other,
        }
    }

    /// The unit of value and limit; empty for counts and ratios.
    pub fn unit(&self) -> &'static str {
        match self.name.as_str() {
            name if name.ends_with("_mm") || name.starts_with("diameter_mm") || name == "symmetry" => "mm",
            "max_force_n" | "max_normal_force_n" => "N",
            _ => "",
        }
    }

    /// Limit, value and margin in words.
    pub fn in_words(&self) -> String {
        let unit = self.unit();
        let with_unit = |value: f64| format!("{value:.3} {unit}").trim_end().to_string();
        let (value, limit, margin) = (with_unit(self.value), with_unit(self.limit), 100.0 * self.margin_relative);
        format!("{}: {value} (limit {limit}, margin {margin:.1} %)", self.plain_name())
    }

    fn from_difference(name: &str, value: f64, limit: f64, difference: f64) -> Self {
        let margin_relative = relative(difference, limit);
        LimitMargin { name: name.into(), value, limit, margin_relative, is_satisfied: margin_relative >= -ROUNDING }
    }

    /// A limit without a distance: met within `tolerance` of `limit`, or violated by `difference / scale`.
    fn discrete(name: &str, value: f64, limit: f64, difference: f64, tolerance: f64, scale: f64) -> Self {
        let is_satisfied = difference <= tolerance;
        let margin_relative = if is_satisfied { 1.0 } else { -relative(difference, scale) };
        LimitMargin { name: name.into(), value, limit, margin_relative, is_satisfied }
    }
}

/// A difference relative to a limit, finite where both are. Counts may be limited to zero; every other limit is
/// positive, but may be smaller than any difference.
fn relative(difference: f64, limit: f64) -> f64 {
    let scale = if limit.abs() > f64::MIN_POSITIVE { limit.abs() } else { 1.0 };
    (difference / scale).clamp(f64::MIN, f64::MAX)
}

impl ManufacturingLimits {
    /// Reads and validates limits.
    ///
    /// # Errors
    /// [`LimitsError`].
    pub fn from_json(text: &str) -> Result<Self, LimitsError> {
        let limits: Self =
            serde_json::from_str(text).map_err(|error| LimitsError::Json(JsonProblem::new(text, &error)))?;
        limits.validate()?;
        Ok(limits)
    }

    /// Checks the limits themselves. Call it when the limits are part of a larger file.
    ///
    /// # Errors
    /// [`LimitsError`]: the first problem found.
    pub fn validate(&self) -> Result<(), LimitsError> {
        self.problems().into_iter().next().map_or(Ok(()), Err)
    }

    /// Every limit that is no limit, with pointers; the first is that of [`ManufacturingLimits::validate`].
    pub fn field_errors(&self) -> Vec<FieldError> {
        self.problems().iter().map(LimitsError::field_error).collect()
    }

    fn problems(&self) -> Vec<LimitsError> {
        let mut problems = Vec::new();
        let mut check = |field: FieldPath, value: f64, above: f64| {
            if !(value.is_finite() && value > above) {
                problems.push(LimitsError::OutOfRange { field, value, above });
            }
        };
        check(FieldPath::of("min_ligament_hole_hole_mm"), self.min_ligament_hole_hole_mm, 0.0);
        check(FieldPath::of("min_ligament_hole_edge_mm"), self.min_ligament_hole_edge_mm, 0.0);
        if let Some(range) = &self.diameter_mm {
            check(FieldPath::of("diameter_mm").name("min"), range.min, 0.0);
            check(FieldPath::of("diameter_mm").name("max"), range.max, 0.0);
        }
        for (i, punch) in self.punches_mm.iter().flatten().enumerate() {
            check(FieldPath::of("punches_mm").index(i), *punch, 0.0);
        }
        for (name, value, least) in [
            ("min_voxels_across_ligament", self.min_voxels_across_ligament, 0.0),
            ("max_force_n", self.max_force_n, 0.0),
            ("max_normal_force_n", self.max_normal_force_n, 0.0),
            ("max_drive_mm", self.max_drive_mm, 0.0),
            ("dimension_step_mm", self.dimension_step_mm, 0.0),
            ("max_local_stretch", self.max_local_stretch, UNDEFORMED_STRETCH),
        ] {
            if let Some(value) = value {
                check(FieldPath::of(name), value, least);
            }
        }
        match (&self.diameter_mm, &self.punches_mm) {
            (Some(range), None) if range.min > range.max => {
                problems.push(LimitsError::EmptyRange { min_mm: range.min, max_mm: range.max });
            }
            (None, Some(punches)) if punches.is_empty() => problems.push(LimitsError::NoPunches),
            (Some(_), None) | (None, Some(_)) => {}
            (range, punches) => {
                let (has_range, has_punches) = (range.is_some(), punches.is_some());
                problems.push(LimitsError::DiametersAmbiguous { has_range, has_punches });
            }
        }
        if let Some(value) = self.max_holes.filter(|value| *value > MAX_HOLES) {
            problems.push(LimitsError::TooManyHoles { value, limit: MAX_HOLES });
        }
        problems
    }

    /// The thinnest allowed ligament of a kind, mm.
    pub fn min_ligament_mm(&self, kind: LigamentKind) -> f64 {
        match kind {
            LigamentKind::HoleHole(..) => self.min_ligament_hole_hole_mm,
            LigamentKind::HoleEdge(..) => self.min_ligament_hole_edge_mm,
        }
    }

    /// Voxels across a ligament of the section: voxel layers passed along the axis on which the ligament passes
    /// most, max over axes of (thickness × |direction| / voxel). Never more than the voxels really crossed.
    pub fn voxels_across(specimen: &Specimen, length_mm: f64, direction: [f64; 2], voxel_mm: [f64; 3]) -> f64 {
        let lateral_voxel = match specimen.extrusion_axis() {
            super::HoleAxis::Thickness => voxel_mm[2],
            super::HoleAxis::Width => voxel_mm[1],
        };
        length_mm * (direction[0].abs() / voxel_mm[0]).max(direction[1].abs() / lateral_voxel)
    }

    /// Margins of every limit on the geometry, by closed forms: thinnest ligament of each kind, diameters, voxels
    /// across the ligament that has fewest, number of holes, symmetry. Without holes only what applies; of several
    /// samples the smallest margin of each limit. `voxel_mm`: the scan's voxel along (x, y, z).
    pub fn check_geometry(&self, specimen: &Specimen, voxel_mm: [f64; 3]) -> Vec<LimitMargin> {
        let mut worst: Vec<LimitMargin> = Vec::new();
        for own in specimen.samples().iter().flat_map(|sample| self.check_sample(sample, voxel_mm)) {
            match worst.iter_mut().find(|m| m.name == own.name) {
                // A NaN wins, so that it is seen.
                Some(margin) if !(own.margin_relative >= margin.margin_relative) => *margin = own,
                Some(_) => {}
                None => worst.push(own),
            }
        }
        worst
    }

    /// [`Self::check_geometry`] of one sample.
    fn check_sample(&self, specimen: &Specimen, voxel_mm: [f64; 3]) -> Vec<LimitMargin> {
        let mut margins = Vec::new();
        let ligaments = specimen.ligaments();
        let is_between_holes = |kind: LigamentKind| matches!(kind, LigamentKind::HoleHole(..));
        for (name, between_holes, limit) in [
            ("min_ligament_hole_hole_mm", true, self.min_ligament_hole_hole_mm),
            ("min_ligament_hole_edge_mm", false, self.min_ligament_hole_edge_mm),
        ] {
            let thinnest =
                least(ligaments.iter().filter(|l| is_between_holes(l.kind) == between_holes).map(|l| l.length_mm));
            margins.extend(thinnest.map(|value| LimitMargin::at_least(name, value, limit)));
        }
        if let Some(range) = &self.diameter_mm {
            let smallest = least(specimen.holes.iter().map(|hole| hole.diameter_mm));
            let largest = least(specimen.holes.iter().map(|hole| -hole.diameter_mm)).map(|value| -value);
            margins.extend(smallest.map(|value| LimitMargin::at_least("diameter_mm.min", value, range.min)));
            margins.extend(largest.map(|value| LimitMargin::at_most("diameter_mm.max", value, range.max)));
        }
        if let Some(punches) = &self.punches_mm {
            margins.extend(worst_punch(specimen, punches));
        }
        if let Some(limit) = self.min_voxels_across_ligament {
            let fewest =
                least(ligaments.iter().map(|l| Self::voxels_across(specimen, l.length_mm, l.direction, voxel_mm)));
            margins.extend(fewest.map(|value| LimitMargin::at_least("min_voxels_across_ligament", value, limit)));
        }
        if let Some(limit) = self.max_holes {
            margins.push(LimitMargin::at_most("max_holes", specimen.holes.len() as f64, limit as f64));
        }
        if self.symmetry != Symmetry::None {
            let defects = self.symmetry.mirrors().iter().map(|signs| specimen.mirror_defect_mm(*signs));
            let defect = defects.fold(0.0, f64::max);
            let scale = specimen.section_size()[0];
            let tolerance = MIRROR_TOLERANCE_MM;
            margins.push(LimitMargin::discrete("symmetry", defect, tolerance, defect, tolerance, scale));
        }
        margins
    }

    /// Margins of the limits on what the test does. A quantity that is not limited gives no margin, nor does one that
    /// the test has not.
    pub fn check_response(&self, response: &TestResponse) -> Vec<LimitMargin> {
        let limits = self.of_response().into_iter().zip(response.limited());
        limits.filter_map(|((name, limit), value)| Some(LimitMargin::at_most(name, value?, limit?))).collect()
    }

    /// The limits on what the test does, in the order of [`TestResponse::limited`]: their names and, where they are
    /// set, values.
    pub fn of_response(&self) -> [(&'static str, Option<f64>); 4] {
        [
            ("max_drive_mm", self.max_drive_mm),
            ("max_force_n", self.max_force_n),
            ("max_normal_force_n", self.max_normal_force_n),
            ("max_local_stretch", self.max_local_stretch),
        ]
    }
}

/// The diameter that is furthest from its nearest punch.
fn worst_punch(specimen: &Specimen, punches: &[f64]) -> Option<LimitMargin> {
    let nearest_of =
        |diameter: f64| punches.iter().copied().min_by(|a, b| (a - diameter).abs().total_cmp(&(b - diameter).abs()));
    specimen
        .holes
        .iter()
        .filter_map(|hole| nearest_of(hole.diameter_mm).map(|punch| (hole.diameter_mm, punch)))
        .max_by(|a, b| (a.0 - a.1).abs().total_cmp(&(b.0 - b.1).abs()))
        .map(|(value, punch)| {
            LimitMargin::discrete("punches_mm", value, punch, (value - punch).abs(), PUNCH_TOLERANCE_MM, punch)
        })
}

/// The least of some values; `None` of none. A NaN wins, so that it is seen.
fn least(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.reduce(|a, b| if a.is_nan() || a < b { a } else { b })
}
