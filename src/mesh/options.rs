//! How fine a mesh is, and which mesher may be used.

use serde::{Deserialize, Serialize};

use super::error::MeshError;
use crate::specimen::Specimen;

/// Settings of [`super::mesh_specimen`].
///
/// The constructors [`search`](Self::search), [`standard`](Self::standard) and [`fine`](Self::fine) derive the sizes
/// from the specimen's block, so that the number of unknowns is about the same for every specimen of the same shape.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshOptions {
    /// Mean element size in the section, mm.
    pub section_size_mm: f64,
    /// Element layers through the whole extrusion; a mirrored mesh has half of them (rounded up).
    pub levels: usize,
    /// Smallest element size next to a graded boundary (bonded faces and their edges, hole walls) relative to the size
    /// in the interior; 1 = uniform. The number of elements does not depend on it.
    pub grading: f64,
    /// Depth of a layer of elements along the free faces of a sheared block, mm, or what its holes leave room for;
    /// 0 = none, and none beside notches and in dumb-bells. With it the elements next to these faces are as deep in
    /// every layout of the holes' cells.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub free_layer_mm: f64,
    /// Least number of elements around a whole hole, at least 8.
    pub hole_segments: usize,
    /// Least number of element layers between a hole and the edge of its cell.
    pub radial_layers: usize,
    /// Mesh one half or quarter where the specimen has mirror planes.
    pub use_mirror: bool,
    /// Use triangles extruded to prisms even where quadrilaterals would do.
    pub force_prisms: bool,
    /// A section of quadrilaterals with a smaller scaled Jacobian is replaced by triangles; a section of triangles with
    /// a smaller one is refused.
    pub min_scaled_jacobian: f64,
    /// Most elements allowed.
    pub max_elements: usize,
}

/// Elements in the unmirrored block at standard size.
const STANDARD_ELEMENTS: f64 = 720.0;
/// Element size of [`MeshOptions::search`] relative to standard.
pub(crate) const SEARCH_FACTOR: f64 = 1.8;
/// Element size of [`MeshOptions::fine`] relative to standard.
pub(super) const FINE_FACTOR: f64 = 0.6;

/// Grading of [`MeshOptions::graded`].
const STRONG_GRADING: f64 = 0.1;

/// Depth of the layer along free faces of [`MeshOptions::graded`], relative to the gap between the plates: over this
/// depth the fields at a free face change.
const FREE_LAYER: f64 = 0.11;
/// Layers between the plates of [`MeshOptions::graded`] at the standard element size. A number that followed the
/// block's proportions would jump between designs that hardly differ, and promised standard deviations by 2 % with it.
const GRADED_GAP_LEVELS: f64 = 9.8;

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// The standard element size of a specimen, mm.
fn standard_size_mm(specimen: &Specimen) -> f64 {
    let block = &specimen.block;
    (block.length_mm * block.thickness_mm * block.width_mm / STANDARD_ELEMENTS).cbrt()
}

impl MeshOptions {
    /// Coarse meshes for a search: about 2–4 thousand free unknowns in half of a two-hole block.
    pub fn search(specimen: &Specimen) -> Self {
        MeshOptions { hole_segments: 8, ..Self::scaled(specimen, SEARCH_FACTOR) }
    }

    /// The default: about 10–15 thousand free unknowns in half of a two-hole block.
    pub fn standard(specimen: &Specimen) -> Self {
        Self::scaled(specimen, 1.0)
    }

    /// Meshes to confirm results: about 40–70 thousand free unknowns in half of a two-hole block.
    pub fn fine(specimen: &Specimen) -> Self {
        Self::scaled(specimen, FINE_FACTOR)
    }

    /// Element size `factor` times that of [`Self::standard`]; unknowns go with its inverse third power.
    pub fn scaled(specimen: &Specimen, factor: f64) -> Self {
        let block = &specimen.block;
        let size = standard_size_mm(specimen) * factor;
        let along_width = specimen.holes.first().is_some_and(|h| h.axis == crate::specimen::HoleAxis::Width);
        let depth = if along_width { block.width_mm } else { block.thickness_mm };
        // Through the plates' gap shear is not uniform. Along holes fields change slowly but for the free faces.
        let layers = if along_width { 0.6 } else { 1.25 };
        // `as` saturates and maps NaN to 0: bad numbers are reported by `validate`, not here.
        let segments = ((12.0 / factor).round() as usize).clamp(8, 64);
        MeshOptions {
            section_size_mm: size,
            levels: ((layers * depth / size).round() as usize).clamp(3, 400),
            grading: 0.3,
            free_layer_mm: 0.0,
            hole_segments: segments,
            radial_layers: if factor > 1.3 { 2 } else { ((3.0 / factor).round() as usize).clamp(2, 20) },
            use_mirror: true,
            force_prisms: false,
            min_scaled_jacobian: 0.2,
            max_elements: 100_000,
        }
    }

    /// Meshes of elements `by` times the size of these, but no smaller than `finest` times the standard size (where
    /// these are not smaller themselves). All else is as [`Self::scaled`] has it.
    pub fn refined_by(&self, by: f64, specimen: &Specimen, finest: f64) -> Self {
        let own = self.section_size_mm / standard_size_mm(specimen);
        let (use_mirror, max_elements) = (self.use_mirror, self.max_elements);
        MeshOptions { use_mirror, max_elements, ..Self::scaled(specimen, (by * own).max(finest.min(own))) }
    }

    /// As [`Self::scaled`] with elements that get thinner toward bonded faces and edges three times as fast, and twice
    /// as many layers between the plates where holes run through the gap: as many for every block whose gap is not
    /// far deeper than the standard element. Along the plates elements are as large as those of `scaled`: the free
    /// faces' bonded edges are on the brink of folding, and elements small enough to fold do. Along the free faces
    /// lies a layer of elements that is as deep whatever the factor and the layout of the holes' cells: much of what a
    /// scan tells is seen there, and designs must not differ by how deep the elements there happen to be.
    pub fn graded(specimen: &Specimen, factor: f64) -> Self {
        let options = Self::scaled(specimen, factor);
        if !specimen.has_plates() {
            return MeshOptions { grading: STRONG_GRADING, ..options };
        }
        let along_width = specimen.holes.first().is_some_and(|h| h.axis == crate::specimen::HoleAxis::Width);
        let of_gap = (GRADED_GAP_LEVELS / factor).round() as usize;
        let levels = if along_width { options.levels } else { options.levels.max(of_gap) };
        let free_layer_mm = FREE_LAYER * specimen.block.thickness_mm;
        MeshOptions { grading: STRONG_GRADING, levels, free_layer_mm, ..options }
    }

    /// These options, made for `from`, for another block `to`: sizes and layers in proportion to their standard meshes.
    pub fn carried(self, from: &Specimen, to: &Specimen) -> Self {
        let (own, other) = (Self::standard(from), Self::standard(to));
        let levels = self.levels as f64 * other.levels as f64 / own.levels as f64;
        MeshOptions {
            section_size_mm: self.section_size_mm * other.section_size_mm / own.section_size_mm,
            free_layer_mm: self.free_layer_mm * other.section_size_mm / own.section_size_mm,
            levels: (levels.round() as usize).max(1),
            ..self
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`MeshError::OutOfRange`].
    pub fn validate(&self) -> Result<(), MeshError> {
        in_range("section_size_mm", self.section_size_mm, 1e-6, 1e6)?;
        in_range("levels", self.levels as f64, 1.0, 1e4)?;
        in_range("grading", self.grading, 0.01, 1.0)?;
        in_range("free_layer_mm", self.free_layer_mm, 0.0, 1e6)?;
        in_range("hole_segments", self.hole_segments as f64, 8.0, 1e4)?;
        in_range("radial_layers", self.radial_layers as f64, 1.0, 1e3)?;
        in_range("min_scaled_jacobian", self.min_scaled_jacobian, 0.0, 0.9)?;
        in_range("max_elements", self.max_elements as f64, 1.0, 2e7)
    }
}

/// `Ok` if `value` is a number in [`minimum`, `maximum`].
pub(super) fn in_range(name: &'static str, value: f64, minimum: f64, maximum: f64) -> Result<(), MeshError> {
    if value >= minimum && value <= maximum {
        Ok(())
    } else {
        Err(MeshError::OutOfRange { name, value, minimum, maximum })
    }
}
