//! Finite deformations with closed forms: a tube that is blown up, twisted and pulled at once, thin bonded layers
//! pressed between plates, the energy that plates put into a sample.
//!
//! `cargo test --test fem_closed_forms -- --nocapture` prints the tables of `docs/verification.md`.

mod common;

use common::fine_quadrature::{displacement_errors, gauss};
use common::{
    Matrix, Vector, bar, bricks, determinant, is_zero, model, never, nodes_where, ogden, one_term, solid, specimen,
    tight, two_holes, two_terms, unit_block,
};
use lambdak::fem::{ForwardModel, QuadraturePoint, SolveOptions};
use lambdak::kinematics::principal_stretches;
use lambdak::material::{Material, energy_density};
use lambdak::mesh::ElementKind;
use lambdak::specimen::{HoleAxis, TestKind};
use nalgebra::{Matrix4, Vector4};
use std::f64::consts::PI;

/// Inner and outer radius and height of the tube at rest, mm.
const INNER: f64 = 1.0;
const OUTER: f64 = 2.0;
const HEIGHT: f64 = 1.0;

/// A tube of an incompressible solid whose inner radius, length and twist are given: r² = a² + (R² − A²)/λ,
/// θ = Θ + τ Z, z = λ Z (Ericksen's family 3; Rivlin, Phil. Trans. R. Soc. A 242, 1949). Its outer face is free.
struct Tube {
    /// a, mm.
    inner_mm: f64,
    /// λ.
    axial_stretch: f64,
    /// τ, radians per mm at rest.
    twist_per_mm: f64,
}

impl Tube {
    /// r of R, mm.
    fn radius(&self, at_rest: f64) -> f64 {
        (self.inner_mm.powi(2) + (at_rest.powi(2) - INNER.powi(2)) / self.axial_stretch).sqrt()
    }

    /// Position and F of a place at rest.
    fn deformation(&self, x: &Vector) -> (Vector, Matrix) {
        let (at_rest, angle) = (x[0].hypot(x[1]), x[1].atan2(x[0]));
        let r = self.radius(at_rest);
        let turned = angle + self.twist_per_mm * x[2];
        let position = [r * turned.cos(), r * turned.sin(), self.axial_stretch * x[2]];
        // F = Σ F_ij e_i(θ) ⊗ E_j(Θ) with what the cylindrical components are.
        let now = [[turned.cos(), turned.sin(), 0.0], [-turned.sin(), turned.cos(), 0.0], [0.0, 0.0, 1.0]];
        let before = [[angle.cos(), angle.sin(), 0.0], [-angle.sin(), angle.cos(), 0.0], [0.0, 0.0, 1.0]];
        let components = self.components(at_rest);
        let mut f = [[0.0; 3]; 3];
        for (i, row) in components.iter().enumerate() {
            for (j, component) in row.iter().enumerate() {
                for a in 0..3 {
                    for b in 0..3 {
                        f[a][b] += component * now[i][a] * before[j][b];
                    }
                }
            }
        }
        (position, f)
    }

    /// F in cylindrical components (r, θ, z).
    fn components(&self, at_rest: f64) -> Matrix {
        let r = self.radius(at_rest);
        [
            [at_rest / (r * self.axial_stretch), 0.0, 0.0],
            [0.0, r / at_rest, r * self.twist_per_mm],
            [0.0, 0.0, self.axial_stretch],
        ]
    }

    /// σ + p 1 in cylindrical components: r, θ, z and θz, kPa.
    fn extra_stress(&self, material: &Material, at_rest: f64) -> [f64; 4] {
        let f = self.components(at_rest);
        // The left Cauchy–Green tensor of the θz plane has the squares of two principal stretches as eigenvalues.
        let (b_t, b_z, b_tz) = (f[1][1].powi(2) + f[1][2].powi(2), f[2][2].powi(2), f[1][2] * f[2][2]);
        let (mean, half) = (0.5 * (b_t + b_z), 0.5 * (b_t - b_z));
        let apart = half.hypot(b_tz);
        let of_stretch =
            |stretch: f64| -> f64 { material.terms.iter().map(|t| t.mu_kpa * stretch.powf(t.alpha)).sum() };
        let [large, small] = [mean + apart, mean - apart].map(|square| of_stretch(square.sqrt()));
        let (middle, swing) = (0.5 * (large + small), if apart > 0.0 { 0.5 * (large - small) / apart } else { 0.0 });
        [of_stretch(f[0][0]), middle + swing * half, middle - swing * half, swing * b_tz]
    }

    /// Pressure inside (kPa), axial force (10⁻³ N) and moment (10⁻³ N mm) by quadrature over the radius.
    fn loads(&self, material: &Material) -> [f64; 3] {
        let quadrature = gauss(40);
        // ∫ g dr from the inner face to r(R), with dr = R dR/(λ r).
        let integral = |from: f64, to: f64, g: &dyn Fn(f64) -> f64| -> f64 {
            let half = 0.5 * (to - from);
            quadrature
                .iter()
                .map(|&(x, w)| {
                    let at_rest = from + half * (x + 1.0);
                    half * w * g(at_rest) * at_rest / (self.axial_stretch * self.radius(at_rest))
                })
                .sum()
        };
        // σ_r′ = (σ_θ − σ_r)/r, and σ_r = 0 outside.
        let slope = |at_rest: f64| {
            let [r, t, ..] = self.extra_stress(material, at_rest);
            (t - r) / self.radius(at_rest)
        };
        let radial_stress = |at_rest: f64| -integral(at_rest, OUTER, &slope);
        let force = |at_rest: f64| {
            let [r, _, z, _] = self.extra_stress(material, at_rest);
            2.0 * PI * self.radius(at_rest) * (z - r + radial_stress(at_rest))
        };
        let moment = |at_rest: f64| 2.0 * PI * self.radius(at_rest).powi(2) * self.extra_stress(material, at_rest)[3];
        [-radial_stress(INNER), integral(INNER, OUTER, &force), integral(INNER, OUTER, &moment)]
    }

    /// The same of the fields of a finite element solution, by virtual work: of (a/r) e_r, z e_z and z r e_θ.
    fn loads_of(&self, points: &[QuadraturePoint]) -> [f64; 3] {
        let height = self.axial_stretch * HEIGHT;
        let mut sums = [0.0; 3];
        for point in points {
            let (now, _) = self.deformation(&point.position);
            let (r, angle) = (now[0].hypot(now[1]), now[1].atan2(now[0]));
            let (radial, around) = ([angle.cos(), angle.sin(), 0.0], [-angle.sin(), angle.cos(), 0.0]);
            let axial = [0.0, 0.0, 1.0];
            let stress = |a: &Vector, b: &Vector| -> f64 {
                (0..3).map(|i| (0..3).map(|j| a[i] * point.cauchy_stress[i][j] * b[j]).sum::<f64>()).sum()
            };
            let volume = point.volume_mm3 * determinant(&point.deformation_gradient);
            sums[0] += volume * (stress(&around, &around) - stress(&radial, &radial)) / (2.0 * PI * r * r);
            sums[1] += volume * stress(&axial, &axial);
            sums[2] += volume * r * stress(&around, &axial);
        }
        sums.map(|s| s / height)
    }
}

/// Errors of displacement and gradient (L2), and relative ones of pressure inside, axial force and moment, on a tube of
/// n elements through its wall and along it and 6 n around it. Its ends and its inner face are displaced as the closed
/// form says; its outer face is free.
fn tube_errors(tube: &Tube, kind: ElementKind, n: usize, material: &Material) -> [f64; 5] {
    let (mut mesh, places) = bricks(kind, [n, 6 * n, n], true, |p| {
        let (r, angle) = (INNER + (OUTER - INNER) * p[0], 2.0 * PI * p[1]);
        [r * angle.cos(), r * angle.sin(), HEIGHT * p[2]]
    });
    mesh.fixed_nodes = nodes_where(&places, |p| is_zero(p[0]) || is_zero(p[2]) || is_zero(p[2] - 1.0));
    let exact: Vec<Vector> = mesh
        .nodes
        .iter()
        .map(|x| {
            let (p, _) = tube.deformation(x);
            [0, 1, 2].map(|i| p[i] - x[i])
        })
        .collect();
    let mut model = ForwardModel::new(mesh.clone(), &unit_block()).unwrap();
    // Rounding of κ ln J leaves a relative residual of 1e-8 at κ/μ = 10⁵.
    let options = SolveOptions { tolerance: 1e-7, max_iterations: 30, ..tight() };
    let found = model.solve_prescribed(material, &exact, None, &options).unwrap();
    let [u, gradient] = displacement_errors(&mesh, &found, |x| tube.deformation(x));
    let loads = tube.loads_of(&model.quadrature_fields(material, &found));
    let expected = tube.loads(material);
    let relative = [0, 1, 2].map(|k| if expected[k].abs() > 0.0 { (loads[k] / expected[k] - 1.0).abs() } else { 0.0 });
    [u, gradient, relative[0], relative[1], relative[2]]
}

#[test]
fn tubes_follow_their_closed_forms() {
    let shear = 0.5 * (16.0 * 1.9 + 0.35 * 8.0);
    let material = ogden(1e5 * shear, &[(16.0, 1.9), (0.35, 8.0)]);
    let inflated = Tube { inner_mm: 1.4, axial_stretch: 1.0, twist_per_mm: 0.0 };
    let twisted = Tube { inner_mm: 1.0, axial_stretch: 1.0, twist_per_mm: 0.4 };
    let all = Tube { inner_mm: 1.3, axial_stretch: 1.2, twist_per_mm: 0.4 };
    println!("| tube | element | n | u, mm | gradient | pressure | axial force | moment |");
    for (name, tube) in [("inflated", inflated), ("twisted", twisted), ("inflated, twisted and pulled", all)] {
        for kind in [ElementKind::Hex27, ElementKind::Prism21] {
            let mut before: Option<[f64; 5]> = None;
            for n in [2, 4, 6] {
                let now = tube_errors(&tube, kind, n, &material);
                let [u, gradient, pressure, force, moment] = now;
                println!(
                    "| {name} | {kind:?} | {n} | {u:.2e} | {gradient:.2e} | {pressure:.1e} | {force:.1e} | {moment:.1e} |"
                );
                if n == 6 {
                    let order = |k: usize| (before.unwrap()[k] / now[k]).ln() / 1.5f64.ln();
                    println!("  orders: {:.2} in u, {:.2} in the gradient", order(0), order(1));
                    // Full are 3 and 2; prisms come near them more slowly.
                    assert!(order(0) > 2.75 && order(1) > 1.75, "{name}, {kind:?}: {}, {}", order(0), order(1));
                    // Ten times what is found: the loads converge by order four, until κ/μ = 10⁵ shows.
                    assert!(pressure < 1e-4 && force < 1e-3 && moment < 1e-4, "{name}, {kind:?}: {now:?}");
                }
                before = Some(now);
            }
        }
    }
}

/// Force (N) that presses a thin bonded layer of 2a × 2b × t together by a part `strain` of its thickness. Reynolds'
/// equation of lubrication with a compressible solid, t²/(12 μ) ∇²p − p/κ = −`strain` with p = 0 along the free edges
/// (Gent & Lindley, Proc. Inst. Mech. Eng. 173, 1959; Gent & Meinecke, Polym. Eng. Sci. 10, 1970), in sines.
fn thin_layer_force_n(extents: Vector, shear_kpa: f64, bulk_kpa: f64, strain: f64) -> f64 {
    let [length, thickness, width] = extents;
    let odd = || (0..400).map(|i| f64::from(2 * i + 1));
    let mut sum = 0.0;
    for m in odd() {
        for n in odd() {
            let wave = (PI * m / length).powi(2) + (PI * n / width).powi(2);
            let compliance = thickness * thickness * wave / (12.0 * shear_kpa) + 1.0 / bulk_kpa;
            sum += 64.0 / (PI.powi(4) * m * m * n * n * compliance);
        }
    }
    1e-3 * strain * length * width * sum
}

/// Layers between plates, ever thinner: their force tends to that of lubrication theory as the part of the free edges
/// falls, in proportion to the thickness.
#[test]
fn bonded_layers_tend_to_lubrication_theory() {
    const STRAIN: f64 = 1e-4;
    let (shear, bulk) = (16.0, 16.0e5);
    let material = ogden(bulk, &[(16.0, 2.0)]);
    println!("| thickness, mm | elements | force, mN | lubrication, mN | ratio |");
    // Rounding of κ ln J leaves a relative residual of 1e-8 at κ/μ = 10⁵.
    let options = SolveOptions { tolerance: 1e-7, ..tight() };
    let mut ratios = Vec::new();
    for thickness in [0.8, 0.4, 0.2] {
        let extents = [6.0, thickness, 4.0];
        let mut layer = specimen(TestKind::DoubleLapShear, extents, HoleAxis::Thickness, &[]);
        layer.precompression_mm = STRAIN * thickness;
        let mut model = model(&layer, 1.0);
        let found = model.solve(&material, 0.0, None, &options, &never).unwrap();
        let (force, expected) = (found.normal_force_n.abs(), thin_layer_force_n(extents, shear, bulk, STRAIN));
        let ratio = force / expected;
        let num_elements = model.mesh().num_elements();
        println!("| {thickness} | {num_elements} | {:.4} | {:.4} | {ratio:.4} |", 1e3 * force, 1e3 * expected);
        ratios.push(ratio);
    }
    // Halving twice and taking off what is in proportion to t and to t² (Richardson).
    let first = [0, 1].map(|k| 2.0 * ratios[k + 1] - ratios[k]);
    let limit = (4.0 * first[1] - first[0]) / 3.0;
    println!("limit of thin layers: {limit:.4}");
    // What is left is in proportion to t³, an eighth of the last change of what was extrapolated, and the mesh's.
    assert!((limit - 1.0).abs() < 0.005, "{limit}");
}

/// Energy that a solution stores (mJ, of the meshed part): ∫ Ψ_iso(F) + κ/2 (ln θ)² dV, θ the linear function of the
/// place that is nearest to J in each element, which is what these elements store (Simo, Taylor & Pister, Comput.
/// Methods Appl. Mech. Eng. 51, 1985).
fn stored_mj(points: &[QuadraturePoint], material: &Material) -> f64 {
    let isochoric = Material { bulk_kpa: 0.0, ..material.clone() };
    let of_element = |points: &[QuadraturePoint]| {
        // About the first point, so that the normal equations are well conditioned.
        let basis = |q: &QuadraturePoint| {
            let d = [0, 1, 2].map(|i| q.position[i] - points[0].position[i]);
            Vector4::new(1.0, d[0], d[1], d[2])
        };
        let (mut matrix, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for q in points {
            let b = basis(q);
            matrix += q.volume_mm3 * b * b.transpose();
            right += q.volume_mm3 * determinant(&q.deformation_gradient) * b;
        }
        let theta = matrix.cholesky().expect("points of an element span it").solve(&right);
        let energy = |q: &QuadraturePoint| {
            let of_volume = 0.5 * material.bulk_kpa * basis(q).dot(&theta).ln().powi(2);
            q.volume_mm3 * (energy_density(&isochoric, principal_stretches(&q.deformation_gradient)) + of_volume)
        };
        points.iter().map(energy).sum::<f64>()
    };
    1e-3 * points.chunk_by(|a, b| a.element == b.element).map(of_element).sum::<f64>()
}

/// What the plates do on their way is what the sample stores: ∫ F dδ by Gauss's quadrature over the drive against the
/// stored energy.
#[test]
fn work_of_the_plates_is_stored() {
    println!("| specimen | drive, mm | work, mJ | stored, mJ | difference |");
    for (name, s, drive, material) in [
        ("shear, two holes, two terms", two_holes(), 7.0, two_terms()),
        ("shear, solid, one term, compressible", solid(), 7.0, ogden(5.0 * 16.2, &[(17.0, 1.91)])),
        ("bar, one term", bar(), 15.0, one_term()),
    ] {
        let mut model = model(&s, 1.8);
        let mut work_mj = 0.0;
        let mut last = None;
        let mut quadrature = gauss(8);
        quadrature.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (x, w) in quadrature {
            let at = 0.5 * drive * (x + 1.0);
            let found = model.solve(&material, at, last.as_ref(), &tight(), &never).unwrap();
            work_mj += 0.5 * drive * w * found.force_n;
            last = Some(found);
        }
        let found = model.solve(&material, drive, last.as_ref(), &tight(), &never).unwrap();
        let stored = model.multiplicity() * stored_mj(&model.quadrature_fields(&material, &found), &material);
        let difference = work_mj / stored - 1.0;
        println!("| {name} | {drive} | {work_mj:.6} | {stored:.6} | {difference:.1e} |");
        // Eight points leave about 1e-9 of the quadrature, equilibria 1e-11.
        assert!(difference.abs() < 1e-7, "{name}: {difference:e}");
    }
}
