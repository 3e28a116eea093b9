//! The laws in the first invariant by their names, and the one that a material has.

use super::invariant_energy::{ArrudaBoyce, FirstInvariantEnergy, Gent, LawParameter, MooneyRivlin, NeoHookean, Yeoh};
use super::lanes::Lanes;

/// The exponent of an Ogden term that is Ī₂ − 3.
pub const SECOND_EXPONENT: f64 = -2.0;

/// Which energy in the first invariant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum LawKind {
    /// W = ½ μ x, x = Ī₁ − 3: an Ogden term whose exponent is 2.
    NeoHookean,
    /// c₁ (Ī₁ − 3) + c₂ (Ī₂ − 3): Ogden terms whose exponents are 2 and −2.
    MooneyRivlin,
    /// W = c₁ x + c₂ x² + c₃ x³, x = Ī₁ − 3.
    Yeoh,
    /// W = −½ μ J_m ln(1 − x/J_m).
    Gent,
    /// Eight chains, the five-term series of the inverse Langevin function.
    ArrudaBoyce,
}

impl LawKind {
    /// All of them.
    pub const ALL: [LawKind; 5] =
        [LawKind::NeoHookean, LawKind::MooneyRivlin, LawKind::Yeoh, LawKind::Gent, LawKind::ArrudaBoyce];

    /// The name by which it goes: `neo-Hookean`, `Mooney-Rivlin`, `Yeoh`, `Gent`, `Arruda-Boyce`.
    pub fn name(self) -> &'static str {
        match self {
            LawKind::NeoHookean => "neo-Hookean",
            LawKind::MooneyRivlin => "Mooney-Rivlin",
            LawKind::Yeoh => "Yeoh",
            LawKind::Gent => "Gent",
            LawKind::ArrudaBoyce => "Arruda-Boyce",
        }
    }

    /// Its parameters, in their order.
    pub fn parameters(self) -> &'static [LawParameter] {
        self.law(&[]).parameters()
    }

    /// The law with these values of its parameters, in their order; those that are missing are no numbers.
    pub fn law(self, values: &[f64]) -> InvariantLaw {
        let mut law = match self {
            LawKind::NeoHookean => InvariantLaw::NeoHookean(NeoHookean { mu_kpa: f64::NAN }),
            LawKind::MooneyRivlin => InvariantLaw::MooneyRivlin(MooneyRivlin { coefficients_kpa: [f64::NAN; 2] }),
            LawKind::Yeoh => InvariantLaw::Yeoh(Yeoh { coefficients_kpa: [f64::NAN; 3] }),
            LawKind::Gent => InvariantLaw::Gent(Gent { mu_kpa: f64::NAN, limit: f64::NAN }),
            LawKind::ArrudaBoyce => {
                InvariantLaw::ArrudaBoyce(ArrudaBoyce { mu_kpa: f64::NAN, locking_stretch: f64::NAN })
            }
        };
        for (parameter, value) in law.parameters().iter().zip(values) {
            law.set(*parameter, *value);
        }
        law
    }

    /// Laws with this initial shear modulus (kPa) to start fits from, from stiffening late to early. Where
    /// stresses are linear in all parameters one start is enough.
    pub fn starts(self, shear_kpa: f64) -> Vec<InvariantLaw> {
        match self {
            LawKind::NeoHookean => vec![InvariantLaw::NeoHookean(NeoHookean { mu_kpa: shear_kpa })],
            LawKind::MooneyRivlin => {
                vec![InvariantLaw::MooneyRivlin(MooneyRivlin { coefficients_kpa: [0.4 * shear_kpa, 0.1 * shear_kpa] })]
            }
            LawKind::Yeoh => vec![InvariantLaw::Yeoh(Yeoh { coefficients_kpa: [0.5 * shear_kpa, 0.0, 0.0] })],
            LawKind::Gent => {
                [200.0, 60.0, 20.0].map(|limit| InvariantLaw::Gent(Gent { mu_kpa: shear_kpa, limit })).into()
            }
            LawKind::ArrudaBoyce => [6.0, 3.0, 1.6]
                .map(|locking_stretch| {
                    let unit = InvariantLaw::ArrudaBoyce(ArrudaBoyce { mu_kpa: 1.0, locking_stretch });
                    let mu_kpa = shear_kpa / unit.initial_shear_modulus_kpa();
                    InvariantLaw::ArrudaBoyce(ArrudaBoyce { mu_kpa, locking_stretch })
                })
                .into(),
        }
    }
}

/// An energy in the first invariant that a material may have.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum InvariantLaw {
    /// The neo-Hookean one.
    NeoHookean(NeoHookean),
    /// Mooney and Rivlin's, which holds the second invariant, too.
    MooneyRivlin(MooneyRivlin),
    /// Yeoh's.
    Yeoh(Yeoh),
    /// Gent's.
    Gent(Gent),
    /// Arruda and Boyce's.
    ArrudaBoyce(ArrudaBoyce),
}

impl InvariantLaw {
    /// The law behind the trait.
    fn energy(&self) -> &dyn FirstInvariantEnergy {
        match self {
            InvariantLaw::NeoHookean(law) => law,
            InvariantLaw::MooneyRivlin(law) => law,
            InvariantLaw::Yeoh(law) => law,
            InvariantLaw::Gent(law) => law,
            InvariantLaw::ArrudaBoyce(law) => law,
        }
    }

    /// Which one it is.
    pub fn kind(&self) -> LawKind {
        match self {
            InvariantLaw::NeoHookean(_) => LawKind::NeoHookean,
            InvariantLaw::MooneyRivlin(_) => LawKind::MooneyRivlin,
            InvariantLaw::Yeoh(_) => LawKind::Yeoh,
            InvariantLaw::Gent(_) => LawKind::Gent,
            InvariantLaw::ArrudaBoyce(_) => LawKind::ArrudaBoyce,
        }
    }

    /// Index of a parameter.
    fn index_of(&self, parameter: LawParameter) -> Option<usize> {
        self.energy().parameters().iter().position(|p| *p == parameter)
    }

    /// Its parameters.
    pub fn parameters(&self) -> &'static [LawParameter] {
        self.energy().parameters()
    }

    /// Value of a parameter; NaN where the law has none of this name.
    pub fn value(&self, parameter: LawParameter) -> f64 {
        self.index_of(parameter).map_or(f64::NAN, |index| self.energy().value(index))
    }

    /// Sets a parameter that the law has.
    pub fn set(&mut self, parameter: LawParameter, value: f64) {
        let Some(index) = self.index_of(parameter) else { return };
        match self {
            InvariantLaw::NeoHookean(law) => law.set(index, value),
            InvariantLaw::MooneyRivlin(law) => law.set(index, value),
            InvariantLaw::Yeoh(law) => law.set(index, value),
            InvariantLaw::Gent(law) => law.set(index, value),
            InvariantLaw::ArrudaBoyce(law) => law.set(index, value),
        }
    }

    /// W (kPa) at x = Ī₁ − 3, without what the second invariant adds.
    pub fn energy_density(&self, x: f64) -> f64 {
        self.energy().energy_density(x)
    }

    /// μ (kPa) of the Ogden term that c (Ī₂ − 3) is, with [`SECOND_EXPONENT`]; `None` where the law never holds it.
    pub fn second_mu_kpa(&self) -> Option<f64> {
        self.energy().second_kpa().map(|c| SECOND_EXPONENT * c)
    }

    /// The derivative of that by a parameter.
    pub fn second_mu_derivative(&self, parameter: LawParameter) -> f64 {
        self.index_of(parameter).map_or(0.0, |index| SECOND_EXPONENT * self.energy().second_derivative(index))
    }

    /// The x that no state reaches.
    pub fn largest_x(&self) -> f64 {
        self.energy().largest_x()
    }

    /// W′ and W″ (kPa) at x.
    #[inline(always)]
    pub fn slopes(&self, x: Lanes) -> [Lanes; 2] {
        match self {
            InvariantLaw::NeoHookean(law) => law.slopes(x),
            InvariantLaw::MooneyRivlin(law) => law.slopes(x),
            InvariantLaw::Yeoh(law) => law.slopes(x),
            InvariantLaw::Gent(law) => law.slopes(x),
            InvariantLaw::ArrudaBoyce(law) => law.slopes(x),
        }
    }

    /// The same at one state.
    pub fn slopes_at(&self, x: f64) -> [f64; 2] {
        self.slopes(Lanes::splat(x)).map(|s| s.0[0])
    }

    /// ∂W′/∂ξ (kPa per unit of ξ) at x; zero for a parameter that the law does not have.
    #[inline(always)]
    pub fn slope_derivative(&self, parameter: LawParameter, x: Lanes) -> Lanes {
        let Some(index) = self.index_of(parameter) else { return Lanes::ZERO };
        match self {
            InvariantLaw::NeoHookean(law) => law.slope_derivative(index, x),
            InvariantLaw::MooneyRivlin(law) => law.slope_derivative(index, x),
            InvariantLaw::Yeoh(law) => law.slope_derivative(index, x),
            InvariantLaw::Gent(law) => law.slope_derivative(index, x),
            InvariantLaw::ArrudaBoyce(law) => law.slope_derivative(index, x),
        }
    }

    /// The initial shear modulus 2 W′(0), kPa, and ½ μα of the second term.
    pub fn initial_shear_modulus_kpa(&self) -> f64 {
        2.0 * self.slopes_at(0.0)[0] + 0.5 * SECOND_EXPONENT * self.second_mu_kpa().unwrap_or(0.0)
    }
}

#[cfg(test)]
pub(crate) use tests::laws;

#[cfg(test)]
#[path = "invariant_law_tests.rs"]
mod tests;
