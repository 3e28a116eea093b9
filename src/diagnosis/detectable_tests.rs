use super::*;
use crate::calibration::Observed as Seen;
use crate::diagnosis::diagnose::diagnose;
use crate::diagnosis::supposed::{Supposed, scene_of};
use crate::diagnosis::test_recordings::{FINER_FACTOR, FORCE_SD_N, NOISE_MM, material, options, recorded};
use crate::sensitivity::ScanSettings;
use crate::specimen::Specimen;

/// The scan of the small recordings.
fn scan() -> ScanSettings {
    ScanSettings {
        voxel_mm: [2.5, 0.8, 2.5],
        noise_sd_mm: [NOISE_MM; 3],
        force_sd_n: FORCE_SD_N,
        ..ScanSettings::default()
    }
}

fn solid() -> Specimen {
    Specimen::from_json(include_str!("../../geometries/solid-shear.json")).unwrap()
}

/// What would be found in the small recordings.
fn found_in(planned: &PlannedScan, allowance_mm: f64) -> Vec<Detectable> {
    let options = DiagnosisOptions { allowance_mm: Some(allowance_mm), ..options() };
    detectable(planned, &material(), &options, &|| false).unwrap()
}

fn planned<'a>(specimen: &'a Specimen, scan: &'a ScanSettings, drives_mm: &'a [f64]) -> PlannedScan<'a> {
    // About what this block takes: 2 N for every millimetre.
    PlannedScan { specimen, scan, drives_mm, forces_n: &[4.0, 8.0], time_shares: &[] }
}

fn of<'d>(all: &'d [Detectable], cause: &str, parameter: &str) -> &'d Detectable {
    all.iter().find(|d| d.cause.as_str() == cause && d.parameter == parameter).unwrap()
}

/// Hides a cause of half the size and of one and a half times that in the small recordings: the diagnosis names nothing
/// of that name in the one and the cause in the other. One cause each of the plates, of the image and of the load;
/// where a rival is what limits it, the smaller one may be named, too: a gain of half the difference is above the
/// rival's in some recordings.
#[test]
fn what_is_promised_is_found() {
    let (specimen, scan) = (solid(), scan());
    let sizes = found_in(&planned(&specimen, &scan, &[2.0, 4.0]), options().allowance_mm.unwrap());
    let driven = Specimen { drive_mm: vec![2.0, 4.0], ..specimen.clone() };
    let causes = Registry::standard().tested(&driven);
    for (name, parameter) in [
        ("tilt", "degrees_at_full_drive_about_y"),
        ("gain", "relative_gain_error_x"),
        ("gain", "relative_gain_error_y"),
        ("compliance", "mm_per_n"),
    ] {
        let promised = of(&sizes, name, parameter);
        let cause = causes.iter().find(|c| c.name().as_str() == name && c.variant() == promised.variant).unwrap();
        for (part, is_expected) in [(0.5, false), (1.5, true)] {
            let mut values = cause.start();
            values[promised.place] += part * promised.size;
            let scene = scene_of(&[Supposed { cause: cause.clone(), values }]);
            let recording = recorded(&material(), &scene, FINER_FACTOR);
            // With the material's number of terms known, as the sizes take it.
            let options = DiagnosisOptions { prior: Some(material()), ..options() };
            let diagnosed = diagnose(&recording, &options, &|_| {}, &|| false).unwrap();
            let names: Vec<&str> = diagnosed.causes.iter().map(|c| c.name.as_str()).collect();
            let may_be_named = promised.limited_by == DetectionLimit::Rival;
            let is_named = names.contains(&name);
            assert!(is_named == is_expected || is_named && may_be_named, "{part} of {promised:?}: {names:?}");
        }
    }
}

/// With hardly any allowance the noise alone limits a gain error across the drive: in a quarter of the time it must be
/// twice as large. An allowance that hides everything is met in proportion to itself.
#[test]
fn noise_and_allowance_limit_in_proportion() {
    let (specimen, scan) = (solid(), scan());
    let whole = planned(&specimen, &scan, &[2.0, 4.0]);
    let size = |planned: &PlannedScan, allowance_mm: f64, limit: DetectionLimit| {
        let all = found_in(planned, allowance_mm);
        let found = of(&all, "gain", "relative_gain_error_y");
        assert_eq!(found.limited_by, limit, "{found:?}");
        found.size
    };
    let quarter = PlannedScan { time_shares: &[0.25, 0.25], ..whole };
    let ratio = size(&quarter, 1e-5, DetectionLimit::Noise) / size(&whole, 1e-5, DetectionLimit::Noise);
    // The forces' weight and what is known of κ stay as they are: some percent of what follows.
    assert!((ratio / 2.0 - 1.0).abs() < 0.05, "{ratio}");
    let ratio = size(&whole, 0.04, DetectionLimit::Allowance) / size(&whole, 0.02, DetectionLimit::Allowance);
    // The allowance is in the weights by which the material follows, too.
    assert!((ratio / 2.0 - 1.0).abs() < 0.1, "{ratio}");
}

/// At one drive a plate out of place looks like one that moves out of line: it is not looked for.
#[test]
fn causes_alike_at_every_drive_need_two() {
    let (specimen, scan) = (solid(), scan());
    let one = found_in(&planned(&specimen, &scan, &[4.0]), 0.005);
    let two = found_in(&planned(&specimen, &scan, &[2.0, 4.0]), 0.005);
    for (cause, parameter) in [("mount", "y_mm"), ("slack", "slack_mm")] {
        let row = of(&one, cause, parameter).row();
        assert_eq!((row.size, row.limited_by), (None, DetectionLimit::Drives));
        assert!(of(&two, cause, parameter).row().size.is_some());
    }
    // A row for every parameter that a single suspect has, and no other.
    assert!(one.iter().all(|d| d.cause.as_str() != "hole"));
    assert_eq!(one.iter().filter(|d| d.cause.as_str() == "gain").count(), 3);
    assert_eq!(one.len(), two.len());
}

/// The scan that is planned is the recording that would be made: the same voxels count.
#[test]
fn the_planned_scan_has_the_voxels_of_the_recording() {
    let (specimen, scan) = (solid(), scan());
    let planned = planned(&specimen, &scan, &[2.0, 4.0]);
    let seen = Seen::new(&recorded(&material(), &Scene::default(), FINER_FACTOR), FORCE_SD_N).unwrap();
    assert_eq!(planned.observed().unwrap().mask, seen.mask);
}

#[test]
fn a_rival_is_left_behind_by_what_it_cannot_explain() {
    let of = |num_parameters: f64, weight: f64| Contender { weight, num_parameters, cost: 10.0 * num_parameters };
    let ahead = |own, rival, share| root_noncentrality(own, rival, Alike { share, overlap: share });
    // One that explains everything for no more parameters is never told apart.
    assert_eq!(ahead(of(1.0, 1.0), of(1.0, 1.0), 1.0), f64::INFINITY);
    // For so many more that noise does not pay for them it is no rival.
    assert_eq!(ahead(of(1.0, 1.0), of(6.0, 1.0), 1.0), 0.0);
    // One that explains nothing and costs far more is never in the way.
    assert_eq!(ahead(of(1.0, 1.0), of(6.0, 1.0), 0.0), 0.0);
    // The more of the effect it explains, and the fewer parameters it has, the larger the effect must be.
    assert!(ahead(of(6.0, 1.0), of(1.0, 1.0), 0.9) > ahead(of(6.0, 1.0), of(1.0, 1.0), 0.5));
    assert!(ahead(of(6.0, 1.0), of(1.0, 1.0), 0.5) > ahead(of(6.0, 1.0), of(3.0, 1.0), 0.5));
    // A cause that counts for a third stays behind one that explains half of its effect.
    assert_eq!(ahead(of(6.0, 1.0 / 3.0), of(1.0, 1.0), 0.5), f64::INFINITY);
    // Without chance in it: (1 − ρ) λ = the cost of five parameters more, less the five that they fit to noise.
    let root = ahead(of(6.0, 1.0), of(1.0, 1.0), 0.0);
    assert!(root.powi(2) > 45.0 && root.powi(2) < 45.0 + 2.0 * 1.2816 * 2.0 * 60f64.sqrt(), "{}", root.powi(2));
}
