//! What the search asks of a model of the experiment: outcomes, their derivatives, and failures that are data.

use super::study::Study;
use crate::material::Ogden;
use crate::mesh::DesignVariable;
use crate::sensitivity::Evaluation;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};

/// How much work an evaluation may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fidelity {
    /// Coarse mesh, integrals over the specimen, central values of the priors.
    Search,
    /// Standard mesh, sums over the scan's voxels, all material states.
    Confirm,
}

/// A material for which designs are evaluated.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialState {
    /// Index of the prior in the study.
    pub material: usize,
    /// The values.
    pub values: Ogden,
    /// Weight among the states of this prior; they sum to 1.
    pub weight: f64,
}

/// The states of a study at a fidelity: for each prior its central values, then (to confirm) two sigma points.
///
/// The sigma points stand at all α (1 ± r) and all μ (1 ∓ r), r the relative standard deviation: the direction along which
/// a fit of the initial shear modulus ½ Σ μα leaves them free. Weights ½, ¼, ¼.
pub fn material_states(study: &Study, fidelity: Fidelity) -> Vec<MaterialState> {
    let mut states = Vec::new();
    for (material, prior) in study.materials.iter().enumerate() {
        let is_robust = fidelity == Fidelity::Confirm && prior.relative_sd > 0.0;
        let central = if is_robust { 0.5 } else { 1.0 };
        states.push(MaterialState { material, values: prior.material.clone(), weight: central });
        if is_robust {
            for sign in [1.0, -1.0] {
                let mut values = prior.material.clone();
                for term in &mut values.terms {
                    term.alpha *= 1.0 + sign * prior.relative_sd;
                    term.mu_kpa *= 1.0 - sign * prior.relative_sd;
                }
                states.push(MaterialState { material, values, weight: 0.25 });
            }
        }
    }
    states
}

/// What a design yields for one material state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateOutcome {
    /// 𝒮 of μ₁, α₁, μ₂, … in the study's normalisation.
    pub integrated: Vec<f64>,
    /// Fisher information of κ, μ₁, α₁, …, row by row, in the parameters' units; in rates it may be empty (not computed).
    pub information: Vec<f64>,
    /// Force of all samples, N.
    pub force_n: f64,
    /// Largest principal stretch.
    pub largest_stretch: f64,
}

/// What a design yields, state by state in the order of [`material_states`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// Per state.
    pub states: Vec<StateOutcome>,
    /// At [`Fidelity::Confirm`]: the evaluation of each prior's central values.
    #[serde(default)]
    pub evaluations: Vec<Evaluation>,
}

/// What moves when one variable of the search moves by its unit.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Motion {
    /// Geometric quantities with their rates, mm per unit.
    pub shape: Vec<(DesignVariable, f64)>,
    /// Rate of the drive, mm per unit.
    pub drive_mm: f64,
}

/// Why a design has no outcome. Recorded like an outcome.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
#[non_exhaustive]
pub enum EvaluationFailure {
    /// No mesh.
    #[error("not meshed: {message}")]
    Mesh {
        /// The mesher's words.
        message: String,
    },
    /// No equilibrium.
    #[error("not solved: {message}")]
    Solve {
        /// The solver's words.
        message: String,
    },
    /// The scan's grid does not suit it, or its information is not finite.
    #[error("not observed: {message}")]
    Observe {
        /// What is wrong.
        message: String,
    },
    /// Stopped from outside; not recorded.
    #[error("stopped")]
    Cancelled,
}

/// An outcome with its derivatives by each motion, of the same shape as the outcome.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutcomeWithRates {
    /// The outcome.
    pub outcome: Outcome,
    /// d outcome / d motion.
    pub rates: Vec<Vec<StateOutcome>>,
}

/// A model of the experiment. The search knows nothing else of finite elements.
///
/// Results must depend on the arguments alone (not on thread, order or earlier calls): they are stored and reused.
pub trait Evaluator: Sync {
    /// Evaluates a specimen at its (one) drive.
    ///
    /// # Errors
    /// [`EvaluationFailure`].
    fn evaluate(
        &self,
        specimen: &Specimen,
        fidelity: Fidelity,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Outcome, EvaluationFailure>;

    /// At [`Fidelity::Search`], with derivatives; those of the information only where `needs_information` of the outcome
    /// (they cost most), else they are left empty.
    ///
    /// # Errors
    /// [`EvaluationFailure`].
    fn evaluate_with_rates(
        &self,
        specimen: &Specimen,
        motions: &[Motion],
        needs_information: &(dyn Fn(&Outcome) -> bool + Sync),
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<OutcomeWithRates, EvaluationFailure>;
}
