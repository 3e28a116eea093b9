//! How often what a calibration allows for discretisation holds, over random specimens, materials and drives, without
//! noise; the table is in docs/calibration.md. `cargo test --test calibration_allowance -- --ignored --nocapture` (an
//! hour of one core); CASES sets how many, SEED which.

mod common;

use common::{Random, random_scanned_case};
use lambdak::calibration::{CalibrateOptions, StudyCase, StudyRow, TWO_SIDED_95, TermCount, study};
use lambdak::material::Material;
use lambdak::mesh::MeshOptions;
use lambdak::recording::Filter;
use lambdak::sensitivity::ScanSettings;
use lambdak::specimen::Specimen;
use rayon::prelude::*;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Element size of the mesh that makes the data, whose sections are graded otherwise, as a factor on that of the fits.
const REFERENCE: f64 = 0.6;

/// Order of the errors that singular edges leave: the difference to the reference is 1 − REFERENCE^ORDER of the error.
const ORDER: f64 = 1.4;

/// A case that takes longer is left out and counted.
const PATIENCE: Duration = Duration::from_secs(300);

/// A parameter: its error relative to its estimate, and the standard deviation allowed for it.
struct Allowed {
    is_bulk: bool,
    error: f64,
    sd: f64,
}

fn allowed(row: &StudyRow) -> Allowed {
    let is_bulk = row.parameter == "kappa";
    let estimate = row.truth + row.mesh_shift;
    // The interval of the bulk modulus is symmetric in its logarithm.
    let shift = if is_bulk { (estimate / row.truth).ln() } else { row.mesh_shift / estimate };
    let error = (shift / (1.0 - REFERENCE.powf(ORDER))).abs();
    Allowed { is_bulk, error, sd: row.discretisation_sd / estimate.abs() }
}

/// The identifiable parameters of a case, scanned at two drives; `None` where a mesh has no equilibrium or the fit does
/// not end.
fn parameters((specimen, material): &(Specimen, Material)) -> Option<Vec<Allowed>> {
    let start = Instant::now();
    let is_over = || start.elapsed() > PATIENCE;
    let mut specimen = specimen.clone();
    specimen.drive_mm = vec![0.5 * specimen.drive_mm[0], specimen.drive_mm[0]];
    let fine = MeshOptions::scaled(&specimen, REFERENCE);
    let case = StudyCase {
        truth: material.clone(),
        filter: Filter::None,
        draws: 0,
        blind_draws: 0,
        seed: 0,
        truth_mesh: MeshOptions { grading: 0.4, max_elements: 1_000_000, ..fine },
        fit_mesh: MeshOptions::scaled,
        scan: ScanSettings::default(),
        options: CalibrateOptions { terms: TermCount::Fixed(material.terms.len()), ..CalibrateOptions::default() },
        specimen,
    };
    let found = study(&case, &|| (), &is_over).ok()?;
    Some(found.rows.iter().filter(|row| row.is_identifiable).map(allowed).collect())
}

#[test]
#[ignore = "an hour of computing"]
fn random_cases() {
    let stated = |name: &str| std::env::var(name).ok().and_then(|v| v.parse().ok());
    let mut random = Random::new(stated("SEED").unwrap_or(4));
    let cases: Vec<_> = (0..stated("CASES").unwrap_or(100)).map(|_| random_scanned_case(&mut random)).collect();
    let progress = Mutex::new((0, Vec::new()));
    cases.par_iter().for_each(|case| {
        let found = parameters(case);
        let (done, all) = &mut *progress.lock().expect("no case panics");
        *done += 1;
        all.extend(found);
        eprintln!("{} of {done} cases fitted", all.len());
    });
    let (done, found) = progress.into_inner().expect("no case panics");
    println!("{} of {done} cases fitted", found.len());
    let all: Vec<&Allowed> = found.iter().flatten().collect();
    let holds = |a: &Allowed| a.error <= TWO_SIDED_95 * a.sd;
    for (name, is_bulk) in [("bulk modulus", true), ("moduli and exponents", false)] {
        let of_kind: Vec<&&Allowed> = all.iter().filter(|a| a.is_bulk == is_bulk).collect();
        let median = |of: fn(&Allowed) -> f64| {
            let mut values: Vec<f64> = of_kind.iter().map(|a| of(a)).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
        };
        println!(
            "{name}: {} of {} within 1.96 standard deviations, {} within one; median error {:.2e}, median sd {:.2e}",
            of_kind.iter().filter(|a| holds(a)).count(),
            of_kind.len(),
            of_kind.iter().filter(|a| a.error <= a.sd).count(),
            median(|a| a.error),
            median(|a| a.sd)
        );
    }
    let part = all.iter().filter(|a| holds(a)).count() as f64 / all.len() as f64;
    println!("all: {:.1} % of {}", 100.0 * part, all.len());
    // Parameters are alike within a case: of some fifty cases three parts in a hundred are one standard deviation.
    assert!(part > 0.89, "{part}");
}
