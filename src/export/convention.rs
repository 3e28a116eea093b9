//! How other programs write the Ogden material, and their constants from ours.
//!
//! Ours is Ψ = Σ μᵢ/αᵢ (λ̄₁^αᵢ + λ̄₂^αᵢ + λ̄₃^αᵢ − 3) + κ/2 (ln J)². All have the same exponents and the same sum of
//! powers; they differ in the factor before it and in the volumetric energy.

use super::error::ExportError;
use super::number::number;
use crate::homogeneous::StressUnit;
use crate::material::{Ogden, OgdenTerm};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The program that a material is written for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaterialFormat {
    /// Abaqus: an input file's `*MATERIAL`.
    Abaqus,
    /// Ansys Mechanical APDL: commands `TB,HYPER`.
    Ansys,
    /// CalculiX: an input file's `*MATERIAL`.
    Calculix,
    /// COMSOL Multiphysics: a file of parameters.
    Comsol,
    /// FEBio: a `material` of a model.
    Febio,
}

/// The energy of a change of volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum VolumetricLaw {
    /// κ/2 (ln J)², which is ours.
    Logarithmic,
    /// κ/2 (J − 1)². The initial bulk modulus is the same, and so is the energy up to the second order in J − 1.
    Quadratic,
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
        }
    }
}

/// How the volumetric energy is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Volumetric {
    /// By κ.
    Modulus,
    /// By 2/κ.
    Compliance,
}

/// A program's way of writing an Ogden material.
pub struct Convention {
    /// The program.
    pub program: &'static str,
    /// Its strain energy.
    pub energy: &'static str,
    /// Where its manual says so.
    pub manual: &'static str,
    /// Its volumetric energy.
    pub law: VolumetricLaw,
    /// Ending of the file's name.
    pub(super) file: &'static str,
    /// Most terms that it reads.
    pub(super) most_terms: usize,
    /// The factor's name in the program, and ours as that factor.
    factor: (&'static str, fn(&OgdenTerm) -> f64),
    /// The exponent's name.
    exponent: &'static str,
    /// The name of the volumetric constant, and how it is given.
    volumetric: (&'static str, Volumetric),
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

/// ½ μα: the share of a term in the initial shear modulus.
fn half_product(term: &OgdenTerm) -> f64 {
    0.5 * term.mu_kpa * term.alpha
}

fn product(term: &OgdenTerm) -> f64 {
    term.mu_kpa * term.alpha
}

fn same(term: &OgdenTerm) -> f64 {
    term.mu_kpa
}

static ABAQUS: Convention = Convention {
    program: "Abaqus",
    energy: "U = sum_i 2 mu_i/alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3) + sum_i (J - 1)^(2 i)/D_i",
    manual: "Abaqus Analysis User's Guide, Hyperelastic behavior of rubberlike materials (Ogden form); \
             Keywords Guide, *HYPERELASTIC",
    law: VolumetricLaw::Quadratic,
    file: "abaqus.inp",
    most_terms: 6,
    factor: ("mu", half_product),
    exponent: "alpha",
    volumetric: ("D_1", Volumetric::Compliance),
};

static ANSYS: Convention = Convention {
    program: "Ansys",
    energy: "W = sum_i mu_i/alpha_i (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3) + sum_k (J - 1)^(2 k)/d_k",
    manual: "Ansys Mechanical APDL Material Reference, Ogden Hyperelasticity (TB,HYPER,,,,OGDEN)",
    law: VolumetricLaw::Quadratic,
    file: "ansys.inp",
    most_terms: 6,
    factor: ("mu", same),
    exponent: "alpha",
    volumetric: ("d_1", Volumetric::Compliance),
};

static CALCULIX: Convention = Convention {
    program: "CalculiX",
    energy: "U = sum_i 2 mu_i/alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3) + sum_i (J - 1)^(2 i)/D_i",
    manual: "CalculiX CrunchiX User's Manual, *HYPERELASTIC (OGDEN)",
    law: VolumetricLaw::Quadratic,
    file: "calculix.inp",
    most_terms: 3,
    factor: ("mu", half_product),
    exponent: "alpha",
    volumetric: ("D_1", Volumetric::Compliance),
};

static COMSOL: Convention = Convention {
    program: "COMSOL",
    energy: "W = sum_p mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) + kappa/2 (J - 1)^2",
    manual: "COMSOL Multiphysics, Structural Mechanics Module User's Guide, Hyperelastic Material, Ogden, nearly \
             incompressible with quadratic volumetric strain energy",
    law: VolumetricLaw::Quadratic,
    file: "comsol.txt",
    most_terms: 6,
    factor: ("mu", same),
    exponent: "alpha",
    volumetric: ("kappa", Volumetric::Modulus),
};

static FEBIO: Convention = Convention {
    program: "FEBio",
    energy: "W = sum_i c_i/m_i^2 (l1^m_i + l2^m_i + l3^m_i - 3) + k/2 (ln J)^2",
    manual: "FEBio User Manual, Uncoupled Materials, Ogden (the volumetric energy is that of all uncoupled materials)",
    law: VolumetricLaw::Logarithmic,
    file: "febio.xml",
    most_terms: 6,
    factor: ("c", product),
    exponent: "m",
    volumetric: ("k", Volumetric::Modulus),
};

impl MaterialFormat {
    /// All of them.
    pub const ALL: [MaterialFormat; 5] = [
        MaterialFormat::Abaqus,
        MaterialFormat::Ansys,
        MaterialFormat::Calculix,
        MaterialFormat::Comsol,
        MaterialFormat::Febio,
    ];

    /// The program's convention.
    pub fn convention(self) -> &'static Convention {
        match self {
            MaterialFormat::Abaqus => &ABAQUS,
            MaterialFormat::Ansys => &ANSYS,
            MaterialFormat::Calculix => &CALCULIX,
            MaterialFormat::Comsol => &COMSOL,
            MaterialFormat::Febio => &FEBIO,
        }
    }

    /// Name of the card's file.
    pub fn file_name(self) -> String {
        format!("material-{}", self.convention().file)
    }
}

impl Convention {
    /// The program's constants of `material`: factor and exponent of each term, then the volumetric one.
    ///
    /// # Errors
    /// [`ExportError::TooManyTerms`], [`ExportError::NotOgden`].
    pub fn constants(&self, material: &Ogden, unit: StressUnit) -> Result<Vec<Constant>, ExportError> {
        if material.law.is_some() {
            return Err(ExportError::NotOgden { program: self.program });
        }
        let count = material.terms.len();
        if count > self.most_terms {
            return Err(ExportError::TooManyTerms { program: self.program, count, limit: self.most_terms });
        }
        let stress = |kpa: f64| kpa / unit.in_kpa();
        let mut constants = Vec::with_capacity(2 * count + 1);
        for (index, term) in material.terms.iter().enumerate() {
            let (name, factor) = self.factor;
            let (value, index) = (stress(factor(term)), index + 1);
            constants.push(Constant { name: format!("{name}_{index}"), value, unit: unit.symbol().into() });
            let name = format!("{}_{index}", self.exponent);
            constants.push(Constant { name, value: term.alpha, unit: "1".into() });
        }
        let (name, volumetric) = self.volumetric;
        let bulk = stress(material.bulk_kpa);
        let (value, unit) = match volumetric {
            Volumetric::Modulus => (bulk, unit.symbol().to_string()),
            Volumetric::Compliance => (2.0 / bulk, format!("1/{}", unit.symbol())),
        };
        constants.push(Constant { name: name.into(), value, unit });
        Ok(constants)
    }
}
