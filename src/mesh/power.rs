//! The power diagram of the holes in a rectangle: one polygon around each hole, sharing whole edges with its
//! neighbours.

use super::domain::SectionHole;
use super::section::{cross, dot, sub};

/// Polygons by vertex index. A polygon of a half hole is an open chain from one end of the mirror line to the other.
#[derive(Clone, Debug)]
pub(super) struct PowerDiagram {
    pub vertices: Vec<[f64; 2]>,
    pub polygons: Vec<Polygon>,
}

/// The edges around one hole, counter-clockwise.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    pub vertices: Vec<usize>,
    /// Not closed: the part of the rectangle's lower side that a half hole sits on is missing.
    pub is_open: bool,
}

impl Polygon {
    /// Consecutive vertices.
    pub fn edges(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let n = self.vertices.len();
        (0..if self.is_open { n - 1 } else { n }).map(move |i| (self.vertices[i], self.vertices[(i + 1) % n]))
    }
}

/// A rectangle [low₀, high₀] × [low₁, high₁].
#[derive(Clone, Copy, Debug)]
pub(super) struct Rectangle {
    pub low: [f64; 2],
    pub high: [f64; 2],
}

impl Rectangle {
    /// Bits of the sides that a point lies on: left 1, right 2, lower 4, upper 8.
    pub fn sides(&self, p: [f64; 2], tolerance: f64) -> u8 {
        let on = |value: f64, side: f64, bit: u8| if (value - side).abs() < tolerance { bit } else { 0 };
        on(p[0], self.low[0], 1) | on(p[0], self.high[0], 2) | on(p[1], self.low[1], 4) | on(p[1], self.high[1], 8)
    }
}

impl PowerDiagram {
    /// Divides `rectangle` among `holes` by radical lines: a point belongs to the hole with the smallest |p − c|² − r²,
    /// where r is its radius, or that of the circle that stands for it ([`SectionHole::power_radius`] with `weight`).
    /// Disjoint circles lie inside their polygons; of other holes it is checked. Edges shorter than `shortest` are
    /// collapsed.
    ///
    /// `None` if a polygon degenerates or does not hold its hole.
    pub fn new(rectangle: Rectangle, holes: &[SectionHole], shortest: f64, weight: f64) -> Option<Self> {
        let scale = (rectangle.high[0] - rectangle.low[0]).max(rectangle.high[1] - rectangle.low[1]);
        let tolerance = 1e-7 * scale;
        let mut diagram = PowerDiagram { vertices: Vec::new(), polygons: Vec::new() };
        for (i, hole) in holes.iter().enumerate() {
            let ([l0, l1], [h0, h1]) = (rectangle.low, rectangle.high);
            let mut polygon = vec![[l0, l1], [h0, l1], [h0, h1], [l0, h1]];
            for (j, other) in holes.iter().enumerate() {
                if j != i {
                    polygon = clip(&polygon, hole, other, weight);
                }
            }
            let vertices: Vec<usize> = polygon.iter().map(|&p| diagram.vertex(p, tolerance)).collect();
            diagram.polygons.push(Polygon { vertices: without_repeats(vertices), is_open: false });
        }
        diagram.insert_hanging_vertices(tolerance);
        diagram.collapse_short_edges(rectangle, tolerance, shortest);
        diagram.open_half_cells(holes, rectangle.low[1], tolerance)?;
        diagram.sees_holes(holes).then_some(diagram)
    }

    fn vertex(&mut self, p: [f64; 2], tolerance: f64) -> usize {
        let near = |q: &[f64; 2]| (q[0] - p[0]).abs() < tolerance && (q[1] - p[1]).abs() < tolerance;
        self.vertices.iter().position(near).unwrap_or_else(|| {
            self.vertices.push(p);
            self.vertices.len() - 1
        })
    }

    /// Rounding can leave a vertex of one polygon inside an edge of another; the edge takes it up.
    fn insert_hanging_vertices(&mut self, tolerance: f64) {
        for polygon in &mut self.polygons {
            let mut i = 0;
            while i < polygon.vertices.len() {
                let (u, v) = (polygon.vertices[i], polygon.vertices[(i + 1) % polygon.vertices.len()]);
                let (p, q) = (self.vertices[u], self.vertices[v]);
                let along = sub(q, p);
                let length_squared = dot(along, along);
                let hanging = (0..self.vertices.len()).find(|&w| {
                    if polygon.vertices.contains(&w) {
                        return false;
                    }
                    let r = sub(self.vertices[w], p);
                    let s = dot(r, along) / length_squared;
                    s > 0.0 && s < 1.0 && (cross(along, r) / length_squared.sqrt()).abs() < 2.0 * tolerance
                });
                match hanging {
                    Some(w) => polygon.vertices.insert(i + 1, w),
                    None => i += 1,
                }
            }
        }
    }

    /// Merges the ends of short edges, shortest first. A corner of the rectangle stays, a vertex on a side stays on it.
    fn collapse_short_edges(&mut self, rectangle: Rectangle, tolerance: f64, shortest: f64) {
        loop {
            let mut best: Option<(f64, usize, usize)> = None;
            for polygon in &self.polygons {
                for (u, v) in polygon.edges() {
                    let d = sub(self.vertices[u], self.vertices[v]);
                    let length = dot(d, d).sqrt();
                    let is_shorter = best.is_none_or(|(l, ..)| length < l);
                    if u < v && length < shortest && is_shorter && self.can_merge(u, v, rectangle, tolerance) {
                        best = Some((length, u, v));
                    }
                }
            }
            let Some((_, u, v)) = best else { return };
            let [pu, pv] = [u, v].map(|w| self.vertices[w]);
            let [su, sv] = [pu, pv].map(|p| rectangle.sides(p, tolerance).count_ones());
            self.vertices[u] = match su.cmp(&sv) {
                std::cmp::Ordering::Greater => pu,
                std::cmp::Ordering::Less => pv,
                std::cmp::Ordering::Equal => [0.5 * (pu[0] + pv[0]), 0.5 * (pu[1] + pv[1])],
            };
            for polygon in &mut self.polygons {
                for w in &mut polygon.vertices {
                    if *w == v {
                        *w = u;
                    }
                }
                polygon.vertices = without_repeats(std::mem::take(&mut polygon.vertices));
            }
        }
    }

    fn can_merge(&self, u: usize, v: usize, rectangle: Rectangle, tolerance: f64) -> bool {
        let [su, sv] = [u, v].map(|w| rectangle.sides(self.vertices[w], tolerance));
        // The sides of one must include the other's, or merging would cut a corner off or move a corner.
        let compatible = su & sv == su || su & sv == sv;
        let both_corners = su.count_ones() > 1 && sv.count_ones() > 1;
        let keeps_polygons =
            self.polygons.iter().all(|p| p.vertices.len() > 3 || !(p.vertices.contains(&u) && p.vertices.contains(&v)));
        compatible && !both_corners && keeps_polygons
    }

    /// Takes the edge below a half hole away.
    fn open_half_cells(&mut self, holes: &[SectionHole], bottom: f64, tolerance: f64) -> Option<()> {
        for (polygon, hole) in self.polygons.iter_mut().zip(holes) {
            if hole.is_half {
                let n = polygon.vertices.len();
                let on_bottom = |w: usize| (self.vertices[w][1] - bottom).abs() < tolerance;
                let start =
                    (0..n).find(|&i| on_bottom(polygon.vertices[i]) && on_bottom(polygon.vertices[(i + n - 1) % n]))?;
                polygon.vertices.rotate_left(start);
                polygon.is_open = true;
            }
        }
        Some(())
    }

    /// Every polygon is star-shaped about its hole's centre and holds the hole.
    fn sees_holes(&self, holes: &[SectionHole]) -> bool {
        self.polygons.iter().zip(holes).all(|(polygon, hole)| {
            polygon.vertices.len() >= 3
                && polygon.edges().all(|(u, v)| {
                    let (p, q) = (sub(self.vertices[u], hole.center()), sub(self.vertices[v], hole.center()));
                    let along = sub(q, p);
                    let length = dot(along, along).sqrt();
                    let outward = [along[1] / length, -along[0] / length];
                    cross(p, q) / length > hole.wall.reach_mm(outward) * (1.0 + 1e-3)
                })
        })
    }
}

/// The part of a convex polygon with a smaller power to `hole` than to `other`.
fn clip(polygon: &[[f64; 2]], hole: &SectionHole, other: &SectionHole, weight: f64) -> Vec<[f64; 2]> {
    // |p − c|² − r² ≤ |p − c'|² − r'² is 2 p·(c' − c) ≤ |c'|² − |c|² + r² − r'².
    let (own, others) = (hole.center(), other.center());
    let [radius, other_radius] = [hole, other].map(|h| h.power_radius(weight));
    let normal = sub(others, own);
    let offset = 0.5 * (dot(others, others) - dot(own, own) + radius * radius - other_radius * other_radius);
    let excess = |p: [f64; 2]| dot(p, normal) - offset;
    let mut clipped = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (ep, eq) = (excess(p), excess(q));
        if ep <= 0.0 {
            clipped.push(p);
        }
        if (ep < 0.0 && eq > 0.0) || (ep > 0.0 && eq < 0.0) {
            let s = ep / (ep - eq);
            clipped.push([p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1])]);
        }
    }
    clipped
}

/// A closed chain without equal neighbours.
fn without_repeats(mut vertices: Vec<usize>) -> Vec<usize> {
    vertices.dedup();
    while vertices.len() > 1 && vertices.first() == vertices.last() {
        vertices.pop();
    }
    vertices
}
