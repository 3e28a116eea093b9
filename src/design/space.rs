//! The search space: a few discrete structures (kind of test, direction and symmetry orbits of the holes), each with a
//! continuous vector.
//!
//! Holes come in orbits under the study's mirrors: a hole on a mirror plane is its own image, others bring theirs
//! along.

use super::study::{Range, Study};
use crate::mesh::DesignVariable;
use crate::specimen::{Block, Hole, HoleAxis, MIRROR_TOLERANCE_MM, Specimen, Symmetry, TestKind};

/// One orbit of holes: which of its two coordinates are held at zero by lying on a mirror.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Orbit {
    /// x = 0.
    pub on_x: bool,
    /// Other coordinate = 0.
    pub on_other: bool,
}

/// A discrete choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// Kind of test.
    pub test: TestKind,
    /// Direction of the holes.
    pub axis: HoleAxis,
    /// Orbits, sorted.
    pub orbits: Vec<Orbit>,
    mirrors: [bool; 2],
    /// Whether holes come in pairs through the centre of the section; then no mirror acts.
    is_point_symmetric: bool,
}

/// One component of the continuous vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Variable {
    /// x of an orbit.
    X(usize),
    /// Other coordinate of an orbit.
    Other(usize),
    /// Diameter of an orbit.
    Diameter(usize),
    /// Drive.
    Drive,
    /// Drive of a scan before it.
    EarlierScan,
    /// Length of the block.
    Length,
    /// Thickness of the block.
    Thickness,
    /// Width of the block.
    Width,
    /// Length of a further sample's block.
    OtherLength(usize),
    /// Thickness of a further sample's block.
    OtherThickness(usize),
    /// Width of a further sample's block.
    OtherWidth(usize),
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

impl Structure {
    /// Number of holes.
    pub fn num_holes(&self) -> usize {
        self.orbits.iter().map(|o| self.images(*o)).sum()
    }

    fn images(&self, orbit: Orbit) -> usize {
        self.image_signs(orbit).len()
    }

    /// Signs of the images of an orbit, its own first.
    fn image_signs(&self, orbit: Orbit) -> Vec<[f64; 2]> {
        if self.is_point_symmetric {
            return if orbit.on_x { vec![[1.0; 2]] } else { vec![[1.0; 2], [-1.0; 2]] };
        }
        let signs = |mirror: bool, on: bool| if mirror && !on { vec![1.0, -1.0] } else { vec![1.0] };
        let mut all = Vec::new();
        for sx in signs(self.mirrors[0], orbit.on_x) {
            for so in signs(self.mirrors[1], orbit.on_other) {
                all.push([sx, so]);
            }
        }
        all
    }
}

/// All structures of a study, fewest holes first.
pub fn subspaces(study: &Study) -> Vec<Subspace> {
    let axes = study.axes();
    let max_holes = study.limits.max_holes.unwrap_or(usize::MAX).min(study.vary.hole_count.max);
    let mut all = Vec::new();
    for test in study.tests() {
        let mut has_solid = false;
        for &axis in &axes {
            let mirrors = mirrors_of(study.limits.symmetry, axis);
            let is_point_symmetric = study.limits.symmetry == Symmetry::Point;
            let kinds = if is_point_symmetric {
                [false, true].map(|is_central| Orbit { on_x: is_central, on_other: is_central }).to_vec()
            } else {
                orbit_kinds(mirrors)
            };
            let mut stack = vec![Vec::new()];
            let mut lists: Vec<Vec<Orbit>> = Vec::new();
            while let Some(list) = stack.pop() {
                let structure = Structure { test, axis, orbits: list.clone(), mirrors, is_point_symmetric };
                if structure.num_holes() > max_holes {
                    continue;
                }
                if structure.num_holes() >= study.vary.hole_count.min {
                    lists.push(list.clone());
                }
                for kind in &kinds {
                    // Sorted lists only: the order of orbits does not matter. One centre holds one hole.
                    let is_repeated_centre = kind.on_x && kind.on_other && list.last() == Some(kind);
                    if list.last().is_none_or(|last| last <= kind) && !is_repeated_centre {
                        let mut longer = list.clone();
                        longer.push(*kind);
                        stack.push(longer);
                    }
                }
            }
            for orbits in lists {
                if orbits.is_empty() && std::mem::replace(&mut has_solid, true) {
                    continue;
                }
                all.push(Subspace::new(study, Structure { test, axis, orbits, mirrors, is_point_symmetric }));
            }
        }
    }
    all.sort_by_key(|s| s.structure.num_holes());
    all
}

/// Which mirrors act on (x, other).
fn mirrors_of(symmetry: Symmetry, axis: HoleAxis) -> [bool; 2] {
    let x = matches!(symmetry, Symmetry::MirrorX | Symmetry::MirrorXAndZ | Symmetry::MirrorXAndY);
    // Holes along the width are symmetric in z anyway.
    let other = match axis {
        HoleAxis::Thickness => matches!(symmetry, Symmetry::MirrorZ | Symmetry::MirrorXAndZ),
        HoleAxis::Width => matches!(symmetry, Symmetry::MirrorY | Symmetry::MirrorXAndY),
    };
    [x, other]
}

fn orbit_kinds(mirrors: [bool; 2]) -> Vec<Orbit> {
    let choices = |mirror: bool| if mirror { vec![false, true] } else { vec![false] };
    let mut kinds = Vec::new();
    for on_x in choices(mirrors[0]) {
        for on_other in choices(mirrors[1]) {
            kinds.push(Orbit { on_x, on_other });
        }
    }
    kinds.sort();
    kinds
}

impl Subspace {
    fn new(study: &Study, structure: Structure) -> Subspace {
        let mut template = study.base.clone();
        template.test = structure.test;
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
            if !orbit.on_x {
                let half = 0.5 * (length - diameter.min) - edge;
                variables.push(Variable::X(index));
                // Of a pair through the centre the one with x ≥ 0 stands for both.
                let is_half = structure.mirrors[0] || structure.is_point_symmetric;
                ranges.push(Range { min: if is_half { 0.0 } else { -half }, max: half });
            }
            if !orbit.on_other {
                let half = (0.5 * (other - diameter.min) - edge).max(0.0);
                variables.push(Variable::Other(index));
                ranges.push(Range { min: if structure.mirrors[1] { 0.0 } else { -half }, max: half });
            }
            variables.push(Variable::Diameter(index));
            ranges.push(diameter);
        }
        for (variable, interval) in [
            (Variable::Drive, Some(study.drive_range())),
            (Variable::EarlierScan, vary.earlier_scan_mm),
            (Variable::Length, vary.length_mm),
            (Variable::Thickness, vary.thickness_mm),
            (Variable::Width, vary.width_mm),
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
        let mut orbits = vec![([0.0; 2], 0.0); self.structure.orbits.len()];
        let mut earlier_mm = None;
        for ((variable, range), t) in self.variables.iter().zip(&self.ranges).zip(vector) {
            let value = range.min + t.clamp(0.0, 1.0) * (range.max - range.min);
            match *variable {
                Variable::X(o) => orbits[o].0[0] = value,
                Variable::Other(o) => orbits[o].0[1] = value,
                Variable::Diameter(o) => orbits[o].1 = self.nearest_punch(value),
                Variable::Drive => specimen.drive_mm = vec![value],
                Variable::EarlierScan => earlier_mm = Some(value),
                Variable::Length => specimen.block.length_mm = value,
                Variable::Thickness => specimen.block.thickness_mm = value,
                Variable::Width => specimen.block.width_mm = value,
                Variable::OtherLength(i) => specimen.other_samples[i].block.length_mm = value,
                Variable::OtherThickness(i) => specimen.other_samples[i].block.thickness_mm = value,
                Variable::OtherWidth(i) => specimen.other_samples[i].block.width_mm = value,
            }
        }
        // One beyond the last drive is no earlier one: such a design is not valid.
        specimen.drive_mm.splice(0..0, earlier_mm);
        specimen.holes.clear();
        for (orbit, (center, diameter_mm)) in self.structure.orbits.iter().zip(&orbits) {
            for signs in self.structure.image_signs(*orbit) {
                specimen.holes.push(Hole {
                    axis: self.structure.axis,
                    center_mm: [signs[0] * center[0], signs[1] * center[1]],
                    diameter_mm: *diameter_mm,
                });
            }
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
        specimen.name = match count {
            0 => format!("{kind}, solid"),
            1 => format!("{kind}, 1 hole along the {direction}"),
            n => format!("{kind}, {n} holes along the {direction}"),
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

    /// Whether a variable moves freely (a punched diameter does not).
    pub fn is_continuous(&self, index: usize) -> bool {
        self.punches_mm.is_none() || !matches!(self.variables[index], Variable::Diameter(_))
    }

    /// What a variable moves in the specimen's sample with this number (0: the first), with signs; empty where it moves
    /// nothing, as the drive.
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
        let first =
            |orbit: usize| -> usize { self.structure.orbits[..orbit].iter().map(|o| self.structure.images(*o)).sum() };
        let of_orbit = |orbit: usize, make: fn(usize) -> DesignVariable, component: Option<usize>| {
            self.structure
                .image_signs(self.structure.orbits[orbit])
                .iter()
                .enumerate()
                .map(|(i, signs)| (make(first(orbit) + i), component.map_or(1.0, |c| signs[c])))
                .collect()
        };
        match variable {
            Variable::X(o) => of_orbit(o, DesignVariable::HoleX, Some(0)),
            Variable::Other(o) => of_orbit(o, DesignVariable::HoleOther, Some(1)),
            Variable::Diameter(o) => of_orbit(o, DesignVariable::HoleDiameter, None),
            Variable::Drive
            | Variable::EarlierScan
            | Variable::OtherLength(_)
            | Variable::OtherThickness(_)
            | Variable::OtherWidth(_) => Vec::new(),
            Variable::Length => vec![(DesignVariable::BlockLength, 1.0)],
            Variable::Thickness => vec![(DesignVariable::BlockThickness, 1.0)],
            Variable::Width => vec![(DesignVariable::BlockWidth, 1.0)],
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
        let holes = self.representatives(&specimen.holes)?;
        let mut vector = Vec::with_capacity(self.variables.len());
        for (variable, range) in self.variables.iter().zip(&self.ranges) {
            let value = match *variable {
                Variable::X(o) => holes[o].center_mm[0],
                Variable::Other(o) => holes[o].center_mm[1],
                Variable::Diameter(o) => holes[o].diameter_mm,
                Variable::Drive => drive_mm,
                Variable::EarlierScan => *specimen.drive_mm.first().filter(|d| **d < drive_mm)?,
                Variable::Length => specimen.block.length_mm,
                Variable::Thickness => specimen.block.thickness_mm,
                Variable::Width => specimen.block.width_mm,
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
    fn representatives(&self, holes: &[Hole]) -> Option<Vec<Hole>> {
        let near = |a: f64, b: f64| (a - b).abs() <= MIRROR_TOLERANCE_MM;
        let mut left: Vec<Hole> = holes.to_vec();
        let mut found = Vec::with_capacity(self.structure.orbits.len());
        for orbit in &self.structure.orbits {
            let is_on = [orbit.on_x, orbit.on_other];
            let fits = |hole: &Hole| {
                if self.structure.is_point_symmetric {
                    let is_central = hole.center_mm.iter().all(|c| near(*c, 0.0));
                    return is_central == orbit.on_x && hole.center_mm[0] >= 0.0;
                }
                (0..2).all(|c| {
                    let value = hole.center_mm[c];
                    !self.structure.mirrors[c] || if is_on[c] { near(value, 0.0) } else { value > MIRROR_TOLERANCE_MM }
                })
            };
            let hole = *left.iter().find(|h| fits(h))?;
            for signs in self.structure.image_signs(*orbit) {
                let image = [signs[0] * hole.center_mm[0], signs[1] * hole.center_mm[1]];
                let index = left.iter().position(|h| {
                    near(h.center_mm[0], image[0])
                        && near(h.center_mm[1], image[1])
                        && near(h.diameter_mm, hole.diameter_mm)
                })?;
                left.remove(index);
            }
            found.push(hole);
        }
        left.is_empty().then_some(found)
    }
}
