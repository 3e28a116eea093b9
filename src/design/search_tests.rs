//! The whole search on a small study: the same bits at any number of threads and after a stop; what it confirms can be made.

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
    study.budget = Budget { explore: 6, refine: 1, iterations: 3, confirm: 2 };
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
