//! The whole search on a small study: the same bits at any number of threads and after a stop; what it confirms can be
//! made.

use super::evaluation_failure::EvaluationFailure;
use super::evaluator::Evaluator;
use super::fidelity::Fidelity;
use super::objective::Judged;
use super::search::base_at_drive;
use super::search_run::{Judge, SearchRun};
use super::state::State;
use super::*;
use crate::specimen::{Specimen, TestResponse};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// One material at its central values, no hole or one on the bar's middle plane; a quarter of the bar is meshed.
fn small_study() -> Study {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
    let text = std::fs::read_to_string(folder.join("uniaxial-bar.json")).expect("the study is there");
    let mut study = Study::from_json(&text, &folder).expect("the study is valid");
    study.vary.hole_count = CountRange { min: 0, max: 1 };
    study.materials[0].relative_sd = 0.0;
    study.budget =
        Budget { explore: 6, refine: 1, iterations: 3, propose: 12, confirm: 2, scans: 1, variants_in_search: true };
    study
}

/// The same of a bar a little over half as long, for whole searches.
fn short_study() -> Study {
    let mut study = small_study();
    study.base.block.length_mm = 24.0;
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
    let mut study = short_study();
    study.budget = Budget { explore: 4, propose: 6, confirm: 1, ..study.budget };
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

/// Every design that the search proposes keeps every geometry limit; what it tells of its progress grows.
#[test]
fn proposals_keep_the_limits() {
    let study = short_study();
    let told = std::sync::Mutex::new(Vec::new());
    let listener = |p: &Progress| told.lock().expect("no thread panicked").push((p.stage, p.done, p.total));
    // One thread tells it in order.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    let found =
        pool.install(|| search(&study, &Checkpoint::in_memory(), &listener, &|| false)).expect("the search succeeds");
    for pair in told.into_inner().expect("no thread panicked").windows(2) {
        let [(stage, before, of), (next, after, of_next)] = [pair[0], pair[1]];
        assert!(stage != next || before < after && of == of_next || before == of, "{pair:?}");
        assert!(after <= of_next, "{pair:?}");
    }
    for candidate in &found.candidates {
        assert!(is_makeable(&candidate.specimen, &study.limits, study.scan.voxel_mm), "{:?}", candidate.specimen);
    }
    assert!(found.ranked[0].is_within_limits);
    assert!(found.ranked[0].objective.is_finite());
    // A design is told by how much it gains wherever the grid lies: here by about as much.
    let anywhere = found.gain_anywhere.expect("the grid is centred");
    let recommended = &found.ranked[found.simplest];
    for (gain, confirmed) in [(anywhere.best, &found.ranked[0]), (anywhere.recommended, recommended)] {
        assert!((gain / confirmed.objective - 1.0).abs() < 0.3, "{gain} {}", confirmed.objective);
    }
    // It is told how exactly the recommended bar is to be made, and what it loses otherwise.
    let whole = ["length", "thickness", "width"];
    assert_eq!(found.tolerances.iter().map(|t| t.name.as_str()).take(3).collect::<Vec<_>>(), whole);
    for t in &found.tolerances {
        let [smaller, larger] =
            [t.relative_change_smaller, t.relative_change_larger].map(|c| c.expect("bars have an equilibrium"));
        let within = t.tolerance_mm.expect("both sides are known");
        assert!(t.step_mm == 0.1 && within > 0.0 && within <= 0.2, "{t:?}");
        assert_eq!(within < 0.1, smaller.min(larger) < -0.01, "{t:?}");
        let changed = [-0.1, 0.1].map(|by_mm| t.dimension.changed(&recommended.specimen, by_mm));
        assert!(changed.iter().all(|s| s.validate().is_ok() && *s != recommended.specimen));
    }
    let result = DesignResult::new(&study, &found).expect("something was confirmed");
    let thickness = &result.tolerances[1];
    assert_eq!(result.drawing_tolerances()[0].block_mm[1], thickness.tolerance_mm);
    assert!(result.recommendation.dimensions.contains("thickness"), "{}", result.recommendation.dimensions);
    let said = &result.findings;
    assert!(said.iter().any(|s| s.contains(&format!("it is {:.3}", anywhere.best))), "{said:?}");
    let advice = &result.recommendation.make;
    let is_less = anywhere.recommended < 0.98 * recommended.objective;
    let says = advice
        .contains(&format!("on average over all places where it may lie the factor is {:.3}", anywhere.recommended));
    assert_eq!(says, is_less && !advice.starts_with("Keep"), "{advice} {anywhere:?}");
}

/// Structures race by their coarse designs; those of which nothing could be solved finely come last, and the next
/// design to try of them lies elsewhere.
#[test]
fn structures_without_a_fine_equilibrium_come_last() {
    let study = small_study();
    let checkpoint = Checkpoint::in_memory();
    let run = SearchRun {
        study: &study,
        evaluator: Evaluator::new(&study),
        checkpoint: &checkpoint,
        is_cancelled: &|| false,
        progress: &quiet,
    };
    let (mut state, base) = (State::default(), base_at_drive(&study));
    let judge = |fidelity: Fidelity, state: &State| Judge {
        fidelity,
        reference: run.in_integrals(&base, state).expect("the base has an equilibrium"),
    };
    let (coarse, fine) = (judge(Fidelity::Coarse, &state), judge(Fidelity::Fine, &state));
    let judged = coarse.reference.of_base();
    let gaining = |gain: f64| Judged { gains: judged.gains.iter().map(|g| g + gain).collect(), ..judged.clone() };
    let add = |state: &mut State, space: usize, at: f64, judge: &Judge, gain: f64| {
        state.add((space, &[at]), base.clone(), judge, &gaining(gain), "explore");
    };
    add(&mut state, 0, 0.5, &coarse, 0.0);
    add(&mut state, 1, 0.5, &coarse, 0.2);
    assert_eq!(state.best_structures(9), [1, 0]);
    assert_eq!(state.to_check(1, 0.25), Some(&(1, vec![0.5])));
    state.fail(&base, Some((1, &[0.5], Fidelity::Fine)), &EvaluationFailure::Cancelled);
    assert_eq!(state.best_structures(9), [0, 1]);
    assert_eq!(state.to_check(1, 0.25), None);
    add(&mut state, 1, 0.9, &coarse, 0.1);
    assert_eq!(state.to_check(1, 0.25), Some(&(1, vec![0.9])));
    // What is found on the fine mesh does not count against coarse designs.
    add(&mut state, 1, 0.9, &fine, -0.3);
    assert_eq!((state.best_structures(9), state.to_check(1, 0.25)), (vec![1, 0], None));
}

/// The solid block is improved on the fine mesh for the comparison, in the race of all structures or by proposals of
/// its own, which are of no other structure.
#[test]
fn the_solid_block_is_improved_too() {
    let mut study = short_study();
    let length_mm = study.base.block.length_mm;
    study.vary.length_mm = Some(Range { min: 0.7 * length_mm, max: 1.2 * length_mm });
    // Enough samples of the solid block to learn from.
    study.budget.explore = 16;
    let found = search(&study, &Checkpoint::in_memory(), &quiet, &|| false).expect("the search succeeds");
    let solid: Vec<&str> =
        found.candidates.iter().filter(|c| c.specimen.holes.is_empty()).map(|c| &c.stage[..]).collect();
    assert!(solid.iter().any(|stage| ["propose", "solid"].contains(stage)), "{solid:?} {:?}", found.failures);
    assert!(found.candidates.iter().all(|c| c.stage != "solid" || c.specimen.holes.is_empty()));
    // At last the best design is tried with a row of voxels more or less.
    let apart_by_a_row = |a: &Candidate, b: &Candidate| {
        let apart_mm = (a.specimen.block.length_mm - b.specimen.block.length_mm).abs();
        (apart_mm - study.scan.voxel_mm[0]).abs() < 1e-9 && a.specimen.holes == b.specimen.holes
    };
    let last = found.candidates.iter().position(|c| c.stage == "rows").expect("rows are tried");
    let (before, rows) = found.candidates.split_at(last);
    assert!(rows.iter().all(|c| c.stage == "rows") && before.iter().any(|c| apart_by_a_row(c, &rows[0])));
}

/// Two blocks that differ in thickness alone, both scanned: the second follows the first, limits and rounding hold for
/// both, and the recommendation speaks of both.
#[test]
fn unlike_samples_are_searched() {
    let sample = crate::specimen::Sample { block: crate::specimen::Block::new(12.0, 4.0, 9.0), holes: Vec::new() };
    let mut study = small_study();
    study.base = Specimen {
        test: crate::specimen::TestKind::DoubleLapShear,
        block: sample.block,
        holes: Vec::new(),
        drive_mm: vec![2.0],
        samples_in_parallel: 1,
        other_samples: vec![sample],
        ..study.base
    };
    study.vary.tests = Vec::new();
    study.vary.axes = Some(vec![crate::specimen::HoleAxis::Thickness]);
    study.vary.drive_mm = Range { min: 1.0, max: 2.0 };
    study.vary.thickness_mm = Some(Range { min: 3.0, max: 5.0 });
    let thickness_mm = Some(Range { min: 3.0, max: 6.0 });
    study.vary.other_samples = vec![VarySample { is_like_first: true, thickness_mm, ..VarySample::default() }];
    study.scan.voxel_mm = [1.0, 0.5, 1.0];
    study.protocol.blocks_scanned = 2;
    study.budget =
        Budget { explore: 4, refine: 1, iterations: 2, propose: 4, confirm: 1, scans: 1, variants_in_search: false };
    study.validate().expect("a study");
    let found = search(&study, &Checkpoint::in_memory(), &quiet, &|| false).expect("the search succeeds");
    let result = DesignResult::new(&study, &found).expect("something was confirmed");
    for candidate in &found.candidates {
        let (first, other) = (&candidate.specimen, &candidate.specimen.other_samples[0]);
        assert_eq!((&first.holes, first.block.length_mm), (&other.holes, other.block.length_mm));
        assert!((3.0..=6.0).contains(&other.block.thickness_mm));
    }
    let best = &result.best;
    assert_eq!(best.evaluation.blocks_scanned, 2);
    assert_eq!(best.evaluation.steps[0].force_by_kind_n.len(), 2);
    assert!(best.objective.is_finite() && best.is_within_limits);
    // In steps of a tenth of a millimetre.
    let thickness = 10.0 * best.specimen.other_samples[0].block.thickness_mm;
    assert!((thickness - thickness.round()).abs() < 1e-9, "{thickness}");
    let said = result.recommendation.make;
    assert!(said.contains("sample 2") && said.contains("2 blocks together"), "{said}");
}

/// A further scan before the last one: its drive is searched, and the time of one scan is shared out to the two.
#[test]
fn an_earlier_scan_is_searched() {
    let mut study = short_study();
    study.vary.hole_count = CountRange { min: 1, max: 1 };
    study.vary.earlier_scan_mm = Some(Range { min: 2.0, max: 10.0 });
    assert!(matches!(study.validate(), Err(StudyError::EarlierScanNeedsVoxels)), "gradients are of one scan");
    study.budget = Budget { explore: 4, refine: 0, propose: 4, confirm: 1, ..study.budget };
    study.validate().expect("a study");
    let found = search(&study, &Checkpoint::in_memory(), &quiet, &|| false).expect("the search succeeds");
    let result = DesignResult::new(&study, &found).expect("something was confirmed");
    for candidate in &found.candidates {
        assert!(matches!(candidate.specimen.drive_mm[..], [earlier, last] if 2.0 <= earlier && earlier < last));
    }
    let scanned = result.ranked.iter().filter(|e| e.specimen.drive_mm.len() == 2);
    for entry in scanned {
        let shares = &entry.evaluation.scan_share;
        assert!(shares.len() == 2 && (shares.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{shares:?}");
        // Each drive alone tells less than both.
        let both = entry.evaluation.promised_sd[2].value.expect("it is determined");
        for step in &entry.evaluation.steps {
            assert!(step.promised_sd[2].value.is_none_or(|alone| alone > both));
        }
    }
    assert!(result.base.evaluation.scan_share.is_empty());
}

/// Voxels and encoding that are better for the best design are found, rounded, in the ranges, and the same at any
/// number of threads; all designs are then confirmed in that scan, and the base is not.
#[test]
fn a_scan_is_chosen() {
    let mut study = short_study();
    study.vary.hole_count = CountRange { min: 1, max: 1 };
    study.scan.mm_per_radian = Some([0.3; 3]);
    let voxel_mm = EdgeRange { min: study.scan.voxel_mm.map(|e| 0.8 * e), max: study.scan.voxel_mm.map(|e| 2.0 * e) };
    study.vary.scan = Some(VaryScan { voxel_mm: Some(voxel_mm), mm_per_radian: Some(Range { min: 0.1, max: 0.6 }) });
    assert!(matches!(study.validate(), Err(StudyError::Scan(_))), "gradients take the noise to be even");
    study.budget = Budget { explore: 3, refine: 0, propose: 2, confirm: 2, scans: 19, ..study.budget };
    study.validate().expect("a study");
    let text = result_of(&study, &Checkpoint::in_memory(), 1);
    assert_eq!(text, result_of(&study, &Checkpoint::in_memory(), 2));
    let result: DesignResult = serde_json::from_str(&text).expect("a result");
    let chosen = result.scan.expect("a better scan than weak encoding in small voxels");
    assert_eq!(chosen.num_tried, 19);
    assert!(result.ranked.iter().all(|e| e.evaluation.scan == chosen.scan));
    assert_eq!(result.base.evaluation.scan, study.scan);
    let [x, y, z] = [0, 1, 2].map(|a| voxel_mm.min[a] * 0.96 <= chosen.scan.voxel_mm[a]);
    assert!(x && y && z, "{chosen:?}");
    let of_base = chosen.base_objective.expect("the base can be scanned so");
    assert!(of_base > 1.05 && result.best.objective > of_base - 1e-9, "{of_base} {}", result.best.objective);
    let said = result.recommendation.make;
    assert!(said.contains("in voxels of") && said.contains("The scan alone makes the base"), "{said}");
    // The promise is that of the same evaluation by itself.
    let alone = Study { scan: chosen.scan, ..study.clone() };
    let again = confirm(&alone, &result.best.specimen, &|| false).expect("it is confirmed");
    assert_eq!(again.by_material[0].evaluation.promised_sd, result.best.evaluation.promised_sd);
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

/// Holes of every outline have a vector that gives them back, also where symmetry ties them, and one design is of one
/// structure.
#[test]
fn designs_with_outlines_have_a_vector() {
    use crate::specimen::{Hole, HoleAxis, HoleKind, HoleShape, Symmetry};
    let mut study = small_study();
    study.limits.punches_mm = None;
    study.limits.diameter_mm = Some(crate::specimen::DiameterRange { min: 1.0, max: 5.0 });
    study.vary.hole_count = CountRange { min: 0, max: 2 };
    study.vary.hole_shapes = Some(VaryHoleShapes {
        kinds: vec![HoleKind::Ellipse, HoleKind::Slot],
        elongation_mm: Range { min: 0.5, max: 6.0 },
        angle_deg: AngleRange::default(),
    });
    let hole = |kind, center_mm, angle_deg| {
        let shape = Some(HoleShape { kind, length_mm: 4.5, angle_deg });
        Hole { axis: HoleAxis::Thickness, center_mm, diameter_mm: 2.5, shape, is_notch: false }
    };
    for kind in [HoleKind::Ellipse, HoleKind::Slot] {
        for (symmetry, holes) in [
            (Symmetry::None, vec![hole(kind, [-5.0, 1.0], 30.0), hole(kind, [6.0, -2.0], 150.0)]),
            (Symmetry::MirrorZ, vec![hole(kind, [3.0, 3.0], 30.0), hole(kind, [3.0, -3.0], -30.0)]),
            (Symmetry::MirrorZ, vec![hole(kind, [3.0, 0.0], 90.0)]),
            (Symmetry::MirrorX, vec![hole(kind, [6.0, 1.0], -45.0), hole(kind, [-6.0, 1.0], 45.0)]),
            (Symmetry::Point, vec![hole(kind, [6.0, 1.0], 20.0), hole(kind, [-6.0, -1.0], 20.0)]),
        ] {
            study.limits.symmetry = symmetry;
            let specimen = Specimen { holes, ..base_at_drive(&study) };
            assert_eq!(specimen.validate(), Ok(()), "{symmetry:?}");
            let back: Vec<Specimen> = subspaces(&study)
                .iter()
                .filter_map(|space| Some(space.specimen(&space.vector_of(&specimen, specimen.drive_mm[0])?)))
                .collect();
            assert_eq!(back.len(), 1, "{kind:?} {symmetry:?}");
            for hole in &specimen.holes {
                // Scaling to [0, 1] and back rounds, and so does a half turn.
                let differences = back[0].holes.iter().map(|other| hole.difference_mm(other));
                assert!(differences.fold(f64::INFINITY, f64::min) < 1e-9, "{symmetry:?}: {:?}", back[0].holes);
            }
        }
        // An oblique hole on a mirror has no place in a study that asks for the mirror.
        study.limits.symmetry = Symmetry::MirrorZ;
        let oblique = Specimen { holes: vec![hole(kind, [3.0, 0.0], 30.0)], ..base_at_drive(&study) };
        assert!(
            study.limits.check_geometry(&oblique, [1.0; 3]).iter().any(|m| m.name == "symmetry" && !m.is_satisfied)
        );
    }
    // Circles, ellipses and slots of every arrangement, and the solid block once.
    let num_arrangements = |kind| subspaces(&study).iter().filter(|s| s.structure.hole_kind == kind).count();
    assert_eq!(num_arrangements(None), num_arrangements(Some(HoleKind::Slot)) + 1);
}

/// Notches have a vector that gives them back, in the structures of free sides alone, and go with the block.
#[test]
fn designs_with_notches_have_a_vector() {
    use crate::design::study::NotchedSide;
    use crate::specimen::{Hole, HoleAxis, Symmetry, TestKind};
    let mut study = small_study();
    study.limits.punches_mm = None;
    study.limits.diameter_mm = Some(crate::specimen::DiameterRange { min: 1.0, max: 5.0 });
    study.limits.symmetry = Symmetry::MirrorXAndZ;
    study.limits.max_holes = None;
    study.vary.hole_count = CountRange { min: 0, max: 4 };
    study.vary.length_mm = Some(Range { min: 30.0, max: 50.0 });
    study.vary.axes = Some(vec![HoleAxis::Thickness, HoleAxis::Width]);
    study.vary.tests = vec![TestKind::DoubleLapShear];
    study.vary.notches = vec![NotchedSide::Ends, NotchedSide::Sides];
    study.base.drive_mm = vec![3.0];
    study.vary.drive_mm = Range { min: 1.0, max: 5.0 };
    assert_eq!(study.validate().map_err(|e| e.to_string()), Ok(()));
    let notch = |center| Hole::notch(HoleAxis::Thickness, center, 3.0);
    let half = [0.5 * study.base.block.length_mm, 0.5 * study.base.block.width_mm];
    for holes in [
        vec![notch([half[0], 0.0]), notch([-half[0], 0.0])],
        [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]].map(|s| notch([s[0] * half[0], s[1] * 2.5])).to_vec(),
        vec![notch([0.0, half[1]]), notch([0.0, -half[1]]), Hole::circle(HoleAxis::Thickness, [0.0, 0.0], 3.0)],
    ] {
        let specimen = Specimen { test: TestKind::DoubleLapShear, holes, ..base_at_drive(&study) };
        assert_eq!(specimen.validate(), Ok(()));
        let spaces = subspaces(&study);
        let found: Vec<_> = spaces
            .iter()
            .filter_map(|space| Some((space, space.vector_of(&specimen, specimen.drive_mm[0])?)))
            .collect();
        let [(space, vector)] = found.as_slice() else { panic!("{} structures", found.len()) };
        let back = space.specimen(vector);
        for hole in &specimen.holes {
            let differences = back.holes.iter().map(|other| hole.difference_mm(other));
            assert!(differences.fold(f64::INFINITY, f64::min) < 1e-9, "{:?}", back.holes);
        }
        // A longer block takes its notches along.
        let mut longer = vector.clone();
        let place = space.variables.iter().position(|v| *v == super::space::Variable::Length).expect("it varies");
        longer[place] = 1.0;
        assert_eq!(space.specimen(&longer).validate(), Ok(()));
    }
    // Along the width, sides are bonded.
    let spaces = subspaces(&study);
    let along_width = spaces.iter().filter(|s| s.structure.axis == HoleAxis::Width);
    assert!(along_width.flat_map(|s| &s.structure.orbits).all(|o| o.notched != Some(NotchedSide::Sides)));
    // Without a mirror there is no place for them, which is told.
    study.limits.symmetry = Symmetry::None;
    assert!(matches!(study.validate(), Err(StudyError::NoPlaceForNotches)));
    study.limits.symmetry = Symmetry::MirrorXAndZ;
    study.vary.notches = vec![NotchedSide::Ends, NotchedSide::Ends];
    assert!(matches!(study.validate(), Err(StudyError::NotchedSides { count: 2 })));
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
    use crate::specimen::{DiameterRange, HoleAxis, HoleKind, Symmetry, TestKind};
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
    study.vary.hole_shapes = (draw.below(2) == 0).then(|| VaryHoleShapes {
        kinds: [vec![HoleKind::Slot], vec![HoleKind::Ellipse, HoleKind::Slot]][draw.below(2)].clone(),
        elongation_mm: Range { min: 0.5, max: draw.between(1.0, 6.0) },
        angle_deg: AngleRange::default(),
    });
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
            for vector in sample(space, (&study.limits, study.scan.voxel_mm), 4, (study.seed, stream as u64), &[]) {
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
        // Shorter bars than those of the geometry alone: every design is solved.
        study.base.block.length_mm = 24.0;
        study.vary.length_mm = study.vary.length_mm.map(|_| Range { min: 20.0, max: 28.0 });
        study.budget = Budget {
            explore: 4,
            refine: 1,
            iterations: 3,
            propose: 12,
            confirm: 2,
            scans: 1,
            variants_in_search: true,
        };
        match search(&study, &Checkpoint::in_memory(), &quiet, &|| false) {
            Ok(found) => {
                num_found += 1;
                for confirmed in found.ranked.iter().filter(|c| c.is_within_limits) {
                    let specimen = &confirmed.specimen;
                    let mut margins = study.limits.check_geometry(specimen, study.scan.voxel_mm);
                    // What is confirmed is the mean over the meshes, of every material that the priors leave possible.
                    let largest =
                        |f: fn(&Response) -> f64| confirmed.responses.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
                    margins.extend(study.limits.check_response(&TestResponse {
                        drive_mm: specimen.drive_mm[0],
                        force_n: largest(|r| r.log_force).exp(),
                        normal_force_n: None,
                        local_stretch: largest(|r| r.log_stretch).exp(),
                    }));
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
