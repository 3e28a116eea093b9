//! The result of a forward solution (`solve/1`).

use super::contact::Contact;
use super::equilibrium::Equilibrium;
use super::forward_model::ForwardModel;
use super::options::Statistics;
use crate::mesh::{CoarserMeshes, MeshedResult};
use serde::{Deserialize, Serialize};

/// Forces at each drive, with what they rest on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct SolveResult {
    /// Always `solve/1`.
    pub schema: String,
    /// Drives, away from rest.
    pub steps: Vec<SolveStep>,
    /// Elements of the mesh.
    pub num_elements: usize,
    /// Free displacement unknowns.
    pub num_unknowns: usize,
    /// Whether mirror planes were used (y, z).
    pub mirror: [bool; 2],
    /// Smallest scaled Jacobian of the mesh's elements.
    pub min_scaled_jacobian: f64,
    /// Vector instructions in use.
    pub instruction_set: String,
    /// Version of the program.
    pub version: String,
    /// SHA-256 of specimen, material and mesh settings, hexadecimal.
    pub input_hash: String,
}

/// One drive of a [`SolveResult`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct SolveStep {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Force in the direction of the drive on the moved face, all samples together, N.
    pub force_n: f64,
    /// What the mesh may put the force wrong by, N: in 19 of 20 cases no more. Absent where no coarser mesh was
    /// solved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_discretisation_n: Option<f64>,
    /// Where there are several kinds of samples: the force of all samples of each kind, N.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub force_by_kind_n: Vec<f64>,
    /// Force along +y on the moved face, all samples together, N.
    pub normal_force_n: f64,
    /// What the mesh may put the force along +y wrong by, N, as `force_discretisation_n`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_force_discretisation_n: Option<f64>,
    /// |sum of the forces on both faces| / |force|.
    pub reaction_imbalance: f64,
    /// Largest principal stretch at a quadrature point.
    pub largest_principal_stretch: f64,
    /// Smallest and largest det F at a quadrature point.
    pub jacobian_range: [f64; 2],
    /// Where a bar that is pushed together touches itself or its grips, which the model does not know: what then.
    #[serde(default, skip_serializing_if = "Contact::is_none")]
    pub contact: Contact,
    /// Solver work.
    pub statistics: Statistics,
}

impl SolveResult {
    /// An empty result of `model`.
    pub fn new(model: &ForwardModel, input_hash: String) -> SolveResult {
        let mesh = model.mesh();
        SolveResult {
            schema: "solve/1".into(),
            steps: Vec::new(),
            num_elements: mesh.num_elements(),
            num_unknowns: model.num_unknowns(),
            mirror: [mesh.mirror.y, mesh.mirror.z],
            min_scaled_jacobian: mesh.quality().min_scaled_jacobian,
            instruction_set: model.instruction_set().into(),
            version: env!("CARGO_PKG_VERSION").into(),
            input_hash,
        }
    }

    /// The result of a test from those of its kinds of samples, at the same drives: forces, elements, unknowns and
    /// solver work add, of the rest the worst counts; mirror planes are those that all have.
    pub fn of_samples(parts: Vec<SolveResult>, input_hash: &str) -> SolveResult {
        let mut parts = parts.into_iter();
        let Some(mut all) = parts.next() else { unreachable!("a specimen has a first sample") };
        all.input_hash = input_hash.into();
        for part in parts {
            all.num_elements += part.num_elements;
            all.num_unknowns += part.num_unknowns;
            all.mirror = [0, 1].map(|axis| all.mirror[axis] && part.mirror[axis]);
            all.min_scaled_jacobian = all.min_scaled_jacobian.min(part.min_scaled_jacobian);
            for (step, own) in all.steps.iter_mut().zip(part.steps) {
                step.add_sample(own);
            }
        }
        all
    }

    /// Bounds what the mesh puts the forces wrong by; `coarser` are the forces (along the drive and along +y) at every
    /// drive on coarser `meshes`, `None` where such a mesh has no solution.
    pub fn bound_forces(&mut self, meshes: &CoarserMeshes, coarser: &[Option<Vec<[f64; 2]>>; 2]) {
        for (index, step) in self.steps.iter_mut().enumerate() {
            let on_coarser = |axis: usize| {
                let of_mesh = |forces: &Option<Vec<[f64; 2]>>| Some(forces.as_ref()?.get(index)?[axis]);
                [of_mesh(&coarser[0]), of_mesh(&coarser[1])]
            };
            let bound = |value: f64, axis: usize| meshes.bound(MeshedResult::Force, value, on_coarser(axis));
            step.force_discretisation_n = bound(step.force_n, 0);
            step.normal_force_discretisation_n = bound(step.normal_force_n, 1);
        }
    }

    /// Adds an equilibrium; `extremes` are the largest principal stretch, the smallest and the largest det F.
    pub fn push(&mut self, equilibrium: &Equilibrium, extremes: [f64; 3], contact: Contact, statistics: Statistics) {
        self.steps.push(SolveStep {
            drive_mm: equilibrium.drive_mm,
            force_n: equilibrium.force_n,
            force_discretisation_n: None,
            force_by_kind_n: Vec::new(),
            normal_force_n: equilibrium.normal_force_n,
            normal_force_discretisation_n: None,
            reaction_imbalance: equilibrium.reaction_imbalance,
            largest_principal_stretch: extremes[0],
            jacobian_range: [extremes[1], extremes[2]],
            contact,
            statistics,
        });
    }
}

impl SolveStep {
    /// Adds the same drive of another kind of sample.
    fn add_sample(&mut self, other: SolveStep) {
        if self.force_by_kind_n.is_empty() {
            self.force_by_kind_n.push(self.force_n);
        }
        self.force_by_kind_n.push(other.force_n);
        self.force_n += other.force_n;
        self.normal_force_n += other.normal_force_n;
        self.reaction_imbalance = self.reaction_imbalance.max(other.reaction_imbalance);
        self.largest_principal_stretch = self.largest_principal_stretch.max(other.largest_principal_stretch);
        let [low, high] = other.jacobian_range;
        self.jacobian_range = [self.jacobian_range[0].min(low), self.jacobian_range[1].max(high)];
        self.statistics.load_steps += other.statistics.load_steps;
        self.statistics.failed_steps += other.statistics.failed_steps;
        self.statistics.newton_iterations += other.statistics.newton_iterations;
    }
}
