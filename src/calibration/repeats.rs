//! Scans that repeat one another, as their mean: where the noise is Gaussian the mean tells as much as all of them, and
//! a fit solves each of its equilibria once.

use super::force_readings::ObservedForce;
use super::observed::{Observed, ObservedStep};
use crate::specimen::Specimen;

/// The plain mean is taken of scans whose noise differs by at most this factor: it is then within 5 % of what the best
/// weights give.
const ALIKE: f64 = 1.25;

/// The mean of scans of one sample at the same drives, and how many scans it is of.
#[derive(Clone, Debug)]
pub struct MeanScan {
    /// The mean, with its own noise.
    pub mean: Observed,
    /// Number of scans.
    pub num_scans: usize,
}

/// Every scan that differs from those before it, and the mean of it and its repeats.
pub fn mean_scans(observed: &[Observed]) -> Vec<MeanScan> {
    let mut groups: Vec<Vec<&Observed>> = Vec::new();
    for scan in observed {
        match groups.iter_mut().find(|group| is_repeat(group[0], scan)) {
            Some(group) => group.push(scan),
            None => groups.push(vec![scan]),
        }
    }
    groups.iter().map(|group| MeanScan { mean: mean_of(group), num_scans: group.len() }).collect()
}

/// Whether two recordings are of the same body, seen by the same voxels with about the same noise, at the same drives.
fn is_repeat(a: &Observed, b: &Observed) -> bool {
    let body = |s: &Specimen| Specimen { name: String::new(), ..s.clone() };
    let is_alike = |a: f64, b: f64| a == b || a.max(b) <= ALIKE * a.min(b);
    let is_same_step = |(a, b): (&ObservedStep, &ObservedStep)| {
        let is_free = |s: &ObservedStep| s.faces_per_mm.iter().all(Option::is_none);
        a.drive_mm == b.drive_mm && is_free(a) && is_free(b)
    };
    let is_same_force = |pair: (Option<ObservedForce>, Option<ObservedForce>)| match pair {
        (Some(a), Some(b)) => is_alike(a.sd_n, b.sd_n),
        (None, None) => true,
        _ => false,
    };
    body(&a.specimen) == body(&b.specimen)
        && a.mask.grid == b.mask.grid
        && a.mask.voxels == b.mask.voxels
        && a.filter == b.filter
        && a.load_cell == b.load_cell
        && a.on_the_way.iter().map(|r| r.drive_mm).eq(b.on_the_way.iter().map(|r| r.drive_mm))
        && a.forces().zip(b.forces()).all(is_same_force)
        && (0..3).all(|c| is_alike(a.noise_sd_mm[c], b.noise_sd_mm[c]))
        && a.steps.len() == b.steps.len()
        && a.steps.iter().zip(&b.steps).all(is_same_step)
}

/// The mean of repeats. A voxel that some of them miss is the mean of the others.
fn mean_of(scans: &[&Observed]) -> Observed {
    let [first, _, ..] = scans else { return scans[0].clone() };
    let num = scans.len() as f64;
    // The standard deviation of a mean of independent values.
    let sd_of_mean = |sds: &mut dyn Iterator<Item = f64>| sds.map(|sd| sd * sd).sum::<f64>().sqrt() / num;
    let noise_sd_mm = [0, 1, 2].map(|c| sd_of_mean(&mut scans.iter().map(|o| o.noise_sd_mm[c])));
    let step = |s: usize| {
        let steps = || scans.iter().map(|o| &o.steps[s]);
        let (displacement, relative_noise) =
            (0..first.mask.num_voxels()).map(|v| mean_voxel(scans, s, v, noise_sd_mm)).unzip();
        let is_even = |step: &ObservedStep| {
            step.relative_noise.is_none() && step.displacement.iter().flatten().all(|u| u.is_finite())
        };
        let relative_noise = Some(relative_noise).filter(|_| !steps().all(is_even));
        ObservedStep { displacement, relative_noise, ..first.steps[s].clone() }
    };
    let mut mean = first.with_steps((0..first.steps.len()).map(step).collect());
    let forces: Vec<Vec<Option<ObservedForce>>> = scans.iter().map(|o| o.forces().collect()).collect();
    for (d, force) in mean.forces_mut().enumerate() {
        let all = || forces.iter().filter_map(|of_scan| of_scan[d]);
        if let Some(force) = force {
            force.value_n = all().map(|f| f.value_n).sum::<f64>() / num;
            force.sd_n = sd_of_mean(&mut all().map(|f| f.sd_n));
        }
    }
    mean.noise_sd_mm = noise_sd_mm;
    mean.num_outliers = scans.iter().map(|o| o.num_outliers).max().unwrap_or(0);
    mean
}

/// A voxel's mean over the scans that have it, NaN where none has, and its noise in multiples of `noise_sd_mm`.
fn mean_voxel(scans: &[&Observed], step: usize, voxel: usize, noise_sd_mm: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let has = |o: &&&Observed| o.steps[step].displacement[voxel].iter().all(|u| u.is_finite());
    let (mut num, mut sum, mut variance) = (0.0, [0.0; 3], [0.0; 3]);
    for scan in scans.iter().filter(has) {
        num += 1.0;
        let (u, noise_mm2) = (scan.steps[step].displacement[voxel], scan.noise_mm2(step, voxel));
        for c in 0..3 {
            sum[c] += u[c];
            variance[c] += noise_mm2[c];
        }
    }
    if num == 0.0 {
        return ([f64::NAN; 3], [1.0; 3]);
    }
    let relative = |c: usize| match noise_sd_mm[c] {
        // A component that cameras do not measure.
        sd if !sd.is_finite() => 1.0,
        sd => variance[c].sqrt() / (num * sd),
    };
    (sum.map(|s| s / num), [0, 1, 2].map(relative))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::ForceOnTheWay;
    use crate::calibration::test_problem::{block, coarse, same_mesh, truth};
    use crate::calibration::{CalibrateOptions, TermCount, calibrate};
    use crate::recording::Filter;

    /// `num` noisy scans of one sample, with a force read at 1 mm on the way to each.
    fn scans(num: u64) -> Vec<Observed> {
        let (_, synthetic) = same_mesh(&truth());
        let scan = |draw: u64| {
            let measured = synthetic.draw(1, draw);
            let made = synthetic.recording("scan", &block(), &measured, Filter::None).unwrap();
            let force = ObservedForce { value_n: 2.0 + 0.1 * draw as f64, sd_n: 0.5 };
            let mut observed = Observed::new(&made, 0.01).unwrap();
            observed.on_the_way = vec![ForceOnTheWay { drive_mm: 1.0, force }];
            observed
        };
        (0..num).map(scan).collect()
    }

    /// By hand: values are means of those that are there, variances those of means.
    #[test]
    fn means_of_values_with_the_noise_of_means() {
        let mut all = scans(3);
        all[1].steps[0].displacement[7] = [f64::NAN; 3];
        all[1].specimen.name = "another day".into();
        let found = mean_scans(&all);
        let [MeanScan { mean, num_scans: 3 }] = &found[..] else { panic!("{} groups", found.len()) };
        let of = |scan: usize, voxel: usize| all[scan].steps[0].displacement[voxel][1];
        let u = &mean.steps[0].displacement;
        assert!((u[0][1] - (of(0, 0) + of(1, 0) + of(2, 0)) / 3.0).abs() < 1e-15);
        assert!((u[7][1] - f64::midpoint(of(0, 7), of(2, 7))).abs() < 1e-15);
        assert!((mean.noise_mm2(0, 0)[1] / (0.03 * 0.03 / 3.0) - 1.0).abs() < 1e-12);
        assert!((mean.noise_mm2(0, 7)[1] / (0.03 * 0.03 / 2.0) - 1.0).abs() < 1e-12);
        let force = mean.steps[0].force.unwrap();
        let mean_n = all.iter().map(|o| o.steps[0].force.unwrap().value_n).sum::<f64>() / 3.0;
        assert!((force.value_n - mean_n).abs() < 1e-15);
        assert!((force.sd_n - 0.01 / 3f64.sqrt()).abs() < 1e-15);
        let [ForceOnTheWay { drive_mm: 1.0, force }] = mean.on_the_way[..] else { panic!("{:?}", mean.on_the_way) };
        assert!((force.value_n - 2.1).abs() < 1e-12 && (force.sd_n - 0.5 / 3f64.sqrt()).abs() < 1e-12);
    }

    /// Another drive, much more noise, other voxels or no force on the way are no repeat.
    #[test]
    fn only_repeats_are_averaged() {
        let mut all = scans(5);
        all[1].steps[0].drive_mm = 3.0;
        all[2].noise_sd_mm[0] *= 2.0;
        all[3].mask.voxels.pop();
        all[4].on_the_way.clear();
        assert!(mean_scans(&all).iter().all(|m| m.num_scans == 1));
        assert_eq!(mean_scans(&all).len(), 5);
    }

    /// The mean is a sufficient statistic: the fit to it is that to all scans. The fits stop within a thousandth of a
    /// standard deviation.
    #[test]
    fn the_mean_is_fitted_as_all_of_them() {
        let all = scans(3);
        let means: Vec<Observed> = mean_scans(&all).into_iter().map(|m| m.mean).collect();
        let options = CalibrateOptions {
            terms: TermCount::Fixed(1),
            has_mesh_allowance: false,
            num_starts: 1,
            ..CalibrateOptions::default()
        };
        let fit = |observed: &[Observed]| {
            calibrate(observed, &|s, _| coarse(s), &options, &|_| (), &|| false).unwrap().estimates
        };
        for (one, other) in fit(&all).iter().zip(&fit(&means)) {
            let (sd, other_sd) = (one.sd.unwrap(), other.sd.unwrap());
            assert!(((one.value - other.value) / sd).abs() < 2e-3, "{one:?}, {other:?}");
            assert!((sd / other_sd - 1.0).abs() < 2e-3, "{one:?}, {other:?}");
        }
    }
}
