//! Settings of the solution and what it took.

/// Settings of [`ForwardModel::solve`](super::ForwardModel::solve).
#[derive(Clone, Copy, Debug)]
pub struct SolveOptions {
    /// Newton stops when |residual| falls below this fraction of |reactions|. Convergence is quadratic: at the default,
    /// 10⁻⁶, forces are good to about that, a hundredth of what any mesh in use leaves. Rounding allows 10⁻¹¹ at
    /// κ/μ = 10³.
    pub tolerance: f64,
    /// Newton iterations per load step.
    pub max_iterations: usize,
    /// Smallest load step as a fraction of the drive asked for. Steps shrink only where they fail.
    pub min_step: f64,
}

impl Default for SolveOptions {
    fn default() -> Self {
        SolveOptions { tolerance: 1e-6, max_iterations: 14, min_step: 1.0 / 1024.0 }
    }
}

impl SolveOptions {
    /// For what searches and fits try out: a path that needs load steps below 1/64 of the drive counts as ended. A
    /// design whose sample comes so near to giving way is none to make, and a fit finds another way round.
    pub fn trial() -> SolveOptions {
        SolveOptions { min_step: 1.0 / 64.0, ..SolveOptions::default() }
    }
}

/// What the last solve took.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Statistics {
    /// Load steps accepted.
    pub load_steps: usize,
    /// Load steps that failed and were halved.
    pub failed_steps: usize,
    /// Newton iterations, failed steps included.
    pub newton_iterations: usize,
}
