//! Newton's method with adaptive load steps.
//!
//! Displacement and pressure are iterated together (see [`super::kernel`]). A step that would invert an element is
//! halved; a load step that does not converge is halved; what cannot be reached is a typed error.

use super::error::{SolveError, StepFailure};
use super::model::{ForwardModel, Statistics};
use crate::material::{MAX_TERMS, Ogden};
use std::sync::atomic::{AtomicU64, Ordering};

/// Settings of [`ForwardModel::solve`].
#[derive(Clone, Copy, Debug)]
pub struct SolveOptions {
    /// Newton stops when |residual| falls below this fraction of |reactions|. Convergence is quadratic: at the default,
    /// 10⁻⁶, forces are good to about that, a hundredth of what any mesh in use leaves. Rounding allows 10⁻¹¹ at
    /// κ/μ = 10³.
    pub tolerance: f64,
    /// Newton iterations per load step.
    pub max_iterations: usize,
    /// Smallest load step as a fraction of the drive asked for.
    pub min_step: f64,
}

impl Default for SolveOptions {
    fn default() -> Self {
        SolveOptions { tolerance: 1e-6, max_iterations: 14, min_step: 1.0 / 64.0 }
    }
}

/// Relative residual below which the factor of an earlier iterate is tried first.
const REUSE_BELOW: f64 = 1e-4;

/// Conjugate-gradient iterations that such a factor is given: they cost as much as a new one.
const REUSE_ITERATIONS: usize = 10;

/// An equilibrium at one drive.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Displacement of each node of the mesh, mm.
    pub displacement: Vec<[f64; 3]>,
    /// Pressure coefficients of each element.
    pub pressure: Vec<[f64; 4]>,
    /// Force along +x on the moved face, N: the whole specimen, times the samples in parallel.
    pub force_n: f64,
    /// Force along +y on the moved face, N, likewise (zero where y is a mirror).
    pub normal_force_n: f64,
    /// |sum of the forces on both faces| / |force|: zero up to the solver's tolerance.
    pub reaction_imbalance: f64,
    /// Which solve of the model made it: its tangent may still be there.
    pub(super) serial: u64,
}

impl ForwardModel {
    /// Solves at one drive (mm), from rest or from `start` (an equilibrium of this mesh at any drive and material).
    ///
    /// # Errors
    /// [`SolveError::Diverged`] with the drive reached and the cause, [`SolveError::Cancelled`],
    /// [`SolveError::TooManyTerms`], [`SolveError::InvalidDrive`].
    pub fn solve(
        &mut self,
        material: &Ogden,
        drive_mm: f64,
        start: Option<&Equilibrium>,
        options: &SolveOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Equilibrium, SolveError> {
        if material.terms.len() > MAX_TERMS {
            return Err(SolveError::TooManyTerms { num_terms: material.terms.len(), limit: MAX_TERMS });
        }
        if !drive_mm.is_finite() {
            return Err(SolveError::InvalidDrive { drive_mm });
        }
        self.statistics = Statistics::default();
        if start.is_none_or(|s| s.drive_mm != drive_mm)
            && self.is_nominal
            && let Some(found) = self.solve_guided(material, drive_mm, options, is_cancelled)
        {
            return Ok(found);
        }
        let mut current = match start {
            Some(e) => e.clone(),
            None => Equilibrium {
                drive_mm: 0.0,
                displacement: vec![[0.0; 3]; self.mesh.nodes.len()],
                pressure: vec![[0.0; 4]; self.mesh.num_elements()],
                force_n: 0.0,
                normal_force_n: 0.0,
                reaction_imbalance: 0.0,
                serial: 0,
            },
        };
        let mut previous: Option<Equilibrium> = None;
        let mut step = self.first_step_mm.min((drive_mm - current.drive_mm).abs());
        let smallest = options.min_step * drive_mm.abs().max(1e-9);
        loop {
            if is_cancelled() {
                return Err(SolveError::Cancelled { reached_mm: current.drive_mm });
            }
            let left = drive_mm - current.drive_mm;
            let is_last = left.abs() <= step * (1.0 + 1e-9);
            let target = if is_last { drive_mm } else { current.drive_mm + step * left.signum() };
            let before = self.statistics.newton_iterations;
            match self.step(material, &current, previous.as_ref(), target, options, is_cancelled) {
                Ok(next) => {
                    self.statistics.load_steps += 1;
                    if is_last {
                        return Ok(next);
                    }
                    if self.statistics.newton_iterations - before <= 6 {
                        step *= 1.5;
                    }
                    previous = Some(std::mem::replace(&mut current, next));
                }
                Err(cause) => {
                    if is_cancelled() {
                        return Err(SolveError::Cancelled { reached_mm: current.drive_mm });
                    }
                    self.statistics.failed_steps += 1;
                    step = 0.5 * (target - current.drive_mm).abs();
                    if step < smallest {
                        return Err(SolveError::Diverged { reached_mm: current.drive_mm, asked_mm: drive_mm, cause });
                    }
                }
            }
        }
    }

    /// From the coarse model's equilibrium; `None` where there is no coarse model or the short cut fails.
    fn solve_guided(
        &mut self,
        material: &Ogden,
        drive_mm: f64,
        options: &SolveOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Option<Equilibrium> {
        let mut guide = self.guide.take()?;
        // A loose coarse solution is enough: its error is the mesh's.
        let loose = SolveOptions { tolerance: 1e-4, ..*options };
        let found = guide.coarse.solve(material, drive_mm, None, &loose, is_cancelled).ok().and_then(|coarse| {
            let first_guess = guide.transfer(self, material, &coarse);
            self.step(material, &first_guess, None, drive_mm, options, is_cancelled).ok()
        });
        self.guide = Some(guide);
        match &found {
            Some(_) => self.statistics.load_steps += 1,
            None => self.statistics.failed_steps += 1,
        }
        found
    }

    /// Solves at several drives, each from the last.
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub fn solve_path(
        &mut self,
        material: &Ogden,
        drives_mm: &[f64],
        options: &SolveOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Vec<Equilibrium>, SolveError> {
        let mut path: Vec<Equilibrium> = Vec::with_capacity(drives_mm.len());
        for &drive in drives_mm {
            let next = self.solve(material, drive, path.last(), options, is_cancelled)?;
            path.push(next);
        }
        Ok(path)
    }

    /// One load step.
    fn step(
        &mut self,
        material: &Ogden,
        from: &Equilibrium,
        previous: Option<&Equilibrium>,
        drive_mm: f64,
        options: &SolveOptions,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Equilibrium, StepFailure> {
        let mut trial = from.clone();
        trial.drive_mm = drive_mm;
        let increment = drive_mm - from.drive_mm;
        match previous {
            // Linear extrapolation along the path.
            Some(p) if (from.drive_mm - p.drive_mm).abs() > 0.0 => {
                let r = increment / (from.drive_mm - p.drive_mm);
                for (x, (a, b)) in trial.displacement.iter_mut().zip(from.displacement.iter().zip(&p.displacement)) {
                    for i in 0..3 {
                        x[i] = a[i] + r * (a[i] - b[i]);
                    }
                }
                for (x, (a, b)) in trial.pressure.iter_mut().zip(from.pressure.iter().zip(&p.pressure)) {
                    for i in 0..4 {
                        x[i] = a[i] + r * (a[i] - b[i]);
                    }
                }
            }
            _ => {
                for (x, lift) in trial.displacement.iter_mut().zip(&self.lift) {
                    x[0] += increment * lift;
                }
            }
        }
        for (v, x) in trial.displacement.iter_mut().enumerate() {
            if self.is_held[v] {
                *x = self.imposed(v, drive_mm);
            }
        }
        let mut residual = vec![[0.0; 3]; self.mesh.nodes.len()];
        let mut update: Option<Update> = None;
        let mut worst = f64::INFINITY;
        let mut last = f64::INFINITY;
        let mut iteration = 0;
        loop {
            if is_cancelled() {
                return Err(StepFailure::NotConverged { iterations: iteration, residual: last });
            }
            if let Err(failure) =
                self.assemble_tangent(material, drive_mm, &trial.displacement, Some(&trial.pressure), &mut residual)
            {
                // The step inverts an element: take half of it, or give up.
                match &mut update {
                    Some(u) if u.length > 0.1 => {
                        u.length *= 0.5;
                        u.apply(&mut trial);
                        continue;
                    }
                    _ => return Err(failure),
                }
            }
            let right = self.collect(&residual, -1.0);
            last = norm(&right) / self.reaction_scale(material, &residual);
            if last < options.tolerance {
                return Ok(self.finish(trial, &residual));
            }
            // A residual that grows past every earlier one by far is not coming back.
            if !last.is_finite() || iteration >= options.max_iterations || (iteration > 3 && last > 1e3 * worst) {
                return Err(StepFailure::NotConverged { iterations: iteration, residual: last });
            }
            worst = worst.min(last);
            iteration += 1;
            self.statistics.newton_iterations += 1;
            // Near the solution the factor of an earlier iterate is as good a preconditioner as a new one is, and cheaper.
            let is_near = iteration > 1 && last < REUSE_BELOW;
            let mut x = None;
            if is_near {
                let accuracy = (0.3 * options.tolerance / last).clamp(1e-7, 1e-2);
                let right = std::slice::from_ref(&right);
                x = self.system.iterate(&self.topology, right, accuracy, REUSE_ITERATIONS).ok().flatten();
            }
            let x = match x {
                Some(x) => x,
                None => {
                    self.system.factorise(&self.topology).map_err(StepFailure::Linear)?;
                    // Quadratic convergence leaves last² at best: the linear solve need not be better than a tenth of it.
                    let accuracy = (0.1 * last).clamp(1e-9, 1e-3);
                    self.system.solve(&self.topology, &[right], accuracy).map_err(StepFailure::Linear)?
                }
            };
            let delta = self.spread(&x[0]);
            let delta_pressure = self.pressure_update(&delta);
            let next = Update { from: trial.clone(), delta, delta_pressure, length: 1.0 };
            next.apply(&mut trial);
            update = Some(next);
        }
    }

    /// What a residual is measured against: the forces on the plates, or, near rest, μ × 1 mm².
    fn reaction_scale(&self, material: &Ogden, residual: &[[f64; 3]]) -> f64 {
        let mu = material.terms.iter().map(|t| 0.5 * t.mu_kpa * t.alpha).sum::<f64>().abs().max(1e-12);
        let mut s = 0.0;
        for v in self.mesh.moved_nodes.iter().chain(&self.mesh.fixed_nodes) {
            if !self.is_released[*v as usize] {
                s += residual[*v as usize].iter().map(|x| x * x).sum::<f64>();
            }
        }
        // Released nodes pass their forces on through the springs.
        s += self.spring_forces.iter().flat_map(|f| f.1).map(|x| x * x).sum::<f64>();
        s.sqrt().max(mu)
    }

    pub(super) fn finish(&mut self, mut state: Equilibrium, residual: &[[f64; 3]]) -> Equilibrium {
        let mut moved = self.reaction(residual);
        let mut fixed = [0.0; 3];
        for &v in &self.mesh.fixed_nodes {
            for i in 0..3 {
                fixed[i] += residual[v as usize][i];
            }
        }
        // What the sample pulls with, not what balances it.
        for (v, force) in &self.spring_forces {
            let sum = if self.is_moved[*v as usize] { &mut moved } else { &mut fixed };
            for i in 0..3 {
                sum[i] -= force[i];
            }
        }
        // kPa·mm² = 10⁻³ N.
        state.force_n = moved[0] * self.multiplicity * 1e-3;
        state.normal_force_n = if self.mesh.mirror.y { 0.0 } else { moved[1] * self.multiplicity * 1e-3 };
        state.serial = next_serial();
        self.tangent_at = state.serial;
        state.reaction_imbalance = (moved[0] + fixed[0]).abs() / moved[0].abs().max(1e-12);
        state
    }
}

/// A number that no other equilibrium of this process has.
fn next_serial() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// A Newton step that can be shortened.
struct Update {
    from: Equilibrium,
    delta: Vec<[f64; 3]>,
    delta_pressure: Vec<[f64; 4]>,
    length: f64,
}

impl Update {
    fn apply(&self, trial: &mut Equilibrium) {
        for (x, (u, d)) in trial.displacement.iter_mut().zip(self.from.displacement.iter().zip(&self.delta)) {
            for i in 0..3 {
                x[i] = u[i] + self.length * d[i];
            }
        }
        for (x, (p, d)) in trial.pressure.iter_mut().zip(self.from.pressure.iter().zip(&self.delta_pressure)) {
            for i in 0..4 {
                x[i] = p[i] + self.length * d[i];
            }
        }
    }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}
