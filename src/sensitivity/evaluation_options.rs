//! Settings of an evaluation.

use super::covariance::IDENTIFIABILITY_LIMIT;
use super::protocol::Protocol;
use crate::fem::SolveOptions;
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;
use crate::voxel::Sampling;

/// Settings of an evaluation.
#[derive(Clone, Debug)]
pub struct EvaluationOptions {
    /// The mesh.
    pub mesh: MeshOptions,
    /// Sample points per voxel.
    pub sampling: Sampling,
    /// The solver.
    pub solve: SolveOptions,
    /// Largest relative standard deviation of an identifiable parameter.
    pub identifiability_limit: f64,
    /// Standard deviation of ln κ known beforehand, added to the joint information; none by default.
    pub bulk_log_prior_sd: Option<f64>,
    /// Forces read beside the scans, and what is not known exactly of the set-up; none by default.
    pub protocol: Protocol,
}

impl EvaluationOptions {
    /// Standard mesh, default sampling and tolerances, no prior.
    pub fn standard(specimen: &Specimen) -> Self {
        EvaluationOptions {
            mesh: MeshOptions::standard(specimen),
            sampling: Sampling::default(),
            solve: SolveOptions::default(),
            identifiability_limit: IDENTIFIABILITY_LIMIT,
            bulk_log_prior_sd: None,
            protocol: Protocol::default(),
        }
    }
}
