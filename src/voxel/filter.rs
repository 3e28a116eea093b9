//! The 2×2×2 Hamming filter (`hamming2`) of filtered recordings.

use super::{VoxelError, VoxelGrid, VoxelMask};
use crate::specimen::Specimen;

/// Averages the 2×2×2 acquired voxels around each corner of the acquired grid: equal weights, material voxels only.
/// (Two Hamming weights are equal.) The filtered value lies at the corner.
///
/// Neighbouring filtered values share acquired voxels, so their noise is correlated: `noise_sd_mm` of a filtered
/// recording is that of one value, a factor √8 below the acquired noise in the interior.
#[derive(Clone, Debug)]
pub struct HammingFilter {
    filtered: VoxelMask,
    num_sources: usize,
    offsets: Vec<u32>,
    /// Places in the acquired mask.
    sources: Vec<u32>,
}

/// The filter is one of volumes.
fn check_volume(grid: &VoxelGrid) -> Result<(), VoxelError> {
    if grid.surface.is_none() { Ok(()) } else { Err(VoxelError::FilteredSurface) }
}

impl HammingFilter {
    /// All corners inside the acquired grid with at least half (four) of their eight voxels in the acquired mask. The
    /// filtered grid has one voxel less along each axis and lies half a voxel further.
    ///
    /// # Errors
    /// [`VoxelError::EmptyMask`]; [`VoxelError::FilteredSurface`].
    pub fn new(acquired: &VoxelMask) -> Result<Self, VoxelError> {
        check_volume(&acquired.grid)?;
        let grid = VoxelGrid {
            origin_mm: [0, 1, 2].map(|a| acquired.grid.origin_mm[a] + 0.5 * acquired.grid.voxel_mm[a]),
            shape: acquired.grid.shape.map(|n| n.saturating_sub(1)),
            ..acquired.grid
        };
        Self::build(acquired, grid, |_, num_present| num_present >= 4)
    }

    /// The filter for a filtered recording: `filtered_grid` and the voxels marked by `flags` are the recording's. Also
    /// returns the acquired mask, one voxel larger along each axis and taken from the nominal specimen. Marked voxels
    /// without any acquired voxel are left out.
    ///
    /// # Errors
    /// [`VoxelError::LengthMismatch`], [`VoxelError::EmptyMask`], [`VoxelError::TooManyVoxels`],
    /// [`VoxelError::FilteredSurface`].
    pub fn for_recording(
        specimen: &Specimen,
        filtered_grid: VoxelGrid,
        flags: &[bool],
    ) -> Result<(VoxelMask, Self), VoxelError> {
        check_volume(&filtered_grid)?;
        if flags.len() != filtered_grid.num_voxels() {
            let expected = filtered_grid.num_voxels();
            return Err(VoxelError::LengthMismatch { what: "mask", found: flags.len(), expected });
        }
        let acquired = VoxelMask::of_specimen(
            specimen,
            VoxelGrid::new(
                [0, 1, 2].map(|a| filtered_grid.origin_mm[a] - 0.5 * filtered_grid.voxel_mm[a]),
                filtered_grid.voxel_mm,
                filtered_grid.shape.map(|n| n + 1),
            )?,
        )?;
        let filter = Self::build(&acquired, filtered_grid, |voxel, num_present| flags[voxel] && num_present > 0)?;
        Ok((acquired, filter))
    }

    fn build(
        acquired: &VoxelMask,
        grid: VoxelGrid,
        is_kept: impl Fn(usize, usize) -> bool,
    ) -> Result<Self, VoxelError> {
        let places: Vec<u32> = (0..acquired.num_voxels() as u32).collect();
        let place = acquired.spread(&places, u32::MAX);
        let mut filter = HammingFilter {
            filtered: VoxelMask { grid: grid.clone(), voxels: vec![], material_fraction: vec![] },
            num_sources: acquired.num_voxels(),
            offsets: vec![0],
            sources: vec![],
        };
        for voxel in 0..grid.num_voxels() {
            let [i, j, k] = grid.indices(voxel);
            let first = filter.sources.len();
            for corner in 0..8 {
                let source = [i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2)];
                let at = place[acquired.grid.index(source)];
                if at != u32::MAX {
                    filter.sources.push(at);
                }
            }
            if is_kept(voxel, filter.sources.len() - first) {
                let filled: f64 = filter.sources[first..].iter().map(|&s| acquired.material_fraction[s as usize]).sum();
                filter.filtered.voxels.push(voxel as u32);
                filter.filtered.material_fraction.push(filled / 8.0);
                filter.offsets.push(filter.sources.len() as u32);
            } else {
                filter.sources.truncate(first);
            }
        }
        if filter.filtered.voxels.is_empty() {
            return Err(VoxelError::EmptyMask { voxel_mm: grid.voxel_mm });
        }
        Ok(filter)
    }

    /// The filtered grid and mask.
    pub fn mask(&self) -> &VoxelMask {
        &self.filtered
    }

    /// Filters acquired voxel values (vectors of any length), one per voxel of the acquired mask.
    ///
    /// # Errors
    /// [`VoxelError::LengthMismatch`].
    pub fn apply<const N: usize>(&self, values: &[[f64; N]]) -> Result<Vec<[f64; N]>, VoxelError> {
        if values.len() != self.num_sources {
            let (found, expected) = (values.len(), self.num_sources);
            return Err(VoxelError::LengthMismatch { what: "voxel values", found, expected });
        }
        Ok(self
            .offsets
            .windows(2)
            .map(|range| {
                let sources = &self.sources[range[0] as usize..range[1] as usize];
                let mut mean = [0.0; N];
                for &source in sources {
                    for n in 0..N {
                        mean[n] += values[source as usize][n] / sources.len() as f64;
                    }
                }
                mean
            })
            .collect())
    }

    /// The transpose of [`Self::apply`]: Σ_f A_fa w_f for each acquired voxel a. For adjoints and the noise's
    /// covariance.
    ///
    /// # Errors
    /// [`VoxelError::LengthMismatch`].
    pub fn apply_transposed(&self, weights: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, VoxelError> {
        if weights.len() != self.filtered.num_voxels() {
            let (found, expected) = (weights.len(), self.filtered.num_voxels());
            return Err(VoxelError::LengthMismatch { what: "voxel weights", found, expected });
        }
        let mut acquired = vec![[0.0; 3]; self.num_sources];
        for (range, weight) in self.offsets.windows(2).zip(weights) {
            let sources = &self.sources[range[0] as usize..range[1] as usize];
            for &source in sources {
                for n in 0..3 {
                    acquired[source as usize][n] += weight[n] / sources.len() as f64;
                }
            }
        }
        Ok(acquired)
    }

    /// Acquired voxels that each filtered value is the mean of.
    pub fn num_averaged(&self) -> Vec<usize> {
        self.offsets.windows(2).map(|range| (range[1] - range[0]) as usize).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::mask::tests::{PUBLISHED_VOXEL, solid, two_hole};
    use super::*;

    /// In the interior a linear field keeps its value at the corner; a constant is kept everywhere.
    #[test]
    fn linear_fields_move_to_the_corners() {
        let acquired = VoxelMask::covering(&two_hole(), PUBLISHED_VOXEL).unwrap();
        let filter = HammingFilter::new(&acquired).unwrap();
        assert_eq!(filter.mask().grid.shape, acquired.grid.shape.map(|n| n - 1));
        let values: Vec<[f64; 2]> = acquired
            .voxels
            .iter()
            .map(|&v| acquired.grid.center_mm(v as usize))
            .map(|x| [2.0, x[0] - 2.0 * x[1] + 0.5 * x[2]])
            .collect();
        let filtered = filter.apply(&values).unwrap();
        for (n, &voxel) in filter.mask().voxels.iter().enumerate() {
            // Means of eight numbers of order ten.
            assert!((filtered[n][0] - 2.0).abs() < 1e-14);
            if filter.mask().material_fraction[n] > 1.0 - 1e-12 {
                let x = filter.mask().grid.center_mm(voxel as usize);
                assert!((filtered[n][1] - (x[0] - 2.0 * x[1] + 0.5 * x[2])).abs() < 1e-13);
            }
        }
    }

    /// ⟨A u, w⟩ = ⟨u, Aᵀ w⟩.
    #[test]
    fn transpose_is_the_transpose() {
        let acquired = VoxelMask::covering(&two_hole(), PUBLISHED_VOXEL).unwrap();
        let filter = HammingFilter::new(&acquired).unwrap();
        let wave = |n: usize, s: f64| [0, 1, 2].map(|c| (s * n as f64 + c as f64).sin());
        let u: Vec<[f64; 3]> = (0..acquired.num_voxels()).map(|n| wave(n, 0.7)).collect();
        let w: Vec<[f64; 3]> = (0..filter.mask().num_voxels()).map(|n| wave(n, 1.3)).collect();
        let dot = |a: &[[f64; 3]], b: &[[f64; 3]]| -> f64 {
            a.iter().zip(b).map(|(a, b)| a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).sum()
        };
        let (left, right) = (dot(&filter.apply(&u).unwrap(), &w), dot(&u, &filter.apply_transposed(&w).unwrap()));
        // Sums of 6·10⁴ products of order one.
        assert!((left - right).abs() < 1e-10, "{left} {right}");
        assert!(filter.num_averaged().iter().all(|n| (4..=8).contains(n)));
    }

    /// A filtered recording's grid leads back to the acquired one.
    #[test]
    fn recording_round_trip() {
        let acquired = VoxelMask::covering(&solid(), PUBLISHED_VOXEL).unwrap();
        let filter = HammingFilter::new(&acquired).unwrap();
        let grid = filter.mask().grid.clone();
        let flags = filter.mask().spread(&vec![true; filter.mask().num_voxels()], false);
        let (again, second) = HammingFilter::for_recording(&solid(), grid, &flags).unwrap();
        assert_eq!(again.voxels, acquired.voxels);
        assert_eq!(second.mask().voxels, filter.mask().voxels);
        assert_eq!(second.sources, filter.sources);
    }
}
