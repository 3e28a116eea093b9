//! The regular grid of a scan.

use super::{Surface, VoxelError};
use crate::specimen::Specimen;
use serde::Serialize;

/// A regular grid aligned with the specimen's axes. Voxels are numbered with x fastest: `i + nx (j + ny k)`.
///
/// The affine of a NIfTI image with this grid has `voxel_mm` on its diagonal and `origin_mm` in its last column.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct VoxelGrid {
    /// Centre of voxel (0, 0, 0), mm in the specimen's frame.
    pub origin_mm: [f64; 3],
    /// Edges of a voxel, mm.
    pub voxel_mm: [f64; 3],
    /// Voxels along x, y, z.
    pub shape: [usize; 3],
    /// The face on which the grid lies, where cameras measured a surface: its one layer of voxels has no thickness, and
    /// the edge along the normal only says how pictures draw it. `None` for a scan of the volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surface: Option<Surface>,
}

impl VoxelGrid {
    /// Largest number of voxels of a grid: memory, and indices in 32 bits.
    pub const MAX_VOXELS: usize = 50_000_000;

    /// A grid from its first voxel's centre, its voxel and its shape.
    ///
    /// # Errors
    /// [`VoxelError::InvalidVoxel`], [`VoxelError::TooManyVoxels`].
    pub fn new(origin_mm: [f64; 3], voxel_mm: [f64; 3], shape: [usize; 3]) -> Result<Self, VoxelError> {
        check_voxel(voxel_mm)?;
        check_size(shape.iter().map(|&n| n as f64).product())?;
        Ok(VoxelGrid { origin_mm, voxel_mm, shape, surface: None })
    }

    /// The grid centred on the specimen's block (of a wedge, on the box around it), with extent / edge voxels along
    /// each axis, rounded to the nearest whole number (at least one).
    ///
    /// A scan's grid lies anywhere relative to the sample. On average over that offset, the voxels at least half filled
    /// number extent / edge along each axis; rounding keeps closest to that and keeps the grid mirror symmetric. Up to
    /// half a voxel of material at a face then belongs to no voxel. (25.4 × 6.4 × 19.1 mm at 1 × 0.1875 × 0.75 mm: 25 ×
    /// 34 × 25 = 21,250 voxels; volume / voxel volume is 22,079.)
    ///
    /// # Errors
    /// [`VoxelError::InvalidVoxel`], [`VoxelError::TooManyVoxels`].
    pub fn covering(specimen: &Specimen, voxel_mm: [f64; 3]) -> Result<Self, VoxelError> {
        check_voxel(voxel_mm)?;
        let extent = specimen.block.extents_mm();
        let count = [0, 1, 2].map(|a| (extent[a] / voxel_mm[a]).round().max(1.0));
        check_size(count.iter().product())?;
        let origin_mm = [0, 1, 2].map(|a| -0.5 * (count[a] - 1.0) * voxel_mm[a]);
        Ok(VoxelGrid { origin_mm, voxel_mm, shape: count.map(|n| n as usize), surface: None })
    }

    /// By how much less the block may extend along x, y and z before [`Self::covering`] has a row of voxels less there,
    /// mm.
    ///
    /// # Errors
    /// As [`Self::covering`].
    pub fn spare_mm(specimen: &Specimen, voxel_mm: [f64; 3]) -> Result<[f64; 3], VoxelError> {
        let grid = Self::covering(specimen, voxel_mm)?;
        let extent = specimen.block.extents_mm();
        Ok([0, 1, 2].map(|a| extent[a] - (grid.shape[a] as f64 - 0.5) * voxel_mm[a]))
    }

    /// The grid of a planned measurement: [`Self::covering`], of the volume or of a surface. The subsets of a surface
    /// lie side by side and have the two edges of `voxel_mm` in the face.
    ///
    /// # Errors
    /// As [`Self::covering`]; [`VoxelError::HiddenFace`].
    pub fn planned(specimen: &Specimen, voxel_mm: [f64; 3], surface: Option<Surface>) -> Result<Self, VoxelError> {
        let Some(surface) = surface else { return Self::covering(specimen, voxel_mm) };
        check_voxel(voxel_mm)?;
        // Along the normal a voxel as long as the block is one layer, which is then moved onto the face.
        let axis = surface.face.axis();
        let mut whole = voxel_mm;
        whole[axis] = 2.0 * surface.face.position_mm(specimen).abs();
        let mut grid = Self::covering(specimen, whole)?;
        grid.voxel_mm[axis] = voxel_mm[axis];
        grid.origin_mm[axis] = surface.face.position_mm(specimen);
        grid.on_surface(specimen, surface)
    }

    /// A grid that stands for [`Self::planned`] wherever that may lie, and for how many of its voxels each voxel
    /// stands.
    ///
    /// Where a grid lies relative to the sample is not known beforehand, and what a scan tells depends on it: much is
    /// seen at the free faces, where it decides about a row of voxels. Over all places with the same probability, the
    /// sum over voxels of a function g of a voxel's centre c is on average ∫ g(c) dc over the centres of voxels at
    /// least half filled, which are those in the block, divided by the volume of a voxel. The voxels of this grid are
    /// stretched or shortened until they tile the block exactly, as many along each axis as in [`Self::planned`]: their
    /// sum is the integral by the midpoint rule. Unlike the sum over one grid it changes smoothly with the size of the
    /// block. Of a wedge they tile the box around it, and those at least half filled stand for the integral.
    ///
    /// # Errors
    /// As [`Self::planned`].
    pub fn tiling(
        specimen: &Specimen,
        voxel_mm: [f64; 3],
        surface: Option<Surface>,
    ) -> Result<(Self, f64), VoxelError> {
        let mut grid = Self::planned(specimen, voxel_mm, surface)?;
        let extent = specimen.block.extents_mm();
        let (normal, mut voxels_each) = (grid.normal_axis(), 1.0);
        for axis in (0..3).filter(|&a| normal != Some(a)) {
            let edge = extent[axis] / grid.shape[axis] as f64;
            voxels_each *= edge / voxel_mm[axis];
            grid.voxel_mm[axis] = edge;
            grid.origin_mm[axis] = -0.5 * (grid.shape[axis] as f64 - 1.0) * edge;
        }
        Ok((grid, voxels_each))
    }

    /// This grid as one of a surface: it must be a layer on the face.
    ///
    /// # Errors
    /// [`VoxelError::HiddenFace`], [`VoxelError::OffFace`].
    pub fn on_surface(self, specimen: &Specimen, surface: Surface) -> Result<Self, VoxelError> {
        surface.check(specimen)?;
        let (axis, expected_mm) = (surface.face.axis(), surface.face.position_mm(specimen));
        let (layers, found_mm) = (self.shape[axis], self.origin_mm[axis]);
        // Affines are stored in single precision.
        if layers != 1 || !((found_mm - expected_mm).abs() <= FACE_TOLERANCE * expected_mm.abs()) {
            return Err(VoxelError::OffFace { face: surface.face.name(), layers, found_mm, expected_mm });
        }
        Ok(VoxelGrid { surface: Some(surface), ..self })
    }

    /// The axis of the normal of the face on which it lies.
    pub fn normal_axis(&self) -> Option<usize> {
        self.surface.map(|surface| surface.face.axis())
    }

    /// Whether the displacement along x, y, z is measured: all three in a volume.
    pub fn measured(&self) -> [bool; 3] {
        self.surface.map_or([true; 3], Surface::measured)
    }

    /// Whether every component that is measured has a value there.
    pub fn is_complete(&self, displacement: &[f64; 3]) -> bool {
        displacement.iter().zip(self.measured()).all(|(u, is_measured)| !is_measured || u.is_finite())
    }

    /// Puts `value` in the place of every component that is not measured.
    pub fn fill_unmeasured(&self, displacement: &mut [[f64; 3]], value: f64) {
        let measured = self.measured();
        for u in displacement {
            for (component, _) in u.iter_mut().zip(measured).filter(|(_, is_measured)| !is_measured) {
                *component = value;
            }
        }
    }

    /// Number of voxels, in and out of the material.
    pub fn num_voxels(&self) -> usize {
        self.shape.iter().product()
    }

    /// Volume of a voxel, mm³: none where it lies on a face.
    pub fn voxel_volume_mm3(&self) -> f64 {
        if self.surface.is_some() { 0.0 } else { self.voxel_mm.iter().product() }
    }

    /// Area of a voxel on a face, mm²; `None` in a volume.
    pub fn subset_area_mm2(&self) -> Option<f64> {
        let normal = self.normal_axis()?;
        Some((0..3).filter(|&a| a != normal).map(|a| self.voxel_mm[a]).product())
    }

    /// Linear index of voxel (i, j, k).
    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.shape[0] * (j + self.shape[1] * k)
    }

    /// How far the numbers of neighbours along an axis are apart.
    pub fn stride(&self, axis: usize) -> usize {
        self.shape[..axis].iter().product()
    }

    /// (i, j, k) of a linear index.
    pub fn indices(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.shape;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    /// Centre of a voxel, mm.
    pub fn center_mm(&self, index: usize) -> [f64; 3] {
        let n = self.indices(index);
        [0, 1, 2].map(|a| self.origin_mm[a] + n[a] as f64 * self.voxel_mm[a])
    }
}

/// A grid lies on a face where it is this near to it, relative to the face's distance from the centre: ten times the
/// rounding of a number in single precision.
const FACE_TOLERANCE: f64 = 1e-6;

fn check_voxel(voxel_mm: [f64; 3]) -> Result<(), VoxelError> {
    for (axis, value) in ['x', 'y', 'z'].into_iter().zip(voxel_mm) {
        if !(value.is_finite() && value > 0.0) {
            return Err(VoxelError::InvalidVoxel { axis, value });
        }
    }
    Ok(())
}

fn check_size(num_voxels: f64) -> Result<(), VoxelError> {
    if num_voxels <= VoxelGrid::MAX_VOXELS as f64 {
        Ok(())
    } else {
        Err(VoxelError::TooManyVoxels { num_voxels, limit: VoxelGrid::MAX_VOXELS })
    }
}

#[cfg(test)]
mod tests {
    use super::super::mask::tests::{PUBLISHED_VOXEL, solid};
    use super::super::{Face, MeasuredComponents, VoxelMask};
    use super::*;
    use crate::specimen::Block;

    #[test]
    fn published_grid_is_centred() {
        let grid = VoxelGrid::covering(&solid(), PUBLISHED_VOXEL).unwrap();
        assert_eq!(grid.shape, [25, 34, 25]);
        let (first, last) = (grid.center_mm(0), grid.center_mm(grid.num_voxels() - 1));
        for a in 0..3 {
            // Rounding of coordinates of order ten.
            assert!((first[a] + last[a]).abs() < 1e-13);
        }
    }

    /// 25.4, 6.4 and 19.1 mm are 25.4, 34.13 and 25.47 voxels, of which 25, 34 and 25 are kept down to half a voxel
    /// less.
    #[test]
    fn a_row_of_voxels_is_lost_where_half_of_it_is_empty() {
        let spare_mm = VoxelGrid::spare_mm(&solid(), PUBLISHED_VOXEL).unwrap();
        let expected = [0.9, 6.4 - 33.5 * 0.1875, 19.1 - 24.5 * 0.75];
        // Rounding of lengths of order ten.
        assert!((0..3).all(|a| (spare_mm[a] - expected[a]).abs() < 1e-12), "{spare_mm:?}");
        let mut smaller = solid();
        smaller.block.length_mm -= spare_mm[0] + 1e-9;
        assert_eq!(VoxelGrid::covering(&smaller, PUBLISHED_VOXEL).unwrap().shape, [24, 34, 25]);
    }

    /// Sums over the voxels of a grid that lies anywhere are on average those over the tiling's; the centred grid's may
    /// be far off, and jump with the size of the block.
    #[test]
    fn a_tiling_gives_the_mean_over_all_places() {
        let specimen = Specimen { block: Block::new(12.9, 6.2, 9.7), ..solid() };
        let voxel_mm = [2.0, 0.5, 1.5];
        // Much is told at the free faces along x and z.
        let told = |x: [f64; 3]| 1.0 + (x[0] / 6.45).powi(6) + (x[2] / 4.85).powi(4) - 0.5 * (x[1] / 3.1).powi(2);
        let sum = |grid: &VoxelGrid| -> f64 {
            let mask = VoxelMask::of_specimen(&specimen, grid.clone()).unwrap();
            mask.voxels.iter().map(|&voxel| told(grid.center_mm(voxel as usize))).sum()
        };
        let centred = VoxelGrid::covering(&specimen, voxel_mm).unwrap();
        let (tiling, voxels_each) = VoxelGrid::tiling(&specimen, voxel_mm, None).unwrap();
        assert_eq!(tiling.shape, centred.shape);
        assert!((tiling.num_voxels() as f64 * voxels_each - 12.9 * 6.2 * 9.7 / 1.5).abs() < 1e-9);
        let places = 12;
        let mut mean = 0.0;
        for place in 0..places * places * places {
            let moved = [place % places, place / places % places, place / places / places];
            let moved = moved.map(|n| (n as f64 + 0.5) / places as f64 - 1.5);
            let origin = [0, 1, 2].map(|a| centred.origin_mm[a] + moved[a] * voxel_mm[a]);
            let shape = centred.shape.map(|n| n + 2);
            mean += sum(&VoxelGrid::new(origin, voxel_mm, shape).unwrap()) / (places * places * places) as f64;
        }
        let (promised, one) = (voxels_each * sum(&tiling), sum(&centred));
        // Six midpoints take 3.7 % from these powers; at each edge 0.0966 of a voxel's square is less than half filled,
        // 1.5 % of the block, which tells up to three times as much.
        assert!((promised / mean - 1.0).abs() < 0.04, "{promised} {mean}");
        assert!((one / mean - 1.0).abs() > 0.1, "{one} {mean}");
    }

    /// A surface's grid is one layer on the face with the subsets of a volume's grid in its plane.
    #[test]
    fn subsets_lie_on_the_face() {
        let surface = Surface { face: Face::MinusZ, components: MeasuredComponents::InPlane };
        let grid = VoxelGrid::planned(&solid(), PUBLISHED_VOXEL, Some(surface)).unwrap();
        assert_eq!((grid.shape, grid.normal_axis()), ([25, 34, 1], Some(2)));
        assert!((grid.center_mm(0)[2] + 9.55).abs() < 1e-12);
        assert_eq!((grid.voxel_volume_mm3(), grid.subset_area_mm2()), (0.0, Some(0.1875)));
        assert!(grid.is_complete(&[1.0, 2.0, f64::NAN]) && !grid.is_complete(&[f64::NAN, 2.0, 3.0]));
        let off = VoxelGrid::new([0.0; 3], [1.0; 3], [2, 2, 2]).unwrap().on_surface(&solid(), surface);
        assert!(matches!(off, Err(VoxelError::OffFace { layers: 2, .. })), "{off:?}");
        let json = serde_json::to_string(&VoxelGrid::covering(&solid(), PUBLISHED_VOXEL).unwrap()).unwrap();
        assert!(!json.contains("surface"), "a grid of the volume is written as ever: {json}");
    }

    #[test]
    fn indices_invert() {
        let grid = VoxelGrid::new([1.0, 2.0, 3.0], [0.5, 0.25, 2.0], [4, 3, 5]).unwrap();
        for n in 0..grid.num_voxels() {
            assert_eq!(grid.index(grid.indices(n)), n);
        }
        assert_eq!(grid.center_mm(grid.index([3, 2, 1])), [2.5, 2.5, 5.0]);
    }

    #[test]
    fn bad_voxels_are_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = VoxelGrid::covering(&solid(), [1.0, bad, 1.0]).unwrap_err();
            assert!(matches!(error, VoxelError::InvalidVoxel { axis: 'y', .. }));
        }
        assert!(matches!(VoxelGrid::covering(&solid(), [1e-9; 3]).unwrap_err(), VoxelError::TooManyVoxels { .. }));
    }
}
