//! Strain energies, their stress, tangent and parameter derivatives.

mod error;
mod file;
mod invariant_energy;
mod invariant_law;
mod lanes;
mod limits;
mod ogden_lanes;
mod parameter;
mod point;
mod read;
mod shear_modulus;
mod shear_term;
mod stability;

pub use error::MaterialError;
pub use invariant_energy::{ArrudaBoyce, FirstInvariantEnergy, Gent, LawParameter, MooneyRivlin, NeoHookean, Yeoh};
#[cfg(test)]
pub(crate) use invariant_law::laws;
pub use invariant_law::{InvariantLaw, LawKind, SECOND_EXPONENT};
pub use lanes::{LANES, Lanes};
pub use limits::{
    ARRUDA_BOYCE_SCHEMA, GENT_SCHEMA, MAX_ALPHA, MAX_CHAIN_LIMIT, MAX_LOCKING_STRETCH, MAX_MODULUS_KPA, MIN_ALPHA,
    MIN_CHAIN_LIMIT, MIN_LOCKING_STRETCH, SCHEMA, YEOH_SCHEMA,
};
pub use ogden_lanes::{MAX_TERMS, SpectralState, Tensor};
pub use parameter::{Parameter, symbol_of_parameter};
pub(crate) use point::first_invariant_less_3;
pub use point::{energy_density, first_piola_kirchhoff_stress, material_tangent, stress_parameter_derivative};
pub use shear_modulus::initial_shear_modulus_kpa;
pub use shear_term::{ShearTerm, power_difference};
pub use stability::{
    least_relative_stiffness, relative_stiffness, smallest_principal_stiffness_kpa, smallest_relative_stiffness,
    smallest_relative_stiffness_of_law,
};

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

/// A compressible hyperelastic material, Ψ = Σ μᵢ/αᵢ (λ̄₁^αᵢ + λ̄₂^αᵢ + λ̄₃^αᵢ − 3) + W(Ī₁ − 3) + κ/2 (ln J)²: Ogden's
/// with its terms, or one whose energy is a law W in the first isochoric invariant alone.
///
/// In JSON it is `ogden/1`, `yeoh/1`, `gent/1` or `arruda_boyce/1`, with the tag `schema` before its fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "file::MaterialFields", into = "file::MaterialFile")]
pub struct Material {
    /// κ, kPa.
    pub bulk_kpa: f64,
    /// Ogden's terms.
    pub terms: Vec<OgdenTerm>,
    /// A law in the first invariant in their place.
    pub law: Option<InvariantLaw>,
}

impl Material {
    /// All its parameters but κ.
    pub fn shear_parameters(&self) -> impl Iterator<Item = Parameter> {
        self.parameters().into_iter().filter(|p| *p != Parameter::Kappa)
    }

    /// A valid material of a bulk modulus (kPa) and terms (μ in kPa, α).
    ///
    /// ```
    /// use lambdak::material::Material;
    /// let material = Material::new(2173.0, [(17.0, 1.91)])?;
    /// assert_eq!(material.terms[0].alpha, 1.91);
    /// assert!(Material::new(-1.0, [(17.0, 1.91)]).is_err());
    /// # Ok::<(), lambdak::material::MaterialError>(())
    /// ```
    ///
    /// # Errors
    /// As [`Material::validate`].
    pub fn new(bulk_kpa: f64, terms: impl IntoIterator<Item = (f64, f64)>) -> Result<Material, MaterialError> {
        let terms = terms.into_iter().map(|(mu_kpa, alpha)| OgdenTerm { mu_kpa, alpha }).collect();
        let material = Material { bulk_kpa, terms, law: None };
        material.validate().map(|()| material)
    }

    /// A valid material of a bulk modulus (kPa) and a law in the first invariant.
    ///
    /// ```
    /// use lambdak::material::{Gent, InvariantLaw, Material};
    /// let material = Material::of_law(2173.0, InvariantLaw::Gent(Gent { mu_kpa: 16.0, limit: 30.0 }))?;
    /// assert_eq!(material.initial_shear_modulus_kpa(), 16.0);
    /// # Ok::<(), lambdak::material::MaterialError>(())
    /// ```
    ///
    /// # Errors
    /// As [`Material::validate`].
    pub fn of_law(bulk_kpa: f64, law: InvariantLaw) -> Result<Material, MaterialError> {
        let material = Material { bulk_kpa, terms: Vec::new(), law: Some(law) };
        material.validate().map(|()| material)
    }

    /// Its law as it is called: `Ogden`, or the name of its law in the first invariant.
    pub fn law_name(&self) -> &'static str {
        self.law.map_or("Ogden", |law| law.kind().name())
    }

    /// The terms, and the one that a law has of the second invariant.
    pub(crate) fn all_terms(&self) -> impl Iterator<Item = OgdenTerm> {
        let of_law = self.law.and_then(|law| law.second_mu_kpa());
        let of_law = of_law.map(|mu_kpa| OgdenTerm { mu_kpa, alpha: SECOND_EXPONENT });
        self.terms.iter().copied().chain(of_law)
    }

    /// κ, μ₁, α₁, μ₂, α₂, …, then those of the law.
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut all = vec![Parameter::Kappa];
        for i in 0..self.terms.len() {
            all.extend([Parameter::Mu(i), Parameter::Alpha(i)]);
        }
        all.extend(self.law.iter().flat_map(|law| law.parameters()).map(|p| Parameter::Law(*p)));
        all
    }

    /// Value of a parameter.
    pub fn value(&self, parameter: Parameter) -> f64 {
        match parameter {
            Parameter::Kappa => self.bulk_kpa,
            Parameter::Mu(i) => self.terms[i].mu_kpa,
            Parameter::Alpha(i) => self.terms[i].alpha,
            Parameter::Law(parameter) => self.law.map_or(f64::NAN, |law| law.value(parameter)),
        }
    }

    /// Sets a parameter.
    pub fn set(&mut self, parameter: Parameter, value: f64) {
        match parameter {
            Parameter::Kappa => self.bulk_kpa = value,
            Parameter::Mu(i) => self.terms[i].mu_kpa = value,
            Parameter::Alpha(i) => self.terms[i].alpha = value,
            Parameter::Law(parameter) => {
                if let Some(law) = &mut self.law {
                    law.set(parameter, value);
                }
            }
        }
    }
}
