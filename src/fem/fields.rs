//! Deformation and stress at the quadrature points.

use super::element_data::ElementOutput;
use super::model::ForwardModel;
use super::newton::Equilibrium;
use crate::material::{LANES, Ogden};

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

impl ForwardModel {
    /// Deformation and stress at every quadrature point, element after element, in the order of
    /// [`crate::mesh::ElementKind::quadrature`].
    pub fn quadrature_fields(&self, material: &Ogden, equilibrium: &Equilibrium) -> Vec<QuadraturePoint> {
        self.fields_of(material, &self.mesh.nodes, &equilibrium.displacement, Some(&equilibrium.pressure))
    }

    /// As [`Self::quadrature_fields`] with the nodes at other `positions` and any displacement; the pressure is the
    /// condensed one.
    pub fn quadrature_fields_at(
        &self,
        material: &Ogden,
        positions: &[[f64; 3]],
        displacement: &[[f64; 3]],
    ) -> Vec<QuadraturePoint> {
        self.fields_of(material, positions, displacement, None)
    }

    fn fields_of(
        &self,
        material: &Ogden,
        positions: &[[f64; 3]],
        displacement: &[[f64; 3]],
        pressure: Option<&[[f64; 4]]>,
    ) -> Vec<QuadraturePoint> {
        let mut out = ElementOutput::default();
        let n = self.tables.num_nodes();
        let mut points = Vec::with_capacity(n * self.mesh.num_elements());
        for e in 0..self.mesh.num_elements() {
            let input = self.input(e, positions, displacement, pressure, material);
            // An equilibrium has no inverted element, so the kernel fills every field.
            self.kernels.residual(&self.tables, &input, &mut out);
            for q in 0..n {
                let (g, l) = (q / LANES, q % LANES);
                let f = out.deformation_gradient[g].map(|row| row.map(|x| x.0[l]));
                let p = out.stress[g].map(|row| row.map(|x| x.0[l]));
                let j = f[0][0] * (f[1][1] * f[2][2] - f[1][2] * f[2][1])
                    - f[0][1] * (f[1][0] * f[2][2] - f[1][2] * f[2][0])
                    + f[0][2] * (f[1][0] * f[2][1] - f[1][1] * f[2][0]);
                let cauchy_stress =
                    [0, 1, 2].map(|i| [0, 1, 2].map(|k| (0..3).map(|c| p[i][c] * f[k][c]).sum::<f64>() / j));
                points.push(QuadraturePoint {
                    element: e,
                    position: [0, 1, 2].map(|i| out.points[i][g].0[l]),
                    volume_mm3: out.volume[g].0[l],
                    deformation_gradient: f,
                    cauchy_stress,
                });
            }
        }
        points
    }
}
