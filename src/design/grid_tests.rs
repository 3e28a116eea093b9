//! The search against brute force: a grid over small spaces finds nothing more than 1 % better.

use super::*;
use rayon::prelude::*;
use std::path::Path;

/// The published specimen with two equal holes, mirrored in x and z: place and diameter vary, the drive does not.
fn two_variables(kind: ObjectiveKind) -> Study {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
    let text = std::fs::read_to_string(folder.join("two-hole-shear.json")).expect("the study is there");
    let mut study = Study::from_json(&text, &folder).expect("the study is valid");
    study.materials.truncate(1);
    study.materials[0].relative_sd = 0.0;
    study.limits.symmetry = crate::specimen::Symmetry::MirrorXAndZ;
    study.limits.max_local_stretch = Some(3.5);
    study.vary.hole_count = CountRange { min: 2, max: 2 };
    study.vary.axes = Some(vec![crate::specimen::HoleAxis::Thickness]);
    study.vary.drive_mm = Range { min: 5.0, max: 5.0 };
    (study.vary.length_mm, study.vary.thickness_mm, study.vary.width_mm) = (None, None, None);
    study.objective = Objective { kind, guard_promised_sd: Guard::None, ..Objective::default() };
    study.budget =
        Budget { explore: 16, refine: 2, iterations: 10, propose: 0, confirm: 1, scans: 1, variants_in_search: true };
    study
}

/// Points per variable of the grid.
const POINTS: usize = 5;

#[test]
fn a_grid_finds_nothing_better() {
    for kind in [ObjectiveKind::DOptimal, ObjectiveKind::IntegratedSensitivity] {
        let study = two_variables(kind);
        let found = search(&study, &Checkpoint::in_memory(), &|_| {}, &|| false).expect("the search succeeds");
        let within = found.candidates.iter().filter(|c| c.is_within_limits);
        let searched = within.map(|c| c.objective).fold(0.0, f64::max);

        let evaluator = Evaluator::new(&study);
        let base = evaluator.evaluate(&base_at_drive(&study), None, &|| false).expect("the base evaluates");
        let reference = Reference::new(&study, evaluator.samples(), &base.responses);
        let mut designs = Vec::new();
        for space in &subspaces(&study) {
            assert_eq!(space.variables.len(), 3);
            for i in 0..POINTS {
                for j in 0..POINTS {
                    let vector = [i as f64 / (POINTS - 1) as f64, j as f64 / (POINTS - 1) as f64, 1.0];
                    let specimen = space.specimen(&vector);
                    if is_makeable(&specimen, &study.limits, study.scan.voxel_mm) {
                        designs.push(specimen);
                    }
                }
            }
        }
        let values: Vec<f64> = designs
            .par_iter()
            .map(|specimen| {
                let Ok(evaluated) = evaluator.evaluate(specimen, None, &|| false) else { return 0.0 };
                let judged = reference.judge(&evaluated);
                if judged.margins.iter().all(|m| *m >= 0.0) { reference.objective(&judged).exp() } else { 0.0 }
            })
            .collect();
        let gridded = values.iter().copied().fold(0.0, f64::max);
        let best = values.iter().position(|v| v.to_bits() == gridded.to_bits()).map(|i| &designs[i].holes);
        println!("{kind:?}: search {searched:.4}, grid of {} designs {gridded:.4} at {best:?}", designs.len());
        assert!(designs.len() > POINTS, "the grid is empty");
        assert!(gridded <= 1.01 * searched, "{kind:?}: grid {gridded} at {best:?}, search {searched}");
    }
}
