//! Notches: round holes that one side of the section cuts open.
//!
//! With d the distance of the centre from the side (positive inside the block) and r the radius, the wall that is left
//! is the arc of half angle β about the inward normal, cos β = −d/r, and the mouth is 2 √(r² − d²) wide. At the mouth
//! the material has the angle π − β.

use super::{Hole, HoleAxis, SectionEdge, Specimen, TestKind};
use std::f64::consts::{FRAC_PI_2, PI};

/// How deep inside the block the centre of a notch may lie, as a part of its radius: the material at the mouth keeps
/// an angle of 60° and more.
pub const MAX_NOTCH_INSET: f64 = 0.5;
/// How deep a notch is at least, as a part of its radius: below, it is rather an error of the drawing.
pub const MIN_NOTCH_DEPTH: f64 = 0.2;
/// Rounding by which a depth may miss its limit, relative to the radius.
const ROUNDING: f64 = 1e-9;

/// A notch in a side of the section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Notch {
    /// The side that it opens to.
    pub side: SectionEdge,
    /// Centre in the section (x, lateral), mm.
    pub center_mm: [f64; 2],
    /// Radius, mm.
    pub radius_mm: f64,
    /// Distance of the centre from the side, mm; positive inside the block.
    pub inset_mm: f64,
}

/// How fast a notch changes, mm per unit of a variable.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NotchRates {
    /// Of its centre in the section.
    pub center: [f64; 2],
    /// Of its radius.
    pub radius: f64,
    /// Of the side that it opens to, outwards.
    pub side: f64,
}

impl SectionEdge {
    /// The axis of the section (0: x, 1: lateral) that the side lies across, and the sign of its end.
    pub fn axis_and_sign(self) -> (usize, f64) {
        match self {
            SectionEdge::MinusX => (0, -1.0),
            SectionEdge::PlusX => (0, 1.0),
            SectionEdge::MinusLateral => (1, -1.0),
            SectionEdge::PlusLateral => (1, 1.0),
        }
    }

    /// The sign of the coordinate along the side in which it is passed with the outline counter-clockwise: the end at
    /// +x upwards, the side at +lateral towards −x.
    pub fn travel(self) -> f64 {
        let (axis, sign) = self.axis_and_sign();
        if axis == 0 { sign } else { -sign }
    }
}

impl Notch {
    /// Half of the angle of the wall that is left, β, radians.
    pub fn half_angle(&self) -> f64 {
        (-self.inset_mm / self.radius_mm).clamp(-1.0, 1.0).acos()
    }

    /// Half of the width of the mouth, mm.
    pub fn half_mouth_mm(&self) -> f64 {
        (self.radius_mm.powi(2) - self.inset_mm.powi(2)).max(0.0).sqrt()
    }

    /// The polar angle of the inward normal of the side, radians.
    pub fn inward_angle(&self) -> f64 {
        match self.side {
            SectionEdge::MinusX => 0.0,
            SectionEdge::PlusX => PI,
            SectionEdge::MinusLateral => FRAC_PI_2,
            SectionEdge::PlusLateral => -FRAC_PI_2,
        }
    }

    /// Polar angles of the wall from one end of the mouth to the other, falling: with the outline counter-clockwise,
    /// the material lies on the left.
    pub fn wall_angles(&self) -> [f64; 2] {
        let (inward, half) = (self.inward_angle(), self.half_angle());
        [inward + half, inward - half]
    }

    /// The ends of the mouth in the order of [`Notch::wall_angles`], exactly on the side, mm.
    pub fn mouth_mm(&self) -> [[f64; 2]; 2] {
        let (axis, sign) = self.side.axis_and_sign();
        let half = self.half_mouth_mm();
        [-half, half].map(|along| {
            let mut p = self.center_mm;
            p[axis] += sign * self.inset_mm;
            p[1 - axis] += self.side.travel() * along;
            p
        })
    }

    /// How the wall's points move, each at its share of the arc, so that the ends of the mouth stay on the side. Off
    /// the wall the field continues by the polar angle of `p`.
    ///
    /// With φ the angle from the inward normal, points lie at (r cos φ, r sin φ) inwards and along from the centre;
    /// φ/β is held, and −r sin β β' = (d r' − d' r)/r with d' of side and centre.
    pub fn motion(&self, p: [f64; 2], rates: NotchRates) -> [f64; 2] {
        let (axis, sign) = self.side.axis_and_sign();
        let (r, half) = (self.radius_mm, self.half_angle());
        let outward_center = sign * rates.center[axis];
        let inset = rates.side - outward_center;
        let d_half = (inset - self.inset_mm * rates.radius / r) / (r * half.sin());
        let inwards = -sign * (p[axis] - self.center_mm[axis]);
        let along = p[1 - axis] - self.center_mm[1 - axis];
        let angle = along.atan2(inwards).clamp(-half, half);
        let (sin, cos) = angle.sin_cos();
        let d_angle = d_half * angle / half;
        let mut motion = [0.0; 2];
        motion[axis] = sign * (outward_center - rates.radius * cos + r * sin * d_angle);
        motion[1 - axis] = rates.center[1 - axis] + rates.radius * sin + r * cos * d_angle;
        motion
    }

    /// First moment along x about the origin of the area that is cut out, mm³: what the side cuts off the disc, farther
    /// than d from its centre, has the moment 2/3 (r² − d²)^(3/2) towards the side.
    pub fn moment_x_mm3(&self) -> f64 {
        let (axis, sign) = self.side.axis_and_sign();
        let cut_off = if axis == 0 { sign * 2.0 / 3.0 * self.half_mouth_mm().powi(3) } else { 0.0 };
        self.area_mm2() * self.center_mm[0] - cut_off
    }

    /// Area that is cut out of the block, mm²: r² β + d √(r² − d²).
    pub fn area_mm2(&self) -> f64 {
        self.radius_mm.powi(2) * self.half_angle() + self.inset_mm * self.half_mouth_mm()
    }
}

/// What is wrong with a notch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotchProblem {
    /// It is an ellipse or a slot.
    NotRound,
    /// The specimen is no block.
    NotABlock,
    /// The side that it would open to is bonded.
    BondedSide(SectionEdge),
    /// Its centre is not within reach of the nearest side: distance from it (positive inside) and the least and the
    /// largest allowed, mm.
    Depth([f64; 3]),
}

impl std::fmt::Display for NotchProblem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            NotchProblem::NotRound => {
                write!(f, "has a shape; a notch is round: leave out shape, or set is_notch to false")
            }
            NotchProblem::NotABlock => {
                write!(f, "is in a dumb-bell; only blocks may have notches: leave out the outline, or the notch")
            }
            NotchProblem::BondedSide(_) => {
                write!(f, "opens to a bonded face; a notch opens to a free one: move it, or turn its axis")
            }
            NotchProblem::Depth([inset_mm, low_mm, high_mm]) => write!(
                f,
                "has its centre {inset_mm:.4} mm inside the nearest side; from {low_mm:.4} to {high_mm:.4} mm (negative \
                 outside) are allowed: move it, or set is_notch to false"
            ),
        }
    }
}

impl Hole {
    /// A round notch: a hole that a side of the block cuts open.
    pub fn notch(axis: HoleAxis, center_mm: [f64; 2], diameter_mm: f64) -> Hole {
        Hole { is_notch: true, ..Hole::circle(axis, center_mm, diameter_mm) }
    }
}

impl Specimen {
    /// The notch that a hole of the specimen is, in the side that its centre is nearest to; `None` of a hole within the
    /// block. Of a specimen that is not valid the side may be one that the hole does not reach.
    pub fn notch_of(&self, hole: &Hole) -> Option<Notch> {
        hole.is_notch.then(|| {
            let half = self.section_size().map(|extent| 0.5 * extent);
            let inset_of = |side: SectionEdge| {
                let (axis, sign) = side.axis_and_sign();
                half[axis] - sign * hole.center_mm[axis]
            };
            let nearest = |a: &SectionEdge, b: &SectionEdge| inset_of(*a).total_cmp(&inset_of(*b));
            let side = SectionEdge::ALL.into_iter().min_by(nearest).unwrap_or(SectionEdge::PlusX);
            let radius_mm = 0.5 * hole.diameter_mm;
            Notch { side, center_mm: hole.center_mm, radius_mm, inset_mm: inset_of(side) }
        })
    }

    /// Area of the section that a hole takes away, mm².
    pub fn hole_area_mm2(&self, hole: &Hole) -> f64 {
        self.notch_of(hole).map_or_else(|| hole.wall().area_mm2(), |notch| notch.area_mm2())
    }

    /// First moment along x about the origin of that area, mm³.
    pub fn hole_moment_x_mm3(&self, hole: &Hole) -> f64 {
        let whole = || hole.wall().area_mm2() * hole.center_mm[0];
        self.notch_of(hole).map_or_else(whole, |notch| notch.moment_x_mm3())
    }

    /// What is wrong with a notch, if the hole is one.
    pub(crate) fn notch_problem(&self, hole: &Hole) -> Option<NotchProblem> {
        let notch = self.notch_of(hole)?;
        if hole.shape.is_some() {
            return Some(NotchProblem::NotRound);
        }
        if self.outline.dumbbell().is_some() {
            return Some(NotchProblem::NotABlock);
        }
        let (axis, _) = notch.side.axis_and_sign();
        let is_bonded = match self.test {
            TestKind::Uniaxial => axis == 0,
            TestKind::DoubleLapShear => axis == 1 && hole.axis == HoleAxis::Width,
        };
        if is_bonded {
            return Some(NotchProblem::BondedSide(notch.side));
        }
        let (r, inset) = (notch.radius_mm, notch.inset_mm);
        let (low, high) = ((MIN_NOTCH_DEPTH - 1.0) * r, MAX_NOTCH_INSET * r);
        let is_within = inset >= low - ROUNDING * r && inset <= high + ROUNDING * r;
        (!is_within).then_some(NotchProblem::Depth([inset, low, high]))
    }
}

#[cfg(test)]
#[path = "notch_tests.rs"]
mod tests;
