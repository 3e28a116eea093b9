//! `lambdak compare`.

use super::error::CliError;
use super::output;
use crate::compare::{CompareError, CompareOptions, Comparison, compare, pairs, read, to_junit, to_markdown, to_text};
use clap::Args;
use std::path::{Path, PathBuf};

/// Exit codes: 0 same or better, 1 worse, 2 not comparable or unreadable, 4 a report cannot be written.
#[derive(Args)]
#[command(
    after_help = "Exit codes: 0 same or better, 1 worse, 2 not comparable or unreadable, 4 a report cannot be written."
)]
pub(super) struct CompareArguments {
    /// Result file (evaluation/1, sweep/1, design/1), or folder of result files, that is compared with.
    base: PathBuf,
    /// The result file or folder that is judged.
    current: PathBuf,
    /// Relative change up to which a figure counts as the same.
    #[arg(long, default_value_t = CompareOptions::default().relative_tolerance)]
    rel_tol: f64,
    /// Count every change beyond the tolerance as worse, improvements too.
    #[arg(long)]
    strict: bool,
    /// Compare evaluations of different specimens with the same scan and parameters.
    #[arg(long)]
    across_inputs: bool,
    /// Print the comparison as JSON on stdout.
    #[arg(long)]
    json: bool,
    /// Write JUnit XML.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Write a Markdown summary.
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
}

pub(super) fn run(a: &CompareArguments) -> Result<(), CliError> {
    if !(a.rel_tol >= 0.0 && a.rel_tol.is_finite()) {
        return Err(CliError::Option { option: "rel-tol", message: format!("{} is not a number from 0", a.rel_tol) });
    }
    let options = CompareOptions { relative_tolerance: a.rel_tol, is_strict: a.strict, across_inputs: a.across_inputs };
    let mut comparisons: Vec<Comparison> = Vec::new();
    for pair in pairs(&a.base, &a.current)? {
        let (base, current) = (read(&pair.base)?, read(&pair.current)?);
        comparisons.push(compare(&pair.name, &base, &current, &options).map_err(|e| match e {
            CompareError::NotComparable { reasons } => CompareError::NotComparable {
                reasons: reasons.into_iter().map(|r| format!("{}: {r}", pair.name)).collect(),
            },
            other => other,
        })?);
    }
    if let Some(path) = &a.junit {
        write(path, &to_junit(&comparisons))?;
    }
    if let Some(path) = &a.markdown {
        write(path, &to_markdown(&comparisons))?;
    }
    let is_worse = comparisons.iter().any(|c| c.is_worse);
    let text = if a.json {
        output::to_json(&serde_json::json!({
            "schema": "comparison/1",
            "relative_tolerance": a.rel_tol,
            "is_strict": a.strict,
            "is_worse": is_worse,
            "comparisons": comparisons,
        }))?
    } else {
        to_text(&comparisons)
    };
    output::print(&text)?;
    if is_worse {
        let count: usize = comparisons.iter().map(|c| c.num_worse).sum();
        let strict = if a.strict { " or otherwise changed (--strict)" } else { "" };
        return Err(CliError::Worse(format!("{count} figures are worse than in {}{strict}", a.base.display())));
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<(), CliError> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    output::write_file(folder, &name, text.as_bytes()).map(|_| ())
}
