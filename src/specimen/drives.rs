//! What drives a specimen may have: in which order, and how far.

use super::read_error::SpecimenError;
use super::{Specimen, TestKind};
use crate::field::FieldPath;

/// Most drives.
pub const MAX_DRIVES: usize = 1000;
/// Largest angle of a drive from x towards z either way, degrees. Negative drives go to the other half of the plane.
pub const MAX_DRIVE_ANGLE_DEG: f64 = 90.0;
/// Largest supported shear strain, drive / thickness, either way.
pub const MAX_SHEAR_STRAIN: f64 = 1.5;
/// Largest supported nominal stretch in a uniaxial test.
pub const MAX_NOMINAL_STRETCH: f64 = 3.0;
/// Smallest supported nominal stretch in a uniaxial test. Flat discs with bonded ends keep an equilibrium as far as
/// that; bars that are longer than wide have buckled before it, or their sides have met the grips.
pub const MIN_NOMINAL_STRETCH: f64 = 0.5;
/// Most that the plates of a double-lap test may be pressed together or pulled apart before they are driven, as a part
/// of the thinnest sample's thickness. Bonded blocks of rubber bulge out over the plates' edges beyond it.
pub const MAX_PRECOMPRESSION: f64 = 0.25;
/// Unit vector along which precompression brings the moved plate nearer to the fixed one.
pub const PRECOMPRESSION_DIRECTION: [f64; 3] = [0.0, -1.0, 0.0];
/// Rounding that a drive at the very limit may have, relative.
const LIMIT_SLACK: f64 = 1e-9;

/// A drive that leads on from another one, both in mm: away from rest, in the same direction. Every drive but zero does
/// from rest.
pub fn leads_on(from_mm: f64, drive_mm: f64) -> bool {
    drive_mm.abs() > from_mm.abs() && drive_mm * from_mm >= 0.0
}

/// The value of largest magnitude, with its sign: of drives, or of the forces that they take. Zero of none.
pub fn farthest_from_zero(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |a, b| if b.abs() > a.abs() { b } else { a })
}

/// What a force across the plates (N, along +y on the moved one) does to them, in words.
pub fn way_across_plates(force_n: f64) -> &'static str {
    if force_n < 0.0 { "pushes them apart" } else { "pulls them together" }
}

impl Specimen {
    /// Its largest drive by magnitude, with its sign, mm; zero without drives.
    pub fn largest_drive_mm(&self) -> f64 {
        farthest_from_zero(self.drive_mm.iter().copied())
    }

    /// The same specimen at other drives, mm.
    pub fn at_drives(&self, drives_mm: &[f64]) -> Specimen {
        Specimen { drive_mm: drives_mm.to_vec(), ..self.clone() }
    }

    /// Unit vector along which the moved plate or grip goes for a positive drive.
    pub fn drive_direction(&self) -> [f64; 3] {
        // Along an axis exactly: the cosine of a right angle in radians is none of zero.
        if self.drive_angle_deg.abs() >= MAX_DRIVE_ANGLE_DEG {
            return [0.0, 0.0, self.drive_angle_deg.signum()];
        }
        let (sin, cos) = self.drive_angle_deg.to_radians().sin_cos();
        [cos, 0.0, sin]
    }

    /// Whether plates hold it, across which there is a force; else grips do.
    pub fn has_plates(&self) -> bool {
        self.test == TestKind::DoubleLapShear
    }

    /// Whether its plates are pressed together, or pulled apart, before they are driven.
    pub fn is_precompressed(&self) -> bool {
        self.precompression_mm.abs() > 0.0
    }

    /// What is done to its plates before they are driven, in words, and how far, mm; `None` where nothing is.
    pub fn plates_before_drive(&self) -> Option<(&'static str, f64)> {
        let way = if self.precompression_mm > 0.0 { "pressed together" } else { "pulled apart" };
        self.is_precompressed().then(|| (way, self.precompression_mm.abs()))
    }

    /// Displacement (mm) of the moved plate before it is driven: it stays on.
    pub fn displacement_before_drive_mm(&self) -> [f64; 3] {
        PRECOMPRESSION_DIRECTION.map(|component| component * self.precompression_mm)
    }

    /// Whether the moved plate or grip goes along x.
    pub fn is_driven_along_x(&self) -> bool {
        !(self.drive_angle_deg.abs() > 0.0)
    }

    /// Whether its grips approach each other. It may then buckle: bend to a side although nothing pushes it there.
    pub fn is_compressed(&self) -> bool {
        self.test == TestKind::Uniaxial && self.largest_drive_mm() < 0.0
    }

    /// Elongation or slip at which the test reaches a nominal deformation, as a fraction of `drive_mm`: shear strain
    /// drive/thickness (of the thinnest sample), or stretch 1 + drive/length. For a dumb-bell the length is the one
    /// over which the gauge's strain would give the whole elongation
    /// ([`super::dumbbell::Profile::effective_length_mm`]).
    pub fn nominal_deformation(&self, drive_mm: f64) -> f64 {
        match self.test {
            TestKind::DoubleLapShear => drive_mm / self.thinnest_mm(),
            TestKind::Uniaxial => 1.0 + drive_mm / self.nominal_length_mm(),
        }
    }

    /// The farthest drive that is supported in the direction of the specimen's own drives, mm: a shear strain of 1.5
    /// either way, a nominal stretch of 3 or, in compression, of 0.5.
    pub fn drive_limit_mm(&self) -> f64 {
        self.limit_towards_mm(self.largest_drive_mm())
    }

    /// Whether a drive (mm) goes in the direction of the specimen's own drives, and no further than is supported.
    pub fn supports_drive(&self, drive_mm: f64) -> bool {
        let limit_mm = self.drive_limit_mm();
        drive_mm * limit_mm > 0.0 && drive_mm.abs() <= limit_mm.abs()
    }

    /// Whether a drive (mm) goes the other way than the specimen's own drives.
    pub fn is_other_way(&self, drive_mm: f64) -> bool {
        drive_mm * self.largest_drive_mm() < 0.0
    }

    /// The farthest drive in the direction of a drive, mm.
    fn limit_towards_mm(&self, drive_mm: f64) -> f64 {
        let is_negative = drive_mm < 0.0;
        match self.test {
            TestKind::DoubleLapShear => {
                let limit = MAX_SHEAR_STRAIN * self.thinnest_mm();
                if is_negative { -limit } else { limit }
            }
            TestKind::Uniaxial => {
                let stretch = if is_negative { MIN_NOMINAL_STRETCH } else { MAX_NOMINAL_STRETCH };
                (stretch - 1.0) * self.nominal_length_mm()
            }
        }
    }

    fn nominal_length_mm(&self) -> f64 {
        self.profile().map_or(self.block.length_mm, |profile| profile.effective_length_mm())
    }

    pub(super) fn check_drives(&self, problems: &mut Vec<SpecimenError>) {
        if self.drive_mm.is_empty() {
            problems.push(SpecimenError::NoDrives { limit: MAX_DRIVES });
        }
        if self.drive_mm.len() > MAX_DRIVES {
            problems.push(SpecimenError::TooManyDrives { count: self.drive_mm.len(), limit: MAX_DRIVES });
            return;
        }
        let mut previous_mm = 0.0;
        for (index, &value_mm) in self.drive_mm.iter().enumerate() {
            problems.extend(self.check_drive(index, value_mm, previous_mm));
            previous_mm = value_mm;
        }
        problems.extend(self.check_precompression());
        let value_deg = self.drive_angle_deg;
        let field = || FieldPath::of("drive_angle_deg");
        if !value_deg.is_finite() {
            problems.push(SpecimenError::NotFinite { field: field(), value: value_deg });
        } else if value_deg.abs() > MAX_DRIVE_ANGLE_DEG {
            let limit_deg = MAX_DRIVE_ANGLE_DEG;
            problems.push(SpecimenError::AngleOutOfRange { field: field(), value_deg, limit_deg });
        } else if self.test == TestKind::Uniaxial && !self.is_driven_along_x() {
            problems.push(SpecimenError::AngleOfPull { value_deg });
        }
        if self.outline.dumbbell().is_some() && self.is_compressed() {
            problems.push(SpecimenError::DumbbellCompressed { drive_mm: self.largest_drive_mm() });
        }
    }

    fn check_precompression(&self) -> Option<SpecimenError> {
        let value_mm = self.precompression_mm;
        let limit_mm = MAX_PRECOMPRESSION * self.thinnest_mm();
        if !value_mm.is_finite() {
            Some(SpecimenError::NotFinite { field: FieldPath::of("precompression_mm"), value: value_mm })
        } else if self.test == TestKind::Uniaxial && self.is_precompressed() {
            Some(SpecimenError::PrecompressionOfPull { value_mm })
        } else if value_mm.abs() > limit_mm * (1.0 + LIMIT_SLACK) {
            Some(SpecimenError::PrecompressionTooLarge { value_mm, limit_mm, part: MAX_PRECOMPRESSION })
        } else {
            None
        }
    }

    fn check_drive(&self, index: usize, value_mm: f64, previous_mm: f64) -> Option<SpecimenError> {
        if !value_mm.is_finite() {
            let field = FieldPath::of("drive_mm").index(index);
            return Some(SpecimenError::NotFinite { field, value: value_mm });
        }
        if !(value_mm.abs() > 0.0) {
            return Some(SpecimenError::DriveZero { index });
        }
        if !leads_on(previous_mm, value_mm) {
            return Some(SpecimenError::DrivesNotLeadingOn { index, value_mm, previous_mm });
        }
        let limit_mm = self.limit_towards_mm(value_mm);
        if value_mm.abs() <= limit_mm.abs() * (1.0 + LIMIT_SLACK) {
            return None;
        }
        let (measure, limit, dimension) = match self.test {
            TestKind::DoubleLapShear => ("shear strain", MAX_SHEAR_STRAIN * value_mm.signum(), "thicker"),
            TestKind::Uniaxial if value_mm < 0.0 => ("stretch", MIN_NOMINAL_STRETCH, "longer"),
            TestKind::Uniaxial => ("stretch", MAX_NOMINAL_STRETCH, "longer"),
        };
        let deformation = self.nominal_deformation(value_mm);
        Some(SpecimenError::DriveTooLarge { index, value_mm, measure, deformation, limit, limit_mm, dimension })
    }
}
