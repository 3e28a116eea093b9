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
    /// by a wall or a slanted face by slices.
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
                let area = match section.overlap_on(&grid, x, across) {
                    Overlap::Full => (x[1] - x[0]) * filled_mm(&grid, section.across, across),
                    Overlap::Cut => section.area(x, across, FRACTION_SLICES),
                    Overlap::None => 0.0,
                };
                column_fraction.push(area / (grid.voxel_mm[0] * grid.voxel_mm[section.across]));
            }
        }
        let layer_fraction: Vec<f64> = (0..num_along)
            .map(|n| {
                let along = clipped(&grid, &section, section.along, n);
                filled_mm(&grid, section.along, along) / grid.voxel_mm[section.along]
            })
            .collect();
        let (mut voxels, mut material_fraction) = (Vec::new(), Vec::new());
        for index in 0..grid.num_voxels() {
            let n = grid.indices(index);
            let of_layer = layer_fraction[n[section.along]];
            let mut fraction = column_fraction[n[0] + grid.shape[0] * n[section.across]] * of_layer;
            if let Some(slanted) = slanted_fraction(&grid, &section, n) {
                fraction = slanted;
            }
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

    /// Material area of the voxels in the mask where they lie on a face, mm²; `None` in a volume.
    pub fn material_area_mm2(&self) -> Option<f64> {
        Some(self.material_fraction.iter().sum::<f64>() * self.grid.subset_area_mm2()?)
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

/// The filled part of a voxel that a slanted face of a wedge cuts; `None` of others.
fn slanted_fraction(grid: &VoxelGrid, section: &Section, n: [usize; 3]) -> Option<f64> {
    let [x, y, z] = [0, 1, 2].map(|axis| clipped(grid, section, axis, n[axis]));
    if !section.is_slanted(x, y) {
        return None;
    }
    let edge_on_mm = (grid.normal_axis() == Some(section.across)).then_some(grid.voxel_mm[section.across]);
    Some(section.volume(x, z, y, edge_on_mm, FRACTION_SLICES) / grid.voxel_mm.iter().product::<f64>())
}

/// How much of a voxel's edge along an axis lies in an interval, mm. Along the normal of a face, where a voxel has no
/// thickness, it is there as a whole.
fn filled_mm(grid: &VoxelGrid, axis: usize, [low, high]: [f64; 2]) -> f64 {
    if grid.normal_axis() == Some(axis) { grid.voxel_mm[axis] } else { (high - low).max(0.0) }
}

/// Extent of the n-th voxel along an axis, cut to the block; empty (low ≥ high) outside it. Along the normal of a face
/// it is the face's position twice.
pub(super) fn clipped(grid: &VoxelGrid, section: &Section, axis: usize, n: usize) -> [f64; 2] {
    if let Some(surface) = grid.surface.filter(|s| s.face.axis() == axis) {
        return [surface.face.sign() * section.half[axis]; 2];
    }
    let (center, edge) = (grid.origin_mm[axis] + n as f64 * grid.voxel_mm[axis], grid.voxel_mm[axis]);
    [(center - 0.5 * edge).max(-section.half[axis]), (center + 0.5 * edge).min(section.half[axis])]
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::{Face, MeasuredComponents, Surface};
    use super::*;
    use crate::specimen::{Block, Hole, HoleAxis, Outline, TestKind};

    pub(crate) const PUBLISHED_VOXEL: [f64; 3] = [1.0, 0.1875, 0.75];

    pub(crate) fn solid() -> Specimen {
        Specimen {
            name: "solid".into(),
            test: TestKind::DoubleLapShear,
            block: Block::new(25.4, 6.4, 19.1),
            outline: Outline::Block,
            holes: vec![],
            drive_mm: vec![5.0],
            drive_angle_deg: 0.0,
            precompression_mm: 0.0,
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
            block: Block::new(35.0, 2.0, 6.0),
            outline: Outline::Iso37Type4,
            ..solid()
        };
        let grid = VoxelGrid::new([-18.1, -1.3, -3.2], [0.7, 0.3, 0.4], [54, 11, 18]).unwrap();
        let all = VoxelMask::from_flags(&specimen, grid.clone(), &vec![true; grid.num_voxels()], 0.0).unwrap();
        // As for holes: slices of the columns at the transition arcs.
        assert!((all.material_volume_mm3() / specimen.volume_mm3() - 1.0).abs() < 1e-4);
    }

    /// The subsets of every face add up to its area, also where holes open in it and where it is a dumb-bell's.
    #[test]
    fn filled_subsets_add_up_to_the_area() {
        let bar = Specimen { test: TestKind::Uniaxial, ..two_hole() };
        let dumbbell = Specimen {
            test: TestKind::Uniaxial,
            block: Block::new(35.0, 2.0, 6.0),
            outline: Outline::Iso37Type4,
            ..solid()
        };
        for (specimen, face, exact) in [
            (&solid(), Face::PlusZ, 25.4 * 6.4),
            // Holes along the thickness open in the y faces alone.
            (&bar, Face::MinusZ, 25.4 * 6.4),
            (&bar, Face::PlusY, 25.4 * 19.1 - 12.5 * std::f64::consts::PI),
            (&dumbbell, Face::MinusY, dumbbell.volume_mm3() / 2.0),
        ] {
            let surface = Surface { face, components: MeasuredComponents::All };
            let mut grid = VoxelGrid::planned(specimen, [0.7, 0.3, 0.4], Some(surface)).unwrap();
            for a in (0..3).filter(|a| *a != face.axis()) {
                // Everything is covered, from anywhere.
                grid.shape[a] += 3;
                grid.origin_mm[a] -= 1.3 * grid.voxel_mm[a];
            }
            let flags = vec![true; grid.num_voxels()];
            let all = VoxelMask::from_flags(specimen, grid, &flags, 0.0).unwrap();
            // As for volumes: slices of the columns at walls and arcs.
            assert!((all.material_area_mm2().unwrap() / exact - 1.0).abs() < 2e-4, "{face:?}");
            assert!(all.material_volume_mm3().abs() < 1e-300);
        }
    }

    #[test]
    fn too_coarse_a_grid_is_an_error() {
        let grid = VoxelGrid::new([0.0; 3], [100.0; 3], [1; 3]).unwrap();
        assert_eq!(VoxelMask::of_specimen(&solid(), grid).unwrap_err(), VoxelError::EmptyMask { voxel_mm: [100.0; 3] });
    }
}
