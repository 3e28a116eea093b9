//! The command. Nothing is computed here: arguments become one validated request, the library works, results are
//! printed.
//!
//! Results on stdout (`--json` for machines), progress on stderr, files in a folder. Exit codes: 0 done, 1 worse
//! (`compare`), 2 bad input, 3 no solution found, 4 a file cannot be written, 130 stopped by Ctrl-C.

mod commands;
mod compare;
mod design;
mod design_slurm;
mod error;
mod flag;
mod input;
mod interrupt;
mod job_command;
mod output;
mod results;
mod run;
#[cfg(feature = "service")]
mod serve;
mod slurm;
mod sweep;
mod task_bar;
mod terminal;
mod time_left;
#[cfg(feature = "service")]
mod worker;

use clap::{ArgMatches, Args, Command, FromArgMatches};
use std::path::PathBuf;
use std::process::ExitCode;

pub use error::CliError;

/// The command whose second word says what is written for other programs.
const EXPORT: &str = "export";

/// Name, version and exit codes.
fn program() -> Command {
    let codes = "Exit codes: 0 done, 1 worse (compare), 2 bad input, 3 no solution found, 4 a file cannot be written, \
                 130 stopped by Ctrl-C.";
    let program = Command::new("lambdak")
        .version(crate::provenance::VERSION)
        .about("Designs, verifies and diagnoses full-field experiments on soft materials")
        .after_help(codes)
        .subcommand_required(true)
        .arg_required_else_help(true);
    let job = commands::COMMANDS.iter().map(job_command::JobCommand::clap);
    let exports = commands::EXPORTS.iter().map(|(word, command)| command.clap().name(*word));
    let own = [
        Command::new(EXPORT)
            .about("Materials and models for other programs")
            .subcommand_required(true)
            .arg_required_else_help(true)
            .subcommands(exports),
        of_kind(design::DesignArguments::augment_args(Command::new("design"))),
        of_kind(sweep::SweepArguments::augment_args(Command::new("sweep"))),
        compare::clap(),
        run::RunArguments::augment_args(Command::new("run"))
            .about("Any kind of job from a request as the service takes it"),
    ];
    let program = program.subcommands(job).subcommands(own);
    #[cfg(feature = "service")]
    let program = program.subcommands([
        serve::ServeArguments::augment_args(Command::new("serve"))
            .about("The service: REST, jobs, and a page for planners"),
        worker::WorkerArguments::augment_args(Command::new("worker")).about("A worker of a service on PostgreSQL"),
    ]);
    program
}

/// A command that says of itself what its kind of job does.
fn of_kind(command: Command) -> Command {
    match crate::job::kind_of_command(command.get_name()) {
        Some(kind) => command.about(kind.about),
        None => command,
    }
}

/// What every command takes.
#[derive(Args)]
struct Common {
    /// Print the result as JSON on stdout (and write files only where --out says).
    #[arg(long)]
    json: bool,
    /// Folder for result files [default: results/NAME/COMMAND].
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Threads [default: one per core].
    #[arg(long)]
    threads: Option<usize>,
}

/// Runs the command line.
pub fn run() -> ExitCode {
    let matches = match program().try_get_matches() {
        Ok(matches) => matches,
        Err(error) => {
            // Help and version are not errors; a closed pipe while printing them is none either.
            let code = u8::try_from(error.exit_code()).unwrap_or(2);
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    match matches.subcommand().map_or(Ok(()), |(name, matches)| run_command(name, matches)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("lambdak: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// The options of a command that describes them by a type.
fn read<T: FromArgMatches>(matches: &ArgMatches) -> Result<T, CliError> {
    T::from_arg_matches(matches).map_err(|e| CliError::Numerics(e.to_string()))
}

fn run_command(name: &str, matches: &ArgMatches) -> Result<(), CliError> {
    // The service and its workers end gracefully by signals of their own.
    match name {
        #[cfg(feature = "service")]
        "serve" => return serve::run(&read(matches)?),
        #[cfg(feature = "service")]
        "worker" => return worker::run(&read(matches)?),
        _ => interrupt::listen(),
    }
    match name {
        "design" => design::run(&read(matches)?),
        "sweep" => sweep::run(&read(matches)?),
        "run" => run::run(&read(matches)?),
        compare::COMMAND => compare::run(matches),
        EXPORT => {
            let (word, matches) = matches.subcommand().unwrap_or((name, matches));
            match commands::EXPORTS.iter().find(|(w, _)| *w == word) {
                Some((_, command)) => command.run(matches),
                None => Err(CliError::Numerics(format!("no export {word}"))),
            }
        }
        _ => match commands::COMMANDS.iter().find(|c| c.name == name) {
            Some(command) => command.run(matches),
            None => Err(CliError::Numerics(format!("no command {name}"))),
        },
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
