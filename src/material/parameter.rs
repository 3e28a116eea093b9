//! Parameters of a material: their order, names and symbols.

use super::invariant_energy::LawParameter;

/// A material parameter. Order everywhere: κ, μ₁, α₁, μ₂, α₂, …, or κ and those of the law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Parameter {
    /// κ, kPa.
    Kappa,
    /// μ of the term with this index (from 0), kPa.
    Mu(usize),
    /// α of the term with this index (from 0).
    Alpha(usize),
    /// A parameter of the law in the first invariant.
    Law(LawParameter),
}

impl Parameter {
    /// `kappa`, `mu_1`, `alpha_1`, …; of a law as [`LawParameter::name`] says.
    pub fn name(self) -> String {
        match self {
            Parameter::Kappa => "kappa".into(),
            Parameter::Mu(i) => format!("mu_{}", i + 1),
            Parameter::Alpha(i) => format!("alpha_{}", i + 1),
            Parameter::Law(parameter) => parameter.name(),
        }
    }

    /// The parameter of this [`Self::name`], by which results call it; none for any other word.
    ///
    /// ```
    /// use lambdak::material::Parameter;
    /// assert_eq!(Parameter::named("alpha_2"), Some(Parameter::Alpha(1)));
    /// assert_eq!(Parameter::named("mu_0"), None);
    /// ```
    pub fn named(name: &str) -> Option<Parameter> {
        let number = |digits: &str| digits.parse::<usize>().ok()?.checked_sub(1);
        let found = match name.split_once('_') {
            Some(("mu", digits)) => number(digits).map(Parameter::Mu),
            Some(("alpha", digits)) => number(digits).map(Parameter::Alpha),
            Some(("c", digits)) => number(digits).map(|n| Parameter::Law(LawParameter::Coefficient(n))),
            _ => {
                let others = [LawParameter::Modulus, LawParameter::Limit, LawParameter::LockingStretch];
                let others = others.map(Parameter::Law);
                others.into_iter().chain([Parameter::Kappa]).find(|p| p.name() == name)
            }
        };
        // Digits have many spellings, names have one.
        found.filter(|p| p.name() == name)
    }

    /// As it is written in reports: κ, μ₁, α₁₂; of a law its name, and μ for its modulus.
    pub fn symbol(self) -> String {
        let indexed = |letter: char, index: usize| {
            let below = |c: char| char::from_u32('₀' as u32 + c.to_digit(10)?);
            std::iter::once(letter).chain((index + 1).to_string().chars().filter_map(below)).collect()
        };
        match self {
            Parameter::Kappa => "κ".into(),
            Parameter::Mu(i) => indexed('μ', i),
            Parameter::Alpha(i) => indexed('α', i),
            Parameter::Law(LawParameter::Modulus) => "μ".into(),
            Parameter::Law(parameter) => parameter.name(),
        }
    }

    /// Whether it is a modulus, in kPa; the others have no unit.
    pub fn is_modulus(self) -> bool {
        match self {
            Parameter::Kappa | Parameter::Mu(_) => true,
            Parameter::Alpha(_) => false,
            Parameter::Law(parameter) => parameter.is_modulus(),
        }
    }

    /// Whether it may have either sign and be zero; the others keep the sign that they have.
    pub fn has_any_sign(self) -> bool {
        matches!(self, Parameter::Law(parameter) if parameter.has_any_sign())
    }
}

/// The symbol of the parameter of this name: `kappa` is κ, `mu_1` is μ₁, `alpha_2` is α₂; other names stay.
pub fn symbol_of_parameter(name: &str) -> String {
    Parameter::named(name).map_or_else(|| name.to_string(), Parameter::symbol)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        let laws =
            [LawParameter::Coefficient(0), LawParameter::Modulus, LawParameter::Limit, LawParameter::LockingStretch];
        let all = [Parameter::Kappa, Parameter::Mu(0), Parameter::Alpha(11)].into_iter();
        for parameter in all.chain(laws.map(Parameter::Law)) {
            assert_eq!(Parameter::named(&parameter.name()), Some(parameter));
        }
        for other in
            ["", "mu_", "mu_0", "mu_01", "mu_+1", "mu_x", "alpha_99999999999999999999", "c", "Kappa", "delta_2"]
        {
            assert_eq!(Parameter::named(other), None, "{other}");
        }
    }

    #[test]
    fn parameters_have_symbols() {
        assert_eq!(Parameter::Kappa.symbol(), "κ");
        assert_eq!(Parameter::Mu(0).symbol(), "μ₁");
        assert_eq!(Parameter::Alpha(11).symbol(), "α₁₂");
        assert_eq!(Parameter::Law(LawParameter::Coefficient(0)).symbol(), "c_1");
        assert_eq!(symbol_of_parameter("mu_1"), "μ₁");
        assert_eq!(symbol_of_parameter("mu_x"), "mu_x");
    }
}
