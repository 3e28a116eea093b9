//! A hundred random makeable specimens with random stable materials, driven to their limits: each converges or fails
//! typed, none hangs or panics.
//!
//! With LAMBDAK_EXPLAIN set, each failure is followed up to the last drive that converges and the smallest principal
//! stretch there, anywhere in the specimen, is printed. A free surface of an incompressible neo-Hookean solid under
//! plane strain wrinkles below 0.544 (Biot 1963): a specimen that never comes near it failed for another reason.

mod common;

use common::{Random, random_material, random_specimen};
use lambdak::fem::{ForwardModel, SolveError, SolveOptions};
use lambdak::kinematics::principal_stretches;
use lambdak::material::Material;
use lambdak::mesh::{MeshError, MeshOptions, mesh_specimen};
use lambdak::specimen::Specimen;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

const NUM_SPECIMENS: usize = 100;

/// A specimen that takes longer hangs. The slowest takes a few seconds on one busy core.
const PATIENCE: Duration = Duration::from_secs(60);

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
