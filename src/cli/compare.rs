//! `lambdak compare`.

use super::error::CliError;
use super::flag::Flag;
use super::input::read_text;
use super::job_command::{Asked, kind_of, leave, value};
use super::output::write_named;
use super::terminal::Terminal;
use crate::compare::{CompareError, pairs};
use clap::{Arg, ArgAction, ArgMatches, Command};
use serde_json::{Value, json};
use std::path::Path;

/// Name of the command and of its kind of job.
pub(super) const COMMAND: &str = "compare";
const FLAGS: [Flag; 3] = [
    Flag::of("rel-tol", "relative_tolerance"),
    Flag::of("strict", "is_strict"),
    Flag::of("across-inputs", "across_inputs"),
];

/// The command for clap.
pub(super) fn clap() -> Command {
    let kind = kind_of(COMMAND);
    let base = "Result file (evaluation/1, sweep/1, design/1), or folder of result files, that is compared with";
    let mut command = Command::new(COMMAND)
        .about(kind.about)
        .after_help(
            "Exit codes: 0 same or better, 1 worse, 2 not comparable or unreadable, 4 a report cannot be written.",
        )
        .arg(Arg::new("BASE").help(base).required(true))
        .arg(Arg::new("CURRENT").help("The result file or folder that is judged").required(true))
        .arg(Arg::new("json").long("json").help("Print the comparison as JSON on stdout").action(ArgAction::SetTrue))
        .arg(Arg::new("junit").long("junit").value_name("FILE").help("Write JUnit XML"))
        .arg(Arg::new("markdown").long("markdown").value_name("FILE").help("Write a Markdown summary"));
    let fields = kind.fields();
    for flag in FLAGS {
        if let Some(field) = fields.iter().find(|f| f.name == flag.field) {
            command = command.arg(flag.arg(field));
        }
    }
    command
}

pub(super) fn run(matches: &ArgMatches) -> Result<(), CliError> {
    let (base, current) = (value(matches, "BASE"), value(matches, "CURRENT"));
    let mut asked = Asked { kind: COMMAND, request: json!({}), sources: Vec::new() };
    let mut compared: Vec<Value> = Vec::new();
    for (index, pair) in pairs(Path::new(&base), Path::new(&current))?.into_iter().enumerate() {
        asked.sources.push((format!("/pairs/{index}"), pair.name.clone()));
        let (base, current) = (result_in(&pair.base)?, result_in(&pair.current)?);
        compared.push(json!({ "name": pair.name, "base": base, "current": current }));
    }
    asked.set("pairs", compared, base);
    let fields = kind_of(COMMAND).fields();
    for flag in FLAGS {
        asked.sources.push((format!("/{}", flag.field), format!("--{}", flag.name)));
        flag.apply(&fields, matches, &mut asked.request)?;
    }
    let ran = crate::job::run(&asked.job()?, &Terminal::new(None, None));
    let outcome = ran.map_err(|e| asked.failure(e, None))?;
    for (option, name) in [("junit", "comparison.xml"), ("markdown", "comparison.md")] {
        let found = outcome.files.iter().find(|f| f.name == name);
        if let (Some(path), Some(file)) = (matches.get_one::<String>(option), found) {
            write_named(Path::new(path), &String::from_utf8_lossy(&file.bytes))?;
        }
    }
    leave(&outcome, None, matches.get_flag("json"))
}

/// A result from a file.
fn result_in(path: &Path) -> Result<Value, CliError> {
    let not_a_result = |e: serde_json::Error| CompareError::NotAResult { path: path.into(), message: e.to_string() };
    Ok(serde_json::from_str(&read_text(path)?).map_err(not_a_result)?)
}
