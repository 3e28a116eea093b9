//! Exact derivatives of an equilibrium from its factorised tangent.
//!
//! With the condensed residual r(u, X, ξ) (displacements, node positions, material):
//!
//! * material: K s = −∂r/∂ξ, s = ∂u/∂ξ;
//! * along a path X + tV, drive + tḋ: K u′ = −d/dt r(u + t ḋ w, X + tV), u′ the derivative *following the node*;
//! * of s along that path: K s′ = −d/dt [∂r/∂ξ + K s](u + t u′, X + tV) at fixed s.
//!
//! The derivatives of r are closed forms ([`change`](super::change)). Those of ∂r/∂ξ + K s along a path are
//! fourth-order central differences of closed-form element vectors (no solve is differenced): with t a 1/500 of the
//! smallest element their error is (1/500)⁴ κ/μ ≈ 10⁻⁸ at κ/μ = 10³.

use super::assembler::Configuration;
use super::change::{ACCURACY, Change, ChangeSensitivity};
use super::error::{SolveError, StepFailure};
use super::rates::Rates;
use super::tangent::Tangent;
use crate::material::{MAX_TERMS, Material, OgdenTerm, Parameter};
use crate::mesh::Mesh;

/// A term of this part of the shear modulus is not there yet; its derivatives exist. Not even at singular edges, where
/// powers of large exponents are 10¹⁰, it is anything.
const NO_MODULUS: f64 = 1e-30;

/// Derivative of an equilibrium with respect to one material parameter.
#[derive(Clone, Debug)]
pub struct ParameterSensitivity {
    /// The parameter ξ.
    pub parameter: Parameter,
    /// ∂u/∂ξ at each node, mm per unit of ξ.
    pub displacement: Vec<[f64; 3]>,
    /// ∂F/∂ξ, N per unit of ξ (as [`Equilibrium::force_n`](super::Equilibrium::force_n)).
    pub force_n: f64,
}

/// Derivative of an equilibrium and of its material sensitivities along a path of node positions and drive.
#[derive(Clone, Debug)]
pub struct PathSensitivity {
    /// du/dt following each node, mm per unit of t.
    pub displacement: Vec<[f64; 3]>,
    /// dF/dt, N per unit of t.
    pub force_n: f64,
    /// The same of the force along +y ([`Equilibrium::normal_force_n`](super::Equilibrium::normal_force_n)).
    pub normal_force_n: f64,
    /// d/dt of the sensitivities given, in their order (displacements following each node).
    pub parameters: Vec<ParameterSensitivity>,
}

/// A path t ↦ (X + t `velocity`, u + t `rate`), differenced over multiples of `step`.
#[derive(Clone, Copy)]
struct Path<'a> {
    velocity: &'a [[f64; 3]],
    rate: &'a [[f64; 3]],
    step: f64,
}

impl Tangent<'_> {
    /// ∂u/∂ξ and ∂F/∂ξ for every parameter, in the order of
    /// [`Material::parameters`](crate::material::Material::parameters).
    ///
    /// # Errors
    /// [`SolveError::Linear`] if the tangent is not positive definite.
    pub fn material_sensitivities(&mut self) -> Result<Vec<ParameterSensitivity>, SolveError> {
        let parameters = self.material.parameters();
        let found = self.sensitivities_by(self.material, &parameters)?;
        let named = parameters.into_iter().zip(found);
        Ok(named
            .map(|(parameter, s)| ParameterSensitivity { parameter, displacement: s.displacement, force_n: s.force_n })
            .collect())
    }

    /// ∂u/∂μ and ∂F/∂μ, per kPa, of Ogden terms of `exponents` that the material does not have: what they would change.
    ///
    /// # Errors
    /// [`SolveError::TooManyTerms`] where the material has room for none; as [`Self::material_sensitivities`].
    pub fn further_term_sensitivities(&mut self, exponents: &[f64]) -> Result<Vec<ChangeSensitivity>, SolveError> {
        let num_own = self.material.terms.len();
        if num_own >= MAX_TERMS {
            return Err(SolveError::TooManyTerms { num_terms: num_own + 1, limit: MAX_TERMS });
        }
        let mu_kpa = NO_MODULUS * self.material.initial_shear_modulus_kpa();
        let mut all = Vec::with_capacity(exponents.len());
        for chunk in exponents.chunks(MAX_TERMS - num_own) {
            let mut wide = self.material.clone();
            wide.terms.extend(chunk.iter().map(|&alpha| OgdenTerm { mu_kpa, alpha }));
            let moduli: Vec<Parameter> = (num_own..wide.terms.len()).map(Parameter::Mu).collect();
            all.extend(self.sensitivities_by(&wide, &moduli)?);
        }
        Ok(all)
    }

    /// Those by some parameters of `material`, with which this is an equilibrium too.
    fn sensitivities_by(
        &mut self,
        material: &Material,
        parameters: &[Parameter],
    ) -> Result<Vec<ChangeSensitivity>, SolveError> {
        let assembler = self.assembler.clone();
        let rates_of = |displacement| {
            move |&parameter: &Parameter| Rates { parameter: Some(parameter), displacement, ..Rates::default() }
        };
        let rates: Vec<Rates> = parameters.iter().map(rates_of(None)).collect();
        let at = Configuration { material, ..self.configuration() };
        let derivatives = assembler.assemble_rates(&at, &rates, None).map_err(|cause| self.diverged(cause))?;
        let right: Vec<Vec<f64>> = derivatives.iter().map(|d| assembler.collect(d, -1.0)).collect();
        let displacements: Vec<Vec<[f64; 3]>> =
            self.solve_all(&right, ACCURACY)?.iter().map(|x| assembler.spread(x)).collect();
        let rates: Vec<Rates> =
            parameters.iter().zip(&displacements).map(|(parameter, u)| rates_of(Some(u))(parameter)).collect();
        let driven = Some(&assembler.plates().driven_elements[..]);
        let at = Configuration { material, ..self.configuration() };
        let forces = assembler.assemble_rates(&at, &rates, driven).map_err(|cause| self.diverged(cause))?;
        let of_parameter = |(displacement, residual): (Vec<[f64; 3]>, &Vec<[f64; 3]>)| {
            let [force_n, normal_force_n] = assembler.forces_n(assembler.reaction(residual));
            ChangeSensitivity { displacement, force_n, normal_force_n }
        };
        Ok(displacements.into_iter().zip(&forces).map(of_parameter).collect())
    }

    /// Derivatives along t ↦ (node positions X + t `velocity`, drive + t `drive_rate`) at t = 0; `sensitivities` are
    /// those of the same equilibrium (may be empty). `velocity` in mm per unit of t at each node (`None`: the mesh
    /// stays).
    ///
    /// # Errors
    /// [`SolveError::Linear`] if the tangent is not positive definite.
    pub fn path_sensitivity(
        &mut self,
        sensitivities: &[ParameterSensitivity],
        velocity: Option<&[[f64; 3]]>,
        drive_rate: f64,
    ) -> Result<PathSensitivity, SolveError> {
        self.path_sensitivity_of(sensitivities, &self.change_of_nodes(velocity, drive_rate))
    }

    /// As [`Self::path_sensitivity`] along a change of nodes and plates ([`Self::change_of_nodes`],
    /// [`Self::change_of_moved_plate`]).
    ///
    /// # Errors
    /// As [`Self::path_sensitivity`].
    pub fn path_sensitivity_of(
        &mut self,
        sensitivities: &[ParameterSensitivity],
        change: &Change,
    ) -> Result<PathSensitivity, SolveError> {
        let mut found = self.sensitivities(std::slice::from_ref(change))?;
        // One change, one derivative.
        let ChangeSensitivity { displacement, force_n, normal_force_n } = found.swap_remove(0);
        let assembler = self.assembler.clone();
        let mesh = assembler.mesh();
        let driven = Some(&assembler.plates().driven_elements[..]);
        let still = vec![[0.0; 3]; mesh.nodes.len()];
        let velocity = change.velocity.as_deref().unwrap_or(&still);
        let along = Path { velocity, rate: &displacement, step: difference_step(mesh, velocity, &displacement) };
        let mut reactions = Vec::with_capacity(sensitivities.len());
        let mut right = Vec::with_capacity(sensitivities.len());
        for s in sensitivities {
            let g = self.linearisation_along(along, s)?;
            right.push(assembler.collect(&g, -1.0));
            reactions.push(assembler.forces_n(assembler.reaction(&g))[0]);
        }
        let solutions = self.solve_all(&right, ACCURACY)?;
        let mut buffer = vec![[0.0; 3]; mesh.nodes.len()];
        let mut parameters = Vec::with_capacity(sensitivities.len());
        for ((s, x), g) in sensitivities.iter().zip(&solutions).zip(&reactions) {
            let change = assembler.spread(x);
            assembler
                .assemble_directional(&self.configuration(), Some(&change), None, driven, &mut buffer)
                .map_err(|cause| self.diverged(cause))?;
            parameters.push(ParameterSensitivity {
                parameter: s.parameter,
                displacement: change,
                force_n: g + assembler.forces_n(assembler.reaction(&buffer))[0],
            });
        }
        Ok(PathSensitivity { displacement, force_n, normal_force_n, parameters })
    }

    /// d/dt [∂r/∂ξ + K s] along a path.
    fn linearisation_along(&self, path: Path, sensitivity: &ParameterSensitivity) -> Result<Vec<[f64; 3]>, SolveError> {
        let (direction, parameter) = (Some(&sensitivity.displacement[..]), Some(sensitivity.parameter));
        self.difference(path, |at, out| self.assembler.assemble_directional(at, direction, parameter, None, out))
    }

    /// Fourth-order central difference of a nodal vector along a path.
    fn difference(
        &self,
        path: Path,
        vector: impl Fn(&Configuration, &mut [[f64; 3]]) -> Result<(), StepFailure>,
    ) -> Result<Vec<[f64; 3]>, SolveError> {
        let nodes = &self.assembler.mesh().nodes;
        let t = path.step;
        let mut sum = vec![[0.0; 3]; nodes.len()];
        let mut value = vec![[0.0; 3]; nodes.len()];
        for (multiple, weight) in [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)] {
            let moved = |base: &[[f64; 3]], rate: &[[f64; 3]]| -> Vec<[f64; 3]> {
                base.iter().zip(rate).map(|(a, b)| [0, 1, 2].map(|i| a[i] + multiple * t * b[i])).collect()
            };
            let positions = moved(nodes, path.velocity);
            let displacement = moved(&self.equilibrium.displacement, path.rate);
            let at = Configuration { material: self.material, positions: &positions, displacement: &displacement };
            vector(&at, &mut value).map_err(|cause| self.diverged(cause))?;
            for (s, v) in sum.iter_mut().zip(&value) {
                for i in 0..3 {
                    s[i] += weight / (12.0 * t) * v[i];
                }
            }
        }
        Ok(sum)
    }
}

/// t at which the fastest node or displacement moves by [`difference_length`].
fn difference_step(mesh: &Mesh, velocity: &[[f64; 3]], rate: &[[f64; 3]]) -> f64 {
    let speed = velocity.iter().chain(rate).flatten().fold(0.0f64, |s, x| s.max(x.abs()));
    difference_length(mesh) / speed.max(1e-12)
}

/// A 1/500 of the shortest element edge, mm. An edge is twice the smallest distance of two nodes that follow each other
/// in an element.
fn difference_length(mesh: &Mesh) -> f64 {
    let mut shortest = f64::INFINITY;
    for e in 0..mesh.num_elements() {
        for pair in mesh.element(e).windows(2) {
            let (a, b) = (mesh.nodes[pair[0] as usize], mesh.nodes[pair[1] as usize]);
            let d: f64 = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum();
            shortest = shortest.min(d);
        }
    }
    2.0 * shortest.sqrt() / 500.0
}
