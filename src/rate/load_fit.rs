//! Fits of one set of physics to load curves.

use super::force_history::limits_of;
use super::load_curve::LoadCurve;
use super::model::{Layout, Physics, Prepared, model};
use super::starts::time_range;
use crate::homogeneous::incompressible_stress;
use crate::optimise::{Evaluation, LeastSquaresOptions, LinearLimit, minimise};
use nalgebra::{DMatrix, DVector};

/// Relaxation times that are tried for a new relaxation.
const NUM_TIMES: usize = 9;
/// Exponents that are tried for a new term.
const NEW_EXPONENTS: [f64; 9] = [-10.0, -6.0, -3.5, -1.5, 1.2, 3.5, 6.0, 9.0, 14.0];
/// Gains of load cells and errors of areas that a test house would not notice; beyond them another cause is at work.
const GAIN_RANGE: [f64; 2] = [0.8, 1.25];
/// A new term starts with this part of the stress.
const NEW_PART: f64 = 0.02;

/// A fitted model.
#[derive(Clone, Debug)]
pub(crate) struct LoadCurveFit {
    pub(crate) layout: Layout,
    pub(crate) x: Vec<f64>,
    /// (model − data) / weight over the fitted samples, curve after curve.
    pub(crate) residual: DVector<f64>,
    pub(crate) jacobian: DMatrix<f64>,
    pub(crate) sum_of_squares: f64,
}

/// The curves with what the fits share.
pub(crate) struct LoadCurveProblem<'a> {
    pub(crate) curves: &'a [LoadCurve],
    pub(crate) prepared: Vec<Prepared>,
    /// What residuals are divided by, kPa.
    pub(crate) weight_kpa: f64,
    pub(crate) alpha_range: [f64; 2],
    pub(crate) min_alpha_gap: f64,
}

impl LoadCurveProblem<'_> {
    /// LoadCurveFit samples of all curves.
    pub(crate) fn num_data(&self) -> usize {
        self.curves.iter().map(LoadCurve::fitted).sum()
    }

    /// Residuals split by curve.
    pub(crate) fn by_curve<'r>(&self, residual: &'r DVector<f64>) -> Vec<&'r [f64]> {
        let mut rest = residual.as_slice();
        self.curves
            .iter()
            .map(|c| {
                let (own, after) = rest.split_at(c.fitted());
                rest = after;
                own
            })
            .collect()
    }

    /// Modelled stress of every sample of every curve, kPa.
    pub(crate) fn stresses(&self, fitted: &LoadCurveFit) -> Vec<Vec<f64>> {
        self.prepared.iter().map(|p| model(&fitted.layout, &fitted.x, p).stress_kpa).collect()
    }

    fn evaluate(&self, layout: &Layout, x: &[f64]) -> Option<Evaluation> {
        let mut residual = DVector::zeros(self.num_data());
        let mut jacobian = DMatrix::zeros(self.num_data(), x.len());
        let mut row = 0;
        for (curve, prepared) in self.curves.iter().zip(&self.prepared) {
            if curve.fitted() == 0 {
                continue;
            }
            let found = model(layout, x, prepared);
            for i in 0..curve.fitted() {
                residual[row] = (found.stress_kpa[i] - curve.nominal_stress_kpa[i]) / self.weight_kpa;
                for (u, list) in found.by_unknown.iter().enumerate() {
                    jacobian[(row, u)] = list[i] / self.weight_kpa;
                }
                row += 1;
            }
        }
        residual.iter().all(|r| r.is_finite()).then_some((residual, jacobian))
    }

    /// Longest list of times among the fitted curves with times.
    pub(crate) fn times(&self) -> Option<&[f64]> {
        let timed = self.prepared.iter().zip(self.curves).filter(|(p, c)| c.fitted() > 0 && !p.time_s.is_empty());
        timed.map(|(p, _)| p.time_s.as_slice()).max_by(|a, b| span(a).total_cmp(&span(b)))
    }

    /// Shortest sampling interval and longest duration over the fitted curves, as a list that [`limits_of`]
    /// understands.
    fn clock(&self) -> Vec<f64> {
        let ranges: Vec<[f64; 2]> = self
            .prepared
            .iter()
            .zip(self.curves)
            .filter(|(p, c)| c.fitted() > 0 && !p.time_s.is_empty())
            .map(|(p, _)| time_range(&p.time_s))
            .collect();
        let shortest = ranges.iter().map(|r| r[0]).fold(f64::INFINITY, f64::min);
        let longest = ranges.iter().map(|r| r[1]).fold(0.0, f64::max);
        if longest > 0.0 { vec![0.0, shortest, 2.0 * shortest, longest.max(3.0 * shortest)] } else { vec![0.0, 1.0] }
    }

    /// Largest energy density of a model's elastic part over the fitted samples: the scale of softening's m.
    fn energy_scale(&self, layout: &Layout, x: &[f64]) -> f64 {
        let terms = layout.terms(x);
        let states = self.curves.iter().filter(|c| c.fitted() > 0);
        states
            .flat_map(|c| c.drive[..c.fitted()].iter().map(|&d| c.test.at(d)))
            .map(|s| super::channels::channels(&terms, &s).energy)
            .fold(1e-12, f64::max)
    }

    /// Levenberg–Marquardt from the best of several starts.
    pub(crate) fn fit(&self, layout: &Layout, starts: &[Vec<f64>]) -> Option<LoadCurveFit> {
        let p = layout.physics;
        let mut best: Option<LoadCurveFit> = None;
        for start in starts {
            let mut limits = Vec::new();
            for i in 0..layout.signs.len() {
                limits.push(LinearLimit::at_least(2 * i + 1, self.alpha_range[0]));
                limits.push(LinearLimit::at_most(2 * i + 1, self.alpha_range[1]));
                if i > 0 {
                    let coefficients = vec![(2 * i + 1, 1.0), (2 * i - 1, -1.0)];
                    limits.push(LinearLimit { coefficients, bound: -self.min_alpha_gap });
                }
            }
            limits.extend(limits_of(p.num_relaxations, layout.relaxations(), &self.clock()));
            let mut steps = vec![1.0; layout.num_unknowns()];
            if p.has_softening {
                let s = layout.softening();
                let scale = self.energy_scale(layout, start);
                limits.extend([LinearLimit::at_least(s, 0.0), LinearLimit::at_most(s, 0.999)]);
                limits.extend([
                    LinearLimit::at_least(s + 1, (1e-4 * scale).ln()),
                    LinearLimit::at_most(s + 1, (1e2 * scale).ln()),
                ]);
                limits.extend([LinearLimit::at_least(s + 2, 0.0), LinearLimit::at_most(s + 2, 5.0)]);
                steps[s] = 0.3;
            }
            if p.has_barrelling {
                limits.extend([
                    LinearLimit::at_least(layout.barrelling(), 0.0),
                    LinearLimit::at_most(layout.barrelling(), 10.0),
                ]);
            }
            if p.has_friction {
                limits.push(LinearLimit::at_least(layout.friction(), 0.0));
                steps[layout.friction()] = 10.0 * self.weight_kpa.max(1.0);
            }
            if p.has_offset {
                steps[layout.offset()] = f64::MAX.sqrt();
            }
            for g in layout.gains()..layout.num_unknowns() {
                limits.extend([LinearLimit::at_least(g, GAIN_RANGE[0]), LinearLimit::at_most(g, GAIN_RANGE[1])]);
            }
            let settings = LeastSquaresOptions { max_evaluations: 120, tolerance: 1e-8 };
            let found = minimise(start, &limits, &steps, &settings, &mut |x| self.evaluate(layout, x));
            if let Some(m) = found
                && best.as_ref().is_none_or(|b| m.sum_of_squares < b.sum_of_squares)
            {
                best = Some(LoadCurveFit {
                    layout: layout.clone(),
                    x: m.parameters,
                    residual: m.residual,
                    jacobian: m.jacobian,
                    sum_of_squares: m.sum_of_squares,
                });
            }
        }
        best
    }

    /// The fit with one more relaxation, from the times where a linear step gains most.
    pub(crate) fn with_relaxation(&self, from: &LoadCurveFit) -> Option<LoadCurveFit> {
        if from.layout.physics.num_relaxations > 0 {
            return self.with_relaxation_as(from, from.layout.physics.is_nominal);
        }
        // The first relaxation chooses what is convolved.
        let found = [false, true].map(|is_nominal| self.with_relaxation_as(from, is_nominal));
        found.into_iter().flatten().min_by(|a, b| a.sum_of_squares.total_cmp(&b.sum_of_squares))
    }

    fn with_relaxation_as(&self, from: &LoadCurveFit, is_nominal: bool) -> Option<LoadCurveFit> {
        self.times()?;
        let [low, high] = time_range(&self.clock());
        let physics =
            Physics { num_relaxations: from.layout.physics.num_relaxations + 1, is_nominal, ..from.layout.physics };
        let layout = Layout { physics, ..from.layout.clone() };
        let mut ranked: Vec<(f64, Vec<f64>)> = Vec::new();
        for i in 0..NUM_TIMES {
            let part = i as f64 / (NUM_TIMES - 1) as f64;
            let ln_tau = low.ln() + part * ((2.0 * high).ln() - low.ln());
            let first = from.layout.relaxations();
            let before =
                (0..from.layout.physics.num_relaxations).filter(|r| from.x[first + 2 * r + 1] < ln_tau).count();
            // Next to a time that is there already the two would be one.
            if (0..from.layout.physics.num_relaxations)
                .any(|r| (from.x[first + 2 * r + 1] - ln_tau).abs() < 2.0 * super::force_history::MIN_TIME_RATIO.ln())
            {
                continue;
            }
            let mut x = from.x.clone();
            let at = first + 2 * before;
            x.splice(at..at, [0.0, ln_tau]);
            if let Some(strength) = self.linear_gain(&layout, &x, at) {
                x[at] = strength.1.clamp(0.02, 2.0);
                ranked.push((strength.0, x));
            }
        }
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let starts: Vec<Vec<f64>> = ranked.into_iter().take(3).map(|(_, x)| x).collect();
        self.fit(&layout, &starts)
    }

    /// What a linear step in all unknowns with unknown `at` free from zero takes off the sum of squares, and where it
    /// takes that unknown.
    fn linear_gain(&self, layout: &Layout, x: &[f64], at: usize) -> Option<(f64, f64)> {
        let (r, j) = self.evaluate(layout, x)?;
        // Columns without effect (a time of zero strength) are left out.
        let used: Vec<usize> = (0..x.len()).filter(|&u| j.column(u).norm() > 1e-12).collect();
        let place = used.iter().position(|&u| u == at)?;
        let columns: Vec<DVector<f64>> = used.iter().map(|&u| j.column(u) / j.column(u).norm()).collect();
        let matrix = DMatrix::from_columns(&columns);
        let gram = matrix.transpose() * &matrix + DMatrix::from_diagonal_element(used.len(), used.len(), 1e-10);
        let right = -(matrix.transpose() * &r);
        let step = gram.cholesky()?.solve(&right);
        let value = step[place] / j.column(at).norm();
        (value > 0.0).then_some((right.dot(&step), value))
    }

    /// The fit with softening.
    pub(crate) fn with_softening(&self, from: &LoadCurveFit) -> Option<LoadCurveFit> {
        let physics = Physics { has_softening: true, ..from.layout.physics };
        let layout = Layout { physics, ..from.layout.clone() };
        let scale = self.energy_scale(&from.layout, &from.x);
        let starts: Vec<Vec<f64>> = [0.05, 0.4]
            .iter()
            .map(|m| {
                let mut x = from.x.clone();
                let at = layout.softening();
                x.splice(at..at, [0.3, (m * scale).ln(), 0.05]);
                x
            })
            .collect();
        self.fit(&layout, &starts)
    }

    /// The fit with one more term.
    pub(crate) fn with_term(&self, from: &LoadCurveFit) -> Option<LoadCurveFit> {
        let num = from.layout.signs.len();
        let mut signs = from.layout.signs.clone();
        signs.push(1.0);
        let layout = Layout { signs, ..from.layout.clone() };
        let mut ranked: Vec<(f64, Vec<f64>)> = Vec::new();
        for alpha in NEW_EXPONENTS {
            let is_near = (0..num).any(|i| (from.x[2 * i + 1] - alpha).abs() < self.min_alpha_gap * 1.05);
            if is_near || alpha < self.alpha_range[0] || alpha > self.alpha_range[1] {
                continue;
            }
            let before = (0..num).filter(|&i| from.x[2 * i + 1] > alpha).count();
            // The modulus that gives the new term its part of the stress.
            let unit = crate::homogeneous::ShearTerm { modulus_kpa: 1.0, alpha };
            let largest = self
                .curves
                .iter()
                .filter(|c| c.fitted() > 0)
                .flat_map(|c| {
                    c.drive[..c.fitted()].iter().map(|&d| incompressible_stress(&[unit], &c.test.at(d)).abs())
                })
                .fold(1e-300, f64::max);
            let scale =
                self.curves.iter().flat_map(|c| c.nominal_stress_kpa.iter()).fold(0.0f64, |a, s| a.max(s.abs()));
            let mut x = from.x.clone();
            let at = 2 * before;
            x.splice(at..at, [(NEW_PART * scale / largest).ln(), alpha]);
            if let Some((gain, _)) = self.linear_gain(&layout, &x, at) {
                ranked.push((gain, x));
            }
        }
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let starts: Vec<Vec<f64>> = ranked.into_iter().take(2).map(|(_, x)| x).collect();
        self.fit(&layout, &starts)
    }

    /// The fit with one more linear part: `switch` turns it on, `place` is where its unknowns go, `values` their
    /// nominal values.
    pub(crate) fn with_part(
        &self,
        from: &LoadCurveFit,
        switch: impl Fn(&mut Physics),
        place: impl Fn(&Layout) -> usize,
        values: &[f64],
    ) -> Option<LoadCurveFit> {
        let mut layout = from.layout.clone();
        switch(&mut layout.physics);
        let mut x = from.x.clone();
        let at = place(&layout);
        x.splice(at..at, values.iter().copied());
        self.fit(&layout, &[x])
    }
}

fn span(times: &[f64]) -> f64 {
    times.last().copied().unwrap_or(0.0) - times.first().copied().unwrap_or(0.0)
}
