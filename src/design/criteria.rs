//! Relative covariance of the parameters from stored Fisher information, its criteria and their derivatives.
//!
//! The same definitions as [`crate::sensitivity::Covariance`] (a test compares them): relative parameters δξ/|ξ|, all
//! parameters estimated together, so those left out of a criterion (κ) are nuisance parameters: the block of the inverse
//! is the inverse of the Schur complement.

use super::study::ObjectiveKind;
use crate::material::{Ogden, Parameter};
use nalgebra::{DMatrix, SymmetricEigen};

/// Directions with an eigenvalue below this times the largest, at unit diagonal, are undetermined.
const NULL_EIGENVALUE: f64 = 1e-13;

/// Covariance of the relative parameters κ, μ₁, α₁, …
#[derive(Clone, Debug)]
pub struct RelativeCovariance {
    matrix: DMatrix<f64>,
    scales: Vec<f64>,
    shear: Vec<usize>,
}

impl RelativeCovariance {
    /// From information in the parameters' units, row by row; `None` where some parameter is not determined.
    pub fn of(material: &Ogden, information: &[f64]) -> Option<Self> {
        let parameters = material.parameters();
        let n = parameters.len();
        if information.len() != n * n || information.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let scales: Vec<f64> = parameters
            .iter()
            .map(|p| material.value(*p).abs())
            .map(|v| if v > 0.0 { v } else { 1.0 })
            .collect();
        let root: Vec<f64> = (0..n).map(|i| scales[i] * information[i * n + i].sqrt()).collect();
        if root.iter().any(|r| !(*r > 0.0)) {
            return None;
        }
        let scaled = DMatrix::from_fn(n, n, |i, j| scales[i] * information[i * n + j] * scales[j] / (root[i] * root[j]));
        let eigen = SymmetricEigen::new(scaled);
        let largest = eigen.eigenvalues.max();
        if eigen.eigenvalues.iter().any(|v| !(*v > NULL_EIGENVALUE * largest)) {
            return None;
        }
        let matrix = DMatrix::from_fn(n, n, |i, j| {
            (0..n)
                .map(|m| eigen.eigenvectors[(i, m)] * eigen.eigenvectors[(j, m)] / eigen.eigenvalues[m])
                .sum::<f64>()
                / (root[i] * root[j])
        });
        let shear = (0..n).filter(|&i| parameters[i] != Parameter::Kappa).collect();
        Some(RelativeCovariance { matrix, scales, shear })
    }

    /// Relative standard deviations of μ₁, α₁, …
    pub fn relative_sds(&self) -> Vec<f64> {
        self.shear.iter().map(|&i| self.matrix[(i, i)].sqrt()).collect()
    }

    /// dC for a change of the information (parameters' units, row by row): −C dR C.
    pub fn change(&self, information: &[f64]) -> DMatrix<f64> {
        let n = self.scales.len();
        let relative = DMatrix::from_fn(n, n, |i, j| self.scales[i] * information[i * n + j] * self.scales[j]);
        -(&self.matrix * relative * &self.matrix)
    }

    /// d ln(relative sd) of μ₁, α₁, … for a change of C.
    pub fn log_sd_rates(&self, change: &DMatrix<f64>) -> Vec<f64> {
        self.shear.iter().map(|&i| 0.5 * change[(i, i)] / self.matrix[(i, i)]).collect()
    }

    /// ln of an equivalent relative standard deviation of the parameters in `subset` (indices into μ₁, α₁, …), to be
    /// minimised, with its derivative along `changes` of C: D: (ln det C)/2n; A: ½ ln(tr C / n); E: ½ ln of the largest
    /// eigenvalue; worst: ln of the largest relative sd. At a repeated largest value one of the subgradients.
    pub fn log_criterion(
        &self,
        kind: ObjectiveKind,
        subset: &[usize],
        changes: &[DMatrix<f64>],
    ) -> Option<(f64, Vec<f64>)> {
        let indices: Vec<usize> = subset.iter().map(|&i| self.shear.get(i).copied()).collect::<Option<_>>()?;
        let n = indices.len();
        if n == 0 {
            return None;
        }
        let block_of = |m: &DMatrix<f64>| DMatrix::from_fn(n, n, |a, b| m[(indices[a], indices[b])]);
        let block = block_of(&self.matrix);
        let rates = |by: &dyn Fn(&DMatrix<f64>) -> f64| changes.iter().map(|c| by(&block_of(c))).collect();
        match kind {
            ObjectiveKind::DOptimal => {
                let cholesky = block.cholesky()?;
                let value = cholesky.l().diagonal().iter().map(|d| d.ln()).sum::<f64>() / n as f64;
                let inverse = cholesky.inverse();
                Some((value, rates(&|c| 0.5 * inverse.component_mul(c).sum() / n as f64)))
            }
            ObjectiveKind::AOptimal => {
                let trace = block.trace();
                Some((0.5 * (trace / n as f64).ln(), rates(&|c| 0.5 * c.trace() / trace)))
            }
            ObjectiveKind::EOptimal => {
                let eigen = SymmetricEigen::new(block);
                let top = eigen.eigenvalues.imax();
                let (value, vector) = (eigen.eigenvalues[top], eigen.eigenvectors.column(top).into_owned());
                Some((0.5 * value.ln(), rates(&|c| 0.5 * (vector.transpose() * c * &vector)[(0, 0)] / value)))
            }
            ObjectiveKind::WorstRelativeSd | ObjectiveKind::IntegratedSensitivity => {
                let worst = block.diagonal().imax();
                let value = block[(worst, worst)];
                Some((0.5 * value.ln(), rates(&|c| 0.5 * c[(worst, worst)] / value)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::OgdenTerm;
    use crate::sensitivity::{Criterion, FisherInformation, MeasurementNoise};

    fn material() -> Ogden {
        Ogden { schema: "ogden/1".into(), bulk_kpa: 2000.0, terms: vec![OgdenTerm { mu_kpa: 17.0, alpha: 1.9 }] }
    }

    /// Three voxels with sensitivities that determine everything.
    fn information(tilt: f64) -> FisherInformation {
        let fields = vec![
            vec![[1e-4, 2e-5, 0.0], [0.0, 3e-5, 1e-5], [2e-5, 0.0, 4e-5]],
            vec![[0.02, 0.01 + tilt, 0.0], [0.0, 0.03, 0.01], [0.01, 0.0, 0.02]],
            vec![[0.1, 0.3, 0.2], [0.2, 0.1 - 2.0 * tilt, 0.4], [0.3, 0.2, 0.1]],
        ];
        let noise = MeasurementNoise { displacement_sd_mm: [0.05; 3], force_sd_n: 0.02 };
        FisherInformation::of_drive(&material(), &fields, &[1.0; 3], &[0.0, 0.1, 0.3], &noise).unwrap()
    }

    fn rows(information: &FisherInformation) -> Vec<f64> {
        let m = information.matrix();
        (0..m.nrows()).flat_map(|i| (0..m.ncols()).map(move |j| m[(i, j)])).collect()
    }

    const KINDS: [(ObjectiveKind, Criterion); 4] = [
        (ObjectiveKind::DOptimal, Criterion::LogDeterminant),
        (ObjectiveKind::AOptimal, Criterion::Trace),
        (ObjectiveKind::EOptimal, Criterion::LargestEigenvalue),
        (ObjectiveKind::WorstRelativeSd, Criterion::WorstRelativeSd),
    ];

    #[test]
    fn agrees_with_the_sensitivity_room() {
        let information = information(0.0);
        let mine = RelativeCovariance::of(&material(), &rows(&information)).unwrap();
        let theirs = information.covariance();
        for (i, sd) in mine.relative_sds().iter().enumerate() {
            // Two orders of the same sums: rounding, amplified by the condition number.
            assert!((sd / theirs.relative_sd(i + 1).unwrap() - 1.0).abs() < 1e-9);
        }
        for (kind, criterion) in KINDS {
            let (log, _) = mine.log_criterion(kind, &[0, 1], &[]).unwrap();
            let value = theirs.criterion(criterion, &[1, 2]).unwrap();
            let expected = match criterion {
                Criterion::LogDeterminant => value / 4.0,
                Criterion::Trace => 0.5 * (value / 2.0).ln(),
                Criterion::LargestEigenvalue => 0.5 * value.ln(),
                Criterion::WorstRelativeSd => value.ln(),
            };
            assert!((log - expected).abs() < 1e-9, "{kind:?}");
        }
    }

    #[test]
    fn rates_are_differences() {
        let h = 1e-5;
        let (plus, minus, here) = (rows(&information(h)), rows(&information(-h)), rows(&information(0.0)));
        let rate: Vec<f64> = plus.iter().zip(&minus).map(|(p, m)| (p - m) / (2.0 * h)).collect();
        let of = |info: &[f64]| RelativeCovariance::of(&material(), info).unwrap();
        let change = of(&here).change(&rate);
        for (kind, _) in KINDS {
            let (_, rates) = of(&here).log_criterion(kind, &[0, 1], std::slice::from_ref(&change)).unwrap();
            let value = |info: &[f64]| of(info).log_criterion(kind, &[0, 1], &[]).unwrap().0;
            let difference = (value(&plus) - value(&minus)) / (2.0 * h);
            // Truncation h² against values of order 10–100.
            assert!((rates[0] - difference).abs() < 1e-5 * difference.abs().max(1.0), "{kind:?} {} {difference}", rates[0]);
        }
        let logs = |info: &[f64]| of(info).relative_sds().iter().map(|s| s.ln()).collect::<Vec<_>>();
        let (p, m) = (logs(&plus), logs(&minus));
        for (i, rate) in of(&here).log_sd_rates(&change).iter().enumerate() {
            assert!((rate - (p[i] - m[i]) / (2.0 * h)).abs() < 1e-5 * rate.abs().max(1.0));
        }
    }

    #[test]
    fn undetermined_parameters_have_no_covariance() {
        assert!(RelativeCovariance::of(&material(), &[0.0; 9]).is_none());
        assert!(RelativeCovariance::of(&material(), &[1.0; 9]).is_none());
        assert!(RelativeCovariance::of(&material(), &[f64::NAN; 9]).is_none());
        assert!(RelativeCovariance::of(&material(), &[1.0; 4]).is_none());
    }
}
