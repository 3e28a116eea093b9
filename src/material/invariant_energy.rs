//! Strain energies in the first isochoric invariant: the neo-Hookean one, Mooney and Rivlin's, Yeoh's, Gent's, Arruda
//! and Boyce's.
//!
//! With x = Ī₁ − 3 and W(x) such an energy, τ_a = 2 W′ (λ̄_a² − mean λ̄²) + κ ln J: the law acts like an Ogden term of
//! exponent 2 whose modulus μ = 2 W′(x) follows the deformation. Everything else about a law, as its place in the
//! tangent or in stability, follows from W′ and W″; a law of one's own needs [`FirstInvariantEnergy`] alone.
//!
//! A law may also hold c (Ī₂ − 3), as Mooney and Rivlin's does: that is an Ogden term of exponent −2 with μ = −2 c.

use super::lanes::Lanes;
use super::limits::{MAX_CHAIN_LIMIT, MAX_LOCKING_STRETCH, MAX_MODULUS_KPA, MIN_CHAIN_LIMIT, MIN_LOCKING_STRETCH};

/// What the material model needs to know of an energy W(x), x = Ī₁ − 3.
pub trait FirstInvariantEnergy {
    /// Its parameters, in the order of their derivatives.
    fn parameters(&self) -> &'static [LawParameter];
    /// Value of the parameter with this index.
    fn value(&self, index: usize) -> f64;
    /// Sets it.
    fn set(&mut self, index: usize, value: f64);
    /// W, kPa, zero at x = 0; infinite beyond the largest x that the law allows.
    fn energy_density(&self, x: f64) -> f64;
    /// W′ and W″, kPa.
    fn slopes(&self, x: Lanes) -> [Lanes; 2];
    /// ∂W′/∂ξ of the parameter with this index, kPa per unit of ξ.
    fn slope_derivative(&self, index: usize, x: Lanes) -> Lanes;
    /// The x that no state reaches; infinite where there is none.
    fn largest_x(&self) -> f64 {
        f64::INFINITY
    }
    /// What Ī₂ − 3 is multiplied by in the energy, kPa; `None` where the energy never holds it.
    fn second_kpa(&self) -> Option<f64> {
        None
    }
    /// The derivative of that by the parameter with this index.
    fn second_derivative(&self, _index: usize) -> f64 {
        0.0
    }
}

/// A parameter of an energy in the first invariant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LawParameter {
    /// Yeoh's coefficient of x^(n + 1), or Mooney and Rivlin's of the invariant n + 1, kPa, for n from 0.
    Coefficient(usize),
    /// The modulus, kPa.
    Modulus,
    /// Gent's limit J_m of x.
    Limit,
    /// Arruda and Boyce's locking stretch λ_m.
    LockingStretch,
}

impl LawParameter {
    /// `c_1`, `mu`, `j_m`, `lambda_m`.
    pub fn name(self) -> String {
        match self {
            LawParameter::Coefficient(n) => format!("c_{}", n + 1),
            LawParameter::Modulus => "mu".into(),
            LawParameter::Limit => "j_m".into(),
            LawParameter::LockingStretch => "lambda_m".into(),
        }
    }

    /// Whether stresses are in proportion to it (with all others of its kind): its unit is then kPa.
    pub fn is_modulus(self) -> bool {
        matches!(self, LawParameter::Coefficient(_) | LawParameter::Modulus)
    }

    /// Whether it may have either sign, and be zero.
    pub fn has_any_sign(self) -> bool {
        matches!(self, LawParameter::Coefficient(n) if n > 0)
    }

    /// Its least and largest value; a modulus that may not have either sign is above zero.
    pub fn range(self) -> [f64; 2] {
        match self {
            LawParameter::Coefficient(0) | LawParameter::Modulus => [0.0, MAX_MODULUS_KPA],
            LawParameter::Coefficient(_) => [-MAX_MODULUS_KPA, MAX_MODULUS_KPA],
            LawParameter::Limit => [MIN_CHAIN_LIMIT, MAX_CHAIN_LIMIT],
            LawParameter::LockingStretch => [MIN_LOCKING_STRETCH, MAX_LOCKING_STRETCH],
        }
    }
}

/// The neo-Hookean law, W = ½ μ x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeoHookean {
    /// μ, the initial shear modulus, kPa.
    pub mu_kpa: f64,
}

impl FirstInvariantEnergy for NeoHookean {
    fn parameters(&self) -> &'static [LawParameter] {
        &[LawParameter::Modulus]
    }

    fn value(&self, _: usize) -> f64 {
        self.mu_kpa
    }

    fn set(&mut self, _: usize, value: f64) {
        self.mu_kpa = value;
    }

    fn energy_density(&self, x: f64) -> f64 {
        0.5 * self.mu_kpa * x
    }

    #[inline(always)]
    fn slopes(&self, _: Lanes) -> [Lanes; 2] {
        [Lanes::splat(0.5 * self.mu_kpa), Lanes::ZERO]
    }

    #[inline(always)]
    fn slope_derivative(&self, _: usize, _: Lanes) -> Lanes {
        Lanes::splat(0.5)
    }
}

/// Mooney (1940) and Rivlin (1948), c₁ (Ī₁ − 3) + c₂ (Ī₂ − 3). With c₂ = 0 it is the neo-Hookean law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MooneyRivlin {
    /// c₁, c₂, kPa.
    pub coefficients_kpa: [f64; 2],
}

impl FirstInvariantEnergy for MooneyRivlin {
    fn parameters(&self) -> &'static [LawParameter] {
        &[LawParameter::Coefficient(0), LawParameter::Coefficient(1)]
    }

    fn value(&self, index: usize) -> f64 {
        self.coefficients_kpa[index]
    }

    fn set(&mut self, index: usize, value: f64) {
        self.coefficients_kpa[index] = value;
    }

    fn energy_density(&self, x: f64) -> f64 {
        self.coefficients_kpa[0] * x
    }

    #[inline(always)]
    fn slopes(&self, _: Lanes) -> [Lanes; 2] {
        [Lanes::splat(self.coefficients_kpa[0]), Lanes::ZERO]
    }

    #[inline(always)]
    fn slope_derivative(&self, index: usize, _: Lanes) -> Lanes {
        if index == 0 { Lanes::splat(1.0) } else { Lanes::ZERO }
    }

    fn second_kpa(&self) -> Option<f64> {
        Some(self.coefficients_kpa[1])
    }

    fn second_derivative(&self, index: usize) -> f64 {
        if index == 1 { 1.0 } else { 0.0 }
    }
}

/// Yeoh (1993), W = c₁ x + c₂ x² + c₃ x³. With c₂ = c₃ = 0 it is the neo-Hookean law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Yeoh {
    /// c₁, c₂, c₃, kPa.
    pub coefficients_kpa: [f64; 3],
}

impl FirstInvariantEnergy for Yeoh {
    fn parameters(&self) -> &'static [LawParameter] {
        use LawParameter::Coefficient;
        &[Coefficient(0), Coefficient(1), Coefficient(2)]
    }

    fn value(&self, index: usize) -> f64 {
        self.coefficients_kpa[index]
    }

    fn set(&mut self, index: usize, value: f64) {
        self.coefficients_kpa[index] = value;
    }

    fn energy_density(&self, x: f64) -> f64 {
        let [c1, c2, c3] = self.coefficients_kpa;
        x * (c1 + x * (c2 + x * c3))
    }

    #[inline(always)]
    fn slopes(&self, x: Lanes) -> [Lanes; 2] {
        let [c1, c2, c3] = self.coefficients_kpa;
        [x * (x * (3.0 * c3) + 2.0 * c2) + c1, x * (6.0 * c3) + 2.0 * c2]
    }

    #[inline(always)]
    fn slope_derivative(&self, index: usize, x: Lanes) -> Lanes {
        match index {
            0 => Lanes::splat(1.0),
            1 => x * 2.0,
            _ => x * x * 3.0,
        }
    }
}

/// Gent (1996), W = −½ μ J_m ln(1 − x/J_m): the chains are at their end where x reaches J_m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gent {
    /// μ, the initial shear modulus, kPa.
    pub mu_kpa: f64,
    /// J_m.
    pub limit: f64,
}

impl Gent {
    /// 1/(J_m − x); NaN where x is not below J_m, so that no state beyond is taken for an equilibrium.
    #[inline(always)]
    fn inverse_rest(&self, x: Lanes) -> Lanes {
        let rest = Lanes::splat(self.limit) - x;
        Lanes::select_below(rest, f64::MIN_POSITIVE, Lanes::splat(f64::NAN), Lanes::splat(1.0) / rest)
    }
}

impl FirstInvariantEnergy for Gent {
    fn parameters(&self) -> &'static [LawParameter] {
        &[LawParameter::Modulus, LawParameter::Limit]
    }

    fn value(&self, index: usize) -> f64 {
        [self.mu_kpa, self.limit][index]
    }

    fn set(&mut self, index: usize, value: f64) {
        *[&mut self.mu_kpa, &mut self.limit][index] = value;
    }

    fn energy_density(&self, x: f64) -> f64 {
        if x < self.limit { -0.5 * self.mu_kpa * self.limit * (-x / self.limit).ln_1p() } else { f64::INFINITY }
    }

    #[inline(always)]
    fn slopes(&self, x: Lanes) -> [Lanes; 2] {
        let inverse = self.inverse_rest(x);
        let slope = inverse * (0.5 * self.mu_kpa * self.limit);
        [slope, slope * inverse]
    }

    #[inline(always)]
    fn slope_derivative(&self, index: usize, x: Lanes) -> Lanes {
        let inverse = self.inverse_rest(x);
        if index == 0 { inverse * (0.5 * self.limit) } else { x * inverse * inverse * (-0.5 * self.mu_kpa) }
    }

    fn largest_x(&self) -> f64 {
        self.limit
    }
}

/// Arruda and Boyce (1993), the eight-chain network in the five-term series of the inverse Langevin function,
/// W = μ Σ Cᵢ λ_m^(2 − 2i) (Ī₁ⁱ − 3ⁱ), C = 1/2, 1/20, 11/1050, 19/7000, 519/673750.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArrudaBoyce {
    /// μ, kPa: the initial shear modulus of chains that never lock.
    pub mu_kpa: f64,
    /// λ_m.
    pub locking_stretch: f64,
}

/// i Cᵢ of the series.
const CHAIN_SERIES: [f64; 5] = [0.5, 0.1, 11.0 / 350.0, 19.0 / 1750.0, 519.0 / 134_750.0];

impl ArrudaBoyce {
    /// Σ i Cᵢ weight(i − 1) q^(i−1), q = Ī₁/λ_m².
    #[inline(always)]
    fn series(&self, x: Lanes, weight: impl Fn(f64) -> f64) -> Lanes {
        let q = (x + 3.0) * self.locking_stretch.powi(-2);
        let mut sum = Lanes::ZERO;
        for (i, c) in CHAIN_SERIES.iter().enumerate().rev() {
            sum = sum * q + c * weight(i as f64);
        }
        sum
    }
}

impl FirstInvariantEnergy for ArrudaBoyce {
    fn parameters(&self) -> &'static [LawParameter] {
        &[LawParameter::Modulus, LawParameter::LockingStretch]
    }

    fn value(&self, index: usize) -> f64 {
        [self.mu_kpa, self.locking_stretch][index]
    }

    fn set(&mut self, index: usize, value: f64) {
        *[&mut self.mu_kpa, &mut self.locking_stretch][index] = value;
    }

    fn energy_density(&self, x: f64) -> f64 {
        let part = self.locking_stretch.powi(-2);
        let mut sum = 0.0;
        for (i, c) in CHAIN_SERIES.iter().enumerate() {
            let n = i as i32 + 1;
            // (3 + x)ⁿ − 3ⁿ without loss of digits at small x.
            let rise = 3f64.powi(n) * (f64::from(n) * (x / 3.0).ln_1p()).exp_m1();
            sum += c / f64::from(n) * part.powi(n - 1) * rise;
        }
        self.mu_kpa * sum
    }

    #[inline(always)]
    fn slopes(&self, x: Lanes) -> [Lanes; 2] {
        // dq/dx = λ_m⁻², and Σ i Cᵢ (i − 1) q^(i−2) = (Σ i Cᵢ (i − 1) q^(i−1))/q.
        let second = self.series(x, |i| i) / (x + 3.0);
        [self.series(x, |_| 1.0) * self.mu_kpa, second * self.mu_kpa]
    }

    #[inline(always)]
    fn slope_derivative(&self, index: usize, x: Lanes) -> Lanes {
        if index == 0 {
            self.series(x, |_| 1.0)
        } else {
            // dq/dλ_m = −2 q/λ_m.
            self.series(x, |i| i) * (-2.0 * self.mu_kpa / self.locking_stretch)
        }
    }
}
