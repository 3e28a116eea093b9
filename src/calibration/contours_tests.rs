use super::super::test_problem::{block, coarse, same_mesh, truth};
use super::*;
use crate::calibration::{FitOptions, Objective, Observed};
use crate::recording::Filter;

/// Polynomials give what solving at every place gives: to a thousandth of each loss, or of a thousandth of the largest
/// one where a loss vanishes (the data hold no noise).
#[test]
fn polynomials_follow_the_model() {
    let (_, scan) = same_mesh(&truth());
    let recording = scan.recording("block", &block(), scan.noiseless(), Filter::None).unwrap();
    let observed = [Observed::new(&recording, 0.01).unwrap()];
    let problem = CalibrationProblem::new(&observed, &coarse, Objective::Weighted).unwrap();
    let fit = problem.fit(&truth(), None, &FitOptions::default(), &|| false).unwrap();
    let options = ContourOptions { num_values: 5, ..ContourOptions::default() };
    let found = contours(&problem, &fit, &options, &|| false).unwrap();
    let axes = [0, 1, 2].map(|index| Axis::of(&fit, index, &options));
    for (contour, [first, second]) in found.iter().zip([[0, 1], [0, 2], [1, 2]]) {
        let solved = place_by_place(&problem, &fit, [&axes[first], &axes[second]], &|| false).unwrap();
        for (k, losses) in [&contour.loss_u, &contour.loss_f].into_iter().enumerate() {
            let solved: Vec<f64> = solved.iter().map(|l| l.unwrap()[k]).collect();
            let largest = solved.iter().copied().fold(0.0, f64::max);
            for (found, solved) in losses.iter().zip(&solved) {
                let (found, allowed) = (found.unwrap(), 1e-3 * solved.max(1e-3 * largest));
                assert!((found - solved).abs() < allowed, "{:?}: {found} {solved} {largest}", contour.parameters);
            }
        }
        // The estimate itself is in the middle.
        assert!(contour.loss_u[12].unwrap() < 1e-6 * contour.loss_u[0].unwrap());
    }
}
