//! Closed forms of a specimen's geometry: section, outline, containment, ligaments, mirrors, volume.

use super::dumbbell::Profile;
use super::hole_gap::largest_between;
use super::ligament::{Ligament, LigamentKind, SectionEdge};
use super::{HoleAxis, HoleWall, Specimen, TestKind};
use std::f64::consts::TAU;

/// How far a hole may lie from its partner's mirror image, in place and in diameter, for the specimen to count
/// as symmetric, mm. Far below any mould's accuracy, far above rounding.
pub const MIRROR_TOLERANCE_MM: f64 = 1e-6;
/// Points of an ellipse or a slot at which its distance from a dumb-bell's curved side is looked at first.
const WALL_POINTS: usize = 128;

impl Specimen {
    /// The side of a dumb-bell; `None` of a block.
    pub fn profile(&self) -> Option<Profile> {
        let whole_mm = [self.block.length_mm, self.block.width_mm];
        self.outline.dumbbell().map(|dumbbell| Profile::new(&dumbbell, whole_mm))
    }

    /// Half the extent along z at `x_mm`, mm: width/2 of a block, the profile of a dumb-bell.
    pub fn half_width_mm(&self, x_mm: f64) -> f64 {
        self.profile().map_or(0.5 * self.block.width_mm, |profile| profile.half_width_mm(x_mm))
    }

    /// Half the extent along y at `x_mm`, mm: thickness/2, times g(x) of a wedge.
    pub fn half_gap_mm(&self, x_mm: f64) -> f64 {
        self.block.taper().raised([x_mm, 0.5 * self.block.thickness_mm, 0.0])[1]
    }

    /// Whether a reference position (x, y, z), mm, lies in the material, boundary included.
    pub fn contains(&self, position: [f64; 3]) -> bool {
        let [x, y, z] = position;
        let is_in_outline =
            x.abs() <= 0.5 * self.block.length_mm && y.abs() <= self.half_gap_mm(x) && z.abs() <= self.half_width_mm(x);
        is_in_outline
            && self.holes.iter().all(|hole| {
                let lateral = match hole.axis {
                    HoleAxis::Thickness => z,
                    HoleAxis::Width => y,
                };
                hole.wall().distance_mm([x, lateral]) >= 0.0
            })
    }

    /// The holes' common axis; `None` without holes.
    pub fn hole_axis(&self) -> Option<HoleAxis> {
        self.holes.first().map(|hole| hole.axis)
    }

    /// Direction of extrusion: the holes' axis, the thickness without holes.
    pub fn extrusion_axis(&self) -> HoleAxis {
        self.hole_axis().unwrap_or(HoleAxis::Thickness)
    }

    /// Extents of the section along x and along the lateral direction, mm: (length, width) for holes along the
    /// thickness and without holes, (length, thickness) for holes along the width.
    pub fn section_size(&self) -> [f64; 2] {
        self.extrusion_axis().section_of(&self.block)
    }

    /// Extent across the section, mm.
    pub fn extrusion_mm(&self) -> f64 {
        match self.extrusion_axis() {
            HoleAxis::Thickness => self.block.thickness_mm,
            HoleAxis::Width => self.block.width_mm,
        }
    }

    /// Whether loads and geometry are symmetric under y → −y. Only a uniaxial test is; a bar that is pushed together
    /// may bend all the same.
    pub fn is_mirror_y(&self) -> bool {
        self.test == TestKind::Uniaxial && self.mirror_defect_mm([1.0, -1.0, 1.0]) <= MIRROR_TOLERANCE_MM
    }

    /// Whether loads and geometry are symmetric under z → −z: a drive at an angle is not.
    pub fn is_mirror_z(&self) -> bool {
        self.is_driven_along_x() && self.mirror_defect_mm([1.0, 1.0, -1.0]) <= MIRROR_TOLERANCE_MM
    }

    /// Whether the geometry alone is symmetric under x → −x. The loads never are.
    pub fn is_geometry_mirror_x(&self) -> bool {
        self.mirror_defect_mm([-1.0, 1.0, 1.0]) <= MIRROR_TOLERANCE_MM
    }

    /// How far the block and its holes are from being symmetric under (x, y, z) → (s₀x, s₁y, s₂z) with signs s, mm:
    /// the largest of the least differences (distance of centres plus difference of diameters and outlines) between the
    /// mirror image of a hole and a hole, and where x changes its sign the wedge. Zero without holes in an even block.
    pub fn mirror_defect_mm(&self, signs: [f64; 3]) -> f64 {
        let defect_of = |hole: &super::Hole| {
            let lateral_sign = if hole.axis == HoleAxis::Thickness { signs[2] } else { signs[1] };
            let image = hole.mirrored([signs[0], lateral_sign]);
            let others = self.holes.iter().filter(|other| other.axis == hole.axis);
            others.map(|other| other.difference_mm(&image)).fold(f64::INFINITY, f64::min)
        };
        let of_block = if signs[0] < 0.0 { self.block.wedge_mm.abs() } else { 0.0 };
        self.holes.iter().map(defect_of).fold(of_block, f64::max)
    }

    /// Volume of one sample (of the first kind), mm³: area of the outline less the holes', times the extrusion; of a
    /// wedge the thickness times the integral of g over that area, to which the block itself adds no first moment.
    pub fn volume_mm3(&self) -> f64 {
        let [length, lateral] = self.section_size();
        let outline_area = self.profile().map_or(length * lateral, |profile| profile.area_mm2());
        let hole_area: f64 = self.holes.iter().map(|hole| self.hole_area_mm2(hole)).sum();
        let taper = self.block.taper();
        let slanted = if taper.is_even() {
            0.0
        } else {
            taper.slope_per_mm() * self.holes.iter().map(|hole| self.hole_moment_x_mm3(hole)).sum::<f64>()
        };
        (outline_area - hole_area - slanted) * self.extrusion_mm()
    }

    /// Every ligament: each hole to each of the four sides (but a notch to its own), and each pair of holes. In the
    /// order of the holes.
    pub fn ligaments(&self) -> Vec<Ligament> {
        let mut ligaments = Vec::with_capacity(self.holes.len() * (self.holes.len() + 7) / 2);
        for (i, hole) in self.holes.iter().enumerate() {
            let wall = hole.wall();
            let open_side = self.notch_of(hole).map(|notch| notch.side);
            for edge in SectionEdge::ALL.into_iter().filter(|edge| Some(*edge) != open_side) {
                let (length_mm, direction) = self.wall_to_edge(&wall, edge);
                ligaments.push(Ligament { kind: LigamentKind::HoleEdge(i, edge), length_mm, direction });
            }
            for (j, other) in self.holes.iter().enumerate().skip(i + 1) {
                let (length_mm, direction) = wall.gap_mm(&other.wall());
                ligaments.push(Ligament { kind: LigamentKind::HoleHole(i, j), length_mm, direction });
            }
        }
        ligaments
    }

    /// Material between a hole's wall and a side, mm (negative where the hole reaches beyond it), and the unit vector
    /// along which it is measured. Exact but for ellipses and slots beside the curved side of a dumb-bell, where the
    /// nearest of many points of the wall is sought.
    fn wall_to_edge(&self, wall: &HoleWall, edge: SectionEdge) -> (f64, [f64; 2]) {
        let (distance, direction) = self.distance_to_edge(wall.center_mm(), edge);
        let is_end = matches!(edge, SectionEdge::MinusX | SectionEdge::PlusX);
        let is_straight = is_end || self.outline.dumbbell().is_none();
        if wall.is_circle() || is_straight {
            return (distance - wall.reach_mm(direction), direction);
        }
        let at = |parameter: f64| self.distance_to_edge(wall.point_at(parameter), edge);
        let step = TAU / WALL_POINTS as f64;
        let depth = |parameter: f64| -at(parameter).0;
        let nearest = (0..WALL_POINTS).map(|i| step * i as f64).max_by(|p, q| depth(*p).total_cmp(&depth(*q)));
        let middle = nearest.unwrap_or(0.0);
        at(largest_between(&depth, middle - step, middle + step))
    }

    /// Signed distance (positive inside) from a point of the section to a side, mm, and the unit vector to it.
    fn distance_to_edge(&self, point: [f64; 2], edge: SectionEdge) -> (f64, [f64; 2]) {
        let [length, lateral] = self.section_size();
        match (edge, self.profile()) {
            (SectionEdge::MinusX, _) => (0.5 * length + point[0], [-1.0, 0.0]),
            (SectionEdge::PlusX, _) => (0.5 * length - point[0], [1.0, 0.0]),
            (SectionEdge::MinusLateral, None) => (0.5 * lateral + point[1], [0.0, -1.0]),
            (SectionEdge::PlusLateral, None) => (0.5 * lateral - point[1], [0.0, 1.0]),
            (SectionEdge::PlusLateral, Some(profile)) => profile.distance_to_upper_side(point),
            (SectionEdge::MinusLateral, Some(profile)) => {
                let (distance, direction) = profile.distance_to_upper_side([point[0], -point[1]]);
                (distance, [direction[0], -direction[1]])
            }
        }
    }
}
