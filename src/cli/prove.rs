//! `lambdak prove-diagnosis`.

use super::error::CliError;
use super::{Common, interrupt, output};
use crate::proof::{CauseSummary, HiddenCause, Proof, ProofOptions, Scored, prove};
use crate::provenance::build_id;
use crate::report::confusion_picture;
use crate::specimen::Specimen;
use clap::Args;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

#[derive(Args)]
pub(super) struct ProveArguments {
    /// Recordings per cause.
    #[arg(long, default_value_t = 20)]
    per_cause: usize,
    /// Recordings in which nothing is hidden.
    #[arg(long, default_value_t = 100)]
    controls: usize,
    /// Recordings per cause that the diagnosis is not told of.
    #[arg(long, default_value_t = 10)]
    unknown: usize,
    /// Seed of all draws.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Element size of the diagnosis as a factor on the standard one (0.3 to 5).
    #[arg(long, default_value_t = 1.8)]
    mesh: f64,
    /// Hide these causes alone (as they are named in the table; several with commas); `none` for the controls.
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(a: &ProveArguments) -> Result<(), CliError> {
    super::start_threads(&a.common)?;
    let input = |message: String| CliError::Input { path: PathBuf::from("the published two-hole specimen"), message };
    let specimen =
        Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).map_err(|e| input(e.to_string()))?;
    let mut only = Vec::new();
    for name in &a.only {
        let known = std::iter::once(HiddenCause::None).chain(HiddenCause::ALL);
        let cause = known.clone().find(|c| c.name() == name).ok_or_else(|| {
            let names: Vec<&str> = known.map(HiddenCause::name).collect();
            CliError::Input {
                path: PathBuf::from("--only"),
                message: format!("'{name}' is no cause that can be hidden; there are {}", names.join(", ")),
            }
        })?;
        only.push(cause);
    }
    let options = ProofOptions {
        per_cause: a.per_cause,
        controls: a.controls,
        unknown: a.unknown,
        seed: a.seed,
        mesh_factor: a.mesh,
        only,
    };
    let folder = output::folder(a.common.out.as_deref(), a.common.json, std::path::Path::new("prove-diagnosis"));
    // Results are kept as they come: a stopped proof goes on where it was. Those of another build are not mixed in.
    let mut done: Vec<Scored> = Vec::new();
    let mut log = None;
    if let Some(folder) = &folder {
        let path = folder.join(format!("scored-{}-{}-{}.jsonl", a.seed, a.mesh, build_id()));
        let fail = |e: std::io::Error| CliError::Write { path: path.clone(), source: e };
        std::fs::create_dir_all(folder).map_err(fail)?;
        if let Ok(text) = std::fs::read_to_string(&path) {
            // A line cut off by a crash is done again.
            done = text.lines().filter_map(|l| serde_json::from_str(l).ok()).collect();
        }
        log = Some(Mutex::new(std::fs::OpenOptions::new().create(true).append(true).open(&path).map_err(fail)?));
    }
    let begin = Instant::now();
    let resumed = done.len();
    let count = std::sync::atomic::AtomicUsize::new(resumed);
    let report = |s: &Scored, _: usize, total: usize| {
        let n = count.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
        let first = s.named.first().map_or("none", |n| n);
        let mark = if let Some(failure) = &s.failure {
            failure
        } else if s.is_right {
            "right"
        } else if s.is_detectable || !s.named.is_empty() {
            "WRONG"
        } else {
            "missed"
        };
        eprintln!(
            "{:7.0} s  {n}/{total}  {}{} {:.4}: {first}, {mark} ({:.4} mm rms, {:.3} of the force)",
            begin.elapsed().as_secs_f64(),
            s.hidden.cause.name(),
            if s.is_known { "" } else { " (unknown)" },
            s.hidden.strength,
            s.effect_rms_mm,
            s.effect_force_relative
        );
        if let Some(log) = &log
            && let (Ok(mut file), Ok(line)) = (log.lock(), serde_json::to_string(s))
            && let Err(error) = writeln!(file, "{line}")
        {
            eprintln!("a result could not be kept: {error}");
        }
    };
    let proof = prove(&specimen, &options, &done, &report, &interrupt::is_requested);
    if let Some(folder) = &folder {
        output::write_file(folder, "proof.json", output::to_json(&proof)?.as_bytes())?;
        output::write_file(folder, "proof.md", table(&proof).as_bytes())?;
        output::write_file(folder, "confusion.svg", confusion_picture(&proof).as_bytes())?;
    }
    output::print(&if a.common.json { output::to_json(&proof)? } else { table(&proof) })?;
    if interrupt::is_requested() { Err(CliError::Interrupted("the results so far are kept".into())) } else { Ok(()) }
}

fn table(proof: &Proof) -> String {
    let mut text = String::from(
        "| hidden | recordings | detectable | right | right of detectable | right, nothing left | nothing named | place, mm (median) | intervals that hold | named first |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let row = |k: &CauseSummary, note: &str| {
        let place = k.median_location_error_mm.map_or(String::new(), |x| format!("{x:.1}"));
        let held =
            if k.num_covered[1] == 0 { String::new() } else { format!("{}/{}", k.num_covered[0], k.num_covered[1]) };
        let named: Vec<String> = k.first_named.iter().map(|(n, c)| format!("{n} {c}")).collect();
        format!(
            "| {}{note} | {} | {} | {} | {} | {} | {} | {place} | {held} | {} |\n",
            k.cause.name(),
            k.num_recordings,
            k.num_detectable,
            k.num_right,
            k.num_right_detectable,
            k.num_right_explained,
            k.num_silent,
            named.join(", ")
        )
    };
    for k in &proof.known {
        text += &row(k, "");
    }
    for k in &proof.unknown {
        text += &row(k, " (not in the registry)");
    }
    text += "\n| effect on the displacement, mm rms | recordings with a cause in the displacement | cause first |\n|---|---|---|\n";
    let edges = [0.0, 0.007, 0.014, 0.021, 0.035, 0.07, 0.14, f64::INFINITY];
    for pair in edges.windows(2) {
        let within: Vec<&Scored> = proof
            .scored
            .iter()
            .filter(|s| s.is_known && s.hidden.cause.acts_on_displacement())
            .filter(|s| s.effect_rms_mm >= pair[0] && s.effect_rms_mm < pair[1])
            .collect();
        let right = within.iter().filter(|s| s.is_right).count();
        text += &format!("| {} to {} | {} | {right} |\n", pair[0], pair[1], within.len());
    }
    let percent = |x: f64| if x.is_finite() { format!("{:.1} %", 100.0 * x) } else { "not tried".into() };
    text += &format!(
        "\ncause first, of the detectable: {}; false alarms: {}; unknown causes called unexplained, of the detectable: {}; intervals that hold the truth: {}\n",
        percent(proof.right_of_detectable),
        percent(proof.false_alarm_rate),
        percent(proof.unexplained_of_unknown),
        percent(proof.interval_coverage)
    );
    text
}
