//! The two-dimensional histogram over (λ, k).

use super::VoxelError;
use serde::Serialize;

/// Equal bins between two ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HistogramAxis {
    /// Lower end of the first bin.
    pub low: f64,
    /// Upper end of the last bin.
    pub high: f64,
    /// Number of bins.
    pub num_bins: usize,
}

impl HistogramAxis {
    fn check(&self) -> Result<(), VoxelError> {
        let HistogramAxis { low, high, num_bins } = *self;
        if low.is_finite() && high.is_finite() && low < high && num_bins > 0 {
            Ok(())
        } else {
            Err(VoxelError::InvalidAxis { low, high, num_bins })
        }
    }

    /// Width of a bin.
    pub fn bin_width(&self) -> f64 {
        (self.high - self.low) / self.num_bins as f64
    }

    /// Middle of a bin.
    pub fn center(&self, bin: usize) -> f64 {
        self.low + (bin as f64 + 0.5) * self.bin_width()
    }

    /// Bin of a value; the upper end belongs to the last bin.
    pub fn bin(&self, value: f64) -> Option<usize> {
        if !(self.low..=self.high).contains(&value) {
            return None;
        }
        Some((((value - self.low) / self.bin_width()) as usize).min(self.num_bins - 1))
    }
}

/// Numbers of voxels per bin of stretch amplitude λ and deformation mode k.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Histogram2d {
    /// Bins of λ.
    pub stretch_amplitude: HistogramAxis,
    /// Bins of k.
    pub deformation_mode: HistogramAxis,
    /// Voxels per bin, λ fastest: `bin_λ + num_bins_λ × bin_k`.
    pub counts: Vec<u64>,
    /// Voxels without a mode (λ = 1 or inadmissible).
    pub num_missing: u64,
    /// Voxels outside the axes.
    pub num_outside: u64,
}

impl Histogram2d {
    /// Counts pairs (λ, k).
    ///
    /// # Errors
    /// [`VoxelError::InvalidAxis`].
    pub fn of(
        states: impl IntoIterator<Item = (f64, Option<f64>)>,
        stretch_amplitude: HistogramAxis,
        deformation_mode: HistogramAxis,
    ) -> Result<Self, VoxelError> {
        stretch_amplitude.check()?;
        deformation_mode.check()?;
        let mut histogram = Histogram2d {
            stretch_amplitude,
            deformation_mode,
            counts: vec![0; stretch_amplitude.num_bins * deformation_mode.num_bins],
            num_missing: 0,
            num_outside: 0,
        };
        for (lambda, mode) in states {
            match mode.map(|k| (stretch_amplitude.bin(lambda), deformation_mode.bin(k))) {
                None => histogram.num_missing += 1,
                Some((Some(l), Some(k))) => histogram.counts[l + stretch_amplitude.num_bins * k] += 1,
                Some(_) => histogram.num_outside += 1,
            }
        }
        Ok(histogram)
    }

    /// Voxels counted, with the missing ones and those outside.
    pub fn num_voxels(&self) -> u64 {
        self.counts.iter().sum::<u64>() + self.num_missing + self.num_outside
    }

    /// log₁₀ of the density (voxels in the bin / all voxels / bin area), in the order of `counts`; none for empty bins.
    pub fn log10_density(&self) -> Vec<Option<f64>> {
        let scale = self.num_voxels() as f64 * self.stretch_amplitude.bin_width() * self.deformation_mode.bin_width();
        self.counts.iter().map(|&n| (n > 0).then(|| (n as f64 / scale).log10())).collect()
    }

    /// Σ over bins of count × `f`(λ, k) at the bin's middle: the integrated sensitivity as the paper states it.
    pub fn sum_over_bins(&self, f: impl Fn(f64, f64) -> f64) -> f64 {
        let num = self.stretch_amplitude.num_bins;
        self.counts
            .iter()
            .enumerate()
            .filter(|(_, n)| **n > 0)
            .map(|(bin, &n)| {
                n as f64 * f(self.stretch_amplitude.center(bin % num), self.deformation_mode.center(bin / num))
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> (HistogramAxis, HistogramAxis) {
        (HistogramAxis { low: 1.0, high: 2.0, num_bins: 50 }, HistogramAxis { low: 0.0, high: 1.0, num_bins: 40 })
    }

    /// A uniform density has log₁₀ 0 in every bin, and bin sums approximate point sums.
    #[test]
    fn uniform_density() {
        let (l, k) = axes();
        let points: Vec<(f64, f64)> = (0..400)
            .flat_map(|i| (0..400).map(move |j| (1.0 + (f64::from(i) + 0.5) / 400.0, (f64::from(j) + 0.5) / 400.0)))
            .collect();
        let histogram = Histogram2d::of(points.iter().map(|&(l, k)| (l, Some(k))), l, k).unwrap();
        assert_eq!(histogram.num_voxels(), 160_000);
        assert!(histogram.log10_density().iter().all(|d| d.unwrap().abs() < 1e-12));
        let f = |l: f64, k: f64| l * l * (1.0 + k);
        let exact: f64 = points.iter().map(|&(l, k)| f(l, k)).sum();
        // Midpoint rule per bin: relative error of the order of the squared bin width, 4e-4 / 12.
        assert!((histogram.sum_over_bins(f) / exact - 1.0).abs() < 1e-4);
    }

    #[test]
    fn missing_and_outside_are_counted() {
        let (l, k) = axes();
        let states = [(1.0, None), (2.5, Some(0.5)), (2.0, Some(1.0)), (1.0, Some(0.0)), (f64::NAN, Some(0.1))];
        let histogram = Histogram2d::of(states, l, k).unwrap();
        assert_eq!((histogram.num_missing, histogram.num_outside, histogram.num_voxels()), (1, 2, 5));
        assert_eq!(*histogram.counts.last().unwrap(), 1);
        assert!(Histogram2d::of([], HistogramAxis { num_bins: 0, ..l }, k).is_err());
    }
}
