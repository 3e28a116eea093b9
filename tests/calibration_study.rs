//! Coverage, spread and number of terms over many draws of noise, at the published scan on search meshes; the table is in
//! docs/calibration.md. `cargo test --release --test calibration_study -- --ignored --nocapture`; DRAWS sets the draws,
//! CASE runs one case.

mod common;

use common::ogden;
use lambdak::calibration::{CalibrateOptions, StudyCase, TermCount, study};
use lambdak::mesh::MeshOptions;
use lambdak::recording::Filter;
use lambdak::sensitivity::{PartialVoxels, ScanSettings};
use lambdak::specimen::Specimen;

#[test]
#[ignore = "minutes of computing"]
fn published_scan() {
    let text = include_str!("../geometries/two-hole-shear.json");
    let draws = std::env::var("DRAWS").ok().and_then(|v| v.parse().ok()).unwrap_or(100);
    let only = std::env::var("CASE").ok();
    for (name, truth, filter, max_terms) in [
        ("one", ogden(2173.0, &[(17.0, 1.91)]), Filter::None, 2),
        ("filtered", ogden(2173.0, &[(17.0, 1.91)]), Filter::Hamming2, 2),
        ("two", ogden(2200.0, &[(16.0, 1.9), (0.35, 8.0)]), Filter::None, 3),
        ("three", ogden(2200.0, &[(15.0, 2.0), (0.35, 8.0), (-3.0, -4.0)]), Filter::None, 3),
        ("weak", ogden(2173.0, &[(17.0, 1.91), (1e-4, 8.0)]), Filter::None, 2),
    ] {
        if only.as_ref().is_some_and(|o| o != name) {
            continue;
        }
        let mut specimen = Specimen::from_json(text).unwrap();
        specimen.drive_mm = vec![2.5, 7.0];
        let begin = std::time::Instant::now();
        let case = StudyCase {
            truth,
            filter,
            draws,
            seed: 7,
            truth_mesh: MeshOptions { grading: 0.35, ..MeshOptions::scaled(&specimen, 1.5) },
            fit_mesh: MeshOptions::search(&specimen),
            scan: ScanSettings {
                voxel_mm: [1.0, 0.1875, 0.75],
                noise_sd_mm: [0.05; 3],
                force_sd_n: 0.02,
                partial_voxels: PartialVoxels::Uniform,
            },
            options: CalibrateOptions {
                terms: TermCount::Auto { max: max_terms },
                num_starts: 1,
                least_promise: 4.0,
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
