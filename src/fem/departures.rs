//! What a sample, its bonds or its loading departs from the nominal experiment in.
//!
//! The nominal experiment is one material everywhere, plates that hold every point of the bonded faces, and a drive
//! along x. Each departure here is at rest in its default; the element kernels, the factorisation and the derivatives
//! are the same with and without.

use super::law_correction::LawCorrection;
use super::rotation::turning_of;
use std::fmt;
use std::sync::Arc;

/// A scalar function of the reference position (mm).
#[derive(Clone)]
pub struct Field(Arc<dyn Fn([f64; 3]) -> f64 + Send + Sync>);

impl Field {
    /// A field from its formula.
    pub fn new(formula: impl Fn([f64; 3]) -> f64 + Send + Sync + 'static) -> Field {
        Field(Arc::new(formula))
    }

    /// Its value at a reference position, mm.
    pub fn at(&self, position: [f64; 3]) -> f64 {
        (self.0)(position)
    }
}

impl fmt::Debug for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Field")
    }
}

/// A vector function of the reference position (mm).
#[derive(Clone)]
pub struct VectorField(Arc<dyn Fn([f64; 3]) -> [f64; 3] + Send + Sync>);

impl VectorField {
    /// A field from its formula.
    pub fn new(formula: impl Fn([f64; 3]) -> [f64; 3] + Send + Sync + 'static) -> VectorField {
        VectorField(Arc::new(formula))
    }

    /// Its value at a reference position, mm.
    pub fn at(&self, position: [f64; 3]) -> [f64; 3] {
        (self.0)(position)
    }

    /// The field times a factor.
    fn scaled(&self, factor: f64) -> VectorField {
        let whole = self.clone();
        VectorField::new(move |x| whole.at(x).map(|u| factor * u))
    }
}

impl fmt::Debug for VectorField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("VectorField")
    }
}

/// Fibres of one direction: Ψ_f = k/2 (I₄ − 1)², I₄ = a·C a (standard reinforcing model).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fibre {
    /// a, a unit vector in the reference configuration.
    pub direction: [f64; 3],
    /// k, kPa.
    pub modulus_kpa: f64,
}

/// How a plate departs from its nominal motion: a rigid motion about the centre of its bonded face, a constant part and
/// one in proportion to the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlateMotion {
    /// Translation, mm.
    pub translation_mm: [f64; 3],
    /// Translation per mm of drive.
    pub translation_per_mm: [f64; 3],
    /// Rotation vector, rad.
    pub rotation_rad: [f64; 3],
    /// Rotation vector per mm of drive, rad/mm.
    pub rotation_rad_per_mm: [f64; 3],
}

impl PlateMotion {
    /// Displacement (mm) that the departure adds at `arm`, a position relative to the centre of the face.
    pub fn displacement(&self, arm: [f64; 3], drive_mm: f64) -> [f64; 3] {
        let sum = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|i| a[i] + drive_mm * b[i]);
        let t = sum(self.translation_mm, self.translation_per_mm);
        let w = sum(self.rotation_rad, self.rotation_rad_per_mm);
        let turning = turning_of(w, arm);
        [0, 1, 2].map(|i| t[i] + turning[i])
    }

    /// Both motions, translations and rotation vectors added.
    pub fn plus(&self, other: &PlateMotion) -> PlateMotion {
        let sum = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|i| a[i] + b[i]);
        PlateMotion {
            translation_mm: sum(self.translation_mm, other.translation_mm),
            translation_per_mm: sum(self.translation_per_mm, other.translation_per_mm),
            rotation_rad: sum(self.rotation_rad, other.rotation_rad),
            rotation_rad_per_mm: sum(self.rotation_rad_per_mm, other.rotation_rad_per_mm),
        }
    }

    /// What of the motion is there without any drive.
    fn before_drive(&self) -> PlateMotion {
        PlateMotion { translation_per_mm: [0.0; 3], rotation_rad_per_mm: [0.0; 3], ..*self }
    }

    /// The motion times a factor.
    pub fn scaled(&self, factor: f64) -> PlateMotion {
        let times = |v: [f64; 3]| v.map(|x| factor * x);
        PlateMotion {
            translation_mm: times(self.translation_mm),
            translation_per_mm: times(self.translation_per_mm),
            rotation_rad: times(self.rotation_rad),
            rotation_rad_per_mm: times(self.rotation_rad_per_mm),
        }
    }
}

/// All departures of one experiment.
#[derive(Clone, Debug, Default)]
pub struct Departures {
    /// Factor on the isochoric stiffness at a reference position; one where none is given. The volumetric part stays.
    pub stiffness_factor: Option<Field>,
    /// Logarithm of the volume ratio at which the sample would be free of pressure (swelling); zero where none is
    /// given.
    pub log_growth: Option<Field>,
    /// Fibres.
    pub fibre: Option<Fibre>,
    /// A correction of the material's law. The factor on the stiffness scales it, too.
    pub law: Option<LawCorrection>,
    /// The fixed plate or grip (−y or −x).
    pub fixed_plate: PlateMotion,
    /// The moved plate or grip (+y or +x).
    pub moved_plate: PlateMotion,
    /// Stiffness of the bond, kPa/mm, on faces that were released (see
    /// [`ForwardModel::with_released`](super::ForwardModel::with_released)).
    pub bond_kpa_per_mm: Option<Field>,
    /// Displacement per mm of drive that is imposed on the fixed and on the moved face beside the plates' motions, at
    /// the reference position (mm).
    pub faces_per_mm: [Option<VectorField>; 2],
}

impl Departures {
    /// Whether nothing departs.
    pub fn is_none(&self) -> bool {
        self.stiffness_factor.is_none()
            && self.log_growth.is_none()
            && self.fibre.is_none()
            && self.law.is_none()
            && !self.moves_plates()
            && self.bond_kpa_per_mm.is_none()
            && self.faces_per_mm.iter().all(Option::is_none)
    }

    /// The same with the departures of both plates times a factor.
    pub(super) fn with_plates_scaled(&self, factor: f64) -> Departures {
        Departures {
            fixed_plate: self.fixed_plate.scaled(factor),
            moved_plate: self.moved_plate.scaled(factor),
            faces_per_mm: self.faces_per_mm.clone().map(|face| face.map(|f| f.scaled(factor))),
            ..self.clone()
        }
    }

    /// The same without what grows with the drive.
    pub(super) fn before_drive(&self) -> Departures {
        Departures {
            fixed_plate: self.fixed_plate.before_drive(),
            moved_plate: self.moved_plate.before_drive(),
            faces_per_mm: [None, None],
            ..self.clone()
        }
    }

    /// Whether a plate departs from its nominal motion.
    pub fn moves_plates(&self) -> bool {
        [self.fixed_plate, self.moved_plate] != [PlateMotion::default(); 2]
            || self.faces_per_mm.iter().any(Option::is_some)
    }
}

/// A bond this stiff (kPa/mm) holds: a traction of 100 kPa slips 10⁻⁴ mm.
pub const FIRM_BOND_KPA_PER_MM: f64 = 1e6;
