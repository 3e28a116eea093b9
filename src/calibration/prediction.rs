//! What a material predicts of a measurement, with its derivatives by the material's parameters.

use super::error::CalibrationError;
use super::observed::View;
use crate::fem::{Equilibrium, ForwardModel, SolveError, SolveOptions};
use crate::material::Material;
use crate::voxel::VoxelOperator;
use utoipa::ToSchema;

/// A held parameter counts in the information as known to this relative standard deviation: exact to its square.
pub(super) const HELD_LOG_SD: f64 = 1e-6;

/// How a scan sees a nodal field.
pub(super) trait Averages {
    /// Values in the order of the data.
    fn averages(&self, field: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, CalibrationError>;
}

impl Averages for VoxelOperator {
    fn averages(&self, field: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, CalibrationError> {
        Ok(self.average(field)?)
    }
}

/// Of a sample that is not scanned: nothing is seen of it.
pub(super) struct Unseen;

impl Averages for Unseen {
    fn averages(&self, _: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, CalibrationError> {
        Ok(Vec::new())
    }
}

impl Averages for View {
    fn averages(&self, field: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, CalibrationError> {
        self.average(field)
    }
}

/// What solving took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SolverWork {
    /// Equilibria found.
    pub equilibria: usize,
    /// Newton iterations of them.
    pub newton_iterations: usize,
    /// Factorisations, those of the sensitivities included.
    pub factorisations: usize,
}

impl SolverWork {
    pub(super) fn add(&mut self, other: SolverWork) {
        self.equilibria += other.equilibria;
        self.newton_iterations += other.newton_iterations;
        self.factorisations += other.factorisations;
    }
}

/// What a material predicts of a measurement, with its derivatives. Does not depend on the data.
#[derive(Clone, Debug)]
pub(super) struct Prediction {
    pub(super) material: Material,
    pub(super) states: Vec<Equilibrium>,
    /// Equilibria of the kinds of samples that were joined to it.
    joined: Vec<Vec<Equilibrium>>,
    /// Force per drive, all samples together, N.
    pub(super) forces_n: Vec<f64>,
    /// Voxel displacements per drive, mm.
    pub(super) displacements: Vec<Vec<[f64; 3]>>,
    /// ∂ū/∂ξ per drive and parameter, mm per unit.
    pub(super) sensitivities: Vec<Vec<Vec<[f64; 3]>>>,
    /// ∂F/∂ξ per drive and parameter, N per unit.
    pub(super) force_sensitivities: Vec<Vec<f64>>,
    /// What making it took.
    pub(super) work: SolverWork,
}

impl Prediction {
    /// Solves at every drive; `near` are equilibria of another material at the same drives.
    pub(super) fn new(
        model: &mut ForwardModel,
        seen: &dyn Averages,
        drives_mm: &[f64],
        material: &Material,
        near: Option<&[Equilibrium]>,
        solve: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Prediction, CalibrationError> {
        let mut prediction = Prediction {
            material: material.clone(),
            states: Vec::with_capacity(drives_mm.len()),
            joined: Vec::new(),
            forces_n: Vec::with_capacity(drives_mm.len()),
            displacements: Vec::new(),
            sensitivities: Vec::new(),
            force_sensitivities: Vec::new(),
            work: SolverWork::default(),
        };
        let before = model.num_factorisations();
        for (index, &drive) in drives_mm.iter().enumerate() {
            let start = near.and_then(|n| n.get(index)).or(prediction.states.last());
            let warm = model.solve(material, drive, start, solve, is_cancelled);
            prediction.work.newton_iterations += model.statistics().newton_iterations;
            let state = match warm {
                Err(SolveError::Cancelled { reached_mm }) => return Err(SolveError::Cancelled { reached_mm }.into()),
                // From rest, unless that is what failed.
                Err(_) if start.is_some() => {
                    let cold = model.solve(material, drive, None, solve, is_cancelled);
                    prediction.work.newton_iterations += model.statistics().newton_iterations;
                    cold?
                }
                other => other?,
            };
            prediction.work.equilibria += 1;
            // At once: the tangent of a state just found costs nothing.
            let sensitivities = model.tangent(material, &state)?.material_sensitivities()?;
            prediction.displacements.push(seen.averages(&state.displacement)?);
            prediction
                .sensitivities
                .push(sensitivities.iter().map(|s| seen.averages(&s.displacement)).collect::<Result<Vec<_>, _>>()?);
            prediction.force_sensitivities.push(sensitivities.iter().map(|s| s.force_n).collect());
            prediction.forces_n.push(state.force_n);
            prediction.states.push(state);
        }
        prediction.work.factorisations = model.num_factorisations() - before;
        Ok(prediction)
    }

    /// Joins what another kind of sample of the same test does at the same drives: its voxels stand behind those that
    /// are there, its force adds.
    pub(super) fn join(&mut self, other: Prediction) {
        for (own, theirs) in self.displacements.iter_mut().zip(other.displacements) {
            own.extend(theirs);
        }
        let fields = self.sensitivities.iter_mut().flatten().zip(other.sensitivities.into_iter().flatten());
        fields.for_each(|(own, theirs)| own.extend(theirs));
        let forces = self.force_sensitivities.iter_mut().flatten().zip(other.force_sensitivities.iter().flatten());
        forces.for_each(|(own, theirs)| *own += theirs);
        self.forces_n.iter_mut().zip(&other.forces_n).for_each(|(own, theirs)| *own += theirs);
        self.work.add(other.work);
        self.joined.push(other.states);
        self.joined.extend(other.joined);
    }

    /// Equilibria of the kind of sample with this index, in the order in which they were joined; the first is 0.
    pub(super) fn states_of(&self, index: usize) -> Option<&[Equilibrium]> {
        match index {
            0 => Some(&self.states),
            other => self.joined.get(other - 1).map(|s| &s[..]),
        }
    }

    /// Per drive: ∂ū/∂ξ of every parameter, and ∂F/∂ξ.
    pub(super) fn derivatives(&self) -> impl Iterator<Item = (&Vec<Vec<[f64; 3]>>, &Vec<f64>)> {
        self.sensitivities.iter().zip(&self.force_sensitivities)
    }
}
