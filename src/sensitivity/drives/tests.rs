//! Drive selection and drive search.

use super::super::continuum::tests::block;
use super::*;

#[test]
fn drives_are_checked() {
    let (there, back) = (block("shear"), block("shear").at_drives(&[-1.0]));
    let check = |d: &[f64]| check_drives(&there, &DriveSelection::DriveMm(d.to_vec()));
    let check_back = |d: &[f64]| check_drives(&back, &DriveSelection::DriveMm(d.to_vec()));
    assert!(check_back(&[-2.5, -5.0]).is_ok());
    assert!(matches!(check_back(&[-5.0, -2.5]), Err(EvaluationError::InvalidDrive { .. })));
    assert!(matches!(check_back(&[2.5]), Err(EvaluationError::OtherWay { .. })));
    assert!(matches!(check(&[-1.0]), Err(EvaluationError::OtherWay { .. })));
    assert!(check(&[2.5, 5.0, 7.0]).is_ok());
    assert!(matches!(check(&[]), Err(EvaluationError::NoDrive)));
    for bad in [vec![0.0], vec![1.0, -2.0], vec![f64::NAN], vec![2.0, 2.0], vec![1.0, f64::INFINITY]] {
        assert!(matches!(check(&bad), Err(EvaluationError::InvalidDrive { .. })), "{bad:?}");
    }
    for bad in [1.0, 0.5, f64::NAN, 100.0] {
        assert!(matches!(
            check_drives(&there, &DriveSelection::MedianStretch(bad)),
            Err(EvaluationError::InvalidMedianStretch { .. })
        ));
    }
}

/// The search finds the drive of increasing functions of any curvature in few calls.
#[test]
fn drive_search_converges() {
    let shear = |d: f64| 0.5 * d / 6.4 + (1.0 + 0.25 * (d / 6.4) * (d / 6.4)).sqrt();
    let functions: [(&str, &dyn Fn(f64) -> f64); 4] = [
        ("shear", &shear),
        ("softer", &|d| 1.0 + 0.8 * (shear(d) - 1.0)),
        ("stiffening", &|d| 1.0 + 0.01 * d * d),
        ("saturating", &|d| 1.0 + 0.9 * (1.0 - (-0.2 * d).exp())),
    ];
    for (name, f) in functions {
        for target in [1.01, 1.2, 1.7] {
            for guess in [0.3, 3.0, 30.0] {
                let mut calls = 0;
                let drive = find_drive(guess, target, |d| {
                    calls += 1;
                    Ok(f(d))
                })
                .unwrap();
                assert!((f(drive) - target).abs() <= MEDIAN_TOLERANCE);
                assert!(calls <= 14, "{name} {target} {guess}: {calls} calls");
            }
        }
    }
    let start = homogeneous_drive_mm(&block("shear"), 1.2);
    // Closed form: 4 mm × (1.2 − 1/1.2).
    assert!((start - 4.0 * (1.2 - 1.0 / 1.2)).abs() < 1e-12);
    let back = homogeneous_drive_mm(&block("shear").at_drives(&[-1.0]), 1.2);
    assert!((back + start).abs() < 1e-12);
    // The other way the same search goes: magnitudes are sought.
    let found = find_drive(-3.0, 1.2, |d| Ok(shear(-d))).unwrap();
    assert!(found < 0.0 && (shear(-found) - 1.2).abs() <= MEDIAN_TOLERANCE);
}

#[test]
fn unreachable_stretch_is_an_error() {
    let error = find_drive(1.0, 1.5, |_| Ok(1.1)).unwrap_err();
    assert!(matches!(error, EvaluationError::MedianStretchNotReached { num_solves: MAX_DRIVE_SOLVES, .. }));
}
