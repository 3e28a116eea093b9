//! Where fibres may point: every direction tested to first order at once.
//!
//! The stress of a fibre, 2k (a·C a − 1) F a ⊗ a, is linear in a ⊗ a ⊗ a ⊗ a, whose components span the homogeneous
//! polynomials of degree four: fifteen numbers. The responses to fibres along sixteen directions that span them combine
//! to the response to fibres along any direction, so that a fine grid of directions costs sixteen solutions of the
//! tangent.

use super::error::DiagnosisError;
use super::fit::STEP;
use super::laboratory::{Laboratory, Prediction};
use super::prior::shear_modulus;
use super::scene::Scene;
use super::score::{Prepared, ScoreTest};
use super::supposed::Path;
use crate::fem::Fibre;
use crate::material::Material;
use nalgebra::{DMatrix, DVector};

/// Spacing of the grid of directions, degrees.
const SPACING_DEGREES: f64 = 6.0;
/// A second direction is tried where it is this far from the first one and explains this part of what the first does.
const APART_DEGREES: f64 = 35.0;
const SECOND_SHARE: f64 = 0.5;
/// Largest first-order modulus over shear modulus that a fit starts from.
const LARGEST_START: f64 = 0.6;

/// Axes, face and space diagonals, and three directions beside them: together they span degree four.
const SPANNING: [[f64; 3]; 16] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [0.0, 1.0, 1.0],
    [0.0, 1.0, -1.0],
    [1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [2.0, 1.0, 0.0],
    [0.0, 2.0, 1.0],
    [1.0, 0.0, 2.0],
];

/// A direction of fibres that is worth a fit.
#[derive(Clone, Copy, Debug)]
pub struct FibreDirection {
    /// Fall of the deviance to first order.
    pub explained: f64,
    /// Unit vector.
    pub direction: [f64; 3],
    /// Modulus of the fibres from which a fit starts, kPa.
    pub modulus_kpa: f64,
}

/// Directions of fibres that are worth a fit: the one that explains most, and a second one far from it where that
/// explains much too.
///
/// # Errors
/// [`DiagnosisError::Solve`].
pub fn fibre_directions(
    laboratory: &mut Laboratory,
    material: &Material,
    scene: &Scene,
    prediction: &Prediction,
    test: &ScoreTest,
) -> Result<Vec<FibreDirection>, DiagnosisError> {
    let modulus = shear_modulus(material);
    let paths: Vec<Path> = SPANNING
        .iter()
        .map(|a| {
            let direction = unit(*a);
            Path::of_sample(move |t: f64| Scene {
                fibre: Some(Fibre { direction, modulus_kpa: t * modulus }),
                ..scene.clone()
            })
        })
        .collect();
    let paths: Vec<&Path> = paths.iter().collect();
    let prepared = test.prepare(&laboratory.derivatives(material, scene, prediction, false, &paths, STEP)?);
    let combine = Combination::new();
    let grid = hemisphere();
    let mut scored: Vec<(f64, [f64; 3], f64)> = grid
        .into_iter()
        .filter_map(|direction| {
            let (explained, strength) = explained_along(&prepared, &combine.of(direction));
            (strength > 0.0).then_some((explained, direction, strength))
        })
        .collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<(f64, [f64; 3], f64)> = Vec::new();
    if let Some(&best) = scored.first() {
        chosen.push(best);
        let cosine = APART_DEGREES.to_radians().cos();
        let is_apart = |d: &[f64; 3]| (0..3).map(|i| d[i] * best.1[i]).sum::<f64>().abs() < cosine;
        chosen.extend(scored.iter().find(|s| is_apart(&s.1)).filter(|s| s.0 > SECOND_SHARE * best.0));
    }
    Ok(chosen
        .into_iter()
        .map(|(explained, direction, strength)| FibreDirection {
            explained,
            direction,
            modulus_kpa: modulus * strength.min(LARGEST_START),
        })
        .collect())
}

fn explained_along(prepared: &Prepared, weights: &DVector<f64>) -> (f64, f64) {
    let slope = weights.dot(&prepared.gradient);
    let curvature = weights.dot(&(&prepared.gram * weights));
    if curvature > 0.0 { (slope * slope / curvature, slope / curvature) } else { (0.0, 0.0) }
}

/// Weights of the spanning directions that make any other.
struct Combination {
    inverse: DMatrix<f64>,
}

impl Combination {
    fn new() -> Combination {
        let columns: Vec<DVector<f64>> = SPANNING.iter().map(|a| fourth_powers(unit(*a))).collect();
        let matrix = DMatrix::from_columns(&columns);
        // Full rank (tested), so that nothing but rounding is cut off.
        let inverse = matrix.clone().pseudo_inverse(1e-12).unwrap_or_else(|_| matrix.transpose());
        Combination { inverse }
    }

    fn of(&self, direction: [f64; 3]) -> DVector<f64> {
        &self.inverse * fourth_powers(direction)
    }
}

/// The fifteen monomials of degree four.
fn fourth_powers([x, y, z]: [f64; 3]) -> DVector<f64> {
    let mut all = Vec::with_capacity(15);
    for i in 0..=4 {
        for j in 0..=4 - i {
            all.push(x.powi(i) * y.powi(j) * z.powi(4 - i - j));
        }
    }
    DVector::from_vec(all)
}

/// Directions over half a sphere, evenly spaced.
fn hemisphere() -> Vec<[f64; 3]> {
    let rings = (90.0 / SPACING_DEGREES).round() as usize;
    let mut all = Vec::new();
    for ring in 0..=rings {
        let polar = (ring as f64 * SPACING_DEGREES).to_radians();
        // On the equator one half is the other's opposite.
        let turn = if ring == rings { std::f64::consts::PI } else { std::f64::consts::TAU };
        let count = ((turn * polar.sin() / SPACING_DEGREES.to_radians()).round() as usize).max(1);
        for n in 0..count {
            let azimuth = turn * n as f64 / count as f64;
            all.push([polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()]);
        }
    }
    all
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let n = a.iter().map(|x| x * x).sum::<f64>().sqrt();
    a.map(|x| x / n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spanning_directions_make_every_other() {
        let combine = Combination::new();
        let columns: Vec<DVector<f64>> = SPANNING.iter().map(|a| fourth_powers(unit(*a))).collect();
        let matrix = DMatrix::from_columns(&columns);
        for direction in hemisphere() {
            let wanted = fourth_powers(direction);
            // Rounding of a well-conditioned system of fifteen equations.
            assert!((&matrix * combine.of(direction) - &wanted).norm() < 1e-12, "{direction:?}");
        }
    }

    #[test]
    fn directions_leave_no_gap() {
        let grid = hemisphere();
        for n in 0..2000 {
            // Fibonacci points over the sphere.
            let z = 1.0 - 2.0 * (f64::from(n) + 0.5) / 2000.0;
            let azimuth = f64::from(n) * 2.399_963_229_728_653;
            let r = (1.0 - z * z).sqrt();
            let d = [r * azimuth.cos(), r * azimuth.sin(), z];
            let nearest =
                grid.iter().map(|g| (0..3).map(|i| g[i] * d[i]).sum::<f64>().abs()).fold(0.0, f64::max).min(1.0);
            // A cell's half diagonal, with the rounding of the numbers per ring.
            assert!(nearest.acos().to_degrees() < 0.8 * SPACING_DEGREES, "{d:?}");
        }
    }
}
