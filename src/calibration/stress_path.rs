//! Steps along which the stresses change as promised, not the parameters.
//!
//! Displacements and forces depend on the parameters through the stresses alone, and far more nearly linearly on
//! stresses than on parameters: a two-term fit has a valley, along which the stress at the largest stretches stays, and
//! in the parameters that valley is curved. A step by the linear model leaves it soon. Here a step δ of the parameters
//! is read as one of the stresses, t₀ + D δ with D = ∂t/∂ξ over the states that the specimen visits, and the parameters
//! are moved to those whose stresses come nearest to it within the limits of a step, in the least squares weighted by
//! volume. To first order that is the step itself, so that nothing changes at the optimum; it costs no equilibrium.

use super::error::CalibrationError;
use super::step::Constraints;
use super::system::{NormalSystem, scales_of};
use crate::fem::{Equilibrium, ForwardModel};
use crate::kinematics::principal_stretches;
use crate::material::Material;
use crate::optimise::{self, LeastSquares, Rules, Shortening, Step, Stop};
use nalgebra::{DMatrix, DVector};

/// States kept of those visited: enough for a smooth family of functions with a handful of parameters.
const NUM_STATES: usize = 256;
/// The fit of the stresses: Gauss–Newton steps that are halved where they do not help, until the squared misfit falls
/// by less than a millionth.
const RULES: Rules = Rules {
    shortening: Shortening::Halved { num_lengths: 6 },
    tolerated_rise: 0.0,
    stop: Stop { max_steps: 20, least_relative_gain: Some(1e-6), ..Stop::NEVER },
};
/// Beyond this many times the length of the linear step (ln |μ|, relative α) the linear step is taken: the promise is
/// then met, if at all, by quite another material.
const LARGEST_DETOUR: f64 = 2.0;

/// Visited states: their traceless logarithmic principal strains and the root of their volume.
#[derive(Clone, Debug, Default)]
pub(super) struct StressPath {
    states: Vec<([f64; 3], f64)>,
}

impl StressPath {
    /// The states of `equilibria` of `material`.
    pub(super) fn new(model: &ForwardModel, material: &Material, equilibria: &[Equilibrium]) -> StressPath {
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

    /// Whether every step is the linear one.
    pub(super) fn is_straight(&self) -> bool {
        self.states.is_empty()
    }

    /// `material` after the scaled change `step`, within `limits`. κ moves as in [`NormalSystem::moved`].
    ///
    /// # Errors
    /// [`CalibrationError::Subproblem`].
    pub(super) fn moved(
        &self,
        limits: &Constraints,
        system: &NormalSystem,
        material: &Material,
        step: &DVector<f64>,
    ) -> Result<Material, CalibrationError> {
        let linear = system.moved(material, step);
        if self.is_straight() {
            return Ok(linear);
        }
        let (stresses, slopes) = self.stresses(material);
        let wanted = stresses + slopes * step;
        let near = Material { bulk_kpa: linear.bulk_kpa, ..material.clone() };
        let mut inner = StressFit { path: self, limits, outer: system, wanted: &wanted };
        let start = inner.point(near);
        let own_system = self.system(system, &start.material, &wanted);
        let StressPoint { material: near, misfit } = optimise::descend(&mut inner, start, own_system, &RULES)?.at;
        let length = |m: &Material| {
            let moved = m.terms.iter().zip(&material.terms);
            moved
                .map(|(new, old)| (new.mu_kpa / old.mu_kpa).ln().powi(2) + (new.alpha / old.alpha - 1.0).powi(2))
                .sum::<f64>()
                .sqrt()
        };
        let is_near = length(&near) < LARGEST_DETOUR * length(&linear);
        Ok(if is_near && misfit < self.misfit(&linear, &wanted) { near } else { linear })
    }

    /// Σ (wanted − stress)² of a material.
    fn misfit(&self, material: &Material, wanted: &DVector<f64>) -> f64 {
        (wanted - self.stresses(material).0).norm_squared()
    }

    /// The normal equations of the fit of `material`'s stresses to `wanted`, in scaled parameters.
    fn system(&self, outer: &NormalSystem, material: &Material, wanted: &DVector<f64>) -> NormalSystem {
        let (stresses, slopes) = self.stresses(material);
        let misfit = wanted - stresses;
        let mut matrix = slopes.tr_mul(&slopes);
        // κ has no part in these stresses and stays.
        matrix[(0, 0)] = 1.0;
        NormalSystem {
            values: outer.parameters.iter().map(|p| material.value(*p)).collect(),
            scales: scales_of(material),
            gradient: slopes.tr_mul(&misfit),
            matrix,
            chi2: misfit.norm_squared(),
            ..outer.clone()
        }
    }

    /// Traceless principal Kirchhoff stresses Σμ λ̄^α of all states (kPa, times the root of the volume), and their
    /// derivatives with respect to the scaled parameters, κ first.
    pub(super) fn stresses(&self, material: &Material) -> (DVector<f64>, DMatrix<f64>) {
        let mut stresses = DVector::zeros(3 * self.states.len());
        let mut slopes = DMatrix::zeros(3 * self.states.len(), 2 * material.terms.len() + 1);
        for (s, (logs, root)) in self.states.iter().enumerate() {
            for (t, term) in material.terms.iter().enumerate() {
                let powers = logs.map(|e| root * term.mu_kpa * (term.alpha * e).exp());
                let by_alpha = [0, 1, 2].map(|j| powers[j] * logs[j] * term.alpha);
                let means = [powers, by_alpha].map(|v| v.iter().sum::<f64>() / 3.0);
                for j in 0..3 {
                    stresses[3 * s + j] += powers[j] - means[0];
                    slopes[(3 * s + j, 2 * t + 1)] = powers[j] - means[0];
                    slopes[(3 * s + j, 2 * t + 2)] = by_alpha[j] - means[1];
                }
            }
        }
        (stresses, slopes)
    }
}

/// A material and how far its stresses are from those wanted.
struct StressPoint {
    material: Material,
    misfit: f64,
}

/// The fit of a material's stresses to those that a step promises, within the limits of a step.
struct StressFit<'a> {
    path: &'a StressPath,
    limits: &'a Constraints,
    outer: &'a NormalSystem,
    wanted: &'a DVector<f64>,
}

impl StressFit<'_> {
    fn point(&self, material: Material) -> StressPoint {
        StressPoint { misfit: self.path.misfit(&material, self.wanted), material }
    }
}

impl LeastSquares for StressFit<'_> {
    type Point = StressPoint;
    type Linear = NormalSystem;
    type Error = CalibrationError;

    fn objective(&self, at: &StressPoint) -> f64 {
        at.misfit
    }

    fn linearise(&mut self, at: &StressPoint) -> Result<Option<NormalSystem>, CalibrationError> {
        Ok(Some(self.path.system(self.outer, &at.material, self.wanted)))
    }

    fn step(&mut self, _: &StressPoint, linear: &NormalSystem, damping: f64) -> Result<Option<Step>, CalibrationError> {
        let step = self.limits.step(linear, damping, true)?;
        Ok(Some(Step { change: step.change, promised: step.distance * step.distance }))
    }

    fn trial(
        &mut self,
        at: &StressPoint,
        linear: &NormalSystem,
        step: &Step,
        part: f64,
    ) -> Result<Option<StressPoint>, CalibrationError> {
        Ok(Some(self.point(linear.moved(&at.material, &(&step.change * part)))))
    }
}

#[cfg(test)]
mod tests {
    use super::super::options::{FitOptions, Held};
    use super::super::test_problem::{block, coarse, ogden};
    use super::*;
    use crate::fem::SolveOptions;
    use crate::sensitivity::FisherInformation;

    fn system(material: &Material) -> NormalSystem {
        let parameters = material.parameters();
        let n = parameters.len();
        NormalSystem {
            values: parameters.iter().map(|p| material.value(*p)).collect(),
            scales: scales_of(material),
            parameters,
            information: FisherInformation::none(material),
            matrix: DMatrix::identity(n, n),
            gradient: DVector::zeros(n),
            chi2: 1.0,
            loss_u: 0.0,
            loss_f: 0.0,
        }
    }

    fn limits(material: &Material) -> Constraints {
        Constraints::new(material, &FitOptions::default()).unwrap()
    }

    /// Exponents that a step draws together stop at the smallest distance.
    #[test]
    fn limits_hold_on_the_way() {
        let material = ogden(200.0, &[[16.0, 1.9], [0.35, 3.2]]);
        let (path, system) = (path(&material), system(&material));
        let step = DVector::from_column_slice(&[0.0, 0.0, 0.08, 0.0, -0.04]);
        let moved = path.moved(&limits(&material), &system, &material, &step).unwrap();
        let gap = moved.terms[1].alpha - moved.terms[0].alpha;
        assert!(gap >= 1.0 - 1e-9, "{gap}");
        let far = DVector::from_column_slice(&[0.0, 0.0, 0.3, 0.0, -0.3]);
        let moved = path.moved(&limits(&material), &system, &material, &far).unwrap();
        assert!(moved.terms[1].alpha - moved.terms[0].alpha >= 1.0 - 1e-9 || moved == system.moved(&material, &far));
    }

    fn path(material: &Material) -> StressPath {
        let specimen = block();
        let mut model =
            ForwardModel::new(crate::mesh::mesh_specimen(&specimen, &coarse(&specimen)).unwrap(), &specimen).unwrap();
        let state = model.solve(material, 4.0, None, &SolveOptions::default(), &|| false).unwrap();
        StressPath::new(&model, material, &[state])
    }

    fn two_terms() -> Material {
        ogden(200.0, &[[16.0, 1.9], [0.35, 8.0]])
    }

    fn distance(a: &Material, b: &Material) -> f64 {
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
            distance(
                &path.moved(&limits(&material), &system, &material, &step).unwrap(),
                &system.moved(&material, &step),
            )
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
        let (stresses, slopes) = path.stresses(&material);
        // α₂ up by 15 %, the other parameters such that stresses change least.
        let others = slopes.columns(1, 3).into_owned();
        let rest = (others.tr_mul(&others)).cholesky().unwrap().solve(&others.tr_mul(&(slopes.column(4) * -0.15)));
        let step = DVector::from_column_slice(&[0.0, rest[0], rest[1], rest[2], 0.15]);
        let system = system(&material);
        let wanted = &stresses + &slopes * &step;
        let missed = |m: &Material| (path.stresses(m).0 - &wanted).norm() / stresses.norm();
        let followed = missed(&path.moved(&limits(&material), &system, &material, &step).unwrap());
        let linear = missed(&system.moved(&material, &step));
        assert!(followed < 0.1 * linear, "{followed} {linear}");
    }

    #[test]
    fn held_parameters_and_single_terms_move_linearly() {
        let material = two_terms();
        let (path_two, system_two) = (path(&material), system(&material));
        let step = DVector::from_column_slice(&[0.1, 0.0, 0.06, -0.2, 0.0]);
        let held = FitOptions { held: Held::default().with(1).with(4), ..FitOptions::default() };
        let limits_two = Constraints::new(&material, &held).unwrap();
        let moved = path_two.moved(&limits_two, &system_two, &material, &step).unwrap();
        assert_eq!(moved.terms[0].mu_kpa, 16.0);
        assert_eq!(moved.terms[1].alpha, 8.0);
        assert_eq!(moved.bulk_kpa, 200.0 * 0.1f64.exp());
        let one = ogden(200.0, &[[16.0, 1.9]]);
        let step = DVector::from_column_slice(&[0.1, 0.3, -0.2]);
        let moved = path(&one).moved(&limits(&one), &system(&one), &one, &step).unwrap();
        assert_eq!(moved, system(&one).moved(&one, &step));
    }
}
