//! `lambdak uniaxial` and `lambdak curves` as a user runs them.

use lambdak::homogeneous::{CurveLaw, Deformation, HomogeneousTest, ShearTerm, incompressible_stress};
use lambdak::material::{Gent, InvariantLaw, Material};
use std::path::Path;
use std::process::{Command, Output};

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lambdak")).current_dir(folder).args(arguments).output().unwrap()
}

/// A curve file of a two-term material with a ripple of 0.2 % in place of noise.
fn write_curve(folder: &Path, name: &str, test: HomogeneousTest, end: f64) {
    let terms = [ShearTerm { modulus_kpa: 3.0, alpha: 6.0 }, ShearTerm { modulus_kpa: 28.0, alpha: 1.6 }];
    let mut text = String::from("stretch,nominal_stress_kpa\n");
    for i in 1..=40 {
        let drive = test.rest() + (end - test.rest()) * f64::from(i) / 40.0;
        let ripple = 1.0 + 0.002 * (7.3 * f64::from(i) * f64::from(i)).sin();
        text += &format!("{drive},{}\n", ripple * incompressible_stress(&terms, &test.at(drive)));
    }
    std::fs::write(folder.join(name), text).unwrap();
}

#[test]
fn uniaxial_fits_print_and_write() {
    let folder = tempfile::tempdir().unwrap();
    write_curve(folder.path(), "ut.csv", HomogeneousTest::Uniaxial, 2.5);
    let text = run(folder.path(), &["uniaxial", "ut.csv"]);
    assert!(text.status.success(), "{}", String::from_utf8_lossy(&text.stderr));
    let shown = String::from_utf8_lossy(&text.stdout);
    assert!(shown.contains("free terms") && shown.contains("neo-Hookean") && shown.contains("chosen"), "{shown}");
    for file in ["uniaxial.json", "fits.svg", "fits-neo-hookean.svg"] {
        assert!(folder.path().join("results/ut/uniaxial").join(file).is_file(), "{file}");
    }
    let json = run(folder.path(), &["uniaxial", "ut.csv", "--json"]);
    let value: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(value["schema"], "uniaxial/1");
    let modulus = value["initial_shear_modulus_kpa"]["value"].as_f64().unwrap();
    // ½ (3 + 28) kPa, with a ripple of 0.2 %.
    assert!((modulus / 15.5 - 1.0).abs() < 0.02, "{modulus}");
}

#[test]
fn curves_predict_what_is_kept_back() {
    let folder = tempfile::tempdir().unwrap();
    write_curve(folder.path(), "ut.csv", HomogeneousTest::Uniaxial, 2.5);
    write_curve(folder.path(), "et.csv", HomogeneousTest::Equibiaxial, 1.7);
    write_curve(folder.path(), "ps.csv", HomogeneousTest::PureShear, 2.2);
    let arguments =
        ["curves", "uniaxial=ut.csv", "equibiaxial=et.csv", "pure-shear=ps.csv", "--keep-back", "equibiaxial"];
    let text = run(folder.path(), &arguments);
    assert!(text.status.success(), "{}", String::from_utf8_lossy(&text.stderr));
    assert!(String::from_utf8_lossy(&text.stdout).contains("predicted, kept back: equibiaxial"));
    assert!(folder.path().join("results/ut/curves/curves.svg").is_file());
    let json = run(folder.path(), &[&arguments[..], &["--json"]].concat());
    let value: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!((value["schema"].as_str(), value["num_terms"].as_u64()), (Some("curves/1"), Some(2)));
    // The ripple is 0.14 % rms.
    assert!(value["kept_back"][0]["relative_rms_error"].as_f64().unwrap() < 0.01);
}

/// A file with a preamble, units in brackets, decimal commas, an empty cell and a way back: all of that is said, the
/// first branch alone is fitted, and `material.json` is the fit.
#[test]
fn what_was_read_and_left_out_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let terms = [ShearTerm { modulus_kpa: 28.0, alpha: 2.0 }];
    let row = |stretch: f64, part: f64| {
        let stress = part * incompressible_stress(&terms, &HomogeneousTest::Uniaxial.at(stretch));
        format!("{};{}\n", 100.0 * (stretch - 1.0), stress / 1e3).replace('.', ",")
    };
    let mut text = String::from("Probe;A 7\nDicke;2,0\nDehnung [%];Spannung [MPa]\n");
    text += &(0..=40).map(|i| row(1.0 + 0.025 * f64::from(i), 1.0)).collect::<String>();
    text += "101;\n";
    text += &(0..40).rev().map(|i| row(1.0 + 0.025 * f64::from(i), 0.8)).collect::<String>();
    std::fs::write(folder.path().join("zug.csv"), text).unwrap();
    let output = run(folder.path(), &["uniaxial", "zug.csv", "--terms", "1"]);
    let shown = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for words in [
        "Spannung [MPa] over Dehnung [%], 41 rows",
        "2 lines before the header skipped",
        "1 rows without a number left out",
        "turns at 2.000: 40 rows",
        "material.json holds a bulk modulus of",
    ] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    let written = std::fs::read_to_string(folder.path().join("results/zug/uniaxial/material.json")).unwrap();
    let material = Material::from_json(&written).unwrap();
    // Half of 28 kPa, from numbers with all their digits.
    assert!((material.initial_shear_modulus_kpa() - 14.0).abs() < 1e-3, "{written}");
    assert!((material.bulk_kpa - 14e3).abs() < 1.0, "{written}");
    // Both ways together lie between.
    let both = run(folder.path(), &["uniaxial", "zug.csv", "--terms", "1", "--all-branches", "--json"]);
    let value: serde_json::Value = serde_json::from_slice(&both.stdout).unwrap();
    let modulus = value["initial_shear_modulus_kpa"]["value"].as_f64().unwrap();
    assert!(modulus > 11.2 && modulus < 13.9, "{modulus}");
    assert_eq!(value["files"][0]["num_rows"], 81);
}

/// Curves of a Gent material: its law is fitted, predicts what is kept back, is told to be the best, and its material
/// is one that other programs read.
#[test]
fn laws_are_fitted_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    let law = InvariantLaw::Gent(Gent { mu_kpa: 16.0, limit: 6.0 });
    for (name, test, end) in [
        ("ut.csv", HomogeneousTest::Uniaxial, 2.5),
        ("et.csv", HomogeneousTest::Equibiaxial, 1.7),
        ("ps.csv", HomogeneousTest::PureShear, 2.2),
    ] {
        let mut text = String::from("stretch,nominal_stress_kpa\n");
        for i in 1..=40 {
            let drive = 1.0 + (end - 1.0) * f64::from(i) / 40.0;
            let ripple = 1.0 + 0.002 * (7.3 * f64::from(i) * f64::from(i)).sin();
            text += &format!("{drive},{}\n", ripple * law.incompressible_stress(&test.at(drive)));
        }
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let tests = ["uniaxial=ut.csv", "equibiaxial=et.csv", "pure-shear=ps.csv", "--keep-back", "equibiaxial"];
    let json = run(folder.path(), &[&["curves"], &tests[..], &["--law", "gent", "--json", "--out", "gent"]].concat());
    assert!(json.status.success(), "{}", String::from_utf8_lossy(&json.stderr));
    let value: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!((value["law"].as_str(), value["num_terms"].as_u64()), (Some("gent"), Some(0)));
    for (index, (name, truth)) in [("mu", 16.0), ("j_m", 6.0)].into_iter().enumerate() {
        let found = &value["parameters"][index];
        assert_eq!(found["name"], name);
        // The ripple is 0.14 % rms.
        assert!((found["value"].as_f64().unwrap() / truth - 1.0).abs() < 0.005, "{found}");
    }
    assert!(value["kept_back"][0]["relative_rms_error"].as_f64().unwrap() < 0.01);
    assert_eq!(
        (&value["laws"]["laws"][0]["name"], &value["laws"]["laws"][0]["num_parameters"]),
        (&"Gent".into(), &2.into())
    );
    let material = std::fs::read_to_string(folder.path().join("gent/material.json")).unwrap();
    assert!(material.contains("gent/1") && folder.path().join("gent/laws.svg").is_file(), "{material}");
    let cards =
        run(folder.path(), &["export", "material", "gent/material.json", "--format", "febio", "--out", "cards"]);
    assert!(cards.status.success(), "{}", String::from_utf8_lossy(&cards.stderr));
    let ogden = run(folder.path(), &[&["curves"], &tests[..], &["--terms", "1"]].concat());
    let shown = String::from_utf8_lossy(&ogden.stdout).into_owned();
    assert!(
        shown.contains("Gent (2 parameters) describes the curves better than Ogden, 1 term (2 parameters)"),
        "{shown}"
    );
    let uniaxial = run(folder.path(), &["uniaxial", "ut.csv", "--law", "gent"]);
    let shown = String::from_utf8_lossy(&uniaxial.stdout).into_owned();
    assert!(
        shown.contains("law of Gent") && shown.contains("no law describes the curves better than Gent ("),
        "{shown}"
    );
    let refused = run(folder.path(), &[&["curves"], &tests[..], &["--law", "gent", "--exact"]].concat());
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(said.contains("--exact") && said.contains("the law of Gent has no terms"), "{said}");
}

/// A law in the first invariant is written for the programs that have it; another program is refused by name.
#[test]
fn laws_are_exported_to_the_programs_that_have_them() {
    let folder = tempfile::tempdir().unwrap();
    let gent = r#"{ "schema": "gent/1", "bulk_kpa": 2000.0, "mu_kpa": 16.0, "j_m": 30.0 }"#;
    std::fs::write(folder.path().join("gent.json"), gent).unwrap();
    let text = run(folder.path(), &["export", "material", "gent.json", "--out", "cards"]);
    assert!(text.status.success(), "{}", String::from_utf8_lossy(&text.stderr));
    let cards = folder.path().join("cards");
    let files = ["material-ansys.inp", "material-comsol.txt", "material-febio.xml"];
    assert!(files.iter().all(|file| cards.join(file).is_file()));
    assert!(!cards.join("material-abaqus.inp").exists() && !cards.join("material-calculix.inp").exists());
    let ansys = std::fs::read_to_string(cards.join(files[0])).unwrap();
    // MPa: 16 kPa, and 2/κ.
    assert!(ansys.ends_with("TB,HYPER,1,1,,GENT\nTBDATA,1,1.6e-2,3.0e1,1.0e0\n"), "{ansys}");
    let refused = run(folder.path(), &["export", "material", "gent.json", "--format", "abaqus"]);
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(said.contains("Abaqus has no law of Gent; write the material for Ansys, COMSOL, FEBio"), "{said}");
}

#[test]
fn bad_input_ends_with_code_two_and_says_why() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.csv"), "a,b\n1,2\n").unwrap();
    std::fs::write(folder.path().join("unit.csv"), "stretch,p11\n1,0\n1.2,3\n").unwrap();
    std::fs::write(folder.path().join("binary.csv"), b"strain;stress_kpa\n0,1;2\n\xff\0").unwrap();
    std::fs::write(folder.path().join("soft.json"), r#"{ "schema": "material/1", "terms": [] }"#).unwrap();
    for (arguments, words) in [
        (vec!["uniaxial", "nowhere.csv"], "cannot read"),
        (vec!["uniaxial", "bad.csv"], "no column"),
        (vec!["uniaxial", "unit.csv"], "unit"),
        (vec!["uniaxial", "binary.csv"], "not text"),
        (
            vec!["export", "material", "soft.json"],
            r#"it must be "ogden/1" or "neo_hookean/1" or "mooney_rivlin/1" or "yeoh/1" or "gent/1" or "arruda_boyce/1""#,
        ),
        (vec!["curves", "twist=bad.csv"], "twist"),
        (vec!["curves", "unit.csv"], "TEST=FILE"),
    ] {
        let out = run(folder.path(), &arguments);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(said.contains(words), "{arguments:?}: {said}");
    }
}

/// Stretches and stresses of a biaxial test there and back, with a ripple of 0.2 % in place of noise; the way back has
/// a tenth less stress.
fn write_biaxial(folder: &Path, name: &str, header: &str, ratio: f64) {
    let terms = [ShearTerm { modulus_kpa: 3.0, alpha: 6.0 }, ShearTerm { modulus_kpa: 28.0, alpha: 1.6 }];
    let mut text = format!("{header}\n");
    for i in (1..=40).chain((10..40).rev()).enumerate().map(|(n, i)| (f64::from(i), if n < 40 { 1.0 } else { 0.9 })) {
        let (i, part) = i;
        let ripple = part * (1.0 + 0.002 * (7.3 * i * i).sin());
        let [a, b] = [1.0 + 0.8 * i / 40.0, 1.0 + 0.8 * ratio * i / 40.0];
        let stress = |stretches| ripple * incompressible_stress(&terms, &Deformation::Biaxial { stretches });
        text += &format!("{a};{b};{};{}\n", stress([a, b]), stress([b, a]));
    }
    std::fs::write(folder.join(name), text).unwrap();
}

/// Biaxial tests with both stresses and with one are fitted, one is kept back by its name; what was read, the way back
/// and both stresses of each file are said and drawn, and the material is one that other programs read.
#[test]
fn biaxial_tests_are_fitted() {
    let folder = tempfile::tempdir().unwrap();
    write_biaxial(folder.path(), "equal.csv", "lambda_x;lambda_y;P_x [kPa];P_y [kPa]", 1.0);
    write_biaxial(folder.path(), "half.csv", "stretch_1;stretch_2;stress_1_kpa;stress_2_kpa", 0.5);
    write_biaxial(folder.path(), "held.csv", "F11;F22;unused;P22 [kPa]", 0.0);
    let tests = ["curves", "biaxial=equal.csv", "biaxial=half.csv", "biaxial=held.csv", "--keep-back", "held"];
    let text = run(folder.path(), &[&tests[..], &["--out", "fit"]].concat());
    let shown = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(text.status.success(), "{}", String::from_utf8_lossy(&text.stderr));
    for words in [
        "equal: P_x [kPa] and P_y [kPa] over lambda_x and lambda_y, 40 rows",
        "held: P22 [kPa] over F11 and F22, 40 rows",
        "the test turns at 1.800: 30 rows after that are left out",
        "biaxial equal P2",
        "biaxial half P1",
        "predicted, kept back: biaxial held P2",
    ] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    let picture = std::fs::read_to_string(folder.path().join("fit/curves.svg")).unwrap();
    assert!(picture.contains("biaxial held P2 over λ1"), "{picture}");
    let export =
        run(folder.path(), &["export", "material", "fit/material.json", "--format", "abaqus", "--out", "cards"]);
    assert!(export.status.success(), "{}", String::from_utf8_lossy(&export.stderr));
    let json = run(folder.path(), &[&tests[..], &["--json"]].concat());
    let value: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!((&value["num_terms"], &value["fits"]["selection"]["num_data"]), (&2.into(), &160.into()));
    assert_eq!(value["files"][0]["second_stress_column"], "P_y [kPa]");
    assert_eq!(value["files"][2].get("second_stress_column"), None);
    // The ripple is 0.14 % rms.
    for (parameter, truth) in value["parameters"].as_array().unwrap().iter().zip([0.5, 6.0, 17.5, 1.6]) {
        let [low, high] = [0, 1].map(|end| parameter["interval_95"][end].as_f64().unwrap());
        assert!(low <= truth && truth <= high && high - low < 0.2 * truth, "{truth}: {parameter}");
    }
    assert!(value["kept_back"][0]["relative_rms_error"].as_f64().unwrap() < 0.01);
    // A compressible material of the same files.
    let held = run(folder.path(), &[&tests[..], &["--bulk", "500", "--law", "gent", "--json"]].concat());
    let value: serde_json::Value = serde_json::from_slice(&held.stdout).unwrap();
    assert_eq!((&value["material"]["bulk_kpa"], &value["is_bulk_held"]), (&500.0.into(), &true.into()));
}

/// Columns by number, columns of the second axis, signs: what is asked for is done, and what cannot be is refused with
/// the options that change it.
#[test]
fn columns_and_signs_are_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let rows = |turned: f64| {
        let of = |i: i32| 1.0 - 0.02 * f64::from(i);
        let row = |l: f64| format!("{l},{},7\n", turned * 14.0 * (l - l.powi(-2)));
        (1..20).map(of).map(row).collect::<String>()
    };
    std::fs::write(folder.path().join("down.csv"), format!("stretch,stress_kpa,stress_kpa\n{}", rows(-1.0))).unwrap();
    let refused = |arguments: &[&str], words: &[&str]| {
        let out = run(folder.path(), arguments);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(words.iter().all(|w| said.contains(w)), "{arguments:?}: {said}");
    };
    let number = ["--stress-column", "2"];
    refused(&["curves", "uniaxial=down.csv"], &["2 \"stress_kpa\", 3 \"stress_kpa\"", "number"]);
    let by_number = [&["curves", "uniaxial=down.csv"], &number[..]].concat();
    refused(&by_number, &["negative", "turn the sign", "--turned"]);
    refused(&[&["uniaxial", "down.csv"], &number[..]].concat(), &["negative", "--turned"]);
    refused(&[&by_number[..], &["--turned", "both"]].concat(), &["stretches, which are positive"]);
    let text = run(folder.path(), &[&by_number[..], &["--turned", "stress", "--terms", "1", "--json"]].concat());
    let value: serde_json::Value = serde_json::from_slice(&text.stdout).unwrap();
    assert!((value["initial_shear_modulus_kpa"]["value"].as_f64().unwrap() / 14.0 - 1.0).abs() < 1e-3, "{value}");
    refused(&["curves", "uniaxial=down.csv", "--second-area", "3"], &["no test is biaxial"]);
    refused(&["curves", "uniaxial=down.csv", "--keep-back", "up"], &["'up' is neither a test nor the name of a file"]);
    refused(&["curves", "biaxial=down.csv"], &["no column for the stretch"]);
    refused(&["diagnose", "--curve", "biaxial=down.csv"], &["a test with one drive"]);
}

/// The same file in UTF-8, Latin-1 and UTF-16 of either byte order is the same curve.
#[test]
fn files_of_older_programs_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let rows =
        (1..=8).map(|i| 0.1 * f64::from(i)).map(|e| format!("{};{}\n", 2e4 * e, 17.0 * (1.0 + e - (1.0 + e).powi(-2))));
    let text = format!("Prüfer;A\nVerlängerung [µm];Spannung [kPa]\n{}", rows.collect::<String>());
    let utf16 = |bytes: fn(u16) -> [u8; 2]| format!("\u{feff}{text}").encode_utf16().flat_map(bytes).collect();
    let files: [Vec<u8>; 4] = [
        text.clone().into_bytes(),
        text.chars().map(|c| u8::try_from(c).unwrap()).collect(),
        utf16(u16::to_le_bytes),
        utf16(u16::to_be_bytes),
    ];
    let fits = files.map(|bytes| {
        std::fs::write(folder.path().join("curve.csv"), bytes).unwrap();
        let out = run(folder.path(), &["uniaxial", "curve.csv", "--length", "20", "--terms", "1", "--json"]);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let fit: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        (fit["files"].to_string(), fit["parameters"].to_string())
    });
    assert!(fits[0].0.contains("Verlängerung [µm]") && fits[0].1.contains("alpha_1"), "{:?}", fits[0]);
    assert!(fits.iter().all(|fit| *fit == fits[0]));
}

/// Stress of a neo-Hookean strip with one relaxation, at two rates: the command names it and predicts the third rate.
#[test]
fn load_curves_alone_are_diagnosed() {
    let folder = tempfile::tempdir().unwrap();
    let mut arguments = vec!["diagnose".to_string(), "--json".into(), "--keep-back".into(), "rate-3".into()];
    for (name, rate) in [("rate-1", 0.01), ("rate-2", 0.1), ("rate-3", 0.03)] {
        let mut text = String::from("time_s,stretch,nominal_stress_kpa\n");
        let (mut memory, mut last) = (0.0, 0.0);
        for n in 0..=120 {
            // Up to a stretch of 1.6 and back.
            let strain = 0.01 * if n <= 60 { f64::from(n) } else { f64::from(120 - n) };
            let (stretch, dt) = (1.0 + strain, 0.01 / rate);
            let elastic = 20.0 * (stretch - stretch.powi(-2));
            // Fung's model, g = 0.5, τ = 5 s, by the midpoint rule.
            memory = memory * (-dt / 5.0f64).exp() + (elastic - last) * (-0.5 * dt / 5.0f64).exp();
            last = elastic;
            text += &format!("{},{stretch},{}\n", f64::from(n) * dt, elastic + 0.5 * memory);
        }
        let path = folder.path().join(format!("{name}.csv"));
        std::fs::write(&path, text).unwrap();
        arguments.extend(["--curve".into(), format!("uniaxial={}", path.display())]);
    }
    let out = std::process::Command::new(env!("CARGO_BIN_EXE_lambdak")).args(&arguments).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let result: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(result["causes"][0]["name"], "relaxation", "{result}");
    let [before, after] =
        ["before", "after"].map(|k| result["kept_back"][0][k]["relative_rms_error"].as_f64().unwrap());
    assert!(after < 0.2 * before, "{before} {after}");
}
