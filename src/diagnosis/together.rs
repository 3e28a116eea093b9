//! Several recordings together: does one material serve them all, do causes named in each have the same size, and does
//! what one recording taught predict the others?

use super::case::Case;
use super::cause::CauseIdentity;
use super::cause_fit::CauseFit;
use super::cross_prediction::{CrossPrediction, Predictor};
use super::error::DiagnosisError;
use super::evidence::EVIDENCE;
use super::fit::{Member, fit_members};
use super::interval::interval;
use super::mesh_error::{Coarser, widen};
use super::outcome::Diagnosis;
use super::prior::{BulkPrior, FitSettings, ShearPrior};
use super::result::{ParameterResult, material_parameters, parameter};
use super::supposed::Supposed;
use crate::material::Material;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Whether recordings agree: a supposition that saves parameters is compared with fits of every recording for itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Agreement {
    /// Rise of the deviance.
    pub deviance_rise: f64,
    /// Parameters saved.
    pub parameters_saved: usize,
    /// The rise from which the supposition is refused: ln n per parameter saved, and 30 (as for a cause).
    pub deviance_limit: f64,
    /// Whether the recordings agree.
    pub agrees: bool,
}

/// A cause that is named in every recording. Of a cause of which some numbers are the rig's or the scanner's, those
/// alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CommonCause {
    /// Name.
    pub name: String,
    /// In words.
    pub description: String,
    /// Its parameters that are the same in all.
    pub parameters: Vec<ParameterResult>,
    /// Whether one size serves all, compared with a size for each in one material.
    pub agreement: Agreement,
}

/// Several recordings together (part of `diagnoses/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TogetherResult {
    /// Their one material, each recording with its own causes.
    pub material: Material,
    /// Its parameters.
    pub material_parameters: Vec<ParameterResult>,
    /// Whether one material serves all.
    pub one_material: Agreement,
    /// Causes that are named in every recording.
    pub common_causes: Vec<CommonCause>,
    /// Every recording by every other.
    pub predictions: Vec<CrossPrediction>,
}

/// Where the causes that recordings have in common stand in each of them, and which of their parameters are shared.
struct Common {
    identity: CauseIdentity,
    /// Per recording: the place among its causes.
    places: Vec<usize>,
    /// The parameters that are one number in all.
    parameters: Vec<usize>,
}

impl Common {
    /// Of the cause `of`, where all recordings have it: what belongs to the rig or the scanner; where nothing does, all
    /// that is no single step's.
    fn of(of: &Supposed, own: &[Vec<Supposed>]) -> Option<Common> {
        let identity = of.cause.identity();
        let place = |causes: &Vec<Supposed>| causes.iter().position(|c| c.cause.identity() == identity);
        let places = own.iter().map(place).collect::<Option<Vec<usize>>>()?;
        let all = of.cause.parameters();
        let those = |is_shared: &dyn Fn(usize) -> bool| (0..all.len()).filter(|i| is_shared(*i)).collect::<Vec<_>>();
        let of_rig = those(&|i| all[i].is_of_rig);
        let parameters = if of_rig.is_empty() { those(&|i| all[i].only_step.is_none()) } else { of_rig };
        (!parameters.is_empty()).then_some(Common { identity, places, parameters })
    }
}

/// Looks at diagnosed recordings together: at least two.
///
/// # Errors
/// [`DiagnosisError`]: fewer than two, or the work was cancelled.
pub fn together(
    diagnoses: &[(&str, &Diagnosis)],
    mesh_factor: f64,
    progress: &(dyn Fn(&str) + Sync),
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<TogetherResult, DiagnosisError> {
    // A material that serves all needs as many terms as the richest of them.
    let start = diagnoses.iter().map(|(_, d)| &d.corrected.material).max_by_key(|m| m.terms.len());
    let Some(start) = start.filter(|_| diagnoses.len() >= 2) else {
        return Err(DiagnosisError::Setting {
            name: "the number of recordings",
            value: diagnoses.len() as f64,
            requirement: "at least two, to be looked at together",
        });
    };
    let cases = diagnoses.iter().map(|(name, found)| Case::new(name, found, mesh_factor)).collect::<Result<_, _>>()?;
    let mut common = CommonFit { cases, num_material: start.parameters().len(), is_cancelled };

    progress("fitting one material to all recordings");
    let own: Vec<Vec<Supposed>> = common.cases.iter().map(|c| c.found.corrected.causes.clone()).collect();
    let mut shared = common.fit(start, &own, None)?;
    let one_material = common.one_material(&shared, &own);
    let common_causes = common.common_causes(&shared, &own, progress)?;

    progress("estimating what the mesh does to the common material");
    widen_all(&mut common.cases, mesh_factor, &mut shared, is_cancelled)?;
    progress("predicting every recording by every other");
    let refused = common_causes.iter().filter(|(_, c)| !c.agreement.agrees).map(|(identity, _)| *identity).collect();
    let predictor = Predictor { refused, is_cancelled };
    let mut predictions = Vec::new();
    for to in 0..diagnoses.len() {
        for from in 0..diagnoses.len() {
            predictions.push(predictor.prediction(&mut common.cases, from, to)?);
        }
    }
    let common_causes = common_causes.into_iter().map(|(_, c)| c).collect();
    Ok(TogetherResult {
        material: shared[0].material.clone(),
        material_parameters: material_parameters(&shared[0]),
        one_material,
        common_causes,
        predictions,
    })
}

/// Fits of all recordings with one material.
struct CommonFit<'a> {
    cases: Vec<Case<'a>>,
    /// Number of the one material's parameters.
    num_material: usize,
    is_cancelled: &'a (dyn Fn() -> bool + Sync),
}

/// The sum of the deviances of all recordings.
fn deviance_of(fits: &[CauseFit]) -> f64 {
    fits.iter().map(|f| f.deviance).sum()
}

impl CommonFit<'_> {
    /// Whether a supposition that saves parameters is kept where it raises the deviance by `rise`.
    fn agreement(&self, rise: f64, saved: usize) -> Agreement {
        let ln_n = (self.cases.iter().map(|c| c.metric.num_data()).sum::<usize>() as f64).ln();
        let deviance_limit = EVIDENCE + ln_n * saved as f64;
        Agreement { deviance_rise: rise, parameters_saved: saved, deviance_limit, agrees: rise < deviance_limit }
    }

    /// Whether one material serves all; `shared` are the fits with one, `own` the causes of each recording.
    fn one_material(&self, shared: &[CauseFit], own: &[Vec<Supposed>]) -> Agreement {
        let apart: f64 = self.cases.iter().map(|c| c.found.corrected.deviance).sum();
        let num_apart: usize = self.cases.iter().map(|c| c.found.corrected.num_parameters()).sum();
        let num_shared = self.num_material + own.iter().flatten().map(|c| c.values.len()).sum::<usize>();
        self.agreement(deviance_of(shared) - apart, num_apart.saturating_sub(num_shared))
    }

    /// Causes that are named in every recording, each fitted with one size for all. Artefacts belong to one recording
    /// alone.
    fn common_causes(
        &mut self,
        shared: &[CauseFit],
        own: &[Vec<Supposed>],
        progress: &(dyn Fn(&str) + Sync),
    ) -> Result<Vec<(CauseIdentity, CommonCause)>, DiagnosisError> {
        let mut found = Vec::new();
        for cause in own[0].iter().filter(|c| !c.cause.is_artefact()) {
            let Some(common) = Common::of(cause, own) else { continue };
            progress(&format!("fitting one size of '{}' to all recordings", cause.cause.description()));
            found.push((common.identity, self.common_cause(shared, own, &common)?));
        }
        Ok(found)
    }

    /// A cause fitted with one size for all.
    fn common_cause(
        &mut self,
        shared: &[CauseFit],
        own: &[Vec<Supposed>],
        common: &Common,
    ) -> Result<CommonCause, DiagnosisError> {
        let num_cases = self.cases.len();
        let mut same = own.to_vec();
        for &i in &common.parameters {
            let sum: f64 = shared.iter().zip(&common.places).map(|(f, &at)| f.causes[at].values[i]).sum();
            for (causes, &at) in same.iter_mut().zip(&common.places) {
                causes[at].values[i] = sum / num_cases as f64;
            }
        }
        let fits = self.fit(&shared[0].material, &same, Some(common))?;
        let rise = deviance_of(&fits) - deviance_of(shared);
        let (at, first) = (common.places[0], &fits[0]);
        let (cause, all) = (&first.causes[at].cause, first.causes[at].cause.parameters());
        let of_parameter = |&i: &usize| {
            let (value, sd) = (first.causes[at].values[i], first.sd_of(at)[i]);
            parameter(&all[i].name, value, interval(value, sd))
        };
        Ok(CommonCause {
            name: cause.name().as_str().into(),
            description: cause.description(),
            parameters: common.parameters.iter().map(of_parameter).collect(),
            agreement: self.agreement(rise, common.parameters.len() * (num_cases - 1)),
        })
    }

    /// Fits one material to all cases with `causes`; what is `common` is one number in all.
    fn fit(
        &mut self,
        start: &Material,
        causes: &[Vec<Supposed>],
        common: Option<&Common>,
    ) -> Result<Vec<CauseFit>, DiagnosisError> {
        let (num_cases, num_material) = (self.cases.len() as f64, self.num_material);
        let mut next = num_material + common.map_or(0, |c| c.parameters.len());
        let mut members: Vec<Member> = Vec::new();
        for (n, (case, causes)) in self.cases.iter_mut().zip(causes).enumerate() {
            let mut places: Vec<usize> = (0..num_material).collect();
            for (index, c) in causes.iter().enumerate() {
                let shared = common.filter(|common| common.places[n] == index);
                for i in 0..c.values.len() {
                    match shared.and_then(|common| common.parameters.iter().position(|p| *p == i)) {
                        Some(at) => places.push(num_material + at),
                        None => {
                            places.push(next);
                            next += 1;
                        }
                    }
                }
            }
            members.push(Member {
                laboratory: &mut case.laboratory,
                metric: &case.metric,
                measured: &case.measured,
                causes: causes.clone(),
                settings: shared_prior(case.found.settings, num_cases),
                known: &[],
                places,
            });
        }
        fit_members(&mut members, start, self.is_cancelled)
    }
}

/// Priors of the material count once for all recordings, not once for each.
fn shared_prior(settings: FitSettings, num_cases: f64) -> FitSettings {
    let wide = num_cases.sqrt();
    FitSettings {
        bulk: BulkPrior { log_sd: settings.bulk.log_sd * wide, ..settings.bulk },
        shear: settings.shear.map(|s| ShearPrior { log_sd: s.log_sd * wide, ..s }),
        ..settings
    }
}

/// Adds to the material's standard deviations what the mesh does in each recording. Meshes of one kind err in the same
/// way, so that this part does not become smaller with more recordings; its mean square over the recordings is added.
fn widen_all(
    cases: &mut [Case],
    mesh_factor: f64,
    shared: &mut [CauseFit],
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<(), DiagnosisError> {
    let num_material = shared[0].material.parameters().len();
    let noise: Vec<f64> = shared[0].sd[..num_material].to_vec();
    let mut squares = vec![0.0; num_material];
    let num_cases = cases.len() as f64;
    for (case, fitted) in cases.iter_mut().zip(shared.iter_mut()) {
        let settings = case.found.settings;
        let defect = case.found.mesh_defect.as_ref();
        let other = (&mut Coarser::default(), mesh_factor);
        match widen(&mut case.laboratory, other, &case.metric, &settings, fitted, defect, is_cancelled) {
            Err(error) if is_cancelled() => return Err(error),
            // Where a coarser model has no equilibrium the noise alone counts, as in the diagnosis.
            Err(_) | Ok(()) => {}
        }
        for ((sum, sd), noise) in squares.iter_mut().zip(&fitted.sd).zip(&noise) {
            *sum += (sd * sd - noise * noise).max(0.0) / num_cases;
        }
    }
    for ((sd, noise), square) in shared[0].sd.iter_mut().zip(&noise).zip(&squares) {
        *sd = noise.hypot(square.sqrt());
    }
    Ok(())
}
