use super::super::test_problem::{block, ogden, scan};
use super::*;
use crate::calibration::TermCount;

fn case(truth: Material, filter: Filter, draws: usize, max_terms: usize) -> StudyCase {
    let specimen = block();
    StudyCase {
        truth_mesh: MeshOptions { grading: 0.4, ..MeshOptions::scaled(&specimen, 2.0) },
        fit_mesh: |s, factor| MeshOptions::scaled(s, 2.5 * factor),
        specimen,
        truth,
        scan: scan(),
        filter,
        draws,
        blind_draws: 3,
        seed: 7,
        options: CalibrateOptions {
            terms: TermCount::Auto { max: max_terms },
            num_starts: 2,
            least_promise: 4.0,
            ..CalibrateOptions::default()
        },
    }
}

/// A small version of the study: coverage, spread and number of terms, on another mesh than the truth's, plain and
/// filtered.
#[test]
fn intervals_cover_and_terms_are_found() {
    for filter in [Filter::None, Filter::Hamming2] {
        let n = 24;
        let found = study(&case(ogden(200.0, &[[17.0, 1.91]]), filter, n, 2), &|| (), &|| false).unwrap();
        println!("{filter:?}: {found}");
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
