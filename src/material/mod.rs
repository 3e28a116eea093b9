//! Strain energies, their stress, tangent and parameter derivatives.

mod error;
mod file;
mod lanes;
mod limits;
mod ogden_lanes;
mod point;
mod read;
mod shear_modulus;
mod shear_term;
mod stability;

pub use error::MaterialError;
pub use lanes::{LANES, Lanes};
pub use limits::{MAX_ALPHA, MAX_MODULUS_KPA, MIN_ALPHA, SCHEMA};
pub use ogden_lanes::{MAX_TERMS, SpectralState, Tensor};
pub use point::{energy_density, first_piola_kirchhoff_stress, material_tangent, stress_parameter_derivative};
pub use shear_modulus::initial_shear_modulus_kpa;
pub use shear_term::{ShearTerm, power_difference};
pub use stability::{least_relative_stiffness, smallest_principal_stiffness_kpa, smallest_relative_stiffness};

use serde::{Deserialize, Serialize};

/// One Ogden term.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = TermSchema))]
#[serde(deny_unknown_fields)]
pub struct OgdenTerm {
    /// μ, kPa.
    #[cfg_attr(feature = "schema", schema(value_type = file::MuKpa))]
    pub mu_kpa: f64,
    /// α.
    #[cfg_attr(feature = "schema", schema(value_type = file::Alpha))]
    pub alpha: f64,
}

/// N-term compressible Ogden material, Ψ = Σ μᵢ/αᵢ (λ̄₁^αᵢ + λ̄₂^αᵢ + λ̄₃^αᵢ − 3) + κ/2 (ln J)².
///
/// In JSON it is `ogden/1`, with the tag `schema` before its fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "file::OgdenFile", into = "file::OgdenFile")]
pub struct Ogden {
    /// κ, kPa.
    pub bulk_kpa: f64,
    /// Terms.
    pub terms: Vec<OgdenTerm>,
}

/// A material parameter. Order everywhere: κ, μ₁, α₁, μ₂, α₂, …
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Parameter {
    /// κ, kPa.
    Kappa,
    /// μ of the term with this index (from 0), kPa.
    Mu(usize),
    /// α of the term with this index (from 0).
    Alpha(usize),
}

impl Parameter {
    /// `kappa`, `mu_1`, `alpha_1`, …
    pub fn name(self) -> String {
        match self {
            Parameter::Kappa => "kappa".into(),
            Parameter::Mu(i) => format!("mu_{}", i + 1),
            Parameter::Alpha(i) => format!("alpha_{}", i + 1),
        }
    }
}

impl Ogden {
    /// A valid material of a bulk modulus (kPa) and terms (μ in kPa, α).
    ///
    /// ```
    /// use lambdak::material::Ogden;
    /// let material = Ogden::new(2173.0, [(17.0, 1.91)])?;
    /// assert_eq!(material.terms[0].alpha, 1.91);
    /// assert!(Ogden::new(-1.0, [(17.0, 1.91)]).is_err());
    /// # Ok::<(), lambdak::material::MaterialError>(())
    /// ```
    ///
    /// # Errors
    /// As [`Ogden::validate`].
    pub fn new(bulk_kpa: f64, terms: impl IntoIterator<Item = (f64, f64)>) -> Result<Ogden, MaterialError> {
        let terms = terms.into_iter().map(|(mu_kpa, alpha)| OgdenTerm { mu_kpa, alpha }).collect();
        let material = Ogden { bulk_kpa, terms };
        material.validate().map(|()| material)
    }

    /// κ, μ₁, α₁, μ₂, α₂, …
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut all = vec![Parameter::Kappa];
        for i in 0..self.terms.len() {
            all.extend([Parameter::Mu(i), Parameter::Alpha(i)]);
        }
        all
    }

    /// Value of a parameter.
    pub fn value(&self, parameter: Parameter) -> f64 {
        match parameter {
            Parameter::Kappa => self.bulk_kpa,
            Parameter::Mu(i) => self.terms[i].mu_kpa,
            Parameter::Alpha(i) => self.terms[i].alpha,
        }
    }

    /// Sets a parameter.
    pub fn set(&mut self, parameter: Parameter, value: f64) {
        match parameter {
            Parameter::Kappa => self.bulk_kpa = value,
            Parameter::Mu(i) => self.terms[i].mu_kpa = value,
            Parameter::Alpha(i) => self.terms[i].alpha = value,
        }
    }
}
