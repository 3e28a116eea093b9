//! What a sample's load remembers: the force at one drive by the stress of another.
//!
//! In Simo's finite viscoelasticity (1987) each relaxation adds H = ∫ g e^{−(t−s)/τ} dS_iso to the second
//! Piola–Kirchhoff stress S, and the work of the load gives the force, F = ∫ (S + Σ H) : dE/dd dV. With the deformation
//! at a drive that of the elastic sample, whatever its history, all of this is in the numbers
//!
//! K(a; b) = ∫ S_iso(X; drive a) : dE/dd(X; drive b) dV,
//!
//! since F_H(t) = Σ g ∫ e^{−(t−s)/τ} ∂K(d(s); d(t))/∂s ds. K comes from finite elements, holes and all. K(b; b) is the
//! elastic force but for what pressure adds.

use crate::fem::{Equilibrium, ForwardModel, SolveError, Tangent};
use crate::material::{Material, first_piola_kirchhoff_stress};
use crate::rate::ForceTable;
use nalgebra::Matrix3;

/// K over both drives.
pub struct MemoryKernel {
    /// Rising drives b, mm; the first stands for rest.
    drives_mm: Vec<f64>,
    /// Per b: K(a; b) over a, N.
    rows: Vec<ForceTable>,
}

/// Stress and strain rate of one equilibrium at every quadrature point.
pub struct KernelState {
    drive_mm: f64,
    /// N per unit of ∫ S : dE/dd dV of the part that is meshed (kPa mm² = mN; mirrored parts and further samples
    /// counted).
    scale: f64,
    volume_mm3: Vec<f64>,
    /// S_iso, kPa.
    stress: Vec<Matrix3<f64>>,
    /// dE/dd, 1/mm.
    strain_rate: Vec<Matrix3<f64>>,
}

fn matrix(a: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| a[i][j])
}

impl KernelState {
    /// Of an equilibrium of `model` and its tangent.
    ///
    /// # Errors
    /// [`SolveError`]: the tangent is not positive definite.
    pub fn of(
        model: &ForwardModel,
        material: &Material,
        equilibrium: &Equilibrium,
        tangent: &mut Tangent,
    ) -> Result<KernelState, SolveError> {
        let rate = tangent.path_sensitivity(&[], None, 1.0)?;
        let isochoric = Material { bulk_kpa: 0.0, ..material.clone() };
        let here = model.quadrature_fields(material, equilibrium);
        // The deformation gradient of the rate alone is I + dF/dd.
        let moved = model.quadrature_fields_at(material, &model.mesh().nodes, &rate.displacement);
        let mut state = KernelState {
            drive_mm: equilibrium.drive_mm,
            scale: 1e-3 * model.multiplicity(),
            volume_mm3: here.iter().map(|q| q.volume_mm3).collect(),
            stress: Vec::with_capacity(here.len()),
            strain_rate: Vec::with_capacity(here.len()),
        };
        for (q, r) in here.iter().zip(&moved) {
            let f = matrix(&q.deformation_gradient);
            let f_rate = matrix(&r.deformation_gradient) - Matrix3::identity();
            let p_isochoric = matrix(&first_piola_kirchhoff_stress(&isochoric, &q.deformation_gradient));
            let inverse = f.try_inverse().unwrap_or_else(Matrix3::identity);
            let product = f.transpose() * f_rate;
            state.stress.push(inverse * p_isochoric);
            state.strain_rate.push(0.5 * (product + product.transpose()));
        }
        Ok(state)
    }
}

impl MemoryKernel {
    /// From states away from rest in one direction; the first one, close to rest, stands for it.
    pub fn new(states: &[KernelState]) -> Option<MemoryKernel> {
        // Distances from rest, and forces in the direction of the drives.
        let drives_mm: Vec<f64> = states.iter().map(|s| s.drive_mm.abs()).collect();
        let way = states.last().map_or(1.0, |s| s.drive_mm.signum());
        let from_rest: Vec<f64> = std::iter::once(0.0).chain(drives_mm.iter().copied()).collect();
        let mut rows = Vec::with_capacity(states.len());
        for b in states {
            let mut row = vec![0.0];
            for a in states {
                let sum: f64 =
                    (0..b.volume_mm3.len()).map(|q| b.volume_mm3[q] * a.stress[q].dot(&b.strain_rate[q])).sum();
                row.push(way * b.scale * sum);
            }
            rows.push(ForceTable::new(&from_rest, &row).ok()?);
        }
        (!rows.is_empty()).then_some(MemoryKernel { drives_mm, rows })
    }

    /// Histories K(d(t); b) for every b of the table. A drive in the other direction has the mirrored stress.
    pub fn histories(&self, drive_mm: &[f64]) -> Vec<Vec<f64>> {
        let at = |row: &ForceTable, d: f64| {
            let value = row.at(d.abs().min(row.range()[1])).map_or(0.0, |v| v.0);
            value * d.signum()
        };
        self.rows.iter().map(|row| drive_mm.iter().map(|d| at(row, *d)).collect()).collect()
    }

    /// Rows and their weights that make the row of a drive: the cubic through the four nearest.
    pub fn weights(&self, drive_mm: f64) -> Vec<(usize, f64)> {
        let (d, n) = (drive_mm.abs(), self.drives_mm.len());
        let after = self.drives_mm.partition_point(|b| *b <= d);
        let first = after.saturating_sub(2).min(n.saturating_sub(4));
        let nodes = first..n.min(first + 4);
        let clipped = d.clamp(self.drives_mm[0], self.drives_mm[n - 1]);
        nodes
            .clone()
            .map(|i| {
                let others = nodes.clone().filter(|j| *j != i);
                let weight: f64 =
                    others.map(|j| (clipped - self.drives_mm[j]) / (self.drives_mm[i] - self.drives_mm[j])).product();
                (i, weight)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::SolveOptions;
    use crate::homogeneous::{Deformation, ShearTerm};
    use crate::material::OgdenTerm;
    use crate::mesh::{MeshOptions, mesh_specimen};
    use crate::rate::{channels, memory};
    use crate::specimen::Specimen;

    fn states(drives: &[f64]) -> (Vec<KernelState>, Vec<(f64, f64)>) {
        let mut specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).unwrap();
        // So long and wide that nearly all of it is in simple shear.
        specimen.block.length_mm = 60.0;
        specimen.block.width_mm = 60.0;
        specimen.block.thickness_mm = 3.0;
        let material = Material { bulk_kpa: 3000.0, terms: vec![OgdenTerm { mu_kpa: 15.0, alpha: 2.4 }], law: None };
        let mesh = mesh_specimen(&specimen, &MeshOptions::scaled(&specimen, 6.0)).unwrap();
        let mut model = ForwardModel::new(mesh, &specimen).unwrap();
        let mut last = None;
        let (mut all, mut forces) = (Vec::new(), Vec::new());
        for &d in drives {
            let found = model.solve(&material, d, last.as_ref(), &SolveOptions::default(), &|| false).unwrap();
            forces.push((d, found.force_n));
            let mut tangent = model.tangent(&material, &found).unwrap();
            all.push(KernelState::of(&model, &material, &found, &mut tangent).unwrap());
            last = Some(found);
        }
        (all, forces)
    }

    /// A thin wide block is close to simple shear, whose memory is known in closed form from two channels.
    #[test]
    fn a_thin_block_remembers_as_simple_shear_does() {
        let drives = [0.003, 0.6, 1.2, 1.8, 2.4, 3.0];
        let (states, forces) = states(&drives);
        let kernel = MemoryKernel::new(&states).unwrap();
        // The work of the load is the force; what pressure does of it is small in shear, but for the singular edges.
        for (row, (drive, force)) in kernel.rows.iter().zip(&forces) {
            let found = row.at(*drive).unwrap().0;
            assert!((found / force - 1.0).abs() < 0.02, "{drive} mm: {found} {force}");
        }
        // Up to 3 mm, held, down to 1.5 mm, held.
        let times: Vec<f64> = (0..=200).map(|n| 0.2 * f64::from(n)).collect();
        let drive: Vec<f64> = times
            .iter()
            .map(|&t| {
                if t < 6.0 {
                    0.5 * t
                } else if t < 16.0 {
                    3.0
                } else {
                    (3.0 - 0.5 * (t - 16.0)).max(1.5)
                }
            })
            .collect();
        let remembered: Vec<Vec<f64>> = kernel.histories(&drive).iter().map(|h| memory(&times, h, 8.0).0).collect();
        let found: Vec<f64> = drive
            .iter()
            .enumerate()
            .map(|(n, d)| kernel.weights(*d).iter().map(|(row, w)| w * remembered[*row][n]).sum())
            .collect();
        let terms = [ShearTerm { modulus_kpa: 15.0 * 2.4, alpha: 2.4 }];
        let of_shear: Vec<_> =
            drive.iter().map(|d| channels(&terms, &Deformation::SimpleShear { shear: d / 3.0 })).collect();
        let mut expected = vec![0.0; drive.len()];
        for k in 0..2 {
            let stress: Vec<f64> = of_shear.iter().map(|c| c.stress[k]).collect();
            for (n, m) in memory(&times, &stress, 8.0).0.iter().enumerate() {
                expected[n] += of_shear[n].weight[k] * m;
            }
        }
        // Relative to each one's largest value; free ends and the interpolation leave some percent.
        let largest = |v: &[f64]| v.iter().fold(0.0f64, |s, x| s.max(x.abs()));
        let (a, b) = (largest(&found), largest(&expected));
        for n in 0..drive.len() {
            assert!(
                (found[n] / a - expected[n] / b).abs() < 0.02,
                "{}: {} {}",
                times[n],
                found[n] / a,
                expected[n] / b
            );
        }
    }
}
