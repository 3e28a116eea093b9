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
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use utoipa::ToSchema;

/// Steps of the fit of a recording's own motions: Gauss and Newton's on a nearly quadratic form.
const NUM_STEPS: usize = 4;

/// A number of the rig of which the plates' shifts leave less than this part of the information stays as the whole fit
/// found it: a rotation about the plates' normal turns the drive within their plane, which shifts do as well (on the
/// published blocks a hundredth is left of it, and a half or more of the two others).
const LEAST_INFORMATION: f64 = 0.1;

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
    /// recording tells, and nothing else; what is the rig's or the scanner's is then what the fitted recording says of
    /// it with its own shifts alone, because a rotation of the rig and turns of the plates share what they explain.
    /// Null where the parts of a set-up are not looked for.
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
        let carried = self.carried(cases, from, to);
        let beside_shifts = match from == to {
            true => None,
            false => self.rig_beside_shifts(&mut cases[from], &carried)?,
        };
        let beside_shifts = beside_shifts.unwrap_or_else(|| carried.clone());
        let case = &mut cases[to];
        case.laboratory.forget();
        let [nominal, corrected] = [&teacher.nominal.material, &teacher.corrected.material];
        let own = if from == to { None } else { own_motions(&case.found.observed) };
        let (mut plain, mut shifted, mut moved) = (Vec::new(), Vec::new(), Vec::new());
        let nothing = Carried::default();
        for (material, causes, beside_shifts) in [(nominal, &nothing, &nothing), (corrected, &carried, &beside_shifts)]
        {
            plain.push(self.misfit(case, material, &causes.all())?);
            if let Some([shifts, motions]) = &own {
                shifted.push(self.with_own(shifts, case, material, beside_shifts)?);
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
    fn carried(&self, cases: &[Case], from: usize, to: usize) -> Carried {
        let teacher = cases[from].found;
        if from == to {
            return Carried { others: teacher.corrected.causes.clone(), of_rig: Vec::new() };
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
        let own_of_a_step = |c: &Supposed| c.cause.parameters().iter().any(|p| p.only_step.is_some());
        let known = teacher.corrected.causes.iter().filter(|c| !c.cause.is_artefact() && !own_of_a_step(c));
        let (of_rig, others): (Vec<&Supposed>, Vec<&Supposed>) =
            known.partition(|c| c.cause.parameters().iter().any(|p| p.is_of_rig));
        Carried {
            others: others.into_iter().filter(|c| is_samples(c)).cloned().collect(),
            of_rig: of_rig.into_iter().map(held_to_rig).collect(),
        }
    }

    /// What is carried of a recording, the rig's and the scanner's part of it as its own plates' shifts leave it, and
    /// nothing else of its set-up; `None` where nothing is the rig's or there is no such fit.
    fn rig_beside_shifts(&self, case: &mut Case, carried: &Carried) -> Result<Option<Carried>, DiagnosisError> {
        let Some([shifts, _]) = own_motions(&case.found.observed).filter(|_| !carried.of_rig.is_empty()) else {
            return Ok(None);
        };
        case.laboratory.forget();
        let material = &case.found.corrected.material;
        let mut all = carried.all();
        all.push(Supposed::at_start(shifts));
        let num_held = carried.others.len();
        let Some(all) = self.fitted(case, material, all, num_held, Weighed::ByWhatIsLeft)? else {
            return Ok(None);
        };
        let of_rig = all[num_held..all.len() - 1].iter().map(held_to_rig).collect();
        Ok(Some(Carried { others: carried.others.clone(), of_rig }))
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
        causes: &Carried,
    ) -> Result<Option<Misfit>, DiagnosisError> {
        let mut all = causes.all();
        let num_held = all.len();
        all.push(Supposed::at_start(own.clone()));
        match self.fitted(case, material, all, num_held, Weighed::ByNoise)? {
            Some(all) => self.misfit(case, material, &all),
            None => Ok(None),
        }
    }

    /// Causes of which those after the first `num_held` are fitted, material and the others as they are; `None` where
    /// there is no equilibrium on the way.
    fn fitted(
        &self,
        case: &mut Case,
        material: &Material,
        mut all: Vec<Supposed>,
        num_held: usize,
        weighed: Weighed,
    ) -> Result<Option<Vec<Supposed>>, DiagnosisError> {
        let num_free: usize = all[num_held..].iter().map(|c| c.values.len()).sum();
        for _ in 0..NUM_STEPS {
            let Some(prediction) = self.predict(case, material, &all)? else { return Ok(None) };
            let Ok(columns) = derivatives(&mut case.laboratory, material, &all, &prediction) else { return Ok(None) };
            let metric = match weighed {
                Weighed::ByNoise => case.noise.clone(),
                Weighed::ByWhatIsLeft => {
                    let residual = case.measured.plus(-1.0, &prediction.trace);
                    let left = leftover(&case.found.observed, &residual, &case.noise);
                    case.noise.clone().with_variance(left.variance_mm2(case.found.allowance_mm))
                }
            };
            let (matrix, gradient) =
                normal_system(&metric, &case.measured, &prediction, material, &all, &case.found.settings, &columns);
            let first = matrix.nrows() - num_free;
            let block = matrix.view((first, first), (num_free, num_free)).into_owned();
            let is_of_rig = all[num_held..].iter().flat_map(|c| c.cause.parameters()).map(|p| p.is_of_rig);
            let Some(step) = step_of(block, gradient.rows(first, num_free).into_owned(), is_of_rig) else {
                return Ok(None);
            };
            let mut steps = step.iter();
            for free in &mut all[num_held..] {
                for ((value, p), s) in free.values.iter_mut().zip(free.cause.parameters()).zip(steps.by_ref()) {
                    *value = (*value + s * p.scale).clamp(p.range[0], p.range[1]);
                }
            }
        }
        Ok(Some(all))
    }
}

/// The step of a fit with this normal system; numbers of the rig that the others imitate do not move
/// ([`LEAST_INFORMATION`]). `None` where the system is singular.
fn step_of(
    mut matrix: DMatrix<f64>,
    mut slope: DVector<f64>,
    is_of_rig: impl Iterator<Item = bool>,
) -> Option<DVector<f64>> {
    let covariance = matrix.clone().cholesky()?.inverse();
    for (i, of_rig) in is_of_rig.enumerate() {
        let own = 1.0 / (matrix[(i, i)] * covariance[(i, i)]);
        if of_rig && own < LEAST_INFORMATION {
            slope[i] = 0.0;
            matrix.row_mut(i).fill(0.0);
            matrix.column_mut(i).fill(0.0);
            matrix[(i, i)] = 1.0;
        }
    }
    Some(matrix.cholesky()?.solve(&slope))
}

/// What holds for another recording, too.
#[derive(Clone, Default)]
struct Carried {
    /// The material's and the sample's.
    others: Vec<Supposed>,
    /// The rig's and the scanner's.
    of_rig: Vec<Supposed>,
}

impl Carried {
    /// The rig's last.
    fn all(&self) -> Vec<Supposed> {
        self.others.iter().chain(&self.of_rig).cloned().collect()
    }
}

/// Of a cause what is the rig's; its other numbers as if nothing were known of them.
fn held_to_rig(c: &Supposed) -> Supposed {
    let mut values = c.cause.start();
    for ((value, found), p) in values.iter_mut().zip(&c.values).zip(c.cause.parameters()) {
        if p.is_of_rig {
            *value = *found;
        }
    }
    Supposed { cause: c.cause.clone(), values }
}

/// By what the misfit of a fit is weighed.
#[derive(Clone, Copy, PartialEq)]
enum Weighed {
    /// By the noise alone, as χ² is.
    ByNoise,
    /// By what the fit leaves as well, so that what is believed counts.
    ByWhatIsLeft,
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A number of the rig that another one imitates stays, one that nothing imitates moves, and so does one that is
    /// not the rig's.
    #[test]
    fn what_shifts_imitate_stays() {
        let matrix = DMatrix::from_row_slice(3, 3, &[1.0, 0.0, 0.99, 0.0, 2.0, 0.0, 0.99, 0.0, 1.0]);
        let slope = DVector::from_column_slice(&[1.0, 4.0, 0.5]);
        let step = step_of(matrix.clone(), slope.clone(), [true, true, false].into_iter()).expect("regular");
        // 1 − 0.99² = 0.02 of the first is its own. Rounding alone.
        assert!((step - DVector::from_column_slice(&[0.0, 2.0, 0.5])).amax() < 1e-14);
        let free = step_of(matrix.clone(), slope.clone(), [false; 3].into_iter()).expect("regular");
        assert!((&matrix * free - slope).amax() < 1e-12);
        assert!(step_of(DMatrix::zeros(2, 2), DVector::zeros(2), [true; 2].into_iter()).is_none());
    }
}
