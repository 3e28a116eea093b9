use super::*;
use crate::diagnosis::load_effect::FittedEffect;
use crate::diagnosis::registry::Registry;

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
