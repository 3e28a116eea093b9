//! Gradients of responses against solves on moved meshes.

use super::*;
use crate::design::range::{AngleRange, OffsetRange, Range};
use crate::design::space::subspaces;
use crate::design::study::{NotchedSide, VaryHoleShapes};
use crate::mesh::{mesh_specimen, morphed};
use crate::sensitivity::Protocol;
use std::path::Path;

fn study() -> Study {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/studies");
    let text = std::fs::read_to_string(folder.join("two-hole-shear.json")).expect("the study is there");
    let mut study = Study::from_json(&text, &folder).expect("the study is valid");
    study.limits.symmetry = crate::specimen::Symmetry::None;
    study.vary.thickness_mm = Some(super::super::range::Range { min: 5.0, max: 8.0 });
    study.vary.length_mm = Some(super::super::range::Range { min: 20.0, max: 30.0 });
    study.vary.width_mm = Some(super::super::range::Range { min: 15.0, max: 22.0 });
    study.materials.iter_mut().for_each(|m| m.relative_sd = 0.0);
    // So that the materials' distance is evaluated too.
    study.objective.kind = ObjectiveKind::TellApart;
    // And forces on the way, by a load cell that is not perfect.
    study.protocol =
        Protocol { force_drive_mm: vec![2.5], force_gain_sd: 0.01, force_zero_sd_n: 0.05, ..Protocol::default() };
    study
}

/// f(±h) on the same mesh with moved nodes is f ± h f′ + O(h²): for every kind of variable and every response, the
/// remainders fall fourfold when h is halved, and the extrapolated central difference is the gradient.
#[test]
fn every_gradient_passes_the_taylor_test() {
    let mut study = study();
    study.vary.precompression_mm = Some(OffsetRange { min: -1.2, max: 0.4 });
    let mut specimen = study.base.clone();
    specimen.precompression_mm = -0.5;
    specimen.drive_mm = vec![5.0];
    specimen.holes[0].center_mm = [-4.6, 1.3];
    specimen.holes[0].diameter_mm = 4.2;
    let all = subspaces(&study);
    let space = all
        .iter()
        .find(|s| s.structure.num_holes() == 2 && s.structure.axis == crate::specimen::HoleAxis::Thickness)
        .expect("two holes are allowed");
    // The second hole's variables are of the same kinds as the first's.
    let is_left_out = |variable| matches!(variable, Variable::X(1) | Variable::Other(1) | Variable::Diameter(1));
    let variables = space.variables.iter().copied().filter(|v| !is_left_out(*v)).collect::<Vec<_>>();
    check_gradients(&study, &specimen, space, &variables);
}

/// The same of a wedge, whose nodes between the plates rise and sink as they go along x.
#[test]
fn gradients_of_a_wedge_pass_the_taylor_test() {
    let mut study = study();
    study.base.block.wedge_mm = 1.8;
    study.materials.truncate(2);
    study.vary.axes = Some(vec![crate::specimen::HoleAxis::Thickness]);
    study.vary.tests = vec![crate::specimen::TestKind::DoubleLapShear];
    assert_eq!(study.validate().map_err(|e| e.to_string()), Ok(()));
    let mut specimen = study.base.clone();
    specimen.drive_mm = vec![5.0];
    specimen.holes[0].center_mm = [-4.6, 1.3];
    specimen.holes[0].diameter_mm = 4.2;
    let all = subspaces(&study);
    let space = all.iter().find(|s| s.vector_of(&specimen, 5.0).is_some()).expect("two holes are allowed");
    let variables = [Variable::X(0), Variable::Diameter(0), Variable::Length, Variable::Thickness];
    check_gradients(&study, &specimen, space, &variables);
}

/// A wedge stays as it is in the base, so nothing may be tried that it does not go with.
#[test]
fn what_does_not_go_with_a_wedge_is_told_at_it() {
    use crate::specimen::{HoleAxis, Symmetry, TestKind};
    let base = || {
        let mut study = study();
        study.base.block.wedge_mm = 1.8;
        study.vary.axes = Some(vec![HoleAxis::Thickness]);
        study.vary.tests = vec![TestKind::DoubleLapShear];
        study
    };
    let pointers = |study: &Study| study.field_errors().into_iter().map(|e| e.pointer).collect::<Vec<_>>();
    assert_eq!(pointers(&base()), Vec::<String>::new());
    let mut pulled = base();
    pulled.vary.tests = vec![TestKind::DoubleLapShear, TestKind::Uniaxial];
    let mut across = base();
    across.vary.axes = Some(vec![HoleAxis::Thickness, HoleAxis::Width]);
    let mut mirrored = base();
    mirrored.limits.symmetry = Symmetry::MirrorXAndZ;
    for study in [pulled, across, mirrored] {
        assert_eq!(pointers(&study), ["/base/block/wedge_mm"]);
    }
    let mut along = base();
    along.limits.symmetry = Symmetry::MirrorZ;
    assert_eq!(pointers(&along), Vec::<String>::new());
}

/// The same of an ellipse's and a slot's extents and angle.
#[test]
fn gradients_of_outlines_pass_the_taylor_test() {
    use crate::specimen::{HoleKind, HoleShape};
    let mut study = study();
    study.vary.hole_shapes = Some(VaryHoleShapes {
        kinds: vec![HoleKind::Ellipse, HoleKind::Slot],
        elongation_mm: Range { min: 0.5, max: 6.0 },
        angle_deg: AngleRange::default(),
    });
    for kind in [HoleKind::Ellipse, HoleKind::Slot] {
        let mut specimen = study.base.clone();
        specimen.drive_mm = vec![5.0];
        specimen.holes[0].center_mm = [-4.6, 1.3];
        for (hole, angle_deg) in specimen.holes.iter_mut().zip([30.0, -70.0]) {
            hole.diameter_mm = 3.2;
            hole.shape = Some(HoleShape { kind, length_mm: 5.6, angle_deg });
        }
        let all = subspaces(&study);
        let space = all.iter().find(|s| s.vector_of(&specimen, 5.0).is_some()).expect("two such holes are allowed");
        let variables = [Variable::Diameter(0), Variable::Elongation(0), Variable::Angle(0)];
        check_gradients(&study, &specimen, space, &variables);
    }
}

/// The same of notches: their radius, their place along the side, and the block's dimensions, with which they go.
#[test]
fn gradients_of_notches_pass_the_taylor_test() {
    use crate::specimen::{Hole, HoleAxis, Symmetry};
    let mut study = study();
    study.limits.symmetry = Symmetry::MirrorX;
    study.vary.notches = vec![NotchedSide::Ends];
    assert_eq!(study.validate().map_err(|e| e.to_string()), Ok(()));
    let mut specimen = study.base.clone();
    specimen.drive_mm = vec![5.0];
    specimen.holes = [1.0, -1.0].map(|s| Hole::notch(HoleAxis::Thickness, [s * 12.7, 1.5], 4.4)).to_vec();
    let all = subspaces(&study);
    let space = all.iter().find(|s| s.vector_of(&specimen, 5.0).is_some()).expect("notches are allowed");
    let variables = [Variable::Other(0), Variable::Diameter(0), Variable::Length, Variable::Width];
    check_gradients(&study, &specimen, space, &variables);
}

/// The same of a dumb-bell's gauge and block.
#[test]
fn gradients_of_a_gauge_pass_the_taylor_test() {
    let mut study = study();
    study.base = Specimen::from_json(include_str!("../../geometries/short-dumbbell.json")).expect("shipped");
    study.base.drive_mm = vec![5.0];
    study.vary.tests = vec![crate::specimen::TestKind::Uniaxial];
    study.vary.hole_count = crate::design::range::CountRange { min: 0, max: 0 };
    study.vary.length_mm = Some(Range { min: 35.0, max: 45.0 });
    study.vary.width_mm = Some(Range { min: 10.0, max: 14.0 });
    study.vary.thickness_mm = None;
    study.vary.gauge_width_mm = Some(Range { min: 4.0, max: 8.0 });
    study.vary.gauge_length_mm = Some(Range { min: 4.0, max: 12.0 });
    study.vary.fillet_radius_mm = Some(Range { min: 4.0, max: 8.0 });
    assert_eq!(study.validate().map_err(|e| e.to_string()), Ok(()));
    let all = subspaces(&study);
    assert_eq!(all.len(), 1);
    let vector = all[0].vector_of(&study.base, 5.0).expect("within the ranges");
    assert_eq!(all[0].specimen(&vector).outline, study.base.outline);
    check_gradients(&study, &study.base.clone(), &all[0], &all[0].variables);
}

/// See the tests that call it.
fn check_gradients(study: &Study, specimen: &Specimen, space: &Subspace, variables: &[Variable]) {
    // What is derived is the discrete model, on a mesh as coarse as may be.
    let mut evaluator = Evaluator::new(study).with_coarseness(3.0);
    evaluator.solve.tolerance = 1e-10;
    let mesh = mesh_specimen(specimen, &evaluator.mesh_options(specimen)).expect("a mesh");
    let at = |mesh: crate::mesh::Mesh, drive: f64, [thicker_mm, nearer_mm]: [f64; 2], moves: &[Move]| {
        // The model takes the plates' distance and what they are pressed together from the specimen.
        let mut moved = specimen.clone();
        moved.block.thickness_mm += thicker_mm;
        moved.precompression_mm += nearer_mm;
        let mut model = ForwardModel::new(mesh, &moved).expect("a model");
        let solved = evaluator.solve(&mut model, drive, moves, &|| false).expect("equilibria");
        let block = Block { model, has_plates: specimen.has_plates(), num_scanned: 1 };
        let responses = evaluator.responses(&[Shown::as_solved(&block, &solved)]).expect("responses");
        (block, solved, responses.iter().map(Response::to_vector).collect::<Vec<_>>())
    };
    for &variable in variables {
        // Steps count in mm at the wall: ten degrees move the ends of a hole by half a millimetre.
        let unit = if matches!(variable, Variable::Angle(_)) { 20.0 } else { 1.0 };
        let model = ForwardModel::new(mesh.clone(), specimen).expect("a model");
        let moves = vec![a_move(&model, (specimen, 0), space, variable)];
        let (block, solved, here) = at(mesh.clone(), 5.0, [0.0; 2], &moves);
        let mut gradients = evaluator.gradient(&[block], &[solved], 0, &[moves]).expect("a gradient");
        gradients.iter_mut().flatten().for_each(|slope| *slope *= unit);
        let value = |h: f64| -> Vec<Vec<f64>> {
            let mut moved = mesh.clone();
            for (design_variable, sign) in space.moves(variable, 0) {
                moved = morphed(&moved, &shape_velocity(&mesh, specimen, design_variable), sign * unit * h);
            }
            let of = |which: Variable| if variable == which { h } else { 0.0 };
            at(moved, 5.0 + of(Variable::Drive), [of(Variable::Thickness), of(Variable::Precompression)], &[]).2
        };
        let h = 0.08;
        let near = 1e-4;
        let all_sides = [h, -h, 0.5 * h, -0.5 * h, near, -near].map(value);
        for (sample, (here, gradient)) in here.iter().zip(&gradients).enumerate() {
            let sides: Vec<&Vec<f64>> = all_sides.iter().map(|side| &side[sample]).collect();
            // The tearing stretch is that of one quadrature point, another one after a large step: its slope is local.
            let stretch = here.len() - 1;
            let slope = (sides[4][stretch] - sides[5][stretch]) / (2.0 * near);
            assert!(
                (slope - gradient[stretch]).abs() < 1e-3 * slope.abs().max(0.01),
                "{variable:?}: {slope} {}",
                gradient[stretch]
            );
            for i in 0..stretch {
                let coarse = (sides[0][i] - sides[1][i]) / (2.0 * h);
                let fine = (sides[2][i] - sides[3][i]) / h;
                let limit = (4.0 * fine - coarse) / 3.0;
                // What extrapolation leaves is O(h⁴); all responses are logarithms, whose slopes are of order 0.01 to 1
                // per mm, but for the force across the plates, of some newtons.
                assert!(
                    (limit - gradient[i]).abs() < 2e-4 + 2e-3 * gradient[i].abs(),
                    "{variable:?}, response {i}: difference {limit}, gradient {}",
                    gradient[i]
                );
                let remainder = |f: f64, h: f64| (f - here[i] - h * gradient[i]).abs();
                let (large, small) = (remainder(sides[0][i], h), remainder(sides[2][i], 0.5 * h));
                // Below this the remainder is the solver's and the difference's own error.
                if large > 1e-4 {
                    let order = (large / small).log2();
                    assert!((1.6..2.6).contains(&order), "{variable:?}, response {i}: order {order} ({large} {small})");
                }
            }
        }
    }
}

/// Gradients of a design of two unlike blocks, both scanned, with one force: of a variable that moves both, of one that
/// moves the second alone, and of the drive.
#[test]
fn gradients_of_unlike_blocks() {
    let mut study = study();
    study.objective.kind = ObjectiveKind::SensitivityAndPromisedSd;
    study.protocol.blocks_scanned = 2;
    study.materials.truncate(1);
    study.base.samples_in_parallel = 1;
    let block = crate::specimen::Block { thickness_mm: 7.5, ..study.base.block };
    study.base.other_samples = vec![crate::specimen::Sample { block, holes: study.base.holes.clone() }];
    let thickness_mm = Some(super::super::range::Range { min: 5.0, max: 9.0 });
    study.vary.other_samples =
        vec![super::super::study::VarySample { is_like_first: true, thickness_mm, ..Default::default() }];
    study.validate().expect("a study");
    let specimen = study.base.clone();
    let all = subspaces(&study);
    let space = all.iter().find(|s| s.vector_of(&specimen, 5.0).is_some()).expect("the base's structure");
    let mut evaluator = Evaluator::new(&study).with_coarseness(2.2);
    evaluator.solve.tolerance = 1e-10;
    let samples = specimen.samples();
    let meshes: Vec<crate::mesh::Mesh> =
        samples.iter().map(|s| mesh_specimen(s, &evaluator.mesh_options(s)).expect("a mesh")).collect();
    let at = |step: f64, variable: Variable, has_gradient: bool| {
        let drive = 5.0 + if variable == Variable::Drive { step } else { 0.0 };
        let (mut blocks, mut solved, mut of_blocks) = (Vec::new(), Vec::new(), Vec::new());
        for (number, (sample, mesh)) in samples.iter().zip(&meshes).enumerate() {
            let mut moved = mesh.clone();
            let mut thicker = sample.clone();
            for (design_variable, sign) in space.moves(variable, number) {
                moved = morphed(&moved, &shape_velocity(mesh, sample, design_variable), sign * step);
                if design_variable == crate::mesh::DesignVariable::BlockThickness {
                    thicker.block.thickness_mm += step;
                }
            }
            let mut model = ForwardModel::new(moved, &thicker).expect("a model");
            let own = if has_gradient { vec![a_move(&model, (sample, number), space, variable)] } else { Vec::new() };
            solved.push(evaluator.solve(&mut model, drive, &own, &|| false).expect("equilibria"));
            blocks.push(Block { model, has_plates: specimen.has_plates(), num_scanned: 1 });
            of_blocks.push(own);
        }
        let shown: Vec<Shown> = blocks.iter().zip(&solved).map(|(b, s)| Shown::as_solved(b, s)).collect();
        let responses = evaluator.responses(&shown).expect("responses");
        let gradient = has_gradient.then(|| evaluator.gradient(&blocks, &solved, 0, &of_blocks).expect("a gradient"));
        (responses[0].to_vector(), gradient)
    };
    assert!(space.variables.contains(&Variable::OtherThickness(0)), "{:?}", space.variables);
    for variable in [Variable::X(0), Variable::OtherThickness(0), Variable::Thickness, Variable::Drive] {
        let (here, gradient) = at(0.0, variable, true);
        let gradient = &gradient.expect("asked for")[0];
        let h = 0.08;
        let [a, b, c, d] = [h, -h, 0.5 * h, -0.5 * h].map(|step| at(step, variable, false).0);
        // The last entry is the stretch of one quadrature point, another one after a large step.
        for i in 0..here.len() - 1 {
            let (coarse, fine) = ((a[i] - b[i]) / (2.0 * h), (c[i] - d[i]) / h);
            let limit = (4.0 * fine - coarse) / 3.0;
            // As in the test above: what extrapolation leaves is O(h⁴).
            let is_close = (limit - gradient[i]).abs() < 2e-4 + 2e-3 * gradient[i].abs();
            assert!(is_close, "{variable:?}, response {i}: difference {limit}, gradient {}", gradient[i]);
        }
    }
}

/// Materials that differ by what a fit takes up are not apart; a second term is.
#[test]
fn materials_are_apart_by_what_no_fit_takes_up() {
    let mut study = study();
    let separation = |study: &Study| {
        let evaluator = Evaluator::new(study).with_coarseness(1.5);
        let mut specimen = study.base.clone();
        specimen.drive_mm = vec![7.0];
        evaluator.evaluate(&specimen, None, &|| false).expect("an evaluation").responses[1].log_separation.exp()
    };
    let apart = separation(&study);
    let mut near = study.materials[0].clone();
    near.material.terms[0].mu_kpa *= 1.01;
    near.material.terms[0].alpha *= 0.99;
    study.materials[1] = near;
    let fitted = separation(&study);
    // One term is fitted to another one; the gain at which the fit stops is 10⁻⁴. The published second term is not
    // taken up.
    assert!(fitted < 0.02, "{fitted}");
    assert!(apart > 5.0 * fitted, "{apart} {fitted}");
    study.objective.kind = ObjectiveKind::DOptimal;
    assert!((separation(&study) - 1.0).abs() < f64::EPSILON, "not asked for");
}
