//! The programs that materials are written for, and the laws that each of them has.

use super::convention::{Convention, Converted, LawConstant, Shape, Volumetric, VolumetricLaw};
use super::error::ExportError;
use crate::homogeneous::StressUnit;
use crate::material::{LawKind, LawParameter, Material, OgdenTerm};
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

impl MaterialFormat {
    /// All of them.
    pub const ALL: [MaterialFormat; 5] = [
        MaterialFormat::Abaqus,
        MaterialFormat::Ansys,
        MaterialFormat::Calculix,
        MaterialFormat::Comsol,
        MaterialFormat::Febio,
    ];

    /// The program, as it is called.
    pub fn program(self) -> &'static str {
        match self {
            MaterialFormat::Abaqus => "Abaqus",
            MaterialFormat::Ansys => "Ansys",
            MaterialFormat::Calculix => "CalculiX",
            MaterialFormat::Comsol => "COMSOL",
            MaterialFormat::Febio => "FEBio",
        }
    }

    /// Name of the card's file.
    pub fn file_name(self) -> &'static str {
        match self {
            MaterialFormat::Abaqus => "material-abaqus.inp",
            MaterialFormat::Ansys => "material-ansys.inp",
            MaterialFormat::Calculix => "material-calculix.inp",
            MaterialFormat::Comsol => "material-comsol.txt",
            MaterialFormat::Febio => "material-febio.xml",
        }
    }

    /// How the program writes a law in the first invariant, or Ogden's where none is given; nothing where it does not
    /// have it.
    pub fn convention(self, law: Option<LawKind>) -> Option<&'static Convention> {
        use MaterialFormat::{Abaqus, Ansys, Calculix, Comsol, Febio};
        Some(match (law, self) {
            (None, Abaqus) => &ABAQUS_OGDEN,
            (None, Ansys) => &ANSYS_OGDEN,
            (None, Calculix) => &CALCULIX_OGDEN,
            (None, Comsol) => &COMSOL_OGDEN,
            (None, Febio) => &FEBIO_OGDEN,
            (Some(LawKind::NeoHookean), Abaqus) => &ABAQUS_NEO_HOOKEAN,
            (Some(LawKind::NeoHookean), Ansys) => &ANSYS_NEO_HOOKEAN,
            (Some(LawKind::NeoHookean), Calculix) => &CALCULIX_NEO_HOOKEAN,
            (Some(LawKind::NeoHookean), Comsol) => &COMSOL_NEO_HOOKEAN,
            (Some(LawKind::NeoHookean), Febio) => &FEBIO_NEO_HOOKEAN,
            (Some(LawKind::MooneyRivlin), Abaqus) => &ABAQUS_MOONEY_RIVLIN,
            (Some(LawKind::MooneyRivlin), Ansys) => &ANSYS_MOONEY_RIVLIN,
            (Some(LawKind::MooneyRivlin), Calculix) => &CALCULIX_MOONEY_RIVLIN,
            (Some(LawKind::MooneyRivlin), Comsol) => &COMSOL_MOONEY_RIVLIN,
            (Some(LawKind::MooneyRivlin), Febio) => &FEBIO_MOONEY_RIVLIN,
            (Some(LawKind::Yeoh), Abaqus) => &ABAQUS_YEOH,
            (Some(LawKind::Yeoh), Ansys) => &ANSYS_YEOH,
            (Some(LawKind::Yeoh), Calculix) => &CALCULIX_YEOH,
            (Some(LawKind::Yeoh), Comsol) => &COMSOL_YEOH,
            (Some(LawKind::Yeoh), Febio) => &FEBIO_YEOH,
            (Some(LawKind::Gent), Ansys) => &ANSYS_GENT,
            (Some(LawKind::Gent), Comsol) => &COMSOL_GENT,
            (Some(LawKind::Gent), Febio) => &FEBIO_GENT,
            (Some(LawKind::Gent), Abaqus | Calculix) => return None,
            (Some(LawKind::ArrudaBoyce), Abaqus) => &ABAQUS_ARRUDA_BOYCE,
            (Some(LawKind::ArrudaBoyce), Ansys) => &ANSYS_ARRUDA_BOYCE,
            (Some(LawKind::ArrudaBoyce), Calculix) => &CALCULIX_ARRUDA_BOYCE,
            (Some(LawKind::ArrudaBoyce), Comsol) => &COMSOL_ARRUDA_BOYCE,
            (Some(LawKind::ArrudaBoyce), Febio) => &FEBIO_ARRUDA_BOYCE,
        })
    }

    /// `material` in the program's convention, with stresses in `unit`.
    ///
    /// # Errors
    /// [`ExportError`].
    pub fn convert(self, material: &Material, unit: StressUnit) -> Result<Converted, ExportError> {
        let law = material.law.map(|law| law.kind());
        let has = |format: &MaterialFormat| format.convention(law).is_some();
        let convention = self.convention(law).ok_or_else(|| ExportError::NoSuchLaw {
            program: self.program(),
            law: material.law_name(),
            others: MaterialFormat::ALL.iter().copied().filter(has).map(MaterialFormat::program).collect(),
        })?;
        let constants = convention.constants(material, unit, self.program())?;
        Ok(Converted { convention, constants })
    }
}

/// ½ μα: the share of a term in the initial shear modulus.
fn half_product(term: &OgdenTerm) -> f64 {
    0.5 * term.mu_kpa * term.alpha
}

fn product(term: &OgdenTerm) -> f64 {
    term.mu_kpa * term.alpha
}

fn modulus(term: &OgdenTerm) -> f64 {
    term.mu_kpa
}

fn same(value: f64) -> f64 {
    value
}

/// λ_m² is the number N of links of a chain.
fn squared(value: f64) -> f64 {
    value * value
}

const ABAQUS_MANUAL: &str =
    "Abaqus Analysis User's Guide, Hyperelastic behavior of rubberlike materials; Keywords Guide, *HYPERELASTIC";
const CALCULIX_MANUAL: &str = "CalculiX CrunchiX User's Manual, *HYPERELASTIC";
const COMSOL_MANUAL: &str = "COMSOL Multiphysics, Structural Mechanics Module User's Guide, Hyperelastic Material, \
                             nearly incompressible with quadratic volumetric strain energy";
const FEBIO_MANUAL: &str =
    "FEBio User Manual, Uncoupled Materials (the volumetric energy is that of all uncoupled materials)";

/// A compliance of zero stands for a term that is left out.
const NO_SUCH_TERM: f64 = 0.0;
/// CalculiX takes a compliance of its own where it finds zero (seen in version 2.20). A term so soft leaves nothing: at
/// a change of the volume by a tenth a fifty-millionth of the pressure.
const FAINT: f64 = 1e6;
const COMPLIANCES: (&str, Volumetric) = ("D_1", Volumetric::Compliance);
const COMPLIANCE: (&str, Volumetric) = ("D", Volumetric::Compliance);

static ABAQUS_OGDEN: Convention = Convention {
    keyword: "OGDEN",
    energy: "U = sum_i 2 mu_i/alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3) + sum_i (J - 1)^(2 i)/D_i",
    manual: ABAQUS_MANUAL,
    law: VolumetricLaw::Quadratic,
    shape: Shape::Terms { most: 6, factor: ("mu", half_product), exponent: "alpha" },
    volumetric: COMPLIANCES,
    further: NO_SUCH_TERM,
};

static ANSYS_OGDEN: Convention = Convention {
    keyword: "OGDEN",
    energy: "W = sum_i mu_i/alpha_i (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3) + sum_k (J - 1)^(2 k)/d_k",
    manual: "Ansys Mechanical APDL Material Reference, Ogden Hyperelasticity (TB,HYPER,,,,OGDEN)",
    law: VolumetricLaw::Quadratic,
    shape: Shape::Terms { most: 6, factor: ("mu", modulus), exponent: "alpha" },
    volumetric: ("d_1", Volumetric::Compliance),
    further: NO_SUCH_TERM,
};

static CALCULIX_OGDEN: Convention = Convention {
    manual: CALCULIX_MANUAL,
    shape: Shape::Terms { most: 3, factor: ("mu", half_product), exponent: "alpha" },
    further: FAINT,
    ..ABAQUS_OGDEN
};

static COMSOL_OGDEN: Convention = Convention {
    keyword: "Ogden",
    energy: "W = sum_p mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) + kappa/2 (J - 1)^2",
    manual: COMSOL_MANUAL,
    law: VolumetricLaw::Quadratic,
    shape: Shape::Terms { most: 6, factor: ("mu", modulus), exponent: "alpha" },
    volumetric: ("kappa", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};

static FEBIO_OGDEN: Convention = Convention {
    keyword: "Ogden",
    energy: "W = sum_i c_i/m_i^2 (l1^m_i + l2^m_i + l3^m_i - 3) + k/2 (ln J)^2",
    manual: FEBIO_MANUAL,
    law: VolumetricLaw::Logarithmic,
    shape: Shape::Terms { most: 6, factor: ("c", product), exponent: "m" },
    volumetric: ("k", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};

/// Half of the initial shear modulus is the coefficient of I1 − 3.
fn halved(value: f64) -> f64 {
    0.5 * value
}

static ABAQUS_NEO_HOOKEAN: Convention = Convention {
    keyword: "NEO HOOKE",
    energy: "U = C_10 (I1 - 3) + (J - 1)^2/D_1 (C_10 is half of the initial shear modulus)",
    manual: ABAQUS_MANUAL,
    law: VolumetricLaw::Quadratic,
    shape: Shape::Law { constants: &[("C_10", LawParameter::Modulus, halved)], order: None, num_volumetric: 1 },
    volumetric: COMPLIANCES,
    further: NO_SUCH_TERM,
};

static ANSYS_NEO_HOOKEAN: Convention = Convention {
    keyword: "NEO",
    energy: "W = mu/2 (I1 - 3) + (J - 1)^2/d",
    manual: "Ansys Mechanical APDL Material Reference, Neo-Hookean Hyperelasticity (TB,HYPER,,,,NEO)",
    law: VolumetricLaw::Quadratic,
    shape: Shape::Law { constants: &[("mu", LawParameter::Modulus, same)], order: None, num_volumetric: 1 },
    volumetric: ("d", Volumetric::Compliance),
    further: NO_SUCH_TERM,
};

static CALCULIX_NEO_HOOKEAN: Convention = Convention { manual: CALCULIX_MANUAL, ..ABAQUS_NEO_HOOKEAN };

static COMSOL_NEO_HOOKEAN: Convention = Convention {
    keyword: "Neo-Hookean",
    energy: "W = mu/2 (I1 - 3) + kappa/2 (J - 1)^2",
    manual: COMSOL_MANUAL,
    law: VolumetricLaw::Quadratic,
    shape: Shape::Law { constants: &[("mu", LawParameter::Modulus, same)], order: None, num_volumetric: 1 },
    volumetric: ("kappa", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};

/// FEBio's own neo-Hookean solid is another law, whose shape and volume are not apart; its Mooney-Rivlin solid without
/// c2 is ours.
static FEBIO_NEO_HOOKEAN: Convention = Convention {
    keyword: "Mooney-Rivlin",
    energy: "W = c1 (I1 - 3) + k/2 (ln J)^2",
    manual: FEBIO_MANUAL,
    law: VolumetricLaw::Logarithmic,
    shape: Shape::Law { constants: &[("c1", LawParameter::Modulus, halved)], order: None, num_volumetric: 1 },
    volumetric: ("k", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};

/// The names of Mooney and Rivlin's coefficients in most programs.
const MOONEY_RIVLIN: &[LawConstant] =
    &[("C_10", LawParameter::Coefficient(0), same), ("C_01", LawParameter::Coefficient(1), same)];

static ABAQUS_MOONEY_RIVLIN: Convention = Convention {
    keyword: "MOONEY-RIVLIN",
    energy: "U = C_10 (I1 - 3) + C_01 (I2 - 3) + (J - 1)^2/D_1",
    manual: ABAQUS_MANUAL,
    law: VolumetricLaw::Quadratic,
    shape: Shape::Law { constants: MOONEY_RIVLIN, order: None, num_volumetric: 1 },
    volumetric: COMPLIANCES,
    further: NO_SUCH_TERM,
};

static ANSYS_MOONEY_RIVLIN: Convention = Convention {
    keyword: "MOONEY",
    energy: "W = C_10 (I1 - 3) + C_01 (I2 - 3) + (J - 1)^2/d",
    manual: "Ansys Mechanical APDL Material Reference, Mooney-Rivlin Hyperelasticity (TB,HYPER,,,2,MOONEY)",
    law: VolumetricLaw::Quadratic,
    shape: Shape::Law { constants: MOONEY_RIVLIN, order: Some(2), num_volumetric: 1 },
    volumetric: ("d", Volumetric::Compliance),
    further: NO_SUCH_TERM,
};

static CALCULIX_MOONEY_RIVLIN: Convention = Convention { manual: CALCULIX_MANUAL, ..ABAQUS_MOONEY_RIVLIN };

static COMSOL_MOONEY_RIVLIN: Convention = Convention {
    keyword: "Mooney-Rivlin, Two Parameters",
    energy: "W = C_10 (I1 - 3) + C_01 (I2 - 3) + kappa/2 (J - 1)^2",
    manual: COMSOL_MANUAL,
    law: VolumetricLaw::Quadratic,
    shape: Shape::Law { constants: MOONEY_RIVLIN, order: None, num_volumetric: 1 },
    volumetric: ("kappa", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};

static FEBIO_MOONEY_RIVLIN: Convention = Convention {
    keyword: "Mooney-Rivlin",
    energy: "W = c1 (I1 - 3) + c2 (I2 - 3) + k/2 (ln J)^2",
    manual: FEBIO_MANUAL,
    law: VolumetricLaw::Logarithmic,
    shape: Shape::Law {
        constants: &[("c1", LawParameter::Coefficient(0), same), ("c2", LawParameter::Coefficient(1), same)],
        order: None,
        num_volumetric: 1,
    },
    volumetric: ("k", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};

static ABAQUS_YEOH: Convention = Convention {
    keyword: "YEOH",
    energy: "U = C_10 (I1 - 3) + C_20 (I1 - 3)^2 + C_30 (I1 - 3)^3 + sum_i (J - 1)^(2 i)/D_i",
    manual: ABAQUS_MANUAL,
    law: VolumetricLaw::Quadratic,
    shape: Shape::Law {
        constants: &[
            ("C_10", LawParameter::Coefficient(0), same),
            ("C_20", LawParameter::Coefficient(1), same),
            ("C_30", LawParameter::Coefficient(2), same),
        ],
        order: None,
        num_volumetric: 3,
    },
    volumetric: COMPLIANCES,
    further: NO_SUCH_TERM,
};

static ANSYS_YEOH: Convention = Convention {
    keyword: "YEOH",
    energy: "W = c_10 (I1 - 3) + c_20 (I1 - 3)^2 + c_30 (I1 - 3)^3 + sum_k (J - 1)^(2 k)/d_k",
    manual: "Ansys Mechanical APDL Material Reference, Yeoh Hyperelasticity (TB,HYPER,,,,YEOH)",
    law: VolumetricLaw::Quadratic,
    shape: Shape::Law {
        constants: &[
            ("c_10", LawParameter::Coefficient(0), same),
            ("c_20", LawParameter::Coefficient(1), same),
            ("c_30", LawParameter::Coefficient(2), same),
        ],
        order: Some(3),
        num_volumetric: 3,
    },
    volumetric: ("d_1", Volumetric::Compliance),
    further: NO_SUCH_TERM,
};

static CALCULIX_YEOH: Convention = Convention { manual: CALCULIX_MANUAL, further: FAINT, ..ABAQUS_YEOH };

static COMSOL_YEOH: Convention = Convention {
    keyword: "Yeoh",
    energy: "W = c_1 (I1 - 3) + c_2 (I1 - 3)^2 + c_3 (I1 - 3)^3 + kappa/2 (J - 1)^2",
    manual: COMSOL_MANUAL,
    law: VolumetricLaw::Quadratic,
    shape: Shape::Law { constants: YEOH, order: None, num_volumetric: 1 },
    volumetric: ("kappa", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};

static FEBIO_YEOH: Convention = Convention {
    keyword: "Yeoh",
    energy: "W = sum_i c_i (I1 - 3)^i + k/2 (ln J)^2",
    manual: FEBIO_MANUAL,
    law: VolumetricLaw::Logarithmic,
    shape: Shape::Law { constants: YEOH, order: None, num_volumetric: 1 },
    volumetric: ("k", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};

/// The names of Yeoh's coefficients in COMSOL and FEBio.
const YEOH: &[LawConstant] = &[
    ("c_1", LawParameter::Coefficient(0), same),
    ("c_2", LawParameter::Coefficient(1), same),
    ("c_3", LawParameter::Coefficient(2), same),
];

static ANSYS_GENT: Convention = Convention {
    keyword: "GENT",
    energy: "W = -mu J_m/2 ln(1 - (I1 - 3)/J_m) + ((J^2 - 1)/2 - ln J)/d",
    manual: "Ansys Mechanical APDL Material Reference, Gent Hyperelasticity (TB,HYPER,,,,GENT)",
    law: VolumetricLaw::Mixed,
    shape: Shape::Law {
        constants: &[("mu", LawParameter::Modulus, same), ("J_m", LawParameter::Limit, same)],
        order: None,
        num_volumetric: 1,
    },
    volumetric: ("d", Volumetric::Compliance),
    further: NO_SUCH_TERM,
};

static COMSOL_GENT: Convention = Convention {
    keyword: "Gent",
    energy: "W = -mu j_m/2 ln(1 - (I1 - 3)/j_m) + kappa/2 (J - 1)^2",
    manual: COMSOL_MANUAL,
    law: VolumetricLaw::Quadratic,
    shape: Shape::Law {
        constants: &[("mu", LawParameter::Modulus, same), ("j_m", LawParameter::Limit, same)],
        order: None,
        num_volumetric: 1,
    },
    volumetric: ("kappa", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};

static FEBIO_GENT: Convention = Convention {
    keyword: "Gent",
    energy: "W = -G Jm/2 ln(1 - (I1 - 3)/Jm) + k/2 (ln J)^2",
    manual: FEBIO_MANUAL,
    law: VolumetricLaw::Logarithmic,
    shape: Shape::Law {
        constants: &[("G", LawParameter::Modulus, same), ("Jm", LawParameter::Limit, same)],
        order: None,
        num_volumetric: 1,
    },
    volumetric: ("k", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};

static ABAQUS_ARRUDA_BOYCE: Convention = Convention {
    keyword: "ARRUDA-BOYCE",
    energy: "U = mu sum_i C_i/lambda_m^(2 i - 2) (I1^i - 3^i) + ((J^2 - 1)/2 - ln J)/D, \
             C_i = 1/2, 1/20, 11/1050, 19/7000, 519/673750 (mu is not the initial shear modulus)",
    manual: ABAQUS_MANUAL,
    law: VolumetricLaw::Mixed,
    shape: Shape::Law {
        constants: &[("mu", LawParameter::Modulus, same), ("lambda_m", LawParameter::LockingStretch, same)],
        order: None,
        num_volumetric: 1,
    },
    volumetric: COMPLIANCE,
    further: NO_SUCH_TERM,
};

static ANSYS_ARRUDA_BOYCE: Convention = Convention {
    keyword: "BOYCE",
    energy: "W = mu sum_i C_i/lambda_L^(2 i - 2) (I1^i - 3^i) + ((J^2 - 1)/2 - ln J)/d, \
             C_i = 1/2, 1/20, 11/1050, 19/7000, 519/673750 (mu is the initial shear modulus of chains that never lock)",
    manual: "Ansys Mechanical APDL Material Reference, Arruda-Boyce Hyperelasticity (TB,HYPER,,,,BOYCE)",
    law: VolumetricLaw::Mixed,
    shape: Shape::Law {
        constants: &[("mu", LawParameter::Modulus, same), ("lambda_L", LawParameter::LockingStretch, same)],
        order: None,
        num_volumetric: 1,
    },
    volumetric: ("d", Volumetric::Compliance),
    further: NO_SUCH_TERM,
};

static CALCULIX_ARRUDA_BOYCE: Convention = Convention { manual: CALCULIX_MANUAL, ..ABAQUS_ARRUDA_BOYCE };

static COMSOL_ARRUDA_BOYCE: Convention = Convention {
    keyword: "Arruda-Boyce",
    energy: "W = mu_0 sum_p C_p/N^(p - 1) (I1^p - 3^p) + kappa/2 (J - 1)^2, \
             C_p = 1/2, 1/20, 11/1050, 19/7000, 519/673750 (N = lambda_m^2 links of a chain)",
    manual: COMSOL_MANUAL,
    law: VolumetricLaw::Quadratic,
    shape: Shape::Law {
        constants: &[("mu_0", LawParameter::Modulus, same), ("N", LawParameter::LockingStretch, squared)],
        order: None,
        num_volumetric: 1,
    },
    volumetric: ("kappa", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};

static FEBIO_ARRUDA_BOYCE: Convention = Convention {
    keyword: "Arruda-Boyce",
    energy: "W = mu sum_i C_i/N^(i - 1) (I1^i - 3^i) + k/2 (ln J)^2, \
             C_i = 1/2, 1/20, 11/1050, 19/7000, 519/673750 (N = lambda_m^2 links of a chain)",
    manual: FEBIO_MANUAL,
    law: VolumetricLaw::Logarithmic,
    shape: Shape::Law {
        constants: &[("mu", LawParameter::Modulus, same), ("N", LawParameter::LockingStretch, squared)],
        order: None,
        num_volumetric: 1,
    },
    volumetric: ("k", Volumetric::Modulus),
    further: NO_SUCH_TERM,
};
