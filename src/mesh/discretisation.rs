//! What a mesh may put a result wrong by: a bound from the same result on coarser meshes.
//!
//! Bonded edges are singular, so that the error of a force falls with about the first power of the element size h, and
//! that of a promised standard deviation goes up and down on its way. One coarser mesh of elements r times as large
//! estimates an error of the first order as |f(r h) − f(h)| / (r − 1) (Richardson; Roache 1994). Two such estimates are
//! few, and now and then both meshes agree with the finer one by chance. They are therefore pooled with the error that
//! results of this kind typically have, as one pools a variance from few values with what is known of it beforehand: as
//! if there were [`PRIOR_ESTIMATES`] further estimates of that size. The bound is the 97.5 % point of Student's
//! distribution of as many degrees of freedom as there are estimates, times the root of their mean square.
//! `docs/verification.md` tells how often it holds.

use super::MeshOptions;
use crate::specimen::Specimen;

/// Element sizes of the coarser meshes, as factors on that of the mesh whose results are bounded.
pub const COARSER: [f64; 2] = [1.6, 2.0];

/// How many estimates what is known beforehand counts for: as many as there are coarser meshes.
const PRIOR_ESTIMATES: u8 = 2;

/// 97.5 % points of Student's distribution of three and of four degrees of freedom.
const STUDENT: [f64; 2] = [3.182, 2.776];

/// Largest element size, as a factor on the standard one, of a mesh that is bounded: twice the elements of a coarser
/// one are too large for errors that follow their size, and agree with it by chance.
const COARSEST_BOUNDED: f64 = 1.25;

/// Order with which results of a whole sample converge that singular edges of bonded faces leave. What extrapolates
/// takes this one.
const EDGE_ORDER: f64 = 1.4;
/// Between these it lies: one, for forces at large drives, and two.
const EDGE_ORDERS: [f64; 2] = [1.0, 2.0];

/// Factor by which the difference of our mesh's result and another mesh's, of `ratio` times our element size, gives the
/// error of ours (Richardson's extrapolation with the order 1.4 that singular edges leave); negative where the other
/// mesh is the coarser one.
pub fn error_over_difference(ratio: f64) -> f64 {
    error_of_order(ratio, EDGE_ORDER)
}

/// The same for errors of an order.
fn error_of_order(ratio: f64, order: f64) -> f64 {
    1.0 / (1.0 - ratio.powf(order))
}

/// Standard deviation of what lies beyond a finer mesh of `ratio` times our element size, as a part of what
/// [`error_over_difference`] extrapolates beyond it, where singular edges of bonded faces alone make the error: what
/// the two orders between which theirs lies make of it are the ends of an even distribution.
pub fn sd_over_extrapolated(ratio: f64) -> f64 {
    let beyond = |order: f64| error_of_order(ratio, order) - 1.0;
    let [most, least] = EDGE_ORDERS.map(beyond);
    (most - least) / beyond(EDGE_ORDER) / 12.0_f64.sqrt()
}

/// A kind of results that a mesh puts wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshedResult {
    /// A force.
    Force,
    /// An integrated sensitivity 𝒮.
    IntegratedSensitivity,
    /// A promised standard deviation of an identifiable parameter. That of one which is not may be several times as
    /// wrong, and tells no more than that.
    PromisedSd,
}

impl MeshedResult {
    /// Standard deviation of the relative error of such results on standard meshes: 1.48 times the median of its
    /// magnitude, which is the ratio of the two in a normal distribution. Of 29 random specimens, materials and drives
    /// (`tests/discretisation_study.rs`, seed 3); that of promised standard deviations is a choice between what it is
    /// with one term and what it is with two, which is larger and mostly of parameters that are not identifiable.
    fn typical_error(self) -> f64 {
        match self {
            MeshedResult::Force => 0.0009,
            MeshedResult::IntegratedSensitivity => 0.0019,
            MeshedResult::PromisedSd => 0.02,
        }
    }
}

/// The meshes that tell what one mesh leaves open.
#[derive(Clone, Debug)]
pub struct CoarserMeshes {
    /// Of the element sizes [`COARSER`].
    pub options: [MeshOptions; 2],
    /// Element size of the mesh that is bounded, as a factor on the standard one.
    size: f64,
}

impl CoarserMeshes {
    /// For a mesh of `specimen`; `None` where that is too coarse for others to tell anything.
    pub fn of(mesh: &MeshOptions, specimen: &Specimen) -> Option<CoarserMeshes> {
        let size = mesh.section_size_mm / MeshOptions::standard(specimen).section_size_mm;
        let options = COARSER.map(|ratio| mesh.refined_by(ratio, specimen, 0.0));
        (size <= COARSEST_BOUNDED).then_some(CoarserMeshes { options, size })
    }

    /// What `value`, a result of this kind, may differ by from its limit on fine meshes; in 19 of 20 cases no more.
    /// `coarser` are the same on [`Self::options`]. `None` where there is none of them.
    pub fn bound(&self, kind: MeshedResult, value: f64, coarser: [Option<f64>; 2]) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0);
        for (ratio, other) in COARSER.into_iter().zip(coarser) {
            let Some(other) = other.filter(|o| o.is_finite()) else { continue };
            sum += ((other - value) / (ratio - 1.0)).powi(2);
            count += 1;
        }
        if count == 0 || !value.is_finite() {
            return None;
        }
        let typical = kind.typical_error() * self.size * value;
        let prior = f64::from(PRIOR_ESTIMATES);
        Some(STUDENT[count - 1] * ((sum + prior * typical.powi(2)) / (count as f64 + prior)).sqrt())
    }

    /// [`Self::bound`] relative to the value; `None` where there is nothing to be relative to.
    pub fn relative_bound(&self, kind: MeshedResult, value: f64, coarser: [Option<f64>; 2]) -> Option<f64> {
        self.bound(kind, value, coarser).map(|bound| bound / value.abs()).filter(|r| r.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn published() -> Specimen {
        Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).expect("shipped")
    }

    fn of_standard() -> CoarserMeshes {
        let specimen = published();
        CoarserMeshes::of(&MeshOptions::standard(&specimen), &specimen).expect("fine enough")
    }

    /// With elements of two fifths of the size a difference of one stands for an error of 1/0.6 at the order one and of
    /// 1/0.84 at the order two; the order 1.4 extrapolates 0.3836 beyond it.
    #[test]
    fn orders_of_edges_leave_a_third_of_what_is_extrapolated() {
        let expected = (1.0 / 0.6 - 1.0 / 0.84) / 0.3836 / 12.0_f64.sqrt();
        assert!((sd_over_extrapolated(0.4) - expected).abs() < 1e-4, "{} {expected}", sd_over_extrapolated(0.4));
        assert!((expected - 0.36).abs() < 0.005);
    }

    /// Of errors much larger than is typical, those of two coarser meshes alone count: the root of half of the mean
    /// square, since as many estimates of a typical error stand beside them.
    #[test]
    fn errors_of_the_first_order_are_seen() {
        let meshes = of_standard();
        let value = |size: f64| Some(7.0 + 3.0 * size);
        let bound = meshes.bound(MeshedResult::Force, 10.0, COARSER.map(value)).expect("two meshes");
        let typical = 10.0 * MeshedResult::Force.typical_error();
        // Rounding alone.
        assert!((bound - STUDENT[1] * (0.5 * (9.0 + typical.powi(2))).sqrt()).abs() < 1e-12, "{bound}");
        // Of one mesh what it says alone, with less certainty; of none nothing.
        let of_one = meshes.bound(MeshedResult::Force, 10.0, [None, value(2.0)]).expect("one mesh");
        assert!((of_one - STUDENT[0] * ((9.0 + 2.0 * typical.powi(2)) / 3.0).sqrt()).abs() < 1e-12, "{of_one}");
        assert_eq!(meshes.bound(MeshedResult::Force, 10.0, [None, Some(f64::NAN)]), None);
        let of_nothing = meshes.relative_bound(MeshedResult::Force, 0.0, [Some(0.0), None]);
        assert_eq!(of_nothing, None);
    }

    /// A value that happens to be alike on all meshes is not said to be exact, and that of a finer mesh is better.
    #[test]
    fn agreement_by_chance_is_no_proof() {
        let specimen = published();
        let finer = CoarserMeshes::of(&MeshOptions::scaled(&specimen, 0.5), &specimen).expect("fine enough");
        for kind in [MeshedResult::Force, MeshedResult::IntegratedSensitivity, MeshedResult::PromisedSd] {
            let [standard, fine] = [of_standard(), finer.clone()]
                .map(|meshes| meshes.relative_bound(kind, -2.0, [Some(-2.0); 2]).expect("two meshes"));
            let expected = STUDENT[1] * kind.typical_error() * 0.5f64.sqrt();
            assert!((standard / expected - 1.0).abs() < 1e-12, "{standard} {expected}");
            assert!((fine / standard - 0.5).abs() < 1e-12, "{fine} {standard}");
        }
    }

    #[test]
    fn coarser_meshes_are_coarser_and_else_alike() {
        let specimen = published();
        let whole = MeshOptions { use_mirror: false, ..MeshOptions::fine(&specimen) };
        let coarser = CoarserMeshes::of(&whole, &specimen).expect("fine enough");
        for (ratio, mesh) in COARSER.into_iter().zip(coarser.options) {
            assert!((mesh.section_size_mm / whole.section_size_mm - ratio).abs() < 1e-12);
            assert!(!mesh.use_mirror && mesh.levels < whole.levels);
        }
        assert!(CoarserMeshes::of(&MeshOptions::search(&specimen), &specimen).is_none());
    }
}
