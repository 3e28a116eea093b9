//! A smooth correction of the material's law in the two isochoric invariants.

use crate::material::Lanes;

/// A smooth correction of the isochoric energy, for a law that is no sum of Ogden terms. With t = (x + y)/2 and
/// d = x − y, where x = Ī₁ − 3 and y = Ī₂ − 3 (Ogden terms of exponents 2 and −2 are proportional to x and y), and
/// t̂ = t/(r + t):
///
/// Δψ = r (c₁ t̂²/2 + c₂ t̂³/3) + c₃ d t̂ + c₄ d²/(2 (r + t)).
///
/// c₁ and c₂ change how the material stiffens, c₃ and c₄ how that depends on the mode of deformation (d vanishes in
/// pure and in simple shear). Far beyond the reach r the stress of c₁ and c₂ dies out: what data do not tell is not
/// extrapolated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawCorrection {
    /// r, the t up to which the data tell of it.
    pub reach: f64,
    /// c₁ to c₄, kPa.
    pub coefficients_kpa: [f64; 4],
}

impl LawCorrection {
    /// Δψ (kPa) at the isochoric invariants Ī₁, Ī₂.
    pub fn energy_density(&self, [first, second]: [f64; 2]) -> f64 {
        let (x, y) = (first - 3.0, second - 3.0);
        let (t, d, r) = (0.5 * (x + y), x - y, self.reach);
        let part = t / (r + t);
        let [c1, c2, c3, c4] = self.coefficients_kpa;
        r * (c1 * part.powi(2) / 2.0 + c2 * part.powi(3) / 3.0) + c3 * d * part + c4 * d * d / (2.0 * (r + t))
    }

    /// ∂Δψ/∂Ī₁ and ∂Δψ/∂Ī₂ (kPa) at the isochoric invariants.
    pub fn slopes_kpa(&self, invariants: [f64; 2]) -> [f64; 2] {
        let (slopes, _) = energy_derivatives(self, invariants.map(|i| Lanes::splat(i - 3.0)));
        slopes.map(|s| s.0[0])
    }

    /// The sum of two corrections of one reach.
    pub fn plus(&self, other: &LawCorrection) -> LawCorrection {
        let sum = |n: usize| self.coefficients_kpa[n] + other.coefficients_kpa[n];
        LawCorrection { reach: self.reach, coefficients_kpa: [0, 1, 2, 3].map(sum) }
    }
}

/// Derivatives ψ₁, ψ₂ and ψ₁₁, ψ₁₂, ψ₂₂ of the correction's energy at x and y. By the chain rule ψ₁ = ψ_t/2 + ψ_d and
/// ψ₂ = ψ_t/2 − ψ_d.
#[inline(always)]
pub(super) fn energy_derivatives(law: &LawCorrection, [x, y]: [Lanes; 2]) -> ([Lanes; 2], [Lanes; 3]) {
    let [c1, c2, c3, c4] = law.coefficients_kpa;
    let r = law.reach;
    let (t, d) = ((x + y) * 0.5, x - y);
    // t̂ = t/(r + t) and its first two derivatives.
    let inverse = Lanes::splat(1.0) / (t + r);
    let part = t * inverse;
    let rate = inverse * inverse * r;
    let bend = rate * inverse * -2.0;
    let stiffening = (part * c1 + part * part * c2) * r;
    let along = stiffening * rate + d * rate * c3 - d * d * inverse * inverse * (0.5 * c4);
    let across = part * c3 + d * inverse * c4;
    let along_along = (Lanes::splat(c1) + part * (2.0 * c2)) * rate * rate * r
        + stiffening * bend
        + d * bend * c3
        + d * d * inverse * inverse * inverse * c4;
    let along_across = rate * c3 - d * inverse * inverse * c4;
    let across_across = inverse * c4;
    let quarter = along_along * 0.25;
    (
        [along * 0.5 + across, along * 0.5 - across],
        [quarter + along_across + across_across, quarter - across_across, quarter - along_across + across_across],
    )
}
