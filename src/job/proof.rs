//! Proof: causes concealed in synthetic recordings, and how the diagnosis fares on them.

use super::{
    Context, JobError, Outcome, Progress, RecordingOutline, Request, ResultSchema, Run, cost, defaults, summary,
};
use crate::field::FieldError;
use crate::field::schema::Seed;
use crate::proof::{
    ExperimentKind, HiddenCause, Proof, ProofOptions, Scored, SeveralOptions, SeveralProof, SeveralScored,
    num_recordings, prove, prove_several,
};
use crate::provenance::build_id;
use crate::report::{confusion_picture, detection_picture};
use crate::voxel::VoxelGrid;
use serde::de::DeserializeOwned;
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
    /// Recordings per cause that the diagnosis is not told of: 10 where this is left out. With several causes at once:
    /// recordings in which one cause is known and one is not, 60 where this is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(maximum = 100000)]
    pub unknown: Option<usize>,
    /// Hide two to four causes at once, in place of one; controls then have a mount that is not perfect by less than
    /// does any harm.
    #[serde(default)]
    pub has_several: bool,
    /// Recordings with several causes at once.
    #[serde(default = "recordings")]
    #[schema(maximum = 100000, default = recordings)]
    pub recordings: usize,
    /// Seed of all draws.
    #[serde(default = "seed")]
    #[schema(value_type = Seed, default = seed)]
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
    ProofOptions::default().per_cause
}

fn controls() -> usize {
    ProofOptions::default().controls
}

fn recordings() -> usize {
    SeveralOptions::default().num_recordings
}

fn seed() -> u64 {
    ProofOptions::default().seed
}

fn mesh_factor() -> f64 {
    ProofOptions::default().mesh_factor
}

struct CheckedProof {
    options: ProofOptions,
}

struct CheckedSeveral {
    options: SeveralOptions,
}

impl Request for ProofRequest {
    const COMMAND: &'static str = "prove-diagnosis";
    const COLLECTION: &'static str = "proofs";
    const ABOUT: &'static str = "Conceal causes in synthetic recordings and score the diagnosis on them.";

    fn example() -> serde_json::Value {
        serde_json::json!({ "per_cause": 1, "unknown": 0, "controls": 1, "mesh_factor": 4.0 })
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<Proof>("proof/1").or(ResultSchema::of::<SeveralProof>("proof-of-several/1"))
    }

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
        if self.has_several {
            let options = SeveralOptions {
                num_recordings: self.recordings,
                num_controls: self.controls,
                num_unknown: self.unknown.unwrap_or(SeveralOptions::default().num_unknown),
                seed: self.seed,
                mesh_factor: self.mesh_factor,
            };
            return Ok(Box::new(CheckedSeveral { options }));
        }
        let options = ProofOptions {
            per_cause: self.per_cause,
            controls: self.controls,
            unknown: self.unknown.unwrap_or(ProofOptions::default().unknown),
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

/// Processor seconds of the diagnosis of so many recordings of the proof's specimen; making them takes a small part.
fn seconds_of(num_recordings: usize, mesh_factor: f64) -> Option<f64> {
    let specimen = defaults::two_hole_shear();
    let voxel_mm = defaults::voxel_mm();
    let num_voxels = VoxelGrid::covering(&specimen, voxel_mm).ok()?.num_voxels();
    let outline = RecordingOutline { num_drives: specimen.drive_mm.len(), specimen, num_voxels };
    Some(num_recordings as f64 * cost::of_diagnosis(&[outline], mesh_factor)?)
}

impl Run for CheckedProof {
    fn title(&self) -> String {
        format!("proof of the diagnosis, seed {}", self.options.seed)
    }

    fn estimated_seconds(&self, _: &[RecordingOutline]) -> Option<f64> {
        seconds_of(num_recordings(&self.options), self.options.mesh_factor)
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let options = &self.options;
        let kept: Kept<Scored> = Kept::open(context, &format!("scored-{}-{}", options.seed, options.mesh_factor))?;
        let report = |s: &Scored, _: usize, total: usize| kept.add(context, s, line(s), total);
        let specimen = defaults::two_hole_shear();
        let proof = prove(&specimen, options, &kept.done, &report, &|| context.is_cancelled());
        let table = summary::proof(&proof);
        let mut outcome = Outcome::new("proof.json", &proof, table.clone())?;
        outcome.add("proof.md", table);
        outcome.add("confusion.svg", confusion_picture(&proof));
        finished(context, outcome)
    }
}

/// What became of one recording with several causes, in a line.
fn line_of_several(s: &SeveralScored) -> String {
    let mark = match &s.failure {
        Some(failure) => failure,
        None if s.is_right && s.false_names.is_empty() => "right",
        None => "WRONG",
    };
    let hidden: Vec<String> = s
        .causes
        .iter()
        .map(|c| format!("{}{} {:.3}", if c.is_detectable { "" } else { "~" }, c.cause.name(), c.own_effect_rms_mm))
        .collect();
    let kind = match s.kind {
        ExperimentKind::Several => "",
        ExperimentKind::Harmless => "harmless ",
        ExperimentKind::Unknown => "last unknown ",
    };
    let verdict = s.verdict.map_or("no verdict".into(), |v| format!("{v:?}"));
    format!("{kind}{}: {verdict}, {} | {}: {mark}", hidden.join(", "), s.named.join(", "), s.alternatives.join(", "))
}

impl Run for CheckedSeveral {
    fn title(&self) -> String {
        format!("proof of the diagnosis with several causes at once, seed {}", self.options.seed)
    }

    fn estimated_seconds(&self, _: &[RecordingOutline]) -> Option<f64> {
        let SeveralOptions { num_recordings, num_controls, num_unknown, mesh_factor, .. } = self.options;
        seconds_of(num_recordings.saturating_add(num_controls).saturating_add(num_unknown), mesh_factor)
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let options = &self.options;
        let name = format!("several-{}-{}", options.seed, options.mesh_factor);
        let kept: Kept<SeveralScored> = Kept::open(context, &name)?;
        let report = |s: &SeveralScored, _: usize, total: usize| kept.add(context, s, line_of_several(s), total);
        let specimen = defaults::two_hole_shear();
        let proof = prove_several(&specimen, options, &kept.done, &report, &|| context.is_cancelled());
        let table = summary::several(&proof);
        let mut outcome = Outcome::new("proof.json", &proof, table.clone())?;
        outcome.add("proof.md", table);
        outcome.add("detection.svg", detection_picture(&proof));
        finished(context, outcome)
    }
}

fn finished(context: &Context, outcome: Outcome) -> Result<Outcome, JobError> {
    if context.is_cancelled() {
        let summary = "the results so far are kept".into();
        return Err(JobError::Stopped { summary, unfinished: Some(Box::new(outcome)) });
    }
    Ok(outcome)
}

/// Results that are kept as they come: a stopped proof goes on where it was. Those of another build are not mixed in.
struct Kept<S> {
    /// Results of an earlier run.
    done: Vec<S>,
    log: Option<Mutex<std::fs::File>>,
    count: AtomicUsize,
}

impl<S: Serialize + DeserializeOwned> Kept<S> {
    fn open(context: &Context, name: &str) -> Result<Kept<S>, JobError> {
        let (mut done, mut log): (Vec<S>, _) = (Vec::new(), None);
        if let Some(path) = context.surroundings.checkpoint(&format!("{name}-{}.jsonl", build_id())) {
            if let Ok(text) = std::fs::read_to_string(&path) {
                // A line cut off by a crash is done again.
                done = text.lines().filter_map(|l| serde_json::from_str(l).ok()).collect();
            }
            let file = std::fs::OpenOptions::new().create(true).append(true).open(&path);
            log = Some(Mutex::new(file.map_err(|e| JobError::Internal(format!("{}: {e}", path.display())))?));
        }
        let count = AtomicUsize::new(done.len());
        Ok(Kept { done, log, count })
    }

    /// Keeps one more of `total` results and tells of it in a line.
    fn add(&self, context: &Context, scored: &S, line: String, total: usize) {
        let n = self.count.fetch_add(1, Ordering::Relaxed) + 1;
        context.progress(&Progress::new(line, n, total));
        if let Some(log) = &self.log
            && let (Ok(mut file), Ok(line)) = (log.lock(), serde_json::to_string(scored))
            && let Err(error) = writeln!(file, "{line}")
        {
            context.progress(&Progress::stage(&format!("a result could not be kept: {error}")));
        }
    }
}
