//! A solid bounded by exact faces: what is extruded from the loops of a section, as vertices, edges and faces.
//!
//! Loops of a section are walls between two levels, and bounds of plane faces at a level, which may slant along x.
//! Every edge is shared by two faces that pass it in opposite senses, so the surface is closed.

use super::HoleAxis;
use super::section_loop::{Conic, SectionCurve, SectionLoop};
use std::collections::HashMap;

/// An edge passed by a face: its number, and whether from its first to its second vertex.
pub(super) type OrientedEdge = (usize, bool);

/// A plane across the extrusion, or slanted along x: the positions along the axis of a level of the section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Level {
    /// At x = 0, mm.
    pub middle_mm: f64,
    /// Per mm of x.
    pub slope: f64,
}

impl Level {
    /// Straight across.
    pub fn straight(middle_mm: f64) -> Level {
        Level { middle_mm, slope: 0.0 }
    }

    fn at(self, x_mm: f64) -> f64 {
        self.middle_mm + self.slope * x_mm
    }
}

/// A conic in space, in a plane across the extrusion or slanted to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpaceConic {
    /// Centre, mm.
    pub center_mm: [f64; 3],
    /// Half of the extents along `along` and across it, mm.
    pub half_mm: [f64; 2],
    /// Unit vector.
    pub along: [f64; 3],
    /// Unit normal of its plane, towards higher levels.
    pub axis: [f64; 3],
}

impl SpaceConic {
    /// The ellipse c + u cos t + v sin t.
    fn with_diameters(center_mm: [f64; 3], u: [f64; 3], v: [f64; 3]) -> SpaceConic {
        // Its axes are the conjugate half diameters that are orthogonal.
        let turn = 0.5 * (2.0 * dot(u, v)).atan2(dot(u, u) - dot(v, v));
        let (sin, cos) = turn.sin_cos();
        let major = [0, 1, 2].map(|c| u[c] * cos + v[c] * sin);
        let minor = [0, 1, 2].map(|c| v[c] * cos - u[c] * sin);
        let half_mm = [dot(major, major).sqrt(), dot(minor, minor).sqrt()];
        let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let length = dot(normal, normal).sqrt();
        SpaceConic { center_mm, half_mm, along: major.map(|c| c / half_mm[0]), axis: normal.map(|c| c / length) }
    }

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
    levels: Vec<Level>,
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
    pub fn new(extrusion: HoleAxis, loops: Vec<SectionLoop>, levels: Vec<Level>) -> SolidBuilder {
        let axis = place(extrusion, [0.0; 2], 1.0);
        SolidBuilder {
            extrusion,
            loops,
            levels,
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
            let surface = self.wall_surface(loop_index, piece, (low, bottom), sense);
            self.solid.faces.push(Face { surface, bounds: vec![bound] });
        }
    }

    /// What the wall of a piece lies on, which rises from the edge `bottom` at the level `low`.
    fn wall_surface(&self, loop_index: usize, piece: usize, (low, bottom): (usize, usize), sense: Sense) -> Surface {
        let ring = &self.loops[loop_index];
        match ring[piece].curve {
            SectionCurve::Conic { conic, is_counterclockwise } => Surface::Extruded {
                conic: self.space_conic(conic, Level::straight(self.levels[low].middle_mm)),
                is_convex: is_counterclockwise == (sense == Sense::Forward),
            },
            SectionCurve::Line => {
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
        let slope = self.levels[level].slope;
        let sign = if looks == Sense::Forward { 1.0 } else { -1.0 } / slope.hypot(1.0);
        let normal = place(self.extrusion, [-slope, 0.0], 1.0).map(|c| sign * c);
        let along = place(self.extrusion, [1.0, 0.0], slope).map(|c| c / slope.hypot(1.0));
        self.solid.faces.push(Face { surface: Surface::Plane { vertex, normal, along }, bounds: walks });
    }

    /// The solid.
    pub fn finish(self) -> Solid {
        self.solid
    }

    fn vertex(&mut self, loop_index: usize, piece: usize, level: usize) -> usize {
        let start_mm = self.loops[loop_index][piece].start_mm;
        let position = place(self.extrusion, start_mm, self.levels[level].at(start_mm[0]));
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
            SectionCurve::Conic { conic, is_counterclockwise } => {
                EdgeCurve::Conic { conic: self.space_conic(conic, self.levels[level]), is_counterclockwise }
            }
        };
        let edges = &mut self.solid.edges;
        *self.edge_of_piece.entry((loop_index, piece, level)).or_insert_with(|| {
            edges.push(Edge { ends, curve });
            edges.len() - 1
        })
    }

    /// A conic of the section at a level: of a slanted one, the ellipse in which the level cuts its wall.
    fn space_conic(&self, Conic { center_mm, half_mm, along }: Conic, level: Level) -> SpaceConic {
        let center = place(self.extrusion, center_mm, level.at(center_mm[0]));
        if level.slope.abs() > 0.0 {
            let [u, v] = [along.map(|c| half_mm[0] * c), [-half_mm[1] * along[1], half_mm[1] * along[0]]]
                .map(|p| place(self.extrusion, p, level.slope * p[0]));
            return SpaceConic::with_diameters(center, u, v);
        }
        let along = place(self.extrusion, along, 0.0);
        SpaceConic { center_mm: center, half_mm, along, axis: self.solid.axis }
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

fn dot(u: [f64; 3], v: [f64; 3]) -> f64 {
    u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
}

/// A point of the section at a level, in the specimen's frame. (x, lateral, level) is right-handed: along the thickness
/// levels rise towards −y.
fn place(extrusion: HoleAxis, [x, lateral]: [f64; 2], level: f64) -> [f64; 3] {
    match extrusion {
        HoleAxis::Thickness => [x, -level, lateral],
        HoleAxis::Width => [x, lateral, level],
    }
}
