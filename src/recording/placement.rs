//! Where arrays that are indexed in a laboratory's own order lie in the specimen's frame: one region of a mask, the box
//! around it, and that box as the recording's grid.

use super::import::{ImportError, ImportOptions, IndexAxis};
use crate::voxel::VoxelGrid;

/// What is kept of a voxel beside its values while a recording is put together: flags, region, origin, bytes.
pub(super) const VOXEL_BYTES: u64 = 48;
/// Regions smaller than this part of the largest are specks.
const SPECK: f64 = 0.2;

/// The box around a mask, in indices of its array.
pub(super) struct MaskBox {
    dims: [usize; 3],
    low: [usize; 3],
    high: [usize; 3],
}

impl MaskBox {
    /// Of a mask with a voxel in it; first index fastest.
    pub(super) fn of(mask: &[bool], dims: [usize; 3]) -> MaskBox {
        let (mut low, mut high) = (dims, [0; 3]);
        for v in (0..mask.len()).filter(|&v| mask[v]) {
            let at = [v % dims[0], v / dims[0] % dims[1], v / (dims[0] * dims[1])];
            for i in 0..3 {
                low[i] = low[i].min(at[i]);
                high[i] = high[i].max(at[i] + 1);
            }
        }
        MaskBox { dims, low, high }
    }

    /// The box's centre along index `i`, in indices.
    pub(super) fn center(&self, i: usize) -> f64 {
        0.5 * (self.low[i] + self.high[i] - 1) as f64
    }
}

/// The box of a mask as a grid in the specimen's frame.
pub(super) struct Placement {
    /// The grid.
    pub(super) grid: VoxelGrid,
    /// Which of its voxels hold material.
    pub(super) mask: Vec<bool>,
    /// Place of each of its voxels in the arrays.
    pub(super) source: Vec<usize>,
}

impl Placement {
    /// Puts the box of `mask`, whose voxels have the edges `edges_mm` along its indices, at `center_mm` in the
    /// specimen's frame; index i runs along `axes[i]`.
    ///
    /// # Errors
    /// [`ImportError::Voxel`].
    pub(super) fn new(
        mask: &[bool],
        bounds: &MaskBox,
        edges_mm: [f64; 3],
        center_mm: [f64; 3],
        axes: [IndexAxis; 3],
    ) -> Result<Placement, ImportError> {
        let MaskBox { dims, low, high } = *bounds;
        // Which index runs along which axis.
        let index_of = [0, 1, 2].map(|axis| axes.iter().position(|a| a.axis == axis).unwrap_or(axis));
        let shape = index_of.map(|i| high[i] - low[i]);
        let voxel = index_of.map(|i| edges_mm[i].abs());
        let origin = [0, 1, 2].map(|a| center_mm[a] - 0.5 * (shape[a] as f64 - 1.0) * voxel[a]);
        let grid = VoxelGrid::new(origin, voxel, shape)?;
        let source: Vec<usize> = (0..grid.num_voxels())
            .map(|v| {
                let n = grid.indices(v);
                let mut at = [0; 3];
                for (axis, &i) in index_of.iter().enumerate() {
                    at[i] = if axes[i].is_reversed { high[i] - 1 - n[axis] } else { low[i] + n[axis] };
                }
                at[0] + dims[0] * (at[1] + dims[1] * at[2])
            })
            .collect();
        let mask = source.iter().map(|&s| mask[s]).collect();
        Ok(Placement { grid, mask, source })
    }

    /// The values of an array in the grid's order.
    pub(super) fn of_array(&self, values: &[f64]) -> Vec<f64> {
        self.source.iter().map(|&s| values[s]).collect()
    }
}

/// Keeps one region of the mask: voxels joined by faces. Regions are counted along the array's thickness index.
///
/// # Errors
/// [`ImportError::EmptyMask`], [`ImportError::Regions`].
pub(super) fn select_region(mask: &mut [bool], dims: [usize; 3], options: &ImportOptions) -> Result<(), ImportError> {
    let strides = [1, dims[0], dims[0] * dims[1]];
    let mut label = vec![0u32; mask.len()];
    // Size and mean position along the thickness index, per region.
    let mut regions: Vec<(usize, f64)> = Vec::new();
    let along = options.axes.iter().position(|a| a.axis == 1).unwrap_or(1);
    let mut stack = Vec::new();
    for start in 0..mask.len() {
        if !mask[start] || label[start] != 0 {
            continue;
        }
        let name = regions.len() as u32 + 1;
        let (mut size, mut sum) = (0, 0.0);
        label[start] = name;
        stack.push(start);
        while let Some(v) = stack.pop() {
            size += 1;
            sum += (v / strides[along] % dims[along]) as f64;
            for i in 0..3 {
                let at = v / strides[i] % dims[i];
                let below = (at > 0).then(|| v - strides[i]);
                let above = (at + 1 < dims[i]).then(|| v + strides[i]);
                for to in below.into_iter().chain(above) {
                    if mask[to] && label[to] == 0 {
                        label[to] = name;
                        stack.push(to);
                    }
                }
            }
        }
        regions.push((size, sum / f64::from(u32::try_from(size).unwrap_or(u32::MAX))));
    }
    let largest = regions.iter().map(|r| r.0).max().ok_or(ImportError::EmptyMask)?;
    let mut large: Vec<usize> = (0..regions.len()).filter(|&r| regions[r].0 as f64 >= SPECK * largest as f64).collect();
    large.sort_by(|&a, &b| regions[a].1.total_cmp(&regions[b].1));
    let chosen = match options.region {
        None if large.len() == 1 => large[0],
        Some(n) if (1..=large.len()).contains(&n) => large[n - 1],
        asked => return Err(ImportError::Regions { num_regions: large.len(), asked }),
    };
    for (m, l) in mask.iter_mut().zip(&label) {
        *m = *l == chosen as u32 + 1;
    }
    Ok(())
}
