//! From responses to the objective and the response limits, all as logarithms of ratios: 0 is the base specimen, or a
//! limit just met; larger is better. The force across the plates, which may have either sign, is limited from both
//! sides by 1 ∓ F / limit: to first order at the limit the logarithm, and smooth where the force changes its sign.

use super::aim::{Combine, ObjectiveKind};
use super::detection::log_gains;
use super::evaluator::Evaluated;
use super::material_samples::MaterialSample;
use super::response::Response;
use super::study::Study;
use crate::specimen::ManufacturingLimits;

/// The base specimen's responses, against which gains are counted.
pub struct Reference<'a> {
    study: &'a Study,
    samples: &'a [MaterialSample],
    base: Vec<Response>,
    /// Added to the margins of each prior's limits: what a confirmation has shown the search fidelity to be off by.
    shifts: Vec<Vec<f64>>,
}

/// Gains and limits of one design, with gradients where the evaluation has them.
#[derive(Clone, Debug)]
pub struct Judged {
    /// ln gain of each component, with its weight; the objective is their minimum or weighted mean.
    pub gains: Vec<f64>,
    /// Weights of the gains; they sum to one.
    pub weights: Vec<f64>,
    /// Margins that must not be negative, at every material sample: guards, force, stretch.
    pub margins: Vec<f64>,
    /// The least margin of each limit over a prior's samples: `[prior][limit]`.
    pub worst_margins: Vec<Vec<f64>>,
    /// `[variable][gain]`, per mm.
    pub gain_gradients: Vec<Vec<f64>>,
    /// `[variable][margin]`, per mm.
    pub margin_gradients: Vec<Vec<f64>>,
}

impl<'a> Reference<'a> {
    /// Counts from `base`, the base specimen's responses to `samples`.
    pub fn new(study: &'a Study, samples: &'a [MaterialSample], base: &[Response]) -> Reference<'a> {
        Reference { study, samples, base: base.to_vec(), shifts: Vec::new() }
    }

    /// What the base itself is judged.
    pub fn of_base(&self) -> Judged {
        self.judge(&Evaluated { responses: self.base.clone(), gradients: Vec::new() })
    }

    /// The same with each margin lowered by as much as the confirmation of one design found it below what the search
    /// found there: `[prior][limit]` both, as in [`Judged::worst_margins`].
    pub fn lowered(&self, confirmed: &[Vec<f64>], searched: &[Vec<f64>]) -> Reference<'a> {
        let of_prior = |(c, s): (&Vec<f64>, &Vec<f64>)| c.iter().zip(s).map(|(c, s)| (c - s).min(0.0)).collect();
        let shifts = confirmed.iter().zip(searched).map(of_prior).collect();
        Reference { study: self.study, samples: self.samples, base: self.base.clone(), shifts }
    }

    /// ln gains of one response; none of the first material where materials are to be told apart.
    fn gains(&self, prior: usize, response: &Response, base: &Response) -> Vec<f64> {
        let criterion = |i: usize| vec![base.log_criteria[i] - response.log_criteria[i]];
        let sensitivity = || response.log_integrated.iter().zip(&base.log_integrated).map(|(a, b)| a - b);
        let promised = response.log_relative_sd.iter().zip(&base.log_relative_sd).map(|(a, b)| b - a);
        match self.study.objective.kind {
            ObjectiveKind::IntegratedSensitivity => sensitivity().collect(),
            ObjectiveKind::SensitivityAndPromisedSd => sensitivity().chain(promised).collect(),
            ObjectiveKind::DOptimal => criterion(0),
            ObjectiveKind::AOptimal => criterion(1),
            ObjectiveKind::EOptimal => criterion(2),
            ObjectiveKind::WorstRelativeSd => criterion(3),
            ObjectiveKind::Detect => log_gains(&response.log_detectable, &base.log_detectable),
            ObjectiveKind::TellApart if prior == 0 => Vec::new(),
            ObjectiveKind::TellApart => vec![response.log_separation - base.log_separation],
        }
    }

    /// Weights of [`Self::gains`] within a prior; they sum to one.
    fn weights(&self, prior: usize, count: usize) -> Vec<f64> {
        let objective = &self.study.objective;
        if objective.combine != Combine::Weighted {
            return vec![1.0 / count as f64; count];
        }
        let parameters = self.study.materials[prior].material.shear_parameters();
        let of_parameters: Vec<f64> = parameters.map(|p| objective.weight_of(&p.name())).collect();
        let of_gains: Vec<f64> = of_parameters.iter().copied().cycle().take(count).collect();
        let total: f64 = of_gains.iter().sum();
        of_gains.into_iter().map(|w| w / total).collect()
    }

    /// Guards (of a guarded prior one per μᵢ and αᵢ: ln of base over own standard deviation), force, force that pulls
    /// the plates together, that pushes them apart, stretch.
    fn margins(&self, prior: usize, response: &Response, base: &Response) -> Vec<f64> {
        let limits: &ManufacturingLimits = &self.study.limits;
        let mut margins = Vec::new();
        if self.study.objective.guard_promised_sd.covers(prior) {
            margins.extend(base.log_relative_sd.iter().zip(&response.log_relative_sd).map(|(b, r)| b - r));
        }
        margins.extend(limits.max_force_n.map(|limit| limit.ln() - response.log_force));
        let across = |limit: f64| [1.0, -1.0].map(|sign| 1.0 - sign * response.normal_force_n / limit);
        margins.extend(limits.max_normal_force_n.map(across).into_iter().flatten());
        margins.extend(limits.max_local_stretch.map(|limit| limit.ln() - response.log_stretch));
        margins
    }

    /// Judges an evaluation.
    pub fn judge(&self, evaluated: &Evaluated) -> Judged {
        let num_variables = evaluated.gradients.first().map_or(0, Vec::len);
        let mut judged = Judged {
            gains: Vec::new(),
            weights: Vec::new(),
            margins: Vec::new(),
            worst_margins: Vec::new(),
            gain_gradients: vec![Vec::new(); num_variables],
            margin_gradients: vec![Vec::new(); num_variables],
        };
        // Each prior's gains are averaged over its samples (a design must not bank on one guess of the parameters);
        // limits must hold at each of them.
        let num_priors = self.study.materials.len();
        for prior in 0..num_priors {
            let of_prior: Vec<usize> = (0..self.samples.len()).filter(|&s| self.samples[s].prior == prior).collect();
            let total: f64 = of_prior.iter().map(|&s| self.samples[s].weight).sum();
            let mean = |rows: &dyn Fn(usize) -> Vec<f64>| -> Vec<f64> {
                let mut sum: Vec<f64> = Vec::new();
                for &s in &of_prior {
                    let row = rows(s);
                    sum.resize(row.len(), 0.0);
                    for (a, b) in sum.iter_mut().zip(row) {
                        *a += self.samples[s].weight / total * b;
                    }
                }
                sum
            };
            let gains = mean(&|s| self.gains(prior, &evaluated.responses[s], &self.base[s]));
            let share = if self.study.objective.combine == Combine::Maximin { 1.0 / num_priors as f64 } else { total };
            judged.weights.extend(self.weights(prior, gains.len()).into_iter().map(|w| share * w));
            judged.gains.extend(gains);
            let mut worst: Vec<f64> = Vec::new();
            for &s in &of_prior {
                let mut margins = self.margins(prior, &evaluated.responses[s], &self.base[s]);
                if let Some(shifts) = self.shifts.get(prior) {
                    margins.iter_mut().zip(shifts).for_each(|(m, shift)| *m += shift);
                }
                worst.resize(margins.len(), f64::INFINITY);
                worst.iter_mut().zip(&margins).for_each(|(w, m)| *w = w.min(*m));
                judged.margins.extend(margins);
            }
            judged.worst_margins.push(worst);
            for v in 0..num_variables {
                let like = |s: usize, v: &[f64]| Response::from_vector(v, self.base[s].log_integrated.len());
                let zero = |s: usize| like(s, &vec![0.0; self.base[s].to_vector().len()]);
                let slope = |s: usize| like(s, &evaluated.gradients[s][v]);
                judged.gain_gradients[v].extend(mean(&|s| self.gains(prior, &slope(s), &zero(s))));
                for &s in &of_prior {
                    // The margins are affine in the responses: their slope is the difference from the constant part.
                    let constant = self.margins(prior, &zero(s), &zero(s));
                    let moved = self.margins(prior, &slope(s), &zero(s));
                    judged.margin_gradients[v].extend(moved.iter().zip(constant).map(|(a, b)| a - b));
                }
            }
        }
        judged
    }

    /// Name of a limit of [`Judged::worst_margins`].
    pub fn limit_name(&self, prior: usize, limit: usize) -> String {
        let name = &self.study.materials[prior].name;
        let mut names: Vec<String> = Vec::new();
        if self.study.objective.guard_promised_sd.covers(prior) {
            let guards = self.study.materials[prior].material.shear_parameters().map(|p| p.symbol());
            names.extend(guards.map(|p| format!("the guard on the standard deviation of {p}, material \"{name}\"")));
        }
        names.extend(self.study.limits.max_force_n.map(|_| "the largest force".into()));
        let ways = ["the force that pulls the plates together", "the force that pushes the plates apart"];
        let ways = self.study.limits.max_normal_force_n.map(|_| ways.map(String::from));
        names.extend(ways.into_iter().flatten());
        names.extend(self.study.limits.max_local_stretch.map(|_| "the largest local stretch".into()));
        names.get(limit).cloned().unwrap_or_default()
    }

    /// ln of the objective: the smallest gain or the weighted mean.
    pub fn objective(&self, judged: &Judged) -> f64 {
        combine(self.study.objective.combine, &judged.gains, &judged.weights)
    }

    /// The objective less a penalty on broken limits: what the search compares by.
    pub fn merit(&self, judged: &Judged) -> f64 {
        const PENALTY: f64 = 10.0;
        self.objective(judged) - PENALTY * judged.margins.iter().map(|m| (-m).max(0.0)).sum::<f64>()
    }
}

/// Minimum or weighted mean of ln gains.
pub fn combine(how: Combine, gains: &[f64], weights: &[f64]) -> f64 {
    match how {
        Combine::Maximin => gains.iter().copied().fold(f64::INFINITY, f64::min),
        Combine::GeometricMean | Combine::Weighted => gains.iter().zip(weights).map(|(g, w)| g * w).sum(),
    }
}

#[cfg(test)]
#[path = "objective_tests.rs"]
mod tests;
