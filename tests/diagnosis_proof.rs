//! The proof of the diagnosis in small: what is concealed is drawn alike from one seed, and is found or not named falsely. The
//! whole proof is `lambdak prove-diagnosis`.

mod common;

use lambdak::diagnosis::Verdict;
use lambdak::proof::{HiddenCause, conceal, draw_cause, score_one};
use lambdak::specimen::Specimen;

fn specimen() -> Specimen {
    Specimen::from_json(include_str!("../geometries/two-hole-shear.json")).unwrap()
}

#[test]
fn one_seed_conceals_one_recording() {
    let hidden = draw_cause(HiddenCause::Gain, 3);
    assert_eq!(hidden, draw_cause(HiddenCause::Gain, 3));
    assert_ne!(hidden, draw_cause(HiddenCause::Gain, 4));
    let [a, b] = [0, 1].map(|_| conceal(&specimen(), &hidden).unwrap().recording);
    assert_eq!(a.steps[2].force_n, b.steps[2].force_n);
    let bits = |r: &lambdak::recording::Recording| -> Vec<u64> {
        r.steps.iter().flat_map(|s| &s.displacement).flatten().map(|x| x.to_bits()).collect()
    };
    assert_eq!(bits(&a), bits(&b));
}

#[test]
fn a_control_names_nothing() {
    let found = score_one(&specimen(), &draw_cause(HiddenCause::None, 21), true, 2.2, &common::never).unwrap();
    assert_eq!(found.verdict, Some(Verdict::NoMismatch), "{found:?}");
}

/// 4 % gain error: about five times the allowance along the drive.
#[test]
fn a_plain_gain_error_is_found_with_its_size() {
    let hidden = lambdak::proof::Hidden { strength: 0.04, which: 0, ..draw_cause(HiddenCause::Gain, 22) };
    let found = score_one(&specimen(), &hidden, true, 2.2, &common::never).unwrap();
    assert!(found.is_right, "{found:?}");
    // Three intervals of 95 %: one may miss.
    assert!(found.deviations.iter().filter(|d| d.1.abs() <= 1.0).count() >= 2, "{found:?}");
}

/// Where the diagnosis is not told of debonds it must say that something is left.
#[test]
fn an_unknown_cause_is_not_named_no_mismatch() {
    let hidden = lambdak::proof::Hidden {
        which: 1,
        center_mm: [10.7, 3.2, 0.0],
        extent_mm: [4.0, 0.0, 19.1],
        ..draw_cause(HiddenCause::Debond, 23)
    };
    let found = score_one(&specimen(), &hidden, false, 2.2, &common::never).unwrap();
    assert_ne!(found.verdict, Some(Verdict::NoMismatch), "{found:?}");
    assert!(!found.named.iter().any(|n| n == "debond"), "{found:?}");
}
