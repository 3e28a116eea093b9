//! What the finite-element tests share: specimens, materials, hand-made meshes of a cube, norms, random numbers.

#![allow(dead_code)] // Each test binary uses a part.

use lambdak::fem::{Equilibrium, ForwardModel, SolveError, SolveOptions};
use lambdak::material::{Material, OgdenTerm};
use lambdak::mesh::{ElementKind, Mesh, MeshOptions, Mirror, mesh_specimen};
use lambdak::specimen::{Block, Hole, HoleAxis, HoleKind, HoleShape, Outline, Specimen, Taper, TestKind};
use std::collections::HashMap;

pub mod fine_quadrature;

pub type Vector = [f64; 3];
pub type Matrix = [[f64; 3]; 3];

/// κ and terms (μ, α).
pub fn ogden(bulk_kpa: f64, terms: &[(f64, f64)]) -> Material {
    Material { bulk_kpa, terms: terms.iter().map(|&(mu_kpa, alpha)| OgdenTerm { mu_kpa, alpha }).collect(), law: None }
}

/// Ecoflex 00-20, one term.
pub fn one_term() -> Material {
    ogden(2173.0, &[(17.0, 1.91)])
}

/// Ecoflex 00-20, two terms.
pub fn two_terms() -> Material {
    ogden(2200.0, &[(16.0, 1.9), (0.35, 8.0)])
}

/// A block (length, thickness, width) with holes (first, second coordinate, diameter).
pub fn specimen(test: TestKind, extents: Vector, axis: HoleAxis, holes: &[Vector]) -> Specimen {
    let [length_mm, thickness_mm, width_mm] = extents;
    Specimen {
        name: format!("{test:?} {extents:?} {axis:?} {holes:?}"),
        test,
        block: Block::new(length_mm, thickness_mm, width_mm),
        outline: Outline::Block,
        holes: holes.iter().map(|h| Hole::circle(axis, [h[0], h[1]], h[2])).collect(),
        drive_mm: vec![1.0],
        drive_angle_deg: 0.0,
        precompression_mm: 0.0,
        samples_in_parallel: 1,
        other_samples: Vec::new(),
    }
}

pub const SHEAR_BLOCK: Vector = [25.4, 6.4, 19.1];

pub fn solid() -> Specimen {
    specimen(TestKind::DoubleLapShear, SHEAR_BLOCK, HoleAxis::Thickness, &[])
}

pub fn two_holes() -> Specimen {
    let holes = [[-4.2333, 0.0, 5.0], [4.2333, 0.0, 5.0]];
    specimen(TestKind::DoubleLapShear, SHEAR_BLOCK, HoleAxis::Thickness, &holes)
}

/// Two holes without any symmetry.
pub fn off_axis() -> Specimen {
    let holes = [[-5.0, 3.0, 4.0], [4.0, -2.0, 5.0]];
    specimen(TestKind::DoubleLapShear, SHEAR_BLOCK, HoleAxis::Thickness, &holes)
}

/// An ellipse and a slot without any symmetry.
pub fn ellipse_and_slot() -> Specimen {
    let mut specimen = specimen(TestKind::DoubleLapShear, SHEAR_BLOCK, HoleAxis::Thickness, &[]);
    let hole = |kind, center_mm, diameter_mm, length_mm, angle_deg| {
        let shape = Some(HoleShape { kind, length_mm, angle_deg });
        Hole { axis: HoleAxis::Thickness, center_mm, diameter_mm, shape, is_notch: false }
    };
    specimen.holes =
        vec![hole(HoleKind::Ellipse, [-5.0, 2.0], 3.0, 6.0, 35.0), hole(HoleKind::Slot, [5.0, -1.5], 3.0, 5.5, -60.0)];
    specimen
}

pub fn bar() -> Specimen {
    specimen(TestKind::Uniaxial, [40.0, 4.0, 12.0], HoleAxis::Thickness, &[[0.0, 0.0, 4.0]])
}

/// A dumb-bell with a gauge of its own.
pub fn short_dumbbell() -> Specimen {
    Specimen::from_json(include_str!("../../geometries/short-dumbbell.json")).unwrap()
}

/// Model of a specimen with elements `factor` times the standard size.
pub fn model(specimen: &Specimen, factor: f64) -> ForwardModel {
    let mesh = mesh_specimen(specimen, &MeshOptions::scaled(specimen, factor)).unwrap();
    ForwardModel::new(mesh, specimen).unwrap()
}

pub fn tight() -> SolveOptions {
    SolveOptions { tolerance: 1e-11, ..SolveOptions::default() }
}

pub fn never() -> bool {
    false
}

pub fn solve(model: &mut ForwardModel, material: &Material, drive_mm: f64) -> Result<Equilibrium, SolveError> {
    model.solve(material, drive_mm, None, &tight(), &never)
}

/// The unit cube in n × n × n cells (hexahedra, or twice as many prisms), its nodes moved by `map`. Every boundary node
/// is in `fixed_nodes`.
pub fn cube(kind: ElementKind, n: usize, map: impl Fn(Vector) -> Vector) -> Mesh {
    let (mut mesh, before) = bricks(kind, [n; 3], false, map);
    mesh.fixed_nodes = nodes_where(&before, |p| p.iter().any(|&v| is_zero(v) || is_zero(v - 1.0)));
    mesh
}

/// Whether a coordinate of the unit cube is zero but for rounding.
pub fn is_zero(v: f64) -> bool {
    v.abs() < 1e-9
}

/// The nodes whose place in the unit cube satisfies `is_wanted`.
pub fn nodes_where(places: &[Vector], is_wanted: impl Fn(&Vector) -> bool) -> Vec<u32> {
    (0..places.len() as u32).filter(|&n| is_wanted(&places[n as usize])).collect()
}

/// The unit cube in `counts` cells along x, y and z (hexahedra, or twice as many prisms), its nodes moved by `map`. In
/// a ring the faces y = 0 and y = 1 are one. The places of the nodes in the cube come with the mesh, whose sets of
/// nodes are empty. The middle node of a prism's triangle is where the quadratic map of the other six takes it.
pub fn bricks(
    kind: ElementKind,
    counts: [usize; 3],
    is_ring: bool,
    map: impl Fn(Vector) -> Vector,
) -> (Mesh, Vec<Vector>) {
    let local = kind.node_coordinates();
    let mut mesh = Mesh {
        element_kind: kind,
        nodes: Vec::new(),
        connectivity: Vec::new(),
        taper: Taper::default(),
        mirror: Mirror::default(),
        fixed_nodes: Vec::new(),
        moved_nodes: Vec::new(),
        mirror_y_nodes: Vec::new(),
        mirror_z_nodes: Vec::new(),
    };
    let mut places: Vec<Vector> = Vec::new();
    let mut known: HashMap<[i64; 3], u32> = HashMap::new();
    let h = counts.map(|n| 1.0 / n as f64);
    let halves = if kind == ElementKind::Prism21 { 2 } else { 1 };
    for cell in 0..counts.iter().product::<usize>() * halves {
        let (half, c) = (cell % halves, cell / halves);
        let of_cell = [c % counts[0], c / counts[0] % counts[1], c / (counts[0] * counts[1])];
        for x in &local {
            let place = match (kind, half) {
                (ElementKind::Hex27, _) => x.map(|v| 0.5 * (v + 1.0)),
                (ElementKind::Prism21, 0) => [x[0], x[1], 0.5 * (x[2] + 1.0)],
                (ElementKind::Prism21, _) => [1.0 - x[0], 1.0 - x[1], 0.5 * (x[2] + 1.0)],
            };
            let mut p = [0, 1, 2].map(|i| h[i] * (of_cell[i] as f64 + place[i]));
            if is_ring && is_zero(p[1] - 1.0) {
                p[1] = 0.0;
            }
            // Nodes sit at multiples of h/6, so rounding to 1e-6 tells them apart.
            let key = p.map(|v| (v * 1e6).round() as i64);
            let next = mesh.nodes.len() as u32;
            let node = *known.entry(key).or_insert(next);
            if node == next {
                mesh.nodes.push(map(p));
                places.push(p);
            }
            mesh.connectivity.push(node);
        }
    }
    if kind == ElementKind::Prism21 {
        for e in 0..mesh.num_elements() {
            let element = mesh.element(e).to_vec();
            for level in element.chunks(7) {
                let at = |s: usize, i: usize| mesh.nodes[level[s] as usize][i];
                let centre = [0, 1, 2]
                    .map(|i| 4.0 / 9.0 * (at(3, i) + at(4, i) + at(5, i)) - (at(0, i) + at(1, i) + at(2, i)) / 9.0);
                mesh.nodes[level[6] as usize] = centre;
            }
        }
    }
    (mesh, places)
}

/// A specimen to hand to [`ForwardModel::new`] with a mesh of [`cube`]; only its extents are read.
pub fn unit_block() -> Specimen {
    specimen(TestKind::DoubleLapShear, [1.0; 3], HoleAxis::Thickness, &[])
}

pub fn determinant(f: &Matrix) -> f64 {
    f[0][0] * (f[1][1] * f[2][2] - f[1][2] * f[2][1]) - f[0][1] * (f[1][0] * f[2][2] - f[1][2] * f[2][0])
        + f[0][2] * (f[1][0] * f[2][1] - f[1][1] * f[2][0])
}

pub fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Inverse of a 3 × 3 matrix.
pub fn inverse(f: &Matrix) -> Matrix {
    let d = determinant(f);
    [0, 1, 2].map(|i| {
        [0, 1, 2].map(|j| {
            let (r, s, c, t) = ((j + 1) % 3, (j + 2) % 3, (i + 1) % 3, (i + 2) % 3);
            (f[r][c] * f[s][t] - f[r][t] * f[s][c]) / d
        })
    })
}

/// Square root of the sum of squares.
pub fn norm(x: &[Vector]) -> f64 {
    x.iter().flatten().map(|v| v * v).sum::<f64>().sqrt()
}

/// Norm of a + factor b.
pub fn norm_of_sum(a: &[Vector], factor: f64, b: &[Vector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (0..3).map(|i| (a[i] + factor * b[i]).powi(2)).sum::<f64>()).sum::<f64>().sqrt()
}

/// SplitMix64: a fixed sequence per seed.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn below(&mut self, n: u64) -> usize {
        (self.next() % n) as usize
    }
}

/// A block for either test with up to five holes, which may overlap no wall; at its drive limit.
pub fn random_specimen(random: &mut Random) -> Specimen {
    loop {
        let test = [TestKind::DoubleLapShear, TestKind::Uniaxial][random.below(2)];
        let axis = [HoleAxis::Thickness, HoleAxis::Width][random.below(2)];
        let extents = match test {
            TestKind::DoubleLapShear => {
                [random.between(12.0, 40.0), random.between(4.0, 10.0), random.between(8.0, 30.0)]
            }
            TestKind::Uniaxial => [random.between(20.0, 60.0), random.between(2.0, 8.0), random.between(6.0, 20.0)],
        };
        let across = if axis == HoleAxis::Thickness { extents[2] } else { extents[1] };
        let holes: Vec<[f64; 3]> = (0..random.below(6))
            .map(|_| {
                let diameter = random.between(0.15, 0.6) * across;
                let reach = |extent: f64| 0.5 * extent - 0.5 * diameter - 0.5;
                let is_central = random.below(3) == 0;
                let b = reach(across).max(0.0);
                let x = reach(extents[0]).max(0.0);
                let other = if is_central { 0.0 } else { random.between(-b, b) };
                [random.between(-x, x), other, diameter]
            })
            .collect();
        let mut s = specimen(test, extents, axis, &holes);
        s.name = "random".into();
        s.drive_mm = vec![s.drive_limit_mm()];
        if s.validate().is_ok() {
            return s;
        }
    }
}

/// One to three terms, each with μα > 0 (so the sum is stable); κ/μ from 5 to 10⁴, uniform in its logarithm.
pub fn random_material(random: &mut Random) -> Material {
    let terms: Vec<(f64, f64)> = (0..=random.below(3))
        .map(|i| {
            let alpha =
                random.between(0.8, if i == 0 { 4.0 } else { 9.0 }) * if random.below(3) == 0 { -1.0 } else { 1.0 };
            let share = if i == 0 { 1.0 } else { 0.1 / alpha.abs() };
            (random.between(5.0, 50.0) * share * f64::signum(alpha), alpha)
        })
        .collect();
    let shear: f64 = 0.5 * terms.iter().map(|t| t.0 * t.1).sum::<f64>();
    let material = ogden(shear * random.between(5f64.ln(), 1e4f64.ln()).exp(), &terms);
    material.validate().expect("stable by construction");
    material
}

/// A specimen with at most two holes and its drive, a quarter to four fifths of the largest, and a material of one or
/// two terms: one scan tells no three apart.
pub fn random_scanned_case(random: &mut Random) -> (Specimen, Material) {
    loop {
        let (mut specimen, material) = (random_specimen(random), random_material(random));
        if material.terms.len() < 3 && specimen.holes.len() < 3 {
            specimen.drive_mm[0] *= random.between(0.25, 0.8);
            return (specimen, material);
        }
    }
}
