//! How the gap between the plates goes along a wedged block.
//!
//! Both bonded faces slant alike: they lie at y = ± (thickness/2) g(x) with g(x) = 1 + (wedge/thickness) (x/length). In
//! Y = y/g(x) the block is one of even thickness; a mesh of that one with its nodes at y = Y g(x) is a mesh of the
//! wedge, and as g is linear in x the quadratic elements keep it exactly.

use super::Block;

/// Largest wedge in thicknesses: the thin end then has half of the thickness in the middle.
pub const MAX_WEDGE_OF_THICKNESS: f64 = 1.0;
/// Largest wedge in lengths: each face then slants by 27°.
pub const MAX_WEDGE_OF_LENGTH: f64 = 1.0;

/// The gap between the plates along x relative to that in the middle, g(x) = 1 + slope · x. Without a slope the gap is
/// even, and nothing is computed with it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Taper {
    /// g', mm⁻¹.
    slope_per_mm: f64,
}

impl Taper {
    /// Whether the gap is the same everywhere.
    pub fn is_even(self) -> bool {
        !(self.slope_per_mm.abs() > 0.0)
    }

    /// g' = wedge / (thickness · length), mm⁻¹.
    pub fn slope_per_mm(self) -> f64 {
        self.slope_per_mm
    }

    /// g at `x_mm`.
    pub fn at(self, x_mm: f64) -> f64 {
        1.0 + self.slope_per_mm * x_mm
    }

    /// Where a point of the wedge lies in the block of even thickness: (x, y/g, z).
    pub fn flattened(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        [x, if self.is_even() { y } else { y / self.at(x) }, z]
    }

    /// Where a point of the block of even thickness lies in the wedge: (x, Y g, z).
    pub fn raised(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        [x, if self.is_even() { y } else { y * self.at(x) }, z]
    }

    /// ∂Y/∂x (mm⁻¹ · mm) and ∂Y/∂y of [`Self::flattened`] at a point of the wedge.
    pub fn flattening_slopes(self, [x, y, _]: [f64; 3]) -> [f64; 2] {
        let of_gap = 1.0 / self.at(x);
        [-y * self.slope_per_mm * of_gap * of_gap, of_gap]
    }
}

impl Block {
    /// A block of even thickness, mm.
    pub fn new(length_mm: f64, thickness_mm: f64, width_mm: f64) -> Block {
        Block { length_mm, thickness_mm, width_mm, wedge_mm: 0.0 }
    }

    /// How its thickness goes along x.
    pub fn taper(&self) -> Taper {
        let is_even = !(self.wedge_mm.abs() > 0.0);
        let slope = if is_even { 0.0 } else { self.wedge_mm / (self.thickness_mm * self.length_mm) };
        Taper { slope_per_mm: slope }
    }

    /// Thickness at the ends x = −length/2 and +length/2, mm.
    pub fn end_thicknesses_mm(&self) -> [f64; 2] {
        [self.thickness_mm - 0.5 * self.wedge_mm, self.thickness_mm + 0.5 * self.wedge_mm]
    }

    /// Thickness of the thin end, mm: all of the thickness where it is even.
    pub fn thinnest_mm(&self) -> f64 {
        self.thickness_mm - 0.5 * self.wedge_mm.abs()
    }

    /// Extents along x, y and z of the box around the block, mm.
    pub fn extents_mm(&self) -> [f64; 3] {
        [self.length_mm, self.thickness_mm + 0.5 * self.wedge_mm.abs(), self.width_mm]
    }

    /// The even thickness that would be sheared with the same force, mm: of ends of thickness a and b (b − a)/ln(b/a),
    /// the harmonic mean over the length.
    pub fn harmonic_thickness_mm(&self) -> f64 {
        let [a, b] = self.end_thicknesses_mm();
        if self.taper().is_even() { self.thickness_mm } else { (b - a) / (b / a).ln() }
    }

    /// The largest wedge that such a block may have, mm: what leaves the thin end half of the thickness and at least
    /// `min_mm`, and lets no face slant by more than 27°. Below 0 where the block itself is too thin.
    pub(super) fn wedge_limit_mm(&self, min_mm: f64) -> f64 {
        let of_thickness = MAX_WEDGE_OF_THICKNESS * self.thickness_mm;
        let of_thin_end = 2.0 * (self.thickness_mm - min_mm);
        of_thickness.min(MAX_WEDGE_OF_LENGTH * self.length_mm).min(of_thin_end)
    }
}
