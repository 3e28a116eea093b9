//! Artefacts of the image: found in what a fit leaves, taken into it, and looked for again where it has changed.

use super::error::DiagnosisError;
use super::findings::Findings;
use super::inference::Inference;
use super::registry::Registry;
use super::supposed::{Supposed, scene_of};
use super::trace::Trace;

/// Finds the artefacts of the image in what the fit so far leaves, if none is in it yet, and fits their sizes.
///
/// # Errors
/// [`DiagnosisError`]: the work was cancelled, or the fit has no derivatives.
pub(super) fn take_out_artefacts(
    inference: &mut Inference,
    registry: &Registry,
    findings: &mut Findings,
    measured: &Trace,
) -> Result<(), DiagnosisError> {
    let current = &findings.current;
    if current.causes.iter().all(|c| !c.cause.is_artefact()) {
        let found = registry.artefacts(inference.laboratory.observed(), &current.residual, inference.progress);
        if !found.is_empty() {
            let causes = current.causes.iter().cloned().chain(found).collect::<Vec<_>>();
            findings.current = inference.fit(measured, &current.material, &causes)?;
        }
    }
    Ok(())
}

/// Looks for the artefacts of the image again, in what the fit leaves without them, and fits anew where they are others
/// now: what looked like one before all causes were found may have been a cause's. Whether they are others.
///
/// # Errors
/// [`DiagnosisError`]: the work was cancelled, or the fit has no derivatives.
pub(super) fn look_for_artefacts_again(
    inference: &mut Inference,
    registry: &Registry,
    findings: &mut Findings,
    measured: &Trace,
) -> Result<bool, DiagnosisError> {
    let (known, others): (Vec<Supposed>, Vec<Supposed>) =
        findings.current.causes.iter().cloned().partition(|s| s.cause.is_artefact());
    if known.is_empty() {
        return Ok(false);
    }
    let mut without = findings.current.residual.clone();
    for jump in scene_of(&known).image.jumps {
        for &voxel in jump.voxels.iter() {
            without.displacement[jump.step][voxel as usize][jump.component] += jump.size_mm;
        }
    }
    let found = registry.artefacts(inference.laboratory.observed(), &without, &|_| {});
    let identities = |all: &[Supposed]| all.iter().map(|s| s.cause.identity()).collect::<Vec<_>>();
    let are_others = identities(&found) != identities(&known);
    if are_others {
        (inference.progress)(&format!("of {} artefacts of the image {} are left", known.len(), found.len()));
        let causes = [others, found].concat();
        findings.current = inference.fit(measured, &findings.current.material, &causes)?;
    }
    Ok(are_others)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Observed;
    use crate::diagnosis::scene::{Jump, Scene};
    use crate::diagnosis::test_recordings::{FORCE_SD_N, MESH_FACTOR, inference_of, material, recorded};
    use std::sync::Arc;

    /// A group of voxels that is a turn off, and another that looked so before: the first stays, with its size, the
    /// other goes.
    #[test]
    fn artefacts_that_are_not_found_again_go() {
        let plain = recorded(&material(), &Scene::default(), MESH_FACTOR);
        let plain = Observed::new(&plain, FORCE_SD_N).unwrap();
        let around = |x_mm: f64| -> Vec<u32> {
            let center = |v: &u32| plain.mask.grid.center_mm(plain.mask.voxels[*v as usize] as usize);
            let is_near = |x: [f64; 3]| (x[0] - x_mm).abs() < 4.0 && x[2].abs() < 5.0;
            (0..plain.mask.num_voxels() as u32).filter(|v| is_near(center(v))).collect()
        };
        let mut scene = Scene::default();
        scene.image.jumps.push(Jump { step: 1, component: 2, voxels: Arc::new(around(-5.0)), size_mm: 0.4 });
        let recording = recorded(&material(), &scene, MESH_FACTOR);
        let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
        let (registry, mut inference) = (Registry::standard(), inference_of(&observed));
        let measured = inference.laboratory.measured();
        let nominal = inference.fit(&measured, &material(), &[]).unwrap();
        let mut findings = Findings::of_nominal(nominal.clone());
        take_out_artefacts(&mut inference, &registry, &mut findings, &measured).unwrap();
        let right = findings.current.causes.clone();
        assert_eq!(right.len(), 1);
        // Other voxels by the same cause: those of a residual that jumps elsewhere.
        let mut elsewhere = nominal.residual.scaled(0.0);
        around(5.0).into_iter().for_each(|v| elsewhere.displacement[1][v as usize][0] = 0.5);
        let wrong = registry.artefacts(&observed, &elsewhere, &|_| {});
        assert_eq!(wrong.len(), 1);
        let both = [&right[..], &wrong].concat();
        findings.current = inference.fit(&measured, &material(), &both).unwrap();
        assert!(look_for_artefacts_again(&mut inference, &registry, &mut findings, &measured).unwrap());
        assert!(!look_for_artefacts_again(&mut inference, &registry, &mut findings, &measured).unwrap());
        let [left] = &findings.current.causes[..] else { panic!("{}", findings.current.causes.len()) };
        assert_eq!(left.cause.identity(), right[0].cause.identity());
        // The mean of more than fifty voxels of 0.01 mm of noise each: seven standard deviations.
        assert!((left.values[0] - 0.4).abs() < 0.01, "{}", left.values[0]);
    }
}
