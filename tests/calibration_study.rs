//! Coverage, spread and number of terms over many draws of noise, at the published scan on search-fidelity meshes; the
//! table is in docs/calibration.md. `cargo test --test calibration_study -- --ignored --nocapture` (minutes); DRAWS
//! sets the draws, CASE runs one case.

mod common;

use common::ogden;
use lambdak::calibration::{CalibrateOptions, StudyCase, TermCount, study};
use lambdak::mesh::MeshOptions;
use lambdak::recording::Filter;
use lambdak::sensitivity::ScanSettings;
use lambdak::specimen::Specimen;

#[test]
#[ignore = "minutes of computing"]
fn published_scan() {
    let text = include_str!("../geometries/two-hole-shear.json");
    let draws = std::env::var("DRAWS").ok().and_then(|v| v.parse().ok()).unwrap_or(100);
    let only = std::env::var("CASE").ok();
    for (name, truth, filter) in [
        ("one", ogden(2173.0, &[(17.0, 1.91)]), Filter::None),
        ("filtered", ogden(2173.0, &[(17.0, 1.91)]), Filter::Hamming2),
        ("two, stiffening", ogden(2200.0, &[(16.0, 1.9), (0.35, 8.0)]), Filter::None),
        // Strongly stiffening; three terms are only seen apart at strains that bring them out.
        ("three", ogden(2200.0, &[(16.0, 2.0), (0.002, 14.0), (-0.3, -7.0)]), Filter::None),
        // Second terms at the edge of what can be found.
        ("weak 0.01", ogden(2173.0, &[(17.0, 1.91), (0.01, 8.0)]), Filter::None),
        ("weak 0.02", ogden(2173.0, &[(17.0, 1.91), (0.02, 8.0)]), Filter::None),
        ("weak 0.04", ogden(2173.0, &[(17.0, 1.91), (0.04, 8.0)]), Filter::None),
    ] {
        if only.as_ref().is_some_and(|o| !name.starts_with(o.as_str())) {
            continue;
        }
        let mut specimen = Specimen::from_json(text).unwrap();
        let num_terms = truth.terms.len();
        specimen.drive_mm = if num_terms < 3 { vec![2.5, 7.0] } else { vec![3.0, 6.0, 9.0] };
        let begin = std::time::Instant::now();
        let case = StudyCase {
            truth,
            filter,
            draws,
            blind_draws: draws.min(2),
            seed: 7,
            // Other section, layers and grading than the mesh of the fits.
            truth_mesh: MeshOptions { grading: 0.4, ..MeshOptions::scaled(&specimen, 1.3) },
            fit_mesh: |s, factor| MeshOptions::scaled(s, 1.5 * factor),
            scan: ScanSettings::default(),
            options: CalibrateOptions {
                terms: TermCount::Auto { max: num_terms + 1 },
                num_starts: 2,
                least_promise: 8.0,
                ..CalibrateOptions::default()
            },
            specimen,
        };
        match study(&case, &|| (), &|| false) {
            Ok(found) => println!("{name} ({:.0} s): {found}", begin.elapsed().as_secs_f64()),
            Err(e) => println!("{name}: {e}"),
        }
    }
}
