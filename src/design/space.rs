//! The search space: a few discrete structures, each with a continuous vector.

use super::range::Range;
use super::structure::{Orbit, Structure, structures};
use super::study::Study;
use crate::mesh::DesignVariable;
use crate::specimen::{Block, Dumbbell, Hole, HoleAxis, HoleKind, HoleShape, MIRROR_TOLERANCE_MM, Specimen, TestKind};

/// One component of the continuous vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Variable {
    /// x of an orbit.
    X(usize),
    /// Other coordinate of an orbit.
    Other(usize),
    /// Diameter of an orbit; of holes that are not circles the extent across.
    Diameter(usize),
    /// How much longer than wide the holes of an orbit are.
    Elongation(usize),
    /// Angle of an orbit, degrees.
    Angle(usize),
    /// Drive.
    Drive,
    /// Drive of a scan before it.
    EarlierScan,
    /// How far the plates are pressed together before the drive.
    Precompression,
    /// Length of the block.
    Length,
    /// Thickness of the block.
    Thickness,
    /// Width of the block.
    Width,
    /// Width of the gauge.
    GaugeWidth,
    /// Length of the gauge.
    GaugeLength,
    /// Radius of the arcs between gauge and ends.
    FilletRadius,
    /// Length of a further sample's block.
    OtherLength(usize),
    /// Thickness of a further sample's block.
    OtherThickness(usize),
    /// Width of a further sample's block.
    OtherWidth(usize),
}

impl Variable {
    /// Whether it says where a hole is, how large or of what shape.
    pub(super) fn is_of_holes(self) -> bool {
        use Variable::{Angle, Diameter, Elongation, Other, X};
        matches!(self, X(_) | Other(_) | Diameter(_) | Elongation(_) | Angle(_))
    }
}

/// A structure with the ranges of its variables.
#[derive(Clone, Debug)]
pub struct Subspace {
    /// The discrete choice.
    pub structure: Structure,
    /// Variables in order.
    pub variables: Vec<Variable>,
    /// Their ranges.
    pub ranges: Vec<Range>,
    /// Diameters that exist, where only some do.
    pub punches_mm: Option<Vec<f64>>,
    template: Specimen,
    /// Whether each further sample has the outline and the holes of the first.
    is_like_first: Vec<bool>,
}

/// All structures of a study, fewest holes first.
pub fn subspaces(study: &Study) -> Vec<Subspace> {
    structures(study).into_iter().map(|structure| Subspace::new(study, structure)).collect()
}

impl Subspace {
    fn new(study: &Study, structure: Structure) -> Subspace {
        let mut template = study.base.clone();
        template.test = structure.test;
        let has_plates = template.has_plates();
        if !has_plates {
            template.precompression_mm = 0.0;
        }
        let vary = &study.vary;
        let (length, thickness, width) = (
            vary.length_mm.map_or(template.block.length_mm, |r| r.max),
            vary.thickness_mm.map_or(template.block.thickness_mm, |r| r.max),
            vary.width_mm.map_or(template.block.width_mm, |r| r.max),
        );
        let other = match structure.axis {
            HoleAxis::Thickness => width,
            HoleAxis::Width => thickness,
        };
        let smallest_other = match structure.axis {
            HoleAxis::Thickness => other,
            HoleAxis::Width => other.min(thickness),
        };
        let edge = study.limits.min_ligament_hole_edge_mm;
        let diameter = match (&study.limits.diameter_mm, &study.limits.punches_mm) {
            (Some(d), _) => Range { min: d.min, max: d.max },
            (_, Some(p)) => Range {
                min: p.iter().copied().fold(f64::INFINITY, f64::min),
                max: p.iter().copied().fold(0.0, f64::max),
            },
            _ => Range { min: 0.5, max: smallest_other },
        };
        // A hole wider than the section less its two ligaments cannot be made.
        let widest = diameter.max.min(smallest_other - 2.0 * edge);
        let diameter = Range { min: diameter.min, max: widest.max(diameter.min) };
        let (mut variables, mut ranges) = (Vec::new(), Vec::new());
        for (index, orbit) in structure.orbits.iter().enumerate() {
            if !orbit.on_x && !orbit.is_on_side(0) {
                let half = 0.5 * (length - diameter.min) - edge;
                variables.push(Variable::X(index));
                // Of a pair through the centre the one with x ≥ 0 stands for both.
                let is_half = structure.mirrors[0] || structure.is_point_symmetric;
                ranges.push(Range { min: if is_half { 0.0 } else { -half }, max: half });
            }
            if !orbit.on_other && !orbit.is_on_side(1) {
                let half = (0.5 * (other - diameter.min) - edge).max(0.0);
                variables.push(Variable::Other(index));
                ranges.push(Range { min: if structure.mirrors[1] { 0.0 } else { -half }, max: half });
            }
            variables.push(Variable::Diameter(index));
            ranges.push(diameter);
            if let Some(shapes) = vary.hole_shapes.as_ref().filter(|_| structure.kind_of(*orbit).is_some()) {
                let angle = shapes.angle_deg;
                variables.extend([Variable::Elongation(index), Variable::Angle(index)]);
                ranges.extend([shapes.elongation_mm, Range { min: angle.min, max: angle.max }]);
            }
        }
        let precompression = vary.precompression_mm.filter(|_| has_plates);
        for (variable, interval) in [
            (Variable::Drive, Some(study.drive_range())),
            (Variable::EarlierScan, vary.earlier_scan_mm),
            (Variable::Precompression, precompression.map(|r| Range { min: r.min, max: r.max })),
            (Variable::Length, vary.length_mm),
            (Variable::Thickness, vary.thickness_mm),
            (Variable::Width, vary.width_mm),
            (Variable::GaugeWidth, vary.gauge_width_mm),
            (Variable::GaugeLength, vary.gauge_length_mm),
            (Variable::FilletRadius, vary.fillet_radius_mm),
        ] {
            if let Some(interval) = interval {
                variables.push(variable);
                ranges.push(interval);
            }
        }
        for (index, other) in vary.other_samples.iter().enumerate() {
            for (variable, interval) in [
                (Variable::OtherLength(index), other.length_mm),
                (Variable::OtherThickness(index), other.thickness_mm),
                (Variable::OtherWidth(index), other.width_mm),
            ] {
                if let Some(interval) = interval {
                    variables.push(variable);
                    ranges.push(interval);
                }
            }
        }
        let is_like_first = (0..template.other_samples.len())
            .map(|index| vary.other_samples.get(index).is_some_and(|other| other.is_like_first))
            .collect();
        let punches_mm = study.limits.punches_mm.clone();
        Subspace { structure, variables, ranges, punches_mm, template, is_like_first }
    }

    /// The specimen of a vector with components in [0, 1]. A punched diameter is the nearest punch.
    pub fn specimen(&self, vector: &[f64]) -> Specimen {
        let mut specimen = self.template.clone();
        let mut orbits = vec![([0.0; 2], 0.0, [0.0; 2]); self.structure.orbits.len()];
        let mut earlier_mm = None;
        for ((variable, range), t) in self.variables.iter().zip(&self.ranges).zip(vector) {
            let value = range.min + t.clamp(0.0, 1.0) * (range.max - range.min);
            match *variable {
                Variable::X(o) => orbits[o].0[0] = value,
                Variable::Other(o) => orbits[o].0[1] = value,
                Variable::Diameter(o) => orbits[o].1 = self.nearest_punch(value),
                Variable::Elongation(o) => orbits[o].2[0] = value,
                Variable::Angle(o) => orbits[o].2[1] = self.allowed_angle(self.structure.orbits[o], value),
                Variable::Drive => specimen.drive_mm = vec![value],
                Variable::EarlierScan => earlier_mm = Some(value),
                Variable::Precompression => specimen.precompression_mm = value,
                Variable::Length => specimen.block.length_mm = value,
                Variable::Thickness => specimen.block.thickness_mm = value,
                Variable::Width => specimen.block.width_mm = value,
                Variable::GaugeWidth => set_gauge(&mut specimen, |gauge| &mut gauge.gauge_width_mm, value),
                Variable::GaugeLength => set_gauge(&mut specimen, |gauge| &mut gauge.gauge_length_mm, value),
                Variable::FilletRadius => set_gauge(&mut specimen, |gauge| &mut gauge.fillet_radius_mm, value),
                Variable::OtherLength(i) => specimen.other_samples[i].block.length_mm = value,
                Variable::OtherThickness(i) => specimen.other_samples[i].block.thickness_mm = value,
                Variable::OtherWidth(i) => specimen.other_samples[i].block.width_mm = value,
            }
        }
        // One beyond the last drive is no earlier one: such a design is not valid.
        specimen.drive_mm.splice(0..0, earlier_mm);
        specimen.holes.clear();
        let size_mm = self.structure.axis.section_of(&specimen.block);
        for (orbit, (mut center_mm, diameter_mm, [elongation_mm, angle_deg])) in
            self.structure.orbits.iter().zip(orbits)
        {
            let of_kind = |kind| HoleShape { kind, length_mm: diameter_mm + elongation_mm, angle_deg };
            let shape = self.structure.kind_of(*orbit).map(of_kind);
            if let Some(side) = orbit.notched {
                center_mm[side.axis()] = 0.5 * size_mm[side.axis()];
            }
            let round = Hole::circle(self.structure.axis, center_mm, diameter_mm);
            let hole = Hole { shape, is_notch: orbit.notched.is_some(), ..round };
            let images = self.structure.image_signs(*orbit).into_iter();
            specimen.holes.extend(images.map(|signs| hole.mirrored(signs)));
        }
        for (sample, is_like_first) in specimen.other_samples.iter_mut().zip(&self.is_like_first) {
            if *is_like_first {
                sample.block = Block { thickness_mm: sample.block.thickness_mm, ..specimen.block };
                sample.holes.clone_from(&specimen.holes);
            }
        }
        let count = specimen.holes.len();
        let kind = match specimen.test {
            TestKind::DoubleLapShear => "double-lap shear",
            TestKind::Uniaxial => "uniaxial",
        };
        let direction = match self.structure.axis {
            HoleAxis::Thickness => "thickness",
            HoleAxis::Width => "width",
        };
        let (hole, holes) = match self.structure.hole_kind {
            _ if specimen.holes.iter().all(|hole| hole.is_notch) => ("notch", "notches"),
            None => ("hole", "holes"),
            Some(HoleKind::Ellipse) => ("elliptic hole", "elliptic holes"),
            Some(HoleKind::Slot) => ("slot", "slots"),
        };
        specimen.name = match count {
            0 => format!("{kind}, solid"),
            1 => format!("{kind}, 1 {hole} along the {direction}"),
            n => format!("{kind}, {n} {holes} along the {direction}"),
        };
        specimen
    }

    fn nearest_punch(&self, diameter: f64) -> f64 {
        match &self.punches_mm {
            None => diameter,
            Some(list) => list
                .iter()
                .copied()
                .min_by(|a, b| (a - diameter).abs().total_cmp(&(b - diameter).abs()))
                .unwrap_or(diameter),
        }
    }

    /// The angle itself, or along or across the mirror that a hole lies on.
    fn allowed_angle(&self, orbit: Orbit, angle_deg: f64) -> f64 {
        if !self.structure.holds_upright(orbit) {
            angle_deg
        } else if angle_deg.to_radians().cos().powi(2) >= 0.5 {
            0.0
        } else {
            90.0
        }
    }

    /// Whether a variable moves freely (a punched diameter does not, nor the angle of a hole on a mirror).
    pub fn is_continuous(&self, index: usize) -> bool {
        match self.variables[index] {
            Variable::Diameter(_) => self.punches_mm.is_none(),
            Variable::Angle(orbit) => !self.structure.holds_upright(self.structure.orbits[orbit]),
            _ => true,
        }
    }

    /// What a variable moves in the specimen's sample with this number (0: the first), with signs; empty where it moves
    /// nothing but the plates, as the drive.
    pub fn moves(&self, variable: Variable, number: usize) -> Vec<(DesignVariable, f64)> {
        // A sample like the first moves with it, but for its thickness.
        let follows = number == 0 || variable != Variable::Thickness && self.is_like_first[number - 1];
        let is_of = |index: usize| number == index + 1;
        match variable {
            Variable::OtherLength(i) if is_of(i) => vec![(DesignVariable::BlockLength, 1.0)],
            Variable::OtherThickness(i) if is_of(i) => vec![(DesignVariable::BlockThickness, 1.0)],
            Variable::OtherWidth(i) if is_of(i) => vec![(DesignVariable::BlockWidth, 1.0)],
            _ if follows => self.moves_of_first(variable),
            _ => Vec::new(),
        }
    }

    fn moves_of_first(&self, variable: Variable) -> Vec<(DesignVariable, f64)> {
        let first = |orbit: usize| -> usize {
            self.structure.orbits[..orbit].iter().map(|o| self.structure.num_images(*o)).sum()
        };
        let of_orbit = |orbit: usize, make: fn(usize) -> DesignVariable, sign: fn(&[f64; 2]) -> f64| -> Vec<_> {
            self.structure
                .image_signs(self.structure.orbits[orbit])
                .iter()
                .enumerate()
                .map(|(i, signs)| (make(first(orbit) + i), sign(signs)))
                .collect()
        };
        // Notches go with the sides that they open to.
        let of_block = |dimension: DesignVariable, coordinate: usize| -> Vec<_> {
            let on_side = |o: &usize| self.structure.orbits[*o].is_on_side(coordinate);
            let notches = (0..self.structure.orbits.len()).filter(on_side).flat_map(|o| match coordinate {
                0 => of_orbit(o, DesignVariable::HoleX, |signs| 0.5 * signs[0]),
                _ => of_orbit(o, DesignVariable::HoleOther, |signs| 0.5 * signs[1]),
            });
            std::iter::once((dimension, 1.0)).chain(notches).collect()
        };
        let is_lateral = |axis: HoleAxis| self.structure.axis == axis;
        match variable {
            Variable::X(o) => of_orbit(o, DesignVariable::HoleX, |signs| signs[0]),
            Variable::Other(o) => of_orbit(o, DesignVariable::HoleOther, |signs| signs[1]),
            Variable::Diameter(o) => {
                let mut moved = of_orbit(o, DesignVariable::HoleDiameter, |_| 1.0);
                // The elongation is held, so that the length goes along.
                if self.structure.kind_of(self.structure.orbits[o]).is_some() {
                    moved.extend(of_orbit(o, DesignVariable::HoleLength, |_| 1.0));
                }
                moved
            }
            Variable::Elongation(o) => of_orbit(o, DesignVariable::HoleLength, |_| 1.0),
            Variable::Angle(o) if self.structure.holds_upright(self.structure.orbits[o]) => Vec::new(),
            Variable::Angle(o) => of_orbit(o, DesignVariable::HoleAngle, |signs| signs[0] * signs[1]),
            Variable::Drive
            | Variable::EarlierScan
            | Variable::Precompression
            | Variable::OtherLength(_)
            | Variable::OtherThickness(_)
            | Variable::OtherWidth(_) => Vec::new(),
            Variable::Length => of_block(DesignVariable::BlockLength, 0),
            Variable::Thickness if is_lateral(HoleAxis::Width) => of_block(DesignVariable::BlockThickness, 1),
            Variable::Thickness => vec![(DesignVariable::BlockThickness, 1.0)],
            Variable::Width if is_lateral(HoleAxis::Thickness) => of_block(DesignVariable::BlockWidth, 1),
            Variable::Width => vec![(DesignVariable::BlockWidth, 1.0)],
            Variable::GaugeWidth => vec![(DesignVariable::GaugeWidth, 1.0)],
            Variable::GaugeLength => vec![(DesignVariable::GaugeLength, 1.0)],
            Variable::FilletRadius => vec![(DesignVariable::FilletRadius, 1.0)],
        }
    }

    /// The vector of a specimen of this structure at `drive_mm`, or `None` where it is of another one, lacks the
    /// study's symmetry or is out of range.
    pub fn vector_of(&self, specimen: &Specimen, drive_mm: f64) -> Option<Vec<f64>> {
        if specimen.test != self.structure.test || specimen.holes.len() != self.structure.num_holes() {
            return None;
        }
        if specimen.holes.iter().any(|h| h.axis != self.structure.axis) {
            return None;
        }
        if specimen.other_samples.len() != self.is_like_first.len() {
            return None;
        }
        for (sample, is_like_first) in specimen.other_samples.iter().zip(&self.is_like_first) {
            let like = Block { thickness_mm: sample.block.thickness_mm, ..specimen.block };
            if *is_like_first && (sample.block != like || sample.holes != specimen.holes) {
                return None;
            }
        }
        let holes = self.representatives(specimen)?;
        let mut vector = Vec::with_capacity(self.variables.len());
        for (variable, range) in self.variables.iter().zip(&self.ranges) {
            let value = match *variable {
                Variable::X(o) => holes[o].center_mm[0],
                Variable::Other(o) => holes[o].center_mm[1],
                Variable::Diameter(o) => holes[o].diameter_mm,
                Variable::Elongation(o) => holes[o].length_mm() - holes[o].diameter_mm,
                Variable::Angle(o) => angle_within(holes[o].shape.map_or(0.0, |shape| shape.angle_deg), range),
                Variable::Drive => drive_mm,
                Variable::EarlierScan => *specimen.drive_mm.first().filter(|d| **d < drive_mm)?,
                Variable::Precompression => specimen.precompression_mm,
                Variable::Length => specimen.block.length_mm,
                Variable::Thickness => specimen.block.thickness_mm,
                Variable::Width => specimen.block.width_mm,
                Variable::GaugeWidth => specimen.outline.dumbbell()?.gauge_width_mm,
                Variable::GaugeLength => specimen.outline.dumbbell()?.gauge_length_mm,
                Variable::FilletRadius => specimen.outline.dumbbell()?.fillet_radius_mm,
                Variable::OtherLength(i) => specimen.other_samples[i].block.length_mm,
                Variable::OtherThickness(i) => specimen.other_samples[i].block.thickness_mm,
                Variable::OtherWidth(i) => specimen.other_samples[i].block.width_mm,
            };
            let width = (range.max - range.min).max(1e-12);
            let t = (value - range.min) / width;
            if !(-1e-9..=1.0 + 1e-9).contains(&t) {
                return None;
            }
            vector.push(t.clamp(0.0, 1.0));
        }
        Some(vector)
    }

    /// For each orbit the hole that stands for it (on the positive side of every mirror), where the holes are exactly
    /// the orbits of this structure.
    fn representatives(&self, specimen: &Specimen) -> Option<Vec<Hole>> {
        let near = |a: f64, b: f64| (a - b).abs() <= MIRROR_TOLERANCE_MM;
        let side_mm = self.structure.axis.section_of(&specimen.block).map(|extent| 0.5 * extent);
        let mut left: Vec<Hole> = specimen.holes.clone();
        let mut found = Vec::with_capacity(self.structure.orbits.len());
        for orbit in &self.structure.orbits {
            let is_on = [orbit.on_x, orbit.on_other];
            let fits = |hole: &Hole| {
                let kind = hole.shape.map(|shape| shape.kind);
                if kind != self.structure.kind_of(*orbit) || hole.is_notch != orbit.notched.is_some() {
                    return false;
                }
                if self.structure.is_point_symmetric {
                    let is_central = hole.center_mm.iter().all(|c| near(*c, 0.0));
                    return is_central == orbit.on_x && hole.center_mm[0] >= 0.0;
                }
                (0..2).all(|c| {
                    let value = hole.center_mm[c];
                    if orbit.is_on_side(c) {
                        return near(value, side_mm[c]);
                    }
                    !self.structure.mirrors[c] || if is_on[c] { near(value, 0.0) } else { value > MIRROR_TOLERANCE_MM }
                })
            };
            let hole = *left.iter().find(|h| fits(h))?;
            for signs in self.structure.image_signs(*orbit) {
                let image = hole.mirrored(signs);
                let index = left.iter().position(|h| near(h.difference_mm(&image), 0.0))?;
                left.remove(index);
            }
            found.push(hole);
        }
        left.is_empty().then_some(found)
    }
}

/// Gives a dumb-bell of free gauge another dimension; what has no such gauge stays.
fn set_gauge(specimen: &mut Specimen, dimension: fn(&mut Dumbbell) -> &mut f64, value_mm: f64) {
    if let Some(gauge) = specimen.outline.free_gauge_mut() {
        *dimension(gauge) = value_mm;
    }
}

/// An angle of a hole with the half turns added that bring it into a range, where any do.
fn angle_within(angle_deg: f64, range: &Range) -> f64 {
    let turned = [-180.0, 0.0, 180.0].map(|turn| angle_deg + turn);
    turned.into_iter().find(|a| (range.min..=range.max).contains(a)).unwrap_or(angle_deg)
}
