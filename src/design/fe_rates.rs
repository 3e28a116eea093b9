//! Derivatives of the integrals over quadrature points along a motion of the nodes and the drive, in closed form.
//!
//! With node positions X + tV and displacements u + t u′ (following the node), at a quadrature point
//! dF/dt = ∇V + ∇u′ − F ∇V and d(dV)/dt = tr(∇V) dV, gradients by X. Everything else is the chain rule through (λ, k),
//! through the largest principal stretch, and through s′ in the information. No solve and no field is differenced.

use super::evaluator::StateOutcome;
use super::study::{Normalisation, Study};
use crate::fem::{ParameterSensitivity, PathSensitivity, QuadraturePoint};
use crate::kinematics::{Tensor, decompose, inverse, principal_frame, principal_stretches, state_gradient};
use crate::material::{Ogden, Parameter};
use crate::mesh::Mesh;
use crate::sensitivity::{IntegratedSensitivity, parameter_sensitivity};

/// Shape functions and their gradients by X at every quadrature point of a mesh.
pub(super) struct Differentiator {
    shape: Vec<[f64; 27]>,
    gradients: Vec<[[f64; 3]; 27]>,
}

/// A solved state whose integrals are differentiated.
pub(super) struct StateAt<'a> {
    pub study: &'a Study,
    pub material: &'a Ogden,
    pub mesh: &'a Mesh,
    pub points: &'a [QuadraturePoint],
    pub sensitivities: &'a [ParameterSensitivity],
    pub integrated: &'a [IntegratedSensitivity],
}

fn contract(a: &Tensor, b: &Tensor) -> f64 {
    (0..3).map(|i| (0..3).map(|j| a[i][j] * b[i][j]).sum::<f64>()).sum()
}

impl Differentiator {
    /// Tables of a mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let rule = mesh.element_kind.quadrature();
        let shape = rule.iter().map(|(r, _)| mesh.element_kind.shape_functions(*r)).collect();
        let local: Vec<_> = rule.iter().map(|(r, _)| mesh.element_kind.shape_gradients(*r)).collect();
        let mut gradients = Vec::with_capacity(mesh.num_elements() * rule.len());
        for element in 0..mesh.num_elements() {
            let nodes = mesh.element(element);
            for d in &local {
                let mut map = [[0.0; 3]; 3];
                for (&node, d) in nodes.iter().zip(d) {
                    for i in 0..3 {
                        for j in 0..3 {
                            map[i][j] += mesh.nodes[node as usize][i] * d[j];
                        }
                    }
                }
                // A solved mesh has no inverted element, so the inverse exists.
                let back = inverse(&map).unwrap_or_default();
                let mut by_position = [[0.0; 3]; 27];
                for (g, d) in by_position.iter_mut().zip(d) {
                    for (j, g) in g.iter_mut().enumerate() {
                        *g = (0..3).map(|k| d[k] * back[k][j]).sum();
                    }
                }
                gradients.push(by_position);
            }
        }
        Differentiator { shape, gradients }
    }

    /// ∇v by X at a quadrature point.
    fn gradient(&self, mesh: &Mesh, point: usize, element: usize, field: &[[f64; 3]]) -> Tensor {
        let mut gradient = [[0.0; 3]; 3];
        for (&node, g) in mesh.element(element).iter().zip(&self.gradients[point]) {
            let v = field[node as usize];
            for i in 0..3 {
                for j in 0..3 {
                    gradient[i][j] += v[i] * g[j];
                }
            }
        }
        gradient
    }

    /// Derivative of a state's outcome along `path`, whose nodes move with `velocity` (`None`: the mesh stays).
    pub fn rate(&self, at: &StateAt, velocity: Option<&[[f64; 3]]>, path: &PathSensitivity) -> StateOutcome {
        let copies: f64 = [at.mesh.mirror.y, at.mesh.mirror.z].map(|m| if m { 2.0 } else { 1.0 }).iter().product();
        let shear: Vec<Parameter> = at.material.parameters().into_iter().filter(|p| *p != Parameter::Kappa).collect();
        let num = at.sensitivities.len();
        let rule = self.shape.len();
        let root = at.study.scan.noise_sd_mm.map(|sd| 1.0 / sd);
        let most = at
            .points
            .iter()
            .map(|p| principal_stretches(&p.deformation_gradient)[0])
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(0, |(i, _)| i);
        let (mut integrals, mut volume, mut volume_rate) = (vec![0.0; shear.len()], 0.0, 0.0);
        let mut information = vec![0.0; num * num];
        let mut largest_stretch = 0.0;
        let (mut local, mut local_rate) = (vec![[0.0; 3]; num], vec![[0.0; 3]; num]);
        for (n, point) in at.points.iter().enumerate() {
            let f = &point.deformation_gradient;
            let motion = velocity.map_or([[0.0; 3]; 3], |v| self.gradient(at.mesh, n, point.element, v));
            let change = self.gradient(at.mesh, n, point.element, &path.displacement);
            let mut rate = [[0.0; 3]; 3];
            for i in 0..3 {
                for j in 0..3 {
                    rate[i][j] =
                        motion[i][j] + change[i][j] - (0..3).map(|k| f[i][k] * motion[k][j]).sum::<f64>();
                }
            }
            let growth = (motion[0][0] + motion[1][1] + motion[2][2]) * point.volume_mm3;
            volume += point.volume_mm3;
            volume_rate += growth;
            let state = decompose(f);
            let by_f = state_gradient(f);
            for (sum, &parameter) in integrals.iter_mut().zip(&shear) {
                let s = parameter_sensitivity(at.material, parameter, state.stretch_amplitude, state.deformation_mode);
                let slope = by_f.map_or(0.0, |g| {
                    s.by_stretch_amplitude * contract(&g.stretch_amplitude, &rate)
                        + s.by_deformation_mode * contract(&g.deformation_mode, &rate)
                });
                *sum += growth * s.value + point.volume_mm3 * slope;
            }
            if n == most {
                largest_stretch = stretch_rate(f, &rate);
            }
            if num == 0 {
                continue;
            }
            self.gather(at, n % rule, point.element, root, &path.parameters, (&mut local, &mut local_rate));
            for i in 0..num {
                for j in 0..=i {
                    for c in 0..3 {
                        let (a, b, da, db) = (local[i][c], local[j][c], local_rate[i][c], local_rate[j][c]);
                        information[i * num + j] += growth * a * b + point.volume_mm3 * (da * b + a * db);
                    }
                }
            }
        }
        let voxel: f64 = at.study.scan.voxel_mm.iter().product();
        let force_precision = 1.0 / at.study.scan.force_sd_n.powi(2);
        for i in 0..num {
            for j in 0..=i {
                let (a, b) = (at.sensitivities[i].force_n, at.sensitivities[j].force_n);
                let (da, db) = (path.parameters[i].force_n, path.parameters[j].force_n);
                let value = copies / voxel * information[i * num + j] + force_precision * (da * b + a * db);
                information[i * num + j] = value;
                information[j * num + i] = value;
            }
        }
        let integrated = integrals
            .iter()
            .zip(at.integrated)
            .map(|(rate, value)| match at.study.objective.normalisation {
                Normalisation::Sum => copies * rate / voxel,
                Normalisation::VolumeIntegral => copies * rate,
                Normalisation::MeanPerVoxel => (rate - value.mean_per_voxel * volume_rate) / volume,
            })
            .collect();
        StateOutcome { integrated, information, force_n: path.force_n, largest_stretch }
    }

    /// Sensitivities and their rates at a quadrature point, over the noise.
    fn gather(
        &self,
        at: &StateAt,
        in_rule: usize,
        element: usize,
        root: [f64; 3],
        rates: &[ParameterSensitivity],
        (local, local_rate): (&mut [[f64; 3]], &mut [[f64; 3]]),
    ) {
        for (target, fields) in [(local, at.sensitivities), (local_rate, rates)] {
            for (value, field) in target.iter_mut().zip(fields) {
                *value = [0.0; 3];
                for (&node, weight) in at.mesh.element(element).iter().zip(&self.shape[in_rule]) {
                    for c in 0..3 {
                        value[c] += weight * root[c] * field.displacement[node as usize][c];
                    }
                }
            }
        }
    }
}

/// dλ₁/dt = n₁ · dF/dt · N₁.
fn stretch_rate(f: &Tensor, rate: &Tensor) -> f64 {
    let Some(frame) = principal_frame(f) else { return 0.0 };
    let (n, reference) = (frame.stretched_directions[0], frame.reference_directions[0]);
    let mut sum = 0.0;
    for i in 0..3 {
        for j in 0..3 {
            sum += n[i] * rate[i][j] * reference[j];
        }
    }
    sum / frame.stretches[0]
}
