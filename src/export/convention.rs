//! How another program writes a material, and its constants from ours.
//!
//! Ours is Ψ = Σ μᵢ/αᵢ (λ̄₁^αᵢ + λ̄₂^αᵢ + λ̄₃^αᵢ − 3) + W(Ī₁ − 3) + κ/2 (ln J)². Of Ogden's law all programs have the
//! same exponents and the same sum of powers with another factor before it; of the laws in the first invariant they
//! have the same energy W with other names of its parameters, or λ_m² in the place of λ_m. They differ in the
//! volumetric energy.

use super::error::ExportError;
use super::number::number;
use crate::homogeneous::StressUnit;
use crate::material::{LawParameter, Material, OgdenTerm};
use serde::Serialize;
use utoipa::ToSchema;

/// The energy of a change of volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum VolumetricLaw {
    /// κ/2 (ln J)², which is ours.
    Logarithmic,
    /// κ/2 (J − 1)². The initial bulk modulus is the same, and so is the energy up to the second order in J − 1.
    Quadratic,
    /// κ/2 ((J² − 1)/2 − ln J), which goes with Arruda and Boyce's law and Gent's. As before, the energy is the same up
    /// to the second order.
    Mixed,
}

impl VolumetricLaw {
    /// What it means for somebody who takes the constants over.
    pub fn meaning(self) -> &'static str {
        match self {
            VolumetricLaw::Logarithmic => "the energy is kappa/2 (ln J)^2, which is lambdak's",
            VolumetricLaw::Quadratic => {
                "the energy is kappa/2 (J - 1)^2, lambdak's kappa/2 (ln J)^2: the initial bulk modulus is the same; at one \
                 per cent of volume change the pressures differ by 1.5 per cent"
            }
            VolumetricLaw::Mixed => {
                "the energy is kappa/2 ((J^2 - 1)/2 - ln J), lambdak's kappa/2 (ln J)^2: the initial bulk modulus is the \
                 same; at one per cent of volume change the pressures differ by one per cent"
            }
        }
    }
}

/// How the volumetric energy is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Volumetric {
    /// By κ.
    Modulus,
    /// By 2/κ.
    Compliance,
}

/// A constant of a law in the first invariant: its name, our parameter, and the constant that the parameter gives.
pub(super) type LawConstant = (&'static str, LawParameter, fn(f64) -> f64);

/// How the energy of a change of shape is given.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    /// By the factor and the exponent of each of Ogden's terms.
    Terms {
        /// Most terms that the program reads.
        most: usize,
        /// The factor's name, and ours as that factor.
        factor: (&'static str, fn(&OgdenTerm) -> f64),
        /// The exponent's name.
        exponent: &'static str,
    },
    /// By the parameters of a law in the first invariant.
    Law {
        /// The constants.
        constants: &'static [LawConstant],
        /// The order that the card states, where it states one.
        order: Option<usize>,
        /// Constants of the volumetric energy in the card.
        num_volumetric: usize,
    },
}

/// A program's way of writing the materials of one law.
pub struct Convention {
    /// The law's name in the program's files.
    pub keyword: &'static str,
    /// Its strain energy.
    pub energy: &'static str,
    /// Where the program's manual says so.
    pub manual: &'static str,
    /// Its volumetric energy.
    pub law: VolumetricLaw,
    pub(super) shape: Shape,
    /// The name of the volumetric constant, and how it is given.
    pub(super) volumetric: (&'static str, Volumetric),
    /// Further compliances Dₖ of the card, which are no part of our energy, as a multiple of the first.
    pub(super) further: f64,
}

/// A constant of a card.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct Constant {
    /// Its name in the program's manual.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its unit; `1` for a plain number.
    pub unit: String,
}

impl Constant {
    /// The value as a card holds it.
    pub(super) fn text(&self) -> String {
        number(self.value)
    }
}

/// A material in the convention of a program.
pub struct Converted {
    /// The convention.
    pub convention: &'static Convention,
    /// The constants in the order of the card, the volumetric one last.
    pub constants: Vec<Constant>,
}

impl Converted {
    /// The order that the card states: the number of Ogden's terms, or that of a polynomial.
    pub(super) fn order(&self) -> Option<usize> {
        match self.convention.shape {
            Shape::Terms { .. } => Some(self.num_terms()),
            Shape::Law { order, .. } => order,
        }
    }

    /// The numbers of the card with all constants of the volumetric energy.
    pub(super) fn padded(&self) -> Vec<String> {
        let num_volumetric = match self.convention.shape {
            Shape::Terms { .. } => self.num_terms(),
            Shape::Law { num_volumetric, .. } => num_volumetric,
        };
        let mut numbers: Vec<String> = self.constants.iter().map(Constant::text).collect();
        let first = self.constants.last().map_or(0.0, |c| c.value);
        numbers.resize(self.constants.len() - 1 + num_volumetric, number(self.convention.further * first));
        numbers
    }

    /// Ogden's terms: pairs of constants before the volumetric one.
    fn num_terms(&self) -> usize {
        self.constants.len() / 2
    }
}

impl Convention {
    /// The constants of `material`, whose law is the convention's: those of the change of shape, then the volumetric
    /// one.
    pub(super) fn constants(
        &self,
        material: &Material,
        unit: StressUnit,
        program: &'static str,
    ) -> Result<Vec<Constant>, ExportError> {
        let stress = |kpa: f64| kpa / unit.in_kpa();
        let constant = |name: String, value, unit: &str| Constant { name, value, unit: unit.into() };
        let mut constants = Vec::new();
        match self.shape {
            Shape::Terms { most, factor: (factor, of_term), exponent } => {
                let count = material.terms.len();
                if count > most {
                    return Err(ExportError::TooManyTerms { program, count, limit: most });
                }
                for (index, term) in material.terms.iter().enumerate() {
                    let number = index + 1;
                    constants.push(constant(format!("{factor}_{number}"), stress(of_term(term)), unit.symbol()));
                    constants.push(constant(format!("{exponent}_{number}"), term.alpha, "1"));
                }
            }
            Shape::Law { constants: listed, .. } => {
                for &(name, parameter, of_value) in listed {
                    let value = of_value(material.value(crate::material::Parameter::Law(parameter)));
                    let (value, unit) =
                        if parameter.is_modulus() { (stress(value), unit.symbol()) } else { (value, "1") };
                    constants.push(constant(name.into(), value, unit));
                }
            }
        }
        let (name, volumetric) = self.volumetric;
        let bulk = stress(material.bulk_kpa);
        constants.push(match volumetric {
            Volumetric::Modulus => constant(name.into(), bulk, unit.symbol()),
            Volumetric::Compliance => constant(name.into(), 2.0 / bulk, &format!("1/{}", unit.symbol())),
        });
        Ok(constants)
    }
}
