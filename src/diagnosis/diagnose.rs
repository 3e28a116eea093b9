//! The diagnosis: fit the nominal model, look at what is left, suppose causes, fit them, and prove them on data kept
//! back.

use super::cause::CauseName;
use super::cause_fit::CauseFit;
use super::conclusion::{explain_too_little, kept_back, verdict_on};
use super::error::DiagnosisError;
use super::evidence::{EVIDENCE, OF_IMAGE_ALONE, UNEXPLAINED, is_large_force, penalty};
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
use super::nominal::{first_guess, fit_nominal, fit_with_terms};
use super::options::DiagnosisOptions;
use super::outcome::Diagnosis;
use super::prior::{BulkPrior, FitSettings, ShearPrior, shear_modulus};
use super::registry::Registry;
use super::rounds::{Asked, RoundLimits, add_causes, fit_round, score_round, take_out_artefacts};
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

/// Where causes leave a misfit unexplained, one that alone explained at least this part of what the first did is tried
/// in its place: the greedy choice between two that explain nearly the same may be the wrong one.
const NEARLY_AS_MUCH: f64 = 0.95;
/// What is found from there is kept where it leaves less than this part (rms).
const OTHER_START_GAINS: f64 = 0.9;

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
    run.attempt("the load curve", |run| run.read_load_curve(recording))?;
    run.attempt("the mesh's error", Run::correct_mesh)?;
    run.attempt("the interior test", Run::test_interior)?;
    run.attempt("the material's own law", Run::question_material)?;
    run.attempt("jumps of phase", Run::take_out_artefacts)?;
    run.attempt("causes", Run::add_causes)?;
    run.attempt("the load curve with the causes", |run| run.read_load_curve_again(recording))?;
    run.attempt("the material's own law with the causes", Run::question_material_again)?;
    run.name_artefacts();
    let seen = run.correct_fits()?;
    run.conclude(&seen)
}

/// What was found with the set-up as a whole in the fit.
struct WithSetUp {
    findings: Findings,
    /// What its misfits are weighed by ([`Inference::discrepancy_mm2`]).
    discrepancy_mm2: [f64; 3],
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

    /// Does a stage. Where it fails, the diagnosis goes on with what was found before: some causes have no equilibrium.
    ///
    /// # Errors
    /// The work was cancelled.
    fn attempt(
        &mut self,
        stage: &str,
        work: impl FnOnce(&mut Self) -> Result<(), DiagnosisError>,
    ) -> Result<(), DiagnosisError> {
        match work(self) {
            Err(error) if !self.is_cancelled() => {
                self.tell(&format!("{stage}: given up, and gone on with what was found so far: {error}"));
                Ok(())
            }
            done => done,
        }
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

    /// Reads the load curve with the causes found: the nominal model's force has another course over the drive than
    /// theirs, and what the first reading made of the difference is no effect of time or of the load cell. Where it
    /// changes, so do the forces that are compared, and the fits to them.
    fn read_load_curve_again(&mut self, recording: &Recording) -> Result<(), DiagnosisError> {
        if self.load.is_none() || self.findings.current.causes.iter().all(|c| c.cause.is_artefact()) {
            return Ok(());
        }
        self.tell("reading the load curve again, with the causes found");
        let effects = self.registry.load_effects();
        let again = match read_load_curve(&mut self.inference, recording, &self.findings.current, &effects) {
            Ok(again) => again,
            Err(error) if self.is_cancelled() => return Err(error),
            // Between the steps the causes may have no equilibrium.
            Err(_) => return Ok(()),
        };
        let names = |load: &Option<LoadHistoryFit>| -> Vec<CauseName> {
            load.iter().flat_map(|l| &l.effects).map(|e| e.effect.name()).collect()
        };
        if names(&again) == names(&self.load) {
            return Ok(());
        }
        self.load = again;
        self.recorded = self.inference.laboratory.measured();
        take_off_effects(&mut self.recorded, self.load.as_ref());
        let effects = self.load.as_ref().map_or(&[][..], |l| &l.effects);
        self.findings.causes.retain(|c| !c.is_of_load_curve());
        self.findings.causes.extend(FoundCause::of_load_curve(effects));
        self.tell("refitting with the forces that this leaves");
        let measured = self.measured();
        let Findings { nominal, current, .. } = &self.findings;
        let (start, material, causes) = (nominal.material.clone(), current.material.clone(), current.causes.clone());
        let with_causes = self.inference.settings;
        self.inference.settings.bulk = self.inference.nominal_bulk;
        let nominal = self.inference.fit(&measured, &start, &[]);
        self.inference.settings = with_causes;
        self.findings.nominal = nominal?;
        self.findings.current = self.inference.fit(&measured, &material, &causes)?;
        self.leave_out_what_is_not_needed(&measured)
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

    /// Finds the artefacts of the image in what the nominal model leaves.
    fn take_out_artefacts(&mut self) -> Result<(), DiagnosisError> {
        let measured = self.measured();
        let Run { inference, registry, findings, .. } = self;
        take_out_artefacts(inference, registry, findings, &measured)
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
        let everything =
            Asked { registry: self.registry, with_terms: self.options.prior.is_none(), evidence: EVIDENCE };
        let does_inside_wait = self.interior.as_ref().is_some_and(InteriorTest::inside_fits);
        let first = if does_inside_wait {
            Asked { registry: &at_boundary, with_terms: false, evidence: EVIDENCE }
        } else {
            everything
        };
        let Run { inference, findings, observed, .. } = self;
        let left_mm =
            |fitted: &CauseFit, metric: &Metric| leftover(observed, &fitted.residual, metric).structured_rms_mm;
        let before_mm = left_mm(&findings.current, &inference.metric);
        // What is no more than a mesh's has no cause but in the image.
        if before_mm < inference.allowance_mm && !is_large_force(observed, &findings.current.residual) {
            let of_image = self.registry.clone().of_image_alone(&observed.specimen);
            let asked = Asked { registry: &of_image, with_terms: false, evidence: OF_IMAGE_ALONE * EVIDENCE };
            return add_causes(inference, findings, &measured, limits, &|_, _| Some(asked));
        }
        let begun = findings.current.clone();
        let scored = score_round(inference, first, findings, limits)?;
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
        let are_all_asked = !(does_inside_wait || are_given_up.get());
        if are_all_asked {
            self.start_otherwise(begun, &measured, limits)?;
            self.fit_material_anew(&measured, limits)?;
        }
        let Some(with_set_up) = self.with_set_up(&measured, limits, is_promising)? else {
            return if are_all_asked { Ok(()) } else { self.ask_all(&measured, limits) };
        };
        if !are_all_asked && !self.is_explained_by(&with_set_up.findings) {
            self.ask_all(&measured, limits)?;
        }
        if self.left_mm(&with_set_up.findings.current) < SET_UP_GAINS * self.left_mm(&self.findings.current) {
            self.go_on_with(with_set_up);
        }
        Ok(())
    }

    /// Where causes leave a misfit unexplained and another cause alone explained nearly as much of it as the first one
    /// found: adds causes from `begun`, the fit before the first round, without that first one in the first round, and
    /// goes on from there where that leaves clearly less.
    fn start_otherwise(
        &mut self,
        begun: CauseFit,
        measured: &Trace,
        limits: RoundLimits,
    ) -> Result<(), DiagnosisError> {
        let Some(first) = self.findings.causes.iter().find(|c| c.is_of_fit()).map(|c| c.name) else { return Ok(()) };
        let alone = self.findings.ranked.iter().filter(|r| r.round == 1).filter_map(|r| Some((r, r.fitted?)));
        let best = alone.clone().map(|(_, fitted)| fitted).fold(0.0, f64::max);
        let has_rival = alone.clone().any(|(r, fitted)| r.identity.name != first && fitted > NEARLY_AS_MUCH * best);
        if !has_rival || self.is_explained_by(&self.findings) {
            return Ok(());
        }
        self.tell("starting from another cause that explains nearly as much as the first");
        let others = self.registry.clone().without(&[first])?;
        let num_begun = begun.causes.len();
        let from_begun = self.findings.going_on_from(begun);
        let mut before = std::mem::replace(&mut self.findings, from_begun);
        let Run { inference, registry, findings, options, .. } = self;
        let with_terms = options.prior.is_none();
        let added = add_causes(inference, findings, measured, limits, &|_, findings| {
            let is_first = findings.current.causes.len() == num_begun;
            Some(Asked { registry: if is_first { &others } else { registry }, with_terms, evidence: EVIDENCE })
        });
        if added.is_err() || self.left_mm(&self.findings.current) >= OTHER_START_GAINS * self.left_mm(&before.current) {
            (before.ranked, before.maps) =
                (std::mem::take(&mut self.findings.ranked), std::mem::take(&mut self.findings.maps));
            self.findings = before;
        }
        if self.is_cancelled() { added } else { Ok(()) }
    }

    /// Goes on with single causes where they were given up, or not all of them asked.
    fn ask_all(&mut self, measured: &Trace, limits: RoundLimits) -> Result<(), DiagnosisError> {
        let Run { inference, registry, findings, options, .. } = self;
        let everything = Asked { registry, with_terms: options.prior.is_none(), evidence: EVIDENCE };
        add_causes(inference, findings, measured, limits, &|_, _| Some(everything))?;
        self.fit_material_anew(measured, limits)
    }

    /// Where causes leave more than a mesh does: fits the material from its start again, now that they are in the fit,
    /// and goes on from there where that explains more. The nominal fit took terms to make up for what causes do, from
    /// which a fit does not find back. In the end, what later causes made needless goes.
    fn fit_material_anew(&mut self, measured: &Trace, limits: RoundLimits) -> Result<(), DiagnosisError> {
        let is_believed = self.options.prior.is_some();
        let current = &self.findings.current;
        if !is_believed && !current.causes.is_empty() && self.left_mm(current) > self.inference.allowance_mm {
            self.tell("fitting the material anew, with the causes found");
            let (causes, deviance) = (current.causes.clone(), current.deviance);
            let num_terms = current.material.terms.len();
            match fit_with_terms(&mut self.inference, measured, &self.start, &causes) {
                Ok(anew) => {
                    let num_more = anew.material.terms.len() as f64 - num_terms as f64;
                    let cost = num_more * penalty(&self.inference.metric, 2);
                    if deviance - anew.deviance - cost > EVIDENCE {
                        self.findings.current = anew;
                        let Run { inference, registry, findings, .. } = self;
                        let everything = Asked { registry, with_terms: true, evidence: EVIDENCE };
                        add_causes(inference, findings, measured, limits, &|_, _| Some(everything))?;
                    }
                }
                Err(error) if self.is_cancelled() => return Err(error),
                Err(_) => {}
            }
        }
        self.leave_out_what_is_not_needed(measured)
    }

    /// What a fit leaves beyond noise, mm rms.
    fn left_mm(&self, fitted: &CauseFit) -> f64 {
        leftover(self.observed, &fitted.residual, &self.inference.metric).structured_rms_mm
    }

    /// Whether findings explain the misfit as far as causes can be asked to.
    fn is_explained_by(&self, findings: &Findings) -> bool {
        let (before, left) = (self.left_mm(&findings.nominal), self.left_mm(&findings.current));
        is_explained(left, before, self.inference.allowance_mm)
    }

    /// Goes on with the set-up as a whole and the weights that belong to it.
    fn go_on_with(&mut self, with_set_up: WithSetUp) {
        let WithSetUp { mut findings, discrepancy_mm2 } = with_set_up;
        (findings.ranked, findings.maps) =
            (std::mem::take(&mut self.findings.ranked), std::mem::take(&mut self.findings.maps));
        self.findings = findings;
        self.inference.weigh_by(discrepancy_mm2);
    }

    /// Takes out of the fit the causes that `measured`, or later causes, have made needless.
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

    /// The set-up as a whole with causes added to it, where what was named so far leaves much of the misfit and the
    /// set-up `is_promising`. `None` where it is not asked for, or has no fit.
    fn with_set_up(
        &mut self,
        measured: &Trace,
        limits: RoundLimits,
        is_promising: bool,
    ) -> Result<Option<WithSetUp>, DiagnosisError> {
        let is_asked = is_promising && !self.is_explained_by(&self.findings);
        if !is_asked || self.registry.set_up(self.observed).is_empty() {
            return Ok(None);
        }
        self.tell("fitting the set-up as a whole: plates, rig, layers, block");
        // Without the further terms that the nominal fit took to make up for the set-up.
        let start = CauseFit {
            material: self.start.clone(),
            causes: artefacts_of(&self.findings.current),
            ..self.findings.nominal.clone()
        };
        let Run { inference, registry, .. } = self;
        let fitted = fit_set_up(inference, registry, measured, &start)
            .and_then(|fitted| simplest_set_up(inference, registry, measured, fitted));
        let found = match fitted {
            Ok(fitted) => self.and_causes(fitted, measured, limits),
            Err(error) => Err(error),
        };
        self.inference.forget_discrepancy();
        match found {
            Ok(found) => Ok(Some(found)),
            Err(error) if self.is_cancelled() => Err(error),
            Err(_) => Ok(None),
        }
    }

    /// What is found from `fitted` on, a fit of the set-up as a whole; the findings so far stay as they are, but for
    /// the list of what was tested.
    fn and_causes(
        &mut self,
        fitted: CauseFit,
        measured: &Trace,
        limits: RoundLimits,
    ) -> Result<WithSetUp, DiagnosisError> {
        let from_set_up = self.findings.going_on_from(fitted);
        let before = std::mem::replace(&mut self.findings, from_set_up);
        self.findings.nominal.deviance = self.inference.misfit_of(&self.findings.nominal.residual);
        let added = self.add_causes_to_set_up(measured, limits);
        let mut findings = std::mem::replace(&mut self.findings, before);
        (self.findings.ranked, self.findings.maps) =
            (std::mem::take(&mut findings.ranked), std::mem::take(&mut findings.maps));
        self.findings.num_rounds = findings.num_rounds;
        added.map(|()| WithSetUp { findings, discrepancy_mm2: self.inference.discrepancy_mm2 })
    }

    /// Adds causes to the set-up as a whole, and names all of them.
    fn add_causes_to_set_up(&mut self, measured: &Trace, limits: RoundLimits) -> Result<(), DiagnosisError> {
        self.name_causes_of_fit()?;
        let Run { inference, registry, findings, options, .. } = self;
        let everything = Asked { registry, with_terms: options.prior.is_none(), evidence: EVIDENCE };
        let num_before = findings.current.causes.len();
        add_causes(inference, findings, measured, limits, &|_, _| Some(everything))?;
        if findings.current.causes.len() > num_before {
            findings.current = simplest_set_up(inference, registry, measured, findings.current.clone())?;
            self.name_causes_of_fit()?;
        }
        Ok(())
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
            let defect = self.correct_fit(n, &settings[n])?;
            if let Some(defect) = &defect {
                seen[n] = defect.taken_off(&self.recorded);
                if n == 1 {
                    // What our mesh alone called for.
                    self.leave_out_what_is_not_needed(&seen[n])?;
                }
            }
            self.widen_intervals(n, &settings[n], defect.as_ref())?;
            self.mesh_defect = defect.or(self.mesh_defect.take());
        }
        Ok(seen)
    }

    /// Corrects one fit, the nominal one (0) or that with the causes (1); gives what the finer mesh predicts beyond
    /// ours.
    fn correct_fit(&mut self, n: usize, settings: &FitSettings) -> Result<Option<MeshDefect>, DiagnosisError> {
        let Run { inference, finer, findings, recorded, .. } = self;
        let Inference { laboratory, metric, is_cancelled, progress, .. } = inference;
        let (is_cancelled, progress) = (*is_cancelled, *progress);
        let fitted = if n == 0 { &mut findings.nominal } else { &mut findings.current };
        let correction =
            finer.as_mut().map(|f| f.correct(laboratory, metric, recorded, settings, fitted, is_cancelled));
        match correction.transpose() {
            Err(error) if is_cancelled() => Err(error),
            Err(_) => {
                progress("a finer model has no equilibrium: estimates are those of this mesh");
                Ok(None)
            }
            Ok(defect) => Ok(defect),
        }
    }

    /// Widens the intervals of one fit, numbered as for [`Self::correct_fit`], by what meshes do.
    fn widen_intervals(
        &mut self,
        n: usize,
        settings: &FitSettings,
        defect: Option<&MeshDefect>,
    ) -> Result<(), DiagnosisError> {
        let Run { inference, findings, .. } = self;
        let Inference { laboratory, metric, mesh_factor, is_cancelled, progress, .. } = inference;
        let fitted = if n == 0 { &mut findings.nominal } else { &mut findings.current };
        match widen(laboratory, *mesh_factor, metric, settings, fitted, defect, *is_cancelled) {
            Err(error) if is_cancelled() => Err(error),
            Err(_) => {
                progress("a coarser model has no equilibrium: the intervals are those of the noise");
                Ok(())
            }
            Ok(()) => Ok(()),
        }
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
