//! Reading, writing and validating a specimen (`specimen/1`).

use super::json::{JsonProblem, schema_of};
use super::{Hole, HoleAxis, LigamentKind, Outline, Specimen, SpecimenError, TestKind, dumbbell};

/// The schema that this version reads and writes.
pub const SCHEMA: &str = "specimen/1";
/// Smallest extent of a block, mm.
pub const MIN_SIZE_MM: f64 = 0.2;
/// Largest extent of a block, mm.
pub const MAX_SIZE_MM: f64 = 1000.0;
/// Smallest diameter of a hole, mm.
pub const MIN_DIAMETER_MM: f64 = 0.1;
/// Largest diameter of a hole, mm.
pub const MAX_DIAMETER_MM: f64 = MAX_SIZE_MM;
/// Most holes.
pub const MAX_HOLES: usize = 64;
/// Most drives.
pub const MAX_DRIVES: usize = 1000;
/// Most samples that share a load cell.
pub const MAX_SAMPLES_IN_PARALLEL: u32 = 64;
/// Longest name, characters.
pub const MAX_NAME_LENGTH: usize = 200;
/// Largest supported shear strain, drive / thickness.
pub const MAX_SHEAR_STRAIN: f64 = 1.5;
/// Largest supported nominal stretch in a uniaxial test.
pub const MAX_NOMINAL_STRETCH: f64 = 3.0;
/// Rounding that a drive at the very limit may have, relative.
const LIMIT_SLACK: f64 = 1e-9;
/// How far a dumb-bell's block may be off the standard, mm: rounding only.
const STANDARD_TOLERANCE_MM: f64 = 1e-6;

/// Thinnest ligament that can be meshed beside a hole (the larger one of two), mm: 0.05 mm and 2 % of the diameter.
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

    /// The specimen as `specimen/1`, indented, with a line break at the end. Reading it back gives each number to within one unit in its
    /// last place (serde_json's default parser rounds so).
    pub fn to_json(&self) -> String {
        // Serialising fails only for maps with keys that are not strings and for failing writers: neither is here.
        let mut text = serde_json::to_string_pretty(self).expect("a struct of strings and numbers serialises");
        text.push('\n');
        text
    }

    /// Checks everything that the types do not. The first problem found is returned, in this order: schema,
    /// name, block, outline, holes, ligaments, drives, samples.
    ///
    /// # Errors
    /// [`SpecimenError`] with the value, the limit and what to change.
    pub fn validate(&self) -> Result<(), SpecimenError> {
        if self.schema != SCHEMA {
            return Err(SpecimenError::WrongSchema { found: self.schema.clone(), expected: SCHEMA });
        }
        let length = self.name.chars().count();
        let has_control = self.name.chars().any(char::is_control);
        if length > MAX_NAME_LENGTH || has_control {
            return Err(SpecimenError::BadName { length, has_control, limit: MAX_NAME_LENGTH });
        }
        for (field, value_mm) in [
            ("block.length_mm", self.block.length_mm),
            ("block.thickness_mm", self.block.thickness_mm),
            ("block.width_mm", self.block.width_mm),
        ] {
            check_size(field, value_mm, MIN_SIZE_MM, MAX_SIZE_MM)?;
        }
        self.validate_outline()?;
        self.validate_holes()?;
        self.validate_drives()?;
        if self.samples_in_parallel == 0 || self.samples_in_parallel > MAX_SAMPLES_IN_PARALLEL {
            let (value, limit) = (self.samples_in_parallel, MAX_SAMPLES_IN_PARALLEL);
            return Err(SpecimenError::SamplesOutOfRange { value, limit });
        }
        Ok(())
    }

    fn validate_outline(&self) -> Result<(), SpecimenError> {
        if self.outline == Outline::Block {
            return Ok(());
        }
        if self.test == TestKind::DoubleLapShear {
            return Err(SpecimenError::DumbbellInShear);
        }
        for (field, value_mm, standard_mm) in [
            ("block.length_mm", self.block.length_mm, dumbbell::LENGTH_MM),
            ("block.thickness_mm", self.block.thickness_mm, dumbbell::THICKNESS_MM),
            ("block.width_mm", self.block.width_mm, dumbbell::END_WIDTH_MM),
        ] {
            if (value_mm - standard_mm).abs() > STANDARD_TOLERANCE_MM {
                return Err(SpecimenError::NotTheStandardsBlock { field, value_mm, standard_mm });
            }
        }
        match self.holes.iter().position(|hole| hole.axis == HoleAxis::Width) {
            Some(hole) => Err(SpecimenError::DumbbellHoleAlongWidth { hole }),
            None => Ok(()),
        }
    }

    fn validate_holes(&self) -> Result<(), SpecimenError> {
        if self.holes.len() > MAX_HOLES {
            return Err(SpecimenError::TooManyHoles { count: self.holes.len(), limit: MAX_HOLES });
        }
        for (i, hole) in self.holes.iter().enumerate() {
            check_size(&format!("holes[{i}].diameter_mm"), hole.diameter_mm, MIN_DIAMETER_MM, MAX_DIAMETER_MM)?;
            for (k, value) in hole.center_mm.into_iter().enumerate() {
                if !value.is_finite() {
                    return Err(SpecimenError::NotFinite { field: format!("holes[{i}].center_mm[{k}]"), value });
                }
            }
            let expected = self.holes[0].axis;
            if hole.axis != expected {
                return Err(SpecimenError::MixedHoleAxes { hole: i, axis: hole.axis, expected });
            }
        }
        let diameter_of = |i: usize| self.holes.get(i).map_or(0.0, |hole: &Hole| hole.diameter_mm);
        for ligament in self.ligaments() {
            let (between, length_mm) = (ligament.kind, ligament.length_mm);
            match between {
                LigamentKind::HoleEdge(i, _) => {
                    let limit_mm = min_meshable_ligament_mm(diameter_of(i));
                    if length_mm <= 0.0 {
                        return Err(SpecimenError::HoleOutside { between, excess_mm: -length_mm, limit_mm });
                    }
                    check_ligament(between, length_mm, limit_mm)?;
                }
                LigamentKind::HoleHole(i, j) => {
                    let limit_mm = min_meshable_ligament_mm(diameter_of(i).max(diameter_of(j)));
                    if length_mm <= 0.0 {
                        return Err(SpecimenError::HolesOverlap { between, overlap_mm: -length_mm, limit_mm });
                    }
                    check_ligament(between, length_mm, limit_mm)?;
                }
            }
        }
        Ok(())
    }

    fn validate_drives(&self) -> Result<(), SpecimenError> {
        if self.drive_mm.is_empty() {
            return Err(SpecimenError::NoDrives { limit: MAX_DRIVES });
        }
        if self.drive_mm.len() > MAX_DRIVES {
            return Err(SpecimenError::TooManyDrives { count: self.drive_mm.len(), limit: MAX_DRIVES });
        }
        let limit_mm = self.max_supported_drive_mm();
        let mut previous_mm = 0.0;
        for (index, &value_mm) in self.drive_mm.iter().enumerate() {
            if !value_mm.is_finite() {
                return Err(SpecimenError::NotFinite { field: format!("drive_mm[{index}]"), value: value_mm });
            }
            if value_mm <= 0.0 {
                return Err(SpecimenError::DriveNotPositive { index, value_mm });
            }
            if value_mm <= previous_mm {
                return Err(SpecimenError::DrivesNotIncreasing { index, value_mm, previous_mm });
            }
            if value_mm > limit_mm * (1.0 + LIMIT_SLACK) {
                let (measure, limit, dimension) = match self.test {
                    TestKind::DoubleLapShear => ("shear strain", MAX_SHEAR_STRAIN, "thicker"),
                    TestKind::Uniaxial => ("stretch", MAX_NOMINAL_STRETCH, "longer"),
                };
                let deformation = self.nominal_deformation(value_mm);
                return Err(SpecimenError::DriveTooLarge {
                    index,
                    value_mm,
                    measure,
                    deformation,
                    limit,
                    limit_mm,
                    dimension,
                });
            }
            previous_mm = value_mm;
        }
        Ok(())
    }
}

fn check_size(field: &str, value_mm: f64, min_mm: f64, max_mm: f64) -> Result<(), SpecimenError> {
    let field = field.to_string();
    if !value_mm.is_finite() {
        return Err(SpecimenError::NotFinite { field, value: value_mm });
    }
    if value_mm < min_mm || value_mm > max_mm {
        return Err(SpecimenError::SizeOutOfRange { field, value_mm, min_mm, max_mm });
    }
    Ok(())
}

fn check_ligament(between: LigamentKind, length_mm: f64, limit_mm: f64) -> Result<(), SpecimenError> {
    if length_mm < limit_mm {
        return Err(SpecimenError::LigamentTooThin { between, length_mm, limit_mm });
    }
    Ok(())
}
