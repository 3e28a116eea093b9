//! The files read back from their text: topology, and the volume by the divergence theorem.

use super::*;
use crate::specimen::sampling::{dumbbell_with_hole, valid_specimen, valid_wedge};
use crate::specimen::{Block, HoleAxis};
use proptest::prelude::*;
use std::collections::HashMap;

/// The entities of a file: keyword and arguments by number.
struct Read(HashMap<usize, (String, String)>);

impl Read {
    fn of(text: &str) -> Read {
        let data = text.split("DATA;\n").nth(1).expect("a section of data");
        let entity = |line: &str| {
            let (number, entity) = line.strip_prefix('#')?.strip_suffix(';')?.split_once('=')?;
            let (keyword, arguments) = entity.split_once('(')?;
            Some((number.parse().ok()?, (keyword.to_string(), arguments.trim_end_matches(')').to_string())))
        };
        Read(data.lines().filter_map(entity).collect())
    }

    fn of_kind<'a>(&'a self, keyword: &'a str) -> impl Iterator<Item = usize> + 'a {
        self.0.iter().filter(move |(_, (k, _))| k == keyword).map(|(n, _)| *n)
    }

    fn arguments(&self, number: usize) -> &str {
        &self.0[&number].1
    }

    /// The entities to which one refers, in order.
    fn references(&self, number: usize) -> Vec<usize> {
        let parts = self.arguments(number).split('#').skip(1);
        parts.map(|rest| rest.split(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap()).collect()
    }

    fn is_true(&self, number: usize) -> bool {
        self.arguments(number).ends_with(".T.")
    }

    /// The numbers in a point or a direction.
    fn triple(&self, number: usize) -> [f64; 3] {
        let inner = self.arguments(number).rsplit('(').next().unwrap();
        let numbers: Vec<f64> = inner.split(',').map(|n| n.parse().unwrap()).collect();
        numbers.try_into().unwrap()
    }

    /// The last number of an entity's arguments.
    fn last(&self, number: usize) -> f64 {
        self.arguments(number).rsplit(',').next().unwrap().parse().unwrap()
    }

    fn is(&self, number: usize, keyword: &str) -> bool {
        self.0[&number].0 == keyword
    }

    /// The vertices of an oriented edge in the sense in which it is passed.
    fn passed(&self, oriented: usize) -> (usize, bool, [usize; 2]) {
        let edge = self.references(oriented)[0];
        let ends = self.references(edge);
        let is_forward = self.is_true(oriented);
        (edge, is_forward, if is_forward { [ends[0], ends[1]] } else { [ends[1], ends[0]] })
    }

    fn point_of_vertex(&self, vertex: usize) -> [f64; 3] {
        self.triple(self.references(vertex)[0])
    }
}

fn cross(u: [f64; 3], v: [f64; 3]) -> [f64; 3] {
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

fn dot(u: [f64; 3], v: [f64; 3]) -> f64 {
    u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
}

/// ½ ∮ (p × dp) · n along an edge, in closed form. Of an arc of a conic, p = c + a cos t e + b sin t f about the
/// conic's axis m, p × dp is c × dp + a b m dt.
fn swept_area(read: &Read, oriented: usize, n: [f64; 3]) -> f64 {
    let (edge, is_forward, ends) = read.passed(oriented);
    let [from, to] = ends.map(|v| read.point_of_vertex(v));
    let curve = read.references(edge)[2];
    if read.is(curve, "LINE") {
        return 0.5 * dot(cross(from, to), n);
    }
    let placement = read.references(read.references(curve)[0]);
    let (center, axis, along) = (read.triple(placement[0]), read.triple(placement[1]), read.triple(placement[2]));
    let [a, b] = match read.0[&curve].0.as_str() {
        "CIRCLE" => [read.last(curve); 2],
        _ => {
            let numbers: Vec<f64> = read.arguments(curve).rsplit(',').take(2).map(|n| n.parse().unwrap()).collect();
            [numbers[1], numbers[0]]
        }
    };
    let across = cross(axis, along);
    let angle = |p: [f64; 3]| {
        let d = [0, 1, 2].map(|c| p[c] - center[c]);
        // Both ends lie on the curve and in its plane, to rounding of coordinates of at most some 200 mm.
        let (u, v) = (dot(d, along) / a, dot(d, across) / b);
        assert!((u.hypot(v) - 1.0).abs() < 1e-9 / b && dot(d, axis).abs() < 1e-12);
        v.atan2(u)
    };
    let sign = if read.is_true(edge) == is_forward { 1.0 } else { -1.0 };
    let turned = (sign * (angle(to) - angle(from))).rem_euclid(std::f64::consts::TAU);
    let chord = [0, 1, 2].map(|c| to[c] - from[c]);
    0.5 * (dot(cross(center, chord), n) + sign * a * b * turned * dot(axis, n))
}

/// Checks a file of a solid with so many holes through it, extruded along an axis; gives its volume and its number of
/// faces.
fn check(text: &str, genus: i64, axis: [f64; 3]) -> (f64, usize) {
    let read = Read::of(text);
    let mut uses: HashMap<usize, Vec<bool>> = HashMap::new();
    let (mut num_bounds, mut volume) = (0, 0.0);
    for face in read.of_kind("ADVANCED_FACE") {
        let mut parts = read.references(face);
        let surface = parts.pop().unwrap();
        num_bounds += parts.len();
        let plane = read.is(surface, "PLANE").then(|| {
            let placement = read.references(read.references(surface)[0]);
            (read.triple(placement[0]), read.triple(placement[1]))
        });
        let mut area = 0.0;
        for &bound in &parts {
            let walk = read.references(read.references(bound)[0]);
            for (i, &oriented) in walk.iter().enumerate() {
                let (edge, is_forward, ends) = read.passed(oriented);
                uses.entry(edge).or_default().push(is_forward);
                assert_eq!(ends[1], read.passed(walk[(i + 1) % walk.len()]).2[0], "the walk is broken");
                if let Some((origin, normal)) = plane {
                    area += swept_area(&read, oriented, normal);
                    let p = read.point_of_vertex(ends[0]);
                    // In the plane, to rounding.
                    assert!(dot([0, 1, 2].map(|c| p[c] - origin[c]), normal).abs() < 1e-9);
                }
            }
        }
        // The divergence of the coordinate along the axis, as a vector along it, is 1: walls do not count.
        if let Some((origin, normal)) = plane {
            assert!(area > 0.0, "a face turned inwards");
            volume += area * dot(normal, axis) * dot(origin, axis);
        }
    }
    for (edge, senses) in &uses {
        assert!(senses.len() == 2 && senses[0] != senses[1], "edge {edge} is used {senses:?}");
    }
    let count = |keyword: &str| read.of_kind(keyword).count();
    let (vertices, edges, faces) = (count("VERTEX_POINT"), count("EDGE_CURVE"), count("ADVANCED_FACE"));
    assert_eq!(uses.len(), edges);
    // Euler and Poincaré: V − E + F − (bounds − F) = 2 (shells − holes through).
    let characteristic = vertices as i64 - edges as i64 + 2 * faces as i64 - num_bounds as i64;
    assert_eq!(characteristic, 2 - 2 * genus);
    (volume, faces)
}

/// The area of the plane faces that slant to an axis.
fn slanted_area(text: &str, axis: [f64; 3]) -> f64 {
    let read = Read::of(text);
    let of_face = |face: usize| -> f64 {
        let mut parts = read.references(face);
        let surface = parts.pop().unwrap();
        if !read.is(surface, "PLANE") {
            return 0.0;
        }
        let normal = read.triple(read.references(read.references(surface)[0])[1]);
        let towards = dot(normal, axis).abs();
        if !(1e-12..=1.0 - 1e-15).contains(&towards) {
            return 0.0;
        }
        let walks = parts.iter().flat_map(|&bound| read.references(read.references(bound)[0]));
        walks.map(|oriented| swept_area(&read, oriented, normal)).sum()
    };
    read.of_kind("ADVANCED_FACE").map(of_face).sum()
}

fn axis_of(specimen: &Specimen) -> [f64; 3] {
    match specimen.extrusion_axis() {
        HoleAxis::Thickness => [0.0, 1.0, 0.0],
        HoleAxis::Width => [0.0, 0.0, 1.0],
    }
}

/// Faces of the walls of the holes: halves of circles and ellipses, or halves of circles and two planes.
fn num_wall_faces(specimen: &Specimen) -> usize {
    inner_loops(specimen).map(|ring| ring.len()).sum()
}

fn check_specimen(specimen: &Specimen, num_outline_faces: usize) {
    let num_holes = specimen.holes.len() as i64;
    let (volume, faces) = check(&to_step(specimen).unwrap(), num_holes, axis_of(specimen));
    let exact = specimen.volume_mm3();
    // Both are closed forms: rounding alone.
    assert!((volume - exact).abs() < 1e-9 * exact, "{volume} against {exact}");
    assert_eq!(faces, 2 + num_outline_faces + num_wall_faces(specimen));
    let (volume, faces) = check(&mould_to_step(specimen).unwrap(), 0, axis_of(specimen));
    let [length, lateral] = specimen.section_size().map(|extent| extent + 2.0 * MOULD_WALL_MM);
    let box_mm3 = length * lateral * (specimen.extrusion_mm() + MOULD_WALL_MM);
    assert!((volume - (box_mm3 - exact)).abs() < 1e-9 * box_mm3, "{volume} and {exact} of {box_mm3}");
    // Outside, below, rim and floor; a pin has a top.
    assert_eq!(faces, 4 + 3 + num_outline_faces + num_wall_faces(specimen) + specimen.holes.len());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn blocks_are_closed_with_the_exact_volume(specimen in valid_specimen()) {
        check_specimen(&specimen, 4);
    }

    /// The slanted planes of a wedge cut its walls in ellipses whose ends and areas are exact.
    #[test]
    fn wedges_are_closed_with_the_exact_faces(specimen in valid_wedge()) {
        let num_holes = specimen.holes.len() as i64;
        let longer = (0.5 * specimen.block.thickness_mm * specimen.block.taper().slope_per_mm()).hypot(1.0);
        let even = Specimen { block: Block { wedge_mm: 0.0, ..specimen.block }, ..specimen.clone() };
        let section_mm2 = even.volume_mm3() / specimen.block.thickness_mm;
        let text = to_step(&specimen).unwrap();
        check(&text, num_holes, axis_of(&specimen));
        let area = slanted_area(&text, axis_of(&specimen));
        prop_assert!((area / (2.0 * longer * section_mm2) - 1.0).abs() < 1e-9, "{} of {}", area, section_mm2);
        // Floor, rim and the tops of pins together cover the box.
        let text = mould_to_step(&specimen).unwrap();
        check(&text, 0, axis_of(&specimen));
        let box_mm2: f64 = specimen.section_size().iter().map(|extent| extent + 2.0 * MOULD_WALL_MM).product();
        let area = slanted_area(&text, axis_of(&specimen));
        prop_assert!((area / (longer * box_mm2) - 1.0).abs() < 1e-9, "{} of {}", area, box_mm2);
    }

    #[test]
    fn dumbbells_are_closed_with_the_exact_volume(specimen in dumbbell_with_hole()) {
        let mut specimen = specimen;
        if specimen.validate().is_err() {
            specimen.holes.clear();
        }
        // Eight arcs, four shoulders, two ends and the two sides of the narrow part.
        check_specimen(&specimen, 16);
    }
}

/// The checks see what they are for.
#[test]
fn a_spoilt_file_is_seen() {
    let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
    let text = to_step(&specimen).unwrap();
    let axis = axis_of(&specimen);
    check(&text, 2, axis);
    let circles: String = text
        .lines()
        .map(|line| if line.contains("CIRCLE(") { line.replace(",2.5)", ",2.6)") } else { line.into() } + "\n")
        .collect();
    let sense = text.replacen(",.F.);\n", ",.T.);\n", 1);
    for spoilt in [circles, sense] {
        assert_ne!(spoilt, text);
        assert!(std::panic::catch_unwind(|| check(&spoilt, 2, axis)).is_err());
    }
}
