//! The first half of a round: every suspect is tested to first order, with the material and the causes found so far
//! free.

use super::candidate::Candidate;
use super::cause::{Cause, CauseParameter, Course};
use super::cause_fit::CauseFit;
use super::error::DiagnosisError;
use super::evidence::{EVIDENCE, WORTH_A_FIT};
use super::fit::{STEP, prior_scales};
use super::inference::Inference;
use super::laboratory::{Laboratory, Prediction};
use super::maps::ScoreMap;
use super::prior::FitSettings;
use super::registry::Registry;
use super::score::ScoreTest;
use super::search::Search;
use super::supposed::{Path, Supposed, paths_of, scene_of};
use super::trace::Trace;
use crate::calibration::Observed;
use crate::material::Material;
use std::sync::Arc;

/// Most full fits per round.
const MAX_FITS: usize = 5;
/// Most full fits per round where the set-up is in the fit: its many parameters make them long.
const MAX_FITS_WITH_SET_UP: usize = 2;
/// First order may overshoot: a fit starts at most so many scales of a parameter away.
const LARGEST_START: f64 = 5.0;
/// A step within this part of the largest drive is near rest and tells no course from another.
const NEAR_REST: f64 = 1e-3;

/// What a round looks for.
#[derive(Clone, Copy)]
pub(super) struct RoundScope {
    /// Whether a load curve was read, which tells of some causes better than the steps' forces do.
    pub(super) has_load_curve: bool,
}

/// What the tests of a round say.
pub(super) struct RoundScores {
    /// All candidates, most explaining first.
    pub(super) candidates: Vec<Candidate>,
    /// Changes of the prediction with the scaled parameters of the fit so far.
    pub(super) known: Vec<Trace>,
    /// The maps of what the fit so far leaves, with their names.
    pub(super) maps: Vec<(String, ScoreMap)>,
}

/// Tests every suspect to first order.
///
/// # Errors
/// [`DiagnosisError`].
pub(super) fn score_suspects(
    inference: &mut Inference,
    registry: &Registry,
    current: &CauseFit,
    scope: RoundScope,
) -> Result<RoundScores, DiagnosisError> {
    let observed = inference.laboratory.observed();
    let suspects = suspects_of(registry, observed, &current.causes, scope.has_load_curve);
    let (nuisance, directions) = directions_of(&mut inference.laboratory, Place::of(current), &suspects)?;
    let Inference { laboratory, metric, settings, is_cancelled, .. } = inference;
    let test = ScoreTest::new(metric, &current.residual, &nuisance, &nuisance_priors(current, settings));
    let mut candidates: Vec<Candidate> = suspects
        .into_iter()
        .zip(&directions)
        .filter_map(|(cause, directions)| scored(cause, directions, &test, observed))
        .collect();
    let mut search = Search::new(laboratory, current, &test, *is_cancelled);
    registry.search(&mut search, &mut candidates)?;
    let maps = search.into_maps()?;
    candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
    drop(test);
    Ok(RoundScores { candidates, known: nuisance, maps })
}

/// What the set-up as a whole explains of what `current` leaves, to first order and as far as its beliefs allow.
///
/// # Errors
/// [`DiagnosisError`].
pub(super) fn score_of_set_up(
    inference: &mut Inference,
    registry: &Registry,
    current: &CauseFit,
) -> Result<f64, DiagnosisError> {
    let parts = registry.set_up(inference.laboratory.observed());
    let (nuisance, directions) = directions_of(&mut inference.laboratory, Place::of(current), &parts)?;
    let test =
        ScoreTest::new(&inference.metric, &current.residual, &nuisance, &nuisance_priors(current, &inference.settings));
    let precision: Vec<f64> = parts.iter().flat_map(|c| c.parameters()).map(|p| prior_scales(&p).powi(-2)).collect();
    Ok(test.explained_believed(&directions.concat(), &precision))
}

/// What is known of the parameters of the fit so far, as precisions in their scales: of ln κ, and of the causes'
/// parameters of which something is believed.
fn nuisance_priors(current: &CauseFit, settings: &FitSettings) -> Vec<f64> {
    let mut priors = vec![0.0; current.material.parameters().len()];
    priors[0] = settings.bulk.log_sd.powi(-2);
    let believed = |p: CauseParameter| p.believed_sd.map_or(0.0, |_| prior_scales(&p).powi(-2));
    priors.extend(current.causes.iter().flat_map(|c| c.cause.parameters()).map(believed));
    priors
}

/// The candidates worth a full fit: of each name as many as the cause asks for, most explaining first.
pub(super) fn leading<'c>(candidates: &'c [Candidate], current: &CauseFit) -> Vec<&'c Candidate> {
    let has_set_up = current.causes.iter().any(|s| s.cause.is_of_set_up());
    let max_fits = if has_set_up { MAX_FITS_WITH_SET_UP } else { MAX_FITS };
    let mut chosen: Vec<&Candidate> = Vec::new();
    let top = candidates.first().map_or(0.0, |c| c.score);
    for c in candidates {
        let is_worth = c.score > EVIDENCE && c.score > WORTH_A_FIT * top;
        let num_alike = chosen.iter().filter(|o| o.cause.name() == c.cause.name()).count();
        if is_worth && num_alike < c.cause.max_suspects() && chosen.len() < max_fits {
            chosen.push(c);
        }
    }
    chosen
}

/// Whether a recording has steps at different drives.
pub(super) fn has_several_drives(observed: &Observed) -> bool {
    observed.steps.iter().any(|s| (s.drive_mm - observed.steps[0].drive_mm).abs() > 0.0)
}

/// The suspects for which every recording is tested, as far as this recording can tell of them. What is in the fit
/// already is free there and is not tested again: nor are plain motions where the plates are free, nor what takes up
/// whatever is smooth where the set-up is in the fit.
pub(super) fn suspects_of(
    registry: &Registry,
    observed: &Observed,
    found: &[Supposed],
    has_load_curve: bool,
) -> Vec<Arc<dyn Cause>> {
    let has_several_drives = has_several_drives(observed);
    let has = |is: fn(&dyn Cause) -> bool| found.iter().any(|s| is(&*s.cause));
    let (is_said, has_set_up) = (registry.special_cases(found), has(|c| c.is_of_set_up()));
    registry
        .tested(&observed.specimen)
        .into_iter()
        .filter(|c| !(has_load_curve && c.is_read_from_load_curve()))
        .filter(|c| has_several_drives || !c.needs_several_drives())
        .filter(|c| !(is_said.contains(&c.name()) || has_set_up && c.is_sponge()))
        .filter(|c| !found.iter().any(|s| s.cause.identity() == c.identity()))
        .collect()
}

/// Where changes of the prediction are looked at.
#[derive(Clone, Copy)]
pub(super) struct Place<'p> {
    /// The material.
    pub(super) material: &'p Material,
    /// The causes found so far.
    pub(super) causes: &'p [Supposed],
    /// What both predict.
    pub(super) prediction: &'p Prediction,
}

impl<'p> Place<'p> {
    /// Where a fit ended.
    fn of(fitted: &'p CauseFit) -> Place<'p> {
        Place { material: &fitted.material, causes: &fitted.causes, prediction: &fitted.prediction }
    }
}

/// Changes of the prediction: with the scaled parameters of the material and the causes at `place`, and per suspect
/// with its own, in scales.
///
/// # Errors
/// [`DiagnosisError::Solve`].
pub(super) fn directions_of(
    laboratory: &mut Laboratory,
    place: Place,
    suspects: &[Arc<dyn Cause>],
) -> Result<(Vec<Trace>, Vec<Vec<Trace>>), DiagnosisError> {
    let Place { material, causes, prediction } = place;
    let with_suspect: Vec<Vec<Supposed>> = suspects
        .iter()
        .map(|cause| {
            let mut all = causes.to_vec();
            all.push(Supposed::at_start(cause.clone()));
            all
        })
        .collect();
    // The suspect's own parameters are the last ones.
    let own: Vec<Vec<Path>> = with_suspect
        .iter()
        .zip(suspects)
        .map(|(all, cause)| {
            let mut paths = paths_of(all);
            paths.split_off(paths.len() - cause.parameters().len())
        })
        .collect();
    let known = paths_of(causes);
    let paths: Vec<&Path> = known.iter().chain(own.iter().flatten()).collect();
    let mut columns = laboratory.derivatives(material, &scene_of(causes), prediction, true, &paths, STEP)?;
    let parameters = material.parameters();
    let mut rest = columns.split_off(parameters.len() + known.len());
    for (trace, p) in columns.iter_mut().zip(&parameters) {
        *trace = trace.scaled(material.value(*p));
    }
    let mut directions = Vec::with_capacity(own.len());
    for paths in &own {
        let after = rest.split_off(paths.len());
        directions.push(std::mem::replace(&mut rest, after));
    }
    Ok((columns, directions))
}

/// A suspect with what it explains; `None` where its course over the drives refutes it.
fn scored(cause: Arc<dyn Cause>, directions: &[Trace], test: &ScoreTest, observed: &Observed) -> Option<Candidate> {
    let score = test.test(directions);
    if has_several_drives(observed)
        && let Some(power) = power_of_opposite(cause.course())
    {
        let changed: Vec<Trace> = directions.iter().map(|d| times_drive(observed, d, power)).collect();
        if test.test(&changed).explained > score.explained + EVIDENCE {
            return None;
        }
    }
    let mut values = cause.start();
    for ((value, c), p) in values.iter_mut().zip(&score.coefficients).zip(cause.parameters()) {
        *value = (*value + c.clamp(-LARGEST_START, LARGEST_START) * p.scale).clamp(p.range[0], p.range[1]);
    }
    Some(Candidate { cause, values, score: score.explained })
}

/// The power of the drive by which an effect is multiplied so that it takes the opposite course; `None` where there is
/// no opposite.
fn power_of_opposite(course: Course) -> Option<i32> {
    match course {
        Course::Alike => Some(1),
        Course::InProportion => Some(-1),
        Course::ItsOwn => None,
    }
}

/// A change times a power of the drive (relative to the largest one). Steps near rest are left out.
fn times_drive(observed: &Observed, trace: &Trace, power: i32) -> Trace {
    let steps = &observed.steps;
    let largest = steps.iter().fold(f64::MIN_POSITIVE, |a, s| a.max(s.drive_mm.abs()));
    let factor = |drive_mm: f64| {
        let part = drive_mm / largest;
        if part.abs() > NEAR_REST { part.powi(power) } else { 0.0 }
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
