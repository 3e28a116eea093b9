//! Diagnosis on recordings made with known causes: another mesh than fitted, noise, coarse voxels.

use lambdak::calibration::Observed;
use lambdak::diagnosis::{
    CauseName, Diagnosis, DiagnosisOptions, DiagnosisResult, Laboratory, Scene, Verdict, diagnose, together,
};
use lambdak::fem::{Field, PlateMotion};
use lambdak::material::Material;
use lambdak::mesh::MeshOptions;
use lambdak::recording::{Filter, LoadCurve, RecordedStep, Recording};
use lambdak::specimen::Specimen;
use lambdak::voxel::VoxelMask;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const NOISE_MM: f64 = 0.03;
const FORCE_SD_N: f64 = 0.002;
/// Of the diagnoses. The recordings are made on a mesh of other element sizes.
const MESH_FACTOR: f64 = 2.6;
const RECORDED_MESH_FACTOR: f64 = 2.1;

fn material() -> Material {
    Material::from_json(include_str!("../geometries/materials/ecoflex-0020.json")).unwrap()
}

/// A block half as long and half as wide as the published one, as thick, with one hole off its centre.
const BLOCK: &str = r#"{
    "schema": "specimen/1",
    "name": "small block",
    "test": "double_lap_shear",
    "block": { "length_mm": 12.7, "thickness_mm": 6.4, "width_mm": 9.6 },
    "holes": [],
    "drive_mm": [2.0, 4.0]
}"#;

/// A recording of `scene` at 2 and 4 mm, made on a mesh of other element sizes than the diagnosis uses.
fn recorded(scene: &Scene, seed: u64) -> Recording {
    recorded_of(&material(), scene, seed)
}

fn recorded_of(material: &Material, scene: &Scene, seed: u64) -> Recording {
    let specimen = Specimen::from_json(BLOCK).unwrap();
    let mask = VoxelMask::covering(&specimen, [0.75, 0.4, 0.6]).unwrap();
    let empty = |drive_mm| RecordedStep {
        drive_mm,
        // About what this block takes; a load train gives by it.
        force_n: Some(0.3 * drive_mm),
        force_sd_n: Some(FORCE_SD_N),
        window_s: None,
        displacement: vec![[0.0; 3]; mask.grid.num_voxels()],
    };
    let mut recording = Recording {
        id: "synthetic".into(),
        steps: specimen.drive_mm.iter().map(|d| empty(*d)).collect(),
        specimen,
        grid: mask.grid.clone(),
        mask: mask.spread(&vec![true; mask.num_voxels()], false),
        noise_sd_mm: Some([NOISE_MM; 3]),
        filter: Filter::None,
        load: None,
        notes: None,
    };
    let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
    let mut laboratory =
        Laboratory::new(&observed, &MeshOptions::scaled(&observed.specimen, RECORDED_MESH_FACTOR)).unwrap();
    let prediction = laboratory.predict(material, scene, &|| false).unwrap();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut normal = |sd: f64| {
        let x: f64 = StandardNormal.sample(&mut rng);
        sd * x
    };
    for (n, step) in recording.steps.iter_mut().enumerate() {
        let noisy: Vec<[f64; 3]> =
            prediction.trace.displacement[n].iter().map(|u| u.map(|x| x + normal(NOISE_MM))).collect();
        step.displacement = observed.mask.spread(&noisy, [f64::NAN; 3]);
        step.force_n = Some(prediction.trace.force[n] + normal(FORCE_SD_N));
    }
    recording
}

fn diagnosed(recording: &Recording) -> DiagnosisResult {
    diagnosed_without(recording, &[])
}

fn found_in(recording: &Recording) -> Diagnosis {
    // The coarse mesh errs by some 0.01 mm at 4 mm of drive.
    let options =
        DiagnosisOptions { mesh_factor: MESH_FACTOR, allowance_mm: Some(0.01), ..DiagnosisOptions::default() };
    diagnose(recording, &options, &|line| eprintln!("{line}"), &|| false).unwrap()
}

/// With causes that the diagnosis is not told of.
fn diagnosed_without(recording: &Recording, left_out: &[&'static str]) -> DiagnosisResult {
    let left_out = left_out.iter().map(|n| CauseName::new(n)).collect();
    // The coarse mesh errs by some 0.01 mm at 4 mm of drive.
    let options = DiagnosisOptions {
        mesh_factor: MESH_FACTOR,
        allowance_mm: Some(0.01),
        left_out,
        ..DiagnosisOptions::default()
    };
    let found = diagnose(recording, &options, &|line| eprintln!("{line}"), &|| false).unwrap();
    DiagnosisResult::new(&found, &recording.id, String::new())
}

fn value(result: &DiagnosisResult, name: &str) -> f64 {
    result.causes[0].parameters.iter().find(|p| p.name == name).unwrap().value
}

#[test]
fn nothing_is_found_where_nothing_is() {
    let result = diagnosed(&recorded(&Scene::default(), 1));
    assert_eq!(result.verdict, Verdict::NoMismatch, "{:?}", result.causes);
    // Noise alone: 1 ± 4 √(2/n) with n = 3 × 2 × some 4,352.
    assert!((result.chi2_per_datum.after - 1.0).abs() < 0.04, "{:?}", result.chi2_per_datum);
}

#[test]
fn a_turning_plate_is_named() {
    let turn = PlateMotion { rotation_rad_per_mm: [0.0, 0.0, 2f64.to_radians() / 4.0], ..PlateMotion::default() };
    let scene = Scene { plates: [PlateMotion::default(), turn], ..Scene::default() };
    let result = diagnosed(&recorded(&scene, 2));
    assert_eq!(result.causes[0].name, "tilt", "{:?}", result.causes);
    // Two degrees at the largest drive; the coarse meshes agree to a few percent of it.
    assert!((value(&result, "degrees_at_full_drive_about_z") - 2.0).abs() < 0.15, "{:?}", result.causes[0]);
    assert!(result.kept_back_rms_mm.is_some_and(|k| k.after < k.before));
}

/// Thirty coefficients could follow a turning plate; but it turns with the drive, and a background does not.
#[test]
fn what_grows_with_the_drive_is_no_background() {
    let turn = PlateMotion { rotation_rad_per_mm: [0.0, 0.0, 1f64.to_radians() / 4.0], ..PlateMotion::default() };
    let scene = Scene { plates: [PlateMotion::default(), turn], ..Scene::default() };
    let result = diagnosed_without(&recorded(&scene, 7), &["tilt"]);
    assert_eq!(result.verdict, Verdict::Unexplained, "{:?}", result.causes);
    assert!(result.causes.iter().all(|c| c.name != "background"), "{:?}", result.causes);

    let mut scene = Scene::default();
    // Bent along x, as plates that stay plane do not move a sample.
    (scene.image.background_mm[1][0], scene.image.background_mm[1][4]) = (0.03, 0.05);
    let result = diagnosed(&recorded(&scene, 8));
    assert_eq!(result.causes[0].name, "background", "{:?}", result.causes);
    // 0.03 mm of noise in 4,352 voxels and two steps; the meshes' difference is smooth and of 0.01 mm.
    assert!((value(&result, "u_y_xx_mm") - 0.05).abs() < 0.01, "{:?}", result.causes[0]);
}

/// A shift by most of a voxel, which moves voxels across the walls of the holes.
#[test]
fn a_shifted_image_is_named() {
    let mut scene = Scene::default();
    scene.image.pose.shift_mm = [0.0, 0.0, 0.6];
    let result = diagnosed(&recorded(&scene, 9));
    assert_eq!(result.causes[0].name, "registration", "{:?}", result.causes);
    // The meshes' difference of 0.01 mm against slopes of some tenths along z.
    assert!((value(&result, "shift_z_mm") - 0.6).abs() < 0.06, "{:?}", result.causes[0]);
}

/// Slack takes as much off every drive; a load train that gives takes what the force takes.
#[test]
fn slack_is_told_from_a_load_train_that_gives() {
    let mut scene = Scene::default();
    scene.plates[1].translation_mm[0] = -0.2;
    let result = diagnosed(&recorded(&scene, 10));
    assert_eq!(result.causes[0].name, "slack", "{:?}", result.causes);
    // 4,352 voxels of 0.03 mm average to far less; the meshes differ by 0.01 mm.
    assert!((value(&result, "slack_mm") - 0.2).abs() < 0.02, "{:?}", result.causes[0]);

    let result = diagnosed(&recorded(&Scene { compliance_mm_per_n: -0.3, ..Scene::default() }, 11));
    assert_eq!(result.causes[0].name, "compliance", "{:?}", result.causes);
}

/// The gap closes by 0.3 mm before the first step.
#[test]
fn a_plate_out_of_place_is_named() {
    let mut scene = Scene::default();
    scene.plates[1].translation_mm[1] = -0.3;
    let result = diagnosed(&recorded(&scene, 12));
    assert_eq!(result.causes[0].name, "mount", "{:?}", result.causes);
    // As for slack.
    assert!((value(&result, "y_mm") + 0.3).abs() < 0.03, "{:?}", result.causes[0]);
}

/// Layers of 0.01 mm/kPa: a tenth of a millimetre of slip under the largest tractions, of 4 mm of drive.
#[test]
fn soft_bonds_are_named() {
    let result = diagnosed(&recorded(&Scene { bond_mm_per_kpa: [0.01, 0.01], ..Scene::default() }, 13));
    assert_eq!(result.causes[0].name, "bond", "{:?}", result.causes);
    for name in ["fixed_plate_mm_per_kpa", "moved_plate_mm_per_kpa"] {
        // The meshes' 0.01 mm of some 0.1 mm of slip.
        assert!((value(&result, name) - 0.01).abs() < 0.001, "{:?}", result.causes[0]);
    }
}

/// A stiffer sample and a load cell that reads too much look alike: both are said, no cause is named.
#[test]
fn a_sample_stiffer_than_believed_is_said() {
    let recording = recorded(&Scene::default(), 14);
    let mut believed = material();
    believed.bulk_kpa /= 1.1;
    believed.terms[0].mu_kpa /= 1.1;
    let options = DiagnosisOptions {
        mesh_factor: MESH_FACTOR,
        allowance_mm: Some(0.01),
        prior: Some(believed),
        ..DiagnosisOptions::default()
    };
    let found = diagnose(&recording, &options, &|_| {}, &|| false).unwrap();
    let result = DiagnosisResult::new(&found, "", String::new());
    assert_eq!(result.verdict, Verdict::NoMismatch, "{:?}", result.causes);
    let against = result.modulus_against_belief.unwrap();
    // Coarse meshes agree in the force to 1 %.
    assert!((against.as_relative_cell_gain_error - 0.1).abs() < 0.015, "{against:?}");
    assert!(against.in_words().contains("stiffer"));
}

#[test]
fn a_wrong_encoding_is_named() {
    let mut scene = Scene::default();
    scene.image.gain = [0.05, 0.0, 0.0];
    let result = diagnosed(&recorded(&scene, 3));
    assert_eq!(result.causes[0].name, "gain", "{:?}", result.causes);
    // 4,352 voxels of up to 4 mm with 0.03 mm of noise: 10⁻⁴, and the meshes' difference.
    assert!((value(&result, "relative_gain_error_x") - 0.05).abs() < 0.005, "{:?}", result.causes[0]);
}

/// One material and one scanner: the wrong encoding of both recordings is one, and each recording's model predicts the
/// other.
#[test]
fn two_recordings_agree_on_material_and_encoding() {
    let mut scene = Scene::default();
    scene.image.gain = [0.05, 0.0, 0.0];
    let [a, b] = [15, 16].map(|seed| found_in(&recorded(&scene, seed)));
    let found = together(&[("a", &a), ("b", &b)], MESH_FACTOR, &|_| {}, &|| false).unwrap();
    assert!(found.one_material.agrees, "{:?}", found.one_material);
    // κ, μ and α once instead of twice.
    assert_eq!(found.one_material.parameters_saved, 3);
    assert_eq!(found.common_causes.len(), 1, "{:?}", found.common_causes);
    let common = &found.common_causes[0];
    assert!(common.name == "gain" && common.agreement.agrees, "{common:?}");
    assert!((common.parameters[0].value - 0.05).abs() < 0.005, "{common:?}");
    for p in &found.predictions {
        let rms = p.displacement_rms_mm.unwrap();
        // The noise, and the meshes' difference of 0.01 mm.
        assert!(rms.after < 1.1 * NOISE_MM && rms.before > 1.5 * NOISE_MM, "{p:?}");
        if p.from != p.to {
            // With the plates' own shifts, too, the encoding comes from the other recording. A shift of the plates
            // takes a part of what it does, so that less than before is left to it. Both are χ² of the same data:
            // only the two estimates of the gain differ, by less than an eighth of it (1.25/8² = 0.02, where the whole
            // gain adds at least 1.5² − 1 = 1.25).
            let [plain, shifted] = [p.chi2_per_datum, p.chi2_per_datum_with_own_shifts].map(Option::unwrap);
            assert!(shifted.before < plain.before && shifted.after < 1.02 * plain.after, "{p:?}");
        }
    }
}

/// Two materials, one a tenth stiffer: no one material, and the one predicts the other's force ten percent off.
#[test]
fn two_materials_do_not_agree() {
    let mut stiffer = material();
    stiffer.bulk_kpa *= 1.1;
    stiffer.terms[0].mu_kpa *= 1.1;
    let a = found_in(&recorded(&Scene::default(), 17));
    let b = found_in(&recorded_of(&stiffer, &Scene::default(), 18));
    let found = together(&[("a", &a), ("b", &b)], MESH_FACTOR, &|_| {}, &|| false).unwrap();
    assert!(!found.one_material.agrees, "{:?}", found.one_material);
    let crossed = found.predictions.iter().find(|p| p.from == "a" && p.to == "b").unwrap();
    let force = crossed.force_relative.unwrap();
    assert!((force.after - 0.1 / 1.1).abs() < 0.01, "{crossed:?}");
    assert!(together(&[("a", &a)], MESH_FACTOR, &|_| {}, &|| false).is_err());
}

#[test]
fn a_stiffness_gradient_is_named() {
    let scene = Scene { stiffness: vec![Field::new(|x| 1.0 + 0.3 * x[1] / 3.2)], ..Scene::default() };
    let result = diagnosed(&recorded(&scene, 4));
    assert_eq!(result.causes[0].name, "gradient", "{:?}", result.causes);
    assert!((value(&result, "relative_change_center_to_face_y") - 0.3).abs() < 0.03, "{:?}", result.causes[0]);
}

#[test]
fn a_load_cell_offset_is_named_from_the_load_curve() {
    let mut recording = recorded(&Scene::default(), 5);
    let offset = 0.4;
    let forces: Vec<f64> = recording.steps.iter().map(|s| s.force_n.unwrap()).collect();
    for step in &mut recording.steps {
        step.force_n = step.force_n.map(|f| f + offset);
    }
    // Rest, ramp, hold, ramp, hold: the force over drive of this block is a straight line to a few percent.
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(6);
    let mut curve = LoadCurve::default();
    for n in 0..160 {
        let t = 0.5 * f64::from(n);
        let drive = if t < 10.0 {
            0.0
        } else if t < 12.0 {
            t - 10.0
        } else if t < 40.0 {
            2.0
        } else {
            (t - 38.0).min(4.0)
        };
        let force = if drive <= 2.0 {
            0.5 * drive * forces[0]
        } else {
            forces[0] + 0.5 * (drive - 2.0) * (forces[1] - forces[0])
        };
        let x: f64 = StandardNormal.sample(&mut rng);
        curve.time_s.push(t);
        curve.drive_mm.push(drive);
        curve.force_n.push(force + offset + 0.02 * x);
    }
    recording.load = Some(curve);
    let result = diagnosed(&recording);
    assert_eq!(result.causes[0].name, "cell", "{:?}", result.causes);
    assert!((value(&result, "offset_n") - offset).abs() < 0.03, "{:?}", result.causes[0]);
}
