//! Loss of the edge of k-space: truncation and apodisation.

use super::{AcquisitionError, Complex};
use std::f64::consts::TAU;
use utoipa::ToSchema;

/// What part of k-space an image keeps.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, ToSchema)]
pub struct KSpace {
    /// Part of each axis's half-width that is kept, in (0, 1]; 1 keeps all.
    pub keep: [f64; 3],
    /// Weights within the kept part.
    pub window: Window,
}

/// Weights over the kept part of k-space, as a function of q in [0, 1] from the centre to the end of the kept part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
#[schema(as = KSpaceWindow)]
#[serde(rename_all = "snake_case")]
pub enum Window {
    /// One.
    #[default]
    None,
    /// 0.54 + 0.46 cos(πq).
    Hamming,
}

impl KSpace {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`AcquisitionError::Value`].
    pub fn check(&self) -> Result<(), AcquisitionError> {
        for value in self.keep {
            if !(value > 0.0 && value <= 1.0) {
                let requirement = "above 0 and at most 1";
                return Err(AcquisitionError::Value { name: "the kept part of k-space", value, requirement });
            }
        }
        Ok(())
    }

    /// Applies the window to an image (x fastest). The image is taken as periodic, as the discrete Fourier transform
    /// does.
    ///
    /// A window that is a product over the axes is a circular convolution along each of them, done directly: n kernel
    /// values per voxel and axis.
    pub fn apply(&self, image: &mut [Complex], shape: [usize; 3]) {
        let strides = [1, shape[0], shape[0] * shape[1]];
        for axis in 0..3 {
            let n = shape[axis];
            let kernel = self.kernel(axis, n);
            if n < 2 || kernel.iter().skip(1).all(|k| k.abs() < 1e-15) {
                continue;
            }
            let (mut line, stride) = (vec![Complex::new(0.0, 0.0); n], strides[axis]);
            for start in 0..image.len() {
                if start / stride % n != 0 {
                    continue;
                }
                for (i, value) in line.iter_mut().enumerate() {
                    *value = image[start + i * stride];
                }
                for i in 0..n {
                    let mut sum = Complex::new(0.0, 0.0);
                    for (j, value) in line.iter().enumerate() {
                        sum += *value * kernel[(i + n - j) % n];
                    }
                    image[start + i * stride] = sum;
                }
            }
        }
    }

    /// h(m) = (1/n) Σ_k w(k) cos(2πkm/n): the image of a point.
    fn kernel(&self, axis: usize, n: usize) -> Vec<f64> {
        let half = 0.5 * n as f64;
        let weights: Vec<f64> = (0..n)
            .map(|k| {
                let frequency = k.min(n - k) as f64;
                // The last kept line must not be decided by rounding.
                let q = frequency / (half * self.keep[axis]).max(1e-9);
                match self.window {
                    _ if q > 1.0 + 1e-9 => 0.0,
                    Window::None => 1.0,
                    Window::Hamming => 0.54 + 0.46 * (0.5 * TAU * q).cos(),
                }
            })
            .collect();
        (0..n)
            .map(|m| {
                let turn = |k: usize| (TAU * ((k * m) % n) as f64 / n as f64).cos();
                weights.iter().enumerate().map(|(k, w)| w * turn(k)).sum::<f64>() / n as f64
            })
            .collect()
    }

    /// Factor on the standard deviation of white noise: √(Σ h²) over the three axes.
    pub fn noise_factor(&self, shape: [usize; 3]) -> f64 {
        (0..3).map(|a| self.kernel(a, shape[a]).iter().map(|h| h * h).sum::<f64>()).product::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Plane waves are the eigenvectors: kept ones pass with their weight, others vanish.
    #[test]
    fn plane_waves_pass_or_vanish() {
        let shape = [12, 5, 8];
        let window = KSpace { keep: [0.5, 1.0, 1.0], window: Window::Hamming };
        for (k, weight) in [(0, 1.0), (2, 0.54 + 0.46 * (0.5 * TAU * 2.0 / 3.0).cos()), (3, 0.08), (4, 0.0), (10, 0.31)]
        {
            let phase = |v: usize| TAU * (k * (v % 12)) as f64 / 12.0;
            let mut image: Vec<Complex> = (0..480).map(|v| Complex::from_polar(1.0, phase(v))).collect();
            window.apply(&mut image, shape);
            for (v, value) in image.iter().enumerate() {
                // Rounding of sums of some ten products; q of k = 10 is that of k = 2.
                assert!((value - Complex::from_polar(1.0, phase(v)) * weight).norm() < 1e-13, "{k} {value}");
            }
        }
    }

    #[test]
    fn all_of_kspace_changes_nothing() {
        let window = KSpace { keep: [1.0; 3], window: Window::None };
        let mut image: Vec<Complex> = (0..60).map(|v| Complex::new((v * v % 17) as f64, v as f64)).collect();
        let before = image.clone();
        window.apply(&mut image, [3, 4, 5]);
        assert_eq!(image, before);
        assert!((window.noise_factor([3, 4, 5]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn bad_settings_are_refused() {
        let window = KSpace { keep: [1.0, 0.0, 1.0], window: Window::None };
        assert!(matches!(window.check(), Err(AcquisitionError::Value { value: 0.0, .. })));
    }
}
