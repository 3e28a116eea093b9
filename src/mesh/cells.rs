//! O-grids in the power-diagram cells of the holes, and structured strips around them.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use super::domain::Domain;
use super::error::MeshError;
use super::grading::{divide, with_middles};
use super::grid::{Builder, count, layered, limit_cells, line};
use super::options::MeshOptions;
use super::power::{PowerDiagram, Rectangle};
use super::section::{Section, dot, sub};
use crate::specimen::HoleWall;

/// Points of each edge by its vertices, the smaller index first.
type EdgePoints = BTreeMap<(usize, usize), Vec<[f64; 2]>>;

/// Choices in making cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style {
    /// Cell edges shorter than this are collapsed, mm.
    pub shortest_mm: f64,
    /// How far the lines from a cell's corners to the hole bend towards the corner's bisector: 0 = straight, 1 = fully.
    pub bend: f64,
    /// Which circle stands for a hole that is none (`SectionHole::power_radius`).
    pub power_weight: f64,
}

/// O-grids around the holes in `inner`, structured strips outside it. `None` if the cells degenerate.
pub(super) fn holed_section(
    domain: &Domain,
    options: &MeshOptions,
    inner: Rectangle,
    style: Style,
) -> Result<Option<Section>, MeshError> {
    let Some(diagram) = PowerDiagram::new(inner, &domain.holes, style.shortest_mm, style.power_weight) else {
        return Ok(None);
    };
    let layout = Layout { domain, options, inner, diagram, bend: style.bend };
    let edges = layout.divide_edges()?;
    let mut builder = Builder::new(domain);
    let mut cells = 0;
    for index in 0..domain.holes.len() {
        let layers = layout.radial_layers(index)?;
        let around: usize = layout.diagram.polygons[index].edges().map(|(u, v)| edges[&key(u, v)].len() / 2).sum();
        cells += layers * around;
        limit_cells(cells, options)?;
        layout.o_grid(index, layers, &edges, &mut builder);
    }
    layout.strips(&edges, &mut builder)?;
    let section = builder.finish();
    limit_cells(section.num_cells(), options)?;
    Ok(Some(section))
}

fn key(u: usize, v: usize) -> (usize, usize) {
    (u.min(v), u.max(v))
}

struct Layout<'a> {
    domain: &'a Domain,
    options: &'a MeshOptions,
    inner: Rectangle,
    diagram: PowerDiagram,
    bend: f64,
}

impl Layout<'_> {
    fn tolerance(&self) -> f64 {
        1e-7 * self.domain.scale()
    }

    /// Bits of the graded outer sides, within the layers along free ones, that a point lies on (mirror line not
    /// counted).
    fn outer_sides(&self, p: [f64; 2]) -> u8 {
        let [a, b] = self.domain.inner_half;
        let outer = Rectangle { low: [-a, -b], high: [a, b] };
        outer.sides(p, self.tolerance())
    }

    /// Size ratio of a line that meets the given outer sides.
    fn ratio(&self, sides: u8) -> f64 {
        let grading = self.domain.grading;
        let mut ratio: f64 = 1.0;
        if sides & 3 != 0 {
            ratio = ratio.min(grading.ends);
        }
        if sides & 12 != 0 {
            ratio = ratio.min(grading.sides);
        }
        ratio
    }

    /// Points of every edge, from its vertex with the smaller index to the other, with middles: the same for both
    /// cells.
    fn divide_edges(&self) -> Result<EdgePoints, MeshError> {
        let vertices = &self.diagram.vertices;
        // Per edge: parts asked for, feet of the centres, product of their distances, number of cells.
        let mut facts: BTreeMap<(usize, usize), (usize, f64, f64, u32)> = BTreeMap::new();
        for (polygon, hole) in self.diagram.polygons.iter().zip(&self.domain.holes) {
            for (first, second) in polygon.edges() {
                let (u, v) = key(first, second);
                let along = sub(vertices[v], vertices[u]);
                let length = dot(along, along).sqrt();
                let to_center = sub(hole.center(), vertices[u]);
                let foot = dot(to_center, along) / length;
                let distance = (dot(to_center, to_center) - foot * foot).max(0.0).sqrt();
                let angle = if hole.wall.is_circle() {
                    ((length - foot) / distance).atan() + (foot / distance).atan()
                } else {
                    let [from, to] = [first, second].map(|w| hole.wall.parameter_of(vertices[w]));
                    (to - from).rem_euclid(TAU) * hole.wall.parts_factor()
                };
                // Rounded down only a little: with eight around, no arc exceeds 60°.
                let around = (angle / TAU * self.options.hole_segments as f64 - 0.3).ceil() as usize;
                let n = count(length, self.options)?.max(around);
                let fact = facts.entry((u, v)).or_insert((1, 0.0, 1.0, 0));
                *fact = (fact.0.max(n), fact.1 + foot, fact.2 * distance, fact.3 + 1);
            }
        }
        Ok(facts
            .into_iter()
            .map(|((u, v), (n, feet, product, cells))| {
                let (p, q) = (vertices[u], vertices[v]);
                let length = dot(sub(q, p), sub(q, p)).sqrt();
                let foot = feet / f64::from(cells);
                let mean = if cells == 2 { product.sqrt() } else { product };
                // Equal angles seen from the centre would make long parts far from a close hole: see it from farther.
                let depth = mean.max(0.5 * length);
                let (sides_u, sides_v) = (self.outer_sides(p), self.outer_sides(q));
                let shared = sides_u & sides_v;
                let divisions = divide(n, self.ratio(sides_u & !shared), self.ratio(sides_v & !shared));
                let (low, high) = ((-foot / depth).atan(), ((length - foot) / depth).atan());
                let mut positions: Vec<f64> =
                    divisions.iter().map(|t| (foot + depth * (low + (high - low) * t).tan()) / length).collect();
                (positions[0], positions[n]) = (0.0, 1.0);
                let points = with_middles(&positions)
                    .iter()
                    .map(|s| [p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1])])
                    .collect();
                ((u, v), points)
            })
            .collect())
    }

    /// Layers between a hole and its cell's edges: their root-mean-square gap over the element size.
    fn radial_layers(&self, index: usize) -> Result<usize, MeshError> {
        let wall = &self.domain.holes[index].wall;
        let (mut sum, mut weight) = (0.0, 0.0);
        for (u, v) in self.diagram.polygons[index].edges() {
            for i in 0..8 {
                let s = (f64::from(i) + 0.5) / 8.0;
                let p = [0, 1].map(|c| (1.0 - s) * self.diagram.vertices[u][c] + s * self.diagram.vertices[v][c]);
                let gap = wall.distance_mm(p);
                sum += gap * gap;
                weight += 1.0;
            }
        }
        Ok(count((sum / weight).sqrt(), self.options)?.max(self.options.radial_layers))
    }

    /// Patches between the hole's wall and each edge of its cell.
    fn o_grid(&self, index: usize, layers: usize, edges: &EdgePoints, builder: &mut Builder) {
        let wall = &self.domain.holes[index].wall;
        let finest = self.domain.grading.holes;
        let inner_steps = with_middles(&divide(layers, finest, 1.0));
        for (u, v) in self.diagram.polygons[index].edges() {
            let mut points = edges[&key(u, v)].clone();
            if u > v {
                points.reverse();
            }
            let last = points.len() - 1;
            let parameters = wall_parameters(wall, &points);
            let bends = [self.corner_bend(index, u), self.corner_bend(index, v)];
            // How far the radial steps are graded towards the outer boundary: fully on an outer edge, and fading to
            // nothing at the middle of an inner edge from its ends on the outer boundary.
            let [ends_u, ends_v] = [points[0], points[last]].map(|p| self.ratio(self.outer_sides(p)));
            let outer = self.ratio(self.outer_sides(points[0]) & self.outer_sides(points[last]));
            let steps: Vec<Vec<f64>> = (0..=last)
                .map(|i| {
                    let s = i as f64 / last as f64;
                    let from_ends = ends_u.ln() * (1.0 - 2.0 * s).max(0.0) + ends_v.ln() * (2.0 * s - 1.0).max(0.0);
                    let fade = from_ends.min(outer.ln()).exp();
                    if fade < 1.0 - 1e-12 {
                        let graded = with_middles(&divide(layers, finest, self.ratio(15)));
                        // Between "graded at the wall only" and "graded at both ends".
                        let w = fade.ln() / self.ratio(15).ln();
                        graded.iter().zip(&inner_steps).map(|(g, h)| w * g + (1.0 - w) * h).collect()
                    } else {
                        inner_steps.clone()
                    }
                })
                .collect();
            builder.grid(2 * layers + 1, points.len(), |i, j| {
                let on_wall = wall.point_at(parameters[j]);
                let t = steps[j][i];
                let s = j as f64 / last as f64;
                let (near_u, near_v) = ((1.0 - 2.0 * s).max(0.0), (2.0 * s - 1.0).max(0.0));
                if i == 2 * layers {
                    return points[j];
                }
                [0, 1].map(|c| {
                    let offset = near_u * bends[0][c] + near_v * bends[1][c];
                    (1.0 - t) * on_wall[c] + t * points[j][c] + 2.0 * t * (1.0 - t) * offset
                })
            });
        }
    }

    /// How far the control point of the line from the hole to a corner of its cell is moved off the straight line. A
    /// line that meets the corner along its bisector makes equal angles with both edges, also where the hole is seen
    /// from the corner close to one of them.
    fn corner_bend(&self, index: usize, corner: usize) -> [f64; 2] {
        let (wall, polygon) = (&self.domain.holes[index].wall, &self.diagram.polygons[index]);
        let n = polygon.vertices.len();
        let position = polygon.vertices.iter().position(|&w| w == corner).unwrap_or(0);
        if polygon.is_open && (position == 0 || position + 1 == n) {
            // On the mirror line.
            return [0.0; 2];
        }
        let point = self.diagram.vertices[corner];
        let direction = |to: [f64; 2]| {
            let d = sub(to, point);
            let length = dot(d, d).sqrt();
            [d[0] / length, d[1] / length]
        };
        let next = direction(self.diagram.vertices[polygon.vertices[(position + 1) % n]]);
        let previous = direction(self.diagram.vertices[polygon.vertices[(position + n - 1) % n]]);
        // The bisector of a convex corner is the normal of the difference of its edges' directions.
        let across = sub(next, previous);
        let length = dot(across, across).sqrt();
        let bisector = [across[1] / length, -across[0] / length];
        let inward =
            direction(if wall.is_circle() { wall.center_mm() } else { wall.point_at(wall.parameter_of(point)) });
        let sign = if dot(bisector, inward) < 0.0 { -1.0 } else { 1.0 };
        let gap = wall.distance_mm(point);
        [0, 1].map(|c| 0.5 * self.bend * gap * (sign * bisector[c] - inward[c]))
    }

    /// Structured grids outside the inner rectangle, continuing the divisions of its sides.
    fn strips(&self, edges: &EdgePoints, builder: &mut Builder) -> Result<(), MeshError> {
        let domain = self.domain;
        let (low, high) = ([-domain.half[0], domain.bottom], domain.half);
        let (within_low, within_high) = ([-domain.inner_half[0], domain.inner_bottom()], domain.inner_half);
        let lower_ratio = if domain.bottom < 0.0 { domain.grading.sides } else { 1.0 };
        let ratios = [[domain.grading.ends, domain.grading.ends], [lower_ratio, domain.grading.sides]];
        let strip = |c: usize, upper: bool| -> Result<Option<Vec<f64>>, MeshError> {
            // Outward from the inner rectangle: graded elements, and the layer.
            let (from, to, end) = if upper {
                (self.inner.high[c], within_high[c], high[c])
            } else {
                (-self.inner.low[c], -within_low[c], -low[c])
            };
            let mut positions = vec![from];
            if to - from > self.tolerance() {
                let n = count(to - from, self.options)?;
                positions = line(from, to, n, 1.0, ratios[c][usize::from(upper)]);
            }
            positions = layered(positions, end, false);
            if positions.len() < 2 {
                return Ok(None);
            }
            if !upper {
                positions.reverse();
                positions.iter_mut().for_each(|p| *p = -*p);
            }
            Ok(Some(positions))
        };
        // Positions along a side of the inner rectangle, increasing.
        let side = |bit: u8, c: usize| -> Vec<f64> {
            let on_side = |w: usize| self.inner.sides(self.diagram.vertices[w], self.tolerance()) & bit != 0;
            let mut positions: Vec<f64> = edges
                .iter()
                .filter(|((u, v), _)| on_side(*u) && on_side(*v))
                .flat_map(|(_, points)| points.iter().map(move |p| p[c]))
                .collect();
            positions.sort_by(f64::total_cmp);
            positions.dedup_by(|p, q| (*p - *q).abs() < self.tolerance());
            positions
        };
        let (left, right) = (strip(0, false)?, strip(0, true)?);
        let (lower, upper) = (strip(1, false)?, strip(1, true)?);
        for (columns, bit) in [(&left, 1), (&right, 2)] {
            let Some(columns) = columns else { continue };
            let middle = Some(side(bit, 1));
            for rows in [&lower, &middle, &upper].into_iter().flatten() {
                limit_cells(columns.len() / 2 * (rows.len() / 2), self.options)?;
                builder.grid(columns.len(), rows.len(), |i, j| [columns[i], rows[j]]);
            }
        }
        for (rows, bit) in [(&lower, 4), (&upper, 8)] {
            let Some(rows) = rows else { continue };
            let columns = side(bit, 0);
            limit_cells(columns.len() / 2 * (rows.len() / 2), self.options)?;
            builder.grid(columns.len(), rows.len(), |i, j| [columns[i], rows[j]]);
        }
        Ok(())
    }
}

/// Parameters of the wall's points that face `points` (of a circle angles): between equal steps and straight lines to
/// the nearest point of the wall, but no step much longer than the equal ones; the middles are exactly midway so that
/// each element's part of the wall is divided evenly. Where the curvature jumps the nearest element corner is put.
fn wall_parameters(wall: &HoleWall, points: &[[f64; 2]]) -> Vec<f64> {
    const LONGEST_STEP: f64 = 1.15;
    const LARGEST_MOVE: f64 = 0.45;
    let last = points.len() - 1;
    let start = wall.parameter_of(points[0]);
    // Counter-clockwise from the start; an edge spans less than half a turn.
    let radial: Vec<f64> = (0..=last)
        .step_by(2)
        .map(|i| if i == 0 { 0.0 } else { (wall.parameter_of(points[i]) - start).rem_euclid(TAU) })
        .collect();
    let n = radial.len() - 1;
    let equal = radial[n] / n as f64;
    let longest = radial.windows(2).map(|w| w[1] - w[0]).fold(equal, f64::max);
    let weight = 0.5f64.min((LONGEST_STEP - 1.0) * equal / (longest - equal).max(1e-12));
    let mut corners: Vec<f64> =
        radial.iter().enumerate().map(|(i, r)| start + (1.0 - weight) * equal * i as f64 + weight * r).collect();
    let mut is_moved = vec![false; n];
    for jump in wall.breaks() {
        let at = start + (jump - start).rem_euclid(TAU);
        let nearest = (1..n).min_by(|&i, &j| (corners[i] - at).abs().total_cmp(&(corners[j] - at).abs()));
        // The ends belong to the edges beside as well, and a corner that is far keeps its step.
        if let Some(i) = nearest.filter(|&i| !is_moved[i] && (corners[i] - at).abs() < LARGEST_MOVE * equal) {
            (corners[i], is_moved[i]) = (at, true);
        }
    }
    with_middles(&corners)
}
