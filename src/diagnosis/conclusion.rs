//! The last stage: what a diagnosis comes to.

use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::UNEXPLAINED;
use super::fit::{derivatives, first_order_refit};
use super::found::FoundCause;
use super::inference::Inference;
use super::prior::FitSettings;
use super::trace::Trace;
use crate::calibration::Observed;
use crate::rate::Verdict;

/// Causes of a misfit above that limit explain it where they leave less than this part of it (rms), or no more than the
/// allowance: the right cause leaves a tenth or less, but for the odd debond; another one in its place about a third.
const EXPLAINED_LEAVES: f64 = 0.25;
/// A cause whose model idealises its shape errs by some percent of its effect: a misfit counts as left unexplained
/// beside it above this part of what was there (rms; half of the squares that a further cause must explain there,
/// [`SMALLEST_SHARE`](super::evidence::SMALLEST_SHARE)).
const IDEALISED_LEAVES: f64 = 0.1;
/// Causes of a smaller misfit explain it where they leave less than this part of it (rms): half of the squares, as much
/// of which is what the mesh leaves.
const SMALL_LEAVES: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Without a cause, a misfit above this multiple of the allowance (rms) is one. Nominal models of recordings with
/// nothing hidden leave less than one.
const MISMATCH: f64 = 1.5;
/// Causes claim a misfit where one of them moves the sample by more than this part of it (rms).
const CLAIMS: f64 = 0.5;
/// Where causes leave more than this part of the squares unexplained, they are not named but listed as tried.
const UNEXPLAINED_SHARE: f64 = 0.5;
/// Blocks of the chequerboard along the length and across the width.
const BLOCKS: f64 = 4.0;

/// How a diagnosis ended: `structured_mm` is the misfit beyond noise (mm rms) without and with the causes, of which one
/// may idealise its shape.
pub(super) fn verdict_on(
    structured_mm: [f64; 2],
    allowance_mm: f64,
    is_idealised: bool,
    causes: &[FoundCause],
    alternatives: &[FoundCause],
) -> Verdict {
    let [before, after] = structured_mm;
    let of_model = if is_idealised { IDEALISED_LEAVES * before } else { 0.0 };
    let limit = of_model.max(UNEXPLAINED * allowance_mm);
    // Of a misfit that is hardly more than a mesh's, causes that claim it must take the larger part.
    let claim_it = before > allowance_mm && causes.iter().any(|c| c.effect_rms_mm > CLAIMS * before);
    let enough = allowance_mm.min(if claim_it { SMALL_LEAVES * before } else { f64::INFINITY });
    let is_half_done = (before > limit || claim_it) && after > enough.max(EXPLAINED_LEAVES * before);
    let is_left = after > if causes.is_empty() { MISMATCH * allowance_mm } else { limit };
    if is_left || is_half_done {
        Verdict::Unexplained
    } else if causes.is_empty() {
        Verdict::NoMismatch
    } else if alternatives.is_empty() {
        Verdict::Explained
    } else {
        Verdict::ExplainedAmbiguously
    }
}

/// Whether causes take away the smaller part of what is there, so that they are no explanation of it.
pub(super) fn explain_too_little(verdict: Verdict, [before, after]: [f64; 2]) -> bool {
    verdict == Verdict::Unexplained && after.powi(2) > UNEXPLAINED_SHARE * before.powi(2)
}

/// Fits each of the two models to the two colours of a chequerboard of blocks in turn and predicts the other colour.
/// `seen` is what each of the two models is compared with. Gives the rms misfit (mm) on the blocks that the fits did
/// not see, without and with the causes.
///
/// The fits to half of the voxels go to first order from where that to all of them ended: they differ from it by
/// little, and cost no equilibria.
///
/// # Errors
/// [`DiagnosisError`]: no derivatives, or the work was cancelled.
pub(super) fn kept_back(
    inference: &mut Inference,
    seen: &[Trace; 2],
    fits: [&CauseFit; 2],
) -> Result<[f64; 2], DiagnosisError> {
    let colours = chequerboard(inference.laboratory.observed());
    let metrics = [false, true].map(|colour| inference.metric_of(&|v| colours[v] != colour));
    let bulks = [inference.nominal_bulk, inference.settings.bulk];
    let mut rms_mm = [0.0; 2];
    for (n, fitted) in fits.into_iter().enumerate() {
        let columns = derivatives(&mut inference.laboratory, &fitted.material, &fitted.causes, &fitted.prediction)?;
        let settings = FitSettings { bulk: bulks[n], ..inference.settings };
        let mut unseen = Vec::new();
        for (colour, metric) in [false, true].into_iter().zip(&metrics) {
            let change = first_order_refit(metric, &seen[n], fitted, &settings, &columns);
            let residual = seen[n].plus(-1.0, &fitted.prediction.trace).plus(-1.0, &change);
            for field in &residual.displacement {
                unseen.extend(field.iter().zip(&colours).filter(|(_, c)| **c == colour).map(|(u, _)| *u));
            }
        }
        rms_mm[n] = Trace { displacement: vec![unseen], force: Vec::new() }.rms_mm();
    }
    Ok(rms_mm)
}

/// The colour of every voxel on a chequerboard of blocks in the plane of x and z.
fn chequerboard(observed: &Observed) -> Vec<bool> {
    let b = observed.specimen.block;
    observed
        .mask
        .voxels
        .iter()
        .map(|&v| {
            let x = observed.mask.grid.center_mm(v as usize);
            let i = ((x[0] / b.length_mm + 0.5) * BLOCKS).floor() as i64;
            let k = ((x[2] / b.width_mm + 0.5) * BLOCKS).floor() as i64;
            (i + k).rem_euclid(2) == 0
        })
        .collect()
}

#[cfg(test)]
#[path = "conclusion_tests.rs"]
mod tests;
