//! Random makeable specimens with random stable materials, driven to their limits: each converges, or it is told what
//! gave way. None hangs or panics.
//!
//! `SPECIMENS=1000 cargo test --test fem_random -- --nocapture` prints the table of `docs/verification.md`.

mod common;

use common::{Random, random_material, random_specimen};
use lambdak::fem::{EndCause, ForwardModel, SolveError, SolveOptions};
use lambdak::material::Material;
use lambdak::mesh::{MeshError, MeshOptions, mesh_specimen};
use lambdak::specimen::Specimen;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

const NUM_SPECIMENS: usize = 100;

/// A specimen that takes longer hangs. The slowest of a thousand took 61 s beside other work.
const PATIENCE: Duration = Duration::from_secs(120);

/// What became of one specimen.
struct Fate {
    /// What it is counted as.
    kind: &'static str,
    /// What is told of it.
    told: String,
}

impl Fate {
    fn new(kind: &'static str, told: impl ToString) -> Fate {
        Fate { kind, told: told.to_string() }
    }
}

const CONVERGED: &str = "reached its limit";
const METHOD: &str = "neither gives way: the method gave up";
const HANGS: &str = "hangs";

fn fate(s: &Specimen, material: &Material) -> Fate {
    // Coarse, and at most four levels: convergence is asked, not accuracy. Coarser ones lose definiteness earlier.
    let options = MeshOptions::scaled(s, 3.0);
    let options = MeshOptions { levels: options.levels.min(4), ..options };
    let mesh = match mesh_specimen(s, &options) {
        Ok(mesh) => mesh,
        Err(e @ MeshError::PoorElement { .. }) => return Fate::new("not meshed: an element would be too flat", e),
        Err(e @ MeshError::TooManyElements { .. }) => return Fate::new("not meshed: too many elements", e),
        Err(e) => return Fate::new("not meshed for another reason", e),
    };
    let mut model = ForwardModel::new(mesh, s).expect("a mesh that passed the mesher is usable");
    let start = Instant::now();
    let is_over = || start.elapsed() > PATIENCE;
    let drive = s.drive_mm[0];
    match model.solve(material, drive, None, &SolveOptions::default(), &is_over) {
        Ok(found) => {
            assert!(found.force_n.is_finite() && found.force_n > 0.0);
            assert!(found.reaction_imbalance < 1e-3, "{}", found.reaction_imbalance);
            Fate::new(CONVERGED, "")
        }
        Err(SolveError::Diverged { reached_mm, .. }) => match model.path_end(material, reached_mm, drive, &is_over) {
            Ok(end) => {
                let kind = match end.cause {
                    EndCause::Material { .. } => "the material gives way",
                    EndCause::Sample { goes_on: true, .. } => "the sample gives way; small steps follow it",
                    EndCause::Sample { is_limit_point: true, .. } => "the sample gives way at a limit point",
                    EndCause::Sample { is_limit_point: false, .. } => "the sample gives way at a bifurcation",
                    EndCause::Mesh { .. } => "an element folds",
                    _ => METHOD,
                };
                Fate::new(kind, format!("{end} ({:?})", end.cause))
            }
            Err(SolveError::Cancelled { .. }) => Fate::new(HANGS, ""),
            Err(e) => Fate::new(METHOD, e),
        },
        Err(SolveError::Cancelled { reached_mm }) => Fate::new(HANGS, format!("at {reached_mm} mm")),
        Err(e) => panic!("unexpected: {e}"),
    }
}

#[test]
fn random_specimens_converge_or_it_is_told_why() {
    let num = std::env::var("SPECIMENS").map_or(NUM_SPECIMENS, |n| n.parse().expect("SPECIMENS is a number"));
    let mut random = Random::new(20);
    let cases: Vec<(Specimen, Material)> =
        (0..num).map(|_| (random_specimen(&mut random), random_material(&mut random))).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let start = Instant::now();
    let fates: Vec<(Fate, f64)> = pool.install(|| {
        let timed = |(s, m): &(Specimen, Material)| {
            let start = Instant::now();
            (fate(s, m), start.elapsed().as_secs_f64())
        };
        cases.par_iter().map(timed).collect()
    });
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for ((fate, seconds), (s, m)) in fates.iter().zip(&cases) {
        *counts.entry(fate.kind).or_default() += 1;
        if fate.kind != CONVERGED {
            let terms: Vec<_> = m.terms.iter().map(|t| (t.mu_kpa, t.alpha)).collect();
            let holes: Vec<_> = s.holes.iter().map(|h| (h.center_mm, h.diameter_mm)).collect();
            println!(
                "{}: {} in {seconds:.1} s: {:?} {:?} {:?} {holes:.2?}, drive {:.2} mm, κ {:.0} {terms:.2?}",
                fate.kind,
                fate.told,
                s.test,
                s.block,
                s.hole_axis(),
                s.drive_mm[0],
                m.bulk_kpa
            );
        }
    }
    let slowest = fates.iter().map(|f| f.1).fold(0.0, f64::max);
    for (kind, count) in &counts {
        println!("| {kind} | {count} |");
    }
    println!("slowest {slowest:.1} s, all {:.1} s", start.elapsed().as_secs_f64());
    let count = |kind: &str| counts.get(kind).copied().unwrap_or(0);
    assert_eq!(count(HANGS), 0, "{counts:?}");
    assert!(count(METHOD) * 100 <= num, "{counts:?}");
    // About seven in ten reach the extreme drives; this floor only catches a solver that gives up wholesale.
    assert!(count(CONVERGED) >= num * 6 / 10, "{counts:?}");
}
