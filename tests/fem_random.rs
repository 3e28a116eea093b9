//! A hundred random makeable specimens with random stable materials, driven to their limits: each converges or fails
//! typed, none hangs or panics.
//!
//! With LAMBDAK_EXPLAIN set, each failure is followed up to the last drive that converges and the smallest principal
//! stretch there, anywhere in the specimen, is printed. A free surface of an incompressible neo-Hookean solid under
//! plane strain wrinkles below 0.544 (Biot 1963): a specimen that never comes near it failed for another reason.

mod common;

use common::{Random, ogden, specimen};
use lambdak::fem::{ForwardModel, SolveError, SolveOptions};
use lambdak::kinematics::principal_stretches;
use lambdak::material::Material;
use lambdak::mesh::{MeshError, MeshOptions, mesh_specimen};
use lambdak::specimen::{HoleAxis, Specimen, TestKind};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

const NUM_SPECIMENS: usize = 100;

/// A specimen that takes longer hangs. The slowest takes a few seconds on one busy core.
const PATIENCE: Duration = Duration::from_secs(60);

fn random_specimen(random: &mut Random) -> Specimen {
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
fn random_material(random: &mut Random) -> Material {
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

fn outcome(s: &Specimen, material: &Material) -> (String, Option<f64>) {
    // Coarse, and at most four levels: convergence is asked, not accuracy. Coarser ones lose definiteness earlier.
    let options = MeshOptions::scaled(s, 3.0);
    let options = MeshOptions { levels: options.levels.min(4), ..options };
    let mesh = match mesh_specimen(s, &options) {
        Ok(mesh) => mesh,
        Err(MeshError::PoorElement { .. }) => return ("mesh: poor element".into(), None),
        Err(MeshError::TooManyElements { .. }) => return ("mesh: too many elements".into(), None),
        Err(e) => return (format!("mesh: {e}"), None),
    };
    let mut model = ForwardModel::new(mesh, s).expect("a mesh that passed the mesher is usable");
    let start = Instant::now();
    let is_over = || start.elapsed() > PATIENCE;
    let drive = s.drive_mm[0];
    // What does not converge in steps of 1/64 rarely does in smaller ones.
    let options = SolveOptions { min_step: 1.0 / 64.0, ..SolveOptions::default() };
    match model.solve(material, drive, None, &options, &is_over) {
        Ok(found) => {
            assert!(found.force_n.is_finite() && found.force_n > 0.0);
            assert!(found.reaction_imbalance < 1e-3, "{}", found.reaction_imbalance);
            ("converged".into(), Some(1.0))
        }
        Err(SolveError::Diverged { reached_mm, cause, .. }) => {
            let kind = format!("{cause:?}");
            let kind = kind.split([' ', '(']).next().unwrap_or_default();
            if std::env::var_os("LAMBDAK_EXPLAIN").is_some() {
                explain(&mut model, material, reached_mm, &options);
            }
            (format!("diverged: {kind}"), Some(reached_mm / drive))
        }
        Err(SolveError::Cancelled { reached_mm }) => (format!("HANGS at {reached_mm} mm"), None),
        Err(e) => panic!("unexpected: {e}"),
    }
}

/// Prints the smallest principal stretch at the last drive that converges.
fn explain(model: &mut ForwardModel, material: &Material, reached_mm: f64, options: &SolveOptions) {
    let Ok(state) = model.solve(material, reached_mm, None, options, &|| false) else {
        println!("  {reached_mm} mm is not reached again from rest in other steps");
        return;
    };
    let fields = model.quadrature_fields(material, &state);
    let smallest = fields.iter().map(|q| principal_stretches(&q.deformation_gradient)[2]).fold(f64::INFINITY, f64::min);
    let verdict = if smallest < 0.6 { "compatible with a surface instability" } else { "no surface instability" };
    println!("  smallest principal stretch {smallest:.3} at {reached_mm:.2} mm: {verdict}");
}

#[test]
fn random_specimens_converge_or_fail_typed() {
    let mut random = Random::new(20);
    let cases: Vec<(Specimen, Material)> =
        (0..NUM_SPECIMENS).map(|_| (random_specimen(&mut random), random_material(&mut random))).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let start = Instant::now();
    let outcomes: Vec<(String, Option<f64>, f64)> = pool.install(|| {
        cases
            .par_iter()
            .map(|(s, m)| {
                let start = Instant::now();
                let (what, reached) = outcome(s, m);
                (what, reached, start.elapsed().as_secs_f64())
            })
            .collect()
    });
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for ((what, reached, seconds), (s, m)) in outcomes.iter().zip(&cases) {
        *counts.entry(what).or_default() += 1;
        if what != "converged" {
            let terms: Vec<_> = m.terms.iter().map(|t| (t.mu_kpa, t.alpha)).collect();
            let holes: Vec<_> = s.holes.iter().map(|h| (h.center_mm, h.diameter_mm)).collect();
            println!(
                "{what}, reached {reached:.2?} of the drive in {seconds:.1} s: {:?} {:?} {:?} {holes:.2?}, κ {:.0} {terms:.2?}",
                s.test,
                s.block,
                s.hole_axis(),
                m.bulk_kpa
            );
        }
    }
    let slowest = outcomes.iter().map(|o| o.2).fold(0.0, f64::max);
    println!("{counts:?}; slowest {slowest:.1} s, all {:.1} s", start.elapsed().as_secs_f64());
    assert!(!counts.keys().any(|k| k.starts_with("HANGS")), "{counts:?}");
    // Typed failures are allowed (thin ligaments at coarse elements, buckling); most specimens must work.
    // Every outcome above is typed, which is what is asked. This floor only catches a solver that gives up wholesale;
    // about seven in ten reach the extreme drives, the others lose stability at a hole wall (see the counts printed).
    assert!(counts.get("converged").copied().unwrap_or(0) >= NUM_SPECIMENS * 6 / 10, "{counts:?}");
}
