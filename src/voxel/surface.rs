//! A face of the specimen that cameras look at: digital image correlation (DIC) gives displacements of its surface.

use super::VoxelError;
use crate::field::FieldError;
use crate::specimen::{Outline, Specimen, TestKind};
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// A plane face of the block, by the direction of its outward normal. The ends x = ±length/2 are no such faces: grips
/// or the edges of the plates hide them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub enum Face {
    /// y = −thickness/2.
    #[serde(rename = "-y")]
    MinusY,
    /// y = +thickness/2.
    #[serde(rename = "+y")]
    PlusY,
    /// z = −width/2.
    #[serde(rename = "-z")]
    MinusZ,
    /// z = +width/2.
    #[serde(rename = "+z")]
    PlusZ,
}

impl Face {
    /// All of them.
    pub const ALL: [Face; 4] = [Face::MinusY, Face::PlusY, Face::MinusZ, Face::PlusZ];

    /// The face as JSON writes it.
    pub fn name(self) -> &'static str {
        match self {
            Face::MinusY => "-y",
            Face::PlusY => "+y",
            Face::MinusZ => "-z",
            Face::PlusZ => "+z",
        }
    }

    /// The axis of its normal: 1 (y) or 2 (z).
    pub fn axis(self) -> usize {
        match self {
            Face::MinusY | Face::PlusY => 1,
            Face::MinusZ | Face::PlusZ => 2,
        }
    }

    /// The sign of its outward normal along that axis.
    pub fn sign(self) -> f64 {
        match self {
            Face::MinusY | Face::MinusZ => -1.0,
            Face::PlusY | Face::PlusZ => 1.0,
        }
    }

    /// Where it lies along its axis, mm.
    pub fn position_mm(self, specimen: &Specimen) -> f64 {
        let block = &specimen.block;
        0.5 * self.sign() * block.extents_mm()[self.axis()]
    }

    /// Whether it is a plane that no plate hides: y faces of a sheared block are bonded, and the z faces of a dumb-bell
    /// are curved.
    pub fn is_free_plane(self, specimen: &Specimen) -> bool {
        match (self.axis(), specimen.test, specimen.outline) {
            (1, TestKind::DoubleLapShear, _) => false,
            (1, TestKind::Uniaxial, _) => true,
            (_, _, outline) => outline == Outline::Block,
        }
    }
}

/// Which components of the displacement of a surface are measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum MeasuredComponents {
    /// The two in the plane of the face: one camera (2D DIC).
    #[default]
    InPlane,
    /// All three: a pair of cameras that see heights, too (stereo DIC).
    All,
}

/// What cameras see of a specimen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Surface {
    /// The face: +z or -z; in a uniaxial test also +y and -y. A dumb-bell's z faces are curved and are none.
    pub face: Face,
    /// Which components of the displacement are measured: in_plane (2D DIC) or all (stereo DIC).
    #[serde(default)]
    pub components: MeasuredComponents,
}

impl Surface {
    /// Whether the displacement along x, y, z is measured.
    pub fn measured(self) -> [bool; 3] {
        let is_all = self.components == MeasuredComponents::All;
        [0, 1, 2].map(|axis| is_all || axis != self.face.axis())
    }

    /// Whether cameras can see it on `specimen`.
    ///
    /// # Errors
    /// [`VoxelError::HiddenFace`].
    pub fn check(self, specimen: &Specimen) -> Result<(), VoxelError> {
        if self.face.is_free_plane(specimen) {
            return Ok(());
        }
        let free = Face::ALL.into_iter().filter(|f| f.is_free_plane(specimen)).map(Face::name).collect();
        Err(VoxelError::HiddenFace { face: self.face.name(), free })
    }
}

impl FromStr for Surface {
    type Err = FieldError;

    /// A face, and after a comma which components are measured: `+z`, `+z,in-plane`, `+z,all`.
    fn from_str(text: &str) -> Result<Surface, FieldError> {
        let (face, components) = text.split_once(',').unwrap_or((text, "in-plane"));
        let face = Face::ALL.into_iter().find(|f| f.name() == face.trim());
        let components = match components.trim() {
            "in-plane" | "in_plane" => Some(MeasuredComponents::InPlane),
            "all" => Some(MeasuredComponents::All),
            _ => None,
        };
        match (face, components) {
            (Some(face), Some(components)) => Ok(Surface { face, components }),
            _ => Err(FieldError::new("", text, "a face (-y, +y, -z, +z), alone or with ,in-plane or ,all")),
        }
    }
}

/// Standard deviations `sd_mm` along x, y, z of what is measured, and no bound to those of components that are not: in
/// every sum of squares over variances they then have no weight.
pub fn unbounded_where_unmeasured(measured: [bool; 3], sd_mm: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|c| if measured[c] { sd_mm[c] } else { f64::INFINITY })
}

#[cfg(test)]
mod tests {
    use super::super::mask::tests::solid;
    use super::*;

    #[test]
    fn free_faces_are_planes_without_plates() {
        let free = |specimen: &Specimen| {
            Face::ALL.into_iter().filter(|f| f.is_free_plane(specimen)).map(Face::name).collect::<Vec<_>>()
        };
        assert_eq!(free(&solid()), ["-z", "+z"]);
        let bar = Specimen { test: TestKind::Uniaxial, ..solid() };
        assert_eq!(free(&bar), ["-y", "+y", "-z", "+z"]);
        let dumbbell = Specimen { outline: Outline::Iso37Type4, ..bar };
        assert_eq!(free(&dumbbell), ["-y", "+y"]);
        let hidden = Surface { face: Face::PlusZ, components: MeasuredComponents::All }.check(&dumbbell).unwrap_err();
        assert_eq!(hidden, VoxelError::HiddenFace { face: "+z", free: vec!["-y", "+y"] });
        assert!((Face::MinusY.position_mm(&solid()) + 3.2).abs() < 1e-15);
    }

    #[test]
    fn one_camera_sees_no_heights() {
        let surface: Surface = serde_json::from_str(r#"{ "face": "+z" }"#).unwrap();
        assert_eq!(surface.measured(), [true, true, false]);
        let stereo: Surface = serde_json::from_str(r#"{ "face": "-y", "components": "all" }"#).unwrap();
        assert_eq!((stereo.face, stereo.measured()), (Face::MinusY, [true; 3]));
        assert_eq!(("+z".parse(), "-y,all".parse()), (Ok(surface), Ok(stereo)));
        assert!("x".parse::<Surface>().is_err() && "+z,two".parse::<Surface>().is_err());
    }
}
