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
pub(super) trait Averages: Sync {
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

/// What a material predicts at one drive; see [`Prediction`].
pub(super) struct AtDrive {
    state: Equilibrium,
    displacements: Vec<[f64; 3]>,
    sensitivities: Vec<Vec<[f64; 3]>>,
    force_sensitivities: Vec<f64>,
    work: SolverWork,
}

impl AtDrive {
    /// Solves at one drive after the other, from `near`, equilibria of another material at the same drives; where there
    /// are none, from the last drive's.
    ///
    /// # Errors
    /// [`CalibrationError`]: there is no equilibrium.
    pub(super) fn along(
        model: &mut ForwardModel,
        seen: &dyn Averages,
        drives_mm: &[f64],
        material: &Material,
        near: Option<&[Equilibrium]>,
        solve: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<AtDrive>, CalibrationError> {
        let mut drives: Vec<AtDrive> = Vec::with_capacity(drives_mm.len());
        for (index, &drive_mm) in drives_mm.iter().enumerate() {
            let start = near.and_then(|n| n.get(index)).or(drives.last().map(|d| &d.state));
            drives.push(AtDrive::new(model, seen, drive_mm, material, start, solve, is_cancelled)?);
        }
        Ok(drives)
    }

    /// Solves at `drive_mm` from `start`, or from rest.
    ///
    /// # Errors
    /// [`CalibrationError`]: there is no equilibrium.
    fn new(
        model: &mut ForwardModel,
        seen: &dyn Averages,
        drive_mm: f64,
        material: &Material,
        start: Option<&Equilibrium>,
        solve: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<AtDrive, CalibrationError> {
        let before = model.num_factorisations();
        let warm = model.solve(material, drive_mm, start, solve, is_cancelled);
        let mut newton_iterations = model.statistics().newton_iterations;
        let state = match warm {
            Err(SolveError::Cancelled { reached_mm }) => return Err(SolveError::Cancelled { reached_mm }.into()),
            // From rest, unless that is what failed.
            Err(_) if start.is_some() => {
                let cold = model.solve(material, drive_mm, None, solve, is_cancelled);
                newton_iterations += model.statistics().newton_iterations;
                cold?
            }
            other => other?,
        };
        // At once: the tangent of a state just found costs nothing.
        let sensitivities = model.tangent(material, &state)?.material_sensitivities()?;
        let fields = sensitivities.iter().map(|s| seen.averages(&s.displacement));
        Ok(AtDrive {
            displacements: seen.averages(&state.displacement)?,
            sensitivities: fields.collect::<Result<_, _>>()?,
            force_sensitivities: sensitivities.iter().map(|s| s.force_n).collect(),
            work: SolverWork { equilibria: 1, newton_iterations, factorisations: model.num_factorisations() - before },
            state,
        })
    }
}

impl Prediction {
    /// With what is predicted at the drives one after the other.
    pub(super) fn of_drives(material: &Material, drives: impl IntoIterator<Item = AtDrive>) -> Prediction {
        let mut prediction = Prediction {
            material: material.clone(),
            states: Vec::new(),
            joined: Vec::new(),
            forces_n: Vec::new(),
            displacements: Vec::new(),
            sensitivities: Vec::new(),
            force_sensitivities: Vec::new(),
            work: SolverWork::default(),
        };
        for drive in drives {
            prediction.work.add(drive.work);
            prediction.displacements.push(drive.displacements);
            prediction.sensitivities.push(drive.sensitivities);
            prediction.force_sensitivities.push(drive.force_sensitivities);
            prediction.forces_n.push(drive.state.force_n);
            prediction.states.push(drive.state);
        }
        prediction
    }

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
        let drives = AtDrive::along(model, seen, drives_mm, material, near, solve, is_cancelled)?;
        Ok(Prediction::of_drives(material, drives))
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

    /// Adds derivatives of one kind of sample at one drive (of its voxels, and of the force), behind those that are
    /// there; samples come in their order, the first is 0.
    pub(super) fn add_derivatives(&mut self, drive: usize, sample: usize, further: Vec<(Vec<[f64; 3]>, f64)>) {
        let (fields, forces_n) = (&mut self.sensitivities[drive], &mut self.force_sensitivities[drive]);
        // Those of further samples join what the first has added.
        let at = fields.len() - further.len().min(fields.len());
        for (n, (field, force_n)) in further.into_iter().enumerate() {
            if sample == 0 {
                fields.push(field);
                forces_n.push(force_n);
            } else {
                fields[at + n].extend(field);
                forces_n[at + n] += force_n;
            }
        }
    }

    /// The same with the terms of the material in another order: the first of the new one stands at place `order[0]`.
    pub(super) fn with_terms_in_order(mut self, order: &[usize]) -> Prediction {
        let terms = order.iter().map(|&n| self.material.terms[n]).collect();
        let places: Vec<usize> = std::iter::once(0).chain(order.iter().flat_map(|n| [1 + 2 * n, 2 + 2 * n])).collect();
        self.material.terms = terms;
        for fields in &mut self.sensitivities {
            *fields = places.iter().map(|&p| std::mem::take(&mut fields[p])).collect();
        }
        for forces in &mut self.force_sensitivities {
            *forces = places.iter().map(|&p| forces[p]).collect();
        }
        self
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
