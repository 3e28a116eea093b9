//! The covariance that an information matrix promises, and the optimality criteria of it.

use super::information::FisherInformation;
use crate::material::Parameter;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// Largest relative standard deviation of an identifiable parameter: at ½ the 95 % interval just reaches zero.
pub const IDENTIFIABILITY_LIMIT: f64 = 0.5;

/// A direction counts as undetermined where its eigenvalue, in the information matrix scaled to a unit diagonal, is
/// below this times the largest: sums over some 10⁴ data carry about that much rounding.
const NULL_EIGENVALUE: f64 = 1e-13;

/// A parameter shares an undetermined direction where its component in it exceeds this.
const NULL_COMPONENT: f64 = 1e-5;

/// What a parameter's standard deviation would be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PromisedSd {
    /// `kappa`, `mu_1`, `alpha_1`, …
    pub parameter: String,
    /// Standard deviation in the parameter's unit; null where the data do not determine the parameter at all.
    pub value: Option<f64>,
    /// Standard deviation / |parameter|.
    pub relative_sd: Option<f64>,
    /// Whether the relative standard deviation is below the limit in use.
    pub identifiable: bool,
    /// What the mesh may put the standard deviation wrong by, relative to it: in 19 of 20 cases no more. Absent where
    /// no coarser mesh was solved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub discretisation_relative: Option<f64>,
}

impl PromisedSd {
    /// Whether it is that of any parameter but κ.
    pub fn is_of_shear(&self) -> bool {
        Parameter::named(&self.parameter) != Some(Parameter::Kappa)
    }
}

/// A figure of merit of the relative covariance C of chosen parameters, all others being estimated as well (nuisance).
/// All are to be **minimised**.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// D-optimal: ln det C. The generalised relative standard deviation of n parameters is exp(value / 2n).
    LogDeterminant,
    /// A-optimal: trace C, the sum of the relative variances.
    Trace,
    /// E-optimal: the largest eigenvalue of C, the relative variance of the worst combination.
    LargestEigenvalue,
    /// The largest relative standard deviation of a single parameter.
    WorstRelativeSd,
}

/// Covariance of relative parameters δξ/|ξ| (δξ itself for a parameter that is zero).
#[derive(Clone, Debug, PartialEq)]
pub struct Covariance {
    parameters: Vec<Parameter>,
    /// |ξ|, or 1 for a parameter that is zero.
    scales: Vec<f64>,
    relative: DMatrix<f64>,
    is_determined: Vec<bool>,
}

impl FisherInformation {
    /// The covariance that the data promise (Cramér–Rao).
    pub fn covariance(&self) -> Covariance {
        Covariance::of(self)
    }
}

impl Covariance {
    pub(super) fn of(information: &FisherInformation) -> Self {
        let n = information.parameters().len();
        let scales: Vec<f64> = information.values().iter().map(|v| if v.abs() > 0.0 { v.abs() } else { 1.0 }).collect();
        let relative_information = DMatrix::from_fn(n, n, |i, j| scales[i] * information.matrix()[(i, j)] * scales[j]);
        // A parameter without any information has a zero row; it takes no part in the inverse.
        let known: Vec<usize> = (0..n).filter(|&i| relative_information[(i, i)] > 0.0).collect();
        let root: Vec<f64> = known.iter().map(|&i| relative_information[(i, i)].sqrt()).collect();
        let scaled = DMatrix::from_fn(known.len(), known.len(), |a, b| {
            relative_information[(known[a], known[b])] / (root[a] * root[b])
        });
        let eigen = SymmetricEigen::new(scaled);
        let largest = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
        let mut relative = DMatrix::zeros(n, n);
        let mut is_determined = vec![false; n];
        for &i in &known {
            is_determined[i] = true;
        }
        for (m, &value) in eigen.eigenvalues.iter().enumerate() {
            let vector = eigen.eigenvectors.column(m);
            if value <= NULL_EIGENVALUE * largest {
                for (a, &i) in known.iter().enumerate() {
                    is_determined[i] &= vector[a].abs() < NULL_COMPONENT;
                }
                continue;
            }
            for (a, &i) in known.iter().enumerate() {
                for (b, &j) in known.iter().enumerate() {
                    relative[(i, j)] += vector[a] * vector[b] / (value * root[a] * root[b]);
                }
            }
        }
        Covariance { parameters: information.parameters().to_vec(), scales, relative, is_determined }
    }

    /// The sandwich M⁻¹ B M⁻¹ of an estimate whose weights are not the inverse of the noise's covariance: this
    /// covariance is M⁻¹, `score` is B, the covariance of the weighted misfit's gradient, in the parameters' units.
    pub fn with_score(&self, score: &DMatrix<f64>) -> Covariance {
        let n = self.parameters.len();
        let relative_score = DMatrix::from_fn(n, n, |i, j| self.scales[i] * score[(i, j)] * self.scales[j]);
        let relative = &self.relative * relative_score * &self.relative;
        Covariance { relative: 0.5 * (&relative + relative.transpose()), ..self.clone() }
    }

    /// Trace of this covariance times `score`: how many parameters' worth of noise an estimate takes up.
    pub fn absorbed(&self, score: &DMatrix<f64>) -> f64 {
        let n = self.parameters.len();
        (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| self.relative[(i, j)] * self.scales[i] * self.scales[j] * score[(j, i)])
            .sum()
    }

    /// The covariance times `factor`.
    pub fn scaled(&self, factor: f64) -> Covariance {
        Covariance { relative: &self.relative * factor, ..self.clone() }
    }

    /// Standard deviation of Σ gradient_i ξ_i, `gradient` in 1 / the parameters' units; none where a parameter with a
    /// gradient is undetermined.
    pub fn sd_along(&self, gradient: &[f64]) -> Option<f64> {
        let mut variance = 0.0;
        for (i, a) in gradient.iter().enumerate() {
            for (j, b) in gradient.iter().enumerate() {
                if a.abs() > 0.0 && b.abs() > 0.0 {
                    variance += a * b * self.covariance(i, j)?;
                }
            }
        }
        Some(variance.max(0.0).sqrt())
    }

    /// Parameters, in the order of indices.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Relative standard deviation; none where the data do not determine the parameter.
    pub fn relative_sd(&self, index: usize) -> Option<f64> {
        self.is_determined[index].then(|| self.relative[(index, index)].sqrt())
    }

    /// Standard deviation in the parameter's unit.
    pub fn sd(&self, index: usize) -> Option<f64> {
        self.relative_sd(index).map(|sd| sd * self.scales[index])
    }

    /// Covariance of two parameters in their units.
    pub fn covariance(&self, i: usize, j: usize) -> Option<f64> {
        (self.is_determined[i] && self.is_determined[j])
            .then(|| self.relative[(i, j)] * self.scales[i] * self.scales[j])
    }

    /// Correlation of two parameters.
    pub fn correlation(&self, i: usize, j: usize) -> Option<f64> {
        Some((self.relative[(i, j)] / (self.relative_sd(i)? * self.relative_sd(j)?)).clamp(-1.0, 1.0))
    }

    /// The correlation matrix; null where either parameter is undetermined.
    pub fn correlation_matrix(&self) -> Vec<Vec<Option<f64>>> {
        let n = self.parameters.len();
        (0..n).map(|i| (0..n).map(|j| self.correlation(i, j)).collect()).collect()
    }

    /// Promised standard deviations of all parameters; identifiable are those below `limit`
    /// ([`IDENTIFIABILITY_LIMIT`]).
    pub fn promised_sd(&self, limit: f64) -> Vec<PromisedSd> {
        (0..self.parameters.len())
            .map(|i| {
                let relative_sd = self.relative_sd(i);
                PromisedSd {
                    parameter: self.parameters[i].name(),
                    value: self.sd(i),
                    relative_sd,
                    identifiable: relative_sd.is_some_and(|sd| sd < limit),
                    discretisation_relative: None,
                }
            })
            .collect()
    }

    /// Ratio of the largest to the smallest eigenvalue of the relative covariance of the parameters `subset`.
    pub fn condition_number(&self, subset: &[usize]) -> Option<f64> {
        let eigenvalues = self.block(subset)?.symmetric_eigenvalues();
        Some(eigenvalues.max() / eigenvalues.min())
    }

    /// The criterion over the parameters `subset` (indices), with all others as nuisance; none where one of them is
    /// undetermined or the subset is empty.
    pub fn criterion(&self, criterion: Criterion, subset: &[usize]) -> Option<f64> {
        let block = self.block(subset)?;
        match criterion {
            Criterion::LogDeterminant => {
                Some(2.0 * block.cholesky()?.l().diagonal().iter().map(|d| d.ln()).sum::<f64>())
            }
            Criterion::Trace => Some(block.trace()),
            Criterion::LargestEigenvalue => Some(block.symmetric_eigenvalues().max()),
            Criterion::WorstRelativeSd => Some(block.diagonal().max().sqrt()),
        }
    }

    /// Derivative of the criterion with respect to the information matrix in parameter units: ∂Φ/∂I_ij with the entries
    /// (i, j) and (j, i) taken apart, so that dΦ = Σ_ij gradient_ij dI_ij. From dC = −C dI C. At a repeated largest
    /// value one of the subgradients.
    pub fn criterion_gradient(&self, criterion: Criterion, subset: &[usize]) -> Option<DMatrix<f64>> {
        let block = self.block(subset)?;
        let by_block = match criterion {
            Criterion::LogDeterminant => block.cholesky()?.inverse(),
            Criterion::Trace => DMatrix::identity(subset.len(), subset.len()),
            Criterion::LargestEigenvalue => {
                let eigen = SymmetricEigen::new(block);
                let vector: DVector<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
                &vector * vector.transpose()
            }
            Criterion::WorstRelativeSd => {
                let worst = block.diagonal().imax();
                let mut gradient = DMatrix::zeros(subset.len(), subset.len());
                gradient[(worst, worst)] = 0.5 / block[(worst, worst)].sqrt();
                gradient
            }
        };
        let n = self.parameters.len();
        let mut padded = DMatrix::zeros(n, n);
        for (a, &i) in subset.iter().enumerate() {
            for (b, &j) in subset.iter().enumerate() {
                padded[(i, j)] = by_block[(a, b)];
            }
        }
        let mut gradient = -(&self.relative * padded * &self.relative);
        for i in 0..n {
            for j in 0..n {
                gradient[(i, j)] *= self.scales[i] * self.scales[j];
            }
        }
        Some(gradient)
    }

    fn block(&self, subset: &[usize]) -> Option<DMatrix<f64>> {
        let is_known = |&i: &usize| self.is_determined.get(i).copied().unwrap_or(false);
        if subset.is_empty() || !subset.iter().all(is_known) {
            return None;
        }
        Some(DMatrix::from_fn(subset.len(), subset.len(), |a, b| self.relative[(subset[a], subset[b])]))
    }
}

#[cfg(test)]
mod tests {
    use super::super::information::tests::one_term;
    use super::*;
    use crate::material::{Material, OgdenTerm};

    const ALL: [Criterion; 4] =
        [Criterion::LogDeterminant, Criterion::Trace, Criterion::LargestEigenvalue, Criterion::WorstRelativeSd];

    /// An information matrix with given relative entries for κ, μ, α.
    fn information(relative: [[f64; 3]; 3]) -> FisherInformation {
        let mut information = FisherInformation::none(&one_term());
        let values = information.values().to_vec();
        for i in 0..3 {
            for j in 0..3 {
                information.set(i, j, relative[i][j] / (values[i] * values[j]));
            }
        }
        information
    }

    /// κ hardly known, as in the experiment: the other parameters' covariance is that of the Schur complement.
    #[test]
    fn nuisance_is_marginalised() {
        let a = [[1e-3, 2e-2, 1e-2], [2e-2, 4e5, 1e5], [1e-2, 1e5, 2e5]];
        let covariance = information(a).covariance();
        let schur = |i: usize, j: usize| a[i][j] - a[i][0] * a[0][j] / a[0][0];
        let determinant = schur(1, 1) * schur(2, 2) - schur(1, 2) * schur(2, 1);
        let exact = [[schur(2, 2), -schur(1, 2)], [-schur(1, 2), schur(1, 1)]].map(|r| r.map(|x| x / determinant));
        // Relative rounding of the scaled inverse, condition number below 10.
        assert!((covariance.relative_sd(1).unwrap() / exact[0][0].sqrt() - 1.0).abs() < 1e-12);
        assert!((covariance.relative_sd(2).unwrap() / exact[1][1].sqrt() - 1.0).abs() < 1e-12);
        let log_det = covariance.criterion(Criterion::LogDeterminant, &[1, 2]).unwrap();
        assert!((log_det + determinant.ln()).abs() < 1e-11);
        let promised = covariance.promised_sd(IDENTIFIABILITY_LIMIT);
        assert!(!promised[0].identifiable && promised[0].value.is_some());
        assert!(promised[1].identifiable && promised[2].identifiable);
        assert!((covariance.sd(1).unwrap() - 17.0 * exact[0][0].sqrt()).abs() < 1e-12);
        assert!(covariance.condition_number(&[1, 2]).unwrap() < 10.0);
        assert!(covariance.condition_number(&[0, 1, 2]).unwrap() > 1e7);
        assert!(covariance.correlation(1, 2).unwrap() < 0.0);
    }

    /// Only the sum of two parameters is measured: neither is determined, the third is.
    #[test]
    fn undetermined_combinations_have_no_sd() {
        let covariance = information([[4.0, 4.0, 0.0], [4.0, 4.0, 0.0], [0.0, 0.0, 25.0]]).covariance();
        assert_eq!((covariance.sd(0), covariance.sd(1)), (None, None));
        assert!((covariance.relative_sd(2).unwrap() - 0.2).abs() < 1e-14);
        assert_eq!(covariance.criterion(Criterion::Trace, &[0, 2]), None);
        assert_eq!(covariance.criterion(Criterion::Trace, &[]), None);
        assert_eq!(covariance.correlation(0, 2), None);
    }

    /// Two Ogden terms of one exponent are one term: both μ undetermined by name, nothing panics.
    #[test]
    fn twin_terms_do_not_panic() {
        let term = OgdenTerm { mu_kpa: 8.0, alpha: 2.0 };
        let material = Material { bulk_kpa: 2000.0, terms: vec![term, term], law: None };
        let mut information = FisherInformation::none(&material);
        information.add_force(&[0.0, 0.3, 0.7, 0.3, 0.7], 0.02);
        let covariance = information.covariance();
        assert!(covariance.promised_sd(0.5).iter().all(|p| p.value.is_none() && !p.identifiable));
    }

    /// Gradients of the criteria by central differences of the information matrix.
    #[test]
    fn criterion_gradients() {
        let base = information([[30.0, 4.0, -2.0], [4.0, 50.0, 20.0], [-2.0, 20.0, 40.0]]);
        for criterion in ALL {
            for subset in [vec![1, 2], vec![0, 1, 2], vec![2]] {
                let gradient = base.covariance().criterion_gradient(criterion, &subset).unwrap();
                for i in 0..3 {
                    for j in 0..=i {
                        let h = 1e-5 * (base.matrix()[(i, i)] * base.matrix()[(j, j)]).sqrt();
                        let at = |h: f64| {
                            let mut moved = base.clone();
                            moved.set(i, j, base.matrix()[(i, j)] + h);
                            moved.covariance().criterion(criterion, &subset).unwrap()
                        };
                        let difference = (at(h) - at(-h)) / (2.0 * h);
                        let exact = if i == j { gradient[(i, i)] } else { gradient[(i, j)] + gradient[(j, i)] };
                        let scale = base.covariance().criterion(criterion, &subset).unwrap().abs() / h * 1e-5;
                        // Truncation (10⁻⁵)² and rounding 10⁻¹⁵ / 10⁻⁵, relative to criterion over entry.
                        assert!((difference - exact).abs() < 1e-8 * scale, "{criterion:?} {subset:?} {i} {j}");
                    }
                }
            }
        }
    }
}
