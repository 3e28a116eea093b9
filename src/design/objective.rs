//! From an outcome to what the search maximises and must keep: logarithmic gains over the base specimen and margins, each
//! with its gradient.

use super::criteria::RelativeCovariance;
use super::evaluator::{Fidelity, MaterialState, Outcome, StateOutcome, material_states};
use super::qp::Linear;
use super::study::{Combine, ObjectiveKind, Study};
use crate::material::Parameter;
use serde::{Deserialize, Serialize};

/// How cautious the search is where it knows less than the confirmation will: factors from search to confirmed values
/// (local stretches grow with the mesh at bonded edges) and reserves on top.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Caution {
    /// Confirmed over coarse force.
    pub force_factor: f64,
    /// Confirmed over coarse largest (stretch − 1).
    pub stretch_factor: f64,
    /// Relative reserve of force and stretch limits.
    pub response_reserve: f64,
    /// Reserve of ln sd where the promised standard deviations are guarded.
    pub guard_reserve: f64,
}

impl Caution {
    /// For confirmed values: none.
    pub const NONE: Caution =
        Caution { force_factor: 1.0, stretch_factor: 1.0, response_reserve: 0.0, guard_reserve: 0.0 };
}

/// A gain or margin with the name of what it is about.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// Such as `alpha_1 (one term)`.
    pub name: String,
    /// ln gain, or relative margin.
    pub linear: Linear,
    /// Weight in means.
    pub weight: f64,
}

/// An outcome judged.
#[derive(Clone, Debug, PartialEq)]
pub struct Assessment {
    /// ln of each gain over the base.
    pub gains: Vec<Term>,
    /// Margins ≥ 0 of force, stretch and guard.
    pub margins: Vec<Term>,
    combine: Combine,
}

impl Assessment {
    /// The objective: the smallest gain, or the weighted geometric mean; 1 for the base.
    pub fn objective(&self) -> f64 {
        self.log_objective().exp()
    }

    /// Its logarithm.
    pub fn log_objective(&self) -> f64 {
        self.components().iter().map(|c| c.value).fold(f64::INFINITY, f64::min)
    }

    /// The smooth components whose least is to be maximised: all gains under maximin, their mean else.
    pub fn components(&self) -> Vec<Linear> {
        if self.combine == Combine::Maximin {
            return self.gains.iter().map(|g| g.linear.clone()).collect();
        }
        let total: f64 = self.gains.iter().map(|g| g.weight).sum();
        let n = self.gains.first().map_or(0, |g| g.linear.gradient.len());
        let mut mean = Linear { value: 0.0, gradient: vec![0.0; n] };
        for gain in &self.gains {
            let w = gain.weight / total;
            mean.value += w * gain.linear.value;
            for (m, g) in mean.gradient.iter_mut().zip(&gain.linear.gradient) {
                *m += w * g;
            }
        }
        vec![mean]
    }

    /// Σ max(0, −margin).
    pub fn violation(&self) -> f64 {
        self.margins.iter().map(|m| (-m.linear.value).max(0.0)).sum()
    }

    /// What exploration ranks by: ln objective less a price of violations.
    pub fn score(&self) -> f64 {
        self.log_objective() - 3.0 * self.violation()
    }
}

/// Judges outcomes of one fidelity against the base's.
#[derive(Clone, Debug)]
pub struct Judge<'a> {
    study: &'a Study,
    states: Vec<MaterialState>,
    caution: Caution,
    base_integrated: Vec<Vec<f64>>,
    base_criterion: Vec<f64>,
    base_log_sds: Vec<Option<Vec<f64>>>,
}

/// Index of the first (central) state of each material.
fn central_states(states: &[MaterialState]) -> Vec<usize> {
    (0..states.len()).filter(|&i| i == 0 || states[i - 1].material != states[i].material).collect()
}

impl<'a> Judge<'a> {
    /// `None` where the base's outcome does not have the states of the fidelity.
    pub fn new(study: &'a Study, fidelity: Fidelity, base: &Outcome, caution: Caution) -> Option<Self> {
        let states = material_states(study, fidelity);
        if base.states.len() != states.len() {
            return None;
        }
        let mut judge = Judge {
            study,
            states,
            caution,
            base_integrated: Vec::new(),
            base_criterion: Vec::new(),
            base_log_sds: Vec::new(),
        };
        for material in 0..study.materials.len() {
            let mean = judge.mean_integrated(material, &base.states)?;
            // A parameter that the base does not sense at all is judged by itself.
            judge.base_integrated.push(mean.iter().map(|s| if *s > 0.0 { s.ln() } else { 0.0 }).collect());
        }
        for (state, outcome) in judge.states.iter().zip(&base.states) {
            let covariance = RelativeCovariance::of(&state.values, &outcome.information);
            let subset = judge.subset(state.material);
            let criterion = covariance.and_then(|c| c.log_criterion(study.objective.kind, &subset, &[]));
            judge.base_criterion.push(criterion.map_or(0.0, |(value, _)| value));
        }
        for index in central_states(&judge.states) {
            let covariance =
                RelativeCovariance::of(&judge.states[index].values, &base.states[index].information);
            judge.base_log_sds.push(covariance.map(|c| c.relative_sds().iter().map(|s| s.ln()).collect()));
        }
        Some(judge)
    }

    /// The caution in force.
    pub fn caution(&self) -> Caution {
        self.caution
    }

    /// Names of μ₁, α₁, … of a material.
    fn names(&self, material: usize) -> Vec<String> {
        let parameters = self.study.materials[material].material.parameters();
        parameters.into_iter().filter(|p| *p != Parameter::Kappa).map(|p| p.name()).collect()
    }

    fn weight(&self, name: &str) -> f64 {
        self.study.objective.weights.get(name).copied().unwrap_or(1.0)
    }

    /// Indices into μ₁, α₁, … of those with a weight.
    fn subset(&self, material: usize) -> Vec<usize> {
        let names = self.names(material);
        (0..names.len()).filter(|&i| self.weight(&names[i]) > 0.0).collect()
    }

    /// |Σ weight 𝒮| per parameter over the states of a material.
    fn mean_integrated(&self, material: usize, outcomes: &[StateOutcome]) -> Option<Vec<f64>> {
        let n = self.names(material).len();
        let mut mean = vec![0.0; n];
        for (state, outcome) in self.states.iter().zip(outcomes).filter(|(s, _)| s.material == material) {
            if outcome.integrated.len() != n {
                return None;
            }
            for (m, s) in mean.iter_mut().zip(&outcome.integrated) {
                *m += state.weight * s;
            }
        }
        Some(mean.iter().map(|m| m.abs()).collect())
    }

    /// Judges an outcome with its rates (one list of states per variable; none: gradients are empty). `None` where the
    /// outcome cannot be judged: wrong shape, not finite, or a criterion that does not exist.
    pub fn assess(&self, outcome: &Outcome, rates: &[Vec<StateOutcome>]) -> Option<Assessment> {
        let is_complete = |states: &[StateOutcome]| states.len() == self.states.len();
        if !is_complete(&outcome.states) || !rates.iter().all(|r| is_complete(r)) {
            return None;
        }
        let gains = match self.study.objective.kind {
            ObjectiveKind::IntegratedSensitivity => self.integrated_gains(outcome, rates)?,
            _ => self.criterion_gains(outcome, rates)?,
        };
        let margins = self.margins(outcome, rates);
        let is_finite = gains.iter().chain(&margins).all(|t| t.linear.is_usable(rates.len()));
        (is_finite && !gains.is_empty()).then_some(Assessment { gains, margins, combine: self.study.objective.combine })
    }

    fn integrated_gains(&self, outcome: &Outcome, rates: &[Vec<StateOutcome>]) -> Option<Vec<Term>> {
        let mut gains = Vec::new();
        for (material, prior) in self.study.materials.iter().enumerate() {
            let names = self.names(material);
            let value = self.mean_integrated(material, &outcome.states)?;
            for (i, name) in names.iter().enumerate() {
                let weight = self.weight(name) * prior.weight;
                if weight <= 0.0 {
                    continue;
                }
                // 𝒮 keeps its sign everywhere (see the sensitivity room), so |mean| is smooth.
                let signed = |states: &[StateOutcome]| -> f64 {
                    let own = self.states.iter().zip(states).filter(|(s, _)| s.material == material);
                    own.map(|(s, o)| s.weight * o.integrated.get(i).copied().unwrap_or(f64::NAN)).sum()
                };
                let sum = signed(&outcome.states);
                gains.push(Term {
                    name: format!("{name} ({})", prior.name),
                    linear: Linear {
                        value: value[i].ln() - self.base_integrated[material][i],
                        gradient: rates.iter().map(|r| signed(r) / sum).collect(),
                    },
                    weight,
                });
            }
        }
        Some(gains)
    }

    fn criterion_gains(&self, outcome: &Outcome, rates: &[Vec<StateOutcome>]) -> Option<Vec<Term>> {
        let mut gains: Vec<Term> = self
            .study
            .materials
            .iter()
            .map(|prior| Term {
                name: prior.name.clone(),
                linear: Linear { value: 0.0, gradient: vec![0.0; rates.len()] },
                weight: prior.weight,
            })
            .collect();
        for (s, state) in self.states.iter().enumerate() {
            let covariance = RelativeCovariance::of(&state.values, &outcome.states[s].information)?;
            let n = outcome.states[s].information.len();
            // A criterion's gradient needs every derivative of the information.
            if rates.iter().any(|r| r[s].information.len() != n) {
                return None;
            }
            let changes: Vec<_> = rates.iter().map(|r| covariance.change(&r[s].information)).collect();
            let subset = self.subset(state.material);
            let (value, slopes) = covariance.log_criterion(self.study.objective.kind, &subset, &changes)?;
            let gain = &mut gains[state.material].linear;
            gain.value += state.weight * (self.base_criterion[s] - value);
            for (g, slope) in gain.gradient.iter_mut().zip(&slopes) {
                *g -= state.weight * slope;
            }
        }
        Some(gains)
    }

    fn margins(&self, outcome: &Outcome, rates: &[Vec<StateOutcome>]) -> Vec<Term> {
        let mut margins = Vec::new();
        let limits = &self.study.limits;
        for (s, state) in self.states.iter().enumerate() {
            let name = &self.study.materials[state.material].name;
            let own = &outcome.states[s];
            if let Some(limit) = limits.max_force_n {
                let scale = self.caution.force_factor * own.force_n.signum() / limit;
                margins.push(Term {
                    name: format!("max_force_n ({name})"),
                    linear: Linear {
                        value: 1.0 - self.caution.response_reserve - scale * own.force_n,
                        gradient: rates.iter().map(|r| -scale * r[s].force_n).collect(),
                    },
                    weight: 1.0,
                });
            }
            if let Some(limit) = limits.max_local_stretch {
                let scale = self.caution.stretch_factor / limit;
                let value = 1.0 / limit + scale * (own.largest_stretch - 1.0);
                margins.push(Term {
                    name: format!("max_local_stretch ({name})"),
                    linear: Linear {
                        value: 1.0 - self.caution.response_reserve - value,
                        gradient: rates.iter().map(|r| -scale * r[s].largest_stretch).collect(),
                    },
                    weight: 1.0,
                });
            }
        }
        if self.study.objective.guard_promised_sd {
            self.push_guards(outcome, rates, &mut margins);
        }
        margins
    }

    fn push_guards(&self, outcome: &Outcome, rates: &[Vec<StateOutcome>], margins: &mut Vec<Term>) {
        for (material, &s) in central_states(&self.states).iter().enumerate() {
            let Some(base) = &self.base_log_sds[material] else { continue };
            let covariance = RelativeCovariance::of(&self.states[s].values, &outcome.states[s].information);
            let size = outcome.states[s].information.len();
            // Derivatives that were left out belong to margins that are far from active: zero will do.
            let rows: Vec<Vec<f64>> = rates
                .iter()
                .map(|r| match &covariance {
                    Some(c) if r[s].information.len() == size => c.log_sd_rates(&c.change(&r[s].information)),
                    _ => vec![0.0; base.len()],
                })
                .collect();
            for (i, name) in self.names(material).iter().enumerate() {
                let prior = &self.study.materials[material].name;
                // What the base determines and the design does not counts as worse by a factor e.
                let value = covariance.as_ref().map_or(-1.0, |c| base[i] - c.relative_sds()[i].ln());
                margins.push(Term {
                    name: format!("promised_sd of {name} ({prior})"),
                    linear: Linear {
                        value: value - self.caution.guard_reserve,
                        gradient: rows.iter().map(|row| -row[i]).collect(),
                    },
                    weight: 1.0,
                });
            }
        }
    }

    /// Whether derivatives of the information matter at an outcome: always under a criterion of the covariance; else
    /// where a guarded standard deviation comes within 20 % of the base's.
    pub fn needs_information(&self, outcome: &Outcome) -> bool {
        if self.study.objective.kind != ObjectiveKind::IntegratedSensitivity {
            return true;
        }
        let mut guards = Vec::new();
        if self.study.objective.guard_promised_sd && outcome.states.len() == self.states.len() {
            self.push_guards(outcome, &[], &mut guards);
        }
        guards.iter().any(|g| g.linear.value < 0.2)
    }

    /// Relative standard deviations of μ₁, α₁, … at the central values of a material.
    pub fn relative_sds(&self, material: usize, outcome: &Outcome) -> Option<Vec<f64>> {
        let s = *central_states(&self.states).get(material)?;
        Some(RelativeCovariance::of(&self.states[s].values, &outcome.states.get(s)?.information)?.relative_sds())
    }

    /// Largest force and largest local stretch over the material states.
    pub fn largest_response(&self, outcome: &Outcome) -> (f64, f64) {
        let most = |f: &dyn Fn(&StateOutcome) -> f64| outcome.states.iter().map(f).fold(f64::NAN, f64::max);
        (most(&|s| s.force_n.abs()), most(&|s| s.largest_stretch))
    }
}

/// Gains over a base under another criterion than the study's: (ln gain, weight) combined the study's way.
pub fn log_gain_under(study: &Study, kind: ObjectiveKind, base: &Outcome, outcome: &Outcome) -> Option<f64> {
    let mut other = study.clone();
    other.objective.kind = kind;
    other.objective.guard_promised_sd = false;
    let judge = Judge::new(&other, Fidelity::Confirm, base, Caution::NONE)?;
    Some(judge.assess(outcome, &[])?.log_objective())
}
