//! Displacement fields as registration programs keep them in NIfTI images: one vector per voxel, on a grid that may be
//! turned or mirrored against the scanner's axes.
//!
//! Everything is expressed along the image's own three indices: the voxel's edges are the lengths of the affine's
//! columns, and component i is the displacement along the unit vector of index i. A turned or mirrored grid then needs
//! no interpolation; which index runs along which of the specimen's axes says [`ImportOptions::axes`], or, where the
//! scanner's axes are the specimen's, [`axes_of_affine`].

use super::Recording;
use super::import::{ImportError, ImportOptions, IndexAxis};
use super::lab::recording_from_mat;
use super::mat::MatValue;
use super::nifti::Image;
use crate::file::ReadingMemory;
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use utoipa::ToSchema;

/// Cosine of the angle between two columns of an affine from which on the grid counts as sheared: half a degree.
const LARGEST_SHEAR: f64 = 0.0087;
/// Edges and directions of images of one recording agree to this part.
const SAME_GRID: f64 = 1e-4;
/// NIfTI intent of a plain vector, which ITK (and with it ANTs) gives displacement fields.
const INTENT_VECTOR: i16 = 1007;

/// The frame of the vectors in images; where it is left out, lps for the intent 1007 (ITK, ANTs), ras for others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum VectorFrame {
    /// The axes that the affine leads to (right, anterior, superior), as the NIfTI standard has it.
    Ras,
    /// Left, posterior, superior: the first two components are turned. ITK and ANTs write them so.
    Lps,
    /// The image's indices.
    Index,
}

/// An image and its file.
pub struct NamedImage {
    /// The file.
    pub path: PathBuf,
    /// The image.
    pub image: Image,
}

/// Unit vectors along the indices and the voxel's edges, in the affine's unit.
///
/// # Errors
/// [`ImportError::Layout`] for a sheared or flat grid.
pub(super) fn directions(path: &Path, image: &Image) -> Result<([[f64; 3]; 3], [f64; 3]), ImportError> {
    let affine = &image.affine;
    let column = |j: usize| [affine[0][j], affine[1][j], affine[2][j]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let edges = [0, 1, 2].map(|j| dot(column(j), column(j)).sqrt());
    let refuse = |message: &str| ImportError::Layout { name: path.display().to_string(), message: message.into() };
    if !edges.iter().all(|e| *e > 0.0 && e.is_finite()) {
        return Err(refuse("its affine has a column without a length; the voxels have no size"));
    }
    let units = [0, 1, 2].map(|j| column(j).map(|x| x / edges[j]));
    if (0..3).any(|j| dot(units[j], units[(j + 1) % 3]).abs() > LARGEST_SHEAR) {
        return Err(refuse("its affine shears the grid; resample it onto a grid of right angles"));
    }
    Ok((units, edges))
}

/// Whether directions and edges of two images agree.
pub(super) fn is_same_lattice(a: ([[f64; 3]; 3], [f64; 3]), b: ([[f64; 3]; 3], [f64; 3])) -> bool {
    let agree = |a: f64, b: f64| (a - b).abs() <= SAME_GRID * b.abs().max(1.0);
    (0..3).all(|i| agree(a.1[i], b.1[i]) && (0..3).all(|c| agree(a.0[i][c], b.0[i][c])))
}

/// The axis that each index runs along most nearly, where the scanner's axes are the specimen's.
///
/// # Errors
/// [`ImportError::Layout`] for a sheared or flat grid, and for one turned so far that no axis is the nearest.
pub fn axes_of_affine(named: &NamedImage) -> Result<[IndexAxis; 3], ImportError> {
    let (units, _) = directions(&named.path, &named.image)?;
    let nearest = units.map(|u| {
        let axis = (0..3).max_by(|&a, &b| u[a].abs().total_cmp(&u[b].abs())).unwrap_or(0);
        IndexAxis { axis, is_reversed: u[axis] < 0.0 }
    });
    let is_each_once = (0..3).all(|axis| nearest.iter().any(|n| n.axis == axis));
    if is_each_once {
        return Ok(nearest);
    }
    let message = "its affine turns the grid so far that no axis is the nearest; say along which of the specimen's axes \
                   its indices run (--axes)";
    Err(ImportError::Layout { name: named.path.display().to_string(), message: message.into() })
}

/// A recording from images: those with a vector per voxel are its steps (several, where they hold several times), in
/// their order; one with a number per voxel is the mask. Without one the sample is where all displacements are numbers
/// and one at least is not zero.
///
/// The frame of the vectors is `frame`, else [`VectorFrame::Lps`] for the intent of a plain vector, which ITK and ANTs
/// write, and [`VectorFrame::Ras`] for any other. `unit_mm` of the options is the unit of the displacements, and of the
/// grid where the header names none.
///
/// # Errors
/// [`ImportError`].
pub fn recording_from_images(
    images: &[NamedImage],
    specimen: &Specimen,
    frame: Option<VectorFrame>,
    options: &ImportOptions,
    memory: &ReadingMemory,
) -> Result<Recording, ImportError> {
    let layout =
        |named: &NamedImage, message: String| ImportError::Layout { name: named.path.display().to_string(), message };
    let first = images.first().ok_or(ImportError::Missing { what: "image", found: "no file".into() })?;
    let (units, edges) = directions(&first.path, &first.image)?;
    let size = [0, 1, 2].map(|i| first.image.shape[i]);
    let num_voxels: usize = size.iter().product();
    let numeric = |values: Vec<f64>| MatValue::Numeric { dims: size.to_vec(), values, imaginary: None };
    let (mut steps, mut mask) = (Vec::new(), None);
    // Registration programs write zeros or no numbers where there is no sample.
    memory.take("where the sample is", 2 * num_voxels as u64)?;
    let mut is_sample = vec![false; num_voxels];
    let mut is_number = vec![true; num_voxels];
    for named in images {
        let image = &named.image;
        let is_same = [0, 1, 2].map(|i| image.shape[i]) == size
            && is_same_lattice(directions(&named.path, &named.image)?, (units, edges));
        if !is_same {
            let message = format!("its grid is not that of {}; resample one onto the other", first.path.display());
            return Err(layout(named, message));
        }
        // One vector per voxel: components last (NIfTI, ANTs) or, with one time alone, in the place of times (FSL).
        let num_times = match image.shape[3..] {
            [1, 1] => {
                memory.take_values::<f64>("a mask", num_voxels as u64)?;
                mask = Some(numeric(image.values.clone()));
                continue;
            }
            [times, 3] => times,
            [3, 1] => 1,
            _ => {
                let message = format!("its shape is {:?}; (nx, ny, nz, times, 3) is a displacement", image.shape);
                return Err(layout(named, message));
            }
        };
        let by_intent = if image.intent == INTENT_VECTOR { VectorFrame::Lps } else { VectorFrame::Ras };
        let along = directions_of_vectors(frame.unwrap_or(by_intent), &units);
        for (n, &value) in image.values.iter().enumerate() {
            is_sample[n % num_voxels] |= value.abs() > 0.0;
            is_number[n % num_voxels] &= value.is_finite();
        }
        for time in 0..num_times {
            memory.take_values::<f64>("displacements", 3 * num_voxels as u64)?;
            let start = |component: usize| (component * num_times + time) * num_voxels;
            let component = |i: usize| -> Vec<f64> {
                let value = |v: usize| (0..3).map(|c| along[i][c] * image.values[start(c) + v]).sum();
                (0..num_voxels).map(value).collect()
            };
            let members = (0..3).map(|i| numeric(component(i))).collect();
            steps.push(MatValue::Cell { dims: vec![1, 3], members });
        }
    }
    if steps.is_empty() {
        let found = images.iter().map(|n| n.path.display().to_string()).collect::<Vec<_>>().join(", ");
        return Err(ImportError::Missing { what: "with a displacement per voxel", found });
    }
    is_sample.iter_mut().zip(is_number).for_each(|(is_sample, is_number)| *is_sample &= is_number);
    if mask.is_none() && is_sample.contains(&false) && is_sample.contains(&true) {
        memory.take_values::<f64>("a mask", num_voxels as u64)?;
        mask = Some(numeric(is_sample.iter().map(|&is_sample| f64::from(u8::from(is_sample))).collect()));
    }
    let mut variables = vec![("U_t".to_string(), MatValue::Cell { dims: vec![1, steps.len()], members: steps })];
    variables.extend(mask.map(|mask| ("mask".to_string(), mask)));
    let unit = first.image.unit_mm.unwrap_or(options.unit_mm);
    let voxel_mm_by_index = options.voxel_mm_by_index.or(Some(edges.map(|e| e * unit)));
    recording_from_mat(&variables, specimen, &ImportOptions { voxel_mm_by_index, ..options.clone() }, memory)
}

/// For each index the factors of the three components in the displacement along it.
fn directions_of_vectors(frame: VectorFrame, units: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    match frame {
        VectorFrame::Ras => *units,
        VectorFrame::Lps => units.map(|u| [-u[0], -u[1], u[2]]),
        VectorFrame::Index => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    }
}

#[cfg(test)]
#[path = "images_tests.rs"]
mod tests;
