//! The initial shear modulus ½ Σ μᵢαᵢ: the shear stiffness at rest, by which fits are compared.

use super::invariant_law::SECOND_EXPONENT;
use super::{Lanes, Material, Parameter, ShearTerm};

/// ½ Σ cᵢ of terms with products cᵢ = μᵢαᵢ, kPa.
///
/// Halving is exact in floating point, so that half of the sum and the sum of halves are the same number to the bit.
pub fn initial_shear_modulus_kpa(terms: &[ShearTerm]) -> f64 {
    0.5 * terms.iter().map(|t| t.modulus_kpa).sum::<f64>()
}

impl Material {
    /// The initial shear modulus ½ Σ μᵢαᵢ + 2 W′(0), kPa.
    ///
    /// ```
    /// use lambdak::material::Material;
    /// let text = r#"{ "schema": "ogden/1", "bulk_kpa": 2000.0, "terms": [{ "mu_kpa": 16.0, "alpha": 2.0 }] }"#;
    /// assert_eq!(Material::from_json(text)?.initial_shear_modulus_kpa(), 16.0);
    /// # Ok::<(), lambdak::material::MaterialError>(())
    /// ```
    pub fn initial_shear_modulus_kpa(&self) -> f64 {
        let of_terms = 0.5 * self.terms.iter().map(|t| t.mu_kpa * t.alpha).sum::<f64>();
        self.law.map_or(of_terms, |law| of_terms + law.initial_shear_modulus_kpa())
    }

    /// Its derivatives in the order of [`Material::parameters`].
    pub fn initial_shear_modulus_derivatives(&self) -> Vec<f64> {
        let derivative = |parameter: &Parameter| match *parameter {
            Parameter::Kappa => 0.0,
            Parameter::Mu(i) => 0.5 * self.terms[i].alpha,
            Parameter::Alpha(i) => 0.5 * self.terms[i].mu_kpa,
            Parameter::Law(p) => self.law.map_or(0.0, |law| {
                2.0 * law.slope_derivative(p, Lanes::ZERO).0[0] + 0.5 * SECOND_EXPONENT * law.second_mu_derivative(p)
            }),
        };
        self.parameters().iter().map(derivative).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::OgdenTerm;

    /// Both forms, and halving each term first, agree to the bit: terms of very different sizes, whose sum rounds.
    #[test]
    fn forms_agree_to_the_bit() {
        let terms = [[17.3, 1.91], [0.351, 7.77], [-2.1e-5, 11.3], [3.3e-9, -9.1]];
        let terms: Vec<OgdenTerm> = terms.iter().map(|&[mu_kpa, alpha]| OgdenTerm { mu_kpa, alpha }).collect();
        let halves: f64 = terms.iter().map(|t| 0.5 * t.mu_kpa * t.alpha).sum();
        let material = Material { bulk_kpa: 2000.0, terms, law: None };
        assert_eq!(material.initial_shear_modulus_kpa().to_bits(), halves.to_bits());
        assert_eq!(initial_shear_modulus_kpa(&material.shear_terms()).to_bits(), halves.to_bits());
    }
}
