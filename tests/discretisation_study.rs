//! How often the bounds of discretisation hold, over random specimens, materials and drives; the table is in
//! docs/verification.md. `cargo test --test discretisation_study -- --ignored --nocapture` (an hour of one core);
//! CASES sets how many, SEED which.

mod common;

use common::{Random, random_scanned_case};
use lambdak::material::Material;
use lambdak::mesh::MeshOptions;
use lambdak::sensitivity::{
    DriveSelection, Evaluation, EvaluationOptions, Fixture, PromisedSd, ScanSettings, bound_discretisation,
    evaluate_fixture,
};
use lambdak::specimen::Specimen;
use rayon::prelude::*;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Element size of the mesh that the standard one is compared with.
const REFERENCE: f64 = 0.6;

/// What is left of an error of the second order, that of forces here, is REFERENCE² of it: the difference to the
/// reference is this part of the error.
const PART_SEEN: f64 = 1.0 - REFERENCE * REFERENCE;

/// A case whose reference takes longer is left out and counted.
const PATIENCE: Duration = Duration::from_secs(200);

/// A figure: which kind it is, its relative error, and its bound.
struct Bounded {
    kind: &'static str,
    error: f64,
    bound: f64,
}

const KINDS: [&str; 3] = ["force", "integrated sensitivity", "promised standard deviation"];

fn evaluated(specimen: &Specimen, material: &Material, options: &EvaluationOptions) -> Option<Evaluation> {
    let scan = ScanSettings::default();
    let start = Instant::now();
    let is_over = || start.elapsed() > PATIENCE;
    let mut fixture = Fixture::new(specimen, &scan, options).ok()?;
    let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
    evaluate_fixture(&mut fixture, material, &drives, &[], options, &is_over).ok().map(|(evaluation, _)| evaluation)
}

/// The figures of a case; `None` where the standard mesh or the reference has no equilibrium.
fn figures((specimen, material): &(Specimen, Material)) -> Option<Vec<Bounded>> {
    let options = EvaluationOptions::standard(specimen);
    let mut own = evaluated(specimen, material, &options)?;
    bound_discretisation(&mut own, specimen, material, &options, &|| false);
    let mesh = MeshOptions { max_elements: 1_000_000, ..MeshOptions::scaled(specimen, REFERENCE) };
    let reference = evaluated(specimen, material, &EvaluationOptions { mesh, ..options })?;
    let error = |own: f64, fine: f64| ((own - fine) / (PART_SEEN * own)).abs();
    let (step, fine) = (&own.steps[0], &reference.steps[0]);
    let bound = step.force_discretisation_n.map(|b| b / step.force_n.abs());
    let mut figures = vec![(KINDS[0], error(step.force_n, fine.force_n), bound)];
    for (own, fine) in step.integrated_sensitivity.iter().zip(&fine.integrated_sensitivity) {
        figures.push((KINDS[1], error(own.volume_integral, fine.volume_integral), own.discretisation_relative));
    }
    // The bulk modulus is not what a scan is made for, and what is not identifiable is not read.
    let is_read = |own: &PromisedSd| own.parameter != "kappa" && own.identifiable;
    for (own, fine) in own.promised_sd.iter().zip(&reference.promised_sd).filter(|(own, _)| is_read(own)) {
        if let (Some(sd), Some(of_fine)) = (own.value, fine.value) {
            figures.push((KINDS[2], error(sd, of_fine), own.discretisation_relative));
        }
    }
    // Where neither coarser mesh has an equilibrium there is no bound to judge.
    Some(figures.into_iter().filter_map(|(kind, error, bound)| Some(Bounded { kind, error, bound: bound? })).collect())
}

/// What the figures of each kind come to, one line a kind.
fn table(all: &[&Bounded]) -> String {
    let mut lines = String::new();
    for kind in KINDS {
        let of_kind: Vec<&&Bounded> = all.iter().filter(|f| f.kind == kind).collect();
        let median = |of: fn(&Bounded) -> f64| {
            let mut values: Vec<f64> = of_kind.iter().map(|f| of(f)).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
        };
        let held = of_kind.iter().filter(|f| f.error <= f.bound).count();
        lines += &format!(
            "{kind}: {held} of {} within the bound ({:.1} %), median error {:.2e}, median bound {:.2e}\n",
            of_kind.len(),
            100.0 * held as f64 / of_kind.len() as f64,
            median(|f| f.error),
            median(|f| f.bound)
        );
    }
    lines
}

#[test]
#[ignore = "an hour of computing"]
fn random_cases() {
    let stated = |name: &str| std::env::var(name).ok().and_then(|v| v.parse().ok());
    let mut random = Random::new(stated("SEED").unwrap_or(4));
    let cases: Vec<_> = (0..stated("CASES").unwrap_or(160)).map(|_| random_scanned_case(&mut random)).collect();
    // Those that are done, among them those with a reference.
    let progress = Mutex::new((0, Vec::new()));
    cases.par_iter().for_each(|case| {
        let figures = figures(case);
        let (done, found) = &mut *progress.lock().expect("no case panics");
        *done += 1;
        let Some(figures) = figures else { return };
        found.push(figures);
        if found.len() % 10 == 0 {
            let all: Vec<&Bounded> = found.iter().flatten().collect();
            eprintln!("{} of {done} cases with a reference\n{}", found.len(), table(&all));
        }
    });
    let (done, found) = progress.into_inner().expect("no case panics");
    println!("{} of {done} cases with a reference", found.len());
    let all: Vec<&Bounded> = found.iter().flatten().collect();
    println!("{}", table(&all));
    let held = all.iter().filter(|f| f.error <= f.bound).count();
    let part = held as f64 / all.len() as f64;
    println!("all: {held} of {} ({:.1} %)", all.len(), 100.0 * part);
    // Figures are alike within a case: of a hundred cases two parts in a hundred are one standard deviation.
    assert!(part > 0.91, "{part}");
}
