//! A solid bounded by exact faces: what is extruded from the loops of a section, as vertices, edges and faces.
//!
//! Loops of a section are walls between two levels, and bounds of plane faces at a level. Every edge is shared by two
//! faces that pass it in opposite senses, so the surface is closed.

use super::HoleAxis;
use super::section_loop::{Conic, SectionCurve, SectionLoop};
use std::collections::HashMap;

/// An edge passed by a face: its number, and whether from its first to its second vertex.
pub(super) type OrientedEdge = (usize, bool);

/// A conic in space, in a plane across the extrusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpaceConic {
    /// Centre, mm.
    pub center_mm: [f64; 3],
    /// Half of the extents along `along` and across it, mm.
    pub half_mm: [f64; 2],
    /// Unit vector.
    pub along: [f64; 3],
}

impl SpaceConic {
    /// Whether it is a circle.
    pub fn is_circle(&self) -> bool {
        // Both are set from one number where a wall is a circle.
        self.half_mm[0].to_bits() == self.half_mm[1].to_bits()
    }
}

/// How an edge goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum EdgeCurve {
    /// Straight.
    Line,
    /// Along a conic.
    Conic {
        /// The whole of it.
        conic: SpaceConic,
        /// Whether counter-clockwise about the extrusion's axis, from the first to the second vertex.
        is_counterclockwise: bool,
    },
}

/// An edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Edge {
    /// Its vertices.
    pub ends: [usize; 2],
    /// What joins them.
    pub curve: EdgeCurve,
}

/// What a face lies on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Surface {
    /// A plane through a vertex with this outward unit normal.
    Plane {
        /// A vertex of it.
        vertex: usize,
        /// Out of the material.
        normal: [f64; 3],
        /// A unit vector in the plane.
        along: [f64; 3],
    },
    /// A conic extruded along the axis.
    Extruded {
        /// The conic.
        conic: SpaceConic,
        /// Whether the material is inside of it.
        is_convex: bool,
    },
}

/// A face.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Face {
    /// What it lies on.
    pub surface: Surface,
    /// Closed walks along edges, counter-clockwise seen from outside; the outer one first.
    pub bounds: Vec<Vec<OrientedEdge>>,
}

/// A closed solid.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Solid {
    /// Positions, mm.
    pub vertices: Vec<[f64; 3]>,
    /// Edges.
    pub edges: Vec<Edge>,
    /// Faces.
    pub faces: Vec<Face>,
    /// Unit vector of the extrusion.
    pub axis: [f64; 3],
}

/// Which way a loop is passed, or a plane face looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sense {
    /// Counter-clockwise; towards higher levels.
    Forward,
    /// Clockwise; towards lower levels.
    Backward,
}

/// Puts a solid together from loops of a section at levels along the extrusion.
pub(super) struct SolidBuilder {
    extrusion: HoleAxis,
    loops: Vec<SectionLoop>,
    /// Levels, mm along the axis.
    levels_mm: Vec<f64>,
    solid: Solid,
    /// The vertex at the start of a piece (loop, piece, level).
    vertex_of: HashMap<(usize, usize, usize), usize>,
    /// The edge of a piece at a level.
    edge_of_piece: HashMap<(usize, usize, usize), usize>,
    /// The edge between two levels at the start of a piece.
    rise_of: HashMap<(usize, usize, [usize; 2]), usize>,
}

impl SolidBuilder {
    /// Of loops extruded along `extrusion`, at increasing levels.
    pub fn new(extrusion: HoleAxis, loops: Vec<SectionLoop>, levels_mm: Vec<f64>) -> SolidBuilder {
        let axis = place(extrusion, [0.0; 2], 1.0);
        SolidBuilder {
            extrusion,
            loops,
            levels_mm,
            solid: Solid { vertices: Vec::new(), edges: Vec::new(), faces: Vec::new(), axis },
            vertex_of: HashMap::new(),
            edge_of_piece: HashMap::new(),
            rise_of: HashMap::new(),
        }
    }

    /// Adds the walls of a loop between two levels; passed in this sense, the material is on the left.
    pub fn wall(&mut self, loop_index: usize, [low, high]: [usize; 2], sense: Sense) {
        for piece in 0..self.loops[loop_index].len() {
            let next = (piece + 1) % self.loops[loop_index].len();
            let (bottom, top) = (self.piece_edge(loop_index, piece, low), self.piece_edge(loop_index, piece, high));
            let (start, end) = (self.rise(loop_index, piece, [low, high]), self.rise(loop_index, next, [low, high]));
            let bound = match sense {
                Sense::Forward => vec![(bottom, true), (end, true), (top, false), (start, false)],
                Sense::Backward => vec![(bottom, false), (start, true), (top, true), (end, false)],
            };
            let surface = self.wall_surface(loop_index, piece, bottom, sense);
            self.solid.faces.push(Face { surface, bounds: vec![bound] });
        }
    }

    fn wall_surface(&self, loop_index: usize, piece: usize, bottom: usize, sense: Sense) -> Surface {
        let ring = &self.loops[loop_index];
        match (ring[piece].curve, self.solid.edges[bottom].curve) {
            (SectionCurve::Conic { is_counterclockwise, .. }, EdgeCurve::Conic { conic, .. }) => {
                Surface::Extruded { conic, is_convex: is_counterclockwise == (sense == Sense::Forward) }
            }
            _ => {
                let (a, b) = (ring[piece].start_mm, ring[(piece + 1) % ring.len()].start_mm);
                let sign = if sense == Sense::Forward { 1.0 } else { -1.0 };
                let length = (b[0] - a[0]).hypot(b[1] - a[1]);
                let t = [0, 1].map(|c| sign * (b[c] - a[c]) / length);
                Surface::Plane {
                    vertex: self.solid.edges[bottom].ends[0],
                    normal: place(self.extrusion, [t[1], -t[0]], 0.0),
                    along: place(self.extrusion, t, 0.0),
                }
            }
        }
    }

    /// Adds a plane face at a level, bounded by loops (the outer one first), each passed in its sense as seen from
    /// above.
    pub fn cap(&mut self, bounds: &[(usize, Sense)], level: usize, looks: Sense) {
        let mut walks = Vec::with_capacity(bounds.len());
        let mut vertex = 0;
        for &(loop_index, sense) in bounds {
            let count = self.loops[loop_index].len();
            let mut walk: Vec<OrientedEdge> =
                (0..count).map(|piece| (self.piece_edge(loop_index, piece, level), sense == Sense::Forward)).collect();
            if sense == Sense::Backward {
                walk.reverse();
            }
            vertex = self.vertex(loop_index, 0, level);
            walks.push(walk);
        }
        let normal = if looks == Sense::Forward { self.solid.axis } else { self.solid.axis.map(|c| -c) };
        let along = place(self.extrusion, [1.0, 0.0], 0.0);
        self.solid.faces.push(Face { surface: Surface::Plane { vertex, normal, along }, bounds: walks });
    }

    /// The solid.
    pub fn finish(self) -> Solid {
        self.solid
    }

    fn vertex(&mut self, loop_index: usize, piece: usize, level: usize) -> usize {
        let position = place(self.extrusion, self.loops[loop_index][piece].start_mm, self.levels_mm[level]);
        let vertices = &mut self.solid.vertices;
        *self.vertex_of.entry((loop_index, piece, level)).or_insert_with(|| {
            vertices.push(position);
            vertices.len() - 1
        })
    }

    fn piece_edge(&mut self, loop_index: usize, piece: usize, level: usize) -> usize {
        let next = (piece + 1) % self.loops[loop_index].len();
        let ends = [self.vertex(loop_index, piece, level), self.vertex(loop_index, next, level)];
        let curve = match self.loops[loop_index][piece].curve {
            SectionCurve::Line => EdgeCurve::Line,
            SectionCurve::Conic { conic: Conic { center_mm, half_mm, along }, is_counterclockwise } => {
                let conic = SpaceConic {
                    center_mm: place(self.extrusion, center_mm, self.levels_mm[level]),
                    half_mm,
                    along: place(self.extrusion, along, 0.0),
                };
                EdgeCurve::Conic { conic, is_counterclockwise }
            }
        };
        let edges = &mut self.solid.edges;
        *self.edge_of_piece.entry((loop_index, piece, level)).or_insert_with(|| {
            edges.push(Edge { ends, curve });
            edges.len() - 1
        })
    }

    fn rise(&mut self, loop_index: usize, piece: usize, between: [usize; 2]) -> usize {
        let ends = between.map(|level| self.vertex(loop_index, piece, level));
        let edges = &mut self.solid.edges;
        *self.rise_of.entry((loop_index, piece, between)).or_insert_with(|| {
            edges.push(Edge { ends, curve: EdgeCurve::Line });
            edges.len() - 1
        })
    }
}

/// A point of the section at a level, in the specimen's frame. (x, lateral, level) is right-handed: along the thickness
/// levels rise towards −y.
fn place(extrusion: HoleAxis, [x, lateral]: [f64; 2], level: f64) -> [f64; 3] {
    match extrusion {
        HoleAxis::Thickness => [x, -level, lateral],
        HoleAxis::Width => [x, lateral, level],
    }
}
