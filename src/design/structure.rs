//! The discrete choices of a search: kind of test, direction, outline and symmetry orbits of the holes.
//!
//! Holes come in orbits under the study's mirrors: a hole on a mirror plane is its own image, others bring theirs
//! along.

use super::study::Study;
use crate::specimen::{HoleAxis, HoleKind, Symmetry, TestKind};

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
            for orbits in orbit_lists(&of_circles, study.vary.hole_count.min, max_holes) {
                let is_solid = orbits.is_empty();
                if is_solid && std::mem::replace(&mut has_solid, true) {
                    continue;
                }
                let kinds = if is_solid { &hole_kinds[..1] } else { &hole_kinds[..] };
                let of_kind = |&hole_kind: &_| Structure { hole_kind, orbits: orbits.clone(), ..of_circles.clone() };
                all.extend(kinds.iter().map(of_kind));
            }
        }
    }
    all.sort_by_key(Structure::num_holes);
    all
}

/// Lists of orbits with a number of holes within limits.
fn orbit_lists(empty: &Structure, min_holes: usize, max_holes: usize) -> Vec<Vec<Orbit>> {
    let kinds = if empty.is_point_symmetric {
        [false, true].map(|is_central| Orbit { on_x: is_central, on_other: is_central }).to_vec()
    } else {
        orbit_kinds(empty.mirrors)
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
            let is_repeated_centre = kind.on_x && kind.on_other && list.last() == Some(kind);
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
