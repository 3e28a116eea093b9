//! The models of all recordings of a fit, solved side by side.

use super::error::CalibrationError;
use super::observed::{Observed, View};
use super::prediction::{AtDrive, Averages, Prediction, Unseen};
use super::stress_path::StressPath;
use crate::fem::{Departures, Equilibrium, ForwardModel, ModelPool, SolveError, SolveOptions, side_by_side};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;
use std::ops::Range;

/// The models of all recordings, and how the scans see them.
pub(super) struct Models {
    /// Of the sample that was scanned, the first that each recording's specimen lists.
    pub(super) scanned: Vec<ModelPool>,
    /// Of the other samples that share each recording's load cell, where it has forces.
    pub(super) others: Vec<Vec<ModelPool>>,
    /// How each scan sees the scanned sample.
    pub(super) views: Vec<View>,
}

/// A sample of a recording to be solved.
struct ToSolve<'t> {
    model: &'t ModelPool,
    seen: &'t dyn Averages,
    drives_mm: Vec<f64>,
    /// Equilibria of another material.
    near: Option<&'t [Equilibrium]>,
}

impl ToSolve<'_> {
    /// Drives that are solved one after the other, because each starts from the last; apart where equilibria of another
    /// material are known at all of them.
    fn stretches(&self) -> Vec<Range<usize>> {
        let num = self.drives_mm.len();
        match self.near {
            Some(near) if near.len() >= num => (0..num).map(|d| d..d + 1).collect(),
            _ => std::iter::once(0..num).collect(),
        }
    }

    /// Solves a stretch of the drives.
    fn solve(
        &self,
        stretch: Range<usize>,
        material: &Material,
        solve: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<AtDrive>, CalibrationError> {
        self.model.with(|model| {
            let near = self.near.and_then(|near| near.get(stretch.start..stretch.end.min(near.len())));
            AtDrive::along(model, self.seen, &self.drives_mm[stretch], material, near, solve, is_cancelled)
        })
    }
}

impl Models {
    /// Of `observed`, meshed with `mesh`.
    ///
    /// # Errors
    /// As [`super::CalibrationProblem::new`].
    pub(super) fn new(
        observed: &[Observed],
        mesh: &dyn Fn(&Specimen) -> MeshOptions,
    ) -> Result<Models, CalibrationError> {
        let mut models = Models { scanned: Vec::new(), others: Vec::new(), views: Vec::new() };
        for recording in observed {
            let mut samples = recording.specimen.samples();
            // Others are felt in the force alone.
            let others = if recording.num_forces() > 0 { samples.split_off(1) } else { Vec::new() };
            let specimen = &samples[0];
            let model = ForwardModel::of_specimen(specimen, &mesh(specimen))?;
            models.views.push(recording.view(specimen, model.mesh())?);
            models.scanned.push(ModelPool::new(with_boundary(model, recording)?));
            let of_other = |sample: &Specimen| ForwardModel::of_specimen(sample, &mesh(sample)).map(ModelPool::new);
            models.others.push(others.iter().map(of_other).collect::<Result<_, _>>()?);
        }
        Ok(models)
    }

    /// The states that predictions of `material` visit.
    pub(super) fn stress_path(&self, material: &Material, predictions: &[Prediction]) -> StressPath {
        predictions
            .iter()
            .zip(&self.scanned)
            .map(|(prediction, model)| StressPath::new(model.own(), material, &prediction.states))
            .fold(StressPath::default(), StressPath::join)
    }

    /// What `material` predicts of every recording; `near` is what another one does.
    ///
    /// # Errors
    /// [`CalibrationError`]: a sample has no equilibrium.
    pub(super) fn predict(
        &self,
        observed: &[Observed],
        material: &Material,
        near: Option<&[Prediction]>,
        solve: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<Prediction>, CalibrationError> {
        // The samples of the first recording, the one that was scanned first, then those of the next.
        let mut samples: Vec<ToSolve> = Vec::new();
        for (r, recording) in observed.iter().enumerate() {
            let near = near.and_then(|n| n.get(r));
            samples.extend(self.samples(r).enumerate().map(|(place, (model, seen))| {
                let near = near.and_then(|n| n.states_of(place));
                ToSolve { model, seen, drives_mm: recording.all_drives_mm(), near }
            }));
        }
        let parts = samples.iter().flat_map(|s| s.stretches().into_iter().map(move |stretch| (s, stretch)));
        let solved =
            side_by_side(parts.collect(), |(sample, stretch)| sample.solve(stretch, material, solve, is_cancelled));
        let mut drives = solved.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten();
        let mut samples = samples.iter();
        let mut of_next = || {
            let num = samples.next().map_or(0, |s| s.drives_mm.len());
            Prediction::of_drives(material, drives.by_ref().take(num))
        };
        let of_recording = |others: &Vec<ModelPool>| {
            let mut prediction = of_next();
            others.iter().for_each(|_| prediction.join(of_next()));
            prediction
        };
        Ok(self.others.iter().map(of_recording).collect())
    }

    /// `predictions` with derivatives by the moduli of further terms of `exponents`, behind those that are there.
    ///
    /// # Errors
    /// [`CalibrationError::Solve`]: there is no room for a further term, or it was cancelled.
    pub(super) fn with_further_terms(
        &self,
        predictions: &[Prediction],
        exponents: &[f64],
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<Prediction>, CalibrationError> {
        let mut places: Vec<(usize, usize, usize)> = Vec::new();
        for (r, prediction) in predictions.iter().enumerate() {
            for sample in 0..self.samples(r).count() {
                places.extend((0..prediction.states.len()).map(|d| (r, sample, d)));
            }
        }
        let further = side_by_side(places.clone(), |(r, sample, d)| -> Result<_, CalibrationError> {
            let prediction = &predictions[r];
            let (Some((model, seen)), Some(states)) = (self.samples(r).nth(sample), prediction.states_of(sample))
            else {
                return Ok(Vec::new());
            };
            let state = &states[d];
            if is_cancelled() {
                return Err(SolveError::Cancelled { reached_mm: state.drive_mm }.into());
            }
            model.with(|model| {
                let found = model.tangent(&prediction.material, state)?.further_term_sensitivities(exponents)?;
                found.iter().map(|s| Ok((seen.averages(&s.displacement)?, s.force_n))).collect()
            })
        });
        let mut wide = predictions.to_vec();
        for ((r, sample, d), further) in places.into_iter().zip(further) {
            wide[r].add_derivatives(d, sample, further?);
        }
        Ok(wide)
    }

    /// The samples of a recording, the one that was scanned first, and how the scan sees each.
    fn samples(&self, recording: usize) -> impl Iterator<Item = (&ModelPool, &dyn Averages)> {
        let seen: &dyn Averages = &self.views[recording];
        let others = self.others[recording].iter().map(|model| (model, &Unseen as &dyn Averages));
        std::iter::once((&self.scanned[recording], seen)).chain(others)
    }
}

/// A model with what was measured at the boundary of a recording.
fn with_boundary(model: ForwardModel, recording: &Observed) -> Result<ForwardModel, CalibrationError> {
    match &recording.steps[..] {
        _ if !recording.has_measured_faces() => Ok(model),
        _ if !recording.specimen.other_samples.is_empty() => {
            let reason = "other samples share the load cell, and nothing was measured at their boundaries";
            Err(CalibrationError::NoMeasuredBoundary { reason })
        }
        [step] => Ok(model.departed(&Departures { faces_per_mm: step.faces_per_mm.clone(), ..Departures::default() })),
        _ => {
            let reason = "several steps share a model; take the steps apart";
            Err(CalibrationError::NoMeasuredBoundary { reason })
        }
    }
}
