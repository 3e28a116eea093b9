use super::*;
use crate::diagnosis::laboratory::Laboratory;
use crate::diagnosis::load_effect::FittedEffect;
use crate::diagnosis::metric::Metric;
use crate::diagnosis::prior::BulkPrior;
use crate::diagnosis::registry::Registry;
use crate::diagnosis::supposed::{Supposed, scene_of};
use crate::diagnosis::test_recordings::{FORCE_SD_N, MESH_FACTOR, material, recorded};
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;

const SOLID: &str = include_str!("../../geometries/solid-shear.json");

/// Some cause: which one makes no difference to a verdict.
fn some_cause() -> Vec<FoundCause> {
    let effect = Registry::standard().load_effects()[0];
    FoundCause::of_load_curve(&[FittedEffect {
        effect,
        ordinal: 0,
        names: vec!["offset_n"],
        values: vec![0.1],
        sd: vec![0.01],
        gained: 50.0,
    }])
}

/// Allowance 0.01 mm: what is left counts above 0.02 mm, and of a misfit above that a quarter may be left.
#[test]
fn verdicts_follow_from_what_is_left() {
    let (none, cause) = (Vec::new(), some_cause());
    let verdict = |structured: [f64; 2], causes: &[FoundCause], alternatives: &[FoundCause]| {
        verdict_on(structured, 0.01, false, causes, alternatives)
    };
    assert_eq!(verdict([0.015, 0.015], &none, &none), Verdict::NoMismatch);
    assert_eq!(verdict([0.1, 0.02], &cause, &none), Verdict::Explained);
    assert_eq!(verdict([0.1, 0.02], &cause, &cause), Verdict::ExplainedAmbiguously);
    // More than twice the allowance.
    assert_eq!(verdict([0.1, 0.021], &cause, &none), Verdict::Unexplained);
    // More than a quarter of a misfit that was above the limit, and more than the allowance.
    assert_eq!(verdict([0.04, 0.011], &cause, &none), Verdict::Unexplained);
    assert_eq!(verdict([0.04, 0.0099], &cause, &none), Verdict::Explained);
    // A tenth of a misfit beside a cause that idealises its shape.
    let beside_idealised = |structured: [f64; 2]| verdict_on(structured, 0.01, true, &cause, &none);
    assert_eq!(beside_idealised([0.3, 0.029]), Verdict::Explained);
    assert_eq!(beside_idealised([0.3, 0.031]), Verdict::Unexplained);
    assert_eq!(beside_idealised([0.1, 0.021]), Verdict::Unexplained);
    // A misfit below the limit may stay as it is.
    assert_eq!(verdict([0.019, 0.018], &cause, &none), Verdict::Explained);
}

/// Half of the squares: √½ of the misfit.
#[test]
fn causes_that_leave_more_than_half_are_no_explanation() {
    assert!(explain_too_little(Verdict::Unexplained, [0.1, 0.071]));
    assert!(!explain_too_little(Verdict::Unexplained, [0.1, 0.070]));
    assert!(!explain_too_little(Verdict::Explained, [0.1, 0.09]));
}

/// What the models without and with a turning plate predict of voxels kept back, when fits to the other half are taken
/// to first order, is what the fits themselves predict.
#[test]
fn voxels_kept_back_are_predicted_as_by_fits_to_the_others() {
    let specimen = Specimen { drive_mm: vec![2.0, 4.0], ..Specimen::from_json(SOLID).unwrap() };
    let tested = Registry::standard().tested(&specimen);
    let tilt = tested.into_iter().find(|c| c.name().as_str() == "tilt").unwrap();
    let mut values = tilt.start();
    values[0] += 2.0 * tilt.parameters()[0].scale;
    let turned = scene_of(&[Supposed { cause: tilt.clone(), values }]);
    let observed = Observed::new(&recorded(&material(), &turned, MESH_FACTOR), FORCE_SD_N).unwrap();
    let bulk = BulkPrior { center_kpa: material().bulk_kpa, log_sd: 0.5 };
    let allowance_mm = 0.005;
    let mut inference = Inference {
        laboratory: Laboratory::new(&observed, &MeshOptions::scaled(&observed.specimen, MESH_FACTOR)).unwrap(),
        metric: Metric::new(&observed, allowance_mm, &|_| true),
        settings: FitSettings {
            max_iterations: 20,
            bulk,
            shear: None,
            tolerance: 1e-3,
            relative_tolerance: 0.0,
            goal: None,
        },
        nominal_bulk: bulk,
        believed_bulk: bulk,
        allowance_mm,
        discrepancy_mm2: [0.0; 3],
        mesh_factor: MESH_FACTOR,
        is_cancelled: &|| false,
        progress: &|_| {},
    };
    let measured = inference.laboratory.measured();
    let supposed = Supposed::at_start(tilt);
    let fits = [Vec::new(), vec![supposed]].map(|causes| inference.fit(&measured, &material(), &causes).unwrap());
    let seen = [measured.clone(), measured.clone()];
    let to_first_order = kept_back(&mut inference, &seen, [&fits[0], &fits[1]]).unwrap();
    let colours = chequerboard(&observed);
    for (fitted, to_first_order) in fits.iter().zip(to_first_order) {
        let mut unseen = Vec::new();
        for colour in [false, true] {
            inference.metric = inference.metric_of(&|v| colours[v] != colour);
            let half = inference.fit(&measured, &fitted.material, &fitted.causes).unwrap();
            for field in &half.residual.displacement {
                unseen.extend(field.iter().zip(&colours).filter(|(_, c)| **c == colour).map(|(u, _)| *u));
            }
        }
        let by_fits = Trace { displacement: vec![unseen], force: Vec::new() }.rms_mm();
        let by_all = Trace { force: Vec::new(), ..fitted.residual.clone() }.rms_mm();
        // Of what it adds to a misfit that voxels were not seen, first order leaves out the smaller part.
        let added = by_fits - by_all;
        assert!(added > 0.0 && (to_first_order - by_fits).abs() < 0.5 * added, "{to_first_order} {by_fits} {by_all}");
    }
}
