//! Fisher information of a scan about the material's parameters.
//!
//! Data: the displacement of every voxel (independent Gaussian noise per component) and the load cell's force at every
//! drive. With s_i = ∂ū/∂ξ_i per voxel and f_i = ∂F/∂ξ_i,
//!
//! I_ij = Σ_drives [ Σ_voxels w Σ_c s_ic s_jc / σ_c² + f_i f_j / σ_F² ].
//!
//! Not included: the correlation of the noise of filtered scans, and errors of the model.

use crate::material::{Material, Parameter};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Why an information matrix was not made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InformationError {
    /// A standard deviation is not a positive number.
    #[error("{name} is {value}; a standard deviation must be positive and finite")]
    InvalidSd {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// Two things that must have the same length have not.
    #[error("{what} has {found} entries, {expected} are needed")]
    LengthMismatch {
        /// What was passed.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length it must have.
        expected: usize,
    },
    /// Matrices of different parameters or parameter values were added.
    #[error("information about {found:?} cannot be added to information about {expected:?}")]
    ParameterMismatch {
        /// Parameters of the added matrix.
        found: Vec<String>,
        /// Parameters of this one.
        expected: Vec<String>,
    },
    /// A parameter that the matrix does not have.
    #[error("{parameter} is not among the parameters {known:?}")]
    UnknownParameter {
        /// Its name.
        parameter: String,
        /// Names of the matrix's parameters.
        known: Vec<String>,
    },
    /// A sensitivity is NaN or infinite.
    #[error("the information about {parameter} is not finite; the state it was computed from is not an equilibrium")]
    NotFinite {
        /// Its name.
        parameter: String,
    },
}

/// Noise of what is measured at one drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasurementNoise {
    /// Standard deviation of a voxel's displacement along x, y, z, mm; infinite of a component that is not measured.
    pub displacement_sd_mm: [f64; 3],
    /// Standard deviation of the load cell's force (all samples together), N.
    pub force_sd_n: f64,
}

impl MeasurementNoise {
    pub(super) fn check(&self) -> Result<(), InformationError> {
        let names = ["noise_sd_mm along x", "noise_sd_mm along y", "noise_sd_mm along z"];
        let has_measured = self.displacement_sd_mm.iter().any(|sd| sd.is_finite());
        for (name, value) in names.into_iter().zip(self.displacement_sd_mm) {
            let is_unmeasured = has_measured && value == f64::INFINITY;
            if !is_unmeasured {
                check_sd(name, value)?;
            }
        }
        check_sd("force_sd_n", self.force_sd_n)
    }
}

/// A standard deviation must be above this: its square must not underflow either.
pub(super) const LEAST_SD: f64 = 1e-100;

fn check_sd(name: &'static str, value: f64) -> Result<(), InformationError> {
    if value.is_finite() && value > LEAST_SD { Ok(()) } else { Err(InformationError::InvalidSd { name, value }) }
}

/// Fisher information matrix about material parameters, in their own units (I_ij in 1/(ξ_i ξ_j)).
#[derive(Clone, Debug, PartialEq)]
pub struct FisherInformation {
    parameters: Vec<Parameter>,
    values: Vec<f64>,
    matrix: DMatrix<f64>,
}

impl FisherInformation {
    /// No information about the parameters of `material`, at its values.
    pub fn none(material: &Material) -> Self {
        let parameters = material.parameters();
        let values = parameters.iter().map(|&p| material.value(p)).collect();
        let n = parameters.len();
        FisherInformation { parameters, values, matrix: DMatrix::zeros(n, n) }
    }

    /// A matrix computed elsewhere, rows and columns in the order of [`Material::parameters`], in the parameters'
    /// units.
    ///
    /// # Errors
    /// [`InformationError::LengthMismatch`], [`InformationError::NotFinite`].
    pub fn from_matrix(material: &Material, matrix: DMatrix<f64>) -> Result<Self, InformationError> {
        let information = Self::none(material);
        check_length("rows of the matrix", matrix.nrows(), information.parameters.len())?;
        check_length("columns of the matrix", matrix.ncols(), information.parameters.len())?;
        let information = FisherInformation { matrix, ..information };
        information.check_finite()?;
        Ok(information)
    }

    /// Information of one drive.
    ///
    /// `voxel_sensitivities[i][v]` is ∂ū/∂ξ_i of voxel v (mm per unit of ξ_i) and `force_sensitivities[i]` is ∂F/∂ξ_i
    /// (N per unit), both in the order of [`Material::parameters`]; `weights[v]` comes from
    /// [`PartialVoxels::weights`](super::PartialVoxels::weights).
    ///
    /// # Errors
    /// [`InformationError::InvalidSd`], [`InformationError::LengthMismatch`], [`InformationError::NotFinite`].
    pub fn of_drive(
        material: &Material,
        voxel_sensitivities: &[Vec<[f64; 3]>],
        weights: &[f64],
        force_sensitivities: &[f64],
        noise: &MeasurementNoise,
    ) -> Result<Self, InformationError> {
        noise.check()?;
        let mut information = Self::none(material);
        let n = information.parameters.len();
        check_length("voxel sensitivities", voxel_sensitivities.len(), n)?;
        check_length("force sensitivities", force_sensitivities.len(), n)?;
        for field in voxel_sensitivities {
            check_length("a parameter's voxel sensitivities", field.len(), weights.len())?;
        }
        let precision = noise.displacement_sd_mm.map(|sd| 1.0 / (sd * sd));
        for i in 0..n {
            for j in 0..=i {
                let (a, b) = (&voxel_sensitivities[i], &voxel_sensitivities[j]);
                let mut sum = 0.0;
                for ((a, b), w) in a.iter().zip(b).zip(weights) {
                    sum += w * (precision[0] * a[0] * b[0] + precision[1] * a[1] * b[1] + precision[2] * a[2] * b[2]);
                }
                information.set(i, j, sum);
            }
        }
        information.add_force(force_sensitivities, noise.force_sd_n);
        information.check_finite()?;
        Ok(information)
    }

    pub(super) fn set(&mut self, i: usize, j: usize, value: f64) {
        self.matrix[(i, j)] = value;
        self.matrix[(j, i)] = value;
    }

    pub(super) fn add_force(&mut self, force_sensitivities: &[f64], force_sd_n: f64) {
        for (i, a) in force_sensitivities.iter().enumerate() {
            for (j, b) in force_sensitivities.iter().enumerate() {
                self.matrix[(i, j)] += (a / force_sd_n) * (b / force_sd_n);
            }
        }
    }

    pub(super) fn check_finite(&self) -> Result<(), InformationError> {
        for (i, parameter) in self.parameters.iter().enumerate() {
            if self.matrix.row(i).iter().any(|x| !x.is_finite()) {
                return Err(InformationError::NotFinite { parameter: parameter.name() });
            }
        }
        Ok(())
    }

    /// Parameters, in the order of rows and columns.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Parameter values at which the information holds.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The matrix.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// Index of a parameter.
    ///
    /// # Errors
    /// [`InformationError::UnknownParameter`].
    pub fn index_of(&self, parameter: Parameter) -> Result<usize, InformationError> {
        self.parameters
            .iter()
            .position(|p| *p == parameter)
            .ok_or_else(|| InformationError::UnknownParameter { parameter: parameter.name(), known: self.names() })
    }

    /// Indices of all μᵢ and αᵢ: the usual subset of the criteria, with κ as a nuisance.
    pub fn shear_indices(&self) -> Vec<usize> {
        (0..self.parameters.len()).filter(|&i| self.parameters[i] != Parameter::Kappa).collect()
    }

    fn names(&self) -> Vec<String> {
        self.parameters.iter().map(|p| p.name()).collect()
    }

    /// Adds the information of independent data about the same parameters at the same values.
    ///
    /// # Errors
    /// [`InformationError::ParameterMismatch`].
    pub fn add(&mut self, other: &FisherInformation) -> Result<(), InformationError> {
        self.add_times(1.0, other)
    }

    /// Adds `factor` times another's.
    ///
    /// # Errors
    /// [`InformationError::ParameterMismatch`].
    pub(super) fn add_times(&mut self, factor: f64, other: &FisherInformation) -> Result<(), InformationError> {
        // Values are copied, never computed, so equality of bits is what is meant.
        let is_same = self.values.len() == other.values.len()
            && self.values.iter().zip(&other.values).all(|(a, b)| a.to_bits() == b.to_bits());
        if !is_same || self.parameters != other.parameters {
            return Err(InformationError::ParameterMismatch { found: other.names(), expected: self.names() });
        }
        self.matrix += &other.matrix * factor;
        Ok(())
    }

    /// Adds what is known beforehand: a Gaussian prior of standard deviation `sd` (parameter's unit).
    ///
    /// # Errors
    /// [`InformationError::InvalidSd`], [`InformationError::UnknownParameter`].
    pub fn add_prior(&mut self, parameter: Parameter, sd: f64) -> Result<(), InformationError> {
        check_sd("prior standard deviation", sd)?;
        let i = self.index_of(parameter)?;
        self.matrix[(i, i)] += 1.0 / (sd * sd);
        Ok(())
    }

    /// As [`Self::add_prior`] for ln ξ: `log_sd` is the standard deviation of ln ξ, to first order sd = |ξ| × `log_sd`.
    ///
    /// # Errors
    /// As [`Self::add_prior`].
    pub fn add_log_prior(&mut self, parameter: Parameter, log_sd: f64) -> Result<(), InformationError> {
        check_sd("prior standard deviation of the logarithm", log_sd)?;
        let i = self.index_of(parameter)?;
        self.add_prior(parameter, log_sd * self.values[i].abs())
    }
}

fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), InformationError> {
    if found == expected { Ok(()) } else { Err(InformationError::LengthMismatch { what, found, expected }) }
}

#[cfg(test)]
pub(crate) mod tests;
