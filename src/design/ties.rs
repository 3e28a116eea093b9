//! Designs that are equal within what meshes leave open, and the one of them that is simplest to make.

use super::confirm::{Confirmed, standard_error};
use super::study::Study;
use crate::specimen::{Hole, Specimen};

/// Two designs are equal where the mean of the difference of their ln objectives over the meshes is less than so many
/// of its standard errors. With three meshes, chance alone exceeds four with a probability of one in twenty
/// (Student's t, two degrees of freedom).
const EQUAL_WITHIN: f64 = 4.0;
/// Nor are they equal where that mean is larger than this, however large the error.
const LARGEST_DIFFERENCE: f64 = 0.02;
/// Differences of ln objectives below this are of no use to anybody.
const NO_DIFFERENCE: f64 = 0.002;

/// The places in `ranked`, best first, of the designs within every limit that are equal to the first, the first
/// included. What is better than one that is equal to the first is equal to it, too, however well its difference is
/// known: a worse design must not be preferred to it.
pub(super) fn equal_to_best(study: &Study, base: &Confirmed, ranked: &[Confirmed]) -> Vec<usize> {
    let Some(best) = ranked.first() else { return Vec::new() };
    let of_best = best.log_objectives(study, base);
    let is_equal = |c: &Confirmed| {
        let apart: Vec<f64> = of_best.iter().zip(c.log_objectives(study, base)).map(|(a, b)| a - b).collect();
        let mean = apart.iter().sum::<f64>() / (apart.len() as f64).max(1.0);
        mean.abs() <= (EQUAL_WITHIN * standard_error(&apart)).clamp(NO_DIFFERENCE, LARGEST_DIFFERENCE)
    };
    let judged = ranked.iter().map(|c| (c.is_within_limits == best.is_within_limits).then(|| is_equal(c)));
    down_to_the_last_equal(&judged.collect::<Vec<_>>())
}

/// The places of what is judged (`None`: not to be compared), from the first to the last that is equal to it.
fn down_to_the_last_equal(judged: &[Option<bool>]) -> Vec<usize> {
    let last = judged.iter().rposition(|j| *j == Some(true)).unwrap_or(0);
    (0..=last).filter(|&place| place == 0 || judged[place].is_some()).collect()
}

/// Of the designs at `places`, the place of the one that is simplest to make: fewest holes, then fewest that are not
/// circles, then fewest different diameters and outlines; of equals the better one.
pub(super) fn simplest(ranked: &[Confirmed], places: &[usize]) -> Option<usize> {
    let key = |place: &usize| {
        let specimen = &ranked[*place].specimen;
        let num_holes: usize = specimen.samples().iter().map(|s| s.holes.len()).sum();
        (num_holes, num_not_round(specimen), num_outlines(specimen), *place)
    };
    places.iter().copied().min_by_key(key)
}

/// How many holes are not circles.
fn num_not_round(specimen: &Specimen) -> usize {
    specimen.samples().iter().flat_map(|s| &s.holes).filter(|hole| hole.shape.is_some()).count()
}

/// How many different diameters and lengths (to 1 µm) and kinds a specimen's holes have.
fn num_outlines(specimen: &Specimen) -> usize {
    let holes = specimen.samples().into_iter().flat_map(|s| s.holes);
    let micrometres = |length_mm: f64| (1e3 * length_mm).round() as i64;
    let outline = |h: Hole| (micrometres(h.diameter_mm), micrometres(h.length_mm()), h.shape.map(|shape| shape.kind));
    let mut all: Vec<_> = holes.map(outline).collect();
    all.sort_unstable();
    all.dedup();
    all.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The third differs from the first by little, but surely; the fifth by more, and it is not known by how much. The
    /// fourth breaks a limit.
    #[test]
    fn what_is_better_than_an_equal_is_equal() {
        let judged = [Some(true), Some(false), Some(false), None, Some(true), Some(false)];
        assert_eq!(down_to_the_last_equal(&judged), [0, 1, 2, 4]);
        assert_eq!(down_to_the_last_equal(&[Some(true), Some(false), None]), [0]);
        assert_eq!(down_to_the_last_equal(&[None]), [0]);
    }

    #[test]
    fn diameters_are_counted_once() {
        let text = include_str!("../../geometries/two-hole-shear.json");
        let mut specimen = Specimen::from_json(text).expect("the published specimen");
        assert_eq!(num_outlines(&specimen), 1);
        specimen.holes[0].diameter_mm = 4.0;
        assert_eq!(num_outlines(&specimen), 2);
        specimen.holes.clear();
        assert_eq!(num_outlines(&specimen), 0);
    }
}
