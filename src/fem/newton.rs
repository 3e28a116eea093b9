//! Newton's method with adaptive load steps.
//!
//! Displacement and pressure are iterated together (see [`super::kernel`]). A step that would invert an element is
//! halved; a load step that does not converge is halved; what cannot be reached is a typed error.

use super::assembler::Assembler;
use super::condensation::pressure_update;
use super::equilibrium::{Equilibrium, Serial};
use super::error::{SolveError, StepFailure};
use super::linearisation::Linearisation;
use super::options::{SolveOptions, Statistics};
use crate::material::Material;

/// Relative residual below which the factor of an earlier iterate is tried first: the tangent changes by about as much.
const REUSE_BELOW: f64 = 0.1;

/// Relative residual from which a Newton step reaches the tolerance.
const LAST_STEP_BELOW: f64 = 1e-4;

/// The loosest that a step is solved: it is then shorter or longer than it should be by a hundredth.
const LOOSE_STEP: f64 = 1e-2;

/// Relative residual below which the tangent at hand is kept for the steps that follow (the chord method): it hardly
/// changes any more, and an element's residual takes a third of the time of both.
pub(super) const KEEP_TANGENT_BELOW: f64 = 1e-2;

/// A step with a kept tangent must bring the residual down to this part of what it was; else a new one is assembled.
const KEPT_TANGENT_GAINS: f64 = 0.1;

/// With a kept tangent convergence is linear, and the last residual no better than what was asked for. It is brought to
/// this part of the tolerance, so that equilibria are as good as by Newton's steps.
const KEPT_TANGENT_TOLERANCE: f64 = 0.1;

/// A run of Newton's method on one mesh with one material.
pub(super) struct Newton<'a> {
    /// The mesh and its departures.
    pub(super) assembler: &'a Assembler,
    /// Where residuals and tangents are assembled; after a success it stands at the equilibrium found.
    pub(super) linearisation: &'a mut Linearisation,
    /// The material.
    pub(super) material: &'a Material,
    /// Settings.
    pub(super) options: &'a SolveOptions,
    /// Asked before every load step and iteration.
    pub(super) is_cancelled: &'a (dyn Fn() -> bool + Sync),
    /// What the run has taken so far.
    pub(super) statistics: Statistics,
}

impl Newton<'_> {
    /// Solves at one drive (mm) in load steps, from rest or from `start`.
    ///
    /// # Errors
    /// [`SolveError::Diverged`], [`SolveError::NotPrecompressed`], [`SolveError::Cancelled`].
    pub(super) fn solve(&mut self, drive_mm: f64, start: Option<&Equilibrium>) -> Result<Equilibrium, SolveError> {
        let mut current = match start {
            Some(e) => e.clone(),
            None => self.before_drive()?,
        };
        // The equilibria before the present one, the latest first, and of how many the next is guessed.
        let (mut before, mut num_before) = (Vec::new(), 1);
        let mut step = self.assembler.plates().first_step_mm.min((drive_mm - current.drive_mm).abs());
        let smallest = self.options.min_step * drive_mm.abs().max(1e-9);
        loop {
            if (self.is_cancelled)() {
                return Err(SolveError::Cancelled { reached_mm: current.drive_mm });
            }
            let left = drive_mm - current.drive_mm;
            let is_last = left.abs() <= step * (1.0 + 1e-9);
            let target = if is_last { drive_mm } else { current.drive_mm + step * left.signum() };
            let iterations = self.statistics.newton_iterations;
            match self.step(&current, &before, target) {
                Ok(next) => {
                    self.statistics.load_steps += 1;
                    if is_last {
                        return Ok(next);
                    }
                    if self.statistics.newton_iterations - iterations <= 6 {
                        step *= 1.5;
                    }
                    before.insert(0, std::mem::replace(&mut current, next));
                    before.truncate(num_before);
                }
                Err(cause) => {
                    if (self.is_cancelled)() {
                        return Err(SolveError::Cancelled { reached_mm: current.drive_mm });
                    }
                    self.statistics.failed_steps += 1;
                    // The path bends.
                    num_before = 2;
                    step = 0.5 * (target - current.drive_mm).abs();
                    if step < smallest {
                        return Err(SolveError::Diverged { reached_mm: current.drive_mm, asked_mm: drive_mm, cause });
                    }
                }
            }
        }
    }

    /// The equilibrium from which the sample is driven: rest, or what brings the moved plate to where it is before any
    /// drive, in steps.
    ///
    /// # Errors
    /// [`SolveError::NotPrecompressed`], [`SolveError::Cancelled`].
    fn before_drive(&mut self) -> Result<Equilibrium, SolveError> {
        let mesh = self.assembler.mesh();
        let asked_mm = self.assembler.plates().precompression_mm();
        if !(asked_mm.abs() > 0.0) {
            return Ok(Equilibrium::at_rest(mesh.nodes.len(), mesh.num_elements()));
        }
        let pressing = self.assembler.pressing();
        match self.elsewhere(&pressing, |newton| newton.solve(asked_mm, None)) {
            Ok(pressed) => Ok(Equilibrium { drive_mm: 0.0, ..pressed }),
            Err(SolveError::Diverged { reached_mm, asked_mm, cause }) => {
                Err(SolveError::NotPrecompressed { reached_mm, asked_mm, cause })
            }
            Err(SolveError::Cancelled { .. }) => Err(SolveError::Cancelled { reached_mm: 0.0 }),
            Err(other) => Err(other),
        }
    }

    /// What `run` gives with another assembler of the same mesh; what it takes counts here.
    fn elsewhere<T>(&mut self, assembler: &Assembler, run: impl FnOnce(&mut Newton) -> T) -> T {
        let mut newton = Newton {
            assembler,
            linearisation: &mut *self.linearisation,
            material: self.material,
            options: self.options,
            is_cancelled: self.is_cancelled,
            statistics: std::mem::take(&mut self.statistics),
        };
        let out = run(&mut newton);
        self.statistics = newton.statistics;
        out
    }

    /// One load step from `from` to a drive (mm); `before` are equilibria before `from`, the latest first.
    ///
    /// # Errors
    /// [`StepFailure`].
    pub(super) fn step(
        &mut self,
        from: &Equilibrium,
        before: &[Equilibrium],
        drive_mm: f64,
    ) -> Result<Equilibrium, StepFailure> {
        let mut trial = self.first_guess(from, before, drive_mm);
        let mut update: Option<Update> = None;
        let mut worst = f64::INFINITY;
        let mut last = f64::INFINITY;
        let mut iteration = 0;
        let mut keeps_tangent = false;
        loop {
            if (self.is_cancelled)() {
                return Err(StepFailure::NotConverged { iterations: iteration, residual: last });
            }
            let evaluated = match keeps_tangent {
                true => self.assembler.evaluate(self.material, &trial, self.linearisation),
                false => self.assembler.linearise(self.material, &trial, self.linearisation),
            };
            if let Err(failure) = evaluated {
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
            let right = self.assembler.collect(&self.linearisation.residual, -1.0);
            let before = std::mem::replace(&mut last, norm(&right) / self.reaction_scale());
            let part = if keeps_tangent { KEPT_TANGENT_TOLERANCE } else { 1.0 };
            if last < part * self.options.tolerance {
                return Ok(finished(self.assembler, self.linearisation, trial));
            }
            if keeps_tangent && !(last < KEPT_TANGENT_GAINS * before) {
                keeps_tangent = false;
                continue;
            }
            // A residual that grows past every earlier one by far is not coming back.
            if !last.is_finite() || iteration >= self.options.max_iterations || (iteration > 3 && last > 1e3 * worst) {
                return Err(StepFailure::NotConverged { iterations: iteration, residual: last });
            }
            worst = worst.min(last);
            iteration += 1;
            self.statistics.newton_iterations += 1;
            // Near the solution the factor of an earlier iterate is as good a preconditioner as a new one is, and
            // cheaper.
            let is_near = keeps_tangent || iteration > 1 && last < REUSE_BELOW;
            let delta = self.assembler.spread(&self.newton_step(right, last, is_near)?);
            keeps_tangent = last < KEEP_TANGENT_BELOW;
            let delta_pressure = pressure_update(self.assembler.mesh(), &self.linearisation.condensation, &delta);
            let next = Update { from: trial.clone(), delta, delta_pressure, length: 1.0 };
            next.apply(&mut trial);
            update = Some(next);
        }
    }

    /// The state at a drive to which the line through `from` and the equilibrium `before` it leads, or the parabola
    /// through the two before it, with what the plates still lack carried into the sample.
    fn first_guess(&self, from: &Equilibrium, before: &[Equilibrium], drive_mm: f64) -> Equilibrium {
        let mut trial = from.clone();
        trial.drive_mm = drive_mm;
        match before {
            [] => {}
            [p] => trial.add_difference((drive_mm - from.drive_mm) / (from.drive_mm - p.drive_mm), from, p),
            [p, q, ..] => {
                // u₀ + (t − t₀) u[t₀, t₁] + (t − t₀)(t − t₁) u[t₀, t₁, t₂] with Newton's divided differences.
                let [t, t0, t1, t2] = [drive_mm, from.drive_mm, p.drive_mm, q.drive_mm];
                let bend = (t - t0) * (t - t1) / (t0 - t2);
                trial.add_difference((t - t0 + bend) / (t0 - t1), from, p);
                trial.add_difference(-bend / (t1 - t2), p, q);
            }
        }
        let imposed = |v: usize| self.assembler.imposed(v, drive_mm);
        self.assembler.plates().carry(&self.assembler.mesh().nodes, &imposed, &mut trial.displacement);
        trial
    }

    /// K⁻¹ `right` for the tangent K just assembled, to the accuracy that a relative residual of `residual` is worth; a
    /// factor of an earlier iterate is tried first where the solution `is_near`.
    fn newton_step(&mut self, right: Vec<f64>, residual: f64, is_near: bool) -> Result<Vec<f64>, StepFailure> {
        let right = [right];
        let system = &mut self.linearisation.system;
        // Quadratic convergence leaves residual² at best: the linear solve need not be better than a tenth of it.
        let of_step = 0.1 * residual;
        // With this accuracy the step is the last.
        let of_last_step = 0.3 * self.options.tolerance / residual;
        let (near, anew) = if system.gains_digits_at_once() {
            let near = if residual < LAST_STEP_BELOW { of_last_step } else { of_step };
            (near.clamp(1e-7, LOOSE_STEP), of_step.clamp(1e-9, 1e-3))
        } else {
            // Every digit costs iterations.
            let accuracy = of_step.max(of_last_step).min(LOOSE_STEP);
            (accuracy, accuracy)
        };
        if is_near && let Some(mut x) = system.solve_with_earlier_factor(&right, near) {
            return Ok(x.swap_remove(0));
        }
        system.factorise().map_err(StepFailure::Linear)?;
        self.linearisation.factorised_at = residual;
        let mut x = self.linearisation.system.solve(&right, anew).map_err(StepFailure::Linear)?;
        Ok(x.swap_remove(0))
    }

    /// What a residual is measured against: the forces on the plates, or, near rest, μ × 1 mm².
    fn reaction_scale(&self) -> f64 {
        let mu = self.material.initial_shear_modulus_kpa().abs().max(1e-12);
        let (mesh, residual) = (self.assembler.mesh(), &self.linearisation.residual);
        let mut s = 0.0;
        for v in mesh.moved_nodes.iter().chain(&mesh.fixed_nodes) {
            if !self.assembler.plates().is_released[*v as usize] {
                s += residual[*v as usize].iter().map(|x| x * x).sum::<f64>();
            }
        }
        // Released nodes pass their forces on through the springs.
        s += self.linearisation.spring_forces.iter().flat_map(|f| f.1).map(|x| x * x).sum::<f64>();
        s.sqrt().max(mu)
    }
}

/// `state`, at which `linearisation` was assembled, as an equilibrium: with its forces and a number of its own.
pub(super) fn finished(
    assembler: &Assembler,
    linearisation: &mut Linearisation,
    mut state: Equilibrium,
) -> Equilibrium {
    let mesh = assembler.mesh();
    let mut moved = assembler.reaction(&linearisation.residual);
    let mut fixed = [0.0; 3];
    for &v in &mesh.fixed_nodes {
        for i in 0..3 {
            fixed[i] += linearisation.residual[v as usize][i];
        }
    }
    // What the sample pulls with, not what balances it.
    for (v, force) in &linearisation.spring_forces {
        let sum = if assembler.plates().is_moved[*v as usize] { &mut moved } else { &mut fixed };
        for i in 0..3 {
            sum[i] -= force[i];
        }
    }
    [state.force_n, state.normal_force_n] = assembler.forces_n(moved);
    let [on_moved, on_fixed] = [moved, fixed].map(|force| assembler.plates().along(force));
    state.serial = Some(Serial::next());
    linearisation.stands_at = state.serial;
    state.reaction_imbalance = (on_moved + on_fixed).abs() / on_moved.abs().max(1e-12);
    state
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
