//! Design: the best specimen under the limits of a study, with the evidence.

use super::design_pictures::pictures;
use super::subject::{add_drawings, check_count, num_elements};
use super::{Context, JobError, Outcome, Progress, RecordingOutline, Request, ResultSchema, Run, cost, summary};
use crate::calibration::{ParameterSpread, VerifyOptions, verify_in_full};
use crate::design::{
    Checkpoint, CheckpointError, DesignEntry, DesignResult, MaterialPrior, MaterialVerification, ObjectiveKind,
    SearchError, Study, Unfinished, VerificationSettings, search, study_hash,
};
use crate::field::FieldError;
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::provenance::input_hash;
use crate::report::design_report;
use crate::sensitivity::Protocol;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Most evaluations that a study may ask for.
const MAX_EVALUATIONS: usize = 20_000;

impl Request for Study {
    const COMMAND: &'static str = "design";
    const COLLECTION: &'static str = "designs";
    const ABOUT: &'static str = "The best specimen under the limits of a study, with the evidence.";

    fn example() -> serde_json::Value {
        super::defaults::spelled_out(
            include_str!("../../geometries/studies/two-hole-shear.json"),
            &super::defaults::two_hole_shear(),
        )
    }

    fn result() -> ResultSchema {
        ResultSchema::of::<DesignResult>("design/1")
    }

    fn read(value: &Value) -> Result<Study, Vec<FieldError>> {
        Study::from_request(value)
    }

    fn check(self) -> Result<Box<dyn Run>, Vec<FieldError>> {
        let mut errors: Vec<FieldError> = self.check_search().err().iter().map(|e| e.field_error()).collect();
        let budget = self.budget;
        let evaluations = budget
            .refine
            .saturating_mul(budget.iterations)
            .saturating_add(budget.explore)
            .saturating_add(budget.propose)
            .saturating_add(budget.confirm)
            .saturating_add(self.vary.scan.map_or(0, |_| budget.scans))
            .saturating_mul(self.materials.len());
        if evaluations > MAX_EVALUATIONS {
            let found = format!("a budget of about {evaluations} evaluations");
            errors.push(FieldError::new("/budget", found, format!("at most {MAX_EVALUATIONS}")));
        }
        if errors.is_empty() { Ok(Box::new(CheckedStudy(self))) } else { Err(errors) }
    }
}

struct CheckedStudy(Study);

/// What a specimen's verification gives.
struct Verified {
    /// Per parameter; none where nothing could be solved.
    spreads: Vec<ParameterSpread>,
    /// Why the first fit that failed did so.
    failure: Option<String>,
    is_on_larger_elements: bool,
}

impl Run for CheckedStudy {
    fn title(&self) -> String {
        self.0.name.clone()
    }

    fn check_size(&self, _: &[RecordingOutline], max_elements: usize) -> Result<(), FieldError> {
        let base = &self.0.base;
        check_count(num_elements(base, "/base", &MeshOptions::fine)?, "/base", max_elements)
    }

    fn estimated_seconds(&self, _: &[RecordingOutline]) -> Option<f64> {
        let (study, budget) = (&self.0, self.0.budget);
        let num_searched = budget.refine.saturating_mul(budget.iterations).saturating_add(budget.explore);
        // Every material is a solve of its own; what a diagnosis would find takes about twice as much again.
        let num_solves = if study.objective.kind == ObjectiveKind::Detect { 3 } else { 1 };
        let num_materials = num_solves * study.materials.len().max(1);
        let search = cost::seconds(&study.base, &MeshOptions::search(&study.base), None, num_materials)?;
        let voxels = Some((study.scan.voxel_mm, None));
        let confirm = cost::seconds(&study.base, &MeshOptions::standard(&study.base), voxels, num_materials)?;
        Some(num_searched as f64 * search + budget.confirm as f64 * confirm)
    }

    fn run(&self, context: &Context) -> Result<Outcome, JobError> {
        let study = &self.0;
        let checkpoint = self.checkpoint(context)?;
        if checkpoint.num_resumed() > 0 {
            let text = format!("resuming: {} evaluations taken from the checkpoint", checkpoint.num_resumed());
            context.progress(&Progress::stage(&text));
        }
        let show = |p: &crate::design::Progress| {
            let (best, best_specimen) = (p.best, p.leader.clone());
            context.progress(&Progress { best, best_specimen, ..Progress::new(p.stage, p.done, p.total) });
        };
        let found = search(study, &checkpoint, &show, &|| context.is_cancelled()).map_err(|e| match e {
            SearchError::Stopped { unfinished } => stopped(&unfinished),
            other => context.failed(&other),
        })?;
        let mut result = DesignResult::new(study, &found)
            .ok_or_else(|| JobError::NoSolution("nothing was confirmed; widen the limits".into()))?;
        if study.verification.is_on {
            match self.verified(&result, &checkpoint, context) {
                Some(verified) => result.add_verification(verified),
                None => return Err(stopped(&found.unfinished(study, "verify"))),
            }
        }
        if let Some(message) = checkpoint.write_failure() {
            let text = format!("the checkpoint could not be written to the end ({message}); the result is complete");
            context.progress(&Progress::stage(&text));
        }
        let mut outcome = Outcome::new("design.json", &result, summary::design(&result))?;
        let pictures = pictures(study, &result, &mut outcome)?;
        outcome.add("report.html", design_report(&result, &pictures));
        let mut best = result.best.specimen.clone();
        best.name = format!("{} (designed for: {})", best.name, result.name).chars().take(200).collect();
        let tolerances = result.drawing_tolerances();
        let of_best = if result.simplest == 0 { &tolerances[..] } else { &[] };
        add_drawings(&mut outcome, &best, "best-specimen", of_best)?;
        if result.simplest > 0 {
            let mut recommended = result.recommended().specimen.clone();
            recommended.name =
                format!("{} (recommended for: {})", recommended.name, result.name).chars().take(200).collect();
            add_drawings(&mut outcome, &recommended, "recommended-specimen", &tolerances)?;
        }
        Ok(outcome)
    }
}

/// A search that was stopped, with what it had found.
fn stopped(unfinished: &Unfinished) -> JobError {
    let mut kept = Outcome::new("unfinished-design.json", unfinished, unfinished.summary()).ok();
    if let (Some(kept), Some(best)) = (kept.as_mut(), &unfinished.best) {
        let mut specimen = best.specimen.clone();
        specimen.name = format!("{} (unfinished search for: {})", specimen.name, unfinished.name);
        kept.add("unfinished-best-specimen.json", specimen.to_json());
    }
    JobError::Stopped { summary: unfinished.summary(), unfinished: kept.map(Box::new) }
}

impl CheckedStudy {
    /// What earlier runs of this search found.
    fn checkpoint(&self, context: &Context) -> Result<Checkpoint, JobError> {
        let Some(path) = context.surroundings.checkpoint("checkpoint.jsonl") else {
            return Ok(Checkpoint::in_memory());
        };
        // The search does not depend on the verification: a search without it can be verified later.
        let searched = Study { verification: VerificationSettings::default(), ..self.0.clone() };
        Checkpoint::open(&path, &study_hash(&searched)).map_err(|e| match e {
            CheckpointError::Io { .. } => JobError::Internal(e.to_string()),
            other => JobError::Checkpoint(other.to_string()),
        })
    }

    /// Best and base with every material, `None` where it was stopped. What is done is kept in the checkpoint. A
    /// specimen that cannot be verified is a finding, not a failed job.
    fn verified(
        &self,
        result: &DesignResult,
        checkpoint: &Checkpoint,
        context: &Context,
    ) -> Option<Vec<MaterialVerification>> {
        let study = &self.0;
        let draws = study.verification.draws;
        let total = 2 * study.materials.len() * draws;
        let done = AtomicUsize::new(0);
        let tell = |count: usize| {
            let (best, best_specimen) = (Some(result.best.objective), Some(result.best.specimen.clone()));
            context.progress(&Progress { best, best_specimen, ..Progress::new("verify", count, total) });
        };
        // The truth of the first draws takes its time.
        tell(0);
        let of = |entry: &DesignEntry, material: &Material| -> Option<Verified> {
            let told = AtomicUsize::new(0);
            let on_draw = || {
                told.fetch_add(1, Ordering::Relaxed);
                tell(done.fetch_add(1, Ordering::Relaxed) + 1);
            };
            let on = |options: VerifyOptions| {
                let protocol = Protocol { scan_share: entry.evaluation.scan_share.clone(), ..study.protocol.clone() };
                let options = VerifyOptions { protocol, ..options };
                self.verified_on((entry, material), &options, checkpoint, &on_draw, context)
            };
            let mut verified = on(VerifyOptions::new(&entry.specimen, draws, study.seed))?;
            if verified.spreads.is_empty() {
                let larger = on(VerifyOptions::on_larger_elements(&entry.specimen, draws, study.seed))?;
                if !larger.spreads.is_empty() {
                    verified = Verified { is_on_larger_elements: true, ..larger };
                }
            }
            // Draws that were known before, or that a failure left out.
            done.fetch_add(draws.saturating_sub(told.load(Ordering::Relaxed)), Ordering::Relaxed);
            Some(verified)
        };
        // Side by side: making the truth of one keeps one thread busy, the draws of another fill the others.
        let of_material = |prior: &MaterialPrior| {
            let both = rayon::join(|| of(&result.best, &prior.material), || of(&result.base, &prior.material));
            let (best, base) = (both.0?, both.1?);
            Some(MaterialVerification {
                material: prior.name.clone(),
                best: best.spreads,
                base: base.spreads,
                best_failure: best.failure,
                base_failure: base.failure,
                best_on_larger_elements: best.is_on_larger_elements,
                base_on_larger_elements: base.is_on_larger_elements,
            })
        };
        study.materials.par_iter().map(of_material).collect()
    }

    /// One specimen with one material, from the checkpoint where it is known; `None` where it was stopped.
    fn verified_on(
        &self,
        (entry, material): (&DesignEntry, &Material),
        options: &VerifyOptions,
        checkpoint: &Checkpoint,
        on_draw: &(dyn Fn() + Sync),
        context: &Context,
    ) -> Option<Verified> {
        let is_cancelled = || context.is_cancelled();
        let (specimen, scan) = (&entry.specimen, &entry.evaluation.scan);
        let key = input_hash(&json!({
            "specimen": specimen, "material": material, "kind": "verification", "truth_mesh": options.truth_mesh,
            "fit_mesh": options.fit_mesh, "max_iterations": options.fit.max_iterations, "protocol": options.protocol, "scan": scan,
            "draws": options.draws, "seed": options.seed,
        }));
        let (spreads, failure) = checkpoint.get_or(&key, || {
            match verify_in_full(specimen, material, scan, options, on_draw, &is_cancelled) {
                Ok(found) => {
                    let reason = found.fits.iter().find_map(|fit| fit.as_ref().err().map(ToString::to_string));
                    Some((found.spreads, reason))
                }
                Err(_) if context.is_cancelled() => None,
                Err(error) => Some((Vec::new(), Some(error.to_string()))),
            }
        })?;
        Some(Verified { spreads, failure, is_on_larger_elements: false })
    }
}
