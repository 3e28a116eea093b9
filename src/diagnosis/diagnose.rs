//! The diagnosis: fit the nominal model, look at what is left, suppose causes, fit them, and prove them on data kept back.

use super::causes::Cause;
use super::error::DiagnosisError;
use super::fit::{BulkPrior, FitSettings, Fitted, ShearPrior, Supposed, scene_of, shear_modulus};
use super::found::{FoundCause, compressible, found_cause, load_causes, terms};
use super::laboratory::Laboratory;
use super::leftover::{Leftover, leftover};
use super::load_history::{LoadHistoryFit, fit_load_history};
use super::maps::{ScoreMap, jumps};
use super::mesh_error::{Finer, MeshDefect, widen};
use super::metric::Metric;
use super::scene::Scene;
use super::trace::Trace;
use super::work::{EVIDENCE, FREE_BULK, KNOWN_BULK, Work, first_guess, is_large, leading, penalty};
use crate::calibration::Observed;
use crate::material::Ogden;
use crate::mesh::MeshOptions;
use crate::recording::Recording;
use std::sync::Arc;

/// Fits of one cause are the same where their predictions differ by less than this part of the cause's effect.
const SAME_EFFECT: f64 = 0.2;
/// Causes whose fits differ by less than this cannot be told apart.
const AMBIGUITY: f64 = 15.0;
/// A further cause must explain this part of what the ones before it did: a model of a large effect errs by some percent, which
/// is no effect of its own.
const SMALLEST_SHARE: f64 = 0.02;
/// Structured misfit that is left counts as unexplained above this multiple of the allowance (rms).
const UNEXPLAINED: f64 = 2.0;
/// Causes of a misfit above that limit explain it where they leave less than this part of it (rms), or no more than the allowance:
/// the right cause leaves a tenth or less, but for the odd debond; another one in its place about a third.
const EXPLAINED_LEAVES: f64 = 0.25;
/// Where causes leave more than this part of the squares unexplained, they are not named but listed as tried.
const UNEXPLAINED_SHARE: f64 = 0.5;

/// Settings of [`diagnose`].
#[derive(Clone, Debug)]
pub struct DiagnosisOptions {
    /// Element size as a factor on the standard one.
    pub mesh_factor: f64,
    /// What displacement error meshes may leave, mm rms at the largest drive; `None` for a thousandth of that drive.
    pub allowance_mm: Option<f64>,
    /// The material as believed; its number of terms is then the nominal one.
    pub prior: Option<Ogden>,
    /// Most causes.
    pub max_causes: usize,
    /// Drift of the load cell where the recording does not state it, N.
    pub force_sd_n: f64,
    /// Names of causes that are not to be supposed.
    pub left_out: Vec<String>,
}

impl Default for DiagnosisOptions {
    fn default() -> Self {
        DiagnosisOptions {
            mesh_factor: 1.35,
            allowance_mm: None,
            prior: None,
            max_causes: 3,
            force_sd_n: 0.02,
            left_out: Vec::new(),
        }
    }
}

/// How the diagnosis ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing beyond noise and meshes.
    NoMismatch,
    /// The causes named explain what was found.
    Explained,
    /// So do others, which the data cannot tell apart from them.
    ExplainedAmbiguously,
    /// Something is left that no cause explains.
    Unexplained,
}

/// A cause that was looked at.
#[derive(Clone, Debug)]
pub struct Ranked {
    /// Name.
    pub name: String,
    /// In words.
    pub description: String,
    /// Fall of the deviance to first order.
    pub score: f64,
    /// Fall of the deviance in a full fit, less ln n per parameter; none where not fitted.
    pub fitted: Option<f64>,
    /// Which round.
    pub round: usize,
}

/// The diagnosis of a recording.
pub struct Diagnosis {
    /// How it ended.
    pub verdict: Verdict,
    /// Causes, first found first.
    pub causes: Vec<FoundCause>,
    /// What the data cannot tell apart from them; where the verdict is unexplained, what was tried and does not explain it.
    pub alternatives: Vec<FoundCause>,
    /// The nominal model's fit.
    pub nominal: Fitted,
    /// With the causes.
    pub corrected: Fitted,
    /// What each leaves.
    pub left: [Leftover; 2],
    /// Rms misfit (mm) on voxel blocks kept back, without and with the causes.
    pub kept_back_rms_mm: [f64; 2],
    /// All causes looked at.
    pub ranked: Vec<Ranked>,
    /// The load curve.
    pub load: Option<LoadHistoryFit>,
    /// Maps of the nominal misfit.
    pub maps: Vec<(String, ScoreMap)>,
    /// The material as believed.
    pub believed: Option<Ogden>,
    /// Priors and stops of the last fits.
    pub settings: FitSettings,
    /// The recording as compared.
    pub observed: Observed,
    /// Displacement unknowns of the model.
    pub num_unknowns: usize,
    /// Equilibria solved.
    pub num_solves: usize,
    /// The allowance in use, mm.
    pub allowance_mm: f64,
    /// What a finer mesh predicts beyond the mesh of the diagnosis, the causes included.
    pub mesh_defect: Option<MeshDefect>,
}

/// Diagnoses `recording`; `progress` is told what is being done.
///
/// # Errors
/// [`DiagnosisError`].
pub fn diagnose(
    recording: &Recording,
    options: &DiagnosisOptions,
    progress: &dyn Fn(&str),
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Diagnosis, DiagnosisError> {
    if !(0.3..=5.0).contains(&options.mesh_factor) {
        let value = options.mesh_factor;
        return Err(DiagnosisError::Setting { name: "the mesh factor", value, requirement: "from 0.3 to 5" });
    }
    let observed = Observed::new(recording, options.force_sd_n)?;
    let largest = observed.steps.iter().map(|s| s.drive_mm.abs()).fold(0.0, f64::max);
    let allowance_mm = options.allowance_mm.unwrap_or(1e-3 * largest);
    let metric = Metric::new(&observed, allowance_mm, &|_| true);
    let mesh = MeshOptions::scaled(&observed.specimen, options.mesh_factor);
    let mut laboratory = Laboratory::new(&observed, &mesh)?;
    let num_unknowns = laboratory.num_unknowns()?;
    let mut recorded = laboratory.measured();
    let start = first_guess(&mut laboratory, options, is_cancelled)?;
    // Without a force the modulus is that of the first guess; what is fitted are ratios and shapes.
    let has_force = observed.steps.iter().any(|s| s.force.is_some());
    let shear = (!has_force).then(|| ShearPrior { center_kpa: shear_modulus(&start), log_sd: KNOWN_BULK });
    let settings = FitSettings {
        max_iterations: 12,
        bulk: BulkPrior { center_kpa: start.bulk_kpa, log_sd: 0.5 },
        shear,
        tolerance: 0.3,
    };
    progress(&format!("fitting the nominal model ({num_unknowns} unknowns)"));
    let mut work = Work {
        laboratory: &mut laboratory,
        metric: &metric,
        settings,
        nominal_bulk: settings.bulk,
        is_cancelled,
        allowance_mm,
        left_out: &options.left_out,
    };
    let mut nominal = work.nominal(&recorded, &start, options.prior.is_some())?;

    // The load curve first: what time and the load cell add is taken off before the model is compared.
    progress("reading the load curve");
    let mut load = None;
    if let Some(curve) = recording.load.as_ref().filter(|_| observed.steps.iter().any(|s| s.force.is_some())) {
        let (table, kernel) =
            work.elastic_table(&nominal, curve.drive_mm.iter().fold(largest, |s, d| s.max(d.abs())))?;
        let drift = observed.steps.iter().filter_map(|s| s.force).map(|f| f.sd_n).fold(0.0, f64::max);
        let windows: Vec<Option<[f64; 2]>> = recording.steps.iter().map(|s| s.window_s).collect();
        load = fit_load_history(curve, &table, &kernel, drift.max(1e-6), &windows, &|e| !work.is_left_out(e.cause()));
    }
    let has_curve = load.is_some();
    let mut causes: Vec<FoundCause> = Vec::new();
    if let Some(found) = load.as_ref().filter(|l| !l.effects.is_empty()) {
        for (force, excess) in recorded.force.iter_mut().zip(&found.window_excess_n) {
            *force -= excess;
        }
        causes.extend(load_causes(&found.effects));
        progress("refitting with the load curve's effects taken off");
        nominal = work.nominal(&recorded, &start, options.prior.is_some())?;
    }
    // What our mesh gets wrong of the nominal model is taken off before a misfit is looked for.
    let mut finer = Finer::new(&observed, options.mesh_factor);
    let mut mesh_defect: Option<MeshDefect> = None;
    if let Some(finer) = finer.as_mut() {
        progress("predicting on a finer mesh");
        match finer.defect(&nominal, is_cancelled) {
            Ok(found) => {
                mesh_defect = Some(found);
                nominal = work.nominal(&less(&recorded, &mesh_defect), &nominal.material, options.prior.is_some())?;
            }
            Err(error) if is_cancelled() => return Err(error),
            Err(_) => progress("a finer model has no equilibrium: the mismatch is that against this mesh"),
        }
    }
    let measured = less(&recorded, &mesh_defect);
    let mut ranked = Vec::new();
    let mut maps = Vec::new();
    let mut alternatives = Vec::new();
    let mut current = nominal.clone();
    if !work.is_left_out("compressibility")
        && let Some((stiff, free, evidence)) = work.compressibility(&measured, &nominal)?
    {
        causes.push(compressible(&free, &stiff, evidence));
        work.nominal_bulk.log_sd = KNOWN_BULK;
        (nominal, work.settings.bulk) = (stiff, BulkPrior { center_kpa: free.material.bulk_kpa, log_sd: FREE_BULK });
        current = free;
    }
    if options.prior.is_some()
        && !work.is_left_out("terms")
        && let Some((richer, evidence)) = work.further_term(&measured, &current)?
    {
        causes.push(terms(&richer, &current, evidence));
        current = richer;
    }

    let wraps = if work.is_left_out("wrap") { Vec::new() } else { jumps(&observed, &current.residual) };
    if !wraps.is_empty() {
        progress(&format!("{} groups of voxels are a whole turn of phase off", wraps.len()));
        let supposed: Vec<Supposed> = wraps
            .into_iter()
            .map(|w| {
                let values = vec![w.size_mm];
                Supposed { cause: Arc::new(w) as Arc<dyn Cause>, values }
            })
            .collect();
        current = work.fit(&measured, &current.material, &supposed)?;
    }
    let mut round = 0;
    while current.causes.iter().filter(|c| c.cause.name() != "wrap").count() + causes.len() < options.max_causes {
        round += 1;
        progress(&format!("round {round}: testing causes"));
        let candidates = work.candidates(&current, has_curve, round, &mut maps)?;
        for c in &candidates {
            ranked.push(Ranked {
                name: c.cause.name().into(),
                description: c.cause.description(),
                score: c.score,
                fitted: None,
                round,
            });
        }
        let mut fits: Vec<(f64, Fitted)> = Vec::new();
        for c in leading(&candidates) {
            if is_cancelled() {
                break;
            }
            progress(&format!("round {round}: fitting '{}'", c.cause.description()));
            let mut supposed = current.causes.clone();
            supposed.push(Supposed { cause: c.cause.clone(), values: c.values.clone() });
            let Ok(found) = work.fit_with_leaps(&measured, &current.material, &supposed) else { continue };
            let gain = current.deviance - found.deviance - penalty(&metric, c.values.len());
            if let Some(r) = ranked.iter_mut().rev().find(|r| r.description == c.cause.description()) {
                r.fitted = Some(gain);
            }
            fits.push((gain, found));
        }
        fits.sort_by(|a, b| b.0.total_cmp(&a.0));
        let Some((gain, best)) = fits.first() else { break };
        let effect = best.prediction.trace.plus(-1.0, &current.prediction.trace);
        let explained = nominal.deviance - current.deviance;
        if *gain < EVIDENCE.max(SMALLEST_SHARE * explained) || !is_large(&observed, &effect, allowance_mm) {
            break;
        }
        for (other_gain, other) in &fits[1..] {
            // Two starts of one cause that end in one place are no two causes.
            let apart = other.prediction.trace.plus(-1.0, &best.prediction.trace);
            let is_same = other.causes.last().map(|c| c.cause.name()) == best.causes.last().map(|c| c.cause.name())
                && apart.rms_mm() < SAME_EFFECT * effect.rms_mm();
            if gain - other_gain < AMBIGUITY && !is_same {
                let effect = other.prediction.trace.plus(-1.0, &current.prediction.trace);
                let mut alternative =
                    found_cause(other, other.causes.len() - 1, &observed, *other_gain, effect.rms_mm());
                progress(&format!("looking for the experiment that would tell '{}' apart", alternative.description));
                let pair = [best, other];
                alternative.experiments = work.experiments(options.mesh_factor, pair)?;
                alternatives.push(alternative);
            }
        }
        causes.push(found_cause(best, best.causes.len() - 1, &observed, *gain, effect.rms_mm()));
        current = best.clone();
    }
    // What pulled κ before the other causes were known may be one of them.
    if let Some(place) = causes.iter().position(|c| c.name == "compressibility").filter(|_| !current.causes.is_empty())
    {
        progress("testing whether the material is compressible beside the other causes");
        let free_bulk = work.settings.bulk;
        work.settings.bulk = settings.bulk;
        let mut start = current.material.clone();
        start.bulk_kpa = settings.bulk.center_kpa;
        let believed = work.fit(&measured, &start, &current.causes)?;
        let gain = believed.deviance - current.deviance - penalty(&metric, 1);
        if gain < EVIDENCE.max(SMALLEST_SHARE * (nominal.deviance - believed.deviance)) {
            causes.remove(place);
            current = believed;
        } else {
            causes[place].evidence = gain;
            work.settings.bulk = free_bulk;
        }
    }
    // Wraps are named even where nothing else is.
    for (index, c) in current.causes.iter().enumerate().filter(|(_, c)| c.cause.name() == "wrap") {
        let _ = c;
        causes.push(found_cause(&current, index, &observed, nominal.deviance - current.deviance, 0.0));
    }
    progress("correcting by a finer mesh");
    let free_settings = work.settings;
    let mut seen = [measured.clone(), measured.clone()];
    let corrected_settings = [FitSettings { bulk: work.nominal_bulk, ..free_settings }, free_settings];
    for (n, fitted) in [&mut nominal, &mut current].into_iter().enumerate() {
        let settings = corrected_settings[n];
        let correction =
            finer.as_mut().map(|f| f.correct(work.laboratory, &metric, &recorded, &settings, fitted, is_cancelled));
        let defect = match correction {
            Some(Err(error)) if is_cancelled() => return Err(error),
            Some(Err(_)) => {
                progress("a finer model has no equilibrium: estimates are those of this mesh");
                None
            }
            Some(Ok(defect)) => Some(defect),
            None => None,
        };
        if defect.is_some() {
            seen[n] = less(&recorded, &defect);
        }
        let widened =
            widen(work.laboratory, options.mesh_factor, &metric, &settings, fitted, defect.as_ref(), is_cancelled);
        match widened {
            Err(error) if is_cancelled() => return Err(error),
            Err(_) => progress("a coarser model has no equilibrium: the intervals are those of the noise"),
            Ok(()) => {}
        }
        mesh_defect = defect.or(mesh_defect);
    }
    // Parameters as in the last fit, all causes together.
    for c in &mut causes {
        c.refresh(&current, &observed);
    }
    causes.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    let left = [leftover(&observed, &nominal.residual, &metric), leftover(&observed, &current.residual, &metric)];
    progress("predicting voxel blocks that were kept back");
    let kept_back_rms_mm = work.kept_back(&seen, &nominal, &current)?;
    let [before, after] = [0, 1].map(|n: usize| left[n].structured_rms_mm);
    let limit = UNEXPLAINED * allowance_mm;
    let is_half_done = before > limit && after > allowance_mm.max(EXPLAINED_LEAVES * before);
    let verdict = if after > limit || is_half_done {
        Verdict::Unexplained
    } else if causes.is_empty() {
        Verdict::NoMismatch
    } else if alternatives.is_empty() {
        Verdict::Explained
    } else {
        Verdict::ExplainedAmbiguously
    };
    // Causes that take away the smaller part of what is there are no explanation of it.
    if verdict == Verdict::Unexplained && after.powi(2) > UNEXPLAINED_SHARE * before.powi(2) {
        alternatives.splice(0..0, causes.drain(..));
    }
    let last_settings = work.settings;
    let num_solves = laboratory.num_solves;
    Ok(Diagnosis {
        verdict,
        causes,
        alternatives,
        nominal,
        corrected: current,
        left,
        kept_back_rms_mm,
        ranked,
        load,
        maps,
        believed: options.prior.clone(),
        settings: last_settings,
        num_unknowns,
        num_solves,
        allowance_mm,
        mesh_defect,
        observed,
    })
}

/// What our mesh would have shown of `recorded`, were it not for its own error.
fn less(recorded: &Trace, defect: &Option<MeshDefect>) -> Trace {
    defect.as_ref().map_or_else(|| recorded.clone(), |d| recorded.plus(-1.0, &d.trace))
}

/// The scene of a diagnosis' causes, for pictures.
pub fn scene_of_fit(fitted: &Fitted) -> Scene {
    scene_of(&fitted.causes)
}
