//! What cameras see of a face (digital image correlation), by the commands as a user runs them: evaluated, recorded,
//! imported, calibrated, and refused where the volume is needed.

use lambdak::recording::{ReadLimits, Recording};
use std::path::Path;
use std::process::{Command, Output};

fn lambdak(arguments: &[&str]) -> Output {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    Command::new(env!("CARGO_BIN_EXE_lambdak")).current_dir(root).args(arguments).output().unwrap()
}

fn json(output: &Output) -> serde_json::Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The message of a command that must be refused.
fn refused(arguments: &[&str]) -> String {
    let output = lambdak(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

const BLOCK: [&str; 7] = ["geometries/solid-shear.json", "--drive", "4", "--mesh", "search", "--voxel", "0.8"];

/// A synthetic recording of the side of a sheared block is calibrated; the truth lies within the intervals, and the
/// stated deviations are those that the evaluation of the same cameras promised.
#[test]
fn a_filmed_block_is_calibrated_as_promised() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let (film, fit) = (place("film"), place("fit"));
    let cameras = ["--surface", "+z", "--noise", "0.005", "--force-sd", "0.01", "--json"];
    let promised = json(&lambdak(&[&["evaluate"][..], &BLOCK, &cameras].concat()));
    let of_step = &promised["steps"][0];
    assert_eq!(promised["scan"]["surface"]["face"], "+z");
    assert_eq!(of_step["num_voxels"], 32 * 8);
    assert_eq!(of_step["integrated_sensitivity"][0]["volume_integral"], 0.0);
    assert!(of_step["integrated_sensitivity"][0]["surface_integral"].as_f64().unwrap() > 0.0);
    let made = json(&lambdak(&[&["scan"][..], &BLOCK, &cameras, &["--seed", "3", "--out", &film]].concat()));
    assert_eq!((made["schema"].as_str(), &made["noise_sd_mm"][2]), (Some("scan/1"), &serde_json::Value::Null));
    let recording = Recording::read(Path::new(&film), &ReadLimits::default()).unwrap();
    assert_eq!(recording.grid.shape, [32, 8, 1]);
    for name in ["displacement_1.svg", "scan.json", "load.csv"] {
        assert!(Path::new(&film).join(name).exists(), "{name}");
    }
    let options = ["--terms", "1", "--mesh", "2", "--json", "--out", &fit];
    let found = json(&lambdak(&[&["calibrate", &film][..], &options].concat()));
    for (parameter, promise) in
        found["parameters"].as_array().unwrap().iter().zip(promised["promised_sd"].as_array().unwrap())
    {
        let name = parameter["name"].as_str().unwrap();
        assert_eq!(name, promise["parameter"]);
        let truth = match name {
            "mu_1" => 17.0,
            "alpha_1" => 1.91,
            // κ is not told by a sheared block.
            _ => continue,
        };
        let [low, high] = [0, 1].map(|end| parameter["interval_95"][end].as_f64().unwrap());
        // One draw lies in its 95 % interval; twice that wide it is 99.99 %.
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        assert!((middle - truth).abs() < 2.0 * half, "{name}: {low} to {high}");
        let ratio = parameter["sd"].as_f64().unwrap() / promise["value"].as_f64().unwrap();
        // Meshes and materials differ by some percent; the misfit of a coarse mesh may widen what is stated.
        assert!((0.8..2.0).contains(&ratio), "{name}: {ratio}");
    }
    assert!(found["steps"][0]["rms_mm"][2].is_null());
    assert!(Path::new(&fit).join("report.html").exists());
    // A diagnosis is of the volume.
    let message = refused(&["diagnose", &film]);
    assert!(message.contains("the face +z") && message.contains("a recording of the volume"), "{message}");
}

/// A table of one camera, without a place along the normal, is imported and calibrated like the recording it came from.
#[test]
fn a_table_of_a_face_is_imported() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let (film, table, made) = (place("film"), place("points.csv"), place("made"));
    json(&lambdak(&[&["scan"][..], &BLOCK, &["--surface", "-z,all", "--json", "--out", &film]].concat()));
    let recording = Recording::read(Path::new(&film), &ReadLimits::default()).unwrap();
    let mut text = String::from("x_mm,y_mm,ux_mm,uy_mm\n");
    for (v, u) in recording.steps[0].displacement.iter().enumerate().filter(|(v, _)| recording.mask[*v]) {
        let x = recording.grid.center_mm(v);
        text += &format!("{},{},{},{}\n", x[0], x[1], u[0], u[1]);
    }
    std::fs::write(&table, text).unwrap();
    let specimen = ["--specimen", "geometries/solid-shear.json", "--drive", "4"];
    let command = [&["import", &table, "--form", "points"][..], &specimen].concat();
    let options = ["--surface=-z", "--noise", "0.01", "--json", "--out", &made];
    let result = json(&lambdak(&[&command[..], &options].concat()));
    assert_eq!(result["surface"]["components"], "in_plane");
    let again = Recording::read(Path::new(&made), &ReadLimits::default()).unwrap();
    assert_eq!((again.grid.shape, again.num_voxels()), (recording.grid.shape, recording.num_voxels()));
    for (a, b) in again.steps[0].displacement.iter().zip(&recording.steps[0].displacement) {
        // Written in single precision, twice.
        assert!((a[0] - b[0]).abs() < 1e-6 && (a[1] - b[1]).abs() < 1e-6 && a[2].is_nan());
    }
    // Without the face, the table lacks columns; on a bonded face there is nothing to see.
    assert!(refused(&command).contains("there is no column z"));
    assert!(refused(&[&command[..], &["--surface", "+y"]].concat()).contains("a plane face"));
}

#[test]
fn what_needs_a_volume_is_refused() {
    let scan = |more: &[&str]| refused(&[&["scan"][..], &BLOCK, &["--surface", "+z"], more].concat());
    for more in [&["--snr", "20"][..], &["--raw"], &["--filter", "hamming2"], &["--kspace", "0.5"]] {
        assert!(scan(more).contains("left out where a surface is seen"), "{more:?}");
    }
    let evaluate = |more: &[&str]| refused(&[&["evaluate"][..], &BLOCK, more].concat());
    assert!(evaluate(&["--surface", "+z", "--detect"]).contains("a scan of the volume"));
    assert!(evaluate(&["--surface", "+y"]).contains("the plane faces that cameras see are -z, +z"));
    assert!(evaluate(&["--surface", "top"]).contains("a face (-y, +y, -z, +z)"));
}
