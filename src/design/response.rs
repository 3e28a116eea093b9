//! What one design does, at search fidelity, and its exact derivatives: the FE-backed evaluation of the search.
//!
//! Voxel sums are replaced by integrals over quadrature points (see [`crate::sensitivity`]), which vary smoothly with the
//! design, so that gradients are meaningful. The derivative of every number along a design variable follows from one
//! back-solve for the state, one for each material sensitivity, and a central difference of the integrals along the known
//! direction (X + tV, u + tu′, s + ts′): no solution is differenced.

use super::aim::{Normalisation, ObjectiveKind};
use super::space::{Subspace, Variable};
use super::study::{MaterialPrior, Study};
use super::tell_apart::{log_separation, nearest, separation, state_of};
use crate::fem::{
    Equilibrium, ForwardModel, ParameterSensitivity, PathSensitivity, PrepareError, SolveError, SolveOptions, Tangent,
};
use crate::kinematics::principal_stretches;
use crate::material::Ogden;
use crate::mesh::{MeshOptions, shape_velocity};
use crate::sensitivity::{
    Covariance, Criterion, FisherInformation, InformationError, IntegratedSensitivity, MaterialState,
    information_over_quadrature, integrate_over_quadrature,
};
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};

/// Why a design was not evaluated: data for the search, not an error of it.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Serialize, Deserialize)]
#[non_exhaustive]
pub enum EvaluationFailure {
    /// The specimen cannot be made or meshed.
    #[error("{reason}")]
    Geometry {
        /// Why.
        reason: String,
    },
    /// No equilibrium.
    #[error("{reason}")]
    Equilibrium {
        /// Why.
        reason: String,
    },
    /// Stopped from outside.
    #[error("stopped")]
    Cancelled,
}

impl From<PrepareError> for EvaluationFailure {
    fn from(error: PrepareError) -> Self {
        match error {
            PrepareError::Mesh(e) => EvaluationFailure::Geometry { reason: e.to_string() },
            PrepareError::Solve(e) => e.into(),
        }
    }
}

impl From<SolveError> for EvaluationFailure {
    fn from(error: SolveError) -> Self {
        match error {
            SolveError::Cancelled { .. } => EvaluationFailure::Cancelled,
            other => EvaluationFailure::Equilibrium { reason: other.to_string() },
        }
    }
}

impl From<InformationError> for EvaluationFailure {
    fn from(error: InformationError) -> Self {
        EvaluationFailure::Equilibrium { reason: error.to_string() }
    }
}

/// Volume fraction above whose principal stretch a design is judged for tearing: the singular bonded edges, where the
/// stretch of a finite mesh means nothing, fill less.
pub const TEARING_FRACTION: f64 = 0.002;

/// What a design does with one material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// ln 𝒮 of every μᵢ and αᵢ, in the study's normalisation.
    pub log_integrated: Vec<f64>,
    /// ln of the relative standard deviation of every μᵢ and αᵢ (+∞ replaced by a large number where undetermined).
    pub log_relative_sd: Vec<f64>,
    /// ln of the D-, A-, E- and worst-parameter figures, each as a relative standard deviation.
    pub log_criteria: [f64; 4],
    /// ln of the distance of this material's scan from the closest fit of an earlier material to it, in noise standard
    /// deviations; 0 for the first material, and where the study does not ask to tell materials apart.
    #[serde(default)]
    pub log_separation: f64,
    /// ln of the force in N.
    pub log_force: f64,
    /// ln of the principal stretch exceeded in [`TEARING_FRACTION`] of the volume.
    pub log_stretch: f64,
}

/// ln of a relative standard deviation that stands for "not determined".
const UNDETERMINED: f64 = 12.0;

/// ln of a relative standard deviation, a large number where it is not determined.
pub(super) fn log_or_undetermined(value: Option<f64>) -> f64 {
    match value {
        Some(v) if v > 0.0 && v.ln() < UNDETERMINED => v.ln(),
        _ => UNDETERMINED,
    }
}

/// 𝒮 in the normalisation asked for.
pub(super) fn normalised(sensitivity: &IntegratedSensitivity, normalisation: Normalisation) -> f64 {
    match normalisation {
        Normalisation::Sum => sensitivity.sum,
        Normalisation::MeanPerVoxel => sensitivity.mean_per_voxel,
        Normalisation::VolumeIntegral => sensitivity.volume_integral,
    }
}

impl Response {
    /// All numbers in one list, in a fixed order.
    pub fn to_vector(&self) -> Vec<f64> {
        let mut v = self.log_integrated.clone();
        v.extend(&self.log_relative_sd);
        v.extend(self.log_criteria);
        v.extend([self.log_separation, self.log_force, self.log_stretch]);
        v
    }

    /// The inverse of [`Self::to_vector`].
    pub fn from_vector(v: &[f64]) -> Response {
        let n = (v.len() - 7) / 2;
        Response {
            log_integrated: v[..n].to_vec(),
            log_relative_sd: v[n..2 * n].to_vec(),
            log_criteria: [v[2 * n], v[2 * n + 1], v[2 * n + 2], v[2 * n + 3]],
            log_separation: v[2 * n + 4],
            log_force: v[2 * n + 5],
            log_stretch: v[2 * n + 6],
        }
    }
}

/// The relative figures of a covariance: D, A, E, worst, as relative standard deviations.
pub fn criteria_as_relative_sd(covariance: &Covariance, shear: &[usize]) -> [Option<f64>; 4] {
    let n = shear.len().max(1) as f64;
    [
        covariance.criterion(Criterion::LogDeterminant, shear).map(|d| (d / (2.0 * n)).exp()),
        covariance.criterion(Criterion::Trace, shear).map(f64::sqrt),
        covariance.criterion(Criterion::LargestEigenvalue, shear).map(f64::sqrt),
        covariance.criterion(Criterion::WorstRelativeSd, shear),
    ]
}

/// A design's responses to each material of [`sample_materials`], and, where asked for, their derivatives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluated {
    /// One per material sample.
    pub responses: Vec<Response>,
    /// `[material sample][variable][entry of Response::to_vector]`; empty unless asked for.
    pub gradients: Vec<Vec<Vec<f64>>>,
}

/// A material at which designs are judged, and its weight.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialSample {
    /// Index of the prior.
    pub prior: usize,
    /// Values.
    pub material: Ogden,
    /// Weight; all sum to one.
    pub weight: f64,
}

/// The priors' central values and, where a prior is uncertain, two more points: all |α| larger and |μ| smaller by the
/// relative standard deviation, and the reverse (weights ½, ¼, ¼: the three-point rule that has the prior's mean, and
/// half of its variance in α at either side).
pub fn sample_materials(priors: &[MaterialPrior]) -> Vec<MaterialSample> {
    let total: f64 = priors.iter().map(|p| p.weight).sum();
    let mut samples = Vec::new();
    for (index, prior) in priors.iter().enumerate() {
        let share = prior.weight / total;
        let certain = prior.relative_sd == 0.0;
        samples.push(MaterialSample {
            prior: index,
            material: prior.material.clone(),
            weight: if certain { share } else { 0.5 * share },
        });
        if !certain {
            for sign in [1.0, -1.0] {
                let mut material = prior.material.clone();
                for term in &mut material.terms {
                    term.alpha *= 1.0 + sign * prior.relative_sd;
                    term.mu_kpa *= 1.0 - sign * prior.relative_sd;
                }
                samples.push(MaterialSample { prior: index, material, weight: 0.25 * share });
            }
        }
    }
    samples
}

/// Evaluates designs of a study at search fidelity.
pub struct Evaluator<'a> {
    study: &'a Study,
    samples: Vec<MaterialSample>,
    /// Factor on the search mesh's element size.
    coarseness: f64,
    solve: SolveOptions,
}

/// How a variable moves the nodes (none: not at all) and the drive.
type Move = (Option<Vec<[f64; 3]>>, f64);

/// An earlier material fitted to a sample's scan.
#[derive(Clone)]
struct Fitted {
    /// The sample whose scan it is.
    of: usize,
    material: Ogden,
    state: MaterialState,
}

/// All that a design does at one drive.
struct Solved {
    /// Per sample.
    states: Vec<MaterialState>,
    /// Earlier materials fitted to them, where the study asks for it.
    fitted: Vec<Fitted>,
    /// Per state, then per fitted material: derivatives along each move.
    paths: Vec<Vec<PathSensitivity>>,
}

impl<'a> Evaluator<'a> {
    /// For `study`: at the priors' central values, and at their variants if its budget says so.
    pub fn new(study: &'a Study) -> Evaluator<'a> {
        if study.budget.variants_in_search {
            return Self::with_variants(study);
        }
        let central: Vec<MaterialPrior> =
            study.materials.iter().map(|prior| MaterialPrior { relative_sd: 0.0, ..prior.clone() }).collect();
        Evaluator { study, samples: sample_materials(&central), coarseness: 1.0, solve: SolveOptions::default() }
    }

    /// For `study`, always at the variants too.
    pub fn with_variants(study: &'a Study) -> Evaluator<'a> {
        Evaluator {
            study,
            samples: sample_materials(&study.materials),
            coarseness: 1.0,
            solve: SolveOptions::default(),
        }
    }

    /// The same with elements larger by `factor`: for tests.
    pub fn with_coarseness(mut self, factor: f64) -> Self {
        self.coarseness = factor;
        self
    }

    /// The materials in the order of [`Evaluated::responses`].
    pub fn samples(&self) -> &[MaterialSample] {
        &self.samples
    }

    /// Mesh of a specimen at search fidelity.
    pub fn mesh_options(&self, specimen: &Specimen) -> MeshOptions {
        let options = MeshOptions::search(specimen);
        MeshOptions { section_size_mm: options.section_size_mm * self.coarseness, ..options }
    }

    /// Responses at the specimen's last drive; with gradients where `subspace` is given.
    ///
    /// # Errors
    /// [`EvaluationFailure`].
    pub fn evaluate(
        &self,
        specimen: &Specimen,
        subspace: Option<&Subspace>,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Evaluated, EvaluationFailure> {
        let no_drive = || EvaluationFailure::Geometry { reason: "the specimen has no drive".into() };
        let drive = *specimen.drive_mm.last().ok_or_else(no_drive)?;
        specimen.validate().map_err(|e| EvaluationFailure::Geometry { reason: e.to_string() })?;
        let mut model = ForwardModel::of_specimen(specimen, &self.mesh_options(specimen))?;
        let moves: Vec<Move> =
            subspace.map(|s| s.variables.iter().map(|&v| a_move(&model, specimen, s, v)).collect()).unwrap_or_default();
        let solved = self.solve(&mut model, drive, &moves, is_cancelled)?;
        let responses = self.responses(&model, &model.mesh().nodes, &solved.states, &solved.fitted)?;
        let mut gradients = Vec::new();
        if subspace.is_some() {
            gradients = vec![Vec::with_capacity(moves.len()); solved.states.len()];
            for (n, moved) in moves.iter().enumerate() {
                let rows = self.gradient(&model, &solved, n, moved)?;
                gradients.iter_mut().zip(rows).for_each(|(all, row)| all.push(row));
            }
        }
        Ok(Evaluated { responses, gradients })
    }

    /// Every sample's state at `drive`, its derivatives along each of `moves`, and what earlier materials make of it.
    fn solve(
        &self,
        model: &mut ForwardModel,
        drive: f64,
        moves: &[Move],
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Solved, EvaluationFailure> {
        let mut solved = Solved { states: Vec::new(), fitted: Vec::new(), paths: Vec::new() };
        let mut equilibria: Vec<Equilibrium> = Vec::new();
        let along_moves = |tangent: &mut Tangent, state: &MaterialState| {
            let along = |m: &Move| tangent.path_sensitivity(&state.sensitivities, m.0.as_deref(), m.1);
            moves.iter().map(along).collect::<Result<Vec<_>, _>>()
        };
        for sample in &self.samples {
            let material = &sample.material;
            let found = match equilibria.last() {
                // A neighbouring material's state is closer than rest; where it is not, start over.
                Some(previous) => model
                    .solve(material, drive, Some(previous), &self.solve, is_cancelled)
                    .or_else(|_| model.solve(material, drive, None, &self.solve, is_cancelled))?,
                None => model.solve(material, drive, None, &self.solve, is_cancelled)?,
            };
            let mut tangent = model.tangent(material, &found)?;
            let state = state_of(&found, &mut tangent)?;
            solved.paths.push(along_moves(&mut tangent, &state)?);
            solved.states.push(state);
            equilibria.push(found);
        }
        if self.study.objective.kind == ObjectiveKind::TellApart {
            for of in 0..self.samples.len() {
                let earlier = (0..of).filter(|&o| self.is_central(o) && self.samples[o].prior < self.samples[of].prior);
                for other in earlier.collect::<Vec<_>>() {
                    let (start, material) = (&equilibria[other], &self.samples[other].material);
                    let theirs = &solved.states[of];
                    let fit = nearest(self.study, model, material, start, drive, theirs, &self.solve, is_cancelled)?;
                    let mut tangent = model.tangent(&fit.material, &fit.equilibrium)?;
                    solved.paths.push(along_moves(&mut tangent, &fit.state)?);
                    solved.fitted.push(Fitted { of, material: fit.material, state: fit.state });
                }
            }
        }
        Ok(solved)
    }

    /// Derivative of every sample's response entries along the move with this index, per mm. Fitted materials keep their values: at
    /// the nearest point the distance does not change with them.
    fn gradient(
        &self,
        model: &ForwardModel,
        solved: &Solved,
        index: usize,
        (velocity, _): &Move,
    ) -> Result<Vec<Vec<f64>>, EvaluationFailure> {
        // A central difference along a known direction: 10⁻⁴ mm balances its truncation and rounding.
        let t = 1e-4;
        let mut sides = Vec::with_capacity(2);
        for sign in [1.0, -1.0] {
            let step = sign * t;
            let shift = |x: &[[f64; 3]], v: &[[f64; 3]]| -> Vec<[f64; 3]> {
                x.iter().zip(v).map(|(a, b)| [0, 1, 2].map(|i| a[i] + step * b[i])).collect()
            };
            let positions = match velocity {
                Some(v) => shift(&model.mesh().nodes, v),
                None => model.mesh().nodes.clone(),
            };
            let follow = |state: &MaterialState, path: &PathSensitivity| MaterialState {
                displacement: shift(&state.displacement, &path.displacement),
                force_n: state.force_n + step * path.force_n,
                sensitivities: state
                    .sensitivities
                    .iter()
                    .zip(&path.parameters)
                    .map(|(s, d)| ParameterSensitivity {
                        parameter: s.parameter,
                        displacement: shift(&s.displacement, &d.displacement),
                        force_n: s.force_n + step * d.force_n,
                    })
                    .collect(),
            };
            let (of_states, of_fitted) = solved.paths.split_at(solved.states.len());
            let moved: Vec<MaterialState> =
                solved.states.iter().zip(of_states).map(|(state, paths)| follow(state, &paths[index])).collect();
            let fitted: Vec<Fitted> = solved
                .fitted
                .iter()
                .zip(of_fitted)
                .map(|(f, paths)| Fitted { state: follow(&f.state, &paths[index]), ..f.clone() })
                .collect();
            sides.push(self.responses(model, &positions, &moved, &fitted)?);
        }
        let slope = |(a, b): (&Response, &Response)| -> Vec<f64> {
            a.to_vector().iter().zip(b.to_vector()).map(|(a, b)| (a - b) / (2.0 * t)).collect()
        };
        Ok(sides[0].iter().zip(&sides[1]).map(slope).collect())
    }

    /// Responses of all samples from their states, the mesh's nodes at `positions`.
    fn responses(
        &self,
        model: &ForwardModel,
        positions: &[[f64; 3]],
        states: &[MaterialState],
        fitted: &[Fitted],
    ) -> Result<Vec<Response>, EvaluationFailure> {
        let mut all = Vec::with_capacity(states.len());
        for (index, (sample, state)) in self.samples.iter().zip(states).enumerate() {
            let mut response = self.response(model, &sample.material, positions, state)?;
            let mut distances = Vec::new();
            for f in fitted.iter().filter(|f| f.of == index) {
                distances.push(separation(self.study, model, positions, &f.material, &f.state, state)?.distance_sd);
            }
            response.log_separation = log_separation(distances);
            all.push(response);
        }
        Ok(all)
    }

    /// Whether a sample is its prior's central value, which comes first.
    fn is_central(&self, index: usize) -> bool {
        index == 0 || self.samples[index - 1].prior != self.samples[index].prior
    }

    fn response(
        &self,
        model: &ForwardModel,
        material: &Ogden,
        positions: &[[f64; 3]],
        state: &MaterialState,
    ) -> Result<Response, EvaluationFailure> {
        let scan = &self.study.scan;
        let voxel_volume = scan.voxel_mm.iter().product();
        let fields = model.quadrature_fields_at(material, positions, &state.displacement);
        let integrated = integrate_over_quadrature(material, &fields, model.mesh().mirror, voxel_volume);
        let (mesh, noise) = (model.mesh(), scan.noise());
        let information: FisherInformation =
            information_over_quadrature(material, mesh, &fields, &state.sensitivities, &noise, voxel_volume)?;
        let covariance = information.covariance();
        let shear = information.shear_indices();
        let normalisation = self.study.objective.normalisation;
        Ok(Response {
            log_integrated: integrated.iter().map(|s| normalised(s, normalisation).max(1e-300).ln()).collect(),
            log_relative_sd: shear.iter().map(|&i| log_or_undetermined(covariance.relative_sd(i))).collect(),
            log_criteria: criteria_as_relative_sd(&covariance, &shear).map(log_or_undetermined),
            log_separation: 0.0,
            log_force: state.force_n.abs().max(1e-12).ln(),
            log_stretch: tearing_stretch(
                fields.iter().map(|q| (principal_stretches(&q.deformation_gradient)[0], q.volume_mm3)),
            )
            .ln(),
        })
    }
}

/// How `variable` moves the nodes and the drive.
fn a_move(model: &ForwardModel, specimen: &Specimen, subspace: &Subspace, variable: Variable) -> Move {
    let mut velocity: Option<Vec<[f64; 3]>> = None;
    for (design_variable, sign) in subspace.moves(variable) {
        let one = shape_velocity(model.mesh(), specimen, design_variable);
        let sum = velocity.get_or_insert_with(|| vec![[0.0; 3]; one.len()]);
        for (s, v) in sum.iter_mut().zip(&one) {
            for i in 0..3 {
                s[i] += sign * v[i];
            }
        }
    }
    (velocity, if variable == Variable::Drive { 1.0 } else { 0.0 })
}

/// The stretch exceeded in [`TEARING_FRACTION`] of the volume, from (stretch, volume) pairs; 1 without any.
pub fn tearing_stretch(values: impl Iterator<Item = (f64, f64)>) -> f64 {
    let mut sorted: Vec<(f64, f64)> = values.collect();
    sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
    let allowed = TEARING_FRACTION * sorted.iter().map(|s| s.1).sum::<f64>();
    let mut sum = 0.0;
    sorted
        .into_iter()
        .find_map(|(stretch, volume)| {
            sum += volume;
            (sum >= allowed).then_some(stretch)
        })
        .unwrap_or(1.0)
}

#[cfg(test)]
#[path = "response_tests.rs"]
mod tests;
