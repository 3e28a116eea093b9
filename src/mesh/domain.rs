//! The specimen reduced to what a mesher needs: a checked section, its holes, mirror planes and gradings.

use super::Mirror;
use super::error::{LigamentEnd, MeshError};
use super::options::{MeshOptions, in_range};
use crate::specimen::dumbbell::{ISO37_WIDTH_MM, Profile};
use crate::specimen::{HoleAxis, HoleWall, Notch, Outline, SectionEdge, Specimen, Taper, TestKind};

/// Lengths outside this range, mm, are refused: they are certainly errors of unit.
const LENGTH_RANGE_MM: [f64; 2] = [1e-3, 1e5];
/// Ligaments below this fraction of the smaller hole's diameter are not meshed.
const MIN_LIGAMENT_RATIO: f64 = 0.02;
/// A layer along a free side takes no more than this part of what the closest hole leaves there.
const LAYER_OF_ROOM: f64 = 0.4;
/// Points of an ellipse or a slot at which its distance from a dumb-bell's outline is looked at.
const WALL_POINTS: usize = 96;
/// Two positions closer than this fraction of the block's size are the same.
pub(super) const COINCIDENT: f64 = 1e-9;

/// A hole in section coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct SectionHole {
    pub wall: HoleWall,
    /// Index in the specimen.
    pub index: usize,
    /// Centred on the section's mirror line, which cuts it in half.
    pub is_half: bool,
    /// How a side of the section cuts it open, if it does.
    pub notch: Option<Notch>,
}

impl SectionHole {
    pub fn center(&self) -> [f64; 2] {
        self.wall.center_mm()
    }

    /// Area that it takes away from the meshed part of the section, mm².
    fn area_mm2(&self) -> f64 {
        let whole = self.notch.map_or_else(|| self.wall.area_mm2(), |notch| notch.area_mm2());
        if self.is_half { 0.5 * whole } else { whole }
    }

    /// Extent across, the diameter of a circle.
    fn width(&self) -> f64 {
        2.0 * self.wall.half_mm()[1]
    }

    /// How far `k` radii reach from the centre along an axis; of a hole that is no circle its extent and `k` − 1 radii
    /// of the circle of the same area.
    pub fn reach_of_radii(&self, axis: usize, k: f64) -> f64 {
        let radius = self.wall.mean_radius_mm();
        if self.wall.is_circle() { k * radius } else { self.wall.half_extents_mm()[axis] + (k - 1.0) * radius }
    }

    /// The radius of the circle that stands for the hole in a power diagram: half of its extent across (`weight` 0),
    /// half of that along it (1), or between them.
    pub fn power_radius(&self, weight: f64) -> f64 {
        let [a, b] = self.wall.half_mm();
        if self.wall.is_circle() { b } else { a.powf(weight) * b.powf(1.0 - weight) }
    }
}

/// The section [−half₀, half₀] × [bottom, half₁] (coordinates a = x and b = z or y) with its holes, and its extrusion.
#[derive(Clone, Debug)]
pub(super) struct Domain {
    pub half: [f64; 2],
    /// −half₁, or 0 if the section is mirrored at b = 0.
    pub bottom: f64,
    /// Half extents of what the layers along free sides enclose; where there is no layer, those of the section and of
    /// its extrusion.
    pub inner_half: [f64; 2],
    pub inner_extrusion_half: f64,
    /// The side of a dumb-bell; none of a block.
    pub profile: Option<Profile>,
    pub holes: Vec<SectionHole>,
    /// Straight lines inside the section that element edges follow; each may end on the outline.
    pub lines: Vec<[[f64; 2]; 2]>,
    /// Coordinate index of b: 2 (z) or 1 (y).
    pub b_axis: usize,
    /// Coordinate index of the extrusion: 1 (y) or 2 (z).
    pub extrusion_axis: usize,
    pub extrusion_half: f64,
    pub extrusion_mirrored: bool,
    /// How far the extrusion reaches along x, relative to the middle.
    pub taper: Taper,
    pub mirror: Mirror,
    pub test: TestKind,
    /// Size ratio at a = ±half₀, at b = ±half₁, at the hole walls and at the ends of the extrusion; 1 = not graded.
    pub grading: Grading,
}

/// See [`Domain::grading`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Grading {
    pub ends: f64,
    pub sides: f64,
    pub holes: f64,
    pub extrusion: f64,
}

impl Domain {
    /// Checks `specimen` and `options` and finds the mirror planes.
    pub fn new(specimen: &Specimen, options: &MeshOptions) -> Result<Self, MeshError> {
        if !specimen.other_samples.is_empty() {
            return Err(MeshError::UnlikeSamples { count: specimen.other_samples.len() + 1 });
        }
        let block = &specimen.block;
        let [low, high] = LENGTH_RANGE_MM;
        in_range("length_mm", block.length_mm, low, high)?;
        in_range("thickness_mm", block.thickness_mm, low, high)?;
        in_range("width_mm", block.width_mm, low, high)?;
        options.validate()?;
        for (hole, h) in specimen.holes.iter().enumerate() {
            let finite = h.center_mm.iter().all(|c| c.is_finite() && c.abs() < high);
            let is_long = h.length_mm() >= h.diameter_mm && h.length_mm() < high;
            let is_turned = h.shape.is_none_or(|shape| shape.angle_deg.is_finite());
            if !(finite && h.diameter_mm > 0.0 && h.diameter_mm < high && is_long && is_turned) {
                return Err(MeshError::InvalidHole { hole, center_mm: h.center_mm, diameter_mm: h.diameter_mm });
            }
            if let Some(problem) = specimen.notch_problem(h) {
                return Err(MeshError::BadNotch { hole, problem });
            }
            if h.axis != specimen.holes[0].axis {
                return Err(MeshError::MixedHoleAxes { hole });
            }
        }
        let along_width = specimen.holes.first().is_some_and(|h| h.axis == HoleAxis::Width);
        check_wedge(specimen, along_width)?;
        check_dumbbell(specimen)?;
        let profile = specimen.profile();
        if profile.is_some() && along_width {
            return Err(MeshError::UnsupportedHoleAxis { hole: 0 });
        }
        let (b_axis, extrusion_axis) = if along_width { (1, 2) } else { (2, 1) };
        let extents = [block.length_mm, block.thickness_mm, block.width_mm];
        let scale = extents.iter().fold(0.0f64, |a, &b| a.max(b));
        let mut holes: Vec<SectionHole> = specimen
            .holes
            .iter()
            .enumerate()
            .map(|(index, h)| SectionHole { wall: h.wall(), index, is_half: false, notch: specimen.notch_of(h) })
            .collect();

        let uniaxial = specimen.test == TestKind::Uniaxial;
        let holes_symmetric = specimen.holes.iter().all(|h| {
            let image = h.mirrored([1.0, -1.0]);
            specimen.holes.iter().any(|other| other.difference_mm(&image) < COINCIDENT * scale)
        });
        // Where plates move along x, the section is mirrored in b and the extrusion in its own axis. y = 0 is no mirror
        // plane in shear: one plate moves, the other does not. A bar that is pushed together may buckle to a side,
        // which a half or a quarter of it could not.
        let use_mirror = options.use_mirror && !specimen.is_compressed();
        let may = |axis: usize| use_mirror && if axis == 2 { specimen.is_driven_along_x() } else { uniaxial };
        let section_mirrored = may(b_axis) && holes_symmetric;
        let extrusion_mirrored = may(extrusion_axis);
        let is_mirrored = |axis| if axis == b_axis { section_mirrored } else { extrusion_mirrored };

        let domain_half = [0.5 * extents[0], 0.5 * extents[b_axis]];
        let shear = !uniaxial;
        let ratio = options.grading;
        let domain = Domain {
            half: domain_half,
            inner_half: domain_half,
            inner_extrusion_half: 0.5 * extents[extrusion_axis],
            bottom: if section_mirrored { 0.0 } else { -domain_half[1] },
            profile,
            holes: Vec::new(),
            lines: Vec::new(),
            b_axis,
            extrusion_axis,
            extrusion_half: 0.5 * extents[extrusion_axis],
            extrusion_mirrored,
            taper: block.taper(),
            mirror: Mirror { y: is_mirrored(1), z: is_mirrored(2) },
            test: specimen.test,
            // In shear every edge of the block and of a hole through the plates is singular. In tension the grips'
            // edges are; the free faces and the hole walls carry smooth fields.
            grading: Grading {
                ends: ratio,
                sides: if shear { ratio } else { 1.0 },
                holes: if shear && !along_width { ratio } else { ratio.sqrt() },
                extrusion: if shear { ratio } else { 1.0 },
            },
        };
        domain.check_ligaments(&holes)?;
        let mut domain = domain;
        if section_mirrored {
            holes.retain(|d| d.center()[1] > -COINCIDENT * scale);
            for d in &mut holes {
                if d.center()[1] < COINCIDENT * scale {
                    d.wall = d.wall.moved_to([d.center()[0], 0.0]);
                    d.notch = d.notch.map(|notch| Notch { center_mm: [notch.center_mm[0], 0.0], ..notch });
                    d.is_half = true;
                }
            }
        }
        domain.holes = holes;
        if shear && profile.is_none() {
            domain.add_layers(options.free_layer_mm);
        }
        Ok(domain)
    }

    /// Lays layers along the free sides of a sheared block, of a depth in mm, or of a part of what holes leave there.
    fn add_layers(&mut self, depth_mm: f64) {
        let reach = |hole: &SectionHole, c: usize| hole.center()[c].abs() + hole.wall.half_extents_mm()[c];
        let room = |c: usize| self.half[c] - self.holes.iter().map(|hole| reach(hole, c)).fold(0.0, f64::max);
        let [along, across] = [0, 1].map(|c| depth_mm.min(LAYER_OF_ROOM * room(c)));
        // A graded side keeps the lesser half of its grading, in logarithms: the layer is the finest.
        let lay = |inner: &mut f64, ratio: &mut f64, depth: f64| {
            if depth > 0.0 {
                *inner -= depth;
                *ratio = ratio.sqrt();
            }
        };
        lay(&mut self.inner_half[0], &mut self.grading.ends, along);
        // The plates lie at y = ±half, the free sides at z = ±half.
        if self.b_axis == 2 {
            lay(&mut self.inner_half[1], &mut self.grading.sides, across);
        } else {
            let depth = depth_mm.min(LAYER_OF_ROOM * self.extrusion_half);
            lay(&mut self.inner_extrusion_half, &mut self.grading.extrusion, depth);
        }
    }

    /// Lower bound of b of what the layers enclose.
    pub fn inner_bottom(&self) -> f64 {
        if self.bottom < 0.0 { -self.inner_half[1] } else { self.bottom }
    }

    /// Half-width of the section's outline at `a`.
    pub fn half_width(&self, a: f64) -> f64 {
        self.profile.map_or(self.half[1], |profile| profile.half_width_mm(a))
    }

    /// Largest extent of the section.
    pub fn scale(&self) -> f64 {
        self.half[0].max(self.half[1]) * 2.0
    }

    /// Signed distance from a point inside the section to its outline (mirror line not counted); exact for the block,
    /// and the distance to the nearest sampled outline point for the dumb-bell.
    pub fn outline_distance(&self, p: [f64; 2]) -> f64 {
        let ends = self.half[0] - p[0].abs();
        if self.profile.is_none() {
            return ends.min(self.half[1] - p[1].abs());
        }
        let inside = self.half_width(p[0]) - p[1].abs();
        // The outline is at most as far as straight up; search that reach for a nearer point.
        let reach = inside.abs();
        let mut nearest = reach;
        for i in -20..=20 {
            let a = (p[0] + reach * f64::from(i) / 20.0).clamp(-self.half[0], self.half[0]);
            nearest = nearest.min((a - p[0]).hypot(self.half_width(a) - p[1].abs()));
        }
        ends.min(if inside < 0.0 { -nearest } else { nearest })
    }

    /// Material between a hole's wall and the outline: exact in a block, by points of the wall in a dumb-bell.
    fn wall_to_outline(&self, wall: &HoleWall) -> f64 {
        let center = wall.center_mm();
        if wall.is_circle() {
            return self.outline_distance(center) - wall.half_mm()[1];
        }
        if self.profile.is_none() {
            let reach = wall.half_extents_mm();
            return (0..2).map(|c| self.half[c] - center[c].abs() - reach[c]).fold(f64::INFINITY, f64::min);
        }
        let at = |i: usize| wall.point_at(std::f64::consts::TAU * i as f64 / WALL_POINTS as f64);
        (0..WALL_POINTS).map(|i| self.outline_distance(at(i))).fold(f64::INFINITY, f64::min)
    }

    /// Distance from a point inside the section to the sides of a block but one (mirror line not counted), mm.
    pub fn distance_to_other_sides(&self, p: [f64; 2], side: SectionEdge) -> f64 {
        let others = SectionEdge::ALL.into_iter().filter(|other| *other != side);
        let to = |edge: SectionEdge| {
            let (axis, sign) = edge.axis_and_sign();
            self.half[axis] - sign * p[axis]
        };
        others.map(to).fold(f64::INFINITY, f64::min)
    }

    fn check_ligaments(&self, holes: &[SectionHole]) -> Result<(), MeshError> {
        for (i, d) in holes.iter().enumerate() {
            let to_outline = match d.notch {
                None => self.wall_to_outline(&d.wall),
                Some(notch) => self.distance_to_other_sides(d.center(), notch.side) - notch.radius_mm,
            };
            let check = |to, length_mm: f64, limit_mm: f64| {
                if length_mm >= limit_mm {
                    return Ok(());
                }
                Err(MeshError::LigamentTooThin { from: LigamentEnd::Hole(d.index), to, length_mm, limit_mm })
            };
            check(LigamentEnd::Outline, to_outline, MIN_LIGAMENT_RATIO * d.width())?;
            for e in &holes[i + 1..] {
                let limit = MIN_LIGAMENT_RATIO * d.width().min(e.width());
                check(LigamentEnd::Hole(e.index), d.wall.gap_mm(&e.wall).0, limit)?;
            }
        }
        Ok(())
    }

    /// Volume of the meshed part, mm³, in closed form: depth × ∫ g dA. Of a wedge the section is mirrored in b alone,
    /// so that the outline adds no first moment along x.
    pub fn volume(&self) -> f64 {
        let moment_x = |hole: &SectionHole| {
            let whole = hole.area_mm2() * hole.center()[0];
            hole.notch.map_or(whole, |n| if hole.is_half { 0.5 * n.moment_x_mm3() } else { n.moment_x_mm3() })
        };
        let slanted = if self.taper.is_even() {
            0.0
        } else {
            self.taper.slope_per_mm() * self.holes.iter().map(moment_x).sum::<f64>()
        };
        (self.area() - slanted) * self.depth()
    }

    /// Area of the meshed part of the section, mm², in closed form.
    pub fn area(&self) -> f64 {
        let [a, b] = self.half;
        let whole = self.profile.map_or(4.0 * a * b, |profile| profile.area_mm2());
        let mirrored = self.bottom > -self.half[1];
        let holes: f64 = self.holes.iter().map(SectionHole::area_mm2).sum();
        whole * if mirrored { 0.5 } else { 1.0 } - holes
    }

    /// Extent of the meshed part along the extrusion, mm; of a wedge that in the middle.
    pub fn depth(&self) -> f64 {
        self.extrusion_half * if self.extrusion_mirrored { 1.0 } else { 2.0 }
    }

    /// The same where it is largest, mm.
    pub fn thickest(&self) -> f64 {
        self.depth() * (1.0 + self.taper.slope_per_mm().abs() * self.half[0])
    }
}

/// Whether the block is even, or a wedge that is extruded between its bonded faces.
fn check_wedge(specimen: &Specimen, along_width: bool) -> Result<(), MeshError> {
    let value_mm = specimen.block.wedge_mm;
    let is_even = value_mm.is_finite() && specimen.block.taper().is_even();
    let is_meshed = specimen.test == TestKind::DoubleLapShear && specimen.outline == Outline::Block && !along_width;
    if is_even || (is_meshed && specimen.block.thinnest_mm() > 0.0) {
        return Ok(());
    }
    Err(MeshError::UnsupportedWedge { value_mm, thickness_mm: specimen.block.thickness_mm })
}

/// Whether a specimen's dumb-bell can be drawn.
fn check_dumbbell(specimen: &Specimen) -> Result<(), MeshError> {
    let Some(dumbbell) = specimen.outline.dumbbell() else { return Ok(()) };
    let (value_mm, standard_mm) = (specimen.block.width_mm, ISO37_WIDTH_MM);
    if specimen.outline == Outline::Iso37Type4 && (value_mm - standard_mm).abs() > 1e-6 * standard_mm {
        let (name, relation) = ("width_mm", "equal to");
        return Err(MeshError::OutlineMismatch { name, value_mm, relation, limit_mm: standard_mm });
    }
    match dumbbell.misfits([specimen.block.length_mm, specimen.block.width_mm]).into_iter().next() {
        None => Ok(()),
        Some(misfit) => {
            let (name, value_mm) = (misfit.dimension.name(), misfit.value_mm);
            let is_above = value_mm > misfit.max_mm;
            let (relation, limit_mm) = if is_above { ("at most", misfit.max_mm) } else { ("at least", misfit.min_mm) };
            Err(MeshError::OutlineMismatch { name, value_mm, relation, limit_mm })
        }
    }
}
