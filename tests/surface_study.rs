//! What cameras are promised to tell, found again: calibrations of many noisy recordings of a face, truth and fits on
//! meshes of their own. The table is in docs/howto-cameras.md.
//! `cargo test --test surface_study -- --ignored --nocapture` (minutes); DRAWS sets the draws, CASE runs one case.

mod common;

use common::one_term;
use lambdak::calibration::{VerifyOptions, verify};
use lambdak::mesh::MeshOptions;
use lambdak::sensitivity::ScanSettings;
use lambdak::specimen::Specimen;

/// Found over promised deviations that are told as kept, as for designs.
const AS_PROMISED: std::ops::RangeInclusive<f64> = 0.8..=1.25;

#[test]
#[ignore = "minutes of computing"]
fn promises_are_found_again() {
    let draws = std::env::var("DRAWS").ok().and_then(|v| v.parse().ok()).unwrap_or(20);
    let only = std::env::var("CASE").ok();
    let shear = include_str!("../geometries/solid-shear.json");
    let dumbbell = include_str!("../geometries/iso37-type4.json");
    for (name, text, drive_mm, surface) in [
        ("sheared block, one camera", shear, vec![2.5, 5.0], "+z"),
        ("sheared block, two cameras", shear, vec![2.5, 5.0], "+z,all"),
        ("dumb-bell, one camera", dumbbell, vec![8.0, 16.0], "+y"),
        ("dumb-bell, two cameras", dumbbell, vec![8.0, 16.0], "+y,all"),
    ] {
        if only.as_ref().is_some_and(|o| !name.starts_with(o.as_str())) {
            continue;
        }
        let specimen = Specimen { drive_mm, ..Specimen::from_json(text).unwrap() };
        let scan = ScanSettings {
            voxel_mm: [0.5; 3],
            noise_sd_mm: [0.005, 0.005, 0.005],
            force_sd_n: 0.02,
            surface: Some(surface.parse().unwrap()),
            ..ScanSettings::default()
        };
        let mut options = VerifyOptions::new(&specimen, draws, 9);
        options.fit_mesh = MeshOptions::scaled(&specimen, 1.5);
        options.truth_mesh = MeshOptions { grading: 0.4, ..MeshOptions::scaled(&specimen, 1.0) };
        options.correction_mesh = Some(MeshOptions::scaled(&specimen, 1.2));
        let begin = std::time::Instant::now();
        let spreads = verify(&specimen, &one_term(), &scan, &options, &|| (), &|| false).unwrap();
        println!("{name} ({:.0} s)", begin.elapsed().as_secs_f64());
        for s in &spreads {
            let promised = s.promised_sd.unwrap_or(f64::NAN);
            println!(
                "  {:<8} truth {:<7} mean {:<9.5} found {:<9.4} promised {:<9.4} ratio {:.2}, mesh {:+.2} sd, {} of {}{}",
                s.parameter,
                s.truth,
                s.mean,
                s.found_sd,
                promised,
                s.found_sd / promised,
                s.discretisation_bias.unwrap_or(f64::NAN) / promised,
                s.draws,
                s.draws + s.failed_draws,
                if s.identifiable { "" } else { "  not identifiable" }
            );
            if s.identifiable {
                // 20 draws leave a spread uncertain by 16 %.
                assert!(AS_PROMISED.contains(&(s.found_sd / promised)), "{name}: {}", s.parameter);
                assert_eq!(s.failed_draws, 0, "{name}");
            }
        }
    }
}
