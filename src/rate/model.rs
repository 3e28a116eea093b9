//! A load curve's model: Ogden terms in equilibrium and, where switched on, relaxation, Mullins softening, friction in
//! compression, and a load cell's faults. Values and derivatives with respect to all unknowns.
//!
//! * Softening (Ogden and Roxburgh 1999, doi 10.1098/rspa.1999.0431): the elastic stress is multiplied by
//!   η = 1 − ρ erf((W_max − W)/(m + β W_max)), ρ = 1/r in [0, 1); ρ = 0 is no softening.
//! * Relaxation acts on the softened isochoric stress: P = Σ_c w_c (S_c + Σ gᵢ ∫ e^{−(t−s)/τᵢ} dS_c). Simo's model
//!   takes for S the second Piola–Kirchhoff stress; in large shear its components nearly cancel, and so do not when
//!   they lag. Fung's quasi-linear model takes the nominal stress itself. The two agree for small strains; the data
//!   choose.
//! * Barrelling: below λ = 1 the stress is multiplied by 1 + b λ⁻³, b = 2 S² times the degree of bonding, S the shape
//!   factor (Gent and Lindley 1959: 1 + 2 S² for bonded discs; S grows as λ^(−3/2) at constant volume).
//! * Load cell: measured = gain · (P + friction · direction) + offset; gains are relative to the first curve's.

use super::channels::channels;
use super::load_curve::LoadCurve;
use super::prony::memory;
use crate::homogeneous::{Deformation, HomogeneousTest, ShearTerm, erf};

/// Which physics a model has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Physics {
    pub(crate) num_relaxations: usize,
    /// Whether relaxation acts on the nominal stress instead of the isochoric second Piola–Kirchhoff stress.
    pub(crate) is_nominal: bool,
    pub(crate) has_softening: bool,
    pub(crate) has_barrelling: bool,
    pub(crate) has_friction: bool,
    pub(crate) has_offset: bool,
    pub(crate) has_gain: bool,
}

/// Where the unknowns of a model lie: (ln|c|, α) per term, (g, ln τ) per relaxation, (ρ, ln m, β), b, friction, offset,
/// gains of the second and later curves.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layout {
    /// Signs of the terms' c.
    pub(crate) signs: Vec<f64>,
    pub(crate) physics: Physics,
    pub(crate) num_curves: usize,
}

impl Layout {
    pub(crate) fn relaxations(&self) -> usize {
        2 * self.signs.len()
    }

    pub(crate) fn softening(&self) -> usize {
        self.relaxations() + 2 * self.physics.num_relaxations
    }

    pub(crate) fn barrelling(&self) -> usize {
        self.softening() + 3 * usize::from(self.physics.has_softening)
    }

    pub(crate) fn friction(&self) -> usize {
        self.barrelling() + usize::from(self.physics.has_barrelling)
    }

    pub(crate) fn offset(&self) -> usize {
        self.friction() + usize::from(self.physics.has_friction)
    }

    pub(crate) fn gains(&self) -> usize {
        self.offset() + usize::from(self.physics.has_offset)
    }

    pub(crate) fn num_unknowns(&self) -> usize {
        self.gains() + if self.physics.has_gain { self.num_curves.saturating_sub(1) } else { 0 }
    }

    pub(crate) fn terms(&self, x: &[f64]) -> Vec<ShearTerm> {
        (0..self.signs.len())
            .map(|i| ShearTerm { modulus_kpa: self.signs[i] * x[2 * i].exp(), alpha: x[2 * i + 1] })
            .collect()
    }
}

/// A curve with what does not depend on the unknowns.
#[derive(Clone, Debug)]
pub(crate) struct Prepared {
    /// Index among all curves (for the gain).
    pub(crate) index: usize,
    /// States; the first one is rest, put before the recording.
    states: Vec<Deformation>,
    /// Times with the rest state's; empty without times.
    pub(crate) time_s: Vec<f64>,
    /// Direction of motion at each sample (rest included).
    direction: Vec<f64>,
    /// λ⁻³ in compression, 0 elsewhere.
    squeeze: Vec<f64>,
}

impl Prepared {
    pub(crate) fn new(index: usize, curve: &LoadCurve) -> Prepared {
        let rest = curve.test.rest();
        let mut states = vec![curve.test.at(rest)];
        states.extend(curve.drive.iter().map(|&d| curve.test.at(d)));
        let mut time_s = Vec::new();
        if let Some(&first) = curve.time_s.first() {
            // A recording that begins later than at 0 was driven there from rest at time 0; one that begins before is
            // at rest.
            time_s.push(if first > 0.0 { 0.0 } else { first });
            time_s.extend(&curve.time_s);
        }
        let mut direction = vec![0.0];
        direction.extend(curve.directions());
        let squeeze = std::iter::once(rest)
            .chain(curve.drive.iter().copied())
            .map(|d| if curve.test == HomogeneousTest::Uniaxial && d < 1.0 { d.powi(-3) } else { 0.0 })
            .collect();
        Prepared { index, states, time_s, direction, squeeze }
    }
}

/// Modelled stresses at a curve's samples and their derivatives, `[unknown][sample]`.
pub(crate) struct Modelled {
    pub(crate) stress_kpa: Vec<f64>,
    pub(crate) by_unknown: Vec<Vec<f64>>,
}

/// Two channels over a history, with derivatives per unknown.
struct History {
    value: [Vec<f64>; 2],
    by: Vec<[Vec<f64>; 2]>,
}

/// The model's stresses. Relaxations need times; without them they have no effect.
pub(crate) fn model(layout: &Layout, x: &[f64], curve: &Prepared) -> Modelled {
    let (n, num_terms, physics) = (curve.states.len(), layout.signs.len(), layout.physics);
    let terms = layout.terms(x);
    let num_elastic = 2 * num_terms + if physics.has_softening { 3 } else { 0 };
    let empty = || [vec![0.0; n], vec![0.0; n]];
    let mut history = History { value: empty(), by: (0..num_elastic).map(|_| empty()).collect() };
    let mut weight = Vec::with_capacity(n);
    let (mut largest, mut largest_by) = (0.0, vec![0.0; 2 * num_terms]);
    for i in 0..n {
        let mut c = channels(&terms, &curve.states[i]);
        if physics.is_nominal {
            c = c.nominal();
        }
        weight.push(c.weight);
        let energy_by: Vec<f64> = c.energy_by_term.iter().flatten().copied().collect();
        if c.energy > largest {
            largest = c.energy;
            largest_by.clone_from(&energy_by);
        }
        let mut factor = 1.0;
        let mut factor_by = vec![0.0; num_elastic];
        if physics.has_softening {
            let s = layout.softening();
            let (rho, m, beta) = (x[s], x[s + 1].exp(), x[s + 2]);
            let (top, bottom) = (largest - c.energy, m + beta * largest);
            let z = top / bottom;
            factor = 1.0 - rho * erf(z);
            let slope = -rho * std::f64::consts::FRAC_2_SQRT_PI * (-z * z).exp() / bottom;
            for p in 0..2 * num_terms {
                factor_by[p] = slope * (largest_by[p] - energy_by[p] - z * beta * largest_by[p]);
            }
            factor_by[2 * num_terms] = -erf(z);
            factor_by[2 * num_terms + 1] = -slope * z * m;
            factor_by[2 * num_terms + 2] = -slope * z * largest;
        }
        for k in 0..2 {
            history.value[k][i] = factor * c.stress[k];
            for p in 0..num_elastic {
                let own = if p < 2 * num_terms { factor * c.by_term[p / 2][p % 2][k] } else { 0.0 };
                history.by[p][k][i] = own + factor_by[p] * c.stress[k];
            }
        }
    }
    let mut stress = vec![0.0; n];
    let mut by = vec![vec![0.0; n]; layout.num_unknowns()];
    // The elastic unknowns' places: terms first, softening after the relaxations.
    let place = |p: usize| if p < 2 * num_terms { p } else { layout.softening() + p - 2 * num_terms };
    for k in 0..2 {
        for i in 0..n {
            stress[i] += weight[i][k] * history.value[k][i];
            for p in 0..num_elastic {
                by[place(p)][i] += weight[i][k] * history.by[p][k][i];
            }
        }
        if curve.time_s.is_empty() {
            continue;
        }
        for r in 0..physics.num_relaxations {
            let at = layout.relaxations() + 2 * r;
            let (g, tau) = (x[at], x[at + 1].exp());
            let (value, slope) = memory(&curve.time_s, &history.value[k], tau);
            for i in 0..n {
                stress[i] += g * weight[i][k] * value[i];
                by[at][i] += weight[i][k] * value[i];
                by[at + 1][i] += g * tau * weight[i][k] * slope[i];
            }
            for p in 0..num_elastic {
                let (value, _) = memory(&curve.time_s, &history.by[p][k], tau);
                for i in 0..n {
                    by[place(p)][i] += g * weight[i][k] * value[i];
                }
            }
        }
    }
    load_cell(layout, x, curve, &mut stress, &mut by);
    // The rest state was not recorded.
    stress.remove(0);
    for list in &mut by {
        list.remove(0);
    }
    Modelled { stress_kpa: stress, by_unknown: by }
}

/// Barrelling, friction, gain and offset on top of the material's stress.
fn load_cell(layout: &Layout, x: &[f64], curve: &Prepared, stress: &mut [f64], by: &mut [Vec<f64>]) {
    let physics = layout.physics;
    for i in 0..stress.len() {
        if physics.has_barrelling {
            let at = layout.barrelling();
            let factor = 1.0 + x[at] * curve.squeeze[i];
            for list in by.iter_mut() {
                list[i] *= factor;
            }
            by[at][i] = stress[i] * curve.squeeze[i];
            stress[i] *= factor;
        }
        if physics.has_friction {
            let at = layout.friction();
            stress[i] += x[at] * curve.direction[i];
            by[at][i] = curve.direction[i];
        }
        if physics.has_gain && curve.index > 0 {
            let at = layout.gains() + curve.index - 1;
            if at < by.len() {
                let gain = x[at];
                for list in by.iter_mut() {
                    list[i] *= gain;
                }
                by[at][i] = stress[i];
                stress[i] *= gain;
            }
        }
        if physics.has_offset {
            stress[i] += x[layout.offset()];
            by[layout.offset()][i] = 1.0;
        }
    }
}

#[cfg(test)]
#[path = "model_tests.rs"]
mod tests;
