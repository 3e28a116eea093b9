//! The whole search on a small study: the same bits at any number of threads and after a stop; what it confirms can be
//! made.

use super::*;
use crate::specimen::Specimen;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// One material at its central values, no hole or one on the bar's middle plane; a quarter of the bar is meshed.
fn small_study() -> Study {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
    let text = std::fs::read_to_string(folder.join("uniaxial-bar.json")).expect("the study is there");
    let mut study = Study::from_json(&text, &folder).expect("the study is valid");
    study.vary.hole_count = CountRange { min: 0, max: 1 };
    study.materials[0].relative_sd = 0.0;
    study.budget = Budget { explore: 6, refine: 1, iterations: 3, propose: 12, confirm: 2, variants_in_search: true };
    study
}

fn quiet(_: &Progress) {}

fn result_of(study: &Study, checkpoint: &Checkpoint, threads: usize) -> String {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    let found = pool.install(|| search(study, checkpoint, &quiet, &|| false)).expect("the search succeeds");
    serde_json::to_string(&DesignResult::new(study, &found).expect("something was confirmed")).expect("it serialises")
}

/// One run by one thread, one by two, and one that is stopped after every few evaluations until it gets through: equal
/// results to the last digit that is written (`serde_json` writes digits that read back to the same bits).
#[test]
fn threads_and_stops_do_not_change_the_result() {
    let study = small_study();
    let alone = result_of(&study, &Checkpoint::in_memory(), 1);
    assert_eq!(alone, result_of(&study, &Checkpoint::in_memory(), 2));

    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("checkpoint.jsonl");
    let mut stops = 0;
    loop {
        let checkpoint = Checkpoint::open(&path, &study_hash(&study)).expect("it opens");
        let before = checkpoint.num_resumed();
        let finished = AtomicUsize::new(0);
        let progress = |_: &Progress| {
            finished.fetch_add(1, Ordering::Relaxed);
        };
        // Progress is also reported for evaluations taken from the file: they do not count as new.
        let is_stopped = || finished.load(Ordering::Relaxed) > before + 4;
        match search(&study, &checkpoint, &progress, &is_stopped) {
            Ok(found) => {
                let resumed = DesignResult::new(&study, &found).expect("something was confirmed");
                assert_eq!(alone, serde_json::to_string(&resumed).expect("it serialises"));
                break;
            }
            Err(SearchError::Stopped { .. }) => stops += 1,
            Err(other) => panic!("{other}"),
        }
        drop(checkpoint);
        let after = Checkpoint::open(&path, &study_hash(&study)).expect("it opens again");
        assert!(after.num_resumed() > before, "a stopped run keeps what it finished");
        // As after a crash: half a line at the end.
        use std::io::Write;
        let mut file = std::fs::OpenOptions::new().append(true).open(&path).expect("it is there");
        file.write_all(b"{\"key\":\"0123").expect("it can be written");
        assert!(stops < 50, "the search does not come to an end");
    }
    assert!(stops > 0, "the run was never stopped");
}

/// Every design that the search proposes keeps every geometry limit.
#[test]
fn proposals_keep_the_limits() {
    let study = small_study();
    let found = search(&study, &Checkpoint::in_memory(), &quiet, &|| false).expect("the search succeeds");
    for candidate in &found.candidates {
        assert!(is_makeable(&candidate.specimen, &study.limits, study.scan.voxel_mm), "{:?}", candidate.specimen);
    }
    assert!(found.ranked[0].is_within_limits);
    assert!(found.ranked[0].objective.is_finite());
}

/// The base is a design like any other: its structure's vector gives it back, symmetric studies included.
#[test]
fn the_base_has_a_vector() {
    let study = small_study();
    let base = base_at_drive(&study);
    let back: Vec<Specimen> = subspaces(&study)
        .iter()
        .filter_map(|space| Some(space.specimen(&space.vector_of(&base, base.drive_mm[0])?)))
        .collect();
    assert_eq!(back.len(), 1);
    assert_eq!(back[0].holes, base.holes);
    assert_eq!(back[0].drive_mm, base.drive_mm);

    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
    let text = std::fs::read_to_string(folder.join("two-hole-shear.json")).expect("the study is there");
    for symmetry in [
        crate::specimen::Symmetry::None,
        crate::specimen::Symmetry::MirrorX,
        crate::specimen::Symmetry::MirrorZ,
        crate::specimen::Symmetry::MirrorXAndZ,
    ] {
        let mut study = Study::from_json(&text, &folder).expect("the study is valid");
        study.limits.symmetry = symmetry;
        let base = base_at_drive(&study);
        let back: Vec<Specimen> = subspaces(&study)
            .iter()
            .filter_map(|space| Some(space.specimen(&space.vector_of(&base, base.drive_mm[0])?)))
            .collect();
        assert_eq!(back.len(), 1, "{symmetry:?}");
        for hole in &base.holes {
            // Scaling to [0, 1] and back rounds.
            let is_same = |other: &crate::specimen::Hole| {
                (0..2).all(|c| (hole.center_mm[c] - other.center_mm[c]).abs() < 1e-9)
                    && (hole.diameter_mm - other.diameter_mm).abs() < 1e-9
            };
            assert!(back[0].holes.iter().any(is_same), "{symmetry:?}: {:?}", back[0].holes);
        }
    }
}

/// A number in [low, high) from a fixed stream: a linear congruence with the constants of Knuth's MMIX.
struct Draw(u64);

impl Draw {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        self.between(0.0, n as f64) as usize
    }
}

/// A study with random limits and freedoms.
fn random_study(draw: &mut Draw) -> Study {
    use crate::specimen::{DiameterRange, HoleAxis, Symmetry, TestKind};
    let mut study = small_study();
    let limits = &mut study.limits;
    limits.min_ligament_hole_hole_mm = draw.between(0.5, 4.0);
    limits.min_ligament_hole_edge_mm = draw.between(0.5, 3.0);
    (limits.diameter_mm, limits.punches_mm) = if draw.below(2) == 0 {
        let min = draw.between(0.8, 3.0);
        (Some(DiameterRange { min, max: min + draw.between(0.0, 6.0) }), None)
    } else {
        (None, Some((0..=draw.below(4)).map(|_| draw.between(0.8, 7.0)).collect()))
    };
    limits.min_voxels_across_ligament = (draw.below(2) == 0).then(|| draw.between(0.5, 5.0));
    limits.max_force_n = Some(draw.between(1.0, 6.0));
    limits.max_drive_mm = Some(draw.between(2.0, 12.0));
    limits.max_local_stretch = Some(draw.between(1.3, 3.0));
    limits.max_holes = Some(draw.below(4));
    limits.symmetry =
        [Symmetry::None, Symmetry::MirrorX, Symmetry::MirrorZ, Symmetry::MirrorXAndZ, Symmetry::Point][draw.below(5)];
    study.vary.axes = Some(vec![[HoleAxis::Thickness, HoleAxis::Width][draw.below(2)]]);
    study.vary.tests = vec![[TestKind::Uniaxial, TestKind::DoubleLapShear][draw.below(2)]];
    study.vary.hole_count = CountRange { min: 0, max: 4 };
    study.vary.drive_mm = Range { min: 1.0, max: draw.between(2.0, 20.0) };
    study.vary.width_mm = (draw.below(2) == 0).then_some(Range { min: 8.0, max: 14.0 });
    study.vary.length_mm = (draw.below(2) == 0).then_some(Range { min: 30.0, max: 45.0 });
    study.seed = draw.below(1000) as u64;
    study
}

/// Whatever a study's limits are, no design that is sampled breaks one that geometry alone decides, and no drive lies
/// above the actuator's.
#[test]
fn random_studies_propose_only_what_can_be_made() {
    let mut draw = Draw(7);
    let mut num_designs = 0;
    for _ in 0..200 {
        let study = random_study(&mut draw);
        for (stream, space) in subspaces(&study).iter().enumerate() {
            assert!(space.structure.num_holes() <= study.limits.max_holes.unwrap_or(usize::MAX));
            for vector in sample(space, &study.limits, study.scan.voxel_mm, 4, study.seed, stream as u64) {
                let specimen = space.specimen(&vector);
                let margins = study.limits.check_geometry(&specimen, study.scan.voxel_mm);
                assert!(margins.iter().all(|m| m.is_satisfied), "{margins:?} {specimen:?}");
                assert!(specimen.validate().is_ok(), "{specimen:?}");
                // Scaling to [0, 1] and back rounds.
                let drive = specimen.drive_mm[0];
                assert!(drive <= study.limits.max_drive_mm.unwrap_or(f64::INFINITY) * (1.0 + 1e-12), "{drive}");
                num_designs += 1;
            }
        }
    }
    assert!(num_designs > 500, "{num_designs} designs are no test");
}

/// Whole searches on random studies: what is returned as the best keeps every limit, confirmed; or the study is refused
/// as one without a solution.
#[test]
fn random_studies_never_return_what_breaks_a_limit() {
    let mut draw = Draw(11);
    let mut num_found = 0;
    for _ in 0..5 {
        let mut study = random_study(&mut draw);
        study.limits.max_holes = Some(draw.below(2));
        study.vary.tests = vec![crate::specimen::TestKind::Uniaxial];
        study.budget =
            Budget { explore: 4, refine: 1, iterations: 3, propose: 12, confirm: 2, variants_in_search: true };
        match search(&study, &Checkpoint::in_memory(), &quiet, &|| false) {
            Ok(found) => {
                num_found += 1;
                for confirmed in found.ranked.iter().filter(|c| c.is_within_limits) {
                    let specimen = &confirmed.specimen;
                    let mut margins = study.limits.check_geometry(specimen, study.scan.voxel_mm);
                    let of =
                        |f: fn(&MaterialEvaluation) -> f64| confirmed.by_material.iter().map(f).fold(0.0, f64::max);
                    let (force, stretch) = (of(|m| m.force_n), of(|m| m.tearing_stretch));
                    margins.extend(study.limits.check_response(specimen.drive_mm[0], force, stretch));
                    assert!(margins.iter().all(|m| m.is_satisfied), "{margins:?} {specimen:?}");
                }
                assert!(found.ranked[0].is_within_limits);
            }
            Err(SearchError::NothingFeasible { .. }) => {}
            Err(other) => panic!("{other}"),
        }
    }
    assert!(num_found > 0, "no study had a solution");
}
