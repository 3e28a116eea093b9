//! Steps along which the stresses change as promised, not the parameters.
//!
//! Displacements and forces depend on the parameters through the stresses alone, and far more nearly linearly on stresses
//! than on parameters: a two-term fit has a valley, along which the stress at the largest stretches stays, and in the
//! parameters that valley is curved. A step by the linear model leaves it soon. Here a step δ of the parameters is read as one
//! of the stresses, t₀ + D δ with D = ∂t/∂ξ over the states that the specimen visits, and the parameters are moved to those
//! whose stresses come nearest to it, in the least squares weighted by volume. To first order that is the step itself, so that
//! nothing changes at the optimum; it costs no equilibrium.

use super::system::NormalSystem;
use crate::fem::{Equilibrium, ForwardModel};
use crate::kinematics::principal_stretches;
use crate::material::{MAX_ALPHA, MIN_ALPHA, Ogden, OgdenTerm};
use nalgebra::{DMatrix, DVector};

/// States kept of those visited: enough for a smooth family of functions with a handful of parameters.
const NUM_STATES: usize = 256;
/// Gauss–Newton iterations of the inner fit.
const MAX_ITERATIONS: usize = 12;
/// The inner fit has converged when it moves ln |μ| and α by less than this.
const TOLERANCE: f64 = 1e-6;
/// Beyond this many times the length of the linear step (scaled parameters) the linear step is taken.
const LARGEST_DETOUR: f64 = 3.0;
/// Followed where the squared stresses still missing are less than this part of those promised; else the linear step is taken.
const FOLLOWED: f64 = 0.25;
/// Added to a scaled unit diagonal.
const RIDGE: f64 = 1e-12;

/// Visited states: their traceless logarithmic principal strains and the root of their volume.
#[derive(Clone, Debug, Default)]
pub(super) struct StressPath {
    states: Vec<([f64; 3], f64)>,
}

impl StressPath {
    /// The states of `equilibria` of `material`.
    pub(super) fn new(model: &ForwardModel, material: &Ogden, equilibria: &[Equilibrium]) -> StressPath {
        let mut states = Vec::new();
        // With one term parameters and stresses are one to one: nothing is curved.
        if material.terms.len() < 2 {
            return StressPath { states };
        }
        for state in equilibria {
            let points = model.quadrature_fields(material, state);
            let stride = (points.len() * equilibria.len()).div_ceil(NUM_STATES).max(1);
            for point in points.iter().step_by(stride) {
                let logs = principal_stretches(&point.deformation_gradient).map(f64::ln);
                let mean = logs.iter().sum::<f64>() / 3.0;
                if mean.is_finite() && point.volume_mm3 > 0.0 {
                    states.push((logs.map(|e| e - mean), point.volume_mm3.sqrt()));
                }
            }
        }
        StressPath { states }
    }

    /// Adds the states of another recording.
    pub(super) fn join(mut self, other: StressPath) -> StressPath {
        self.states.extend(other.states);
        self
    }

    /// `material` after the scaled change `step`. κ and what cannot be followed moves as in [`NormalSystem::moved`].
    pub(super) fn moved(&self, system: &NormalSystem, material: &Ogden, step: &DVector<f64>) -> Ogden {
        let linear = system.moved(material, step);
        match self.followed(material, step) {
            Some(terms) => Ogden { terms, ..linear },
            None => linear,
        }
    }

    /// Terms whose stresses come nearest to those promised by `step`.
    fn followed(&self, material: &Ogden, step: &DVector<f64>) -> Option<Vec<OgdenTerm>> {
        if self.states.is_empty() || step.len() != 2 * material.terms.len() + 1 {
            return None;
        }
        // Coordinates ln |μ| and α; the scaled step of α is relative.
        let n = 2 * material.terms.len();
        let linear =
            DVector::from_fn(
                n,
                |i, _| {
                    if i % 2 == 0 { step[i + 1] } else { step[i + 1] * material.terms[i / 2].alpha }
                },
            );
        let (stresses, slopes) = self.stresses(&material.terms);
        let wanted = stresses + &slopes * &linear;
        let mut terms = material.terms.clone();
        let at = |terms: &[OgdenTerm]| {
            let (stresses, slopes) = self.stresses(terms);
            let misfit = &wanted - stresses;
            (misfit.norm_squared(), misfit, slopes)
        };
        let (mut error, mut misfit, mut slopes) = at(&terms);
        // Held parameters have no step.
        let is_free: Vec<bool> = (0..n).map(|i| step[i + 1] != 0.0).collect();
        let at_rest = error;
        for _ in 0..MAX_ITERATIONS {
            let mut change = least_squares(&slopes, &misfit, &is_free)?;
            let mut accepted = false;
            for _ in 0..6 {
                let trial: Vec<OgdenTerm> = terms
                    .iter()
                    .enumerate()
                    .map(|(t, term)| OgdenTerm {
                        mu_kpa: term.mu_kpa * change[2 * t].exp(),
                        alpha: term.alpha + change[2 * t + 1],
                    })
                    .collect();
                let is_material = trial
                    .iter()
                    .zip(&terms)
                    .all(|(new, old)| new.alpha * old.alpha > 0.0 && (MIN_ALPHA..MAX_ALPHA).contains(&new.alpha.abs()));
                if is_material {
                    let next = at(&trial);
                    if next.0 <= error * (1.0 + 1e-12) {
                        terms = trial;
                        (error, misfit, slopes) = next;
                        accepted = true;
                        break;
                    }
                }
                change *= 0.5;
            }
            if !accepted || change.amax() < TOLERANCE {
                break;
            }
        }
        let moved = terms
            .iter()
            .zip(&material.terms)
            .flat_map(|(new, old)| [(new.mu_kpa / old.mu_kpa).ln(), new.alpha / old.alpha - 1.0])
            .map(|x| x * x)
            .sum::<f64>();
        let is_near = moved.sqrt() <= LARGEST_DETOUR * step.rows(1, n).norm();
        (error < FOLLOWED * at_rest && is_near).then_some(terms)
    }

    /// Traceless principal Kirchhoff stresses Σμ λ̄^α of all states (kPa, times the root of the volume), and their
    /// derivatives with respect to ln |μ| and α.
    fn stresses(&self, terms: &[OgdenTerm]) -> (DVector<f64>, DMatrix<f64>) {
        let mut stresses = DVector::zeros(3 * self.states.len());
        let mut slopes = DMatrix::zeros(3 * self.states.len(), 2 * terms.len());
        for (s, (logs, root)) in self.states.iter().enumerate() {
            for (t, term) in terms.iter().enumerate() {
                let powers = logs.map(|e| root * term.mu_kpa * (term.alpha * e).exp());
                let by_alpha = [0, 1, 2].map(|j| powers[j] * logs[j]);
                let means = [powers, by_alpha].map(|v| v.iter().sum::<f64>() / 3.0);
                for j in 0..3 {
                    stresses[3 * s + j] += powers[j] - means[0];
                    slopes[(3 * s + j, 2 * t)] = powers[j] - means[0];
                    slopes[(3 * s + j, 2 * t + 1)] = by_alpha[j] - means[1];
                }
            }
        }
        (stresses, slopes)
    }
}

/// The change of the free parameters that takes most of `misfit` away.
fn least_squares(slopes: &DMatrix<f64>, misfit: &DVector<f64>, is_free: &[bool]) -> Option<DVector<f64>> {
    let free: Vec<usize> = (0..is_free.len()).filter(|&i| is_free[i]).collect();
    let scale = |i: usize| Some(slopes.column(i).norm()).filter(|s| *s > 0.0).unwrap_or(1.0);
    let scaled = DMatrix::from_fn(slopes.nrows(), free.len(), |r, a| slopes[(r, free[a])] / scale(free[a]));
    let matrix = scaled.tr_mul(&scaled) + DMatrix::from_diagonal_element(free.len(), free.len(), RIDGE);
    let x = matrix.cholesky()?.solve(&scaled.tr_mul(misfit));
    let mut change = DVector::zeros(is_free.len());
    for (a, &i) in free.iter().enumerate() {
        change[i] = x[a] / scale(i);
    }
    change.iter().all(|v| v.is_finite()).then_some(change)
}

#[cfg(test)]
mod tests {
    use super::super::system::NormalSystem;
    use super::super::test_problem::{block, coarse, ogden};
    use super::*;
    use crate::fem::SolveOptions;
    use crate::sensitivity::FisherInformation;

    fn system(material: &Ogden) -> NormalSystem {
        let parameters = material.parameters();
        let n = parameters.len();
        NormalSystem {
            values: parameters.iter().map(|p| material.value(*p)).collect(),
            parameters,
            information: FisherInformation::none(material),
            matrix: DMatrix::identity(n, n),
            gradient: DVector::zeros(n),
            chi2: 1.0,
            loss_u: 0.0,
            loss_f: 0.0,
        }
    }

    fn path(material: &Ogden) -> StressPath {
        let specimen = block();
        let mut model =
            ForwardModel::new(crate::mesh::mesh_specimen(&specimen, &coarse(&specimen)).unwrap(), &specimen).unwrap();
        let state = model.solve(material, 4.0, None, &SolveOptions::default(), &|| false).unwrap();
        StressPath::new(&model, material, &[state])
    }

    fn two_terms() -> Ogden {
        ogden(200.0, &[[16.0, 1.9], [0.35, 8.0]])
    }

    fn distance(a: &Ogden, b: &Ogden) -> f64 {
        a.parameters().iter().map(|p| (a.value(*p) / b.value(*p) - 1.0).powi(2)).sum::<f64>().sqrt()
    }

    /// Half a step: a quarter of the distance from the linear one.
    #[test]
    fn the_path_is_tangent_to_the_linear_step() {
        let material = two_terms();
        let (path, system) = (path(&material), system(&material));
        let direction = DVector::from_column_slice(&[0.3, -0.05, 0.06, -0.4, 0.12]);
        let apart = [0.1, 0.05].map(|size| {
            let step = &direction * size;
            distance(&path.moved(&system, &material, &step), &system.moved(&material, &step))
        });
        // Third-order terms are a tenth of the step's size.
        assert!((apart[0] / apart[1] - 4.0).abs() < 0.4, "{apart:?}");
        assert!(apart[0] > 1e-6);
    }

    /// Along the valley of the second term stresses stay; the linear step leaves it.
    #[test]
    fn stresses_change_as_promised() {
        let material = two_terms();
        let path = path(&material);
        let (stresses, slopes) = path.stresses(&material.terms);
        // α₂ up by 15 %, the other parameters such that stresses change least.
        let alone = slopes.column(3) * (0.15 * 8.0);
        let rest = least_squares(&slopes, &-&alone, &[true, true, true, false]).unwrap();
        let step = DVector::from_column_slice(&[0.0, rest[0], rest[1] / 1.9, rest[2], 0.15]);
        let system = system(&material);
        let wanted = &stresses + &slopes * DVector::from_column_slice(&[rest[0], rest[1], rest[2], 1.2]);
        let missed = |m: &Ogden| (path.stresses(&m.terms).0 - &wanted).norm() / stresses.norm();
        let [followed, linear] =
            [path.moved(&system, &material, &step), system.moved(&material, &step)].map(|m| missed(&m));
        assert!(followed < 0.1 * linear, "{followed} {linear}");
    }

    #[test]
    fn held_parameters_and_single_terms_move_linearly() {
        let material = two_terms();
        let (path_two, system_two) = (path(&material), system(&material));
        let step = DVector::from_column_slice(&[0.1, 0.0, 0.06, -0.2, 0.0]);
        let moved = path_two.moved(&system_two, &material, &step);
        assert_eq!(moved.terms[0].mu_kpa, 16.0);
        assert_eq!(moved.terms[1].alpha, 8.0);
        assert_eq!(moved.bulk_kpa, 200.0 * 0.1f64.exp());
        let one = ogden(200.0, &[[16.0, 1.9]]);
        let step = DVector::from_column_slice(&[0.1, 0.3, -0.2]);
        assert_eq!(path(&one).moved(&system(&one), &one, &step), system(&one).moved(&one, &step));
    }
}
