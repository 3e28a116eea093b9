//! The diagnosis: fit the nominal model, look at what is left, suppose causes, fit them, and prove them on data kept back.

use super::causes::{Category, Cause, Location, registry};
use super::error::DiagnosisError;
use super::fit::{BulkPrior, FitSettings, Fitted, STEP, ShearPrior, Supposed, fit, paths_of, scene_of, shear_modulus};
use super::laboratory::Laboratory;
use super::load_history::{ElasticTable, FittedEffect, Homogeneous, LoadEffect, LoadHistoryFit, fit_load_history};
use super::maps::{ScoreMap, debond_map, inclusion_map, jumps};
use super::metric::Metric;
use super::scene::Scene;
use super::score::ScoreTest;
use super::trace::Trace;
use crate::calibration::Observed;
use crate::material::{MAX_TERMS, Ogden, OgdenTerm};
use crate::mesh::MeshOptions;
use crate::recording::Recording;
use std::sync::Arc;

/// A cause must lower the deviance by this much beyond ln n per parameter: very strong evidence, many times over, because
/// many causes are tried.
const EVIDENCE: f64 = 30.0;
/// Causes whose fits differ by less than this cannot be told apart.
const AMBIGUITY: f64 = 15.0;
/// An effect is physics where its displacement exceeds this part of the allowance (rms), or its force its own allowance.
const SMALLEST_EFFECT: f64 = 1.0;
/// A further cause must explain this part of what the ones before it did: a model of a large effect errs by some percent, which
/// is no effect of its own.
const SMALLEST_SHARE: f64 = 0.02;
/// Fits of leading causes per round.
const MAX_FITS: usize = 4;
/// Exponents tried for a further Ogden term.
const EXPONENTS: [f64; 5] = [-6.0, -2.0, 5.0, 9.0, 14.0];
/// Structured misfit that is left counts as unexplained above this multiple of the allowance (rms).
const UNEXPLAINED: f64 = 2.0;
/// κ is looked at where the data pull it below the believed one by this many standard deviations of ln κ…
const PULL_OF_BULK: f64 = 1.5;
/// … which then is as good as known, or as good as free.
const KNOWN_BULK: f64 = 0.02;
const FREE_BULK: f64 = 3.0;
/// Where causes leave more than this part of the squares unexplained, they are not named but listed as tried.
const UNEXPLAINED_SHARE: f64 = 0.5;
/// Drives of the load curve's table.
const TABLE_POINTS: usize = 8;

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

/// One cause found.
#[derive(Clone)]
pub struct FoundCause {
    /// Name.
    pub name: &'static str,
    /// Kind.
    pub category: Category,
    /// In words.
    pub description: String,
    /// Parameters: name, value, 95 % interval.
    pub parameters: Vec<(String, f64, [f64; 2])>,
    /// Where, if somewhere.
    pub location: Option<Location>,
    /// Fall of the deviance.
    pub evidence: f64,
    /// Displacement explained, mm rms.
    pub effect_rms_mm: f64,
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

/// What was left of a recording after a fit.
#[derive(Clone, Debug)]
pub struct Leftover {
    /// χ² of the displacement noise per datum.
    pub chi2_per_datum: f64,
    /// Misfit beyond noise, mm rms, from means over boxes.
    pub structured_rms_mm: f64,
    /// Where it is largest.
    pub location: Option<Location>,
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
    /// The recording as compared.
    pub observed: Observed,
    /// Displacement unknowns of the model.
    pub num_unknowns: usize,
    /// Equilibria solved.
    pub num_solves: usize,
    /// The allowance in use, mm.
    pub allowance_mm: f64,
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
    let mut measured = laboratory.measured();
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
    let mut nominal = work.nominal(&measured, &start, options.prior.is_some())?;

    // The load curve first: what time and the load cell add is taken off before the model is compared.
    progress("reading the load curve");
    let mut load = None;
    if let Some(curve) = recording.load.as_ref().filter(|_| observed.steps.iter().any(|s| s.force.is_some())) {
        let table = work.elastic_table(&nominal, curve.drive_mm.iter().fold(largest, |s, d| s.max(d.abs())))?;
        let drift = observed.steps.iter().filter_map(|s| s.force).map(|f| f.sd_n).fold(0.0, f64::max);
        let windows: Vec<Option<[f64; 2]>> = recording.steps.iter().map(|s| s.window_s).collect();
        let sample = Homogeneous::of(&observed.specimen, &nominal.material);
        load = fit_load_history(curve, &table, &sample, drift.max(1e-6), &windows, &|e| !work.is_left_out(e.cause()));
    }
    let has_curve = load.is_some();
    let mut causes: Vec<FoundCause> = Vec::new();
    if let Some(found) = load.as_ref().filter(|l| !l.effects.is_empty()) {
        for (force, excess) in measured.force.iter_mut().zip(&found.window_excess_n) {
            *force -= excess;
        }
        causes.extend(load_causes(&found.effects));
        progress("refitting with the load curve's effects taken off");
        nominal = work.nominal(&measured, &start, options.prior.is_some())?;
    }
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
            let Ok(found) = work.fit(&measured, &current.material, &supposed) else { continue };
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
            if gain - other_gain < AMBIGUITY {
                let effect = other.prediction.trace.plus(-1.0, &current.prediction.trace);
                alternatives.push(found_cause(other, other.causes.len() - 1, &observed, *other_gain, effect.rms_mm()));
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
    // Parameters as in the last fit, all causes together.
    for (index, supposed) in current.causes.iter().enumerate() {
        let fresh = found_cause(&current, index, &observed, 0.0, 0.0);
        if let Some(c) = causes.iter_mut().find(|c| c.description == supposed.cause.description()) {
            (c.parameters, c.location) = (fresh.parameters, fresh.location);
        }
    }
    causes.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    let left = [leftover(&observed, &nominal.residual, &metric), leftover(&observed, &current.residual, &metric)];
    progress("predicting voxel blocks that were kept back");
    let kept_back_rms_mm = work.kept_back(&measured, &nominal, &current)?;
    let verdict = if left[1].structured_rms_mm > UNEXPLAINED * allowance_mm {
        Verdict::Unexplained
    } else if causes.is_empty() {
        Verdict::NoMismatch
    } else if alternatives.is_empty() {
        Verdict::Explained
    } else {
        Verdict::ExplainedAmbiguously
    };
    // Causes that take away the smaller part of what is there are no explanation of it.
    let [before, after] = [0, 1].map(|n: usize| left[n].structured_rms_mm.powi(2));
    if verdict == Verdict::Unexplained && after > UNEXPLAINED_SHARE * before {
        alternatives.splice(0..0, causes.drain(..));
    }
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
        num_unknowns,
        num_solves,
        allowance_mm,
        observed,
    })
}

/// ln n per parameter.
fn penalty(metric: &Metric, num_parameters: usize) -> f64 {
    num_parameters as f64 * (metric.num_data() as f64).ln()
}

/// Whether a change of the prediction is large enough to be more than a mesh's.
fn is_large(observed: &Observed, effect: &Trace, allowance_mm: f64) -> bool {
    let force = observed
        .steps
        .iter()
        .zip(&effect.force)
        .filter_map(|(s, change)| s.force.map(|f| change.abs() > 4.0 * f.sd_n + 0.01 * f.value_n.abs()))
        .any(|large| large);
    let last = Trace { displacement: effect.displacement.last().cloned().into_iter().collect(), force: vec![] };
    force || last.rms_mm() > SMALLEST_EFFECT * allowance_mm
}

fn first_guess(
    laboratory: &mut Laboratory,
    options: &DiagnosisOptions,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Ogden, DiagnosisError> {
    if let Some(prior) = &options.prior {
        return Ok(prior.clone());
    }
    // A neo-Hookean guess, its modulus scaled to the measured force; κ/μ of a rubber.
    let mut material =
        Ogden { schema: "ogden/1".into(), bulk_kpa: 2000.0, terms: vec![OgdenTerm { mu_kpa: 16.0, alpha: 2.0 }] };
    let predicted = laboratory.predict(&material, &Scene::default(), is_cancelled)?;
    let forces = laboratory.measured().force;
    let ratio = |n: &usize| forces[*n] / predicted.trace.force[*n];
    if let Some(r) = (0..forces.len()).filter(|n| forces[*n].abs() > 0.0).map(|n| ratio(&n)).find(|r| *r > 0.0) {
        material.terms[0].mu_kpa *= r;
        material.bulk_kpa *= r;
    }
    Ok(material)
}

struct Candidate {
    cause: Arc<dyn Cause>,
    values: Vec<f64>,
    score: f64,
}

/// The candidates worth a full fit: the best of each name, most explaining first.
fn leading(candidates: &[Candidate]) -> Vec<&Candidate> {
    let mut chosen: Vec<&Candidate> = Vec::new();
    let top = candidates.first().map_or(0.0, |c| c.score);
    for c in candidates {
        let is_worth = c.score > EVIDENCE && c.score > 0.1 * top;
        // Two holes, or two faces, are different suspects of one name.
        let is_new = chosen.iter().filter(|o| o.cause.name() == c.cause.name()).count()
            < if matches!(c.cause.name(), "debond" | "hole") { 2 } else { 1 };
        if is_worth && is_new && chosen.len() < MAX_FITS {
            chosen.push(c);
        }
    }
    chosen
}

struct Work<'a, 'b> {
    laboratory: &'a mut Laboratory<'b>,
    metric: &'a Metric,
    settings: FitSettings,
    /// κ of the nominal model.
    nominal_bulk: BulkPrior,
    is_cancelled: &'a dyn Fn() -> bool,
    allowance_mm: f64,
    left_out: &'a [String],
}

impl Work<'_, '_> {
    fn is_left_out(&self, name: &str) -> bool {
        self.left_out.iter().any(|n| n == name)
    }

    /// Where the data pull κ far below that of a rubber: the fits with κ as believed and with κ free, and the evidence.
    fn compressibility(
        &mut self,
        measured: &Trace,
        nominal: &Fitted,
    ) -> Result<Option<(Fitted, Fitted, f64)>, DiagnosisError> {
        let believed = self.settings.bulk;
        if (believed.center_kpa / nominal.material.bulk_kpa).ln() < PULL_OF_BULK * believed.log_sd {
            return Ok(None);
        }
        let fit_with = |work: &mut Self, bulk: BulkPrior| {
            let settings = FitSettings { bulk, ..work.settings };
            let mut start = nominal.material.clone();
            if bulk.log_sd < believed.log_sd {
                start.bulk_kpa = bulk.center_kpa;
            }
            fit(work.laboratory, work.metric, measured, &start, &[], &settings, work.is_cancelled)
        };
        let stiff = match fit_with(self, BulkPrior { log_sd: KNOWN_BULK, ..believed }) {
            Ok(stiff) => stiff,
            Err(error) if (self.is_cancelled)() => return Err(error),
            Err(_) => return Ok(None),
        };
        let free = fit_with(self, BulkPrior { log_sd: FREE_BULK, ..believed })?;
        let evidence = stiff.deviance - free.deviance - penalty(self.metric, 1);
        Ok((evidence > EVIDENCE).then_some((stiff, free, evidence)))
    }

    fn fit(&mut self, measured: &Trace, material: &Ogden, causes: &[Supposed]) -> Result<Fitted, DiagnosisError> {
        fit(self.laboratory, self.metric, measured, material, causes, &self.settings, self.is_cancelled)
    }

    /// The nominal model: as many terms as the prior material, or one or two as the data call for.
    fn nominal(&mut self, measured: &Trace, start: &Ogden, is_fixed: bool) -> Result<Fitted, DiagnosisError> {
        let one = self.fit(measured, start, &[])?;
        if is_fixed {
            return Ok(one);
        }
        Ok(self.further_term(measured, &one)?.map_or(one, |found| found.0))
    }

    /// The fit with one more Ogden term and its evidence, where the data call for it.
    fn further_term(&mut self, measured: &Trace, one: &Fitted) -> Result<Option<(Fitted, f64)>, DiagnosisError> {
        // Which exponent a further term would have: first order, all tried at once.
        let mut probe = one.material.clone();
        let base = one.material.terms.len();
        for alpha in EXPONENTS.into_iter().take(MAX_TERMS - base) {
            let mu_kpa = 1e-9 * shear_modulus(&one.material) / alpha;
            probe.terms.push(OgdenTerm { mu_kpa, alpha });
        }
        let probed = self.laboratory.derivatives(&probe, &Scene::default(), &one.prediction, true, &[], STEP);
        let Ok(columns) = probed else { return Ok(None) };
        let nuisance: Vec<Trace> = columns[..=2 * base]
            .iter()
            .zip(one.material.parameters())
            .map(|(t, p)| t.scaled(one.material.value(p)))
            .collect();
        let test = ScoreTest::new(self.metric, &one.residual, &nuisance, &[self.settings.bulk.log_sd.powi(-2)]);
        let mut best: Option<(f64, OgdenTerm)> = None;
        for (n, alpha) in EXPONENTS.into_iter().take(MAX_TERMS - base).enumerate() {
            // κ, then μ and α of each term.
            let direction = &columns[1 + 2 * (base + n)];
            let score = test.test(std::slice::from_ref(direction));
            let mu_kpa = score.coefficients[0];
            if mu_kpa * alpha > 0.0 && best.as_ref().is_none_or(|b| score.explained > b.0) {
                best = Some((score.explained, OgdenTerm { mu_kpa, alpha }));
            }
        }
        let Some((_, term)) = best.filter(|b| b.0 > EVIDENCE) else { return Ok(None) };
        let mut two = one.material.clone();
        two.terms.push(term);
        match self.fit(measured, &two, &[]) {
            Ok(found) => {
                let gain = one.deviance - found.deviance - penalty(self.metric, 2);
                let effect = found.prediction.trace.plus(-1.0, &one.prediction.trace);
                let is_used = gain > EVIDENCE && is_large(self.laboratory.observed(), &effect, self.allowance_mm);
                Ok(is_used.then_some((found, gain)))
            }
            Err(error) if (self.is_cancelled)() => Err(error),
            Err(_) => Ok(None),
        }
    }

    /// F∞ over drive with its derivatives with respect to scaled material parameters, κ apart.
    fn elastic_table(&mut self, fitted: &Fitted, largest_mm: f64) -> Result<ElasticTable, DiagnosisError> {
        let drives: Vec<f64> = (1..=TABLE_POINTS).map(|n| largest_mm * n as f64 / TABLE_POINTS as f64).collect();
        let rows = self.laboratory.forces(&fitted.material, &fitted.scene(), &drives, self.is_cancelled)?;
        let parameters = fitted.material.parameters();
        let at_rest = |values: Vec<f64>| -> Vec<f64> { std::iter::once(0.0).chain(values).collect() };
        let forces = at_rest(rows.iter().map(|r| r.0).collect());
        let derivatives: Vec<Vec<f64>> = (1..parameters.len())
            .map(|i| at_rest(rows.iter().map(|r| r.1[i] * fitted.material.value(parameters[i])).collect()))
            .collect();
        ElasticTable::new(&at_rest(drives), &forces, &derivatives)
    }

    /// All candidates, most explaining first.
    fn candidates(
        &mut self,
        current: &Fitted,
        has_curve: bool,
        round: usize,
        maps: &mut Vec<(String, ScoreMap)>,
    ) -> Result<Vec<Candidate>, DiagnosisError> {
        let specimen = self.laboratory.observed().specimen.clone();
        let scene = current.scene();
        let list: Vec<Arc<dyn Cause>> = registry(&specimen, shear_modulus(&current.material))
            .into_iter()
            .filter(|c| !(has_curve && c.name() == "cell"))
            .filter(|c| !self.is_left_out(c.name()))
            // One of a kind: what is in the fit already is free there.
            .filter(|c| !current.causes.iter().any(|s| s.cause.description() == c.description()))
            .filter(|c| !(c.name() == "fibre" && scene.fibre.is_some()))
            .collect();
        let mut supposed = Vec::new();
        for cause in &list {
            let mut all = current.causes.clone();
            all.push(Supposed { cause: cause.clone(), values: cause.start() });
            supposed.push(all);
        }
        // The cause's own parameters are the last ones.
        let own: Vec<Vec<super::fit::Path>> = supposed
            .iter()
            .zip(&list)
            .map(|(all, cause)| {
                let mut paths = paths_of(all);
                let paths = paths.split_off(paths.len() - cause.parameters().len());
                // Turning fibres without stiffness does nothing.
                if cause.name() == "fibre" { paths.into_iter().take(1).collect() } else { paths }
            })
            .collect();
        let flat: Vec<(&dyn Fn(f64) -> Scene, bool)> = own.iter().flatten().map(|(p, b)| (&**p as _, *b)).collect();
        let known = paths_of(&current.causes);
        let num_known = known.len();
        let all: Vec<(&dyn Fn(f64) -> Scene, bool)> = known.iter().map(|(p, b)| (&**p as _, *b)).chain(flat).collect();
        let mut columns =
            self.laboratory.derivatives(&current.material, &scene, &current.prediction, true, &all, STEP)?;
        let parameters = current.material.parameters();
        let mut directions = columns.split_off(parameters.len() + num_known);
        for (trace, p) in columns.iter_mut().zip(&parameters) {
            *trace = trace.scaled(current.material.value(*p));
        }
        let test = ScoreTest::new(self.metric, &current.residual, &columns, &[self.settings.bulk.log_sd.powi(-2)]);
        let mut candidates = Vec::new();
        for (cause, paths) in list.iter().zip(&own) {
            let rest = directions.split_off(paths.len());
            let score = test.test(&directions);
            directions = rest;
            let mut values = cause.start();
            for ((value, c), p) in values.iter_mut().zip(&score.coefficients).zip(cause.parameters()) {
                // First order may overshoot: start a fit at most a few scales away.
                *value = (*value + c.clamp(-5.0, 5.0) * p.scale).clamp(p.range[0], p.range[1]);
            }
            candidates.push(Candidate { cause: cause.clone(), values, score: score.explained });
        }
        if round == 1 || current.causes.is_empty() {
            for is_moved in [false, true] {
                let (map, found) =
                    debond_map(self.laboratory, &current.material, &current.prediction, &test, is_moved)?;
                maps.push((format!("bond of the {} plate", if is_moved { "moved" } else { "fixed" }), map));
                if let Some((score, cause)) = found.filter(|_| !self.is_left_out("debond")) {
                    candidates.push(Candidate { values: cause.start(), cause: Arc::new(cause), score });
                }
            }
            let (map, found) = inclusion_map(self.laboratory, &current.material, &current.prediction, &test)?;
            maps.push(("stiffness of the sample".into(), map));
            if let Some((score, cause)) = found.filter(|_| !self.is_left_out("inclusion")) {
                candidates.push(Candidate { values: cause.start(), cause: Arc::new(cause), score });
            }
        }
        candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(candidates)
    }

    /// Rms misfit on blocks of voxels that the fits did not see, without and with the causes: two halves in turn.
    fn kept_back(
        &mut self,
        measured: &Trace,
        nominal: &Fitted,
        corrected: &Fitted,
    ) -> Result<[f64; 2], DiagnosisError> {
        let observed = self.laboratory.observed();
        let fold = block_fold(observed);
        let mut squares = [0.0; 2];
        let mut count = 0.0;
        for side in [false, true] {
            let metric = Metric::new(observed, self.allowance_mm, &|v| fold[v] != side);
            for (n, fitted) in [nominal, corrected].into_iter().enumerate() {
                let bulk = if n == 0 { self.nominal_bulk } else { self.settings.bulk };
                let settings = FitSettings { max_iterations: 3, bulk, ..self.settings };
                let found = fit(
                    self.laboratory,
                    &metric,
                    measured,
                    &fitted.material,
                    &fitted.causes,
                    &settings,
                    self.is_cancelled,
                )?;
                for (field, _) in found.residual.displacement.iter().zip(&observed.steps) {
                    for u in field.iter().zip(&fold).filter(|(_, f)| **f == side).map(|(u, _)| u) {
                        for x in u.iter().filter(|x| x.is_finite()) {
                            squares[n] += x * x;
                            count += if n == 0 { 1.0 } else { 0.0 };
                        }
                    }
                }
            }
        }
        Ok(squares.map(|s| (s / f64::max(count, 1.0)).sqrt()))
    }
}

/// A chequerboard of blocks, 4 × 4 in the plane.
fn block_fold(observed: &Observed) -> Vec<bool> {
    let b = observed.specimen.block;
    observed
        .mask
        .voxels
        .iter()
        .map(|&v| {
            let x = observed.mask.grid.center_mm(v as usize);
            let i = ((x[0] / b.length_mm + 0.5) * 4.0).floor() as i64;
            let k = ((x[2] / b.width_mm + 0.5) * 4.0).floor() as i64;
            (i + k).rem_euclid(2) == 0
        })
        .collect()
}

fn found_cause(fitted: &Fitted, index: usize, observed: &Observed, evidence: f64, effect_rms_mm: f64) -> FoundCause {
    let supposed = &fitted.causes[index];
    let parameters = supposed
        .cause
        .parameters()
        .iter()
        .zip(supposed.values.iter().zip(fitted.sd_of(index)))
        .map(|(p, (value, sd))| (p.name.clone(), *value, [value - 1.96 * sd, value + 1.96 * sd]))
        .collect();
    FoundCause {
        name: supposed.cause.name(),
        category: supposed.cause.category(),
        description: supposed.cause.description(),
        parameters,
        location: supposed.cause.location(&supposed.values, &observed.specimen),
        evidence,
        effect_rms_mm,
    }
}

/// The cause that κ was far below the believed one.
fn compressible(free: &Fitted, stiff: &Fitted, evidence: f64) -> FoundCause {
    let ratio = free.material.bulk_kpa / shear_modulus(&free.material);
    let sd = ratio * free.sd[0] / free.material.bulk_kpa;
    FoundCause {
        name: "compressibility",
        category: Category::Material,
        description: "the material is compressible, far from a rubber".into(),
        parameters: vec![("bulk_over_shear_modulus".into(), ratio, [ratio - 1.96 * sd, ratio + 1.96 * sd])],
        location: None,
        evidence,
        effect_rms_mm: free.prediction.trace.plus(-1.0, &stiff.prediction.trace).rms_mm(),
    }
}

/// The cause that the material has more Ogden terms than believed.
fn terms(richer: &Fitted, before: &Fitted, evidence: f64) -> FoundCause {
    let parameters = richer
        .material
        .parameters()
        .into_iter()
        .zip(&richer.sd)
        .filter(|(p, _)| !before.material.parameters().contains(p))
        .map(|(p, sd)| {
            let value = richer.material.value(p);
            (p.name(), value, [value - 1.96 * sd, value + 1.96 * sd])
        })
        .collect();
    FoundCause {
        name: "terms",
        category: Category::Material,
        description: "the material needs a further Ogden term".into(),
        parameters,
        location: None,
        evidence,
        effect_rms_mm: richer.prediction.trace.plus(-1.0, &before.prediction.trace).rms_mm(),
    }
}

/// Causes of a load curve's effects; relaxations are one.
fn load_causes(effects: &[FittedEffect]) -> Vec<FoundCause> {
    let mut causes: Vec<FoundCause> = Vec::new();
    for e in effects {
        let (name, category, description, names): (_, _, &str, &[&str]) = match e.effect {
            LoadEffect::Relaxation => {
                ("relaxation", Category::Material, "the material relaxes under load", &["g", "tau_s"])
            }
            LoadEffect::Mullins => (
                "mullins",
                Category::Material,
                "the material softens with its largest load",
                &["rho", "m_over_largest_work"],
            ),
            LoadEffect::Offset => ("cell", Category::Load, "the load cell does not read zero at rest", &["offset_n"]),
            LoadEffect::Friction => {
                ("cell", Category::Load, "friction adds to the force in the direction of motion", &["friction_n"])
            }
        };
        let count = effects.iter().take_while(|o| !std::ptr::eq(*o, e)).filter(|o| o.effect == e.effect).count();
        let parameters = names.iter().zip(e.values.iter().zip(&e.sd)).map(|(n, (value, sd))| {
            let name = if e.effect == LoadEffect::Relaxation { format!("{n}_{}", count + 1) } else { (*n).to_string() };
            (name, *value, [value - 1.96 * sd, value + 1.96 * sd])
        });
        match causes.iter_mut().find(|c| c.name == name) {
            Some(c) => {
                c.parameters.extend(parameters);
                c.evidence += e.gained;
            }
            None => causes.push(FoundCause {
                name,
                category,
                description: description.into(),
                parameters: parameters.collect(),
                location: None,
                evidence: e.gained,
                effect_rms_mm: 0.0,
            }),
        }
    }
    causes
}

/// What is left of a recording: χ² per datum and the misfit beyond noise, from means over boxes.
fn leftover(observed: &Observed, residual: &Trace, metric: &Metric) -> Leftover {
    const BOXES: [usize; 3] = [12, 4, 9];
    let b = observed.specimen.block;
    let half = [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm];
    let num = BOXES.iter().product::<usize>();
    let (mut chi2, mut count) = (0.0, 0.0);
    let (mut structured, mut weight) = (0.0, 0.0);
    let mut worst: Option<(f64, usize, usize)> = None;
    for (step, field) in residual.displacement.iter().enumerate() {
        let mut sums = vec![[0.0; 3]; num];
        let mut counts = vec![0.0; num];
        for (v, u) in field.iter().enumerate().filter(|(v, _)| metric.is_used(step, *v)) {
            if !u.iter().all(|x| x.is_finite()) {
                continue;
            }
            let x = observed.mask.grid.center_mm(observed.mask.voxels[v] as usize);
            let n = [0, 1, 2].map(|a| {
                let t = (0.5 * (x[a] / half[a] + 1.0) * BOXES[a] as f64).floor().max(0.0);
                (t as usize).min(BOXES[a] - 1)
            });
            let at = n[0] + BOXES[0] * (n[1] + BOXES[1] * n[2]);
            counts[at] += 1.0;
            for c in 0..3 {
                chi2 += (u[c] / observed.noise_sd_mm[c]).powi(2);
                count += 1.0;
                sums[at][c] += u[c];
            }
        }
        for (at, (sum, n)) in sums.iter().zip(&counts).enumerate().filter(|(_, (_, n))| **n > 0.0) {
            for c in 0..3 {
                let noise = observed.noise_sd_mm[c].powi(2) * observed.noise_correlation() / n;
                let excess = (sum[c] / n).powi(2) - noise;
                structured += n * excess;
                weight += n;
                let significance = (sum[c] / n).powi(2) / noise;
                if worst.is_none_or(|w| significance > w.0) {
                    worst = Some((significance, at, c));
                }
            }
        }
    }
    let location = worst.map(|(_, at, c)| {
        let n = [at % BOXES[0], at / BOXES[0] % BOXES[1], at / (BOXES[0] * BOXES[1])];
        let size = [0, 1, 2].map(|a| 2.0 * half[a] / BOXES[a] as f64);
        Location {
            region: format!("largest misfit of u_{}", ["x", "y", "z"][c]),
            center_mm: [0, 1, 2].map(|a| (n[a] as f64 + 0.5) * size[a] - half[a]),
            extent_mm: size,
        }
    });
    Leftover {
        chi2_per_datum: chi2 / f64::max(count, 1.0),
        structured_rms_mm: f64::max(structured / f64::max(weight, 1.0), 0.0).sqrt(),
        location,
    }
}

/// The scene of a diagnosis' causes, for pictures.
pub fn scene_of_fit(fitted: &Fitted) -> Scene {
    scene_of(&fitted.causes)
}
