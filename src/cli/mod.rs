//! The command. Nothing is computed here: arguments become one validated request, the library works, results are printed.
//!
//! Results on stdout (`--json` for machines), progress on stderr, files in a folder. Exit codes: 0 done, 1 worse
//! (`compare`), 2 bad input, 3 no solution found, 4 a file cannot be written, 130 stopped by Ctrl-C.

mod calibrate;
mod compare;
mod curve_input;
mod curve_tables;
mod curves;
mod design;
mod design_slurm;
mod diagnose;
mod diagnose_curves;
mod error;
mod evaluate;
mod import;
mod input;
mod interrupt;
mod output;
mod paper_tables;
mod progress;
mod prove;
mod scan;
mod serve;
mod slurm;
mod solve;
mod sweep;
mod task_bar;
mod uniaxial;
mod worker;

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;

pub use error::CliError;

/// Designs, verifies and diagnoses full-field experiments on soft materials.
#[derive(Parser)]
#[command(
    name = "lambdak",
    version,
    after_help = "Exit codes: 0 done, 1 worse (compare), 2 bad input, 3 no solution found, 4 a file cannot be written, 130 stopped by Ctrl-C."
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Forces and fields of a specimen at its drives, by finite elements.
    Solve(solve::SolveArguments),
    /// What a scan of a specimen would see, and what it would tell about the material.
    Evaluate(evaluate::EvaluateArguments),
    /// A synthetic MR-u recording of a specimen: phases with noise, unwrapped, and the loading history.
    Scan(scan::ScanArguments),
    /// Raw phases, MATLAB files or point clouds as a recording of displacements.
    Import(import::ImportArguments),
    /// The material, from recordings of a specimen, with its uncertainty.
    Calibrate(calibrate::CalibrateArguments),
    /// Tables like the paper's on synthetic stand-ins of its experiments.
    PaperTables(paper_tables::PaperTablesArguments),
    /// The best specimen under the limits of a study, with the evidence.
    Design(Box<design::DesignArguments>),
    /// Many designs evaluated: a table of what each would tell, on one machine or a cluster.
    Sweep(Box<sweep::SweepArguments>),
    /// Whether a result is the same as, better or worse than another one.
    Compare(compare::CompareArguments),
    /// Where a recording and its model differ, and what physics was left out.
    Diagnose(diagnose::DiagnoseArguments),
    /// Conceal causes in synthetic recordings and score the diagnosis on them.
    ProveDiagnosis(prove::ProveArguments),
    /// The traditional route: one uniaxial curve, of a strip or a dumb-bell, fitted with Ogden terms.
    Uniaxial(uniaxial::UniaxialArguments),
    /// Ogden terms fitted to curves of several homogeneous tests together.
    Curves(curves::CurvesArguments),
    /// The service: REST, jobs, and a page for planners.
    Serve(serve::ServeArguments),
    /// A worker of a service on PostgreSQL.
    Worker(worker::WorkerArguments),
}

/// What every command takes.
#[derive(Args)]
struct Common {
    /// Print the result as JSON on stdout (and write files only where --out says).
    #[arg(long)]
    json: bool,
    /// Folder for result files [default: results/NAME].
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Threads [default: one per core].
    #[arg(long)]
    threads: Option<usize>,
}

/// A specimen, its material and its mesh.
#[derive(Args)]
struct Subject {
    /// Specimen file (specimen/1).
    specimen: PathBuf,
    /// Material file (ogden/1) [default: Ecoflex 00-20].
    #[arg(long)]
    material: Option<PathBuf>,
    /// Drives in mm, comma-separated [default: the specimen's].
    #[arg(long, value_delimiter = ',')]
    drive: Vec<f64>,
    /// Element size: search, standard, fine, or a factor on standard (0.2 to 5).
    #[arg(long, default_value = "standard")]
    mesh: String,
    /// Mesh the whole specimen even where it has mirror planes.
    #[arg(long)]
    full: bool,
}

/// Runs the command line.
pub fn run() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version are not errors; a closed pipe while printing them is none either.
            let code = u8::try_from(error.exit_code()).unwrap_or(2);
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    // The service and its workers end gracefully by signals of their own.
    if !matches!(arguments.command, Command::Serve(_) | Command::Worker(_)) {
        interrupt::listen();
    }
    let result = match &arguments.command {
        Command::Solve(a) => solve::run(a),
        Command::Evaluate(a) => evaluate::run(a),
        Command::Scan(a) => scan::run(a),
        Command::Import(a) => import::run(a),
        Command::Calibrate(a) => calibrate::run(a),
        Command::PaperTables(a) => paper_tables::run(a),
        Command::Design(a) => design::run(a),
        Command::Sweep(a) => sweep::run(a),
        Command::Compare(a) => compare::run(a),
        Command::Diagnose(a) => diagnose::run(a),
        Command::ProveDiagnosis(a) => prove::run(a),
        Command::Uniaxial(a) => uniaxial::run(a),
        Command::Curves(a) => curves::run(a),
        Command::Serve(a) => serve::run(a),
        Command::Worker(a) => worker::run(a),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("lambdak: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// Starts the thread pool.
fn start_threads(common: &Common) -> Result<(), CliError> {
    start_thread_pool(common.threads)
}

/// Starts the thread pool with this many threads.
fn start_thread_pool(threads: Option<usize>) -> Result<(), CliError> {
    let Some(n) = threads else { return Ok(()) };
    if !(1..=1024).contains(&n) {
        return Err(CliError::Option { option: "threads", message: format!("{n} is not from 1 to 1024") });
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(n)
        .build_global()
        .map_err(|e| CliError::Option { option: "threads", message: e.to_string() })
}
