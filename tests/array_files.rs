//! Results as arrays and fields for other tools, written by the program as a user runs it.

use hdf5_pure::File;
use lambdak::file::MemoryLimit;
use lambdak::recording::mat::{MatValue, read_mat};
use lambdak::recording::{ReadLimits, Recording};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

fn lambdak(arguments: &[&str]) -> Value {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let output = Command::new(env!("CARGO_BIN_EXE_lambdak")).current_dir(root).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The variables of a MAT-file; members of structs as `struct/member`.
fn variables(path: &Path) -> BTreeMap<String, MatValue> {
    fn flatten(prefix: &str, members: Vec<(String, MatValue)>, found: &mut BTreeMap<String, MatValue>) {
        for (name, value) in members {
            match value {
                MatValue::Struct(inner) => flatten(&format!("{prefix}{name}/"), inner, found),
                value => drop(found.insert(format!("{prefix}{name}"), value)),
            }
        }
    }
    let mut found = BTreeMap::new();
    flatten("", read_mat(path, &MemoryLimit::command().begin()).unwrap(), &mut found);
    found
}

/// A numeric array of an HDF5 file: sizes and numbers, last index fastest.
fn array(file: &File, name: &str) -> (Vec<usize>, Vec<f64>) {
    let dataset = file.dataset(name).unwrap_or_else(|e| panic!("{name}: {e}"));
    let sizes = dataset.shape().unwrap().iter().map(|&n| n as usize).collect();
    (sizes, dataset.read_f64().unwrap())
}

/// The number at these indices, last index fastest.
fn at((sizes, values): &(Vec<usize>, Vec<f64>), indices: &[usize]) -> f64 {
    assert_eq!(sizes.len(), indices.len());
    values[indices.iter().zip(sizes).fold(0, |n, (i, size)| n * size + i)]
}

/// Equal to the bit, or both missing.
fn is_same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

/// Both files hold the same arrays: HDF5 with the last index fastest, MATLAB with the first.
fn compare(file: &File, variables: &BTreeMap<String, MatValue>) {
    let mut num_compared = 0;
    for (name, value) in variables.iter().filter(|(name, _)| !name.starts_with("about/")) {
        let Some((matlab_sizes, matlab)) = value.numbers() else { continue };
        let plain = array(file, name);
        let longer_than_one = |sizes: &[usize]| sizes.iter().copied().filter(|n| *n > 1).collect::<Vec<_>>();
        assert_eq!(longer_than_one(&plain.0), longer_than_one(matlab_sizes), "{name}");
        // Indices of nodes count from 1 in MATLAB.
        let first = if name.ends_with("element_nodes") { 1.0 } else { 0.0 };
        for (n, value) in matlab.iter().enumerate() {
            let mut rest = n;
            let index = |size: &usize| {
                let index = rest % size;
                rest /= size;
                index
            };
            let indices: Vec<usize> = plain.0.iter().map(index).collect();
            let other = at(&plain, &indices);
            assert!(is_same(value - first, other), "{name} at {indices:?}: {value} and {other}");
        }
        let about = &variables[&format!("about/{name}")];
        assert!(matches!(about, MatValue::Text(text) if text.starts_with('(')), "{name}: {about:?}");
        num_compared += 1;
    }
    assert!(num_compared > 5);
}

/// The numbers of an array of a VTU file.
fn of_vtu(text: &str, name: &str) -> Vec<f64> {
    let start = text.find(&format!("Name=\"{name}\"")).unwrap_or_else(|| panic!("no {name}"));
    let (_, rest) = text[start..].split_once('>').unwrap();
    let (encoded, _) = rest.split_once('<').unwrap();
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let digits: Vec<u8> = encoded.bytes().filter(|c| *c != b'=').map(digit).collect();
    let mut bytes = Vec::new();
    for group in digits.chunks(4) {
        let bits = group.iter().fold(0u32, |n, d| n << 6 | u32::from(*d)) << (6 * (4 - group.len()));
        bytes.extend_from_slice(&bits.to_be_bytes()[1..group.len()]);
    }
    // The length stands before the numbers.
    bytes[8..].chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect()
}

/// What ParaView reads of one file for all drives is what it reads of one file for each, and so is what MATLAB and
/// Python read.
#[test]
fn a_solution_is_the_same_in_all_files() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let out = folder.path().to_string_lossy().into_owned();
    let arguments = ["solve", "geometries/two-hole-shear.json", "--drive", "1,2,3", "--mesh", "2.5", "--json"];
    let result = lambdak(&[&arguments[..], &["--arrays", "mat,hdf5,vtkhdf", "--out", &out]].concat());
    let file = File::open(place("solve.h5")).unwrap();
    compare(&file, &variables(&place("solve.mat")));
    let text = &file.dataset("result_json").unwrap().read_string().unwrap()[0];
    assert_eq!(serde_json::from_str::<Value>(text).unwrap(), result);
    let forces = array(&file, "force_n");
    let vtkhdf = File::open(place("solution.vtkhdf")).unwrap();
    let (_, times) = array(&vtkhdf, "VTKHDF/Steps/Values");
    let (_, points) = array(&vtkhdf, "VTKHDF/Points");
    let fields = [
        ("PointData", "displacement_mm", &[3][..]),
        ("CellData", "deformation_gradient", &[3, 3]),
        ("CellData", "jacobian", &[]),
        ("CellData", "principal_stretches", &[3]),
        ("CellData", "stretch_amplitude", &[]),
        ("CellData", "deformation_mode", &[]),
        ("CellData", "cauchy_stress_kpa", &[3, 3]),
    ];
    for step in 0..3 {
        assert_eq!(times[step], result["steps"][step]["drive_mm"].as_f64().unwrap());
        assert_eq!(forces.1[step], result["steps"][step]["force_n"].as_f64().unwrap());
        let vtu = std::fs::read_to_string(place(&format!("solution_{}.vtu", step + 1))).unwrap();
        assert_eq!(of_vtu(&vtu, "position_mm"), points);
        for (group, name, sizes) in fields {
            let expected = of_vtu(&vtu, name);
            let (_, values) = array(&vtkhdf, &format!("VTKHDF/{group}/{name}"));
            let (_, offsets) = array(&vtkhdf, &format!("VTKHDF/Steps/{group}Offsets/{name}"));
            let components: usize = sizes.iter().product();
            let from = components * offsets[step] as usize;
            let plain = array(&file, &format!("sample_1/{name}"));
            for (n, &value) in expected.iter().enumerate() {
                assert!(is_same(value, values[from + n]), "{name} at drive {step}: {n}");
                let component = n % components;
                let mut indices = vec![n / components];
                match sizes.len() {
                    1 => indices.push(component),
                    2 => indices.extend([component / 3, component % 3]),
                    _ => {}
                }
                indices.push(step);
                assert!(is_same(value, at(&plain, &indices)), "{name} at {indices:?}");
            }
        }
    }
}

#[test]
fn an_evaluation_is_the_same_in_all_files() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let out = folder.path().to_string_lossy().into_owned();
    let arguments = ["evaluate", "geometries/two-hole-shear.json", "--drive", "2,4", "--mesh", "2.5", "--json"];
    let more = ["--voxel", "1.5,0.4,1.5", "--arrays", "mat,hdf5,vtkhdf", "--out", &out];
    let result = lambdak(&[&arguments[..], &more].concat());
    let file = File::open(place("evaluation.h5")).unwrap();
    compare(&file, &variables(&place("evaluation.mat")));
    let names = file.dataset("parameters").unwrap().read_string().unwrap();
    let promised = array(&file, "promised_sd");
    for (n, expected) in result["promised_sd"].as_array().unwrap().iter().enumerate() {
        assert_eq!(names[n], expected["parameter"]);
        assert!(is_same(promised.1[n], expected["value"].as_f64().unwrap_or(f64::NAN)));
    }
    let (sizes, mask) = array(&file, "sample_1/mask");
    let num_voxels = mask.iter().filter(|m| **m > 0.5).count();
    let stretch = array(&file, "sample_1/stretch_amplitude");
    let sensitivity = array(&file, "sample_1/sensitivity_mu_1");
    for step in 0..2 {
        let expected = &result["steps"][step];
        assert_eq!(num_voxels as u64, expected["num_voxels"].as_u64().unwrap());
        let (mut stretches, mut sum) = (Vec::new(), 0.0);
        for n in 0..mask.len() {
            let [i, j, k] = [n / (sizes[1] * sizes[2]), n / sizes[2] % sizes[1], n % sizes[2]];
            assert_eq!(at(&stretch, &[i, j, k, step]).is_finite(), mask[n] > 0.5);
            if mask[n] > 0.5 {
                stretches.push(at(&stretch, &[i, j, k, step]));
                sum += at(&sensitivity, &[i, j, k, step]);
            }
        }
        stretches.sort_by(f64::total_cmp);
        let middle = [stretches[(num_voxels - 1) / 2], stretches[num_voxels / 2]];
        assert_eq!(0.5 * (middle[0] + middle[1]), expected["median_stretch"].as_f64().unwrap());
        // The same numbers added in another order.
        let expected = expected["integrated_sensitivity"][0]["sum"].as_f64().unwrap();
        assert!((sum - expected).abs() < 1e-10 * expected.abs(), "{sum} and {expected}");
    }
    let (_, times) = array(&File::open(place("solution.vtkhdf")).unwrap(), "VTKHDF/Steps/Values");
    assert_eq!(times, [2.0, 4.0]);
}

/// A recording is written, comes back by the import, and is calibrated; images and arrays hold the same.
#[test]
fn recordings_and_calibrations_are_the_same_in_all_files() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let path = |name: &str| place(name).to_string_lossy().into_owned();
    let specimen = "geometries/two-hole-shear.json";
    let (scan, exported, back, fit) = (path("scan"), path("exported"), path("back"), path("fit"));
    let settings = ["--drive", "2.5,5", "--mesh", "2.5", "--voxel", "1.5,0.4,1.5", "--mm-per-radian", "0.1"];
    lambdak(&[&["scan", specimen, "--json", "--out", &scan][..], &settings].concat());
    let result = lambdak(&["export", "recording", &scan, "--json", "--out", &exported]);
    let files = ["recording.mat", "recording.h5", "recording-1.csv", "recording-2.csv"];
    assert_eq!(result["files"], serde_json::json!(files));
    let recording = Recording::read(Path::new(&scan), &ReadLimits::default()).unwrap();
    let file = File::open(place("exported/recording.h5")).unwrap();
    compare(&file, &variables(&place("exported/recording.mat")));
    let displacement = array(&file, "displacement_mm");
    let affine = array(&file, "affine");
    for (step, recorded) in recording.steps.iter().enumerate() {
        for (voxel, u) in recorded.displacement.iter().enumerate() {
            let indices = recording.grid.indices(voxel);
            let [i, j, k] = indices;
            let center = recording.grid.center_mm(voxel);
            for c in 0..3 {
                assert!(is_same(u[c], at(&displacement, &[i, j, k, c, step])));
                let position = indices.iter().enumerate().map(|(n, &index)| at(&affine, &[c, n]) * index as f64);
                // The same sum in another order.
                assert!((position.sum::<f64>() + at(&affine, &[c, 3]) - center[c]).abs() < 1e-12);
            }
        }
    }
    let mat = path("exported/recording.mat");
    lambdak(&["import", &mat, "--specimen", specimen, "--axes", "x,y,z", "--json", "--out", &back]);
    let again = Recording::read(Path::new(&back), &ReadLimits::default()).unwrap();
    assert_eq!(again.num_voxels(), recording.num_voxels());
    for (one, other) in recording.steps.iter().zip(&again.steps) {
        assert_eq!(one.drive_mm, other.drive_mm);
        let within = |r: &Recording, s: &lambdak::recording::RecordedStep| -> Vec<[f64; 3]> {
            s.displacement.iter().zip(&r.mask).filter(|(_, m)| **m).map(|(u, _)| *u).collect()
        };
        for (u, v) in within(&recording, one).iter().zip(&within(&again, other)) {
            assert!((0..3).all(|c| is_same(u[c], v[c])), "{u:?} and {v:?}");
        }
    }
    let options = ["--terms", "1", "--mesh", "2.5", "--one-mesh", "--arrays", "mat,hdf5"];
    let result = lambdak(&[&["calibrate", &scan, "--json", "--out", &fit][..], &options].concat());
    let file = File::open(place("fit/calibration.h5")).unwrap();
    compare(&file, &variables(&place("fit/calibration.mat")));
    let (covariance, sd) = (array(&file, "covariance"), array(&file, "sd"));
    for (n, parameter) in result["parameters"].as_array().unwrap().iter().enumerate() {
        let of_parameter = at(&covariance, &[n, n]).sqrt();
        // A square and its root.
        assert!(is_same(of_parameter, sd.1[n]) || (of_parameter - sd.1[n]).abs() < 1e-12 * sd.1[n]);
        if parameter["identifiable"] == true {
            assert_eq!(array(&file, "value").1[n], parameter["value"].as_f64().unwrap());
            assert_eq!(sd.1[n], parameter["sd"].as_f64().unwrap());
        }
    }
    let [measured, model, misfit] =
        ["measured_mm", "model_mm", "misfit_mm"].map(|n| array(&file, &format!("recording_1/{n}")));
    let differences = measured.1.iter().zip(&model.1).map(|(u, m)| u - m);
    assert!(differences.zip(&misfit.1).all(|(d, r)| is_same(d, *r)));
    assert!(misfit.1.iter().any(|r| r.is_finite()));
}
