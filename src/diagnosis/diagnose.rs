//! The diagnosis: fit the nominal model, look at what is left, suppose causes, fit them, and prove them on data kept
//! back.

use super::cause_fit::CauseFit;
use super::conclusion::{explain_too_little, kept_back, verdict_on};
use super::error::DiagnosisError;
use super::evidence::UNEXPLAINED;
use super::findings::Findings;
use super::found::FoundCause;
use super::inference::{Inference, KNOWN_LOG_SD};
use super::interior::{InteriorTest, test_interior};
use super::laboratory::Laboratory;
use super::leftover::leftover;
use super::load_curve::{largest_drive_mm, read_load_curve, take_off_effects};
use super::load_history::LoadHistoryFit;
use super::material_cause::{MaterialCase, Recheck};
use super::mesh_error::{Finer, MeshDefect, widen};
use super::metric::Metric;
use super::nominal::{first_guess, fit_nominal};
use super::options::DiagnosisOptions;
use super::outcome::Diagnosis;
use super::prior::{BulkPrior, FitSettings, ShearPrior, shear_modulus};
use super::registry::Registry;
use super::rounds::{Asked, RoundLimits, add_causes, fit_round, score_round};
use super::set_up::{fit_set_up, is_set_up_promising, simplest_set_up};
use super::supposed::Supposed;
use super::thinning::{Needed, named_causes, thinned};
use super::trace::Trace;
use crate::calibration::{Boundary, Observed};
use crate::material::Ogden;
use crate::mesh::MeshOptions;
use crate::recording::Recording;
use std::cell::{Cell, RefCell};

/// Standard deviation of ln κ of the material believed.
const BELIEVED_LOG_SD: f64 = 0.5;
/// Most iterations of a fit.
const MAX_ITERATIONS: usize = 12;
/// A fit ends when a step would lower the deviance by less than this.
const TOLERANCE: f64 = 0.3;
/// The allowance where none is stated, as a part of the largest drive.
const ALLOWANCE_OF_DRIVE: f64 = 1e-3;

/// The set-up as a whole is looked at where single causes leave more than this part of the misfit (rms), or more than
/// could be called explained.
const SET_UP_LEAVES: f64 = 0.25;
/// It is gone on from where it leaves less than this part of what they leave (rms).
const SET_UP_GAINS: f64 = 0.7;

/// Single causes are given up for the set-up where the first explains less than this part of the deviance, or where one
/// explains a smaller part of what was left than the one before it did.
const LEAST_OF_FIRST: f64 = 0.2;

/// The interior is tested where the misfit beyond noise exceeds this multiple of the allowance (rms).
const INTERIOR_ABOVE: f64 = 2.0;

/// The artefacts among the causes of a fit.
fn artefacts_of(fitted: &CauseFit) -> Vec<Supposed> {
    fitted.causes.iter().filter(|c| c.cause.is_artefact()).cloned().collect()
}

/// Whether causes that leave `left_mm` of `before_mm` (rms) explain a misfit as far as single causes can be asked to:
/// else the set-up as a whole is fitted in their place.
fn is_explained(left_mm: f64, before_mm: f64, allowance_mm: f64) -> bool {
    left_mm < (SET_UP_LEAVES * before_mm).max(allowance_mm) && left_mm < UNEXPLAINED * allowance_mm
}

/// Whether causes, found one after the other, explain less and less of what was left (`lefts`, before the first and
/// after each): right ones explain more and more of it, down to nothing.
fn explain_ever_less(lefts: &[f64]) -> bool {
    let shares: Vec<f64> = lefts.windows(2).map(|pair| 1.0 - pair[1] / pair[0]).collect();
    match shares[..] {
        [] => false,
        [first] => first < LEAST_OF_FIRST,
        [.., before, last] => last < before,
    }
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
    let registry = Registry::standard().without(&options.left_out)?;
    let registry = match options.boundary {
        Boundary::Commanded => registry,
        Boundary::Measured => registry.without_boundary(),
    };
    diagnose_among(&registry, recording, options, progress, is_cancelled)
}

/// As [`diagnose`], with the causes of `registry`.
///
/// # Errors
/// As [`diagnose`].
pub(super) fn diagnose_among(
    registry: &Registry,
    recording: &Recording,
    options: &DiagnosisOptions,
    progress: &dyn Fn(&str),
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Diagnosis, DiagnosisError> {
    options.check()?;
    let observed = Observed::new(recording, options.force_sd_n)?.with_boundary(options.boundary)?;
    let mut run = Run::begin(&observed, registry, options, progress, is_cancelled)?;
    run.read_load_curve(recording)?;
    run.correct_mesh()?;
    run.test_interior()?;
    run.question_material()?;
    run.take_out_artefacts()?;
    run.add_causes()?;
    run.question_material_again()?;
    run.name_artefacts();
    let seen = run.correct_fits()?;
    run.conclude(&seen)
}

/// A diagnosis at work: its stages are its methods, in the order of [`diagnose_among`].
struct Run<'a> {
    registry: &'a Registry,
    options: &'a DiagnosisOptions,
    observed: &'a Observed,
    inference: Inference<'a>,
    /// The finer mesh; `None` where ours is fine already, or the finer one cannot be meshed.
    finer: Option<Finer<'a>>,
    /// The material from which nominal fits start.
    start: Ogden,
    /// Displacement unknowns of the model.
    num_unknowns: usize,
    /// What was recorded, less what the load curve's effects add.
    recorded: Trace,
    /// The load curve.
    load: Option<LoadHistoryFit>,
    /// What the finer mesh predicts beyond ours.
    mesh_defect: Option<MeshDefect>,
    /// What the interior test found, where it was made.
    interior: Option<InteriorTest>,
    findings: Findings,
}

impl<'a> Run<'a> {
    /// Prepares the models and fits the nominal one.
    fn begin(
        observed: &'a Observed,
        registry: &'a Registry,
        options: &'a DiagnosisOptions,
        progress: &'a dyn Fn(&str),
        is_cancelled: &'a dyn Fn() -> bool,
    ) -> Result<Run<'a>, DiagnosisError> {
        let mesh_factor = options.mesh_factor;
        let allowance_mm = options.allowance_mm.unwrap_or(ALLOWANCE_OF_DRIVE * largest_drive_mm(observed));
        let metric = Metric::new(observed, allowance_mm, &|_| true);
        let mut laboratory = Laboratory::new(observed, &MeshOptions::scaled(&observed.specimen, mesh_factor))?;
        let num_unknowns = laboratory.num_unknowns()?;
        let recorded = laboratory.measured();
        let start = first_guess(&mut laboratory, options.prior.as_ref(), is_cancelled)?;
        // Without a force the modulus is that of the first guess; what is fitted are ratios and shapes.
        let has_force = observed.steps.iter().any(|s| s.force.is_some());
        let shear = (!has_force).then(|| ShearPrior { center_kpa: shear_modulus(&start), log_sd: KNOWN_LOG_SD });
        let believed_bulk = BulkPrior { center_kpa: start.bulk_kpa, log_sd: BELIEVED_LOG_SD };
        let settings = FitSettings {
            max_iterations: MAX_ITERATIONS,
            bulk: believed_bulk,
            shear,
            tolerance: TOLERANCE,
            relative_tolerance: 0.0,
        };
        progress(&format!("fitting the nominal model ({num_unknowns} unknowns)"));
        let mut inference = Inference {
            laboratory,
            metric,
            settings,
            nominal_bulk: believed_bulk,
            believed_bulk,
            allowance_mm,
            discrepancy_mm2: [0.0; 3],
            mesh_factor,
            is_cancelled,
            progress,
        };
        let nominal = fit_nominal(&mut inference, &recorded, &start, options.prior.is_some())?;
        Ok(Run {
            registry,
            options,
            observed,
            inference,
            finer: None,
            start,
            num_unknowns,
            recorded,
            load: None,
            mesh_defect: None,
            interior: None,
            findings: Findings::of_nominal(nominal),
        })
    }

    fn tell(&self, what: &str) {
        (self.inference.progress)(what);
    }

    fn is_cancelled(&self) -> bool {
        (self.inference.is_cancelled)()
    }

    /// Fits the nominal model to `measured` and goes on from it.
    fn fit_nominal(&mut self, measured: &Trace, start: &Ogden) -> Result<(), DiagnosisError> {
        let nominal = fit_nominal(&mut self.inference, measured, start, self.options.prior.is_some())?;
        self.findings.restart_from(nominal);
        Ok(())
    }

    /// What our mesh would have shown of what was recorded, were it not for its own error.
    fn measured(&self) -> Trace {
        self.mesh_defect.as_ref().map_or_else(|| self.recorded.clone(), |d| d.taken_off(&self.recorded))
    }

    /// Reads the load curve. What time and the load cell add to the forces is taken off before the model is compared.
    fn read_load_curve(&mut self, recording: &Recording) -> Result<(), DiagnosisError> {
        self.tell("reading the load curve");
        let effects = self.registry.load_effects();
        self.load = read_load_curve(&mut self.inference, recording, &self.findings.nominal, &effects)?;
        if take_off_effects(&mut self.recorded, self.load.as_ref()) {
            let effects = self.load.as_ref().map_or(&[][..], |l| &l.effects);
            self.findings.causes.extend(FoundCause::of_load_curve(effects));
            self.tell("refitting with the load curve's effects taken off");
            let (recorded, start) = (self.recorded.clone(), self.start.clone());
            self.fit_nominal(&recorded, &start)?;
        }
        Ok(())
    }

    /// Takes off what our mesh gets wrong of the nominal model, before a misfit is looked for.
    fn correct_mesh(&mut self) -> Result<(), DiagnosisError> {
        self.finer = Finer::new(self.observed, self.options.mesh_factor);
        let Some(finer) = self.finer.as_mut() else { return Ok(()) };
        (self.inference.progress)("predicting on a finer mesh");
        match finer.defect(&self.findings.nominal, self.inference.is_cancelled) {
            Ok(found) => {
                self.mesh_defect = Some(found);
                let (measured, start) = (self.measured(), self.findings.nominal.material.clone());
                self.fit_nominal(&measured, &start)
            }
            Err(error) if self.is_cancelled() => Err(error),
            Err(_) => {
                self.tell("a finer model has no equilibrium: the mismatch is that against this mesh");
                Ok(())
            }
        }
    }

    /// Asks of a misfit that is more than a mesh's whether it was made at the boundary or inside.
    fn test_interior(&mut self) -> Result<(), DiagnosisError> {
        let nominal = &self.findings.nominal;
        let left = leftover(self.observed, &nominal.residual, &self.inference.metric);
        let is_inside = self.observed.has_measured_faces();
        if !is_inside && left.structured_rms_mm > INTERIOR_ABOVE * self.inference.allowance_mm {
            self.interior = test_interior(&self.inference, self.observed, &nominal.residual, &nominal.material)?;
        }
        Ok(())
    }

    /// Looks for causes in the material's own law.
    fn question_material(&mut self) -> Result<(), DiagnosisError> {
        let measured = self.measured();
        for cause in self.registry.material_causes() {
            let Findings { nominal, current, .. } = &self.findings;
            let case =
                MaterialCase { measured: &measured, nominal, current, is_believed: self.options.prior.is_some() };
            if let Some(finding) = cause.look(&mut self.inference, &case)? {
                self.findings.causes.push(finding.found);
                self.findings.current = finding.current;
                if let Some(nominal) = finding.nominal {
                    self.findings.nominal = nominal;
                }
            }
        }
        Ok(())
    }

    /// Finds the artefacts of the image in what the fit so far leaves, and fits their sizes.
    fn take_out_artefacts(&mut self) -> Result<(), DiagnosisError> {
        let current = &self.findings.current;
        let found = self.registry.artefacts(self.observed, &current.residual, self.inference.progress);
        if !found.is_empty() {
            let measured = self.measured();
            self.findings.current = self.inference.fit(&measured, &self.findings.current.material, &found)?;
        }
        Ok(())
    }

    /// Tests, fits and names causes, round by round. Where the interior test found that the inside fits, causes there
    /// wait. Where single causes leave much of the misfit, the set-up as a whole is fitted in their place, and rounds
    /// go on from that.
    fn add_causes(&mut self) -> Result<(), DiagnosisError> {
        let measured = self.measured();
        let limits = RoundLimits { max_causes: self.options.max_causes, has_load_curve: self.load.is_some() };
        if self.findings.causes.len() >= limits.max_causes {
            return Ok(());
        }
        let at_boundary = self.registry.clone().without_inside();
        let everything = Asked { registry: self.registry, with_terms: self.options.prior.is_none() };
        let does_inside_wait = self.interior.as_ref().is_some_and(InteriorTest::inside_fits);
        let first = if does_inside_wait { Asked { registry: &at_boundary, with_terms: false } } else { everything };
        let Run { inference, findings, observed, .. } = self;
        let scored = score_round(inference, first, findings, limits)?;
        let left_mm =
            |fitted: &CauseFit, metric: &Metric| leftover(observed, &fitted.residual, metric).structured_rms_mm;
        let before_mm = left_mm(&findings.current, &inference.metric);
        // What is no more than a mesh's needs no set-up.
        let is_promising = before_mm > inference.allowance_mm
            && is_set_up_promising(inference, first.registry, &findings.current, &scored.candidates)?;
        // What was left of the deviance after each cause so far.
        let lefts = RefCell::new(vec![inference.misfit_beyond_noise(&findings.current)]);
        let are_given_up = Cell::new(false);
        let to_ask = |inference: &Inference, findings: &Findings| {
            let left = left_mm(&findings.current, &inference.metric);
            lefts.borrow_mut().push(inference.misfit_beyond_noise(&findings.current));
            let is_explained = is_explained(left, before_mm, inference.allowance_mm);
            are_given_up.set(is_promising && !is_explained && explain_ever_less(&lefts.borrow()));
            let asked = if is_explained { everything } else { first };
            (!are_given_up.get()).then_some(asked)
        };
        if fit_round(inference, findings, &measured, &scored)? {
            add_causes(inference, findings, &measured, limits, &to_ask)?;
        }
        let is_set_up = is_promising && self.consider_set_up(&measured)?;
        let num_before = self.findings.current.causes.len();
        let Run { inference, registry, findings, .. } = self;
        if is_set_up || does_inside_wait || are_given_up.get() {
            // On top of the set-up; or, where single causes were given up for nothing or not all were asked, on with
            // them.
            add_causes(inference, findings, &measured, limits, &|_, _| Some(everything))?;
        }
        if is_set_up && findings.current.causes.len() > num_before {
            findings.current = simplest_set_up(inference, registry, &measured, findings.current.clone())?;
            self.name_causes_of_fit()?;
        } else if !is_set_up {
            self.leave_out_what_is_not_needed(&measured)?;
        }
        Ok(())
    }

    /// Takes out of the fit the causes that later ones have made needless.
    fn leave_out_what_is_not_needed(&mut self, measured: &Trace) -> Result<(), DiagnosisError> {
        let Run { inference, findings, .. } = self;
        let num_causes = findings.current.causes.len();
        if num_causes > 1 {
            findings.current = thinned(inference, measured, findings.current.clone(), Needed::ByEvidence)?;
            if findings.current.causes.len() < num_causes {
                self.name_causes_of_fit()?;
            }
        }
        Ok(())
    }

    /// Fits the set-up as a whole where what was named so far leaves much of the misfit, and goes on from it where it
    /// explains much more; whether it does.
    fn consider_set_up(&mut self, measured: &Trace) -> Result<bool, DiagnosisError> {
        let left = |run: &Self, fitted: &CauseFit| {
            leftover(run.observed, &fitted.residual, &run.inference.metric).structured_rms_mm
        };
        let (before, single) = (left(self, &self.findings.nominal), left(self, &self.findings.current));
        let is_explained = is_explained(single, before, self.inference.allowance_mm);
        if is_explained || self.registry.set_up(self.observed).is_empty() {
            return Ok(false);
        }
        self.tell("fitting the set-up as a whole: plates, rig, layers, block");
        // Without the further terms that the nominal fit took to make up for the set-up.
        let start = CauseFit {
            material: self.start.clone(),
            causes: artefacts_of(&self.findings.current),
            ..self.findings.nominal.clone()
        };
        let Run { inference, registry, .. } = self;
        let fitted = match fit_set_up(inference, registry, measured, &start) {
            Ok(fitted) => simplest_set_up(inference, registry, measured, fitted),
            Err(error) => Err(error),
        };
        match fitted {
            Ok(fitted) if left(self, &fitted) < SET_UP_GAINS * single => {
                let Findings { nominal, current, causes, alternatives, .. } = &mut self.findings;
                *current = fitted;
                nominal.deviance = self.inference.misfit_of(&nominal.residual);
                causes.retain(|c| !c.is_of_fit());
                alternatives.clear();
                self.name_causes_of_fit()?;
                Ok(true)
            }
            Err(error) if self.is_cancelled() => Err(error),
            _ => {
                self.inference.forget_discrepancy();
                Ok(false)
            }
        }
    }

    /// Names the causes that are in the fit, with the evidence for each among all others.
    fn name_causes_of_fit(&mut self) -> Result<(), DiagnosisError> {
        let named = named_causes(&mut self.inference, &self.findings.current)?;
        self.findings.causes.retain(|c| !c.is_of_fit());
        self.findings.causes.extend(named);
        Ok(())
    }

    /// Looks again at the causes in the material's law, now that other causes are in the fit.
    fn question_material_again(&mut self) -> Result<(), DiagnosisError> {
        if self.findings.current.causes.is_empty() {
            return Ok(());
        }
        let measured = self.measured();
        for cause in self.registry.material_causes() {
            let Some(place) = self.findings.causes.iter().position(|c| c.name == cause.name()) else { continue };
            let Findings { nominal, current, .. } = &self.findings;
            let case =
                MaterialCase { measured: &measured, nominal, current, is_believed: self.options.prior.is_some() };
            match cause.look_again(&mut self.inference, &case)? {
                Recheck::Needed(None) => {}
                Recheck::Needed(Some(evidence)) => self.findings.causes[place].evidence = evidence,
                Recheck::NotNeeded(without) => {
                    self.findings.causes.remove(place);
                    self.findings.current = *without;
                }
            }
        }
        Ok(())
    }

    /// Names the artefacts of the image, even where nothing else is named.
    fn name_artefacts(&mut self) {
        let evidence = self.findings.explained();
        let Findings { current, causes, .. } = &mut self.findings;
        for (index, _) in current.causes.iter().enumerate().filter(|(_, c)| c.cause.is_artefact()) {
            causes.push(FoundCause::of_fit(current, index, self.observed).with_evidence(evidence, 0.0));
        }
    }

    /// Corrects both fits, without and with the causes, by the finer mesh, and widens their intervals by what meshes
    /// do. Gives what each of the two is compared with.
    fn correct_fits(&mut self) -> Result<[Trace; 2], DiagnosisError> {
        self.tell("correcting by a finer mesh");
        let measured = self.measured();
        let mut seen = [measured.clone(), measured];
        let with_causes = self.inference.settings;
        let settings = [FitSettings { bulk: self.inference.nominal_bulk, ..with_causes }, with_causes];
        for n in 0..2 {
            if let Some(defect) = self.correct_fit(n, &settings[n])? {
                seen[n] = defect.taken_off(&self.recorded);
                self.mesh_defect = Some(defect);
            }
        }
        Ok(seen)
    }

    /// Corrects one fit, the nominal one (0) or that with the causes (1); gives what the finer mesh predicts beyond
    /// ours.
    fn correct_fit(&mut self, n: usize, settings: &FitSettings) -> Result<Option<MeshDefect>, DiagnosisError> {
        let Run { inference, finer, findings, recorded, .. } = self;
        let Inference { laboratory, metric, mesh_factor, is_cancelled, progress, .. } = inference;
        let (mesh_factor, is_cancelled, progress) = (*mesh_factor, *is_cancelled, *progress);
        let fitted = if n == 0 { &mut findings.nominal } else { &mut findings.current };
        let correction =
            finer.as_mut().map(|f| f.correct(laboratory, metric, recorded, settings, fitted, is_cancelled));
        let defect = match correction.transpose() {
            Err(error) if is_cancelled() => return Err(error),
            Err(_) => {
                progress("a finer model has no equilibrium: estimates are those of this mesh");
                None
            }
            Ok(defect) => defect,
        };
        match widen(laboratory, mesh_factor, metric, settings, fitted, defect.as_ref(), is_cancelled) {
            Err(error) if is_cancelled() => return Err(error),
            Err(_) => progress("a coarser model has no equilibrium: the intervals are those of the noise"),
            Ok(()) => {}
        }
        Ok(defect)
    }

    /// Looks at what is left, predicts data that were kept back, and says how the diagnosis ended.
    fn conclude(mut self, seen: &[Trace; 2]) -> Result<Diagnosis, DiagnosisError> {
        let Findings { nominal, mut current, mut causes, mut alternatives, ranked, maps, .. } = self.findings;
        (self.inference.progress)("predicting voxel blocks that were kept back");
        let kept_back = kept_back(&mut self.inference, seen, [&nominal, &current])?;
        if self.inference.accepts_discrepancy() {
            // What is left is no noise: neighbours share it, and halves of the voxels tell what that does.
            for (sd, half) in current.sd.iter_mut().zip(&kept_back.half_differences) {
                *sd = sd.hypot(*half);
            }
        }
        // Parameters as in the last fit, all causes together.
        for cause in &mut causes {
            cause.refresh(&current, self.observed);
        }
        causes.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        let left = [&nominal, &current].map(|f| leftover(self.observed, &f.residual, &self.inference.metric));
        let structured_mm = [left[0].structured_rms_mm, left[1].structured_rms_mm];
        let verdict = verdict_on(structured_mm, self.inference.allowance_mm, &causes, &alternatives);
        if explain_too_little(verdict, structured_mm) {
            alternatives.splice(0..0, causes.drain(..));
        }
        Ok(Diagnosis {
            verdict,
            causes,
            alternatives,
            nominal,
            corrected: current,
            left,
            kept_back_rms_mm: kept_back.rms_mm,
            ranked,
            load: self.load,
            maps,
            believed: self.options.prior.clone(),
            settings: self.inference.settings,
            observed: self.observed.clone(),
            num_unknowns: self.num_unknowns,
            num_solves: self.inference.laboratory.num_solves,
            allowance_mm: self.inference.allowance_mm,
            discrepancy_mm2: self.inference.discrepancy_mm2,
            mesh_defect: self.mesh_defect,
            interior: self.interior,
        })
    }
}

#[cfg(test)]
#[path = "diagnose_tests.rs"]
mod tests;
