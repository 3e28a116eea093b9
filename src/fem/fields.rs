//! Deformation and stress at the quadrature points, and the tractions of the plates.

use super::assembler::{Assembler, Configuration};
use super::element_data::ElementOutput;
use super::error::StepFailure;
use crate::material::LANES;

/// The state at one quadrature point.
#[derive(Clone, Copy, Debug)]
pub struct QuadraturePoint {
    /// Element index.
    pub element: usize,
    /// Reference position, mm.
    pub position: [f64; 3],
    /// Reference volume that the point stands for, mm³ (of the meshed part; mirrored parts are not counted).
    pub volume_mm3: f64,
    /// F, row current, column reference.
    pub deformation_gradient: [[f64; 3]; 3],
    /// σ = P Fᵀ / J, kPa.
    pub cauchy_stress: [[f64; 3]; 3],
}

impl Assembler {
    /// The fields at every quadrature point; pressures are the condensed ones where none are given.
    pub(super) fn quadrature_fields(&self, at: &Configuration, pressure: Option<&[[f64; 4]]>) -> Vec<QuadraturePoint> {
        let mut out = ElementOutput::default();
        let n = self.tables().num_nodes();
        let mut points = Vec::with_capacity(n * self.mesh().num_elements());
        for e in 0..self.mesh().num_elements() {
            // An equilibrium has no inverted element, so the kernel fills every field.
            self.kernels().residual(self.tables(), &self.input(e, at, pressure), &mut out);
            points.extend((0..n).map(|q| point_of(e, q, &out)));
        }
        points
    }

    /// Traction (kPa) of the plates on the sample at each node of the bonded faces: nodal force / area.
    pub(super) fn plate_tractions(&self, at: &Configuration) -> Result<Vec<[f64; 3]>, StepFailure> {
        let areas = self.mesh().face_areas();
        let mut residual = vec![[0.0; 3]; areas.len()];
        self.assemble_residual(at, None, &mut residual)?;
        let traction = |(r, area): (&[f64; 3], &f64)| if *area > 0.0 { r.map(|f| f / area) } else { [0.0; 3] };
        Ok(residual.iter().zip(&areas).map(traction).collect())
    }
}

fn point_of(element: usize, q: usize, out: &ElementOutput) -> QuadraturePoint {
    let (g, l) = (q / LANES, q % LANES);
    let f = out.deformation_gradient[g].map(|row| row.map(|x| x.0[l]));
    let p = out.stress[g].map(|row| row.map(|x| x.0[l]));
    let j = f[0][0] * (f[1][1] * f[2][2] - f[1][2] * f[2][1]) - f[0][1] * (f[1][0] * f[2][2] - f[1][2] * f[2][0])
        + f[0][2] * (f[1][0] * f[2][1] - f[1][1] * f[2][0]);
    let cauchy_stress = [0, 1, 2].map(|i| [0, 1, 2].map(|k| (0..3).map(|c| p[i][c] * f[k][c]).sum::<f64>() / j));
    QuadraturePoint {
        element,
        position: [0, 1, 2].map(|i| out.points[i][g].0[l]),
        volume_mm3: out.volume[g].0[l],
        deformation_gradient: f,
        cauchy_stress,
    }
}
