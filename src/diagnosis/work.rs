//! The steps of a diagnosis: fits, tests of candidates, what is kept back.

use super::causes::{Cause, Course, Inclusion, SoftBond, registry};
use super::diagnose::DiagnosisOptions;
use super::error::DiagnosisError;
use super::experiment::{Experiment, experiments};
use super::fibre_map::fibre_directions;
use super::fit::{BulkPrior, FitSettings, Fitted, STEP, Supposed, deviance_at, fit, paths_of, scene_of, shear_modulus};
use super::laboratory::Laboratory;
use super::load_history::ElasticTable;
use super::maps::{ScoreMap, change_of_ball, debond_map, inclusion_map, log_factor_of_ball};
use super::memory_kernel::{KernelState, MemoryKernel};
use super::metric::Metric;
use super::scene::Scene;
use super::score::ScoreTest;
use super::trace::Trace;
use crate::calibration::Observed;
use crate::material::{MAX_TERMS, Ogden, OgdenTerm};
use std::sync::Arc;

/// Exponents tried for a further Ogden term.
const EXPONENTS: [f64; 5] = [-6.0, -2.0, 5.0, 9.0, 14.0];
/// Leaps of a cause after its fit, and how much worse than the fit (in deviance) the start of a further one may be.
const MAX_LEAPS: usize = 3;
const WORSE_BEFORE_BETTER: f64 = 1.5;
/// Fits of leading causes per round.
const MAX_FITS: usize = 5;
/// A cause is fitted where it explains more than this part of what the leading one does, to first order.
const WORTH_A_FIT: f64 = 0.1;
/// An effect is physics where its displacement exceeds this part of the allowance (rms), or its force its own allowance.
const SMALLEST_EFFECT: f64 = 1.0;
/// Drives of the load curve's table.
const TABLE_POINTS: usize = 8;
/// The drive that stands for rest, as a part of the largest.
const SMALL_DRIVE: f64 = 1e-3;
/// A cause must lower the deviance by this much beyond ln n per parameter: very strong evidence, many times over, because
/// many causes are tried.
pub(super) const EVIDENCE: f64 = 30.0;
/// κ is looked at where the data pull it below the believed one by this many standard deviations of ln κ…
const PULL_OF_BULK: f64 = 1.5;
/// … which then is as good as known, or as good as free.
pub(super) const KNOWN_BULK: f64 = 0.02;
pub(super) const FREE_BULK: f64 = 3.0;

/// ln n per parameter.
pub(super) fn penalty(metric: &Metric, num_parameters: usize) -> f64 {
    num_parameters as f64 * (metric.num_data() as f64).ln()
}

/// Whether a change of the prediction is large enough to be more than a mesh's.
pub(super) fn is_large(observed: &Observed, effect: &Trace, allowance_mm: f64) -> bool {
    let force = observed
        .steps
        .iter()
        .zip(&effect.force)
        .filter_map(|(s, change)| s.force.map(|f| change.abs() > 4.0 * f.sd_n + 0.01 * f.value_n.abs()))
        .any(|large| large);
    let last = Trace { displacement: effect.displacement.last().cloned().into_iter().collect(), force: vec![] };
    force || last.rms_mm() > SMALLEST_EFFECT * allowance_mm
}

/// The material as believed, or a neo-Hookean one with the modulus of the measured force.
pub(super) fn first_guess(
    laboratory: &mut Laboratory,
    options: &DiagnosisOptions,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Ogden, DiagnosisError> {
    if let Some(prior) = &options.prior {
        return Ok(prior.clone());
    }
    // A neo-Hookean guess, its modulus scaled to the measured force; κ/μ of a rubber.
    let mut material = Ogden { bulk_kpa: 2000.0, terms: vec![OgdenTerm { mu_kpa: 16.0, alpha: 2.0 }] };
    let predicted = laboratory.predict(&material, &Scene::default(), is_cancelled)?;
    let forces = laboratory.measured().force;
    let ratio = |n: &usize| forces[*n] / predicted.trace.force[*n];
    if let Some(r) = (0..forces.len()).filter(|n| forces[*n].abs() > 0.0).map(|n| ratio(&n)).find(|r| *r > 0.0) {
        material.terms[0].mu_kpa *= r;
        material.bulk_kpa *= r;
    }
    Ok(material)
}

/// A cause to fit, its start, and what it explains to first order.
#[derive(Clone)]
pub(super) struct Candidate {
    pub(super) cause: Arc<dyn Cause>,
    pub(super) values: Vec<f64>,
    pub(super) score: f64,
}

/// Soft bonds of the whole faces (`directions`: fixed, moved), where no compliance must be negative to explain most.
fn soft_bond(test: &ScoreTest, directions: &[Trace]) -> Option<Candidate> {
    let both = test.test(directions);
    let (score, start) = if both.coefficients.iter().all(|c| *c > 0.0) {
        (both.explained, [both.coefficients[0], both.coefficients[1]])
    } else {
        let alone = [0, 1].map(|face| test.test(&directions[face..=face]));
        let explained = |face: usize| if alone[face].coefficients[0] > 0.0 { alone[face].explained } else { 0.0 };
        let face = usize::from(explained(1) > explained(0));
        let mut start = [0.0; 2];
        start[face] = alone[face].coefficients[0].max(0.0);
        (explained(face), start)
    };
    let cause = SoftBond { start_mm_per_kpa: start };
    (score > 0.0).then(|| Candidate { values: cause.start(), cause: Arc::new(cause), score })
}

/// The candidates worth a full fit: the best of each name, most explaining first.
pub(super) fn leading(candidates: &[Candidate]) -> Vec<&Candidate> {
    let mut chosen: Vec<&Candidate> = Vec::new();
    let top = candidates.first().map_or(0.0, |c| c.score);
    for c in candidates {
        let is_worth = c.score > EVIDENCE && c.score > WORTH_A_FIT * top;
        // Two holes, faces or directions are different suspects of one name.
        let is_new = chosen.iter().filter(|o| o.cause.name() == c.cause.name()).count()
            < if matches!(c.cause.name(), "debond" | "hole" | "fibre" | "inclusion") { 2 } else { 1 };
        if is_worth && is_new && chosen.len() < MAX_FITS {
            chosen.push(c);
        }
    }
    chosen
}

/// What the steps share.
pub(super) struct Work<'a, 'b> {
    pub(super) laboratory: &'a mut Laboratory<'b>,
    pub(super) metric: &'a Metric,
    pub(super) settings: FitSettings,
    /// κ of the nominal model.
    pub(super) nominal_bulk: BulkPrior,
    pub(super) is_cancelled: &'a dyn Fn() -> bool,
    pub(super) allowance_mm: f64,
    pub(super) left_out: &'a [String],
}

impl Work<'_, '_> {
    pub(super) fn is_left_out(&self, name: &str) -> bool {
        self.left_out.iter().any(|n| n == name)
    }

    /// Where the data pull κ far below that of a rubber: the fits with κ as believed and with κ free, and the evidence.
    pub(super) fn compressibility(
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

    pub(super) fn fit(
        &mut self,
        measured: &Trace,
        material: &Ogden,
        causes: &[Supposed],
    ) -> Result<Fitted, DiagnosisError> {
        fit(self.laboratory, self.metric, measured, material, causes, &self.settings, self.is_cancelled)
    }

    /// As [`Self::fit`], and then from where the last cause could leap to, as long as that explains more.
    pub(super) fn fit_with_leaps(
        &mut self,
        measured: &Trace,
        material: &Ogden,
        causes: &[Supposed],
    ) -> Result<Fitted, DiagnosisError> {
        let mut found = self.fit(measured, material, causes)?;
        for _ in 0..MAX_LEAPS {
            let Some(last) = found.causes.last() else { break };
            let mut best: Option<(f64, Vec<Supposed>)> = None;
            for values in last.cause.leaps(&last.values) {
                let mut leapt = found.causes.clone();
                if let Some(last) = leapt.last_mut() {
                    last.values = values;
                }
                let deviance = deviance_at(
                    self.laboratory,
                    self.metric,
                    measured,
                    &found.material,
                    &leapt,
                    &self.settings,
                    self.is_cancelled,
                );
                match deviance {
                    Ok(deviance) if best.as_ref().is_none_or(|b| deviance < b.0) => best = Some((deviance, leapt)),
                    Err(error) if (self.is_cancelled)() => return Err(error),
                    _ => {}
                }
            }
            // The material has not followed yet: somewhat worse may become better.
            let Some((_, leapt)) = best.filter(|b| b.0 < WORSE_BEFORE_BETTER * found.deviance) else { break };
            match self.fit(measured, &found.material, &leapt) {
                Ok(other) if other.deviance < found.deviance - EVIDENCE => found = other,
                Err(error) if (self.is_cancelled)() => return Err(error),
                _ => break,
            }
        }
        Ok(found)
    }

    /// The nominal model: as many terms as the prior material, or one or two as the data call for.
    pub(super) fn nominal(
        &mut self,
        measured: &Trace,
        start: &Ogden,
        is_fixed: bool,
    ) -> Result<Fitted, DiagnosisError> {
        let one = self.fit(measured, start, &[])?;
        if is_fixed {
            return Ok(one);
        }
        Ok(self.further_term(measured, &one)?.map_or(one, |found| found.0))
    }

    /// The fit with one more Ogden term and its evidence, where the data call for it.
    pub(super) fn further_term(
        &mut self,
        measured: &Trace,
        one: &Fitted,
    ) -> Result<Option<(Fitted, f64)>, DiagnosisError> {
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

    /// F∞ over drive with its derivatives with respect to scaled material parameters, κ apart, and its memory.
    pub(super) fn elastic_table(
        &mut self,
        fitted: &Fitted,
        largest_mm: f64,
    ) -> Result<(ElasticTable, MemoryKernel), DiagnosisError> {
        // The first one stands for rest.
        let parts = std::iter::once(SMALL_DRIVE).chain((1..=TABLE_POINTS).map(|n| n as f64 / TABLE_POINTS as f64));
        let drives: Vec<f64> = parts.map(|part| part * largest_mm).collect();
        let rows = self.laboratory.load_curve(&fitted.material, &fitted.scene(), &drives, self.is_cancelled)?;
        let parameters = fitted.material.parameters();
        let at_rest = |values: Vec<f64>| -> Vec<f64> { std::iter::once(0.0).chain(values).collect() };
        let forces = at_rest(rows.iter().map(|r| r.0).collect());
        let derivatives: Vec<Vec<f64>> = (1..parameters.len())
            .map(|i| at_rest(rows.iter().map(|r| r.1[i] * fitted.material.value(parameters[i])).collect()))
            .collect();
        let table = ElasticTable::new(&at_rest(drives), &forces, &derivatives)?;
        let states: Vec<KernelState> = rows.into_iter().map(|r| r.2).collect();
        let kernel = MemoryKernel::new(&states).ok_or(DiagnosisError::Setting {
            name: "the number of drives of the load curve's table",
            value: states.len() as f64,
            requirement: "at least one rising drive",
        })?;
        Ok((table, kernel))
    }

    /// All candidates, most explaining first.
    pub(super) fn candidates(
        &mut self,
        current: &Fitted,
        has_curve: bool,
        round: usize,
        maps: &mut Vec<(String, ScoreMap)>,
    ) -> Result<Vec<Candidate>, DiagnosisError> {
        let specimen = self.laboratory.observed().specimen.clone();
        let scene = current.scene();
        let drives: Vec<f64> = self.laboratory.observed().steps.iter().map(|s| s.drive_mm).collect();
        let has_several_drives = drives.iter().any(|d| (d - drives[0]).abs() > 0.0);
        let list: Vec<Arc<dyn Cause>> = registry(&specimen)
            .into_iter()
            .filter(|c| !(has_curve && c.name() == "cell"))
            .filter(|c| has_several_drives || !c.needs_several_drives())
            .filter(|c| !self.is_left_out(c.name()))
            // One of a kind: what is in the fit already is free there.
            .filter(|c| !current.causes.iter().any(|s| s.cause.description() == c.description()))
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
                paths.split_off(paths.len() - cause.parameters().len())
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
            let otherwise = match cause.course() {
                Course::Alike => 1,
                Course::InProportion => -1,
                Course::ItsOwn => 0,
            };
            let is_refuted = has_several_drives && otherwise != 0 && {
                let changed: Vec<Trace> = directions.iter().map(|d| self.over_the_drive(d, otherwise)).collect();
                test.test(&changed).explained > score.explained + EVIDENCE
            };
            directions = rest;
            if is_refuted {
                continue;
            }
            let mut values = cause.start();
            for ((value, c), p) in values.iter_mut().zip(&score.coefficients).zip(cause.parameters()) {
                // First order may overshoot: start a fit at most a few scales away.
                *value = (*value + c.clamp(-5.0, 5.0) * p.scale).clamp(p.range[0], p.range[1]);
            }
            candidates.push(Candidate { cause: cause.clone(), values, score: score.explained });
        }
        if scene.fibre.is_none() && !self.is_left_out("fibre") {
            for (score, cause, modulus_kpa) in
                fibre_directions(self.laboratory, &current.material, &scene, &current.prediction, &test)?
            {
                candidates.push(Candidate { values: vec![modulus_kpa, 0.0, 0.0], cause: Arc::new(cause), score });
            }
        }
        if round == 1 || current.causes.is_empty() {
            let mut whole = Vec::new();
            for is_moved in [false, true] {
                let found = debond_map(self.laboratory, &current.material, &current.prediction, &test, is_moved)?;
                maps.push((format!("bond of the {} plate", if is_moved { "moved" } else { "fixed" }), found.map));
                if let Some((score, cause)) = found.debond.filter(|_| !self.is_left_out("debond")) {
                    candidates.push(Candidate { values: cause.start(), cause: Arc::new(cause), score });
                }
                whole.push(found.whole);
            }
            if !self.is_left_out("bond") {
                candidates.extend(soft_bond(&test, &whole));
            }
            let (map, balls) = inclusion_map(self.laboratory, &current.material, &current.prediction, &test)?;
            maps.push(("stiffness of the sample".into(), map));
            if !self.is_left_out("inclusion") {
                let top = candidates.iter().fold(0.0, |top: f64, c| top.max(c.score));
                candidates.extend(self.inclusions(current, &test, top, balls)?);
            }
        }
        candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(candidates)
    }

    /// The inclusions worth a full fit, of `balls` that explain much to first order. Where one may lead, each is tried with its
    /// full stiffness, which first order tells badly; the best stiff and the best soft one are taken, because one above the
    /// middle and its opposite below look alike.
    fn inclusions(
        &mut self,
        current: &Fitted,
        test: &ScoreTest,
        top: f64,
        balls: Vec<(f64, Inclusion)>,
    ) -> Result<Vec<Candidate>, DiagnosisError> {
        let best = balls.first().map_or(0.0, |b| b.0);
        let is_worth = best > EVIDENCE && best > WORTH_A_FIT * top;
        let mut tried: Vec<(f64, Candidate)> = Vec::new();
        for (score, ball) in balls.into_iter().take(if is_worth { usize::MAX } else { 1 }) {
            let log_factor = ball.log_factor;
            let (mut values, cause) = (ball.start(), Arc::new(ball) as Arc<dyn Cause>);
            let mut explained = score;
            if is_worth {
                let supposed = [Supposed { cause: cause.clone(), values: values.clone() }];
                match self.laboratory.predict(&current.material, &scene_of(&supposed), self.is_cancelled) {
                    Ok(found) => {
                        let change = found.trace.plus(-1.0, &current.prediction.trace);
                        let shape = test.test(std::slice::from_ref(&change));
                        // More or less of the same shape; the other sign is another ball's.
                        let part = shape.coefficients[0];
                        explained = if part > 0.0 { shape.explained } else { 0.0 };
                        values[0] = log_factor_of_ball(part.max(0.1) * change_of_ball(log_factor));
                    }
                    Err(error) if (self.is_cancelled)() => return Err(error),
                    Err(_) => continue,
                }
            }
            tried.push((explained, Candidate { cause, values, score }));
        }
        tried.sort_by(|a, b| b.0.total_cmp(&a.0));
        let first = |is_stiff: bool| tried.iter().position(|(_, c)| (c.values[0] > 0.0) == is_stiff);
        let mut places: Vec<usize> = [first(true), first(false)].into_iter().flatten().collect();
        places.sort_unstable();
        Ok(places.into_iter().map(|n| Candidate { score: best, ..tried[n].1.clone() }).collect())
    }

    /// A change times a power of the drive: what is alike at every drive is made to grow with it (1), or what grows is made alike
    /// (−1).
    fn over_the_drive(&self, trace: &Trace, power: i32) -> Trace {
        let steps = &self.laboratory.observed().steps;
        let largest = steps.iter().fold(f64::MIN_POSITIVE, |a, s| a.max(s.drive_mm.abs()));
        // A step near rest tells neither from the other.
        let factor = |drive_mm: f64| {
            let part = drive_mm / largest;
            if part.abs() > 1e-3 { part.powi(power) } else { 0.0 }
        };
        let displacement = trace
            .displacement
            .iter()
            .zip(steps)
            .map(|(field, step)| field.iter().map(|u| u.map(|x| x * factor(step.drive_mm))).collect())
            .collect();
        let force = trace.force.iter().zip(steps).map(|(f, step)| f * factor(step.drive_mm)).collect();
        Trace { displacement, force }
    }

    /// Further steps that would tell two fits apart.
    pub(super) fn experiments(
        &mut self,
        mesh_factor: f64,
        pair: [&Fitted; 2],
    ) -> Result<Vec<Experiment>, DiagnosisError> {
        let (allowance, settings) = (self.allowance_mm, self.settings);
        experiments(self.laboratory, self.metric, mesh_factor, allowance, &settings, pair, self.is_cancelled)
    }

    /// Rms misfit on blocks of voxels that the fits did not see, without and with the causes: two halves in turn.
    pub(super) fn kept_back(
        &mut self,
        seen: &[Trace; 2],
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
                    &seen[n],
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
pub(super) fn block_fold(observed: &Observed) -> Vec<bool> {
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
