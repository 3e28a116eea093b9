//! Which voxels of a grid hold material.

use super::section::{Overlap, Section};
use super::{VoxelError, VoxelGrid};
use crate::specimen::Specimen;

/// Slices along x for the area of a cut voxel. Its error is about a thousandth of the voxel.
const FRACTION_SLICES: usize = 32;

/// Voxels of a grid that count as material: at least half of each is filled.
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelMask {
    /// The grid.
    pub grid: VoxelGrid,
    /// Linear indices of the voxels in the mask, increasing.
    pub voxels: Vec<u32>,
    /// Filled part of each voxel in the mask, in (0, 1].
    pub material_fraction: Vec<f64>,
}

impl VoxelMask {
    /// Voxels of `grid` that `specimen` fills to at least a half. Uncut voxels are measured in closed form, voxels cut
    /// by a wall by slices.
    ///
    /// # Errors
    /// [`VoxelError::EmptyMask`].
    pub fn of_specimen(specimen: &Specimen, grid: VoxelGrid) -> Result<Self, VoxelError> {
        // Faces on a voxel's middle, as in symmetric grids, must not be decided by rounding.
        Self::select(specimen, grid, |_, fraction| fraction >= 0.5 - 1e-9)
    }

    /// The centred mask: [`VoxelGrid::covering`] and [`Self::of_specimen`].
    ///
    /// # Errors
    /// As those two.
    pub fn covering(specimen: &Specimen, voxel_mm: [f64; 3]) -> Result<Self, VoxelError> {
        Self::of_specimen(specimen, VoxelGrid::covering(specimen, voxel_mm)?)
    }

    /// The voxels that a recording's mask marks (`flags` in the grid's order) and that `specimen` fills to at least
    /// `least_fraction` (above zero): a recording's mask need not match the nominal specimen.
    ///
    /// # Errors
    /// [`VoxelError::LengthMismatch`], [`VoxelError::EmptyMask`].
    pub fn from_flags(
        specimen: &Specimen,
        grid: VoxelGrid,
        flags: &[bool],
        least_fraction: f64,
    ) -> Result<Self, VoxelError> {
        if flags.len() != grid.num_voxels() {
            return Err(VoxelError::LengthMismatch { what: "mask", found: flags.len(), expected: grid.num_voxels() });
        }
        Self::select(specimen, grid, |index, fraction| flags[index] && fraction > 0.0 && fraction >= least_fraction)
    }

    fn select(specimen: &Specimen, grid: VoxelGrid, is_kept: impl Fn(usize, f64) -> bool) -> Result<Self, VoxelError> {
        let section = Section::new(specimen);
        // Filled part of the section's rectangle per column, and of the voxel's edge per layer.
        let (num_across, num_along) = (grid.shape[section.across], grid.shape[section.along]);
        let mut column_fraction = Vec::with_capacity(grid.shape[0] * num_across);
        for b in 0..num_across {
            for i in 0..grid.shape[0] {
                let (x, across) = (clipped(&grid, &section, 0, i), clipped(&grid, &section, section.across, b));
                let area = match section.overlap(x, across) {
                    Overlap::Full => (x[1] - x[0]) * (across[1] - across[0]),
                    Overlap::Cut => section.area(x, across, FRACTION_SLICES),
                    Overlap::None => 0.0,
                };
                column_fraction.push(area / (grid.voxel_mm[0] * grid.voxel_mm[section.across]));
            }
        }
        let layer_fraction: Vec<f64> = (0..num_along)
            .map(|n| {
                let [low, high] = clipped(&grid, &section, section.along, n);
                (high - low).max(0.0) / grid.voxel_mm[section.along]
            })
            .collect();
        let (mut voxels, mut material_fraction) = (Vec::new(), Vec::new());
        for index in 0..grid.num_voxels() {
            let n = grid.indices(index);
            let fraction = column_fraction[n[0] + grid.shape[0] * n[section.across]] * layer_fraction[n[section.along]];
            if is_kept(index, fraction) {
                voxels.push(index as u32);
                material_fraction.push(fraction.min(1.0));
            }
        }
        if voxels.is_empty() {
            return Err(VoxelError::EmptyMask { voxel_mm: grid.voxel_mm });
        }
        Ok(VoxelMask { grid, voxels, material_fraction })
    }

    /// Number of voxels in the mask.
    pub fn num_voxels(&self) -> usize {
        self.voxels.len()
    }

    /// Material volume of the voxels in the mask, mm³.
    pub fn material_volume_mm3(&self) -> f64 {
        self.material_fraction.iter().sum::<f64>() * self.grid.voxel_volume_mm3()
    }

    /// One value per voxel of the grid from one per voxel of the mask; `missing` elsewhere. For images.
    pub fn spread<T: Copy>(&self, values: &[T], missing: T) -> Vec<T> {
        let mut all = vec![missing; self.grid.num_voxels()];
        for (&voxel, &value) in self.voxels.iter().zip(values) {
            all[voxel as usize] = value;
        }
        all
    }
}

/// Extent of the n-th voxel along an axis, cut to the block; empty (low ≥ high) outside it.
pub(super) fn clipped(grid: &VoxelGrid, section: &Section, axis: usize, n: usize) -> [f64; 2] {
    let (center, edge) = (grid.origin_mm[axis] + n as f64 * grid.voxel_mm[axis], grid.voxel_mm[axis]);
    [(center - 0.5 * edge).max(-section.half[axis]), (center + 0.5 * edge).min(section.half[axis])]
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::specimen::{Block, Hole, HoleAxis, Outline, TestKind};

    pub(crate) const PUBLISHED_VOXEL: [f64; 3] = [1.0, 0.1875, 0.75];

    pub(crate) fn solid() -> Specimen {
        Specimen {
            name: "solid".into(),
            test: TestKind::DoubleLapShear,
            block: Block { length_mm: 25.4, thickness_mm: 6.4, width_mm: 19.1 },
            outline: Outline::Block,
            holes: vec![],
            drive_mm: vec![5.0],
            drive_angle_deg: 0.0,
            samples_in_parallel: 2,
            other_samples: Vec::new(),
        }
    }

    pub(crate) fn two_hole() -> Specimen {
        let hole = |x| Hole::circle(HoleAxis::Thickness, [x, 0.0], 5.0);
        Specimen { holes: vec![hole(-4.2333), hole(4.2333)], ..solid() }
    }

    /// The published block at the published voxel holds about 22,000 voxels.
    #[test]
    fn published_block_holds_about_22000_voxels() {
        let mask = VoxelMask::covering(&solid(), PUBLISHED_VOXEL).unwrap();
        assert_eq!(mask.num_voxels(), 21_250);
        assert!(mask.material_fraction.iter().all(|&f| (f - 1.0).abs() < 1e-12));
    }

    /// On a grid that covers everything, the filled parts add up to the specimen's volume, wherever the grid lies.
    #[test]
    fn filled_parts_add_up_to_the_volume() {
        for specimen in
            [solid(), two_hole(), Specimen { holes: vec![Hole::circle(HoleAxis::Width, [2.0, 0.4], 3.0)], ..solid() }]
        {
            let offset = [-14.906, -3.613, -10.999];
            let grid = VoxelGrid::new(offset, PUBLISHED_VOXEL, [30, 39, 30]).unwrap();
            let all = VoxelMask::from_flags(&specimen, grid.clone(), &vec![true; grid.num_voxels()], 0.0).unwrap();
            let extrusion = if specimen.holes.first().is_some_and(|h| h.axis == HoleAxis::Width) { 19.1 } else { 6.4 };
            let holes: f64 =
                specimen.holes.iter().map(|h| std::f64::consts::PI / 4.0 * h.diameter_mm.powi(2) * extrusion).sum();
            let exact = 25.4 * 6.4 * 19.1 - holes;
            // Midpoint slices: about 1e-3 of each of some 30 cut columns of 0.75 mm², with varying sign.
            assert!((all.material_volume_mm3() - exact).abs() < 1e-4 * exact);
        }
    }

    /// The mean count over random offsets is volume / voxel volume: that of the recordings (20,366 of open-control,
    /// with its own offset) lies within the scatter.
    #[test]
    fn recording_grid_gives_the_recording_mask() {
        let grid = VoxelGrid::new([-14.90630531, -3.61303687, -10.99919987], PUBLISHED_VOXEL, [30, 39, 30]).unwrap();
        let mask = VoxelMask::of_specimen(&two_hole(), grid).unwrap();
        // The recordings' masks were sampled with their own rule: a few columns at the hole walls may differ.
        assert!((mask.num_voxels() as f64 - 20_366.0).abs() < 80.0, "{}", mask.num_voxels());
    }

    /// The dumb-bell's filled parts add up to its area × thickness.
    #[test]
    fn dumbbell_adds_up() {
        let specimen = Specimen {
            test: TestKind::Uniaxial,
            block: Block { length_mm: 35.0, thickness_mm: 2.0, width_mm: 6.0 },
            outline: Outline::Iso37Type4,
            ..solid()
        };
        let grid = VoxelGrid::new([-18.1, -1.3, -3.2], [0.7, 0.3, 0.4], [54, 11, 18]).unwrap();
        let all = VoxelMask::from_flags(&specimen, grid.clone(), &vec![true; grid.num_voxels()], 0.0).unwrap();
        // As for holes: slices of the columns at the transition arcs.
        assert!((all.material_volume_mm3() / specimen.volume_mm3() - 1.0).abs() < 1e-4);
    }

    #[test]
    fn too_coarse_a_grid_is_an_error() {
        let grid = VoxelGrid::new([0.0; 3], [100.0; 3], [1; 3]).unwrap();
        assert_eq!(VoxelMask::of_specimen(&solid(), grid).unwrap_err(), VoxelError::EmptyMask { voxel_mm: [100.0; 3] });
    }
}
