//! The discrete choices of a search: kind of test, direction, outline and symmetry orbits of the holes.
//!
//! Holes come in orbits under the study's mirrors: a hole on a mirror plane is its own image, others bring theirs
//! along. Notches have their centres on the sides that they open to.

use super::study::{NotchedSide, Study};
use crate::specimen::{HoleAxis, HoleKind, Symmetry, TestKind};

/// One orbit of holes: which of its two coordinates are held at zero by lying on a mirror.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Orbit {
    /// x = 0.
    pub on_x: bool,
    /// Other coordinate = 0.
    pub on_other: bool,
    /// The sides that its holes open to, where they are notches.
    pub notched: Option<NotchedSide>,
}

impl Orbit {
    /// Whether a coordinate (0: x, 1: the other) is that of the side that the orbit opens to.
    pub(super) fn is_on_side(self, coordinate: usize) -> bool {
        self.notched.is_some_and(|side| side.axis() == coordinate)
    }
}

/// A discrete choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// Kind of test.
    pub test: TestKind,
    /// Direction of the holes.
    pub axis: HoleAxis,
    /// Outline of the holes where they are not circles.
    pub hole_kind: Option<HoleKind>,
    /// Orbits, sorted.
    pub orbits: Vec<Orbit>,
    pub(super) mirrors: [bool; 2],
    /// Whether holes come in pairs through the centre of the section; then no mirror acts.
    pub(super) is_point_symmetric: bool,
}

impl Structure {
    /// Number of holes.
    pub fn num_holes(&self) -> usize {
        self.orbits.iter().map(|o| self.num_images(*o)).sum()
    }

    /// Outline of the holes of an orbit where they are not circles; notches are.
    pub(super) fn kind_of(&self, orbit: Orbit) -> Option<HoleKind> {
        self.hole_kind.filter(|_| orbit.notched.is_none())
    }

    pub(super) fn num_images(&self, orbit: Orbit) -> usize {
        self.image_signs(orbit).len()
    }

    /// Signs of the images of an orbit, its own first.
    pub(super) fn image_signs(&self, orbit: Orbit) -> Vec<[f64; 2]> {
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

    /// Whether a mirror leaves a hole of the orbit only two angles: along it and across it.
    pub(super) fn holds_upright(&self, orbit: Orbit) -> bool {
        !self.is_point_symmetric && (self.mirrors[0] && orbit.on_x || self.mirrors[1] && orbit.on_other)
    }
}

/// All structures of a study, fewest holes first; the solid one of a test once.
pub(super) fn structures(study: &Study) -> Vec<Structure> {
    let max_holes = study.limits.max_holes.unwrap_or(usize::MAX).min(study.vary.hole_count.max);
    let others = study.vary.hole_shapes.iter().flat_map(|shapes| shapes.kinds.iter().copied().map(Some));
    let hole_kinds: Vec<Option<HoleKind>> = std::iter::once(None).chain(others).collect();
    let mut all = Vec::new();
    for test in study.tests() {
        let mut has_solid = false;
        for axis in study.axes() {
            let mirrors = mirrors_of(study.limits.symmetry, axis);
            let is_point_symmetric = study.limits.symmetry == Symmetry::Point;
            let of_circles = Structure { test, axis, hole_kind: None, orbits: Vec::new(), mirrors, is_point_symmetric };
            let sides = notched_sides(study, &of_circles);
            for orbits in orbit_lists(&of_circles, &sides, study.vary.hole_count.min, max_holes) {
                let is_solid = orbits.is_empty();
                if is_solid && std::mem::replace(&mut has_solid, true) {
                    continue;
                }
                // Notches are round.
                let is_round = orbits.iter().all(|orbit| orbit.notched.is_some());
                let kinds = if is_round { &hole_kinds[..1] } else { &hole_kinds[..] };
                let of_kind = |&hole_kind: &_| Structure { hole_kind, orbits: orbits.clone(), ..of_circles.clone() };
                all.extend(kinds.iter().map(of_kind));
            }
        }
    }
    all.sort_by_key(Structure::num_holes);
    all
}

/// Lists of orbits with a number of holes within limits.
fn orbit_lists(empty: &Structure, notched: &[NotchedSide], min_holes: usize, max_holes: usize) -> Vec<Vec<Orbit>> {
    let kinds = if empty.is_point_symmetric {
        [false, true].map(|is_central| Orbit { on_x: is_central, on_other: is_central, notched: None }).to_vec()
    } else {
        orbit_kinds(empty.mirrors, notched)
    };
    let mut stack = vec![Vec::new()];
    let mut lists: Vec<Vec<Orbit>> = Vec::new();
    while let Some(list) = stack.pop() {
        let num_holes = Structure { orbits: list.clone(), ..empty.clone() }.num_holes();
        if num_holes > max_holes {
            continue;
        }
        if num_holes >= min_holes {
            lists.push(list.clone());
        }
        for kind in &kinds {
            // Sorted lists only: the order of orbits does not matter. One centre holds one hole.
            let is_fixed = (0..2).all(|c| [kind.on_x, kind.on_other][c] || kind.is_on_side(c));
            let is_repeated_centre = is_fixed && list.last() == Some(kind);
            if list.last().is_none_or(|last| last <= kind) && !is_repeated_centre {
                let mut longer = list.clone();
                longer.push(*kind);
                stack.push(longer);
            }
        }
    }
    lists
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

fn orbit_kinds(mirrors: [bool; 2], notched: &[NotchedSide]) -> Vec<Orbit> {
    let choices = |mirror: bool| if mirror { vec![false, true] } else { vec![false] };
    let mut kinds = Vec::new();
    for on_x in choices(mirrors[0]) {
        for on_other in choices(mirrors[1]) {
            let hole = Orbit { on_x, on_other, notched: None };
            kinds.push(hole);
            let notches = notched.iter().map(|side| Orbit { notched: Some(*side), ..hole });
            kinds.extend(notches.filter(|orbit| !(on_x && orbit.is_on_side(0) || on_other && orbit.is_on_side(1))));
        }
    }
    kinds.sort();
    kinds
}

/// Whether any structure of a study, whatever its number of holes, may have notches.
pub(super) fn can_be_notched(study: &Study) -> bool {
    let axes = study.axes();
    study.tests().into_iter().any(|test| {
        let may = |axis: &HoleAxis| {
            let mirrors = mirrors_of(study.limits.symmetry, *axis);
            let (orbits, is_point_symmetric) = (Vec::new(), study.limits.symmetry == Symmetry::Point);
            let empty = Structure { test, axis: *axis, hole_kind: None, orbits, mirrors, is_point_symmetric };
            !notched_sides(study, &empty).is_empty()
        };
        axes.iter().any(may)
    })
}

/// The sides in which a structure may have notches: free ones, of which the mirror takes one to the other.
fn notched_sides(study: &Study, structure: &Structure) -> Vec<NotchedSide> {
    let is_free = |side: NotchedSide| match structure.test {
        TestKind::Uniaxial => side == NotchedSide::Sides,
        TestKind::DoubleLapShear => side == NotchedSide::Ends || structure.axis == HoleAxis::Thickness,
    };
    let sides = study.vary.notches.iter().copied();
    sides.filter(|side| is_free(*side) && structure.mirrors[side.axis()]).collect()
}
