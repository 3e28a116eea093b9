use super::super::test_problem::{block, ogden, scan};
use super::*;
use crate::calibration::{Objective, TermCount};

fn case(truth: Ogden, filter: Filter, draws: usize, max_terms: usize) -> StudyCase {
    let specimen = block();
    StudyCase {
        truth_mesh: MeshOptions { grading: 0.4, ..MeshOptions::scaled(&specimen, 2.0) },
        fit_mesh: MeshOptions::scaled(&specimen, 2.5),
        specimen,
        truth,
        scan: scan(),
        filter,
        draws,
        seed: 7,
        options: CalibrateOptions { terms: TermCount::Auto { max: max_terms }, num_starts: 2, ..CalibrateOptions::default() },
    }
}

fn print(name: &str, found: &Study) {
    println!(
        "{name}: {} of {} draws fitted, chi2 per datum {:.4} ± {:.4}",
        found.num_fitted, found.num_draws, found.chi2_per_datum, found.chi2_sd
    );
    for r in &found.rows {
        println!(
            "  {:<8} truth {:>10.4}  mesh shift {:>+9.4}  mean shift {:>+9.4}  found sd {:>9.4}  promised {:>9.4}  ratio {:.3}  coverage {:.1} %",
            r.parameter,
            r.truth,
            r.mesh_shift,
            r.mean_shift,
            r.found_sd,
            r.promised_sd,
            r.found_sd / r.promised_sd,
            100.0 * r.coverage
        );
    }
    let [bic, f_test, decrement] = &found.num_by_rule;
    println!("  number of terms 1, 2, …: BIC {bic:?}, F-test {f_test:?}, decrement {decrement:?}");
    if let (Some(expected), Some(probability)) = (found.expected_decrease, found.detection_probability) {
        println!(
            "  the last term lowers chi2 by {expected:.1} (BIC asks for {:.1}): found in {:.1} % of draws by theory",
            found.needed_decrease,
            100.0 * probability
        );
    }
}

/// A small version of the study: coverage, spread and number of terms, on another mesh than the truth's, plain and filtered.
#[test]
fn intervals_cover_and_terms_are_found() {
    for filter in [Filter::None, Filter::Hamming2] {
        let n = 24;
        let found = study(&case(ogden(200.0, &[[17.0, 1.91]]), filter, n, 2), &|| (), &|| false).unwrap();
        print(&format!("{filter:?}"), &found);
        assert_eq!(found.num_fitted, n);
        for r in &found.rows {
            // 24 draws: the standard deviation to 1/√48 = 14 %, three of these; mean to 1/√24, 3.5 of these.
            assert!((r.found_sd / r.promised_sd).ln().abs() < 0.45, "{r:?}");
            assert!(r.mean_shift.abs() < 3.5 * r.promised_sd / (n as f64).sqrt() + 0.05 * r.promised_sd, "{r:?}");
            // 95 % of 24: fewer than 19 in one of 300 studies.
            assert!(r.coverage > 0.79, "{r:?}");
        }
        assert_eq!(found.num_by_rule[0][0], n, "one term is found to be enough");
        // Mesh of the truth and of the fit differ: a little above 1 is theirs.
        assert!((found.chi2_per_datum - 1.0).abs() < 0.05, "{}", found.chi2_per_datum);
    }
}

/// Closed form at zero noncentrality: exp(−x/2); and the median of a large one is near itself.
#[test]
fn probabilities_of_detection() {
    // Sankaran's approximation is good to a few thousandths.
    assert!((detection_probability(0.0, 6.0) - (-3f64).exp()).abs() < 5e-3);
    assert!((detection_probability(400.0, 401.0) - 0.5).abs() < 0.02);
    assert!(detection_probability(100.0, 22.0) > 0.999);
}

/// The whole study at the published scan; see docs/calibration.md. Run it in release, alone.
#[test]
#[ignore = "minutes: cargo test --release --lib calibration::study::tests::published -- --ignored --nocapture"]
fn published_scan() {
    let text = include_str!("../../geometries/two-hole-shear.json");
    let number = |name: &str, usual: usize| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(usual);
    let only = std::env::var("CASE").ok();
    let draws = number("DRAWS", 100);
    let stiffening = ogden(2200.0, &[[15.0, 2.0], [0.35, 8.0], [-3.0, -4.0]]);
    let weak = ogden(2173.0, &[[17.0, 1.91], [1e-4, 8.0]]);
    for (name, truth, filter, max_terms) in [
        ("one term", ogden(2173.0, &[[17.0, 1.91]]), Filter::None, 2),
        ("one term, filtered", ogden(2173.0, &[[17.0, 1.91]]), Filter::Hamming2, 2),
        ("two terms, stiffening", ogden(2200.0, &[[16.0, 1.9], [0.35, 8.0]]), Filter::None, 3),
        ("three terms, stiffening", stiffening, Filter::None, 3),
        ("two terms, the second too weak", weak, Filter::None, 2),
    ] {
        if only.as_ref().is_some_and(|o| o != name) {
            continue;
        }
        let mut specimen = Specimen::from_json(text).unwrap();
        specimen.drive_mm = vec![2.5, 7.0];
        let begin = std::time::Instant::now();
        let usual = case(truth, filter, draws, max_terms);
        let study_case = StudyCase {
            truth_mesh: MeshOptions { grading: 0.35, ..MeshOptions::scaled(&specimen, 1.5) },
            fit_mesh: MeshOptions::search(&specimen),
            scan: ScanSettings { voxel_mm: [1.0, 0.1875, 0.75], noise_sd_mm: [0.05; 3], force_sd_n: 0.02, ..scan() },
            options: CalibrateOptions { objective: Objective::Weighted, ..usual.options },
            specimen,
            ..usual
        };
        match study(&study_case, &|| (), &|| false) {
            Ok(found) => print(&format!("{name} ({:.0} s)", begin.elapsed().as_secs_f64()), &found),
            Err(e) => println!("{name}: {e}"),
        }
    }
}
