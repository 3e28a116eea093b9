use super::super::test_problem::{block, coarse, ogden, same_mesh};
use super::*;
use crate::calibration::{FitOptions, Objective, Observed};
use crate::recording::Filter;

/// Between the places that are solved polynomials give what solving gives there: misfits of displacements and forces to
/// a thousandth of the largest, by which polynomials count as following at all.
#[test]
fn polynomials_follow_the_model() {
    let truth = ogden(2000.0, &[[17.0, 1.91]]);
    let (_, scan) = same_mesh(&truth);
    let recording = scan.recording("block", &block(), &scan.draw(3, 0), Filter::None).unwrap();
    let observed = [Observed::new(&recording, 0.01).unwrap()];
    let problem = CalibrationProblem::new(&observed, &coarse, Objective::Weighted).unwrap();
    let fit = problem.fit(&truth, None, &FitOptions::default(), &|| false).unwrap();
    // Another number than where every place is solved.
    let options = ContourOptions { num_values: 5, num_values_solved: 3, ..ContourOptions::default() };
    let found = contours(&problem, &fit, &options, &|| false).unwrap();
    let axes = [0, 1, 2].map(|index| Axis::of(&fit, index, &options));
    for (contour, [first, second]) in found.iter().zip(PAIRS) {
        assert_eq!(contour.loss_u.len(), 25, "{:?} is not by polynomials", contour.parameters);
        let solved = place_by_place(&problem, &fit, [&axes[first], &axes[second]], &parts(5), &|| false).unwrap();
        for (k, losses) in [&contour.loss_u, &contour.loss_f].into_iter().enumerate() {
            let solved: Vec<f64> = solved.iter().map(|l| l.unwrap()[k].sqrt()).collect();
            let largest = solved.iter().copied().fold(0.0, f64::max);
            for (found, solved) in losses.iter().zip(&solved) {
                let found = found.unwrap().sqrt();
                assert!((found - solved).abs() < 1e-3 * largest, "{:?}: {found} {solved}", contour.parameters);
            }
        }
        // The estimate itself is in the middle: its own losses, to what the polynomials leave there.
        assert!((contour.loss_u[12].unwrap() / fit.loss_u - 1.0).abs() < 1e-3, "{:?}", contour.parameters);
    }
}
