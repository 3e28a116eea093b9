//! Fisher information about the material and the unknowns of the set-up together.
//!
//! With the matrix I = [A C; Cᵀ B] of the data about material and unknowns, and P = diag(σ²) known beforehand of the
//! unknowns, what the data tell of the material once the unknowns are estimated too is the Schur complement
//! A − C (B + P⁻¹)⁻¹ Cᵀ.

use super::information::{FisherInformation, InformationError, MeasurementNoise};
use crate::material::Material;
use nalgebra::DMatrix;

/// How the data of one drive change with an unknown of the set-up.
#[derive(Clone, Debug)]
pub struct NuisanceColumn {
    /// Voxel averages of the displacement's change; `None` where it does not change.
    pub field: Option<Vec<[f64; 3]>>,
    /// The force's change, N.
    pub force_n: f64,
}

/// Information about material and unknowns.
#[derive(Clone, Debug)]
pub struct JointInformation {
    /// A.
    material: FisherInformation,
    /// C.
    cross: DMatrix<f64>,
    /// B.
    own: DMatrix<f64>,
}

impl JointInformation {
    /// No information about `num` unknowns.
    pub fn none(material: &Material, num: usize) -> JointInformation {
        JointInformation::of_scan(FisherInformation::none(material), num)
    }

    /// Of a scan that tells nothing of `num` unknowns.
    pub fn of_scan(material: FisherInformation, num: usize) -> JointInformation {
        let n = material.parameters().len();
        JointInformation { material, cross: DMatrix::zeros(n, num), own: DMatrix::zeros(num, num) }
    }

    /// Of a scanned drive: `material` is what it tells of the material alone, from `fields` (mm per unit of each
    /// parameter, voxel by voxel) and `forces` (N per unit), both as in [`FisherInformation::of_drive`].
    pub fn of_drive(
        material: FisherInformation,
        fields: &[Vec<[f64; 3]>],
        forces: &[f64],
        nuisances: &[NuisanceColumn],
        weights: &[f64],
        noise: &MeasurementNoise,
    ) -> JointInformation {
        let precision = noise.displacement_sd_mm.map(|sd| 1.0 / (sd * sd));
        let inner = |a: &[[f64; 3]], b: &Option<Vec<[f64; 3]>>| -> f64 {
            let Some(b) = b else { return 0.0 };
            let products = a.iter().zip(b).zip(weights);
            products.map(|((a, b), w)| w * (0..3).map(|c| precision[c] * a[c] * b[c]).sum::<f64>()).sum()
        };
        let of_force = |a: f64, b: f64| (a / noise.force_sd_n) * (b / noise.force_sd_n);
        let num = nuisances.len();
        let cross = DMatrix::from_fn(fields.len(), num, |i, a| {
            inner(&fields[i], &nuisances[a].field) + of_force(forces[i], nuisances[a].force_n)
        });
        let own = DMatrix::from_fn(num, num, |a, b| {
            let field = nuisances[a].field.as_deref().map_or(0.0, |field| inner(field, &nuisances[b].field));
            field + of_force(nuisances[a].force_n, nuisances[b].force_n)
        });
        JointInformation { material, cross, own }
    }

    /// Adds a force that was read without a scan: its derivatives with respect to material and unknowns.
    pub fn add_force(&mut self, forces: &[f64], nuisances: &[f64], force_sd_n: f64) {
        self.material.add_force(forces, force_sd_n);
        let weight = 1.0 / (force_sd_n * force_sd_n);
        for (a, of_a) in nuisances.iter().enumerate() {
            for (i, f) in forces.iter().enumerate() {
                self.cross[(i, a)] += weight * f * of_a;
            }
            for (b, of_b) in nuisances.iter().enumerate() {
                self.own[(a, b)] += weight * of_a * of_b;
            }
        }
    }

    /// Adds another drive's.
    ///
    /// # Errors
    /// [`InformationError::ParameterMismatch`].
    pub fn add(&mut self, other: &JointInformation) -> Result<(), InformationError> {
        self.material.add(&other.material)?;
        self.cross += &other.cross;
        self.own += &other.own;
        Ok(())
    }

    /// Adds `factor` times another's: negative where data are taken away that were counted before.
    ///
    /// # Errors
    /// [`InformationError::ParameterMismatch`].
    pub fn add_times(&mut self, factor: f64, other: &JointInformation) -> Result<(), InformationError> {
        self.material.add_times(factor, &other.material)?;
        self.cross += &other.cross * factor;
        self.own += &other.own * factor;
        Ok(())
    }

    /// The same information about relative changes of the parameters, carried to another material of as many terms:
    /// I_ij ξ_i ξ_j and C_ia ξ_i stay as they are. For averages over materials that a fit leaves possible.
    ///
    /// # Errors
    /// [`InformationError::LengthMismatch`], [`InformationError::NotFinite`].
    pub fn carried_to(&self, material: &Material) -> Result<JointInformation, InformationError> {
        let values: Vec<f64> = material.parameters().into_iter().map(|p| material.value(p)).collect();
        let ratio: Vec<f64> = self.material.values().iter().zip(&values).map(|(own, new)| own / new).collect();
        let n = ratio.len();
        let matrix = self.material.matrix();
        let carried = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
            if i < n && j < n { ratio[i] * matrix[(i, j)] * ratio[j] } else { f64::NAN }
        });
        let cross = DMatrix::from_fn(self.cross.nrows(), self.cross.ncols(), |i, a| {
            ratio.get(i).map_or(f64::NAN, |r| r * self.cross[(i, a)])
        });
        let material = FisherInformation::from_matrix(material, carried)?;
        Ok(JointInformation { material, cross, own: self.own.clone() })
    }

    /// What is left for the material once the unknowns, known beforehand to the standard deviations `sd`, are estimated
    /// too.
    ///
    /// # Errors
    /// [`InformationError::NotFinite`].
    pub fn about_material(&self, material: &Material, sd: &[f64]) -> Result<FisherInformation, InformationError> {
        if sd.is_empty() {
            self.material.check_finite()?;
            return Ok(self.material.clone());
        }
        // In units of the standard deviations, so that the matrix is I + something positive.
        let num = sd.len();
        let own = DMatrix::from_fn(num, num, |a, b| sd[a] * sd[b] * self.own[(a, b)] + if a == b { 1.0 } else { 0.0 });
        let cross = DMatrix::from_fn(self.cross.nrows(), num, |i, a| self.cross[(i, a)] * sd[a]);
        let lost = match own.cholesky() {
            Some(factor) => &cross * factor.solve(&cross.transpose()),
            None => DMatrix::from_element(cross.nrows(), cross.nrows(), f64::NAN),
        };
        FisherInformation::from_matrix(material, self.material.matrix() - lost)
    }
}

#[cfg(test)]
mod tests {
    use super::super::information::tests::one_term;
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// The inverse of the Schur complement is the material's block of the inverse of the whole matrix.
    #[test]
    fn unknowns_are_estimated_beside_the_material() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let (num_voxels, n, m) = (40, 3, 2);
        let mut field =
            || (0..num_voxels).map(|_| [0; 3].map(|_: i32| rng.random_range(-1.0..1.0))).collect::<Vec<_>>();
        let fields: Vec<Vec<[f64; 3]>> = (0..n).map(|_| field()).collect();
        let nuisances =
            vec![NuisanceColumn { field: Some(field()), force_n: 0.7 }, NuisanceColumn { field: None, force_n: 1.0 }];
        let noise = MeasurementNoise { displacement_sd_mm: [0.5, 0.4, 0.3], force_sd_n: 0.2 };
        let (weights, forces, sd) = (vec![1.0; num_voxels], [0.3, -0.2, 0.9], [0.05, 0.4]);
        let alone = FisherInformation::of_drive(&one_term(), &fields, &weights, &forces, &noise).unwrap();
        let mut joint = JointInformation::of_drive(alone, &fields, &forces, &nuisances, &weights, &noise);
        joint.add_force(&[0.1, 0.5, 0.2], &[0.4, 1.0], noise.force_sd_n);
        let about = joint.about_material(&one_term(), &sd).unwrap();

        // All columns as one long vector of data each.
        let column = |field: Option<&Vec<[f64; 3]>>, force: [f64; 2]| -> Vec<f64> {
            let mut all: Vec<f64> = match field {
                Some(f) => f.iter().flat_map(|u| (0..3).map(|c| u[c] / noise.displacement_sd_mm[c])).collect(),
                None => vec![0.0; 3 * num_voxels],
            };
            all.extend(force.map(|f| f / noise.force_sd_n));
            all
        };
        let second = [0.1, 0.5, 0.2, 0.4, 1.0];
        let mut columns: Vec<Vec<f64>> = (0..n).map(|i| column(Some(&fields[i]), [forces[i], second[i]])).collect();
        for (a, nuisance) in nuisances.iter().enumerate() {
            columns.push(column(nuisance.field.as_ref(), [nuisance.force_n, second[n + a]]));
        }
        let mut whole =
            DMatrix::from_fn(n + m, n + m, |i, j| columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum::<f64>());
        for a in 0..m {
            whole[(n + a, n + a)] += sd[a].powi(-2);
        }
        let expected = whole.try_inverse().unwrap();
        let found = about.matrix().clone().try_inverse().unwrap();
        for i in 0..n {
            for j in 0..n {
                // Rounding of two inverses of well-conditioned matrices.
                assert!((found[(i, j)] - expected[(i, j)]).abs() < 1e-9 * expected[(i, i)].abs().max(expected[(j, j)]));
            }
        }
    }
}
