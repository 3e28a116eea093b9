//! Causes that stand in for a smooth field.
//!
//! Rounds count the gain of a smooth field in part ([`counted_part`](super::evidence::counted_part)), because it takes
//! up some of what any cause does. Where there really is one, they may therefore name other causes first, each of
//! which takes up a part of it. At the end of the rounds that can be seen: with the field in the fit, the causes that
//! stood in for it are not needed any more, and all is explained better by no more causes than before.

use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::EVIDENCE;
use super::inference::Inference;
use super::registry::Registry;
use super::score_round::has_several_drives;
use super::supposed::Supposed;
use super::thinning::{Needed, thinned};
use super::trace::Trace;

/// The fit with a smooth field in place of causes that it makes needless; `None` where it makes none needless, or does
/// not explain more than they do.
///
/// # Errors
/// [`DiagnosisError`]: the work was cancelled, or a fit has no derivatives.
pub(super) fn with_sponge_for_stand_ins(
    inference: &mut Inference,
    registry: &Registry,
    measured: &Trace,
    fitted: &CauseFit,
) -> Result<Option<CauseFit>, DiagnosisError> {
    let observed = inference.laboratory.observed();
    let takes_up_already = fitted.causes.iter().any(|s| s.cause.is_sponge() || s.cause.is_of_set_up());
    let num_causes = fitted.causes.iter().filter(|s| !s.cause.is_artefact()).count();
    // A single cause that leaves no more than a mesh does stands in for nothing.
    let may_stand_in = num_causes > 1 || num_causes == 1 && !inference.leaves_no_more_than_a_mesh(fitted);
    // At a single drive a smooth field cannot be told from what moves the sample.
    if takes_up_already || !may_stand_in || !has_several_drives(observed) {
        return Ok(None);
    }
    let sponges = registry.sponges(&observed.specimen);
    let causes: Vec<Supposed> = fitted.causes.iter().cloned().chain(sponges).collect();
    if causes.len() == fitted.causes.len() {
        return Ok(None);
    }
    (inference.progress)("asking whether causes stand in for a smooth field");
    let other = match inference.fit(measured, &fitted.material, &causes) {
        Ok(other) => other,
        Err(error) if (inference.is_cancelled)() => return Err(error),
        Err(_) => return Ok(None),
    };
    let other = thinned(inference, measured, other, Needed::BeyondAMesh)?;
    let has_sponge = other.causes.iter().any(|s| s.cause.is_sponge());
    let explains_more = inference.cost_of(&other) + EVIDENCE < inference.cost_of(fitted);
    Ok((has_sponge && other.causes.len() <= fitted.causes.len() && explains_more).then_some(other))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Observed;
    use crate::diagnosis::cause::Cause;
    use crate::diagnosis::scene::Scene;
    use crate::diagnosis::test_recordings::{FORCE_SD_N, MESH_FACTOR, inference_of, material, recorded};
    use std::sync::Arc;

    /// The causes of the fit of a recording of `scene` with slack and a plate off its axis, and of what takes their
    /// place.
    fn in_place_of_slack(scene: &Scene) -> Option<Vec<&'static str>> {
        let recording = recorded(&material(), scene, MESH_FACTOR);
        let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
        let (registry, mut inference) = (Registry::standard(), inference_of(&observed));
        let may_stand_in = |c: &Arc<dyn Cause>| ["slack", "offaxis"].contains(&c.name().as_str());
        let causes = registry.tested(&observed.specimen).into_iter().filter(may_stand_in);
        let causes: Vec<Supposed> = causes.map(Supposed::at_start).collect();
        assert_eq!(causes.len(), 2);
        let measured = inference.laboratory.measured();
        let fitted = inference.fit(&measured, &material(), &causes).unwrap();
        let other = with_sponge_for_stand_ins(&mut inference, &registry, &measured, &fitted).unwrap();
        other.map(|fit| fit.causes.iter().map(|c| c.cause.name().as_str()).collect())
    }

    /// A background alike at all drives, of which slack and a drifting plate take up what they can: it takes their
    /// place. Slack that is there stays.
    #[test]
    fn a_background_takes_the_place_of_what_stood_in_for_it() {
        let mut scene = Scene::default();
        scene.image.background_mm[0] = [0.06, 0.02, 0.05, 0.0, 0.03, 0.0, 0.0, 0.0, 0.0, 0.02];
        scene.image.background_mm[1] = [0.02, 0.0, 0.04, 0.0, 0.0, 0.0, 0.03, 0.0, 0.0, 0.0];
        assert_eq!(in_place_of_slack(&scene), Some(vec!["background"]));
        let mut slack = Scene::default();
        slack.plates[1].translation_mm[0] = -0.15;
        assert_eq!(in_place_of_slack(&slack), None);
    }
}
