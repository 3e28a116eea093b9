//! How the time of one scan is best shared out to several drives.
//!
//! In a share t_k of the time of a whole scan the voxels of drive k tell t_k as much. Sought is the least D-optimal
//! figure (the generalised relative standard deviation of all μᵢ and αᵢ) over shares that sum to one. Each share is
//! multiplied by how much a little more of it would help, and all are scaled back to one: the multiplicative algorithm
//! of optimal design, which never gets worse (Silvey, Titterington and Torsney 1978; Yu 2010, doi:10.1214/10-AOS794).

use super::covariance::{Criterion, PromisedSd};
use super::information::{FisherInformation, InformationError};
use super::joint_information::JointInformation;
use crate::material::{Material, Parameter};
use serde::{Deserialize, Serialize};

/// The best shares of the time of one scan, and what they promise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct BestShares {
    /// One for each scanned drive; together 1.
    pub scan_share: Vec<f64>,
    /// Standard deviations that all drives together promise with them.
    pub promised_sd: Vec<PromisedSd>,
}

/// Steps of the algorithm at most; it converges linearly.
const MOST_STEPS: usize = 2000;
/// Shares that change by less are found.
const ACCURACY: f64 = 1e-6;
/// Step of the difference quotient of the information, which is smooth and nearly linear in a share.
const STEP: f64 = 1e-6;

/// Drives that share the time of a scan, with one material.
#[derive(Clone, Debug)]
pub struct SharedTime {
    pub(super) material: Material,
    /// What the voxels of each drive tell in the time of a whole scan.
    pub(super) voxels: Vec<JointInformation>,
    /// What the force at each of them tells.
    pub(super) forces: Vec<JointInformation>,
    /// What the forces that are read without a scan tell.
    pub(super) on_the_way: JointInformation,
    /// Standard deviations to which the unknowns of the set-up are known beforehand.
    pub(super) unknown_sd: Vec<f64>,
    /// The same of ln κ, where there is a prior.
    pub(super) bulk_log_prior_sd: Option<f64>,
}

impl SharedTime {
    /// What all drives tell of the material with these shares.
    ///
    /// # Errors
    /// [`InformationError`].
    pub fn information(&self, shares: &[f64]) -> Result<FisherInformation, InformationError> {
        let mut joint = self.on_the_way.clone();
        for ((share, voxels), force) in shares.iter().zip(&self.voxels).zip(&self.forces) {
            joint.add(force)?;
            joint.add_times(*share, voxels)?;
        }
        let mut information = joint.about_material(&self.material, &self.unknown_sd)?;
        if let Some(sd) = self.bulk_log_prior_sd {
            information.add_log_prior(Parameter::Kappa, sd)?;
        }
        Ok(information)
    }

    /// What one drive alone tells with its share.
    pub(super) fn information_of_drive(&self, drive: usize, share: f64) -> Result<FisherInformation, InformationError> {
        let mut joint = self.forces[drive].clone();
        joint.add_times(share, &self.voxels[drive])?;
        joint.about_material(&self.material, &self.unknown_sd)
    }

    /// By how much ln det of the covariance of all μᵢ and αᵢ falls with each share; `None` where it is not determined.
    fn worth(&self, shares: &[f64]) -> Result<Option<Vec<f64>>, InformationError> {
        let here = self.information(shares)?;
        let shear = here.shear_indices();
        let Some(gradient) = here.covariance().criterion_gradient(Criterion::LogDeterminant, &shear) else {
            return Ok(None);
        };
        let mut worth = Vec::with_capacity(shares.len());
        for k in 0..shares.len() {
            let mut more = shares.to_vec();
            more[k] += STEP;
            let change = (self.information(&more)?.matrix() - here.matrix()) / STEP;
            worth.push((-gradient.dot(&change)).max(0.0));
        }
        Ok(Some(worth))
    }
}

/// The shares that are best for all these materials together (the sum of their ln det is least); `None` where the
/// drives do not determine all μᵢ and αᵢ of one of them. All have the same drives.
///
/// # Errors
/// [`InformationError`].
pub fn best_shares(materials: &[&SharedTime]) -> Result<Option<Vec<f64>>, InformationError> {
    let num = materials.first().map_or(0, |m| m.voxels.len());
    let mut shares = vec![1.0 / num as f64; num];
    for _ in 0..MOST_STEPS {
        let mut worth = vec![0.0; num];
        for material in materials {
            let Some(own) = material.worth(&shares)? else { return Ok(None) };
            worth.iter_mut().zip(own).for_each(|(sum, w)| *sum += w);
        }
        let total: f64 = shares.iter().zip(&worth).map(|(s, w)| s * w).sum();
        if !(total > 0.0) {
            break;
        }
        let next: Vec<f64> = shares.iter().zip(&worth).map(|(s, w)| s * w / total).collect();
        let moved = next.iter().zip(&shares).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        shares = next;
        if moved < ACCURACY {
            break;
        }
    }
    Ok(Some(shares))
}

#[cfg(test)]
mod tests {
    use super::super::information::MeasurementNoise;
    use super::super::information::tests::one_term;
    use super::super::joint_information::NuisanceColumn;
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Three drives of made-up voxels with an unknown of the set-up: no shares of a fine grid are better, and one drive
    /// that tells next to nothing gets nothing.
    #[test]
    fn no_shares_of_a_grid_are_better() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let noise = MeasurementNoise { displacement_sd_mm: [0.5; 3], force_sd_n: 0.2 };
        let weights = vec![1.0; 30];
        let mut drive = |scale: f64| {
            let mut field = || -> Vec<[f64; 3]> {
                (0..30).map(|_| [0; 3].map(|_: i32| scale * rng.random_range(-1.0..1.0))).collect()
            };
            let fields = [field(), field(), field()];
            let nuisance = [NuisanceColumn { field: Some(field()), force_n: 0.0 }];
            let none = [0.0; 3];
            let alone = FisherInformation::of_drive(&one_term(), &fields, &weights, &none, &noise).unwrap();
            JointInformation::of_drive(alone, &fields, &none, &nuisance, &weights, &noise)
        };
        let voxels = vec![drive(1.0), drive(1.3), drive(1e-3)];
        let mut forces = JointInformation::none(&one_term(), 1);
        forces.add_force(&[0.1, 2.0, 0.5], &[0.4], noise.force_sd_n);
        let material = one_term();
        let none = JointInformation::none(&material, 1);
        let time = SharedTime {
            material,
            voxels,
            forces: vec![none.clone(), none.clone(), none],
            on_the_way: forces,
            unknown_sd: vec![0.3],
            bulk_log_prior_sd: None,
        };
        let best = best_shares(&[&time]).unwrap().unwrap();
        assert!((best.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(best[2] < 1e-3, "{best:?}");
        let figure = |shares: &[f64]| {
            let information = time.information(shares).unwrap();
            information.covariance().criterion(Criterion::LogDeterminant, &information.shear_indices()).unwrap()
        };
        let found = figure(&best);
        for i in 0..=40 {
            for j in 0..=(40 - i) {
                let shares = [i, j, 40 - i - j].map(|n| f64::from(n) / 40.0);
                // What the last steps would still have brought.
                assert!(found <= figure(&shares) + 1e-6, "{shares:?} {best:?}");
            }
        }
    }
}
