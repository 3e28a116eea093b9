//! What is known of a material before a fit, and when a fit stops.

use crate::material::Material;

/// What is known of κ beforehand: ln κ is Gaussian.
#[derive(Clone, Copy, Debug)]
pub struct BulkPrior {
    /// Centre, kPa.
    pub center_kpa: f64,
    /// Standard deviation of ln κ.
    pub log_sd: f64,
}

/// What is known of the initial shear modulus beforehand: its logarithm is Gaussian. Without any force the displacement
/// says nothing of it, only of its ratio to κ.
#[derive(Clone, Copy, Debug)]
pub struct ShearPrior {
    /// Centre, kPa.
    pub center_kpa: f64,
    /// Standard deviation of its logarithm.
    pub log_sd: f64,
}

impl ShearPrior {
    /// The prior's part of a fit in scaled parameters (κ first): its squares (the distance from the centre in standard
    /// deviations, squared), the derivatives of the modulus' logarithm, and the factor on these that gives half of the
    /// squares' negative gradient.
    pub(super) fn terms(&self, material: &Material) -> (f64, Vec<f64>, f64) {
        let modulus = shear_modulus(material);
        let away = (self.center_kpa / modulus).ln();
        let weight = self.log_sd.powi(-2);
        let derivatives = material.initial_shear_modulus_derivatives();
        let scaled = material.parameters().into_iter().zip(derivatives);
        let slope = scaled.map(|(p, derivative)| derivative * material.value(p) / modulus).collect();
        (weight * away * away, slope, weight * away)
    }
}

/// Settings of a fit.
#[derive(Clone, Copy, Debug)]
pub struct FitSettings {
    /// Most iterations, rejected ones included.
    pub max_iterations: usize,
    /// What is known of κ.
    pub bulk: BulkPrior,
    /// What is known of the shear modulus, where no force was recorded.
    pub shear: Option<ShearPrior>,
    /// A fit ends when a step promises, by the linear model, to lower the deviance by less than this.
    pub tolerance: f64,
    /// It also ends when a step promises less than this part of what noise does not account for.
    pub relative_tolerance: f64,
    /// A fit that is of no use above this deviance ends where it can no longer come to it.
    pub goal: Option<f64>,
}

/// ½ Σ μᵢαᵢ, kPa.
pub fn shear_modulus(material: &Material) -> f64 {
    material.initial_shear_modulus_kpa()
}
