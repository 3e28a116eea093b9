//! What some tests need of the machine: a database, a scheduler, data that are no part of the project.
//!
//! A test without its prerequisite is reported as ignored, with the reason. `LAMBDAK_REQUIRE` names prerequisites,
//! separated by commas ([`Prerequisite::name`]), that must be there: without one of those the test fails. The standard
//! harness cannot ignore a test that runs already, so these tests' binaries bring their own (`harness = false`), which
//! takes the same options, runs the tests in parallel and prints the same lines.

#![allow(dead_code)] // Each test binary uses a part.

use libtest_mimic::{Arguments, Completion, Failed, Trial};
use std::path::PathBuf;
use std::process::{Command, ExitCode};

/// What a test may need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Prerequisite {
    /// A server at `LAMBDAK_TEST_DATABASE_URL` on which databases may be made.
    Postgres,
    /// A Slurm that answers (`.ci/slurm` starts one).
    Slurm,
    /// The synthetic recordings of an independent code, in the folder `LAMBDAK_RECORDINGS`.
    Recordings,
    /// Published measurements, in the folder `LAMBDAK_REAL_DATA`.
    RealData,
    /// `python3`.
    Python,
    /// The right to mount a small file system.
    Mount,
    /// CalculiX (`ccx`).
    Calculix,
    /// Leave to open some 1,400 files in a process.
    OpenFiles,
}

impl Prerequisite {
    const ALL: [Prerequisite; 8] = [
        Prerequisite::Postgres,
        Prerequisite::Slurm,
        Prerequisite::Recordings,
        Prerequisite::RealData,
        Prerequisite::Python,
        Prerequisite::Mount,
        Prerequisite::OpenFiles,
        Prerequisite::Calculix,
    ];

    /// Its name in `LAMBDAK_REQUIRE`.
    pub fn name(self) -> &'static str {
        match self {
            Prerequisite::Postgres => "postgres",
            Prerequisite::Slurm => "slurm",
            Prerequisite::Recordings => "recordings",
            Prerequisite::RealData => "real-data",
            Prerequisite::Python => "python",
            Prerequisite::Mount => "mount",
            Prerequisite::OpenFiles => "open-files",
            Prerequisite::Calculix => "calculix",
        }
    }
}

/// A prerequisite that is not there, and how one sees that.
#[derive(Debug)]
pub struct Missing {
    prerequisite: Prerequisite,
    reason: String,
}

impl Missing {
    /// For `return Err(…)`.
    pub fn new(prerequisite: Prerequisite, reason: impl Into<String>) -> Missing {
        Missing { prerequisite, reason: reason.into() }
    }
}

/// What a test function gives back: nothing, or the prerequisite that it lacks.
pub trait Tested {
    /// The prerequisite that was missing, if any.
    fn into_result(self) -> Result<(), Missing>;
}

impl Tested for () {
    fn into_result(self) -> Result<(), Missing> {
        Ok(())
    }
}

impl Tested for Result<(), Missing> {
    fn into_result(self) -> Result<(), Missing> {
        self
    }
}

/// The prerequisites of `LAMBDAK_REQUIRE`. A name that is none is an error: it would require nothing.
fn required() -> Vec<Prerequisite> {
    let list = std::env::var("LAMBDAK_REQUIRE").unwrap_or_default();
    let names = list.split(',').map(str::trim).filter(|name| !name.is_empty());
    names
        .map(|name| {
            let found = Prerequisite::ALL.into_iter().find(|p| p.name() == name);
            found.unwrap_or_else(|| {
                let known = Prerequisite::ALL.map(Prerequisite::name).join(", ");
                panic!("LAMBDAK_REQUIRE has '{name}'; known are {known}")
            })
        })
        .collect()
}

/// A test of the harness.
pub fn trial<T: Tested + 'static>(name: &str, test: fn() -> T) -> Trial {
    Trial::ignorable_test(name, move || match test().into_result() {
        Ok(()) => Ok(Completion::Completed),
        Err(missing) if required().contains(&missing.prerequisite) => {
            Err(Failed::from(format!("{} is required: {}", missing.prerequisite.name(), missing.reason)))
        }
        Err(missing) => Ok(Completion::ignored_with(missing.reason)),
    })
}

/// Runs a binary's tests.
pub fn run(tests: Vec<Trial>) -> ExitCode {
    required();
    libtest_mimic::run(&Arguments::from_args(), tests).exit_code()
}

/// The `main` of a test binary: runs these functions, which return nothing or `Result<(), Missing>`.
macro_rules! test_binary {
    ($($test:ident),+ $(,)?) => {
        fn main() -> std::process::ExitCode {
            prerequisites::run(vec![$(prerequisites::trial(stringify!($test), $test)),+])
        }
    };
}
pub(crate) use test_binary;

/// Address of the PostgreSQL server for tests.
pub fn postgres() -> Result<String, Missing> {
    std::env::var("LAMBDAK_TEST_DATABASE_URL")
        .map_err(|_| Missing::new(Prerequisite::Postgres, "LAMBDAK_TEST_DATABASE_URL names no PostgreSQL server"))
}

/// Ok where a Slurm answers.
pub fn slurm() -> Result<(), Missing> {
    let answers = Command::new("sinfo").arg("-h").output().is_ok_and(|o| o.status.success());
    if answers && Command::new("sbatch").arg("--version").output().is_ok() {
        return Ok(());
    }
    Err(Missing::new(Prerequisite::Slurm, "no Slurm answers on this machine (.ci/slurm starts one)"))
}

/// Ok where `python3` runs.
pub fn python() -> Result<(), Missing> {
    if Command::new("python3").arg("--version").output().is_ok_and(|o| o.status.success()) {
        return Ok(());
    }
    Err(Missing::new(Prerequisite::Python, "python3 does not run"))
}

/// Ok where `ccx` runs.
pub fn calculix() -> Result<(), Missing> {
    if Command::new("ccx").arg("-v").output().is_ok() {
        return Ok(());
    }
    Err(Missing::new(Prerequisite::Calculix, "ccx does not run (Debian: apt-get install calculix-ccx)"))
}

/// A recording of the independent code.
pub fn recording(name: &str) -> Result<PathBuf, Missing> {
    folder("LAMBDAK_RECORDINGS", Prerequisite::Recordings, name)
}

/// A folder of the published measurements.
pub fn real_data(name: &str) -> Result<PathBuf, Missing> {
    folder("LAMBDAK_REAL_DATA", Prerequisite::RealData, name)
}

fn folder(variable: &str, prerequisite: Prerequisite, name: &str) -> Result<PathBuf, Missing> {
    let found = std::env::var_os(variable).map(|root| PathBuf::from(root).join(name)).filter(|path| path.is_dir());
    found.ok_or_else(|| Missing::new(prerequisite, format!("{variable} does not name a folder with {name}")))
}
