//! Sections of quadrilaterals: structured grids, and an O-grid in the power-diagram cell of each hole.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use super::domain::{Disc, Domain};
use super::error::MeshError;
use super::grading::{divide, with_middles};
use super::options::MeshOptions;
use super::power::{PowerDiagram, Rectangle};
use super::section::{PointMerger, Section, dot, sub};

/// The best section of quadrilaterals for `domain`, or `None` where quadrilaterals are no use.
///
/// With holes, several inner rectangles around them are tried (what is outside becomes structured strips), and the
/// section with the best shape for its size is taken.
///
/// # Errors
/// [`MeshError::TooManyElements`].
pub(super) fn quad_section(domain: &Domain, options: &MeshOptions) -> Result<Option<Section>, MeshError> {
    if domain.discs.is_empty() {
        return structured_section(domain, options).map(Some);
    }
    if domain.is_dumbbell {
        return Ok(None);
    }
    let area = domain.area();
    let mut best: Option<(f64, Section)> = None;
    for rectangle in inner_rectangles(domain, options) {
        for collapse in [0.45, 0.15] {
            let Some(section) = holed_section(domain, options, rectangle, collapse * options.section_size_mm)? else {
                continue;
            };
            let (worst, _) = section.min_scaled_jacobian();
            if worst < options.min_scaled_jacobian {
                continue;
            }
            let expected = area / options.section_size_mm.powi(2);
            let excess = (section.num_cells() as f64 / expected).max(1.0).ln();
            let score = worst.min(0.5) + section.mean_shape() - 0.2 * excess;
            if best.as_ref().is_none_or(|(s, _)| score > s + 1e-9) {
                best = Some((score, section));
            }
        }
    }
    Ok(best.map(|(_, section)| section))
}

/// Number of parts for a length, refused if absurd.
fn count(length: f64, options: &MeshOptions) -> Result<usize, MeshError> {
    let n = (length / options.section_size_mm).round();
    if n > options.max_elements as f64 {
        return Err(MeshError::TooManyElements { elements: n as usize, limit: options.max_elements });
    }
    Ok((n as usize).max(1))
}

fn limit_cells(cells: usize, options: &MeshOptions) -> Result<(), MeshError> {
    if cells.saturating_mul(options.levels.div_ceil(2)) > options.max_elements {
        return Err(MeshError::TooManyElements { elements: cells, limit: options.max_elements });
    }
    Ok(())
}

/// `low` to `high` in `n` graded parts, with middles.
fn line(low: f64, high: f64, n: usize, start: f64, end: f64) -> Vec<f64> {
    with_middles(&divide(n, start, end)).iter().map(|u| low + (high - low) * u).collect()
}

/// Block or dumb-bell without holes.
fn structured_section(domain: &Domain, options: &MeshOptions) -> Result<Section, MeshError> {
    let [a, b] = domain.half;
    let grading = domain.grading;
    let along = if domain.is_dumbbell {
        let [x0, x1, x2] = domain.arc_ends();
        // The narrow part is a third as wide as the ends: its elements are made shorter.
        let n = |length: f64, factor: f64| count(length * factor, options);
        let end = line(x2, a, n(a - x2, 1.0)?, 1.0, grading.ends);
        let outer = line(x1, x2, n(x2 - x1, 1.2)?.max(2), 1.0, 1.0);
        let inner = line(x0, x1, n(x1 - x0, 1.4)?.max(2), 1.0, 1.0);
        let narrow = line(-x0, x0, 2 * n(x0, 1.4)?, 1.0, 1.0);
        let mut all: Vec<f64> = end.iter().rev().chain(outer.iter().rev().skip(1)).map(|x| -x).collect();
        all.extend(inner.iter().rev().skip(1).map(|x| -x));
        all.extend(&narrow[1..]);
        for part in [inner, outer, end] {
            all.extend(&part[1..]);
        }
        all
    } else {
        line(-a, a, count(2.0 * a, options)?.max(2), grading.ends, grading.ends)
    };
    let lower = if domain.bottom < 0.0 { grading.sides } else { 1.0 };
    let width = b - domain.bottom;
    let across_count = if domain.is_dumbbell { count(width, options)?.max(2) } else { count(width, options)? };
    let across = line(domain.bottom / b, 1.0, across_count, lower, grading.sides);
    limit_cells((along.len() / 2) * (across.len() / 2), options)?;
    let mut builder = Builder::new(domain);
    builder.grid(along.len(), across.len(), |i, j| [along[i], across[j] * domain.half_width(along[i])]);
    Ok(builder.finish())
}

/// Rectangles around all holes, the whole section first. The distance kept from a hole is a multiple of its radius.
fn inner_rectangles(domain: &Domain, options: &MeshOptions) -> Vec<Rectangle> {
    const RADII: [f64; 4] = [f64::INFINITY, 3.4, 2.5, 1.8];
    let outer = Rectangle { low: [-domain.half[0], domain.bottom], high: domain.half };
    let reach = |c: usize, sign: f64, k: f64| {
        domain.discs.iter().map(|d| sign * d.center[c] + k * d.radius).fold(f64::NEG_INFINITY, f64::max)
    };
    let has_half = domain.discs.iter().any(|d| d.is_half);
    let side = |c: usize, upper: bool, k: f64| {
        let sign = if upper { 1.0 } else { -1.0 };
        let limit = if upper { outer.high[c] } else { -outer.low[c] };
        let position = reach(c, sign, k);
        // A strip thinner than half an element is not worth its own layer.
        let no_strip = limit - position < 0.5 * options.section_size_mm || (c == 1 && !upper && has_half);
        sign * if no_strip { limit } else { position }
    };
    let mut rectangles: Vec<Rectangle> = Vec::new();
    for k1 in RADII {
        for k0 in RADII {
            let r = Rectangle {
                low: [side(0, false, k0), side(1, false, k1)],
                high: [side(0, true, k0), side(1, true, k1)],
            };
            let same = |q: &Rectangle| {
                (0..2).all(|c| (q.low[c] - r.low[c]).abs() + (q.high[c] - r.high[c]).abs() < 1e-9 * domain.scale())
            };
            if !rectangles.iter().any(same) {
                rectangles.push(r);
            }
        }
    }
    rectangles
}

/// Cells around the holes in `inner`, structured strips outside it.
fn holed_section(
    domain: &Domain,
    options: &MeshOptions,
    inner: Rectangle,
    shortest: f64,
) -> Result<Option<Section>, MeshError> {
    let Some(diagram) = PowerDiagram::new(inner, &domain.discs, shortest) else { return Ok(None) };
    let layout = Layout { domain, options, inner, diagram };
    let edges = layout.divide_edges()?;
    let mut builder = Builder::new(domain);
    let mut cells = 0;
    for index in 0..domain.discs.len() {
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
}

impl Layout<'_> {
    fn tolerance(&self) -> f64 {
        1e-7 * self.domain.scale()
    }

    /// Bits of the block's graded outer sides that a point lies on (mirror line not counted).
    fn outer_sides(&self, p: [f64; 2]) -> u8 {
        let [a, b] = self.domain.half;
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

    /// Points of every edge, from its vertex with the smaller index to the other, with middles: the same for both cells.
    fn divide_edges(&self) -> Result<BTreeMap<(usize, usize), Vec<[f64; 2]>>, MeshError> {
        let vertices = &self.diagram.vertices;
        // Per edge: parts asked for, feet of the centres, product of their distances, number of cells.
        let mut facts: BTreeMap<(usize, usize), (usize, f64, f64, u32)> = BTreeMap::new();
        for (polygon, disc) in self.diagram.polygons.iter().zip(&self.domain.discs) {
            for (u, v) in polygon.edges() {
                let (u, v) = key(u, v);
                let along = sub(vertices[v], vertices[u]);
                let length = dot(along, along).sqrt();
                let to_center = sub(disc.center, vertices[u]);
                let foot = dot(to_center, along) / length;
                let distance = (dot(to_center, to_center) - foot * foot).max(0.0).sqrt();
                let angle = ((length - foot) / distance).atan() + (foot / distance).atan();
                let around = (angle / TAU * self.options.hole_segments as f64).round() as usize;
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
        let disc = &self.domain.discs[index];
        let (mut sum, mut weight) = (0.0, 0.0);
        for (u, v) in self.diagram.polygons[index].edges() {
            for i in 0..8 {
                let s = (f64::from(i) + 0.5) / 8.0;
                let p = [0, 1].map(|c| {
                    (1.0 - s) * self.diagram.vertices[u][c] + s * self.diagram.vertices[v][c] - disc.center[c]
                });
                let gap = dot(p, p).sqrt() - disc.radius;
                sum += gap * gap;
                weight += 1.0;
            }
        }
        Ok(count((sum / weight).sqrt(), self.options)?.max(self.options.radial_layers))
    }

    /// Patches between the hole's arc and each edge of its cell.
    fn o_grid(
        &self,
        index: usize,
        layers: usize,
        edges: &BTreeMap<(usize, usize), Vec<[f64; 2]>>,
        builder: &mut Builder,
    ) {
        let disc = &self.domain.discs[index];
        let wall = self.domain.grading.holes;
        let inner_steps = with_middles(&divide(layers, wall, 1.0));
        for (u, v) in self.diagram.polygons[index].edges() {
            let mut points = edges[&key(u, v)].clone();
            if u > v {
                points.reverse();
            }
            let last = points.len() - 1;
            let angles = arc_angles(disc, &points);
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
                        let graded = with_middles(&divide(layers, wall, self.ratio(15)));
                        // Between "graded at the wall only" and "graded at both ends".
                        let w = fade.ln() / self.ratio(15).ln();
                        graded.iter().zip(&inner_steps).map(|(g, h)| w * g + (1.0 - w) * h).collect()
                    } else {
                        inner_steps.clone()
                    }
                })
                .collect();
            builder.grid(2 * layers + 1, points.len(), |i, j| {
                let on_arc =
                    [disc.center[0] + disc.radius * angles[j].cos(), disc.center[1] + disc.radius * angles[j].sin()];
                let t = steps[j][i];
                if i == 2 * layers { points[j] } else { [0, 1].map(|c| (1.0 - t) * on_arc[c] + t * points[j][c]) }
            });
        }
    }

    /// Structured grids outside the inner rectangle, continuing the divisions of its sides.
    fn strips(&self, edges: &BTreeMap<(usize, usize), Vec<[f64; 2]>>, builder: &mut Builder) -> Result<(), MeshError> {
        let domain = self.domain;
        let (low, high) = ([-domain.half[0], domain.bottom], domain.half);
        let lower_ratio = if domain.bottom < 0.0 { domain.grading.sides } else { 1.0 };
        let ratios = [[domain.grading.ends, domain.grading.ends], [lower_ratio, domain.grading.sides]];
        let strip = |c: usize, upper: bool| -> Result<Option<Vec<f64>>, MeshError> {
            let (from, to) = if upper { (self.inner.high[c], high[c]) } else { (low[c], self.inner.low[c]) };
            if to - from < self.tolerance() {
                return Ok(None);
            }
            let n = count(to - from, self.options)?;
            let ratio = ratios[c][usize::from(upper)];
            Ok(Some(if upper { line(from, to, n, 1.0, ratio) } else { line(from, to, n, ratio, 1.0) }))
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

/// Angles of the arc's points that face `points`: between equal angles and straight radial lines, and with the middles
/// exactly midway so that each element's arc is divided evenly.
fn arc_angles(disc: &Disc, points: &[[f64; 2]]) -> Vec<f64> {
    let angle = |p: [f64; 2]| (p[1] - disc.center[1]).atan2(p[0] - disc.center[0]);
    let last = points.len() - 1;
    let start = angle(points[0]);
    // Counter-clockwise from the start; an edge spans less than half a turn.
    let span = |p: [f64; 2]| (angle(p) - start).rem_euclid(TAU);
    let whole = span(points[last]);
    let corners: Vec<f64> = (0..=last)
        .step_by(2)
        .map(|i| {
            let equal = whole * i as f64 / last as f64;
            let radial = if i == 0 { 0.0 } else { span(points[i]) };
            start + 0.5 * (equal + radial)
        })
        .collect();
    with_middles(&corners)
}

/// Collects grids into a section.
struct Builder {
    merger: PointMerger,
    cells: Vec<u32>,
}

impl Builder {
    fn new(domain: &Domain) -> Self {
        Builder { merger: PointMerger::new(domain), cells: Vec::new() }
    }

    /// A grid of `ni` × `nj` points (odd numbers; every other one is a middle). The first direction turned
    /// counter-clockwise gives the second.
    fn grid(&mut self, ni: usize, nj: usize, point: impl Fn(usize, usize) -> [f64; 2]) {
        let mut indices = Vec::with_capacity(ni * nj);
        for j in 0..nj {
            for i in 0..ni {
                indices.push(self.merger.insert(point(i, j)));
            }
        }
        for j in (0..nj - 1).step_by(2) {
            for i in (0..ni - 1).step_by(2) {
                for b in 0..3 {
                    for a in 0..3 {
                        self.cells.push(indices[i + a + ni * (j + b)]);
                    }
                }
            }
        }
    }

    fn finish(self) -> Section {
        Section { nodes_per_cell: 9, points: self.merger.points, cells: self.cells }
    }
}
