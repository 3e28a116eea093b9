//! A command that runs a job: options become a request, the request a job, the job an outcome, the outcome files and
//! text.

use super::error::CliError;
use super::flag::Flag;
use super::results::{ResultsFolder, default_path, said_where};
use super::terminal::Terminal;
use super::{Common, output};
use crate::field::FieldError;
use crate::job::{Job, JobError, Kind, Outcome};
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What a command adds to the request beyond its flags: its plain arguments. Gives the path after which results are
/// named.
pub(super) type Fill = fn(&ArgMatches, &mut Asked) -> Result<PathBuf, CliError>;

/// A command and the kind of job that it runs.
pub(super) struct JobCommand {
    /// Name of the command, and of the kind of job.
    pub name: &'static str,
    /// Its plain arguments, and options that are no fields of the request.
    pub arguments: fn(Command) -> Command,
    /// Its options that are fields of the request.
    pub flags: &'static [Flag],
    /// Reads its plain arguments.
    pub fill: Fill,
}

/// A request in the making.
pub(super) struct Asked {
    /// Command whose kind of job is asked for; an option may ask for another than its own.
    pub kind: &'static str,
    /// The request.
    pub request: Value,
    /// Where parts of it came from: JSON pointer and how the user knows it.
    pub sources: Vec<(String, String)>,
}

impl Asked {
    /// Sets a field that came from `source`.
    pub(super) fn set(&mut self, field: &str, value: impl Into<Value>, source: impl Into<String>) {
        super::flag::set(&mut self.request, field, value.into());
        self.sources.push((format!("/{field}"), source.into()));
    }

    /// The errors, each with the option or file that it is about.
    pub(super) fn explained(&self, errors: &[FieldError]) -> CliError {
        let explain = |e: &FieldError| {
            let is_within = |p: &str| e.pointer.strip_prefix(p).is_some_and(|r| r.is_empty() || r.starts_with('/'));
            let found = self.sources.iter().filter(|(p, _)| is_within(p)).max_by_key(|(p, _)| p.len());
            match found {
                None => e.to_string(),
                Some((pointer, source)) => {
                    let rest = FieldError { pointer: e.pointer[pointer.len()..].into(), ..e.clone() };
                    let colon = if rest.pointer.is_empty() { "" } else { ":" };
                    format!("{source}{colon} {rest}")
                }
            }
        };
        CliError::Fields(errors.iter().map(explain).collect())
    }

    /// The job.
    pub(super) fn job(&self) -> Result<Job, CliError> {
        kind_of(self.kind).job(&self.request).map_err(|errors| self.explained(&errors))
    }

    /// What a job failed with, in the user's words.
    pub(super) fn failure(&self, error: JobError, folder: Option<&ResultsFolder>) -> CliError {
        match error {
            JobError::Invalid(errors) => self.explained(&errors),
            JobError::TooBig(error) => self.explained(&[error]),
            JobError::Unreadable { name, message } => CliError::Input { path: name.into(), message },
            JobError::Checkpoint(message) => CliError::Checkpoint(message),
            JobError::Stopped { summary, unfinished } => stopped(summary, unfinished.as_deref(), folder),
            other => CliError::Numerics(other.to_string()),
        }
    }
}

/// Writes what a stopped job has found; the error that ends the command.
fn stopped(summary: String, unfinished: Option<&Outcome>, folder: Option<&ResultsFolder>) -> CliError {
    let Some(found) = unfinished else { return CliError::Interrupted(summary) };
    let Some(folder) = folder else {
        // Nothing is on disk: the caller of --json gets it all the same.
        return output::print(&found.result).err().unwrap_or(CliError::Interrupted(summary));
    };
    let result = std::iter::once((found.result_name, found.result.as_bytes()));
    let files = found.files.iter().map(|f| (f.name.as_str(), f.bytes.as_slice()));
    for (name, bytes) in result.chain(files) {
        if let Err(error) = output::write_file(folder.path(), name, bytes) {
            return error;
        }
    }
    let place = folder.path().join(found.result_name);
    let hint = format!("What was found is in {}; run the same command again to go on", place.display());
    CliError::Interrupted(format!("{summary}. {hint}"))
}

/// A kind of job of this program.
pub(super) fn kind_of(command: &'static str) -> &'static Kind {
    match crate::job::kind_of_command(command) {
        Some(kind) => kind,
        None => unreachable!("every command has its kind of job: {command}"),
    }
}

impl JobCommand {
    /// The command for clap.
    pub(super) fn clap(&self) -> Command {
        let kind = kind_of(self.name);
        let fields = kind.fields();
        let mut command = (self.arguments)(Command::new(self.name));
        for flag in self.flags {
            if let Some(field) = fields.iter().find(|f| f.name == flag.field) {
                command = command.arg(flag.arg(field));
            }
        }
        // The description of the options that all commands share is not that of the command.
        Common::augment_args(command).about(kind.about)
    }

    /// The request that the command line asks for, and the path after which results are named.
    pub(super) fn asked(&self, matches: &ArgMatches) -> Result<(Asked, PathBuf), CliError> {
        let sources = self.flags.iter().map(|f| (format!("/{}", f.field), format!("--{}", f.name))).collect();
        let mut asked = Asked { kind: self.name, request: json!({}), sources };
        let named = (self.fill)(matches, &mut asked)?;
        if asked.kind == self.name {
            self.apply_flags(matches, &mut asked)?;
        }
        Ok((asked, named))
    }

    fn apply_flags(&self, matches: &ArgMatches, asked: &mut Asked) -> Result<(), CliError> {
        let fields = kind_of(self.name).fields();
        for flag in self.flags {
            flag.apply(&fields, matches, &mut asked.request)?;
        }
        Ok(())
    }

    /// Runs the command.
    pub(super) fn run(&self, matches: &ArgMatches) -> Result<(), CliError> {
        let common = Common::from_arg_matches(matches).map_err(|e| CliError::Numerics(e.to_string()))?;
        super::start_threads(&common)?;
        let (asked, named) = self.asked(matches)?;
        run_asked(&asked, &common, &named, self.name, None)
    }
}

/// Checks and runs a request, and leaves its outcome in the folder of `command`.
pub(super) fn run_asked(
    asked: &Asked,
    common: &Common,
    named: &Path,
    command: &str,
    limit: Option<Duration>,
) -> Result<(), CliError> {
    let job = asked.job()?;
    let folder = if common.json && common.out.is_none() {
        None
    } else {
        Some(ResultsFolder::open(default_path(common.out.as_deref(), named, command), command)?)
    };
    let terminal = Terminal::new(folder.as_ref().map(ResultsFolder::path), limit);
    let ran = crate::job::run(&job, &terminal);
    terminal.clear();
    let outcome = ran.map_err(|e| asked.failure(e, folder.as_ref()))?;
    leave(&outcome, folder.as_ref(), common.json)
}

/// Writes and prints an outcome.
pub(super) fn leave(outcome: &Outcome, folder: Option<&ResultsFolder>, is_json: bool) -> Result<(), CliError> {
    if let Some(folder) = folder {
        folder.write(outcome)?;
    }
    let place = folder.map(|f| said_where(f.path(), outcome)).unwrap_or_default();
    if is_json {
        output::print(&outcome.result)?;
        eprint!("{}", place.trim_start());
    } else {
        output::print(&format!("{}{place}", outcome.summary))?;
    }
    match &outcome.is_worse {
        Some(message) => Err(CliError::Worse(message.clone())),
        None => Ok(()),
    }
}

/// A plain argument that names files.
pub(super) fn files(name: &'static str, value_name: &'static str, help: &'static str) -> Arg {
    Arg::new(name).value_name(value_name).help(help).required(true).num_args(1..)
}

/// The values of a plain argument, or of an option that may be repeated.
pub(super) fn values(matches: &ArgMatches, name: &str) -> Vec<String> {
    matches.get_many::<String>(name).into_iter().flatten().cloned().collect()
}

/// The first value of a plain argument; empty where clap did not ask for it.
pub(super) fn value(matches: &ArgMatches, name: &str) -> String {
    matches.get_one::<String>(name).cloned().unwrap_or_default()
}
