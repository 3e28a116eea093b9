//! What one recording teaches about another: its material, its rig and, where it is the same sample, its sample.

use super::case::Case;
use super::cause::{Category, Cause, CauseIdentity};
use super::causes::Travel;
use super::error::DiagnosisError;
use super::fit::{derivatives, normal_system};
use super::laboratory::Prediction;
use super::leftover::leftover;
use super::registry::Registry;
use super::supposed::{Supposed, scene_of};
use super::trace::Trace;
use crate::calibration::Observed;
use crate::material::Material;
use crate::rate::BeforeAfter;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use utoipa::ToSchema;

/// Steps of the fit of a recording's own motions: Gauss and Newton's on a nearly quadratic form.
const NUM_STEPS: usize = 4;

/// What one recording's model says of another recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
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
    /// χ² of the displacement per datum, as `displacement_rms_mm`.
    #[serde(default)]
    pub chi2_per_datum: Option<BeforeAfter>,
    /// The same with the plates' shifts at each step fitted (how far they went, and where zero is), which no other
    /// recording tells, and nothing else; null where the parts of a set-up are not looked for.
    #[serde(default)]
    pub chi2_per_datum_with_own_shifts: Option<BeforeAfter>,
    /// The same with the plates' rotations at each step fitted as well.
    #[serde(default)]
    pub chi2_per_datum_with_own_motions: Option<BeforeAfter>,
}

/// Misfit of a prediction.
#[derive(Clone, Copy)]
struct Misfit {
    rms_mm: f64,
    force_relative: Option<f64>,
    chi2_per_datum: f64,
}

/// Predicts recordings by others.
pub(super) struct Predictor<'a> {
    /// Causes that recordings have in common, of which one size does not serve all.
    pub(super) refused: Vec<CauseIdentity>,
    /// Whether the work is to stop.
    pub(super) is_cancelled: &'a (dyn Fn() -> bool + Sync),
}

impl Predictor<'_> {
    /// What the models of case `from` say of case `to`.
    ///
    /// # Errors
    /// [`DiagnosisError`]: the work was cancelled.
    pub(super) fn prediction(
        &self,
        cases: &mut [Case],
        from: usize,
        to: usize,
    ) -> Result<CrossPrediction, DiagnosisError> {
        let teacher = cases[from].found;
        let causes = self.carried(cases, from, to);
        let case = &mut cases[to];
        case.laboratory.forget();
        let models: [(&Material, &[Supposed]); 2] =
            [(&teacher.nominal.material, &[]), (&teacher.corrected.material, &causes)];
        let own = if from == to { None } else { own_motions(&case.found.observed) };
        let (mut plain, mut shifted, mut moved) = (Vec::new(), Vec::new(), Vec::new());
        for (material, causes) in models {
            plain.push(self.misfit(case, material, causes)?);
            if let Some([shifts, motions]) = &own {
                shifted.push(self.with_own(shifts, case, material, causes)?);
                moved.push(self.with_own(motions, case, material, causes)?);
            }
        }
        let pair = |found: &[Option<Misfit>], of: &dyn Fn(&Misfit) -> Option<f64>| {
            let [before, after] = found else { return None };
            Some(BeforeAfter { before: of(before.as_ref()?)?, after: of(after.as_ref()?)? })
        };
        Ok(CrossPrediction {
            from: cases[from].name.into(),
            to: cases[to].name.into(),
            displacement_rms_mm: pair(&plain, &|m| Some(m.rms_mm)),
            force_relative: pair(&plain, &|m| m.force_relative),
            chi2_per_datum: pair(&plain, &|m| Some(m.chi2_per_datum)),
            chi2_per_datum_with_own_shifts: pair(&shifted, &|m| Some(m.chi2_per_datum)),
            chi2_per_datum_with_own_motions: pair(&moved, &|m| Some(m.chi2_per_datum)),
        })
    }

    /// The causes of case `from` that hold for case `to`. Artefacts belong to one recording alone. What is the rig's or
    /// the scanner's goes with them. Samples of one drawing may be one sample or two: a cause of the sample is carried
    /// over unless both have it and differ in it. A recording of another drawing shares neither places nor plates.
    fn carried(&self, cases: &[Case], from: usize, to: usize) -> Vec<Supposed> {
        let teacher = cases[from].found;
        if from == to {
            return teacher.corrected.causes.clone();
        }
        let is_same_drawing = {
            let [a, b] = [from, to].map(|n| &cases[n].found.observed.specimen);
            a.block == b.block && a.holes == b.holes
        };
        let is_samples = |c: &Supposed| {
            let located = c.cause.location(&c.values, &teacher.observed.specimen).is_some();
            let is_carried = is_same_drawing || c.cause.category() == Category::Material && !located;
            is_carried && !self.refused.contains(&c.cause.identity())
        };
        let held_to_rig = |c: &Supposed| {
            let mut values = c.cause.start();
            for ((value, found), p) in values.iter_mut().zip(&c.values).zip(c.cause.parameters()) {
                if p.is_of_rig {
                    *value = *found;
                }
            }
            Supposed { cause: c.cause.clone(), values }
        };
        let own_of_a_step = |c: &Supposed| c.cause.parameters().iter().any(|p| p.only_step.is_some());
        teacher
            .corrected
            .causes
            .iter()
            .filter(|c| !c.cause.is_artefact() && !own_of_a_step(c))
            .filter_map(|c| match c.cause.parameters().iter().any(|p| p.is_of_rig) {
                true => Some(held_to_rig(c)),
                false => is_samples(c).then(|| c.clone()),
            })
            .collect()
    }

    /// A prediction; `None` where the model has no equilibrium.
    fn predict(
        &self,
        case: &mut Case,
        material: &Material,
        causes: &[Supposed],
    ) -> Result<Option<Prediction>, DiagnosisError> {
        match case.laboratory.predict(material, &scene_of(causes), self.is_cancelled) {
            Ok(prediction) => Ok(Some(prediction)),
            Err(error) if (self.is_cancelled)() => Err(error),
            Err(_) => Ok(None),
        }
    }

    fn misfit(
        &self,
        case: &mut Case,
        material: &Material,
        causes: &[Supposed],
    ) -> Result<Option<Misfit>, DiagnosisError> {
        Ok(self.predict(case, material, causes)?.map(|p| misfit(case, &p.trace)))
    }

    /// The misfit with `own` motions of the plates fitted so that χ² is smallest, material and causes as they are.
    fn with_own(
        &self,
        own: &Arc<dyn Cause>,
        case: &mut Case,
        material: &Material,
        causes: &[Supposed],
    ) -> Result<Option<Misfit>, DiagnosisError> {
        let mut all = causes.to_vec();
        all.push(Supposed { values: own.start(), cause: own.clone() });
        for _ in 0..NUM_STEPS {
            let Some(prediction) = self.predict(case, material, &all)? else { return Ok(None) };
            let Ok(columns) = derivatives(&mut case.laboratory, material, &all, &prediction) else { return Ok(None) };
            let (matrix, gradient) =
                normal_system(&case.noise, &case.measured, &prediction, material, &all, &case.found.settings, &columns);
            let Some(own) = all.last_mut() else { return Ok(None) };
            let (num, num_own) = (matrix.nrows(), own.values.len());
            let first = num - num_own;
            let block = matrix.view((first, first), (num_own, num_own)).into_owned();
            let Some(factor) = block.cholesky() else { return Ok(None) };
            let step = factor.solve(&gradient.rows(first, num_own).into_owned());
            for ((value, p), s) in own.values.iter_mut().zip(own.cause.parameters()).zip(step.iter()) {
                *value = (*value + s * p.scale).clamp(p.range[0], p.range[1]);
            }
        }
        self.misfit(case, material, &all)
    }
}

/// The plates' shifts at each step, and their shifts and rotations; `None` where the parts of a set-up are not looked
/// for.
fn own_motions(observed: &Observed) -> Option<[Arc<dyn Cause>; 2]> {
    let is_of_steps = |c: &dyn Cause| c.moves_only_plates() && c.parameters().iter().all(|p| p.only_step.is_some());
    let motions = Registry::standard().set_up(observed).into_iter().find(|c| is_of_steps(c.as_ref()))?;
    Some([Arc::new(Travel::shifts_of(observed)), motions])
}

/// Displacement misfit, the largest relative misfit of a force, and χ².
fn misfit(case: &Case, predicted: &Trace) -> Misfit {
    let left = case.measured.plus(-1.0, predicted);
    let finite = left.displacement.iter().flatten().flatten().filter(|x| x.is_finite());
    let (sum, count) = finite.fold((0.0, 0usize), |(s, n), x| (s + x * x, n + 1));
    let force_relative = case
        .found
        .observed
        .steps
        .iter()
        .zip(left.force.iter().zip(&case.measured.force))
        .filter(|(step, (_, f))| step.force.is_some() && f.abs() > 0.0)
        .map(|(_, (l, f))| (l / f).abs())
        .reduce(f64::max);
    let chi2_per_datum = leftover(&case.found.observed, &left, &case.metric).chi2_per_datum;
    Misfit { rms_mm: (sum / count.max(1) as f64).sqrt(), force_relative, chi2_per_datum }
}
