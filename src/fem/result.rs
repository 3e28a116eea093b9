//! The result of a forward solution (`solve/1`).

use super::equilibrium::Equilibrium;
use super::forward_model::ForwardModel;
use super::options::Statistics;
use serde::{Deserialize, Serialize};

/// Forces at each drive, with what they rest on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolveResult {
    /// Always `solve/1`.
    pub schema: String,
    /// Drives, increasing.
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
#[serde(deny_unknown_fields)]
pub struct SolveStep {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Force along +x on the moved face, all samples together, N.
    pub force_n: f64,
    /// Force along +y on the moved face, all samples together, N.
    pub normal_force_n: f64,
    /// |sum of the forces on both faces| / |force|.
    pub reaction_imbalance: f64,
    /// Largest principal stretch at a quadrature point.
    pub largest_principal_stretch: f64,
    /// Smallest and largest det F at a quadrature point.
    pub jacobian_range: [f64; 2],
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

    /// Adds an equilibrium; `extremes` are the largest principal stretch, the smallest and the largest det F.
    pub fn push(&mut self, equilibrium: &Equilibrium, extremes: [f64; 3], statistics: Statistics) {
        self.steps.push(SolveStep {
            drive_mm: equilibrium.drive_mm,
            force_n: equilibrium.force_n,
            normal_force_n: equilibrium.normal_force_n,
            reaction_imbalance: equilibrium.reaction_imbalance,
            largest_principal_stretch: extremes[0],
            jacobian_range: [extremes[1], extremes[2]],
            statistics,
        });
    }
}
