//! Reading, writing and validating a specimen (`specimen/1`).

use super::bounds::{
    MAX_DIAMETER_MM, MAX_HOLES, MAX_NAME_LENGTH, MAX_OTHER_SAMPLES, MAX_SAMPLES_IN_PARALLEL, MAX_SIZE_MM,
    MIN_DIAMETER_MM, MIN_FILLET_MM, MIN_SIZE_MM, SCHEMA,
};
use super::dumbbell::{DumbbellDimension, ISO37_LENGTH_MM, ISO37_THICKNESS_MM, ISO37_WIDTH_MM};
use super::json::{JsonProblem, schema_of};
use super::{
    Block, Dumbbell, Hole, HoleAxis, HoleShape, Ligament, LigamentKind, MAX_HOLE_ANGLE_DEG, MAX_HOLE_ASPECT, Outline,
    Specimen, SpecimenError, TestKind,
};
use crate::field::{FieldError, FieldPath};

/// How far a dumb-bell's block may be off the standard, mm: rounding only.
const STANDARD_TOLERANCE_MM: f64 = 1e-6;

/// A wedge at its limit is not refused for rounding.
const ROUNDING: f64 = 1e-12;

/// Thinnest ligament that can be meshed beside a hole (the larger one of two), mm: 0.05 mm and 2 % of the diameter (of
/// an ellipse or a slot the extent across it).
pub fn min_meshable_ligament_mm(diameter_mm: f64) -> f64 {
    (0.02 * diameter_mm).max(0.05)
}

impl Specimen {
    /// Reads and validates `specimen/1`.
    ///
    /// ```
    /// use lambdak::specimen::Specimen;
    /// let text = r#"{ "schema": "specimen/1", "name": "solid", "test": "double_lap_shear",
    ///     "block": { "length_mm": 25.4, "thickness_mm": 6.4, "width_mm": 19.1 }, "drive_mm": [5.0] }"#;
    /// let specimen = Specimen::from_json(text)?;
    /// assert_eq!(specimen.samples_in_parallel, 1);
    /// # Ok::<(), lambdak::specimen::SpecimenError>(())
    /// ```
    ///
    /// # Errors
    /// [`SpecimenError`]: the text does not fit the schema, or the specimen is not valid.
    pub fn from_json(text: &str) -> Result<Specimen, SpecimenError> {
        let specimen: Specimen = serde_json::from_str(text).map_err(|error| match schema_of(text) {
            Some(found) if found != SCHEMA => SpecimenError::WrongSchema { found, expected: SCHEMA },
            _ => SpecimenError::Json(JsonProblem::new(text, &error)),
        })?;
        specimen.validate()?;
        Ok(specimen)
    }

    /// The specimen as `specimen/1`, indented, with a line break at the end. Reading it back gives the same numbers.
    pub fn to_json(&self) -> String {
        // Serialising fails only for maps with keys that are not strings and for failing writers: neither is here.
        let mut text = serde_json::to_string_pretty(self).expect("a struct of strings and numbers serialises");
        text.push('\n');
        text
    }

    /// Checks everything that the types do not. The first problem found is returned, in this order: name, block,
    /// outline, holes, ligaments, drives, samples, the same of other samples.
    ///
    /// # Errors
    /// [`SpecimenError`] with the value, the limit and what to change.
    pub fn validate(&self) -> Result<(), SpecimenError> {
        self.problems().into_iter().next().map_or(Ok(()), Err)
    }

    /// Every rule that the specimen violates, with pointers into it; the order is that of [`Specimen::validate`].
    pub fn field_errors(&self) -> Vec<FieldError> {
        self.problems().iter().map(SpecimenError::field_error).collect()
    }

    fn problems(&self) -> Vec<SpecimenError> {
        let mut problems = Vec::new();
        let length = self.name.chars().count();
        let has_control = self.name.chars().any(char::is_control);
        if length > MAX_NAME_LENGTH || has_control {
            problems.push(SpecimenError::BadName { length, has_control, limit: MAX_NAME_LENGTH });
        }
        self.check_shape(&mut problems);
        self.check_drives(&mut problems);
        if self.samples_in_parallel == 0 || self.samples_in_parallel > MAX_SAMPLES_IN_PARALLEL {
            let (value, limit) = (self.samples_in_parallel, MAX_SAMPLES_IN_PARALLEL);
            problems.push(SpecimenError::SamplesOutOfRange { value, limit });
        }
        self.check_other_samples(&mut problems);
        problems
    }

    /// Block, outline, holes and ligaments.
    fn check_shape(&self, problems: &mut Vec<SpecimenError>) {
        let num_before = problems.len();
        for (name, value_mm) in self.extents() {
            let field = || FieldPath::of("block").name(name);
            problems.extend(check_size(field, value_mm, MIN_SIZE_MM, MAX_SIZE_MM));
        }
        self.check_outline(problems);
        self.check_holes(problems);
        self.check_wedge(problems.len() == num_before, problems);
        // Ligaments mean something only where the holes and the block do.
        if problems.len() == num_before {
            problems.extend(self.thin_ligaments());
        }
    }

    fn check_other_samples(&self, problems: &mut Vec<SpecimenError>) {
        let count = self.other_samples.len();
        if count > MAX_OTHER_SAMPLES {
            problems.push(SpecimenError::TooManyOtherSamples { count, limit: MAX_OTHER_SAMPLES });
            return;
        }
        if count > 0 && self.test == TestKind::Uniaxial {
            problems.push(SpecimenError::OtherSamplesInTension { count });
        }
        for (index, sample) in self.other_samples.iter().enumerate() {
            let mut own = Vec::new();
            self.as_sample(sample).check_shape(&mut own);
            problems.extend(own.into_iter().map(|e| SpecimenError::OtherSample { index, error: Box::new(e) }));
        }
    }

    /// Extents of the block by name, mm.
    fn extents(&self) -> [(&'static str, f64); 3] {
        let Block { length_mm, thickness_mm, width_mm, .. } = self.block;
        [("length_mm", length_mm), ("thickness_mm", thickness_mm), ("width_mm", width_mm)]
    }

    /// Whether the block may be a wedge, and this one; `is_sound`: whether nothing else is wrong with block and holes,
    /// so that a limit means something.
    fn check_wedge(&self, is_sound: bool, problems: &mut Vec<SpecimenError>) {
        let value_mm = self.block.wedge_mm;
        let field = || FieldPath::of("block").name("wedge_mm");
        if !value_mm.is_finite() {
            problems.push(SpecimenError::NotFinite { field: field(), value: value_mm });
            return;
        }
        if self.block.taper().is_even() {
            return;
        }
        if self.test == TestKind::Uniaxial {
            problems.push(SpecimenError::WedgeOfPull { value_mm });
        } else if let Some(hole) = self.holes.iter().position(|hole| hole.axis == HoleAxis::Width) {
            problems.push(SpecimenError::WedgeHoleAlongWidth { hole, value_mm });
        } else if is_sound {
            let limit_mm = self.block.wedge_limit_mm(MIN_SIZE_MM).max(0.0);
            if value_mm.abs() > limit_mm * (1.0 + ROUNDING) {
                problems.push(SpecimenError::WedgeTooLarge { value_mm, limit_mm });
            }
        }
    }

    fn check_outline(&self, problems: &mut Vec<SpecimenError>) {
        match &self.outline {
            Outline::Block => return,
            Outline::Iso37Type4 => {
                let standards_mm = [ISO37_LENGTH_MM, ISO37_THICKNESS_MM, ISO37_WIDTH_MM];
                for ((name, value_mm), standard_mm) in self.extents().into_iter().zip(standards_mm) {
                    if (value_mm - standard_mm).abs() > STANDARD_TOLERANCE_MM {
                        let field = FieldPath::of("block").name(name);
                        problems.push(SpecimenError::NotTheStandardsBlock { field, value_mm, standard_mm });
                    }
                }
            }
            Outline::Dumbbell(dumbbell) => self.check_dumbbell(dumbbell, problems),
        }
        if self.test == TestKind::DoubleLapShear {
            problems.push(SpecimenError::DumbbellInShear { outline: self.outline.name() });
        }
        if let Some(hole) = self.holes.iter().position(|hole| hole.axis == HoleAxis::Width) {
            problems.push(SpecimenError::DumbbellHoleAlongWidth { hole });
        }
    }

    /// Each dimension on its own, and whether they go together and with the block.
    fn check_dumbbell(&self, dumbbell: &Dumbbell, problems: &mut Vec<SpecimenError>) {
        use DumbbellDimension as D;
        let num_before = problems.len();
        for (dimension, value_mm, min_mm) in [
            (D::GaugeWidth, dumbbell.gauge_width_mm, MIN_SIZE_MM),
            (D::GaugeLength, dumbbell.gauge_length_mm, MIN_SIZE_MM),
            (D::FilletRadius, dumbbell.fillet_radius_mm, MIN_FILLET_MM),
        ] {
            problems.extend(check_size(|| path_of(dimension), value_mm, min_mm, MAX_SIZE_MM));
        }
        let has_block = self.extents().iter().all(|(_, extent_mm)| extent_mm.is_finite() && *extent_mm > 0.0);
        // How they go together means something only where each of them does.
        if problems.len() == num_before && has_block {
            problems.extend(dumbbell.misfits([self.block.length_mm, self.block.width_mm]).into_iter().map(|misfit| {
                let field = path_of(misfit.dimension);
                let max_mm = misfit.max_mm.min(MAX_SIZE_MM);
                SpecimenError::DumbbellMisfit { field, value_mm: misfit.value_mm, min_mm: misfit.min_mm, max_mm }
            }));
        }
    }

    fn check_holes(&self, problems: &mut Vec<SpecimenError>) {
        if self.holes.len() > MAX_HOLES {
            // One error for all of them: each hole beyond could be wrong in its own way.
            problems.push(SpecimenError::TooManyHoles { count: self.holes.len(), limit: MAX_HOLES });
            return;
        }
        for (i, hole) in self.holes.iter().enumerate() {
            let of_hole = || FieldPath::of("holes").index(i);
            let diameter = || of_hole().name("diameter_mm");
            problems.extend(check_size(diameter, hole.diameter_mm, MIN_DIAMETER_MM, MAX_DIAMETER_MM));
            problems.extend(hole.shape.into_iter().flat_map(|shape| check_hole_shape(of_hole, hole, shape)));
            for (k, value) in hole.center_mm.into_iter().enumerate() {
                if !value.is_finite() {
                    let field = of_hole().name("center_mm").index(k);
                    problems.push(SpecimenError::NotFinite { field, value });
                }
            }
            if hole.diameter_mm > 0.0
                && let Some(problem) = self.notch_problem(hole)
            {
                problems.push(SpecimenError::BadNotch { hole: i, problem });
            }
            let expected = self.holes[0].axis;
            if hole.axis != expected {
                problems.push(SpecimenError::MixedHoleAxes { hole: i, axis: hole.axis, expected });
            }
        }
    }

    /// Ligaments that cannot be meshed, overlaps and holes that reach outside.
    fn thin_ligaments(&self) -> Vec<SpecimenError> {
        let diameter_of = |i: usize| self.holes.get(i).map_or(0.0, |hole: &Hole| hole.diameter_mm);
        let check = |ligament: Ligament| {
            let (between, length_mm) = (ligament.kind, ligament.length_mm);
            let limit_mm = min_meshable_ligament_mm(match between {
                LigamentKind::HoleEdge(i, _) => diameter_of(i),
                LigamentKind::HoleHole(i, j) => diameter_of(i).max(diameter_of(j)),
            });
            if length_mm <= 0.0 {
                return Some(match between {
                    LigamentKind::HoleEdge(..) => {
                        SpecimenError::HoleOutside { between, excess_mm: -length_mm, limit_mm }
                    }
                    LigamentKind::HoleHole(..) => {
                        SpecimenError::HolesOverlap { between, overlap_mm: -length_mm, limit_mm }
                    }
                });
            }
            (length_mm < limit_mm).then_some(SpecimenError::LigamentTooThin { between, length_mm, limit_mm })
        };
        self.ligaments().into_iter().filter_map(check).collect()
    }
}

/// Where a dimension of a dumb-bell stands in a specimen.
fn path_of(dimension: DumbbellDimension) -> FieldPath {
    match dimension {
        DumbbellDimension::GaugeWidth | DumbbellDimension::GaugeLength | DumbbellDimension::FilletRadius => {
            FieldPath::of("outline").name("dumbbell").name(dimension.name())
        }
        DumbbellDimension::Width | DumbbellDimension::Length => FieldPath::of("block").name(dimension.name()),
    }
}

/// An outline that is not a circle is at least as long as wide, and not too long.
fn check_hole_shape(field: impl Fn() -> FieldPath, hole: &Hole, shape: HoleShape) -> Vec<SpecimenError> {
    let length = || field().name("shape").name("length_mm");
    let (min_mm, max_mm) = (hole.diameter_mm, MAX_HOLE_ASPECT * hole.diameter_mm);
    let mut problems: Vec<SpecimenError> = check_size(length, shape.length_mm, min_mm, max_mm).into_iter().collect();
    let (value, limit) = (shape.angle_deg, MAX_HOLE_ANGLE_DEG);
    if !value.is_finite() {
        problems.push(SpecimenError::NotFinite { field: field().name("shape").name("angle_deg"), value });
    } else if value.abs() > limit {
        let field = field().name("shape").name("angle_deg");
        problems.push(SpecimenError::AngleOutOfRange { field, value_deg: value, limit_deg: limit });
    }
    problems
}

fn check_size(field: impl Fn() -> FieldPath, value_mm: f64, min_mm: f64, max_mm: f64) -> Option<SpecimenError> {
    if !value_mm.is_finite() {
        return Some(SpecimenError::NotFinite { field: field(), value: value_mm });
    }
    let is_outside = value_mm < min_mm || value_mm > max_mm;
    is_outside.then(|| SpecimenError::SizeOutOfRange { field: field(), value_mm, min_mm, max_mm })
}
