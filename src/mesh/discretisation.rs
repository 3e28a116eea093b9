//! What a mesh may put a result wrong by: a bound from the same result on coarser meshes.
//!
//! Bonded edges are singular, so that the error of a force falls with about the first power of the element size h, and
//! that of a promised standard deviation goes up and down on its way. One coarser mesh of elements r times as large
//! estimates an error of the first order as |f(r h) − f(h)| / (r − 1) (Richardson; Roache 1994, whose grid convergence
//! index is this times a factor of safety). Two of them do not agree by chance; the root of the mean of the squares of
//! both estimates counts. The factor of safety is measured: `docs/verification.md` tells how often the bound holds.

use super::MeshOptions;
use crate::specimen::Specimen;

/// Element sizes of the coarser meshes, as factors on that of the mesh whose results are bounded.
pub const COARSER: [f64; 2] = [1.6, 2.0];

/// Factor of safety: with it the bound holds in 9 of 10 cases.
const SAFETY: f64 = 1.75;

/// Largest element size, as a factor on the standard one, of a mesh that is bounded: twice the elements of a coarser
/// one are too large for errors that follow their size, and agree with it by chance.
const COARSEST_BOUNDED: f64 = 1.25;

/// The coarser meshes of [`COARSER`]; `None` where the mesh itself is too coarse for them to tell anything.
pub fn coarser_meshes(mesh: &MeshOptions, specimen: &Specimen) -> Option<[MeshOptions; 2]> {
    let is_fine = mesh.section_size_mm <= COARSEST_BOUNDED * MeshOptions::standard(specimen).section_size_mm;
    is_fine.then(|| COARSER.map(|ratio| mesh.refined_by(ratio, specimen, 0.0)))
}

/// What `value` may differ by from its limit on fine meshes, in 9 of 10 cases no more; `coarser` are the same on the
/// meshes of [`COARSER`]. `None` where there is none of them.
pub fn discretisation_bound(value: f64, coarser: [Option<f64>; 2]) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for (ratio, other) in COARSER.into_iter().zip(coarser) {
        let Some(other) = other.filter(|o| o.is_finite()) else { continue };
        sum += ((other - value) / (ratio - 1.0)).powi(2);
        count += 1;
    }
    (count > 0 && value.is_finite()).then(|| SAFETY * (sum / f64::from(count)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_the_first_order_are_bounded_by_their_size_and_the_factor_of_safety() {
        let value = |size: f64| Some(7.0 + 0.3 * size);
        let bound = discretisation_bound(7.3, COARSER.map(value)).expect("two meshes");
        // Rounding alone.
        assert!((bound - SAFETY * 0.3).abs() < 1e-12, "{bound}");
        // Of one mesh what it says alone; of none nothing.
        let of_one = discretisation_bound(7.3, [None, value(2.0)]).expect("one mesh");
        assert!((of_one - bound).abs() < 1e-12);
        assert_eq!(discretisation_bound(7.3, [None, Some(f64::NAN)]), None);
    }

    /// A value that happens to be alike on two meshes is not said to be exact.
    #[test]
    fn agreement_by_chance_is_no_proof() {
        let bound = discretisation_bound(1.0, [Some(1.0), Some(1.2)]).expect("two meshes");
        assert!(bound > 0.1, "{bound}");
    }

    #[test]
    fn coarser_meshes_are_coarser_and_else_alike() {
        let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).expect("shipped");
        let whole = MeshOptions { use_mirror: false, ..MeshOptions::fine(&specimen) };
        for (ratio, mesh) in COARSER.into_iter().zip(coarser_meshes(&whole, &specimen).expect("fine enough")) {
            assert!((mesh.section_size_mm / whole.section_size_mm - ratio).abs() < 1e-12);
            assert!(!mesh.use_mirror && mesh.levels < whole.levels);
        }
        assert!(coarser_meshes(&MeshOptions::search(&specimen), &specimen).is_none());
    }
}
