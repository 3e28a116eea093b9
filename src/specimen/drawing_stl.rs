//! The specimen as a closed surface (binary STL) for printing moulds and cores.
//!
//! The section is triangulated (constrained Delaunay, spade) without adding points, capped at both ends and
//! walled along its boundary. Curves are chords within [`CHORD_ERROR_MM`] of the curve.

use super::section_loop::{SectionCurve, outline};
use super::{HoleAxis, Specimen};
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Largest distance between a curve and its chords, mm.
const CHORD_ERROR_MM: f64 = 0.008;
/// Fewest chords around a circle.
const MIN_CHORDS: usize = 24;

/// Why a drawing cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DrawingError {
    /// The specimen is not valid.
    #[error("no drawing of an invalid specimen: {0}")]
    Invalid(#[from] super::SpecimenError),
    /// The section cannot be triangulated.
    #[error("the section with {num_points} boundary points cannot be triangulated: {reason}; move the holes apart")]
    Triangulation {
        /// Number of boundary points.
        num_points: usize,
        /// What failed.
        reason: String,
    },
}

/// A boundary point of the section: position and the loop that it is on (0 the outline, i + 1 hole i).
#[derive(Clone, Copy)]
struct BoundaryPoint {
    position: Point2<f64>,
    loop_index: usize,
}

impl HasPosition for BoundaryPoint {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// The specimen as a watertight binary STL, mm, in the specimen's frame, with outward normals.
///
/// # Errors
/// [`DrawingError`]: the specimen is invalid, or its section cannot be triangulated.
pub fn to_stl(specimen: &Specimen) -> Result<Vec<u8>, DrawingError> {
    specimen.validate()?;
    let (points, triangles) = triangulate_section(specimen)?;
    let facets = extrude(specimen, &points, &triangles);

    let mut bytes = Vec::with_capacity(84 + 50 * facets.len());
    let mut header = [b' '; 80];
    let title = b"lambdak specimen, mm";
    header[..title.len()].copy_from_slice(title);
    bytes.extend_from_slice(&header);
    bytes.extend_from_slice(&(facets.len() as u32).to_le_bytes());
    for facet in &facets {
        for value in normal_of(facet).iter().chain(facet.iter().flatten()) {
            bytes.extend_from_slice(&(*value as f32).to_le_bytes());
        }
        bytes.extend_from_slice(&[0, 0]);
    }
    Ok(bytes)
}

/// Chords for an arc of `angle` (radians) so that they stay within the chord error.
fn num_chords(radius: f64, angle: f64) -> usize {
    let step = 2.0 * (1.0 - CHORD_ERROR_MM / radius).clamp(-1.0, 1.0).acos();
    let around = ((TAU / step).ceil() as usize).max(MIN_CHORDS);
    ((around as f64 * angle / TAU).ceil() as usize).max(2)
}

/// The outline in the section (x, lateral), counter-clockwise.
fn outline_points(specimen: &Specimen) -> Vec<[f64; 2]> {
    let pieces = outline(specimen);
    let mut points = Vec::with_capacity(pieces.len());
    for (i, piece) in pieces.iter().enumerate() {
        points.push(piece.start_mm);
        let SectionCurve::Conic { conic, is_counterclockwise } = piece.curve else { continue };
        // Of an outline all conics are circles.
        let (center, radius) = (conic.center_mm, conic.half_mm[0]);
        let angle_of = |p: [f64; 2]| (p[1] - center[1]).atan2(p[0] - center[0]);
        let (from, to) = (angle_of(piece.start_mm), angle_of(pieces[(i + 1) % pieces.len()].start_mm));
        let turn = if is_counterclockwise { (to - from).rem_euclid(TAU) } else { -(from - to).rem_euclid(TAU) };
        let n = num_chords(radius, turn.abs());
        for k in 1..n {
            let (sin, cos) = (from + turn * k as f64 / n as f64).sin_cos();
            points.push([center[0] + radius * cos, center[1] + radius * sin]);
        }
    }
    points
}

type Section = (Vec<[f64; 2]>, Vec<[usize; 3]>);

/// Points of the section and its triangles, counter-clockwise in (x, lateral).
fn triangulate_section(specimen: &Specimen) -> Result<Section, DrawingError> {
    let mut loops = vec![outline_points(specimen)];
    for hole in specimen.holes.iter().filter(|hole| !hole.is_notch) {
        let wall = hole.wall();
        // Of an ellipse, a circle of half its length that is shortened, and of a slot the half circles take the most.
        let [a, b] = wall.half_mm();
        let around = if wall.breaks().is_empty() { num_chords(a, TAU) as f64 } else { num_chords(b, TAU) as f64 };
        let n = if wall.is_circle() { around } else { (around * wall.parts_factor()).ceil() } as usize;
        loops.push((0..n).map(|i| wall.point_at(TAU * i as f64 / n as f64)).collect());
    }
    let num_points = loops.iter().map(Vec::len).sum();
    let failed = |reason: String| DrawingError::Triangulation { num_points, reason };
    let mut points = Vec::with_capacity(num_points);
    let mut edges = Vec::with_capacity(num_points);
    for (loop_index, ring) in loops.iter().enumerate() {
        let first = points.len();
        for (i, p) in ring.iter().enumerate() {
            // spade refuses tiny coordinates that are not zero, as sin π gives; they are zero here.
            let clean = p.map(|c| if c.abs() < 1e-9 { 0.0 } else { c });
            points.push(BoundaryPoint { position: Point2::new(clean[0], clean[1]), loop_index });
            edges.push([first + i, first + (i + 1) % ring.len()]);
        }
    }
    let mut num_conflicts = 0;
    let triangulation = ConstrainedDelaunayTriangulation::<BoundaryPoint>::try_bulk_load_cdt(points, edges, |_| {
        num_conflicts += 1;
    })
    .map_err(|error| failed(error.to_string()))?;
    if num_conflicts > 0 || triangulation.num_vertices() != num_points {
        return Err(failed(format!("{num_conflicts} boundary edges cross")));
    }

    let positions = triangulation.vertices().map(|v| [v.position().x, v.position().y]).collect();
    let triangles = triangulation
        .inner_faces()
        .filter(|face| {
            let corners = face.vertices();
            let on = corners.map(|v| v.data().loop_index);
            // A triangle with its corners on one hole lies in it, as the hole's polygon is convex.
            let is_on_one_loop = on[0] == on[1] && on[1] == on[2];
            if !is_on_one_loop {
                return true;
            }
            on[0] == 0 && is_in_polygon(&loops[0], [face.center().x, face.center().y])
        })
        .map(|face| face.vertices().map(|v| v.index()))
        .collect();
    Ok((positions, triangles))
}

/// Whether a point lies in a polygon, by the number of edges that a ray along +x crosses.
fn is_in_polygon(polygon: &[[f64; 2]], p: [f64; 2]) -> bool {
    let mut is_inside = false;
    for (i, a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if (a[1] > p[1]) != (b[1] > p[1]) && p[0] < a[0] + (b[0] - a[0]) * (p[1] - a[1]) / (b[1] - a[1]) {
            is_inside = !is_inside;
        }
    }
    is_inside
}

/// Caps and walls, each facet's corners counter-clockwise seen from outside.
fn extrude(specimen: &Specimen, points: &[[f64; 2]], triangles: &[[usize; 3]]) -> Vec<[[f64; 3]; 3]> {
    let half = 0.5 * specimen.extrusion_mm();
    // (x, z) extruded along y is left-handed: swap two corners of every facet there.
    let is_left_handed = specimen.extrusion_axis() == HoleAxis::Thickness;
    let place = |index: usize, along: f64| {
        let [x, b] = points[index];
        let along = specimen.block.taper().raised([x, along, 0.0])[1];
        if is_left_handed { [x, along, b] } else { [x, b, along] }
    };
    let orient = |[a, b, c]: [[f64; 3]; 3]| if is_left_handed { [a, c, b] } else { [a, b, c] };

    // A directed edge whose reverse is in no triangle is on the boundary, with the material on its left.
    let mut directed: HashMap<(usize, usize), ()> = HashMap::new();
    for [a, b, c] in triangles {
        for edge in [(*a, *b), (*b, *c), (*c, *a)] {
            directed.insert(edge, ());
        }
    }
    let mut facets = Vec::new();
    for [a, b, c] in triangles.iter().copied() {
        facets.push(orient([place(a, half), place(b, half), place(c, half)]));
        facets.push(orient([place(a, -half), place(c, -half), place(b, -half)]));
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if !directed.contains_key(&(to, from)) {
                facets.push(orient([place(from, -half), place(to, -half), place(to, half)]));
                facets.push(orient([place(from, -half), place(to, half), place(from, half)]));
            }
        }
    }
    facets
}

fn normal_of(facet: &[[f64; 3]; 3]) -> [f64; 3] {
    let [a, b, c] = facet;
    let u = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    let v = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    if length > 0.0 { n.map(|c| c / length) } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::sampling::{dumbbell_with_hole, valid_specimen, valid_wedge};
    use proptest::prelude::*;

    fn read(bytes: &[u8]) -> Vec<([f32; 3], [[f32; 3]; 3])> {
        let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let triple = |at: usize| [number(at), number(at + 4), number(at + 8)];
        let count = u32::from_le_bytes(bytes[80..84].try_into().unwrap()) as usize;
        assert_eq!(bytes.len(), 84 + 50 * count);
        (0..count)
            .map(|i| {
                let at = 84 + 50 * i;
                (triple(at), [triple(at + 12), triple(at + 24), triple(at + 36)])
            })
            .collect()
    }

    fn check(specimen: &Specimen) {
        let facets = read(&to_stl(specimen).unwrap());
        let mut edges: HashMap<([u32; 3], [u32; 3]), i32> = HashMap::new();
        let (mut volume, mut wall_area) = (0.0f64, 0.0f64);
        let bits = |p: [f32; 3]| p.map(|c| (c + 0.0).to_bits());
        for (normal, [a, b, c]) in &facets {
            for (p, q) in [(a, b), (b, c), (c, a)] {
                *edges.entry((bits(*p), bits(*q))).or_default() += 1;
            }
            let [a, b, c] = [a, b, c].map(|p| p.map(f64::from));
            let cross = |u: [f64; 3], v: [f64; 3]| {
                [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
            };
            let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
            volume += dot(a, cross(b, c)) / 6.0;
            let twice = cross([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
            assert!(dot(twice, normal.map(f64::from)) >= 0.0, "normal against the corners' order");
            wall_area += 0.5 * dot(twice, twice).sqrt();
        }
        // Closed and oriented: every directed edge once, and its reverse once.
        for ((p, q), count) in &edges {
            assert_eq!(*count, 1);
            assert_eq!(edges.get(&(*q, *p)), Some(&1), "open edge");
        }
        // Outward: the volume is positive, and within the chord error times the wall's area of the exact one.
        let exact = specimen.volume_mm3();
        assert!((volume - exact).abs() < CHORD_ERROR_MM * wall_area + 1e-5 * exact, "{volume} against {exact}");
    }

    #[test]
    fn chords_stay_within_the_error() {
        for radius in [0.05, 0.5, 2.5, 20.0, 400.0] {
            let step = TAU / num_chords(radius, TAU) as f64;
            assert!(radius * (1.0 - (0.5 * step).cos()) <= 0.01);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn blocks_are_closed_with_the_right_volume(specimen in valid_specimen()) {
            check(&specimen);
        }

        #[test]
        fn wedges_are_closed_with_the_right_volume(specimen in valid_wedge()) {
            check(&specimen);
        }

        #[test]
        fn dumbbells_are_closed_with_the_right_volume(specimen in dumbbell_with_hole()) {
            let mut specimen = specimen;
            if specimen.validate().is_err() {
                specimen.holes.clear();
            }
            check(&specimen);
        }
    }
}
