//! The commands `scan` and `import`, run as a user runs them.

use lambdak::recording::{RawRecording, ReadLimits, Recording};
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

const SMALL: [&str; 10] = [
    "scan",
    "geometries/two-hole-shear.json",
    "--drive",
    "2.5",
    "--mesh",
    "search",
    "--voxel",
    "1.5,0.4,1.5",
    "--mm-per-radian",
    "0.1",
];

/// Raw phases written by one command become, by the other, the displacements that the first gives without `--raw`.
#[test]
fn raw_scans_are_imported() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let (raw, direct, imported) = (place("raw"), place("direct"), place("imported"));
    let first = json(&lambdak(&[&SMALL[..], &["--json", "--raw", "--seed", "5", "--out", &raw]].concat()));
    assert_eq!((first["schema"].as_str(), first["is_raw"].as_bool()), (Some("scan/1"), Some(true)));
    let second = json(&lambdak(&[&SMALL[..], &["--json", "--seed", "5", "--out", &direct]].concat()));
    assert_ne!(first["input_hash"], second["input_hash"]);
    assert_eq!(second["steps"][0]["error"][0]["num_wrong_turns"], 0);
    let third = json(&lambdak(&["import", &raw, "--json", "--out", &imported]));
    assert_eq!(third["schema"], "import/1");
    let limits = ReadLimits::default();
    RawRecording::read(Path::new(&raw), &limits).unwrap();
    let direct_recording = Recording::read(Path::new(&direct), &limits).unwrap();
    let imported_recording = Recording::read(Path::new(&imported), &limits).unwrap();
    let pairs = direct_recording.steps[0].displacement.iter().zip(&imported_recording.steps[0].displacement);
    let num_same = pairs.clone().filter(|(a, b)| (a[0] - b[0]).abs() < 1e-5).count();
    // Phases pass through single precision; a voxel at the edge of being kept may be left out by one way alone.
    let num_kept = pairs.filter(|(a, _)| a[0].is_finite()).count();
    assert!(num_same + 5 >= num_kept && num_kept > 0, "{num_same} of {num_kept}");
    for name in ["scan.json", "load.csv", "raw_1.svg"] {
        assert!(Path::new(&raw).join(name).exists(), "{name}");
    }
    assert!(Path::new(&direct).join("displacement_1.svg").exists());
    // The folder that is read is not written over.
    assert_eq!(lambdak(&["import", &raw, "--out", &raw]).status.code(), Some(2));
    assert_eq!(lambdak(&["import", &direct]).status.code(), Some(2));
}

#[test]
fn the_same_seed_gives_the_same_scan() {
    let run = |seed: &str| lambdak(&[&SMALL[..], &["--json", "--filter", "hamming2", "--seed", seed]].concat());
    let (a, b, c) = (run("7"), run("7"), run("8"));
    assert_eq!(a.stdout, b.stdout);
    assert_ne!(a.stdout, c.stdout);
    assert_eq!(json(&a)["filter"], "hamming2");
}

#[test]
fn matlab_files_are_imported() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_string_lossy().into_owned();
    let specimen = "geometries/two-hole-shear.json";
    let import = |file: &str, more: &[&str]| {
        lambdak(&[&["import", file, "--specimen", specimen, "--json", "--out", &out], more].concat())
    };
    let result = json(&import("tests/data/import/v73.mat", &[]));
    assert_eq!((result["num_voxels"].as_u64(), result["steps"][1]["drive_mm"].as_f64()), (Some(119), Some(5.0)));
    assert_eq!(Recording::read(folder.path(), &ReadLimits::default()).unwrap().grid.shape, [5, 6, 4]);
    assert_eq!(import("tests/data/import/v73.mat", &["--unit", "m"]).status.code(), Some(2));
    assert_eq!(import("tests/data/import/two_blocks.mat", &["--drive", "5"]).status.code(), Some(2));
    json(&import("tests/data/import/two_blocks.mat", &["--drive", "5", "--region", "2"]));
}

#[test]
fn bad_input_ends_with_code_2() {
    for arguments in [
        &["scan", "none.json"][..],
        &["scan", "geometries/two-hole-shear.json", "--noise", "0"],
        &["scan", "geometries/two-hole-shear.json", "--kspace", "2", "--mesh", "search"],
        &["scan", "geometries/two-hole-shear.json", "--raw", "--filter", "hamming2"],
        &["import", "none.mat", "--specimen", "geometries/two-hole-shear.json"],
        &["import", "tests/data/import/v5.mat"],
        &["import", "tests/data/import/make.py"],
    ] {
        let output = lambdak(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?} {}", String::from_utf8_lossy(&output.stderr));
    }
}

/// The images of a recording alone, without its `recording.json`, give the same displacements.
#[test]
fn images_alone_are_imported() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let (scanned, imported) = (place("scanned"), place("imported"));
    json(&lambdak(&[&SMALL[..], &["--json", "--seed", "5", "--out", &scanned]].concat()));
    let [u, mask] = ["u_1.nii.gz", "mask.nii.gz"].map(|name| format!("{scanned}/{name}"));
    let specimen = ["--specimen", "geometries/two-hole-shear.json", "--drive", "2.5"];
    let result = json(&lambdak(&[&["import", &u, &mask, "--json", "--out", &imported], &specimen[..]].concat()));
    assert_eq!(result["schema"], "import/1");
    let limits = ReadLimits::default();
    let [from, to] = [&scanned, &imported].map(|name| Recording::read(Path::new(name), &limits).unwrap());
    // The import keeps the mask's box, and centres it: voxels are compared by their order inside the mask.
    let inside = |r: &Recording| -> Vec<[f64; 3]> {
        r.steps[0].displacement.iter().zip(&r.mask).filter(|(_, m)| **m).map(|(u, _)| *u).collect()
    };
    let (from, to) = (inside(&from), inside(&to));
    assert_eq!(from.len(), to.len());
    for (a, b) in from.iter().zip(&to) {
        // Both are kept in single precision.
        assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-6 || (a[c].is_nan() && b[c].is_nan())), "{a:?} {b:?}");
    }
    // Without a specimen, and with a frame that there is not, the command says what it needs.
    assert_eq!(lambdak(&["import", &u, "--drive", "2.5"]).status.code(), Some(2));
    let bad = lambdak(&[&["import", &u, "--vectors", "up"], &specimen[..]].concat());
    assert_eq!(bad.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&bad.stderr).contains("ras or lps or index"));
}

/// What one camera saw of a face is exported as a table of points, with what is not measured left out, and comes back
/// from it, in another code as well.
#[test]
fn faces_are_exported_and_imported_again() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let (film, tables, again) = (place("film"), place("tables"), place("again"));
    let specimen = "geometries/solid-shear.json";
    let scan = ["scan", specimen, "--surface", "+z", "--voxel", "1.6", "--noise", "0.005", "--drive", "2,4"];
    json(&lambdak(&[&scan[..], &["--mesh", "search", "--seed", "3", "--json", "--out", &film]].concat()));
    let export = json(&lambdak(&["export", "recording", &film, "--json", "--out", &tables]));
    let files = ["recording.mat", "recording.h5", "recording-1.csv", "recording-2.csv"];
    assert_eq!(export["files"], serde_json::json!(files));
    let table = std::fs::read_to_string(Path::new(&tables).join("recording-2.csv")).unwrap();
    assert_eq!(table.lines().next(), Some("x_mm,y_mm,z_mm,ux_mm,uy_mm,sd_mm"));
    let utf16: Vec<u8> = format!("\u{feff}{table}").encode_utf16().flat_map(u16::to_le_bytes).collect();
    std::fs::write(Path::new(&tables).join("recording-2.csv"), utf16).unwrap();
    let [first, second] = [1, 2].map(|n| format!("{tables}/recording-{n}.csv"));
    let points = ["import", &first, &second, "--form", "points", "--surface", "+z", "--specimen", specimen];
    json(&lambdak(&[&points[..], &["--drive", "2,4", "--json", "--out", &again]].concat()));
    let [film, again] = [&film, &again].map(|f| Recording::read(Path::new(f), &ReadLimits::default()).unwrap());
    assert_eq!(film.num_voxels(), again.num_voxels());
    for (a, b) in film.steps.iter().zip(&again.steps) {
        let of = |r: &Recording, u: &[[f64; 3]]| -> Vec<[f64; 3]> {
            u.iter().zip(&r.mask).filter(|(_, m)| **m).map(|(u, _)| *u).collect()
        };
        for (a, b) in of(&film, &a.displacement).into_iter().zip(of(&again, &b.displacement)) {
            assert!((0..2).all(|c| (a[c] - b[c]).abs() < 1e-6 || (a[c].is_nan() && b[c].is_nan())), "{a:?} {b:?}");
        }
    }
    let raw = lambdak(&["export", "recording", &place("film"), "--raw", "--format", "points"]);
    assert_eq!(raw.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&raw.stderr).contains("import the phases first"));
}
