//! The material left between a hole and what is next to it.

/// A side of the section's outline. The lateral direction is z for holes along the thickness (and without
/// holes), y for holes along the width.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SectionEdge {
    /// The end x = −length/2.
    MinusX,
    /// The end x = +length/2.
    PlusX,
    /// The side at the negative lateral coordinate; with a dumb-bell outline, arcs included.
    MinusLateral,
    /// The side at the positive lateral coordinate; with a dumb-bell outline, arcs included.
    PlusLateral,
}

impl SectionEdge {
    /// All four.
    pub const ALL: [SectionEdge; 4] =
        [SectionEdge::MinusX, SectionEdge::PlusX, SectionEdge::MinusLateral, SectionEdge::PlusLateral];
}

/// What a ligament lies between. Indices into `Specimen::holes`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LigamentKind {
    /// Between two holes, the smaller index first.
    HoleHole(usize, usize),
    /// Between a hole and a side of the section.
    HoleEdge(usize, SectionEdge),
}

impl LigamentKind {
    /// The hole, or the first of the two holes, that the ligament begins at.
    pub fn first_hole(self) -> usize {
        match self {
            LigamentKind::HoleHole(hole, _) | LigamentKind::HoleEdge(hole, _) => hole,
        }
    }
}

impl std::fmt::Display for LigamentKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            LigamentKind::HoleHole(i, j) => write!(f, "holes[{i}] and holes[{j}]"),
            LigamentKind::HoleEdge(i, edge) => {
                let side = match edge {
                    SectionEdge::MinusX => "the end at -x",
                    SectionEdge::PlusX => "the end at +x",
                    SectionEdge::MinusLateral => "the side at the negative lateral coordinate",
                    SectionEdge::PlusLateral => "the side at the positive lateral coordinate",
                };
                write!(f, "holes[{i}] and {side}")
            }
        }
    }
}

/// The material between a hole and another hole or a side, at its thinnest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ligament {
    /// Between what.
    pub kind: LigamentKind,
    /// Thickness, mm; negative where the hole reaches into the other hole or beyond the side.
    pub length_mm: f64,
    /// Unit vector in the section (x, lateral) along which the thickness is measured, away from the first hole.
    pub direction: [f64; 2],
}
