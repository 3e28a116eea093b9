//! Sections of triangles by constrained Delaunay refinement: for every shape that quadrilaterals do not suit.

use std::collections::{HashMap, HashSet};
use std::f64::consts::{PI, TAU};

use spade::{AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation};

use super::domain::{COINCIDENT, Domain, SectionHole};
use super::error::MeshError;
use super::options::MeshOptions;
use super::section::{Section, sub};
use crate::specimen::{HoleWall, SectionEdge};

/// Smallest angle asked of the refinement, degrees.
const ANGLE_LIMIT_DEG: f64 = 30.0;
/// Boundary parts are at most this fraction of the distance to the next wall.
const GAP_FRACTION: f64 = 0.9;
/// Parameters closer than this are the same.
const SAME_PARAMETER: f64 = 1e-9;
/// Arcs of triangles span at most this part of a circle.
const MIN_SEGMENTS: f64 = 12.0;
/// Factors on the sizes of arcs and of parts beside gaps that are tried in turn.
const BOUNDARY_FINENESS: [f64; 5] = [1.0, 0.8, 0.65, 0.5, 0.35];

/// A curve of the boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Curve {
    Line([f64; 2], [f64; 2]),
    /// Wall of a hole from one parameter to another (angles of a circle).
    Wall {
        hole: usize,
        from: f64,
        to: f64,
    },
    /// A dumb-bell's side b = ±half-width between two positions a.
    Profile {
        upper: bool,
        from: f64,
        to: f64,
    },
}

impl Curve {
    fn is_straight(self, domain: &Domain) -> bool {
        match self {
            Curve::Line(..) => true,
            Curve::Wall { .. } => false,
            Curve::Profile { from, to, .. } => {
                let middle = 0.5 * (from + to).abs();
                domain.profile.is_none_or(|profile| {
                    let [start, _, end] = profile.knots_mm();
                    middle < start || middle > end
                })
            }
        }
    }

    fn at(self, domain: &Domain, t: f64) -> [f64; 2] {
        match self {
            Curve::Line(p, q) => [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])],
            Curve::Wall { hole, from, to } => domain.holes[hole].wall.point_at(from + t * (to - from)),
            Curve::Profile { upper, from, to } => {
                let a = from + t * (to - from);
                [a, if upper { domain.half_width(a) } else { -domain.half_width(a) }]
            }
        }
    }
}

/// A boundary part between two boundary points, by their indices.
type BoundaryEdges = HashMap<(usize, usize), (Curve, f64)>;

/// Triangulates the section, with finer and finer boundary parts until no triangle is worse than
/// `options.min_scaled_jacobian`; a long arc takes half its angle away from the corners of its triangle. If none is
/// good enough, the best is returned.
///
/// # Errors
/// [`MeshError::TooManyElements`], [`MeshError::Triangulation`], [`MeshError::RefinementIncomplete`].
pub(super) fn triangle_section(domain: &Domain, options: &MeshOptions) -> Result<Section, MeshError> {
    let mut best: Option<(f64, Section)> = None;
    let mut failure = None;
    for fineness in BOUNDARY_FINENESS {
        match triangulate(domain, options, fineness) {
            Ok(section) => {
                let (worst, _) = section.min_scaled_jacobian();
                if worst >= options.min_scaled_jacobian {
                    return Ok(section);
                }
                if best.as_ref().is_none_or(|(w, _)| worst > *w) {
                    best = Some((worst, section));
                }
            }
            // The first failure is at the size that was asked for.
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    match (best, failure) {
        (Some((_, section)), _) => Ok(section),
        (None, Some(error)) => Err(error),
        (None, None) => Err(MeshError::RefinementIncomplete { limit: 0 }),
    }
}

fn triangulate(domain: &Domain, options: &MeshOptions, fineness: f64) -> Result<Section, MeshError> {
    let (points, edges, loops) = divide_boundary(domain, options, fineness)?;
    let limit = options.max_elements / options.levels.div_ceil(2);
    let area = 0.5 * options.section_size_mm.powi(2);
    if domain.area() / area > limit as f64 {
        let elements = (domain.area() / area) as usize;
        return Err(MeshError::TooManyElements { elements, limit });
    }
    let mut triangulation = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut handles = Vec::with_capacity(points.len());
    for p in &points {
        let handle = triangulation.insert(Point2::new(p[0], p[1]));
        handles.push(handle.map_err(|_| MeshError::Triangulation { x_mm: p[0], y_mm: p[1] })?);
    }
    // Fixed order: a hash map's would differ between runs.
    let mut ordered: Vec<(usize, usize)> = edges.keys().copied().collect();
    ordered.sort_unstable();
    for &(u, v) in &ordered {
        if handles[u] == handles[v] || !triangulation.can_add_constraint(handles[u], handles[v]) {
            return Err(MeshError::Triangulation { x_mm: points[u][0], y_mm: points[u][1] });
        }
        triangulation.add_constraint(handles[u], handles[v]);
    }
    let vertices = 20 * points.len() + 4 * limit.min((domain.area() / area) as usize + 100);
    // Lines inside would confuse which side of a constraint is outside: there the holes are taken out afterwards.
    let has_lines = !domain.lines.is_empty();
    let parameters = RefinementParameters::<f64>::new()
        .exclude_outer_faces(!has_lines)
        .keep_constraint_edges()
        .with_angle_limit(AngleLimit::from_deg(ANGLE_LIMIT_DEG))
        .with_max_allowed_area(area)
        .with_max_additional_vertices(vertices);
    let result = triangulation.refine(parameters);
    if !result.refinement_complete {
        return Err(MeshError::RefinementIncomplete { limit: vertices });
    }
    let excluded: HashSet<_> = result.excluded_faces.iter().copied().collect();
    let boundary: BoundaryEdges =
        edges.into_iter().map(|((u, v), curve)| (sorted(handles[u].index(), handles[v].index()), curve)).collect();

    let mut section = Section { nodes_per_cell: 7, points: Vec::new(), cells: Vec::new() };
    let mut corner_of: HashMap<usize, u32> = HashMap::new();
    let mut middle_of: HashMap<(usize, usize), u32> = HashMap::new();
    for face in triangulation.inner_faces() {
        if excluded.contains(&face.fix()) {
            continue;
        }
        let corners = face.vertices().map(|v| (v.fix().index(), [v.position().x, v.position().y]));
        let center = [0, 1].map(|c| corners.iter().map(|(_, p)| p[c]).sum::<f64>() / 3.0);
        // Outside of the outline are notches.
        if has_lines && loops.iter().enumerate().any(|(n, polygon)| is_in_polygon(center, polygon) == (n > 0)) {
            continue;
        }
        let mut cell = [0u32; 7];
        for (k, &(vertex, p)) in corners.iter().enumerate() {
            cell[k] = *corner_of.entry(vertex).or_insert_with(|| push(&mut section.points, p));
        }
        for k in 0..3 {
            let ((u, p), (v, q)) = (corners[k], corners[(k + 1) % 3]);
            cell[3 + k] = *middle_of.entry(sorted(u, v)).or_insert_with(|| {
                let straight = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
                let middle = boundary.get(&sorted(u, v)).map_or(straight, |&(curve, t)| curve.at(domain, t));
                push(&mut section.points, middle)
            });
        }
        // Where the quadratic map of the six outer nodes takes the centroid.
        let center = [0, 1].map(|c| {
            (4.0 * (3..6).map(|k| section.points[cell[k] as usize][c]).sum::<f64>()
                - (0..3).map(|k| section.points[cell[k] as usize][c]).sum::<f64>())
                / 9.0
        });
        cell[6] = push(&mut section.points, center);
        section.cells.extend(cell);
    }
    if section.num_cells() > limit {
        return Err(MeshError::TooManyElements { elements: section.num_cells(), limit });
    }
    Ok(section)
}

fn sorted(u: usize, v: usize) -> (usize, usize) {
    (u.min(v), u.max(v))
}

fn push(points: &mut Vec<[f64; 2]>, p: [f64; 2]) -> u32 {
    points.push(p);
    points.len() as u32 - 1
}

/// Closed loops of curves: the outline first, then the holes within it.
fn boundary_loops(domain: &Domain) -> Vec<Vec<Curve>> {
    let mut loops = vec![outline_curves(domain)];
    for (hole, d) in domain.holes.iter().enumerate() {
        if !d.is_half && d.notch.is_none() {
            // Two halves: no part may span the whole wall.
            loops.push(wall_curves(domain, hole, &[TAU, PI, 0.0]));
        }
    }
    loops
}

/// The outline counter-clockwise, from the lower end at −a.
fn outline_curves(domain: &Domain) -> Vec<Curve> {
    let ([a, b], bottom) = (domain.half, domain.bottom);
    // Where lines end on a side parallel to axis `c`, on the given side of the section.
    let ends_on = |c: usize, value: f64| -> Vec<f64> {
        let tolerance = 1e-9 * domain.scale();
        let on = domain.lines.iter().flatten().filter(|p| (p[1 - c] - value).abs() < tolerance).map(|p| p[c]);
        let half = domain.half[c];
        let mut found: Vec<f64> = on.filter(|x| x.abs() < half - tolerance).collect();
        found.sort_by(f64::total_cmp);
        found.dedup_by(|x, y| (*x - *y).abs() < tolerance);
        found
    };
    let knots = domain.profile.map_or(vec![-a, a], |profile| {
        let [x0, x1, x2] = profile.knots_mm();
        vec![-a, -x2, -x1, -x0, x0, x1, x2, a]
    });
    let with_ends = |ends: Vec<f64>| -> Vec<f64> {
        let mut all: Vec<f64> = knots.iter().copied().chain(ends).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    let upright = |x: f64| -> Vec<f64> {
        std::iter::once(bottom).chain(ends_on(1, x).into_iter().filter(|z| *z > bottom)).chain([b]).collect()
    };
    let falling = |mut rising: Vec<f64>| {
        rising.reverse();
        rising
    };
    let mut outline = if bottom < 0.0 {
        side(domain, SectionEdge::MinusLateral, &with_ends(ends_on(0, -b)))
    } else {
        mirror_line(domain)
    };
    outline.extend(side(domain, SectionEdge::PlusX, &upright(a)));
    outline.extend(side(domain, SectionEdge::PlusLateral, &falling(with_ends(ends_on(0, b)))));
    outline.extend(side(domain, SectionEdge::MinusX, &falling(upright(-a))));
    outline
}

/// The mirror line from −a to a, around the holes that it cuts in half.
fn mirror_line(domain: &Domain) -> Vec<Curve> {
    let a = domain.half[0];
    let mut halves: Vec<usize> = (0..domain.holes.len()).filter(|&i| domain.holes[i].is_half).collect();
    halves.sort_by(|&i, &j| domain.holes[i].center()[0].total_cmp(&domain.holes[j].center()[0]));
    let (mut line, mut from, mut to) = (Vec::new(), -a, a);
    for hole in halves {
        let SectionHole { wall, notch, .. } = &domain.holes[hole];
        let (center, reach) = (wall.center_mm()[0], wall.half_extents_mm()[0]);
        match notch.map(|notch| notch.side) {
            Some(SectionEdge::MinusX) => from = center + reach,
            Some(_) => to = center - reach,
            None => {
                line.push(Curve::Line([from, 0.0], [center - reach, 0.0]));
                line.extend(wall_curves(domain, hole, &[PI, 0.0]));
                from = center + reach;
            }
        }
    }
    line.push(Curve::Line([from, 0.0], [to, 0.0]));
    line
}

/// One side of the section along the outline, parted at `knots` (in the order of passing them) and cut open by its
/// notches.
fn side(domain: &Domain, edge: SectionEdge, knots: &[f64]) -> Vec<Curve> {
    let (across, sign) = edge.axis_and_sign();
    let along = 1 - across;
    let is_upper = edge == SectionEdge::PlusLateral;
    if across == 1 && domain.profile.is_some() {
        return knots.windows(2).map(|w| Curve::Profile { upper: is_upper, from: w[0], to: w[1] }).collect();
    }
    let travel = (knots[knots.len() - 1] - knots[0]).signum();
    let mut notches: Vec<usize> =
        (0..domain.holes.len()).filter(|&i| domain.holes[i].notch.is_some_and(|notch| notch.side == edge)).collect();
    let place = |hole: usize| travel * domain.holes[hole].center()[along];
    notches.sort_by(|&i, &j| place(i).total_cmp(&place(j)));
    let point = |value: f64| {
        let mut p = [sign * domain.half[across]; 2];
        p[along] = value;
        p
    };
    let straight = |curves: &mut Vec<Curve>, from: f64, to: f64| {
        let between = knots.iter().copied().filter(|k| travel * k > travel * from && travel * k < travel * to);
        let ends: Vec<f64> = std::iter::once(from).chain(between).chain([to]).collect();
        curves.extend(ends.windows(2).map(|w| Curve::Line(point(w[0]), point(w[1]))));
    };
    let (mut curves, mut from, mut is_open) = (Vec::new(), knots[0], true);
    for hole in notches {
        let SectionHole { notch: Some(notch), is_half, .. } = &domain.holes[hole] else { continue };
        let ([first, last], [enter, leave]) = (notch.wall_angles(), notch.mouth_mm().map(|p| p[along]));
        // The mirror line cuts a notch of an end where the outline comes from it, or where it goes to it.
        let middle = notch.inward_angle();
        match (is_half, edge) {
            (true, SectionEdge::PlusX) => curves.extend(wall_curves(domain, hole, &[middle, last])),
            (true, _) => {
                straight(&mut curves, from, enter);
                curves.extend(wall_curves(domain, hole, &[first, middle]));
                is_open = false;
            }
            (false, _) => {
                straight(&mut curves, from, enter);
                curves.extend(wall_curves(domain, hole, &[first, last]));
            }
        }
        from = leave;
    }
    if is_open {
        straight(&mut curves, from, knots[knots.len() - 1]);
    }
    curves
}

/// The wall of a hole between falling parameters, parted where its curvature jumps.
fn wall_curves(domain: &Domain, hole: usize, knots: &[f64]) -> Vec<Curve> {
    let (first, last) = (knots[0], knots[knots.len() - 1]);
    let jumps = domain.holes[hole].wall.breaks().into_iter().map(|jump| jump.rem_euclid(TAU));
    let mut all: Vec<f64> = knots.iter().copied().chain(jumps.filter(|t| *t < first && *t > last)).collect();
    all.sort_by(|s, t| t.total_cmp(s));
    all.dedup_by(|s, t| (*s - *t).abs() < SAME_PARAMETER);
    all.windows(2).map(|w| Curve::Wall { hole, from: w[0], to: w[1] }).collect()
}

/// Whether a point lies in a polygon: a ray from it crosses its sides an odd number of times.
fn is_in_polygon(p: [f64; 2], polygon: &[[f64; 2]]) -> bool {
    let mut is_in = false;
    for (i, a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if (a[1] > p[1]) != (b[1] > p[1]) && p[0] < a[0] + (p[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) {
            is_in = !is_in;
        }
    }
    is_in
}

/// Points of the boundary and the lines, the parts between them, and the polygons of the outline and of holes within.
type Division = (Vec<[f64; 2]>, BoundaryEdges, Vec<Vec<[f64; 2]>>);

/// Boundary points and the parts between them; each part remembers its curve and the parameter of its middle.
fn divide_boundary(domain: &Domain, options: &MeshOptions, fineness: f64) -> Result<Division, MeshError> {
    let (mut points, mut edges) = (Vec::new(), BoundaryEdges::new());
    let mut loops = Vec::new();
    for curves in boundary_loops(domain) {
        let first = points.len();
        for &curve in &curves {
            for pair in parameters(domain, options, fineness, curve)?.windows(2) {
                edges.insert((points.len(), points.len() + 1), (curve, 0.5 * (pair[0] + pair[1])));
                points.push(curve.at(domain, pair[0]));
            }
        }
        // The last part returns to the loop's first point.
        let last = points.len() - 1;
        if let Some(closing) = edges.remove(&(last, last + 1)) {
            edges.insert((first, last), closing);
        }
        loops.push(points[first..].to_vec());
    }
    for &[from, to] in &domain.lines {
        let line = Curve::Line(from, to);
        let mut last = place_of(&mut points, from, domain);
        for pair in parameters(domain, options, fineness, line)?.windows(2) {
            // Half the size: what ends at a line is singular there.
            let middle = 0.5 * (pair[0] + pair[1]);
            for [start, end] in [[pair[0], middle], [middle, pair[1]]] {
                let next = place_of(&mut points, line.at(domain, end), domain);
                edges.insert((last, next), (line, 0.5 * (start + end)));
                last = next;
            }
        }
    }
    Ok((points, edges, loops))
}

/// The place of a point that may be there already: lines start and end on the outline or on each other.
fn place_of(points: &mut Vec<[f64; 2]>, p: [f64; 2], domain: &Domain) -> usize {
    let tolerance = 1e-9 * domain.scale();
    let known = points.iter().position(|q| (q[0] - p[0]).hypot(q[1] - p[1]) < tolerance);
    known.unwrap_or_else(|| {
        points.push(p);
        points.len() - 1
    })
}

/// Parameters that divide a curve into parts of the local size, by equal shares of ∫ ds / size.
fn parameters(domain: &Domain, options: &MeshOptions, fineness: f64, curve: Curve) -> Result<Vec<f64>, MeshError> {
    const SAMPLES: usize = 256;
    let point = |i: usize| curve.at(domain, i as f64 / SAMPLES as f64);
    let mut shares = vec![0.0];
    let mut sum = 0.0;
    for i in 0..SAMPLES {
        let (p, q) = (point(i), point(i + 1));
        let step = sub(q, p);
        let middle = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
        sum += step[0].hypot(step[1]) / local_size(domain, options, fineness, curve, middle);
        shares.push(sum);
    }
    if sum > options.max_elements as f64 {
        return Err(MeshError::TooManyElements { elements: sum as usize, limit: options.max_elements });
    }
    let n = (sum.round() as usize).max(if curve.is_straight(domain) { 1 } else { 2 });
    let mut parameters = vec![0.0];
    let mut i = 0;
    for k in 1..n {
        let target = sum * k as f64 / n as f64;
        while i + 1 < SAMPLES && shares[i + 1] < target {
            i += 1;
        }
        let within = (target - shares[i]) / (shares[i + 1] - shares[i]);
        parameters.push((i as f64 + within) / SAMPLES as f64);
    }
    parameters.push(1.0);
    Ok(parameters)
}

/// Whether a point of the outline lies on the side that a hole opens to.
fn is_on_open_side(domain: &Domain, hole: &SectionHole, p: [f64; 2]) -> bool {
    hole.notch.is_some_and(|notch| {
        let ((axis, sign), half) = (notch.side.axis_and_sign(), domain.half);
        (half[axis] - sign * p[axis]).abs() < COINCIDENT * half[axis]
    })
}

/// Length wanted for a part of `curve` at `p`: the element size (finer on graded sides), the holes' own resolution, and
/// no more than the gap to the next wall.
fn local_size(domain: &Domain, options: &MeshOptions, fineness: f64, curve: Curve, p: [f64; 2]) -> f64 {
    let segments = (options.hole_segments as f64).max(MIN_SEGMENTS);
    let arc = |wall: &HoleWall| fineness * TAU * wall.speed_at(wall.parameter_of(p)) / (segments * wall.parts_factor());
    let mut size = options.section_size_mm;
    let mut own = None;
    let mut gap = f64::INFINITY;
    match curve {
        Curve::Wall { hole, .. } => {
            own = Some(hole);
            let d = &domain.holes[hole];
            size = size.min(arc(&d.wall));
            gap = match d.notch {
                None => domain.outline_distance(p),
                Some(notch) => domain.distance_to_other_sides(p, notch.side),
            };
            if domain.bottom == 0.0 && !d.is_half {
                gap = gap.min(p[1]);
            }
        }
        Curve::Profile { .. } => size = size.min(domain.half_width(p[0])),
        Curve::Line(..) => {}
    }
    for (i, d) in domain.holes.iter().enumerate() {
        if own != Some(i) {
            let distance = d.wall.distance_mm(p);
            // On the mirror line the wall of a half hole starts, and on its side that of a notch: no gap there.
            let is_on_mirror = d.is_half && domain.bottom == 0.0 && p[1].abs() < 1e-12;
            let touches = is_on_mirror || (own.is_none() && is_on_open_side(domain, d, p));
            if touches {
                size = size.min(arc(&d.wall) + 0.5 * distance.max(0.0));
            } else {
                gap = gap.min(distance);
            }
        }
    }
    size.min((fineness * GAP_FRACTION * gap).max(1e-4 * domain.scale()))
}
