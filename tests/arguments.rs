//! Arguments are checked before work starts: nonsense is exit code 2 with the option's name and range, and takes no
//! time.

use std::path::Path;
use std::process::{Command, Output};

fn lambdak(arguments: &[&str]) -> Output {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scratch = tempfile::tempdir().unwrap();
    let out = scratch.path().join("out");
    let mut command = Command::new(env!("CARGO_BIN_EXE_lambdak"));
    command.current_dir(root).args(arguments);
    if arguments[0] != "compare" {
        command.arg("--out").arg(out);
    }
    command.output().unwrap()
}

/// A recording folder that is never read: options are checked before.
const RECORDING: &str = "tests/data";
const TWO_HOLE: &str = "geometries/two-hole-shear.json";

#[test]
fn nonsense_is_refused_with_the_options_name_and_range() {
    let cases: &[(&[&str], &[&str])] = &[
        (&["calibrate", RECORDING, "--beta", "nan"], &["--beta", "nan", "a number"]),
        (&["calibrate", RECORDING, "--beta", "-1"], &["--beta", "-1", "from 0 to"]),
        (&["calibrate", RECORDING, "--starts", "0"], &["--starts", "0", "from 1 to 20"]),
        (&["calibrate", RECORDING, "--starts", "1e9"], &["--starts", "1e9", "from 1 to 20"]),
        (&["calibrate", RECORDING, "--terms", "6"], &["--terms", "6", "from 1 to 5"]),
        (&["calibrate", RECORDING, "--terms", "many"], &["--terms", "many"]),
        (&["calibrate", RECORDING, "--decrement", "inf"], &["--decrement", "inf"]),
        (&["calibrate", RECORDING, "--mesh", "9"], &["--mesh", "9", "0.2 to 5"]),
        (&["calibrate", RECORDING, "--end-margin", "-3"], &["--end-margin", "-3", "from 0 to"]),
        (&["calibrate", RECORDING, "--rule", "coin"], &["--rule", "coin", "bic"]),
        (&["diagnose", RECORDING, "--allowance", "nan"], &["--allowance", "nan"]),
        (&["diagnose", RECORDING, "--mesh", "5", "--allowance", "1e9"], &["--allowance", "1000000000", "from"]),
        (&["diagnose", RECORDING, "--mesh", "0.1"], &["--mesh", "0.1", "from 0.3 to 5"]),
        (&["diagnose", RECORDING, "--max-causes", "0"], &["--max-causes", "0", "from 1 to 20"]),
        (&["solve", TWO_HOLE, "--drive", "5,nan"], &["--drive", "nan"]),
        (&["solve", TWO_HOLE, "--drive", "5,4"], &["--drive", "4"]),
        (&["solve", TWO_HOLE, "--mesh", "coarse"], &["--mesh", "coarse", "search, standard, fine"]),
        (&["solve", TWO_HOLE, "--threads", "0"], &["--threads", "0", "from 1 to 1024"]),
        (&["evaluate", TWO_HOLE, "--voxel", "0,1,1"], &["--voxel", "0"]),
        (&["evaluate", TWO_HOLE, "--voxel", "1,1"], &["--voxel", "1,1", "3"]),
        (&["evaluate", TWO_HOLE, "--noise", "-1"], &["--noise", "-1"]),
        (&["evaluate", TWO_HOLE, "--force-sd", "0"], &["--force-sd", "0"]),
        (&["evaluate", TWO_HOLE, "--median-stretch", "0.9"], &["--median-stretch", "0.9", "above 1"]),
        (&["evaluate", TWO_HOLE, "--median-stretch", "1.2", "--drive", "5"], &["--median-stretch", "drive_mm"]),
        (&["scan", TWO_HOLE, "--snr", "-5"], &["--snr", "-5", "above 0"]),
        (&["scan", TWO_HOLE, "--snr", "5", "--noise", "0.1"], &["--snr", "noise_sd_mm"]),
        (&["scan", TWO_HOLE, "--kspace", "1.5"], &["--kspace", "1.5"]),
        (&["scan", TWO_HOLE, "--offset", "2"], &["--offset", "2", "from -1 to 1"]),
        (&["scan", TWO_HOLE, "--raw", "--filter", "hamming2"], &["--filter", "hamming2"]),
        (&["scan", TWO_HOLE, "--force-sd", "-1"], &["--force-sd", "-1"]),
        (&["paper-tables", "--mesh", "0"], &["--mesh", "0", "from 0.2 to 5"]),
        (&["paper-tables", "--dumbbell-noise", "0.9"], &["--dumbbell-noise", "0.9", "from 0 to 0.5"]),
        (&["prove-diagnosis", "--mesh", "nan"], &["--mesh", "nan"]),
        (&["prove-diagnosis", "--only", "gremlins"], &["--only", "gremlins"]),
        (&["design", "geometries/studies/two-hole-shear.json", "--time-limit", "-1"], &["--time-limit", "-1"]),
        (&["curves", "uniaxial"], &["curves", "TEST=FILE"]),
        (&["compare", TWO_HOLE, TWO_HOLE, "--rel-tol", "nan"], &["--rel-tol", "nan"]),
    ];
    for (arguments, expected) in cases {
        let output = lambdak(arguments);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        for part in *expected {
            assert!(text.contains(part), "{arguments:?}: {part:?} is not in {text:?}");
        }
    }
}

#[test]
fn all_that_is_wrong_is_said_at_once() {
    let output = lambdak(&["calibrate", RECORDING, "--starts", "0", "--beta", "-1", "--mesh", "2"]);
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("--starts") && text.contains("--beta"), "{text}");
}

#[test]
#[cfg(unix)]
fn inputs_that_are_no_regular_files_are_refused() {
    let scratch = tempfile::tempdir().unwrap();
    let pipe = scratch.path().join("pipe.json");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for path in [pipe.to_str().unwrap(), "/dev/zero", "geometries"] {
        for command in ["solve", "design", "uniaxial"] {
            let output = lambdak(&[command, path]);
            assert_eq!(output.status.code(), Some(2), "{command} {path}: {}", String::from_utf8_lossy(&output.stderr));
        }
    }
}

/// Two commands of one input have folders of their own, and a folder of one is not taken by another.
#[test]
fn results_of_commands_do_not_replace_each_other() {
    let scratch = tempfile::tempdir().unwrap();
    let program = env!("CARGO_BIN_EXE_lambdak");
    let specimen = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/solid-shear.json");
    let run = |arguments: &[&str]| {
        let output = Command::new(program)
            .current_dir(scratch.path())
            .arg(arguments[0])
            .arg(&specimen)
            .args(["--mesh", "5", "--drive", "1"])
            .args(&arguments[1..])
            .output()
            .unwrap();
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr),
        )
    };
    for (command, file) in [("solve", "solution.pvd"), ("evaluate", "solution.vtu")] {
        let (code, text) = run(&[command]);
        assert_eq!(code, Some(0), "{text}");
        assert!(text.contains(&format!("results/solid-shear/{command}")), "it is said where files are: {text}");
        assert!(scratch.path().join("results/solid-shear").join(command).join(file).is_file());
    }
    let (code, text) = run(&["evaluate", "--out", "results/solid-shear/solve"]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("holds the results of `lambdak solve`"), "{text}");
    let (code, text) = run(&["solve", "--full"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("replacing the results of an earlier solve with other inputs"), "{text}");
}

/// Fields at every drive make a series, each drive its own; too many are refused before any work.
#[test]
fn fields_are_a_series_over_the_drives() {
    let scratch = tempfile::tempdir().unwrap();
    let specimen = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries/solid-shear.json");
    let run = |drives: &str, more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lambdak"));
        command.current_dir(scratch.path()).args(["solve", "--mesh", "5", "--out", "out", "--drive", drives]);
        command.args(more).arg(&specimen).output().unwrap()
    };
    let read = |name: &str| std::fs::read_to_string(scratch.path().join("out").join(name));
    assert_eq!(run("1,2", &[]).status.code(), Some(0));
    let series = read("solution.pvd").unwrap();
    for (drive, name) in [(1, "solution_1.vtu"), (2, "solution_2.vtu")] {
        assert!(series.contains(&format!("timestep=\"{drive}\" part=\"0\" file=\"{name}\"")), "{series}");
    }
    assert_ne!(read("solution_1.vtu").unwrap(), read("solution_2.vtu").unwrap());
    assert_eq!(run("1,2", &["--fields", "last"]).status.code(), Some(0));
    assert!(read("solution_1.vtu").is_err() && read("solution_2.vtu").is_ok());
    let many: Vec<String> = (1..=101).map(|i| format!("{}", 0.01 * f64::from(i))).collect();
    let refused = run(&many.join(","), &[]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--fields"));
}
