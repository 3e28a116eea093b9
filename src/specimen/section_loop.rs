//! The boundary of a specimen's section as exact curves: lines, circular arcs and halves of ellipses.
//!
//! Section coordinates are (x, lateral): z where the specimen is extruded along its thickness, y where along its width.

use super::dumbbell::Profile;
use super::{Block, HoleWall, Notch, SectionEdge, Specimen};

/// Straight parts of a slot and differences of an ellipse's axes below this are none, mm: programs for solids take
/// points that near for one.
const LEAST_LENGTH_MM: f64 = 1e-5;

/// An ellipse in the section; a circle where both halves are equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Conic {
    /// Centre, mm.
    pub center_mm: [f64; 2],
    /// Half of the extents along `along` and across it, mm.
    pub half_mm: [f64; 2],
    /// Unit vector.
    pub along: [f64; 2],
}

/// The curve from one point of a loop to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum SectionCurve {
    /// A straight line.
    Line,
    /// A part of a conic, at most half of it.
    Conic {
        /// The whole of it.
        conic: Conic,
        /// Whether it is passed counter-clockwise.
        is_counterclockwise: bool,
    },
}

/// A piece of a loop; it ends where the next one begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    /// Where it begins, mm.
    pub start_mm: [f64; 2],
    /// How it goes on.
    pub curve: SectionCurve,
}

/// A closed boundary, counter-clockwise with x to the right and the lateral coordinate upwards.
pub(super) type SectionLoop = Vec<Piece>;

/// A rectangle about the origin with these extents, mm.
pub(super) fn rectangle([length, lateral]: [f64; 2]) -> SectionLoop {
    let (x, b) = (0.5 * length, 0.5 * lateral);
    [[-x, -b], [x, -b], [x, b], [-x, b]].map(|start_mm| Piece { start_mm, curve: SectionCurve::Line }).to_vec()
}

/// The outline of a specimen.
pub(super) fn outline(specimen: &Specimen) -> SectionLoop {
    match specimen.profile() {
        None => notched_rectangle(specimen),
        Some(profile) => dumbbell_outline(&profile, &specimen.block),
    }
}

/// The rectangle of a block, cut open by its notches.
fn notched_rectangle(specimen: &Specimen) -> SectionLoop {
    use SectionEdge::{MinusLateral, MinusX, PlusLateral, PlusX};
    let notches: Vec<Notch> = specimen.holes.iter().filter_map(|hole| specimen.notch_of(hole)).collect();
    let mut pieces = Vec::with_capacity(4 + 3 * notches.len());
    for (corner, side) in rectangle(specimen.section_size()).into_iter().zip([MinusLateral, PlusX, PlusLateral, MinusX])
    {
        let ((axis, _), travel) = (side.axis_and_sign(), side.travel());
        let mut of_side: Vec<&Notch> = notches.iter().filter(|notch| notch.side == side).collect();
        of_side.sort_by(|a, b| (travel * a.center_mm[1 - axis]).total_cmp(&(travel * b.center_mm[1 - axis])));
        pieces.push(corner);
        of_side.into_iter().for_each(|notch| pieces.extend(notch_pieces(notch)));
    }
    pieces
}

/// The wall of a notch, in two parts, and the straight line that follows.
fn notch_pieces(notch: &Notch) -> [Piece; 3] {
    let half_mm = [notch.radius_mm; 2];
    let conic = Conic { center_mm: notch.center_mm, half_mm, along: [1.0, 0.0] };
    let curve = SectionCurve::Conic { conic, is_counterclockwise: false };
    let ([enter, leave], (sin, cos)) = (notch.mouth_mm(), notch.inward_angle().sin_cos());
    let deepest = [notch.center_mm[0] + notch.radius_mm * cos, notch.center_mm[1] + notch.radius_mm * sin];
    [
        Piece { start_mm: enter, curve },
        Piece { start_mm: deepest, curve },
        Piece { start_mm: leave, curve: SectionCurve::Line },
    ]
}

/// The walls of the holes within the outline.
pub(super) fn inner_loops(specimen: &Specimen) -> impl Iterator<Item = SectionLoop> {
    specimen.holes.iter().filter(|hole| !hole.is_notch).map(|hole| hole_loop(&hole.wall()))
}

/// A dumb-bell in its block, from the lower end of its right transition on.
fn dumbbell_outline(profile: &Profile, block: &Block) -> SectionLoop {
    let [rise, settle] = profile.arcs();
    let end = [0.5 * block.length_mm, 0.5 * block.width_mm];
    // The quarter x > 0, z > 0 outwards: its points, and what leads from each to the next, hollow first.
    let points = [rise.start_mm, settle.start_mm, settle.end_mm, end];
    let arcs = [Some((rise.center_mm, false)), Some((settle.center_mm, true)), None];
    let mut pieces = Vec::with_capacity(16);
    for (signs, is_outwards) in [([1.0, -1.0], true), ([1.0, 1.0], false), ([-1.0, 1.0], true), ([-1.0, -1.0], false)] {
        let mirrored = |p: [f64; 2]| [signs[0] * p[0], signs[1] * p[1]];
        for n in 0..points.len() {
            let (point, arc) = if is_outwards {
                (points[n], arcs.get(n).copied().flatten())
            } else {
                let from = points.len() - 1 - n;
                (points[from], from.checked_sub(1).and_then(|m| arcs[m]))
            };
            let curve = arc.map_or(SectionCurve::Line, |(center, is_counterclockwise)| SectionCurve::Conic {
                conic: Conic { center_mm: mirrored(center), half_mm: [profile.radius_mm(); 2], along: [1.0, 0.0] },
                is_counterclockwise,
            });
            pieces.push(Piece { start_mm: mirrored(point), curve });
        }
    }
    pieces
}

/// The wall of a hole: two halves of a circle or an ellipse, or two half circles and two lines.
fn hole_loop(wall: &HoleWall) -> SectionLoop {
    let ([a, b], center_mm, along) = (wall.half_mm(), wall.center_mm(), wall.along());
    let half_of = |center_mm: [f64; 2], half_mm: [f64; 2]| SectionCurve::Conic {
        conic: Conic { center_mm, half_mm, along },
        is_counterclockwise: true,
    };
    let at = |q: [f64; 2], curve: SectionCurve| Piece { start_mm: wall.section_point(q), curve };
    if wall.is_circle() || a - b < LEAST_LENGTH_MM {
        let half = half_of(center_mm, [b; 2]);
        return vec![at([b, 0.0], half), at([-b, 0.0], half)];
    }
    if wall.is_ellipse() {
        let half = half_of(center_mm, [a, b]);
        return vec![at([a, 0.0], half), at([-a, 0.0], half)];
    }
    let s = a - b;
    let cap = |side: f64| half_of(wall.section_point([side * s, 0.0]), [b; 2]);
    vec![
        at([s, -b], cap(1.0)),
        at([s, b], SectionCurve::Line),
        at([-s, b], cap(-1.0)),
        at([-s, -b], SectionCurve::Line),
    ]
}
