//! Proof: causes concealed in synthetic recordings, and how the diagnosis fares on them.

use super::{Context, JobError, Outcome, Progress, Request, Run, defaults, summary};
use crate::field::FieldError;
use crate::proof::{HiddenCause, ProofOptions, Scored, prove};
use crate::provenance::build_id;
use crate::report::confusion_picture;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use utoipa::ToSchema;

/// Body of a proof.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProofRequest {
    /// Recordings per cause.
    #[serde(default = "per_cause")]
    #[schema(maximum = 100000, default = per_cause)]
    pub per_cause: usize,
    /// Recordings in which nothing is hidden.
    #[serde(default = "controls")]
    #[schema(maximum = 100000, default = controls)]
    pub controls: usize,
    /// Recordings per cause that the diagnosis is not told of.
    #[serde(default = "unknown")]
    #[schema(maximum = 100000, default = unknown)]
    pub unknown: usize,
    /// Seed of all draws.
    #[serde(default = "seed")]
    #[schema(default = seed)]
    pub seed: u64,
    /// Element size of the diagnosis as a factor on the standard one.
    #[serde(default = "mesh_factor")]
    #[schema(minimum = 0.3, maximum = 5.0, default = mesh_factor)]
    pub mesh_factor: f64,
    /// Hide these causes alone (as they are named in the table); `none` for the controls.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100)]
    pub only: Vec<String>,
}

fn per_cause() -> usize {
    20
}

fn controls() -> usize {
    100
}

fn unknown() -> usize {
    10
}

fn seed() -> u64 {
    1
}

fn mesh_factor() -> f64 {
    1.8
}

struct CheckedProof {
    options: ProofOptions,
}

impl Request for ProofRequest {
    const COMMAND: &'static str = "prove-diagnosis";
    const COLLECTION: &'static str = "proofs";
    const ABOUT: &'static str = "Conceal causes in synthetic recordings and score the diagnosis on them.";

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let (mut only, mut errors) = (Vec::new(), Vec::new());
        for (index, name) in self.only.iter().enumerate() {
            let mut known = std::iter::once(HiddenCause::None).chain(HiddenCause::ALL);
            match known.clone().find(|c| c.name() == name) {
                Some(cause) => only.push(cause),
                None => {
                    let names: Vec<&str> = known.by_ref().map(HiddenCause::name).collect();
                    let allowed = format!("a cause that can be hidden: {}", names.join(", "));
                    errors.push(FieldError::new(format!("/only/{index}"), format!("{name:?}"), allowed));
                }
            }
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let options = ProofOptions {
            per_cause: self.per_cause,
            controls: self.controls,
            unknown: self.unknown,
            seed: self.seed,
            mesh_factor: self.mesh_factor,
            only,
        };
        Ok(Box::new(CheckedProof { options }))
    }
}

/// What became of one recording, in a line.
fn line(s: &Scored) -> String {
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
    format!(
        "{}{} {:.4}: {first}, {mark} ({:.4} mm rms, {:.3} of the force)",
        s.hidden.cause.name(),
        if s.is_known { "" } else { " (unknown)" },
        s.hidden.strength,
        s.effect_rms_mm,
        s.effect_force_relative
    )
}

impl Run for CheckedProof {
    fn title(&self) -> String {
        format!("proof of the diagnosis, seed {}", self.options.seed)
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        // Results are kept as they come: a stopped proof goes on where it was. Those of another build are not mixed in.
        let options = &self.options;
        let name = format!("scored-{}-{}-{}.jsonl", options.seed, options.mesh_factor, build_id());
        let (mut done, mut log): (Vec<Scored>, _) = (Vec::new(), None);
        if let Some(path) = context.surroundings.checkpoint(&name) {
            if let Ok(text) = std::fs::read_to_string(&path) {
                // A line cut off by a crash is done again.
                done = text.lines().filter_map(|l| serde_json::from_str(l).ok()).collect();
            }
            let file = std::fs::OpenOptions::new().create(true).append(true).open(&path);
            log = Some(Mutex::new(file.map_err(|e| JobError::Internal(format!("{}: {e}", path.display())))?));
        }
        let count = AtomicUsize::new(done.len());
        let report = |s: &Scored, _: usize, total: usize| {
            let n = count.fetch_add(1, Ordering::Relaxed) + 1;
            context.progress(&Progress::new(line(s), n, total));
            if let Some(log) = &log
                && let (Ok(mut file), Ok(line)) = (log.lock(), serde_json::to_string(s))
                && let Err(error) = writeln!(file, "{line}")
            {
                context.progress(&Progress::stage(&format!("a result could not be kept: {error}")));
            }
        };
        let proof = prove(&defaults::two_hole_shear(), options, &done, &report, &|| context.is_cancelled());
        let table = summary::proof(&proof);
        let mut outcome = Outcome::new("proof.json", &proof, table.clone())?;
        outcome.add("proof.md", table);
        outcome.add("confusion.svg", confusion_picture(&proof));
        if context.is_cancelled() {
            let summary = "the results so far are kept".into();
            return Err(JobError::Stopped { summary, unfinished: Some(Box::new(outcome)) });
        }
        Ok(outcome)
    }
}
