//! All that one scanned drive tells: voxel sensitivities, what is not known of the set-up, noise and discrepancy.
//!
//! n scans of the same drive average their noise and share their discrepancy: a voxel's mean has the variance
//! σ²/n + D g². D is the discrepancy found so far; g = 1 + d grows with the distance d beyond the states visited so
//! far, in units of the visited range of ln λ. A law whose error over that range is of the size √D, changing over a
//! length no shorter than the range, has grown by no more than √D per range beyond it (the first term of its series).

use super::discrepancy::Discrepancy;
use crate::material::Material;
use crate::sensitivity::{FisherInformation, InformationError, JointInformation, MeasurementNoise, NuisanceColumn};

/// A force and how it changes with material and unknowns.
#[derive(Clone, Debug)]
pub(super) struct ForceRead {
    /// The force, N.
    pub(super) force_n: f64,
    /// By parameter, N per unit.
    pub(super) by_parameter: Vec<f64>,
    /// By unknown of the set-up.
    pub(super) by_unknown: Vec<f64>,
    /// Standard deviation of the reading, N.
    pub(super) sd_n: f64,
    /// Distance of the drive's typical state beyond those visited.
    pub(super) beyond: f64,
}

impl ForceRead {
    /// Standard deviation of the mean of `num` readings, N.
    fn sd_of(&self, num: f64, discrepancy: &Discrepancy) -> f64 {
        let growth = 1.0 + self.beyond;
        let shared = discrepancy.force_relative_variance * (self.force_n * growth).powi(2);
        (self.sd_n * self.sd_n / num + shared).sqrt()
    }

    /// Adds what the mean of `num` readings tells.
    fn add_to(&self, joint: &mut JointInformation, num: f64, discrepancy: &Discrepancy) {
        joint.add_force(&self.by_parameter, &self.by_unknown, self.sd_of(num, discrepancy));
    }

    /// What the mean of `num` readings tells of the material and the unknowns of the set-up.
    pub(super) fn information(&self, material: &Material, num: f64, discrepancy: &Discrepancy) -> JointInformation {
        let mut joint = JointInformation::none(material, self.by_unknown.len());
        if num > 0.0 {
            self.add_to(&mut joint, num, discrepancy);
        }
        joint
    }
}

/// One scanned drive.
#[derive(Clone, Debug)]
pub(super) struct ScannedStep {
    /// ∂ū/∂ξ by parameter and voxel, mm per unit.
    pub(super) by_parameter: Vec<Vec<[f64; 3]>>,
    /// By unknown of the set-up and voxel; none where the displacement does not change.
    pub(super) by_unknown: Vec<Option<Vec<[f64; 3]>>>,
    /// By voxel: 0 where it does not count.
    pub(super) weights: Vec<f64>,
    /// By voxel, where the scan says how it encodes: the part of its signal that it keeps by direction.
    pub(super) signal: Option<Vec<[f64; 3]>>,
    /// By voxel: distance beyond the states visited.
    pub(super) beyond: Vec<f64>,
    /// Variance of a voxel's noise per component, mm².
    pub(super) noise_mm2: [f64; 3],
    /// Volume of a voxel, mm³.
    pub(super) voxel_mm3: f64,
    /// None where none is read.
    pub(super) force: Option<ForceRead>,
}

impl ScannedStep {
    /// What the mean of `num` scans tells of the material and `num_unknowns` unknowns of the set-up.
    pub(super) fn information(
        &self,
        material: &Material,
        num_unknowns: usize,
        num: f64,
        discrepancy: &Discrepancy,
    ) -> Result<JointInformation, InformationError> {
        if num <= 0.0 {
            return Ok(JointInformation::none(material, num_unknowns));
        }
        let shared = discrepancy.per_voxel_mm2(self.voxel_mm3);
        let roots: Vec<[f64; 3]> = self
            .weights
            .iter()
            .zip(&self.beyond)
            .enumerate()
            .map(|(voxel, (weight, beyond))| {
                let growth = (1.0 + beyond).powi(2);
                let signal = self.signal.as_ref().map_or([1.0; 3], |signal| signal[voxel]);
                // Without signal the noise has no bound, and the voxel no weight.
                let noise_mm2 = [0, 1, 2].map(|c| self.noise_mm2[c] / (num * signal[c] * signal[c]));
                [0, 1, 2].map(|c| (weight / (noise_mm2[c] + shared[c] * growth)).sqrt())
            })
            .collect();
        // In units of its own standard deviation every value has the noise 1.
        let white = |field: &Vec<[f64; 3]>| -> Vec<[f64; 3]> {
            field.iter().zip(&roots).map(|(u, root)| [0, 1, 2].map(|c| u[c] * root[c])).collect()
        };
        let fields: Vec<Vec<[f64; 3]>> = self.by_parameter.iter().map(white).collect();
        let ones = vec![1.0; self.weights.len()];
        let unit = MeasurementNoise { displacement_sd_mm: [1.0; 3], force_sd_n: 1.0 };
        let no_force = vec![0.0; fields.len()];
        let alone = FisherInformation::of_drive(material, &fields, &ones, &no_force, &unit)?;
        let columns: Vec<NuisanceColumn> = self
            .by_unknown
            .iter()
            .map(|field| NuisanceColumn { field: field.as_ref().map(white), force_n: 0.0 })
            .collect();
        let mut joint = JointInformation::of_drive(alone, &fields, &no_force, &columns, &ones, &unit);
        if let Some(force) = &self.force {
            force.add_to(&mut joint, num, discrepancy);
        }
        Ok(joint)
    }

    /// The part of the voxels beyond the states visited.
    pub(super) fn part_beyond(&self) -> f64 {
        let count = |is_counted: &dyn Fn(f64) -> bool| self.beyond.iter().filter(|b| is_counted(**b)).count() as f64;
        count(&|b| b > 0.0) / count(&|_| true).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step() -> ScannedStep {
        ScannedStep {
            by_parameter: vec![vec![[0.0; 3]; 4], vec![[1.0, 0.0, 0.0]; 4], vec![[0.0, 1.0, 0.0]; 4]],
            by_unknown: vec![],
            weights: vec![1.0; 4],
            signal: None,
            beyond: vec![0.0, 0.0, 1.0, 3.0],
            noise_mm2: [0.04; 3],
            voxel_mm3: 2.0,
            force: None,
        }
    }

    fn of_mu(num: f64, discrepancy: &Discrepancy) -> f64 {
        let material = Material::new(200.0, [(17.0, 2.0)]).unwrap();
        let joint = step().information(&material, 0, num, discrepancy).unwrap();
        joint.about_material(&material, &[]).unwrap().matrix()[(1, 1)]
    }

    /// A voxel with half its signal has twice the noise, one without signal counts for nothing; the discrepancy is
    /// neither smaller nor larger for it.
    #[test]
    fn lost_signal_is_noise() {
        let material = Material::new(200.0, [(17.0, 2.0)]).unwrap();
        let found = Discrepancy { variance_mm2: [0.01; 3], volume_mm3: 6.0, force_relative_variance: 0.0 };
        let seen = ScannedStep { signal: Some(vec![[1.0; 3], [0.5; 3], [0.0; 3], [0.0; 3]]), ..step() };
        let joint = seen.information(&material, 0, 2.0, &found).unwrap();
        let of_mu = joint.about_material(&material, &[]).unwrap().matrix()[(1, 1)];
        let by_hand = 1.0 / (0.04 / 2.0 + 0.03) + 1.0 / (4.0 * 0.04 / 2.0 + 0.03);
        assert!((of_mu / by_hand - 1.0).abs() < 1e-12);
    }

    /// By hand: noise averages, the discrepancy does not, and grows by g² = 1, 1, 4, 16.
    #[test]
    fn repeats_average_noise_alone() {
        let none = Discrepancy::default();
        assert!((of_mu(1.0, &none) - 4.0 / 0.04).abs() < 1e-9);
        assert!((of_mu(3.0, &none) - 3.0 * 4.0 / 0.04).abs() < 1e-9);
        // A box of 6 mm³ holds three voxels: 0.03 mm² each.
        let found = Discrepancy { variance_mm2: [0.01; 3], volume_mm3: 6.0, force_relative_variance: 0.0 };
        let by_hand = |num: f64| [1.0, 1.0, 4.0, 16.0].map(|g| 1.0 / (0.04 / num + 0.03 * g)).iter().sum::<f64>();
        for num in [1.0, 2.0, 1e6] {
            assert!((of_mu(num, &found) / by_hand(num) - 1.0).abs() < 1e-12);
        }
    }
}
