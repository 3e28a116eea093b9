//! Several recordings together: does one material serve them all, do causes named in each have the same size, and does
//! what one recording taught predict the others?

use super::cause::Category;
use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::EVIDENCE;
use super::fit::{Member, fit_members};
use super::interval::interval;
use super::laboratory::{Laboratory, Prediction};
use super::load_curve::take_off_effects;
use super::mesh_error::widen;
use super::metric::Metric;
use super::outcome::Diagnosis;
use super::prior::{BulkPrior, FitSettings, ShearPrior};
use super::result::{ParameterResult, material_parameters, parameter};
use super::supposed::{Supposed, scene_of};
use super::trace::Trace;
use crate::material::Ogden;
use crate::mesh::MeshOptions;
use crate::rate::BeforeAfter;
use serde::{Deserialize, Serialize};

/// Whether recordings agree: a supposition that saves parameters is compared with fits of every recording for itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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

/// A cause that is named in every recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommonCause {
    /// Name.
    pub name: String,
    /// In words.
    pub description: String,
    /// Its parameters where it is the same in all.
    pub parameters: Vec<ParameterResult>,
    /// Whether one size serves all, compared with a size for each in one material.
    pub agreement: Agreement,
}

/// What one recording's model says of another recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CrossPrediction {
    /// The recording that was fitted.
    pub from: String,
    /// The recording that is predicted; `from` itself is what its own fit leaves.
    pub to: String,
    /// Misfit, mm rms over all drives, noise included: by the nominal material; with the causes too. Null where that
    /// model has no equilibrium.
    pub displacement_rms_mm: Option<BeforeAfter>,
    /// Largest misfit of a force relative to it; null where there is none.
    pub force_relative: Option<BeforeAfter>,
}

/// Several recordings together (part of `diagnoses/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TogetherResult {
    /// Their one material, each recording with its own causes.
    pub material: Ogden,
    /// Its parameters.
    pub material_parameters: Vec<ParameterResult>,
    /// Whether one material serves all.
    pub one_material: Agreement,
    /// Causes that are named in every recording.
    pub common_causes: Vec<CommonCause>,
    /// Every recording by every other.
    pub predictions: Vec<CrossPrediction>,
}

/// One diagnosed recording.
struct Case<'a> {
    name: &'a str,
    found: &'a Diagnosis,
    laboratory: Laboratory<'a>,
    metric: Metric,
    measured: Trace,
}

impl<'a> Case<'a> {
    fn new(name: &'a str, found: &'a Diagnosis, mesh_factor: f64) -> Result<Case<'a>, DiagnosisError> {
        let mesh = MeshOptions::scaled(&found.observed.specimen, mesh_factor);
        let laboratory = Laboratory::new(&found.observed, &mesh)?;
        let mut measured = laboratory.measured();
        // As in the diagnosis: what the load curve explained is taken off, and what the mesh gets wrong.
        take_off_effects(&mut measured, found.load.as_ref());
        if let Some(defect) = &found.mesh_defect {
            measured = defect.taken_off(&measured);
        }
        let metric = Metric::new(&found.observed, found.allowance_mm, &|_| true);
        Ok(Case { name, found, laboratory, metric, measured })
    }
}

/// Looks at diagnosed recordings together: at least two.
///
/// # Errors
/// [`DiagnosisError`]: fewer than two, or the work was cancelled.
pub fn together(
    diagnoses: &[(&str, &Diagnosis)],
    mesh_factor: f64,
    progress: &dyn Fn(&str),
    is_cancelled: &dyn Fn() -> bool,
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
    let mut predictions = Vec::new();
    for to in 0..diagnoses.len() {
        for from in 0..diagnoses.len() {
            predictions.push(cross_prediction(&mut common.cases, from, to, is_cancelled)?);
        }
    }
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
    is_cancelled: &'a dyn Fn() -> bool,
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
        progress: &dyn Fn(&str),
    ) -> Result<Vec<CommonCause>, DiagnosisError> {
        let mut found = Vec::new();
        for cause in own[0].iter().filter(|c| !c.cause.is_artefact()) {
            let identity = cause.cause.identity();
            let place = |causes: &[Supposed]| causes.iter().position(|c| c.cause.identity() == identity);
            let Some(places) = own.iter().map(|causes| place(causes)).collect::<Option<Vec<usize>>>() else { continue };
            progress(&format!("fitting one size of '{}' to all recordings", cause.cause.description()));
            found.push(self.common_cause(shared, own, &places)?);
        }
        Ok(found)
    }

    /// The cause at `places` (one per recording), fitted with one size for all.
    fn common_cause(
        &mut self,
        shared: &[CauseFit],
        own: &[Vec<Supposed>],
        places: &[usize],
    ) -> Result<CommonCause, DiagnosisError> {
        let num_cases = self.cases.len();
        let num_values = own[0][places[0]].values.len();
        let mean: Vec<f64> = (0..num_values)
            .map(|i| {
                let sum: f64 = shared.iter().zip(places).map(|(f, &at)| f.causes[at].values[i]).sum();
                sum / num_cases as f64
            })
            .collect();
        let mut same = own.to_vec();
        for (causes, &at) in same.iter_mut().zip(places) {
            causes[at].values.clone_from(&mean);
        }
        let fits = self.fit(&shared[0].material, &same, Some(places))?;
        let rise = deviance_of(&fits) - deviance_of(shared);
        let (at, first) = (places[0], &fits[0]);
        let cause = &first.causes[at].cause;
        Ok(CommonCause {
            name: cause.name().as_str().into(),
            description: cause.description(),
            parameters: cause
                .parameters()
                .iter()
                .zip(first.causes[at].values.iter().zip(first.sd_of(at)))
                .map(|(p, (value, sd))| parameter(&p.name, *value, interval(*value, *sd)))
                .collect(),
            agreement: self.agreement(rise, num_values * (num_cases - 1)),
        })
    }

    /// Fits one material to all cases with `causes`; the causes at the places of `common` (one per case) share their
    /// parameters.
    fn fit(
        &mut self,
        start: &Ogden,
        causes: &[Vec<Supposed>],
        common: Option<&[usize]>,
    ) -> Result<Vec<CauseFit>, DiagnosisError> {
        let (num_cases, num_material) = (self.cases.len() as f64, self.num_material);
        let num_common = common.map_or(0, |places| causes[0][places[0]].values.len());
        let mut next = num_material + num_common;
        let mut members: Vec<Member> = Vec::new();
        for (n, (case, causes)) in self.cases.iter_mut().zip(causes).enumerate() {
            let mut places: Vec<usize> = (0..num_material).collect();
            for (index, c) in causes.iter().enumerate() {
                if common.is_some_and(|places| places[n] == index) {
                    places.extend(num_material..num_material + num_common);
                } else {
                    places.extend(next..next + c.values.len());
                    next += c.values.len();
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
    is_cancelled: &dyn Fn() -> bool,
) -> Result<(), DiagnosisError> {
    let num_material = shared[0].material.parameters().len();
    let noise: Vec<f64> = shared[0].sd[..num_material].to_vec();
    let mut squares = vec![0.0; num_material];
    let num_cases = cases.len() as f64;
    for (case, fitted) in cases.iter_mut().zip(shared.iter_mut()) {
        let settings = case.found.settings;
        let defect = case.found.mesh_defect.as_ref();
        match widen(&mut case.laboratory, mesh_factor, &case.metric, &settings, fitted, defect, is_cancelled) {
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

/// What the models of case `from` say of case `to`.
fn cross_prediction(
    cases: &mut [Case],
    from: usize,
    to: usize,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<CrossPrediction, DiagnosisError> {
    let teacher = cases[from].found;
    let is_same_sample = {
        let [a, b] = [from, to].map(|n| &cases[n].found.observed.specimen);
        a.block == b.block && a.holes == b.holes
    };
    // Artefacts belong to one recording alone. A recording of another sample shares neither places nor plates with this
    // one.
    let causes: Vec<Supposed> = teacher
        .corrected
        .causes
        .iter()
        .filter(|c| from == to || !c.cause.is_artefact())
        .filter(|c| {
            let located = c.cause.location(&c.values, &teacher.observed.specimen).is_some();
            is_same_sample || c.cause.category() == Category::Material && !located
        })
        .cloned()
        .collect();
    let case = &mut cases[to];
    case.laboratory.forget();
    let mut predict = |material: &Ogden, causes: &[Supposed]| -> Result<Option<Prediction>, DiagnosisError> {
        match case.laboratory.predict(material, &scene_of(causes), is_cancelled) {
            Ok(prediction) => Ok(Some(prediction)),
            Err(error) if is_cancelled() => Err(error),
            Err(_) => Ok(None),
        }
    };
    let before = predict(&teacher.nominal.material, &[])?;
    let after = predict(&teacher.corrected.material, &causes)?;
    let misfits = before.zip(after).map(|(b, a)| [b, a].map(|p| misfit(case, &p.trace)));
    Ok(CrossPrediction {
        from: cases[from].name.into(),
        to: cases[to].name.into(),
        displacement_rms_mm: misfits.map(|m| BeforeAfter { before: m[0].0, after: m[1].0 }),
        force_relative: misfits.and_then(|[b, a]| Some(BeforeAfter { before: b.1?, after: a.1? })),
    })
}

/// Displacement misfit (mm rms) and the largest relative misfit of a force.
fn misfit(case: &Case, predicted: &Trace) -> (f64, Option<f64>) {
    let left = case.measured.plus(-1.0, predicted);
    let finite = left.displacement.iter().flatten().flatten().filter(|x| x.is_finite());
    let (sum, count) = finite.fold((0.0, 0usize), |(s, n), x| (s + x * x, n + 1));
    let force = case
        .found
        .observed
        .steps
        .iter()
        .zip(left.force.iter().zip(&case.measured.force))
        .filter(|(step, (_, f))| step.force.is_some() && f.abs() > 0.0)
        .map(|(_, (l, f))| (l / f).abs())
        .reduce(f64::max);
    ((sum / count.max(1) as f64).sqrt(), force)
}
