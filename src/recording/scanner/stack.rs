//! Slices as a volume: the affine of a stack.
//!
//! Scanners give positions in the patient's frame, millimetres: x to the left, y to the back, z to the head (LPS, in
//! DICOM and in ParaVision). Volumes are kept as NIfTI has them: x to the right, y to the front (RAS).

use super::error::StackFault;

/// Directions are unit vectors at right angles to this.
const UNIT_TOLERANCE: f64 = 1e-3;
/// Distances of slices are equal to this part.
const DISTANCE_TOLERANCE: f64 = 0.02;
/// Slices may be shifted in their plane by this part of a pixel.
const SHIFT_TOLERANCE: f64 = 0.1;

/// Directions and spacings of the images of a stack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plane {
    /// Unit vectors along the first index (columns) and the second one (rows), LPS.
    pub(super) along: [[f64; 3]; 2],
    /// Spacing along the first and the second index, mm.
    pub(super) spacing_mm: [f64; 2],
    /// Thickness of a slice, mm: the distance where there is one slice alone.
    pub(super) thickness_mm: Option<f64>,
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Plane {
    /// The normal, right-handed with the two directions.
    pub(super) fn normal(&self) -> [f64; 3] {
        let [u, v] = self.along;
        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    }

    /// Whether directions and spacings make sense.
    pub(super) fn check(&self) -> Result<(), StackFault> {
        let [u, v] = self.along;
        let is_unit = |a: [f64; 3]| (dot(a, a) - 1.0).abs() <= UNIT_TOLERANCE;
        if !(is_unit(u) && is_unit(v) && dot(u, v).abs() <= UNIT_TOLERANCE) {
            let found = self.along.concat();
            let requirement = "two unit vectors at right angles";
            return Err(StackFault::Number { what: "the image orientation", found, requirement });
        }
        if !self.spacing_mm.iter().all(|s| *s > 0.0 && s.is_finite()) {
            let found = self.spacing_mm.to_vec();
            return Err(StackFault::Number { what: "the pixel spacing", found, requirement: "above 0 mm" });
        }
        Ok(())
    }

    /// The affine (RAS, mm) of slices at `positions` (LPS, mm, centres of the first pixel), which are sorted along the
    /// normal.
    pub(super) fn affine(&self, positions: &[[f64; 3]]) -> Result<[[f64; 4]; 3], StackFault> {
        self.check()?;
        let normal = self.normal();
        let (first, last) = match (positions.first(), positions.last()) {
            (Some(first), Some(last)) if positions.iter().flatten().all(|x| x.is_finite()) => (*first, *last),
            _ => {
                let found = positions.concat().into_iter().take(3).collect();
                return Err(StackFault::Number { what: "the image position", found, requirement: "finite" });
            }
        };
        let between = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|c| b[c] - a[c]);
        let distance = match positions.len() {
            1 => self.thickness_mm.filter(|t| *t > 0.0 && t.is_finite()).ok_or_else(|| StackFault::Number {
                what: "the slice thickness",
                found: self.thickness_mm.into_iter().collect(),
                requirement: "above 0 mm where there is one slice alone",
            })?,
            n => dot(between(first, last), normal) / (n - 1) as f64,
        };
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for pair in positions.windows(2) {
            let step = dot(between(pair[0], pair[1]), normal);
            range = [range[0].min(step), range[1].max(step)];
        }
        if positions.len() > 1 && !(distance > 0.0 && range[1] - range[0] <= DISTANCE_TOLERANCE * distance) {
            return Err(StackFault::Distances { least_mm: range[0], most_mm: range[1] });
        }
        let shift = |position: &[f64; 3]| {
            let d = between(first, *position);
            self.along.map(|a| dot(d, a).abs()).into_iter().fold(0.0, f64::max)
        };
        let shift_mm = positions.iter().map(shift).fold(0.0, f64::max);
        if !(shift_mm <= SHIFT_TOLERANCE * self.spacing_mm[0].min(self.spacing_mm[1])) {
            return Err(StackFault::Shifted { shift_mm });
        }
        let [u, v] = self.along;
        let row = |c: usize| [u[c] * self.spacing_mm[0], v[c] * self.spacing_mm[1], normal[c] * distance, first[c]];
        Ok([row(0).map(|x| -x), row(1).map(|x| -x), row(2)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane() -> Plane {
        Plane { along: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], spacing_mm: [0.5, 0.25], thickness_mm: Some(2.0) }
    }

    /// An axial stack whose pixels run to the patient's left and back: against the axes of RAS.
    #[test]
    fn left_and_back_are_turned_and_up_stays() {
        let affine = plane().affine(&[[3.0, 4.0, 5.0], [3.0, 4.0, 6.5]]).unwrap();
        assert_eq!(affine, [[-0.5, 0.0, 0.0, -3.0], [0.0, -0.25, 0.0, -4.0], [0.0, 0.0, 1.5, 5.0]]);
        let one = plane().affine(&[[3.0, 4.0, 5.0]]).unwrap();
        assert_eq!(one[2], [0.0, 0.0, 2.0, 5.0]);
    }

    #[test]
    fn stacks_that_are_none_are_typed_errors() {
        let z = |list: &[f64]| plane().affine(&list.iter().map(|z| [0.0, 0.0, *z]).collect::<Vec<_>>());
        assert!(matches!(z(&[0.0, 1.0, 3.0]), Err(StackFault::Distances { .. })));
        assert!(matches!(z(&[0.0, 0.0]), Err(StackFault::Distances { .. })));
        assert!(matches!(z(&[f64::NAN, 0.0]), Err(StackFault::Number { .. })));
        let sheared = plane().affine(&[[0.0; 3], [0.3, 0.0, 1.0]]);
        assert!(matches!(sheared, Err(StackFault::Shifted { .. })));
        for poor in [
            Plane { along: [[1.0, 0.0, 0.0], [0.1, 1.0, 0.0]], ..plane() },
            Plane { along: [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0]], ..plane() },
            Plane { spacing_mm: [0.0, 1.0], ..plane() },
            Plane { spacing_mm: [f64::NAN, 1.0], ..plane() },
            Plane { thickness_mm: None, ..plane() },
        ] {
            assert!(matches!(poor.affine(&[[0.0; 3]]), Err(StackFault::Number { .. })), "{poor:?}");
        }
    }
}
