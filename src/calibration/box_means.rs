//! Misfit beyond noise: means over boxes of neighbouring voxels, which noise hardly moves and structure does.

use super::observed::Observed;

/// Boxes along x, y, z.
const BOXES: [usize; 3] = [12, 4, 9];

/// The box whose mean is the least likely under noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorstBox {
    /// Its centre, mm.
    pub center_mm: [f64; 3],
    /// Its edges, mm.
    pub extent_mm: [f64; 3],
    /// The component of the displacement that it is about: 0, 1, 2 for x, y, z.
    pub component: usize,
}

/// What is left of a recording after a fit, from means over boxes of voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxMeans {
    /// χ² of the displacement noise per datum.
    pub chi2_per_datum: f64,
    /// Variance of the boxes' means beyond noise per component, mm²; as estimated, which may be below zero.
    pub excess_mm2: [f64; 3],
    /// Variance that noise gives these means, mm², which was taken off.
    pub noise_mm2: [f64; 3],
    /// Standard deviation that noise alone gives `excess_mm2`, mm².
    pub excess_sd_mm2: [f64; 3],
    /// Voxels per box.
    pub voxels_per_box: f64,
    /// None where no voxel is used.
    pub worst: Option<WorstBox>,
}

impl BoxMeans {
    /// Of `residual`: measured minus model per drive and compared voxel, mm; `is_used`(drive, voxel) says which count,
    /// those that are not finite do not.
    pub fn of(observed: &Observed, residual: &[Vec<[f64; 3]>], is_used: &dyn Fn(usize, usize) -> bool) -> BoxMeans {
        let half = observed.specimen.block.extents_mm().map(|extent| 0.5 * extent);
        let num = BOXES.iter().product::<usize>();
        let correlation = observed.noise_correlation();
        let (mut chi2, mut count) = (0.0, 0.0);
        let (mut structured, mut noise_mm2, mut scatter, mut weight) = ([0.0; 3], [0.0; 3], [0.0; 3], 0.0);
        let mut num_means = 0.0;
        let mut worst: Option<(f64, usize, usize)> = None;
        for (step, field) in residual.iter().enumerate() {
            let mut sums = vec![[0.0; 3]; num];
            let mut noises = vec![[0.0; 3]; num];
            let mut counts = vec![0.0; num];
            for (v, u) in field.iter().enumerate().filter(|(v, _)| is_used(step, *v)) {
                if !u.iter().all(|x| x.is_finite()) {
                    continue;
                }
                let x = observed.mask.grid.center_mm(observed.mask.voxels[v] as usize);
                let n = [0, 1, 2].map(|a| {
                    let t = (0.5 * (x[a] / half[a] + 1.0) * BOXES[a] as f64).floor().max(0.0);
                    (t as usize).min(BOXES[a] - 1)
                });
                let at = n[0] + BOXES[0] * (n[1] + BOXES[1] * n[2]);
                counts[at] += 1.0;
                let noise = observed.noise_mm2(step, v);
                for c in 0..3 {
                    chi2 += u[c] * u[c] / noise[c];
                    count += 1.0;
                    sums[at][c] += u[c];
                    noises[at][c] += correlation * noise[c];
                }
            }
            for (at, (sum, n)) in sums.iter().zip(&counts).enumerate().filter(|(_, (_, n))| **n > 0.0) {
                weight += n;
                num_means += 1.0;
                for c in 0..3 {
                    // Of the mean over the box; the square of the mean has the variance 2 σ⁴.
                    let noise = noises[at][c] / (n * n);
                    structured[c] += n * ((sum[c] / n).powi(2) - noise);
                    noise_mm2[c] += n * noise;
                    scatter[c] += 2.0 * (n * noise).powi(2);
                    let significance = (sum[c] / n).powi(2) / noise;
                    if worst.is_none_or(|w| significance > w.0) {
                        worst = Some((significance, at, c));
                    }
                }
            }
        }
        let worst = worst.map(|(_, at, component)| {
            let n = [at % BOXES[0], at / BOXES[0] % BOXES[1], at / (BOXES[0] * BOXES[1])];
            let extent_mm = [0, 1, 2].map(|a| 2.0 * half[a] / BOXES[a] as f64);
            let center_mm = [0, 1, 2].map(|a| (n[a] as f64 + 0.5) * extent_mm[a] - half[a]);
            WorstBox { center_mm, extent_mm, component }
        });
        let weight = f64::max(weight, 1.0);
        BoxMeans {
            chi2_per_datum: chi2 / f64::max(count, 1.0),
            excess_mm2: structured.map(|s| s / weight),
            noise_mm2: noise_mm2.map(|s| s / weight),
            excess_sd_mm2: scatter.map(|s| f64::sqrt(s) / weight),
            voxels_per_box: weight / f64::max(num_means, 1.0),
            worst,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Filter, RecordedStep, Recording};
    use crate::specimen::Specimen;
    use crate::voxel::VoxelGrid;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// A recording whose noise is five times as large beyond x = 4 mm as elsewhere, and such noise.
    fn uneven() -> (Observed, Vec<[f64; 3]>) {
        let specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).unwrap();
        let grid = VoxelGrid::new([-11.5, -2.75, -8.5], [1.0, 0.5, 1.0], [24, 12, 18]).unwrap();
        let num = grid.num_voxels();
        let step = RecordedStep {
            drive_mm: 4.0,
            force_n: None,
            force_sd_n: None,
            window_s: None,
            displacement: vec![[0.0; 3]; num],
        };
        let recording = Recording {
            id: "uneven".into(),
            steps: vec![step],
            specimen,
            mask: vec![true; num],
            noise_sd_mm: Some([0.01, 0.02, 0.03]),
            filter: Filter::None,
            load: None,
            notes: None,
            grid,
        };
        let mut observed = Observed::new(&recording, 0.1).unwrap();
        let grid = observed.mask.grid.clone();
        let relative = |&v: &u32| if grid.center_mm(v as usize)[0] > 4.0 { [5.0; 3] } else { [1.0; 3] };
        let all: Vec<[f64; 3]> = observed.mask.voxels.iter().map(relative).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let noise = all.iter().map(|f| [0, 1, 2].map(|c| f[c] * observed.noise_sd_mm[c] * normal())).collect();
        observed.steps[0].relative_noise = Some(all);
        (observed, noise)
    }

    /// Noise that differs over the image is no misfit, and χ² is one per datum; a shift of everything shows in full.
    #[test]
    fn uneven_noise_is_taken_off() {
        let (observed, noise) = uneven();
        let all = |_: usize, _: usize| true;
        let found = BoxMeans::of(&observed, std::slice::from_ref(&noise), &all);
        // Some 15,000 squares: the standard deviation of their mean is 1.2 %.
        assert!((found.chi2_per_datum - 1.0).abs() < 0.05, "{}", found.chi2_per_datum);
        for c in 0..3 {
            assert!(found.excess_mm2[c].abs() < 4.0 * found.excess_sd_mm2[c], "{found:?}");
        }
        let off: Vec<[f64; 3]> = noise.iter().map(|u| [u[0] + 0.02, u[1], u[2]]).collect();
        let shown = BoxMeans::of(&observed, std::slice::from_ref(&off), &all);
        let excess_mm2 = shown.excess_mm2[0] - 0.02f64.powi(2);
        // Noise and shift are independent: the variance of the square of their sum has a part for their product.
        let sd_mm2 = shown.excess_sd_mm2[0].hypot(2.0 * 0.02 * (shown.noise_mm2[0] / 300.0).sqrt());
        assert!(excess_mm2.abs() < 4.0 * sd_mm2, "{shown:?}");
    }
}
