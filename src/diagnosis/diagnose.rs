//! The diagnosis: fit the nominal model, look at what is left, suppose causes, fit them, and prove them on data kept
//! back.

use super::artefacts::take_out_artefacts;
use super::cause::CauseName;
use super::conclusion::{explain_too_little, kept_back, verdict_on};
use super::error::DiagnosisError;
use super::evidence::ALLOWANCE_OF_DRIVE;
use super::findings::Findings;
use super::found::FoundCause;
use super::further_term::without_needless_terms;
use super::inference::{Inference, KNOWN_LOG_SD};
use super::interior::{InteriorTest, test_interior};
use super::laboratory::Laboratory;
use super::leftover::leftover;
use super::load_curve::{largest_drive_mm, read_load_curve, take_off_effects};
use super::load_history::LoadHistoryFit;
use super::material_cause::{MaterialCase, Recheck};
use super::mesh_error::{Coarser, Finer, MeshDefect, widen};
use super::metric::Metric;
use super::nominal::{first_guess, fit_nominal};
use super::options::DiagnosisOptions;
use super::outcome::Diagnosis;
use super::prior::{BulkPrior, FitSettings, ShearPrior, shear_modulus};
use super::registry::Registry;
use super::trace::Trace;
use crate::calibration::{Boundary, Observed};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::recording::Recording;

/// Standard deviation of ln κ of the material believed.
pub(super) const BELIEVED_LOG_SD: f64 = 0.5;
/// Most iterations of a fit.
const MAX_ITERATIONS: usize = 12;
/// A fit ends when a step would lower the deviance by less than this.
const TOLERANCE: f64 = 0.3;

/// The interior is tested where the misfit beyond noise exceeds this multiple of the allowance (rms).
const INTERIOR_ABOVE: f64 = 2.0;

/// Diagnoses `recording`; `progress` is told what is being done.
///
/// # Errors
/// [`DiagnosisError`].
pub fn diagnose(
    recording: &Recording,
    options: &DiagnosisOptions,
    progress: &(dyn Fn(&str) + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Diagnosis, DiagnosisError> {
    diagnose_with(&Registry::standard(), recording, options, progress, is_cancelled)
}

/// As [`diagnose`], with the causes of `registry`: causes of one's own, or fewer than all.
///
/// # Errors
/// As [`diagnose`].
pub fn diagnose_with(
    registry: &Registry,
    recording: &Recording,
    options: &DiagnosisOptions,
    progress: &(dyn Fn(&str) + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Diagnosis, DiagnosisError> {
    let registry = registry.clone().without(&options.left_out)?;
    let registry = match options.boundary {
        Boundary::Commanded => registry,
        Boundary::Measured => registry.without_boundary(),
    };
    diagnose_among(&registry, recording, options, progress, is_cancelled)
}

/// As [`diagnose_with`], with the very causes of `registry`.
///
/// # Errors
/// As [`diagnose`].
pub(super) fn diagnose_among(
    registry: &Registry,
    recording: &Recording,
    options: &DiagnosisOptions,
    progress: &(dyn Fn(&str) + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
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
    let seen = run.correct_fits()?;
    run.name_artefacts();
    run.conclude(&seen)
}

/// A diagnosis at work: its stages are its methods, in the order of [`diagnose_among`].
pub(super) struct Run<'a> {
    pub(super) registry: &'a Registry,
    pub(super) options: &'a DiagnosisOptions,
    pub(super) observed: &'a Observed,
    pub(super) inference: Inference<'a>,
    /// The finer mesh; `None` where ours is fine already, or the finer one cannot be meshed.
    pub(super) finer: Option<Finer<'a>>,
    /// The coarser meshes, by which intervals are widened.
    coarser: Coarser<'a>,
    /// The material from which nominal fits start.
    pub(super) start: Material,
    /// Displacement unknowns of the model.
    pub(super) num_unknowns: usize,
    /// What was recorded, less what the load curve's effects add.
    pub(super) recorded: Trace,
    /// The load curve.
    pub(super) load: Option<LoadHistoryFit>,
    /// What the finer mesh predicts beyond ours.
    pub(super) mesh_defect: Option<MeshDefect>,
    /// What the interior test found, where it was made.
    pub(super) interior: Option<InteriorTest>,
    pub(super) findings: Findings,
}

impl<'a> Run<'a> {
    /// Prepares the models and fits the nominal one.
    fn begin(
        observed: &'a Observed,
        registry: &'a Registry,
        options: &'a DiagnosisOptions,
        progress: &'a (dyn Fn(&str) + Sync),
        is_cancelled: &'a (dyn Fn() -> bool + Sync),
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
            goal: None,
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
            coarser: Coarser::default(),
            start,
            num_unknowns,
            recorded,
            load: None,
            mesh_defect: None,
            interior: None,
            findings: Findings::of_nominal(nominal),
        })
    }

    pub(super) fn tell(&self, what: &str) {
        (self.inference.progress)(what);
    }

    pub(super) fn is_cancelled(&self) -> bool {
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
    fn fit_nominal(&mut self, measured: &Trace, start: &Material) -> Result<(), DiagnosisError> {
        let nominal = fit_nominal(&mut self.inference, measured, start, self.options.prior.is_some())?;
        self.findings.restart_from(nominal);
        Ok(())
    }

    /// What our mesh would have shown of what was recorded, were it not for its own error.
    pub(super) fn measured(&self) -> Trace {
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
        let Inference { laboratory, progress, is_cancelled, .. } = &mut self.inference;
        self.finer = Finer::new(laboratory, self.options.mesh_factor);
        let Some(finer) = self.finer.as_mut() else { return Ok(()) };
        progress("predicting on a finer mesh");
        match finer.defect(laboratory, &self.findings.nominal, *is_cancelled) {
            Ok(found) => {
                self.inference.laboratory.know_own_error(found.trace.clone());
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
                    self.attempt("needless causes", |run| run.leave_out_what_is_not_needed(&seen[n]))?;
                    self.attempt("needless terms", |run| run.leave_out_terms(&seen[n]))?;
                }
            }
            self.widen_intervals(n, &settings[n], defect.as_ref())?;
            self.mesh_defect = defect.or(self.mesh_defect.take());
        }
        Ok(seen)
    }

    /// Takes Ogden terms that `measured` does not call for beside the causes out of the fit.
    fn leave_out_terms(&mut self, measured: &Trace) -> Result<(), DiagnosisError> {
        let is_believed = self.options.prior.is_some();
        if !is_believed {
            let fitted = self.findings.current.clone();
            self.findings.current = without_needless_terms(&mut self.inference, measured, fitted)?;
        }
        Ok(())
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
        let Run { inference, coarser, findings, .. } = self;
        let Inference { laboratory, metric, mesh_factor, is_cancelled, progress, .. } = inference;
        let fitted = if n == 0 { &mut findings.nominal } else { &mut findings.current };
        match widen(laboratory, (coarser, *mesh_factor), metric, settings, fitted, defect, *is_cancelled) {
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
        let Findings { nominal, current, mut causes, mut alternatives, ranked, maps, .. } = self.findings;
        (self.inference.progress)("predicting voxel blocks that were kept back");
        let kept_back = match kept_back(&mut self.inference, seen, [&nominal, &current]) {
            Ok(kept_back) => Some(kept_back),
            Err(error) if (self.inference.is_cancelled)() => return Err(error),
            Err(error) => {
                (self.inference.progress)(&format!(
                    "nothing is said of voxels kept back: a fit to half of them: {error}"
                ));
                None
            }
        };
        // Parameters as in the last fit, all causes together.
        for cause in &mut causes {
            cause.refresh(&current, self.observed);
        }
        causes.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        let left = [&nominal, &current].map(|f| leftover(self.observed, &f.residual, &self.inference.metric));
        let structured_mm = [left[0].structured_rms_mm, left[1].structured_rms_mm];
        let is_idealised = current.causes.iter().any(|s| s.cause.is_idealised());
        let verdict = verdict_on(structured_mm, self.inference.allowance_mm, is_idealised, &causes, &alternatives);
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
            kept_back_rms_mm: kept_back,
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
