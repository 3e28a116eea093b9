//! The result of a fit: a material with causes, what they predict and what is left.

use super::laboratory::Prediction;
use super::scene::Scene;
use super::supposed::{Supposed, scene_of};
use super::trace::Trace;
use crate::material::Material;

/// A fitted material with causes.
#[derive(Clone)]
pub struct CauseFit {
    /// The material.
    pub material: Material,
    /// The causes.
    pub causes: Vec<Supposed>,
    /// Weighted squares of the misfit (see [`Metric`](super::metric::Metric)), priors included: −2 ln of the likelihood
    /// up to a constant.
    pub deviance: f64,
    /// Measured minus predicted.
    pub residual: Trace,
    /// What is predicted.
    pub prediction: Prediction,
    /// Standard deviations: material parameters, then the causes' in order, in their units.
    pub sd: Vec<f64>,
    /// Iterations made.
    pub iterations: usize,
}

impl CauseFit {
    /// Number of fitted parameters.
    pub fn num_parameters(&self) -> usize {
        self.material.parameters().len() + self.causes.iter().map(|c| c.values.len()).sum::<usize>()
    }

    /// Standard deviations of cause `index`'s parameters.
    pub fn sd_of(&self, index: usize) -> &[f64] {
        let first =
            self.material.parameters().len() + self.causes[..index].iter().map(|c| c.values.len()).sum::<usize>();
        &self.sd[first..first + self.causes[index].values.len()]
    }

    /// The scene of the causes.
    pub fn scene(&self) -> Scene {
        scene_of(&self.causes)
    }
}
