//! From responses to the objective and the response limits, all as logarithms of ratios: 0 is the base specimen, or a limit
//! just met; larger is better.

use super::response::{Evaluated, MaterialSample, Response};
use super::study::{Combine, ObjectiveKind, Study};
use crate::sensitivity::IDENTIFIABILITY_LIMIT;
use crate::specimen::ManufacturingLimits;

/// The base specimen's responses, against which gains are counted.
pub struct Reference<'a> {
    study: &'a Study,
    samples: &'a [MaterialSample],
    base: Vec<Response>,
}

/// Gains and limits of one design, with gradients where the evaluation has them.
#[derive(Clone, Debug)]
pub struct Judged {
    /// ln gain of each component, with its weight; the objective is their minimum or weighted mean.
    pub gains: Vec<f64>,
    /// Weights of the gains; they sum to one.
    pub weights: Vec<f64>,
    /// Margins that must not be negative: guards, force, stretch.
    pub margins: Vec<f64>,
    /// `[variable][gain]`, per mm.
    pub gain_gradients: Vec<Vec<f64>>,
    /// `[variable][margin]`, per mm.
    pub margin_gradients: Vec<Vec<f64>>,
}

impl<'a> Reference<'a> {
    /// Counts from `base`, the base specimen's evaluation.
    pub fn new(study: &'a Study, samples: &'a [MaterialSample], base: &Evaluated) -> Reference<'a> {
        Reference { study, samples, base: base.responses.clone() }
    }

    /// ln gains of one response.
    fn gains(&self, response: &Response, base: &Response) -> Vec<f64> {
        let criterion = |i: usize| vec![base.log_criteria[i] - response.log_criteria[i]];
        match self.study.objective.kind {
            ObjectiveKind::IntegratedSensitivity => {
                response.log_integrated.iter().zip(&base.log_integrated).map(|(a, b)| a - b).collect()
            }
            ObjectiveKind::DOptimal => criterion(0),
            ObjectiveKind::AOptimal => criterion(1),
            ObjectiveKind::EOptimal => criterion(2),
            ObjectiveKind::WorstRelativeSd => criterion(3),
        }
    }

    /// `allowances[i]` is the ln of the factor by which the i-th relative standard deviation may exceed the base's.
    fn margins(&self, response: &Response, base: &Response, allowances: &[f64]) -> Vec<f64> {
        let limits: &ManufacturingLimits = &self.study.limits;
        let mut margins = Vec::new();
        for ((b, r), allowance) in base.log_relative_sd.iter().zip(&response.log_relative_sd).zip(allowances) {
            if allowance.is_finite() {
                margins.push(b + allowance - r);
            }
        }
        margins.extend(limits.max_force_n.map(|limit| limit.ln() - response.log_force));
        margins.extend(limits.max_local_stretch.map(|limit| limit.ln() - response.log_stretch));
        margins
    }

    /// The guard: for the first material no standard deviation may grow; for the others, whatever the base shows must
    /// stay visible, with 3 % kept for the difference between search and confirmation. +∞ where nothing is asked.
    fn allowances(&self, prior: usize) -> Vec<f64> {
        let central = self.samples.iter().position(|s| s.prior == prior).map(|s| &self.base[s]);
        let Some(central) = central else { return Vec::new() };
        let of = |log_relative_sd: &f64| {
            if !self.study.objective.guard_promised_sd {
                f64::INFINITY
            } else if prior == 0 {
                0.0
            } else {
                let room = (0.97 * IDENTIFIABILITY_LIMIT).ln() - log_relative_sd;
                if *log_relative_sd <= IDENTIFIABILITY_LIMIT.ln() { room.max(0.0) } else { f64::INFINITY }
            }
        };
        central.log_relative_sd.iter().map(of).collect()
    }

    /// Judges an evaluation.
    pub fn judge(&self, evaluated: &Evaluated) -> Judged {
        let mut judged = Judged {
            gains: Vec::new(),
            weights: Vec::new(),
            margins: Vec::new(),
            gain_gradients: Vec::new(),
            margin_gradients: Vec::new(),
        };
        let is_averaged = self.study.objective.combine == Combine::GeometricMean;
        // Each prior's samples are averaged: a design must not bank on one guess of the parameters.
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
            let allowances = self.allowances(prior);
            let gains = mean(&|s| self.gains(&evaluated.responses[s], &self.base[s]));
            let share = if is_averaged { total } else { 1.0 / num_priors as f64 };
            judged.weights.extend(std::iter::repeat_n(share / gains.len() as f64, gains.len()));
            judged.gains.extend(gains);
            judged.margins.extend(mean(&|s| self.margins(&evaluated.responses[s], &self.base[s], &allowances)));
            if let Some(first) = evaluated.gradients.first() {
                judged.gain_gradients.resize(first.len(), Vec::new());
                judged.margin_gradients.resize(first.len(), Vec::new());
                for v in 0..first.len() {
                    let zero = |s: usize| Response::from_vector(&vec![0.0; self.base[s].to_vector().len()]);
                    let slope = |s: usize| Response::from_vector(&evaluated.gradients[s][v]);
                    judged.gain_gradients[v].extend(mean(&|s| self.gains(&slope(s), &zero(s))));
                    // The margins are affine in the responses: their slope is the difference from the constant part.
                    judged.margin_gradients[v].extend(mean(&|s| {
                        let constant = self.margins(&zero(s), &zero(s), &allowances);
                        self.margins(&slope(s), &zero(s), &allowances)
                            .iter()
                            .zip(constant)
                            .map(|(a, b)| a - b)
                            .collect()
                    }));
                }
            }
        }
        judged
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
        Combine::GeometricMean => gains.iter().zip(weights).map(|(g, w)| g * w).sum(),
    }
}
