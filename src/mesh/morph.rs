//! Derivatives of the node positions with respect to the design, on a fixed topology.

use serde::{Deserialize, Serialize};

use super::Mesh;
use super::locator::extrusion_axis;
use crate::specimen::dumbbell::{DumbbellDimension, Profile};
use crate::specimen::{HoleAxis, HoleWall, Notch, NotchRates, Outline, SectionEdge, Specimen};

/// One geometric quantity of a specimen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DesignVariable {
    /// x of the centre of a hole (index in the specimen), mm.
    HoleX(usize),
    /// The other coordinate of a hole's centre (z or y), mm.
    HoleOther(usize),
    /// Diameter of a hole, mm; of an ellipse or a slot the extent across it, its length held.
    HoleDiameter(usize),
    /// Length of an ellipse or a slot, mm, its extent across held. A circle has none.
    HoleLength(usize),
    /// Angle of an ellipse or a slot, degrees. A circle has none.
    HoleAngle(usize),
    /// Extent of the block along x, mm.
    BlockLength,
    /// Extent of the block along y, mm.
    BlockThickness,
    /// Extent of the block along z, mm.
    BlockWidth,
    /// Width of the gauge of a dumb-bell of free gauge, mm.
    GaugeWidth,
    /// Length of its gauge between the arcs, mm.
    GaugeLength,
    /// Radius of its arcs, mm.
    FilletRadius,
}

/// d(node position)/d(variable), dimensionless, per node of `mesh` (of `specimen`).
///
/// A hole's wall moves rigidly, or as its extents or its angle ask: an extent moves it linearly, so that a circle stays
/// a circle, an ellipse an ellipse and a slot a slot at any step; an angle does so to first order. The motion fades as
/// d/(d + d_h) towards the other walls and the outline, with d_h the distance to the hole and d a smooth minimum of the
/// distances to the others. A block dimension scales the outline affinely about the origin and leaves the holes'
/// centres and shapes alone; along the extrusion everything is scaled.
///
/// The wall of a notch stays the arc that its side cuts from its circle, to first order: points keep their share of the
/// arc, the ends of the mouth slide along the side, and so does the side next to them. A dimension of the block moves a
/// side and holds the centres of notches, which then lie deeper or less deep in it.
///
/// A wedge is moved as the block of even thickness is that it is in flattened coordinates ([`crate::specimen::Taper`]),
/// and its wedge is held.
///
/// In a mirrored mesh the velocity is that of the meshed half. A hole and its image are moved together by summing their
/// two variables (with opposite signs for [`DesignVariable::HoleOther`]); the one outside the meshed half contributes
/// zero. [`DesignVariable::HoleOther`] of a hole centred on the mirror plane gives zero: by symmetry it changes
/// symmetric results (forces, integrals) in second order only. The same holds for [`DesignVariable::HoleAngle`].
///
/// Of a dumb-bell of free gauge, gauge, arcs and ends each stretch in themselves along x, and across it every section
/// stretches with its width ([`Profile::rate`]). A dumb-bell of a standard keeps its outline: length moves its ends,
/// its other dimensions give zero, as those of a gauge do in a block. An index of a hole that does not exist gives
/// zero.
pub fn shape_velocity(mesh: &Mesh, specimen: &Specimen, variable: DesignVariable) -> Vec<[f64; 3]> {
    let (field, taper) = (Field::new(mesh, specimen), specimen.block.taper());
    if taper.is_even() {
        return mesh.nodes.iter().map(|&p| field.velocity(p, variable)).collect();
    }
    // y = Y g(x) with g = 1 + slope · x, where the slope is wedge / (thickness · length).
    let slope = taper.slope_per_mm();
    let slope_rate = match variable {
        DesignVariable::BlockThickness => -slope / specimen.block.thickness_mm,
        DesignVariable::BlockLength => -slope / specimen.block.length_mm,
        _ => 0.0,
    };
    let raised = |&p: &[f64; 3]| {
        let flat = taper.flattened(p);
        let v = field.velocity(flat, variable);
        let of_gap = slope * v[0] + slope_rate * flat[0];
        [v[0], taper.at(flat[0]) * v[1] + flat[1] * of_gap, v[2]]
    };
    mesh.nodes.iter().map(raised).collect()
}

/// `mesh` with its nodes moved by `step` times `velocity` (as from [`shape_velocity`]). Topology and node sets stay.
/// Check the result before use when the step is not small: elements may have become poor. The taper of a wedge stays,
/// too: where length or thickness change, give the result that of the moved specimen before points are looked for in
/// it.
pub fn morphed(mesh: &Mesh, velocity: &[[f64; 3]], step: f64) -> Mesh {
    let mut moved = mesh.clone();
    for (p, v) in moved.nodes.iter_mut().zip(velocity) {
        for c in 0..3 {
            p[c] += step * v[c];
        }
    }
    moved
}

/// A notch with its index among the holes.
#[derive(Clone, Copy)]
struct NotchOf {
    hole: usize,
    notch: Notch,
}

struct Field<'a> {
    specimen: &'a Specimen,
    /// The side of a dumb-bell.
    profile: Option<Profile>,
    walls: Vec<HoleWall>,
    notches: Vec<Option<Notch>>,
    half: [f64; 3],
    /// Coordinate index of the section's second direction and of the extrusion.
    b_axis: usize,
    extrusion_axis: usize,
    section_mirrored: bool,
    tolerance: f64,
}

impl<'a> Field<'a> {
    fn new(mesh: &Mesh, specimen: &'a Specimen) -> Self {
        let b = &specimen.block;
        // A mesh says itself how it is extruded, which settles the case without holes.
        let extrusion_axis = match specimen.holes.first().map(|h| h.axis) {
            Some(HoleAxis::Thickness) => 1,
            Some(HoleAxis::Width) => 2,
            None => extrusion_axis(mesh),
        };
        let b_axis = 3 - extrusion_axis;
        let half = [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm];
        Field {
            specimen,
            profile: specimen.profile(),
            walls: specimen.holes.iter().map(|hole| hole.wall()).collect(),
            notches: specimen.holes.iter().map(|hole| specimen.notch_of(hole)).collect(),
            half,
            b_axis,
            extrusion_axis,
            section_mirrored: if b_axis == 2 { mesh.mirror.z } else { mesh.mirror.y },
            tolerance: 1e-7 * (half[0] + half[1] + half[2]),
        }
    }

    /// Distance from the wall of a hole; at least 0.
    fn hole_distance(&self, hole: usize, p: [f64; 2]) -> f64 {
        let distance = self.walls[hole].distance_mm(p);
        if distance < self.tolerance { 0.0 } else { distance }
    }

    /// Smooth minimum of the distances to the outline's sides, but for one: 0 on them.
    fn outline_distance(&self, p: [f64; 2], without: Option<SectionEdge>) -> f64 {
        let sides = SectionEdge::ALL.into_iter().filter(|side| Some(*side) != without);
        smooth_minimum(sides.map(|side| self.side_distance(p, side)))
    }

    /// Distance from a side along its normal; at least 0. That is enough of a dumb-bell, too: weights only have to
    /// vanish on the outline.
    fn side_distance(&self, p: [f64; 2], side: SectionEdge) -> f64 {
        let (axis, sign) = side.axis_and_sign();
        let half = match (axis, self.profile) {
            (0, _) => self.half[0],
            (_, None) => self.half[self.b_axis],
            (_, Some(profile)) => profile.half_width_mm(p[0]),
        };
        let distance = half - sign * p[axis];
        if distance < self.tolerance { 0.0 } else { distance }
    }

    fn velocity(&self, node: [f64; 3], variable: DesignVariable) -> [f64; 3] {
        let p = [node[0], node[self.b_axis]];
        let mut v = [0.0; 3];
        match variable {
            DesignVariable::HoleX(hole) => match self.notch(hole) {
                Some(notch) => {
                    self.add_notch_motion(&mut v, notch, p, NotchRates { center: [1.0, 0.0], ..NotchRates::default() });
                }
                None => v[0] = self.hole_weight(hole, p),
            },
            DesignVariable::HoleOther(hole) if self.is_on_mirror(hole) => {}
            DesignVariable::HoleOther(hole) => match self.notch(hole) {
                Some(notch) => {
                    self.add_notch_motion(&mut v, notch, p, NotchRates { center: [0.0, 1.0], ..NotchRates::default() });
                }
                None => v[self.b_axis] = self.hole_weight(hole, p),
            },
            DesignVariable::HoleDiameter(hole) => match self.notch(hole) {
                Some(notch) => {
                    self.add_notch_motion(&mut v, notch, p, NotchRates { radius: 0.5, ..NotchRates::default() });
                }
                None => self.add_wall_motion(&mut v, hole, p, HoleWall::motion_with_width),
            },
            DesignVariable::HoleLength(hole) => self.add_wall_motion(&mut v, hole, p, HoleWall::motion_with_length),
            DesignVariable::HoleAngle(hole) => {
                if !self.is_on_mirror(hole) {
                    self.add_wall_motion(&mut v, hole, p, HoleWall::motion_with_angle);
                }
            }
            DesignVariable::BlockLength => match self.profile {
                Some(profile) => self.add_side_motion(&mut v, profile, p, DumbbellDimension::Length),
                None => self.add_block_motion(&mut v, node, p, 0),
            },
            DesignVariable::BlockThickness => self.add_block_motion(&mut v, node, p, 1),
            DesignVariable::BlockWidth => match self.profile {
                Some(_) => self.add_gauge_motion(&mut v, p, DumbbellDimension::Width),
                None => self.add_block_motion(&mut v, node, p, 2),
            },
            DesignVariable::GaugeWidth => self.add_gauge_motion(&mut v, p, DumbbellDimension::GaugeWidth),
            DesignVariable::GaugeLength => self.add_gauge_motion(&mut v, p, DumbbellDimension::GaugeLength),
            DesignVariable::FilletRadius => self.add_gauge_motion(&mut v, p, DumbbellDimension::FilletRadius),
        }
        v
    }

    /// The motion of a hole's wall, fading.
    fn add_wall_motion(&self, v: &mut [f64; 3], hole: usize, p: [f64; 2], motion: fn(&HoleWall, [f64; 2]) -> [f64; 2]) {
        let weight = self.hole_weight(hole, p);
        if weight > 0.0 {
            let [along, across] = motion(&self.walls[hole], p);
            v[0] = weight * along;
            v[self.b_axis] = weight * across;
        }
    }

    /// The motion of the sides of a dumb-bell of free gauge; a standard's does not change.
    fn add_gauge_motion(&self, v: &mut [f64; 3], p: [f64; 2], dimension: DumbbellDimension) {
        if let (Some(profile), Outline::Dumbbell(_)) = (self.profile, &self.specimen.outline) {
            self.add_side_motion(v, profile, p, dimension);
        }
    }

    /// The motion of a dumb-bell's sides, in proportion to the distance from the middle line, fading towards holes.
    fn add_side_motion(&self, v: &mut [f64; 3], profile: Profile, p: [f64; 2], dimension: DumbbellDimension) {
        let weight = self.outline_weight(p);
        let [along, across] = profile.rate(p[0], dimension);
        v[0] = weight * (p[0].signum() * along);
        v[self.b_axis] = weight * (p[1] / profile.half_width_mm(p[0]) * across);
    }

    /// 1 at the hole's wall, 0 at the outline, the other walls and (for holes off it) the mirror line.
    fn hole_weight(&self, hole: usize, p: [f64; 2]) -> f64 {
        let Some(h) = self.specimen.holes.get(hole) else { return 0.0 };
        if self.section_mirrored && h.center_mm[1] < -self.tolerance {
            return 0.0;
        }
        let own = self.hole_distance(hole, p);
        let mirror = (self.section_mirrored && !self.is_on_mirror(hole)).then_some(if p[1] < self.tolerance {
            0.0
        } else {
            p[1]
        });
        let others = (0..self.specimen.holes.len()).filter(|&i| i != hole).map(|i| self.hole_distance(i, p));
        let open_side = self.notches[hole].map(|notch| notch.side);
        let nearest = smooth_minimum(others.chain(mirror).chain([self.outline_distance(p, open_side)]));
        if nearest <= 0.0 { 0.0 } else { nearest / (nearest + own) }
    }

    fn is_on_mirror(&self, hole: usize) -> bool {
        let on_plane = |h: &crate::specimen::Hole| h.center_mm[1].abs() <= self.tolerance;
        self.section_mirrored && self.specimen.holes.get(hole).is_some_and(on_plane)
    }

    /// 1 on the outline, 0 on the holes' walls and at the mouths of notches.
    fn outline_weight(&self, p: [f64; 2]) -> f64 {
        let holes = smooth_minimum((0..self.specimen.holes.len()).map(|i| self.hole_distance(i, p)));
        if holes.is_infinite() {
            1.0
        } else if holes <= 0.0 {
            0.0
        } else {
            holes / (holes + self.outline_distance(p, None))
        }
    }

    /// The motion of the block's sides across an axis, in proportion to the distance from the middle, fading towards
    /// holes. Notches in them keep their centres.
    fn add_block_motion(&self, v: &mut [f64; 3], node: [f64; 3], p: [f64; 2], axis: usize) {
        let affine = 0.5 * node[axis] / self.half[axis];
        if axis == self.extrusion_axis {
            v[axis] = affine;
            return;
        }
        v[axis] = affine * self.outline_weight(p);
        let in_section = usize::from(axis == self.b_axis);
        for hole in 0..self.notches.len() {
            if let Some(notch) = self.notch(hole).filter(|notch| notch.notch.side.axis_and_sign().0 == in_section) {
                self.add_notch_motion(v, notch, p, NotchRates { side: 0.5, ..NotchRates::default() });
            }
        }
    }

    fn notch(&self, hole: usize) -> Option<NotchOf> {
        self.notches.get(hole).copied().flatten().map(|notch| NotchOf { hole, notch })
    }

    /// The motion of a notch's wall, fading. Across its side it vanishes on the side, along it it does not.
    fn add_notch_motion(&self, v: &mut [f64; 3], NotchOf { hole, notch }: NotchOf, p: [f64; 2], rates: NotchRates) {
        let weight = self.hole_weight(hole, p);
        if weight > 0.0 {
            let motion = notch.motion(p, rates);
            let (own, side) = (self.hole_distance(hole, p), self.side_distance(p, notch.side));
            // At the ends of the mouth both are zero, and the motion is right as it is.
            let across = if own > 0.0 { side / (side + own) } else { 1.0 };
            let (axis, _) = notch.side.axis_and_sign();
            let in_mesh = [0, self.b_axis];
            v[in_mesh[axis]] += weight * across * motion[axis];
            v[in_mesh[1 - axis]] += weight * motion[1 - axis];
        }
    }
}

/// (Σ d⁻⁴)^(−1/4): 0 if any distance is 0, infinite for none.
fn smooth_minimum(distances: impl Iterator<Item = f64>) -> f64 {
    let mut sum = 0.0;
    for d in distances {
        if d <= 0.0 {
            return 0.0;
        }
        sum += d.powi(-4);
    }
    if sum > 0.0 { sum.powf(-0.25) } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_specimens::{
        bar, changed, dumbbell, free_dumbbell, off_axis, solid, specimen, two_holes, width_holes,
    };
    use crate::mesh::{MeshOptions, mesh_specimen};
    use std::f64::consts::PI;

    fn volume_rate(specimen: &Specimen, variable: DesignVariable) -> (Mesh, f64) {
        let mesh = mesh_specimen(specimen, &MeshOptions::standard(specimen)).unwrap();
        let velocity = shape_velocity(&mesh, specimen, variable);
        let h = 1e-4;
        let (plus, minus) = (morphed(&mesh, &velocity, h), morphed(&mesh, &velocity, -h));
        let rate = (plus.volume() - minus.volume()) / (2.0 * h);
        (mesh, rate)
    }

    /// The morphed mesh passes the whole check of the changed specimen: walls are circles of the new size and place,
    /// outer faces are planes, node sets are complete, the volume is right.
    #[test]
    fn the_morphed_mesh_is_a_mesh_of_the_changed_specimen() {
        use DesignVariable::*;
        for specimen in [two_holes(), bar(), width_holes(), off_axis(), solid()] {
            let mut variables = vec![BlockLength, BlockThickness, BlockWidth];
            for i in 0..specimen.holes.len() {
                variables.extend([HoleX(i), HoleOther(i), HoleDiameter(i)]);
            }
            for force_prisms in [false, true] {
                let options = MeshOptions { force_prisms, ..MeshOptions::search(&specimen) };
                let mesh = mesh_specimen(&specimen, &options).unwrap();
                for &variable in &variables {
                    // Moving a hole off the mirror plane leaves no half to compare with.
                    let along_width = specimen.holes.first().is_some_and(|h| h.axis == HoleAxis::Width);
                    let section_mirrored = if along_width { mesh.mirror.y } else { mesh.mirror.z };
                    if section_mirrored && matches!(variable, HoleOther(_)) {
                        continue;
                    }
                    let step = 0.05;
                    let velocity = shape_velocity(&mesh, &specimen, variable);
                    let moved = morphed(&mesh, &velocity, step);
                    let result = moved.check(&changed(&specimen, variable, step));
                    assert!(result.is_ok(), "{variable:?} of {}: {result:?}", specimen.name);
                }
            }
        }
    }

    /// In a mirrored mesh a hole and its image move together.
    #[test]
    fn mirrored_pairs_move_together() {
        use crate::specimen::TestKind::{DoubleLapShear, Uniaxial};
        let holes = [[2.0, 4.5, 3.0], [2.0, -4.5, 3.0], [-5.0, 0.0, 4.0]];
        for (test, extents, axis, scale) in [
            (DoubleLapShear, [25.4, 6.4, 19.1], HoleAxis::Thickness, 1.0),
            (Uniaxial, [25.4, 12.0, 19.1], HoleAxis::Width, 0.6),
        ] {
            let holes = holes.map(|h| [h[0], h[1] * scale, h[2] * scale]);
            let s = specimen(test, extents, axis, &holes);
            let mesh = mesh_specimen(&s, &MeshOptions::standard(&s)).unwrap();
            assert!(if axis == HoleAxis::Width { mesh.mirror.y && mesh.mirror.z } else { mesh.mirror.z });
            for (first, second, sign) in [
                (DesignVariable::HoleX(0), DesignVariable::HoleX(1), 1.0),
                (DesignVariable::HoleOther(0), DesignVariable::HoleOther(1), -1.0),
                (DesignVariable::HoleDiameter(0), DesignVariable::HoleDiameter(1), 1.0),
            ] {
                let step = 0.1;
                let [v, w] = [first, second].map(|variable| shape_velocity(&mesh, &s, variable));
                let moved = morphed(&morphed(&mesh, &v, step), &w, sign * step);
                moved.check(&changed(&changed(&s, first, step), second, sign * step)).unwrap();
            }
            let odd = shape_velocity(&mesh, &s, DesignVariable::HoleOther(2));
            assert!(odd.iter().flatten().all(|v| *v == 0.0));
        }
    }

    #[test]
    fn volume_derivatives_are_the_closed_forms() {
        let s = two_holes();
        let [l, t, w] = [s.block.length_mm, s.block.thickness_mm, s.block.width_mm];
        let r = 0.5 * s.holes[0].diameter_mm;
        let section = l * w - 2.0 * PI * r * r;
        // (variable, derivative of half of the volume)
        for (variable, expected) in [
            (DesignVariable::HoleX(0), 0.0),
            (DesignVariable::HoleDiameter(1), -0.5 * PI * r * t),
            (DesignVariable::BlockLength, 0.5 * t * w),
            (DesignVariable::BlockThickness, 0.5 * section),
            (DesignVariable::BlockWidth, 0.5 * l * t),
        ] {
            let (_, rate) = volume_rate(&s, variable);
            // Quadratic arcs of 30° miss 1e-4 of a hole's area.
            assert!((rate - expected).abs() < 3e-4 * expected.abs() + 1e-6, "{variable:?}: {rate} {expected}");
        }
        let s = width_holes();
        let (_, rate) = volume_rate(&s, DesignVariable::HoleDiameter(1));
        let expected = -0.5 * PI * s.holes[1].diameter_mm * 0.5 * s.block.width_mm;
        assert!((rate - expected).abs() < 3e-4 * expected.abs());
    }

    /// The same of every dimension of a dumb-bell of free gauge, with and without a hole. Its sides follow to first
    /// order: a step of 0.5 µm per mm leaves them far within the check's tolerance.
    #[test]
    fn a_free_gauge_moves_its_sides() {
        use DesignVariable::*;
        let mut holed = free_dumbbell();
        holed.holes = bar().holes;
        holed.holes[0].diameter_mm = 3.0;
        for specimen in [free_dumbbell(), holed] {
            let mesh = mesh_specimen(&specimen, &MeshOptions::standard(&specimen)).unwrap();
            for variable in [BlockLength, BlockThickness, BlockWidth, GaugeWidth, GaugeLength, FilletRadius] {
                let step = 5e-4;
                let velocity = shape_velocity(&mesh, &specimen, variable);
                for step in [step, -step] {
                    let result = morphed(&mesh, &velocity, step).check(&changed(&specimen, variable, step));
                    assert!(result.is_ok(), "{variable:?} of {}: {result:?}", specimen.name);
                }
                let volume = |step: f64| morphed(&mesh, &velocity, step).volume();
                let rate = (volume(step) - volume(-step)) / (2.0 * step);
                let closed = |step: f64| changed(&specimen, variable, step).volume_mm3();
                // A quarter is meshed.
                let expected = 0.25 * (closed(step) - closed(-step)) / (2.0 * step);
                // Parabolas in place of arcs miss up to 1e-3 of the curved parts' share.
                assert!((rate - expected).abs() < 1e-3 * expected.abs(), "{variable:?}: {rate} {expected}");
            }
        }
        // Without a hole the moved mesh is, to first order, the mesh that the changed dumb-bell is given.
        let free = free_dumbbell();
        let options = MeshOptions::standard(&free);
        let mesh = mesh_specimen(&free, &options).unwrap();
        for variable in [BlockLength, BlockWidth, GaugeWidth, GaugeLength, FilletRadius] {
            let velocity = shape_velocity(&mesh, &free, variable);
            let farthest = |step: f64| {
                let moved = morphed(&mesh, &velocity, step);
                let meshed = mesh_specimen(&changed(&free, variable, step), &options).unwrap();
                assert_eq!(moved.connectivity, meshed.connectivity);
                let apart = moved.nodes.iter().flatten().zip(meshed.nodes.iter().flatten());
                apart.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
            };
            let [large, small] = [1e-2, 5e-3].map(farthest);
            assert!(large < 1e-4 && (large < 1e-12 || large / small > 3.5), "{variable:?}: {large:e} {small:e}");
        }
        let standard = dumbbell();
        let mesh = mesh_specimen(&standard, &MeshOptions::standard(&standard)).unwrap();
        for variable in [GaugeWidth, GaugeLength, FilletRadius] {
            assert!(shape_velocity(&mesh, &standard, variable).iter().flatten().all(|v| *v == 0.0));
        }
    }

    #[test]
    fn a_dumbbell_keeps_its_outline() {
        let s = dumbbell();
        let mesh = mesh_specimen(&s, &MeshOptions::standard(&s)).unwrap();
        let velocity = shape_velocity(&mesh, &s, DesignVariable::BlockLength);
        let moved = morphed(&mesh, &velocity, 0.5);
        moved.check(&changed(&s, DesignVariable::BlockLength, 0.5)).unwrap();
        assert!(shape_velocity(&mesh, &s, DesignVariable::BlockWidth).iter().flatten().all(|v| *v == 0.0));
        assert!(shape_velocity(&mesh, &s, DesignVariable::HoleX(3)).iter().flatten().all(|v| *v == 0.0));
    }
}
