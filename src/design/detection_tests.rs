use super::*;
use crate::design::aim::{Objective, ObjectiveKind};
use crate::design::confirm::estimate;
use crate::design::fidelity::Fidelity;
use crate::sensitivity::ScanSettings;
use crate::specimen::HoleAxis;
use std::path::Path;

fn published() -> Study {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
    let text = std::fs::read_to_string(folder.join("two-hole-shear.json")).expect("the study is there");
    Study::from_json(&text, &folder).expect("the study is valid")
}

fn row(cause: &str, description: &str, size: Option<f64>, limited_by: DetectionLimit) -> DetectableSize {
    DetectableSize {
        cause: cause.into(),
        description: description.into(),
        parameter: String::new(),
        size,
        largest: 2.0,
        limited_by,
        rival: None,
    }
}

#[test]
fn the_hardest_count_unless_others_are_named() {
    let mut study = published();
    let names = |study: &Study| -> Vec<String> {
        counted(study).unwrap().iter().map(|c| format!("{} {}", c.cause, c.place)).collect()
    };
    // Three axes, a hole's diameter and place, a shift and a turn: whatever the direction of the holes.
    assert_eq!(study.axes(), [HoleAxis::Thickness, HoleAxis::Width]);
    assert_eq!(names(&study).len(), 3 + 3 + 6);
    study.objective.causes = vec!["hole/diameter_error_mm".into(), "tilt".into(), "hole".into()];
    let expected = ["hole 0", "tilt 0", "tilt 1", "tilt 2", "hole 1", "hole 2"];
    assert_eq!(names(&study), expected);
    for unknown in ["debond", "gain/diameter_error_mm", ""] {
        study.objective.causes = vec![unknown.into()];
        assert_eq!(counted(&study).unwrap_err(), unknown);
    }
}

#[test]
fn sizes_are_compared_where_both_have_them() {
    use DetectionLimit::{Drives, Noise};
    let counted: Vec<Counted> = [("gain", 1), ("hole", 0), ("slack", 0)]
        .map(|(cause, place)| Counted { cause: cause.into(), place, parameter: String::new() })
        .into();
    let of = |rows: &[DetectableSize]| log_sizes(&counted, rows);
    let gains = [row("gain", "a factor", Some(0.5), Noise), row("gain", "a factor", Some(0.25), Noise)];
    let holes = [row("hole", "hole 0", Some(0.1), Noise), row("hole", "hole 1", Some(0.2), Noise)];
    let base = of(&[&gains[..], &holes[..], &[row("slack", "lags", None, Drives)]].concat());
    // The second axis, the worst hole, and nothing of what one drive does not tell.
    assert_eq!(base, [Some(0.25f64.ln()), Some(0.2f64.ln()), None]);
    let solid = of(&gains);
    assert_eq!(log_gains(&solid, &base), [0.0], "a solid block has no hole that could be wrong");
    assert_eq!(log_gains(&[None], &[Some(0.5)]), [0.0], "nothing else counts: as good as the base");
    let worse = of(&[&gains[..], &[row("hole", "hole 0", None, Noise)]].concat());
    // What is never named counts as the largest that it may be, 2.
    assert_eq!(log_gains(&worse, &base), [0.0, 0.2f64.ln() - 2f64.ln()]);
}

/// A design is solved, scanned and diagnosed in advance: the base's gains over itself are none, a solid block has no
/// hole to be wrong, and more noise hides more.
#[test]
fn designs_are_judged_by_what_would_be_found() {
    let mut study = published();
    study.materials.truncate(1);
    study.materials[0].relative_sd = 0.0;
    study.objective = Objective { kind: ObjectiveKind::Detect, ..Objective::default() };
    // Few voxels, for the time.
    study.scan.voxel_mm = [2.0, 0.8, 2.0];
    assert_eq!(study.validate().map_err(|e| e.to_string()), Ok(()));
    let holed = Specimen { drive_mm: vec![5.0], ..study.base.clone() };
    let solid = Specimen { holes: Vec::new(), ..holed.clone() };
    let of = |study: &Study, specimen: &Specimen| {
        estimate(study, specimen, Fidelity::Coarse, &|| false).unwrap().responses[0].log_detectable.clone()
    };
    let base = of(&study, &holed);
    assert!(base.len() == 12 && base.iter().all(Option::is_some));
    let without = of(&study, &solid);
    let counted = counted(&study).unwrap();
    assert!(without.iter().zip(&counted).all(|(size, c)| size.is_none() == (c.cause == "hole")));
    assert_eq!(log_gains(&base, &base), [0.0; 12]);
    assert_eq!(log_gains(&without, &base).len(), 9);
    let noisy = Study { scan: ScanSettings { noise_sd_mm: [0.2; 3], ..study.scan }, ..study };
    // Where the allowance limits, the weights by which the material follows still change with the noise.
    assert!(log_gains(&of(&noisy, &holed), &base).iter().all(|gain| *gain < 0.05));
}
