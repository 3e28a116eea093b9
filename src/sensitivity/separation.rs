//! How far apart two materials are for a scan: the objective of experiments that are to tell models apart.
//!
//! T-optimality (Atkinson and Fedorov 1975): the least squares distance, in standard deviations of the noise, between
//! what one material does and the nearest that the other can do with its parameters free. Its square is the
//! non-centrality of the likelihood ratio by which data of the one reject the other. What is here is the last, linear
//! step to the nearest point; repeated from where it leads it is a Gauss–Newton fit.

use super::continuum::gram_over_quadrature;
use super::information::{InformationError, MeasurementNoise};
use crate::fem::{ParameterSensitivity, QuadraturePoint};
use crate::mesh::Mesh;
use nalgebra::DMatrix;

/// What a material does at one drive.
#[derive(Clone, Debug)]
pub struct MaterialState {
    /// Nodal displacements, mm.
    pub displacement: Vec<[f64; 3]>,
    /// Force, N.
    pub force_n: f64,
    /// Force along +y on the moved face, N.
    pub normal_force_n: f64,
    /// Sensitivities to all of its parameters.
    pub sensitivities: Vec<ParameterSensitivity>,
}

/// A direction of `ours` counts as its own above this share of the largest, in the Gram matrix scaled to a unit
/// diagonal.
const NULL_EIGENVALUE: f64 = 1e-12;

/// How far apart two materials are, and where the nearest point is.
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// Standard deviations of the noise between the scan of one material and the nearest scan that the other can give,
    /// to first order in its parameters.
    pub distance_sd: f64,
    /// Changes of the other's parameters (in their units) that lead there.
    pub steps: Vec<f64>,
    /// Squared standard deviations that the changes gain.
    pub gained: f64,
}

/// Distance of the scan of `theirs` from the nearest scan that `ours` can give.
///
/// # Errors
/// [`InformationError`].
pub fn separation_over_quadrature(
    mesh: &Mesh,
    points: &[QuadraturePoint],
    ours: &MaterialState,
    theirs: &MaterialState,
    noise: &MeasurementNoise,
    voxel_volume_mm3: f64,
) -> Result<Separation, InformationError> {
    let between: Vec<[f64; 3]> =
        theirs.displacement.iter().zip(&ours.displacement).map(|(a, b)| [0, 1, 2].map(|i| a[i] - b[i])).collect();
    let mut fields: Vec<(&[[f64; 3]], f64)> =
        ours.sensitivities.iter().map(|s| (&s.displacement[..], s.force_n)).collect();
    fields.push((&between, theirs.force_n - ours.force_n));
    let gram = gram_over_quadrature(mesh, points, &fields, noise, voxel_volume_mm3)?;
    Ok(project(&gram))
}

/// Projects the last vector onto the others, from their Gram matrix.
fn project(gram: &DMatrix<f64>) -> Separation {
    let n = gram.nrows() - 1;
    let root: Vec<f64> = (0..n).map(|i| gram[(i, i)].max(1e-300).sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| gram[(i, j)] / (root[i] * root[j]));
    let eigen = scaled.symmetric_eigen();
    let largest = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
    let (mut gained, mut steps) = (0.0, vec![0.0; n]);
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > NULL_EIGENVALUE * largest {
            let along: f64 = (0..n).map(|i| vector[i] * gram[(i, n)] / root[i]).sum();
            gained += along * along / value;
            for i in 0..n {
                steps[i] += vector[i] * along / (value * root[i]);
            }
        }
    }
    Separation { distance_sd: (gram[(n, n)] - gained).max(0.0).sqrt(), steps, gained }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Vectors of the plane and of space, by hand.
    #[test]
    fn the_remainder_is_what_is_orthogonal() {
        let gram = |vectors: &[[f64; 3]]| {
            DMatrix::from_fn(vectors.len(), vectors.len(), |i, j| {
                (0..3).map(|c| vectors[i][c] * vectors[j][c]).sum::<f64>()
            })
        };
        let plane = project(&gram(&[[2.0, 0.0, 0.0], [3.0, 4.0, 0.0]]));
        // Rounding only, here and below.
        assert!((plane.distance_sd - 4.0).abs() < 1e-12 && (plane.steps[0] - 1.5).abs() < 1e-12);
        assert!((plane.gained - 9.0).abs() < 1e-12);
        let space = project(&gram(&[[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [5.0, 7.0, 3.0]]));
        assert!((space.distance_sd - 3.0).abs() < 1e-12);
        assert!((space.steps[0] - 6.0).abs() < 1e-12 && (space.steps[1] + 1.0).abs() < 1e-12);
        // Two dependent directions are one.
        let dependent = project(&gram(&[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [5.0, 1.0, 0.0]]));
        assert!((dependent.distance_sd - 1.0).abs() < 1e-10);
        assert!(project(&gram(&[[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]])).distance_sd < 1e-6);
    }
}
