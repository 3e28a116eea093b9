//! A raw recording from the volumes of a scanner. Which of them is the phase along which axis at which drive is said by
//! the user; nothing is guessed from what an operator called a series.

use super::error::ScannerError;
use super::phase::PhaseRange;
use super::reader::VolumeReader;
use crate::file::ReadingMemory;
use crate::recording::images::{NamedImage, axes_of_affine, directions, is_same_lattice};
use crate::recording::import::{GridOrigin, ImportError, ImportOptions, IndexAxis, check_extent};
use crate::recording::nifti::Image;
use crate::recording::placement::{MaskBox, Placement, VOXEL_BYTES, select_region};
use crate::recording::{RawRecording, RawStep};
use crate::specimen::Specimen;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use utoipa::ToSchema;

/// Origins of the volumes of one recording agree to this part of a voxel.
const SAME_ORIGIN: f64 = 0.02;
/// Voxels that may be brighter than where the search for the full signal begins: spikes. Samples have more.
const NUM_SPIKES: usize = 100;
/// Steps of the search for the full signal; it settles after a few.
const SIGNAL_STEPS: usize = 50;

/// A volume of a scanner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct VolumeSource {
    /// The series: number or SeriesInstanceUID in DICOM, experiment/reconstruction such as 5/1 in ParaVision.
    #[schema(max_length = 200)]
    pub series: String,
    /// Which of the series' volumes, from 1.
    #[serde(default = "first_volume")]
    #[schema(default = first_volume, minimum = 1, maximum = 1000000)]
    pub volume: usize,
}

/// A volume of phases along one of the specimen's axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PhaseSource {
    /// The series: number or SeriesInstanceUID in DICOM, experiment/reconstruction such as 5/1 in ParaVision.
    #[schema(max_length = 200)]
    pub series: String,
    /// Which of the series' volumes, from 1.
    #[serde(default = "first_volume")]
    #[schema(default = first_volume, minimum = 1, maximum = 1000000)]
    pub volume: usize,
    /// Whether the phase falls as the displacement along the axis rises.
    #[serde(default)]
    #[schema(default = false)]
    pub is_reversed: bool,
}

fn first_volume() -> usize {
    1
}

/// The volumes of one drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SeriesStep {
    /// Drive in mm; not 0, and in the direction of the specimen's drives.
    #[schema(minimum = -100000.0, maximum = 100000.0)]
    pub drive_mm: f64,
    /// Mean force in N while it was scanned, all samples together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_n: Option<f64>,
    /// Standard deviation of the load cell's slow drift in N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1000000.0)]
    pub force_sd_n: Option<f64>,
    /// When it was scanned, in s of the loading history: start and end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 2, max_items = 2)]
    pub window_s: Option<[f64; 2]>,
    /// Displacement per phase along x, y and z, in mm/rad.
    #[schema(min_items = 3, max_items = 3)]
    pub mm_per_radian: [f64; 3],
    /// Phase of the displacement along the specimen's x.
    pub x: PhaseSource,
    /// Phase of the displacement along the specimen's y.
    pub y: PhaseSource,
    /// Phase of the displacement along the specimen's z.
    pub z: PhaseSource,
    /// Magnitude.
    pub magnitude: VolumeSource,
}

/// Which volumes of a scanner make a recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SeriesMap {
    /// The specimen's axes along the patient's right, front and head, such as y,z,x or -y,z,-x: how the specimen lay in
    /// the scanner. x,y,z where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 16)]
    pub scanner_axes: Option<String>,
    /// Part of the full signal from which a voxel is material: at 0.5 those of which half is. Magnitudes count as their
    /// mean over the drives.
    #[serde(default = "half")]
    #[schema(default = half, exclusive_minimum = 0.0, maximum = 0.95)]
    pub mask_above: f64,
    /// The drives.
    #[schema(min_items = 1, max_items = 1000)]
    pub steps: Vec<SeriesStep>,
}

fn half() -> f64 {
    0.5
}

/// The first volume and what all others must share with it.
struct Lattice {
    series: String,
    image: NamedImage,
    units: [[f64; 3]; 3],
    edges: [f64; 3],
}

impl Lattice {
    fn of_first(series: &str, image: Image) -> Result<Lattice, ImportError> {
        let image = NamedImage { path: format!("series {series}").into(), image };
        let (units, edges) = directions(&image.path, &image.image)?;
        Ok(Lattice { series: series.into(), image, units, edges })
    }

    fn size(&self) -> [usize; 3] {
        [0, 1, 2].map(|i| self.image.image.shape[i])
    }

    /// Whether a volume lies on the same grid.
    fn check(&self, series: &str, volume: usize, image: &Image) -> Result<(), ImportError> {
        let differs = |what: &'static str| {
            ImportError::Scanner(ScannerError::Grid { series: series.into(), volume, first: self.series.clone(), what })
        };
        let name = PathBuf::from(format!("series {series}"));
        if image.shape != self.image.image.shape {
            return Err(differs("it has another number of voxels"));
        }
        if !is_same_lattice(directions(&name, image)?, (self.units, self.edges)) {
            return Err(differs("its voxels have other edges or directions"));
        }
        let smallest = self.edges.iter().copied().fold(f64::INFINITY, f64::min);
        let is_moved =
            |c: usize| !((image.affine[c][3] - self.image.image.affine[c][3]).abs() <= SAME_ORIGIN * smallest);
        if (0..3).any(is_moved) { Err(differs("it lies at another place")) } else { Ok(()) }
    }

    /// The specimen's axis that each index runs along.
    fn axes(&self, map: &SeriesMap, stated: Option<[IndexAxis; 3]>) -> Result<[IndexAxis; 3], ImportError> {
        if let Some(axes) = stated {
            return Ok(axes);
        }
        let nearest = axes_of_affine(&self.image)?;
        let Some(of_scanner) = map.scanner_axes.as_deref().and_then(ImportOptions::parse_axes) else {
            return Ok(nearest);
        };
        Ok(nearest.map(|n| {
            let lies = of_scanner[n.axis];
            IndexAxis { axis: lies.axis, is_reversed: lies.is_reversed != n.is_reversed }
        }))
    }

    /// The centre of a box in the specimen's axes: positions as the scanner gives them.
    fn center_mm(&self, bounds: &MaskBox, axes: [IndexAxis; 3]) -> [f64; 3] {
        let affine = &self.image.image.affine;
        let at = [0, 1, 2].map(|c| (0..3).map(|i| affine[c][i] * bounds.center(i)).sum::<f64>() + affine[c][3]);
        let mut center = [0.0; 3];
        for (unit, axis) in self.units.iter().zip(axes) {
            let along = (0..3).map(|c| unit[c] * at[c]).sum::<f64>();
            center[axis.axis] = if axis.is_reversed { -along } else { along };
        }
        center
    }
}

/// The signal of a voxel full of material: the median of those brighter than `part` of it. `magnitude` has no voxel
/// that is not finite.
fn full_signal(magnitude: &[f64], part: f64, memory: &ReadingMemory) -> Result<f64, ImportError> {
    let mut sorted: Vec<f64> = memory.list("magnitudes", magnitude.len() as u64)?;
    sorted.extend_from_slice(magnitude);
    sorted.sort_by(f64::total_cmp);
    // From the bright end downwards: the median of what is bright enough for the last guess.
    let last = sorted.len() - 1;
    let mut full = sorted[last - NUM_SPIKES.min(last / 2)];
    for _ in 0..SIGNAL_STEPS {
        let bright = &sorted[sorted.partition_point(|m| *m < part * full)..];
        let next = bright.get(bright.len() / 2).copied().unwrap_or(full);
        if (next - full).abs() <= 1e-9 * full.abs() {
            break;
        }
        full = next;
    }
    memory.give_back_values::<f64>(sorted.len());
    Ok(full)
}

/// A raw recording from volumes of phases and magnitudes, as `map` says.
///
/// The mask is where the mean magnitude is above [`SeriesMap::mask_above`] of the full signal, and of that one region
/// ([`ImportOptions::region`]). `axes` says along which of the specimen's axes the columns, rows and slices run;
/// where it is left out, that follows from the affine and [`SeriesMap::scanner_axes`]. `phase_range` are the values
/// that stand for −π and π; where it is left out, they are the known range that the values fill.
///
/// # Errors
/// [`ImportError`].
pub fn raw_recording_from_series(
    files: &dyn VolumeReader,
    map: &SeriesMap,
    phase_range: Option<[f64; 2]>,
    axes: Option<[IndexAxis; 3]>,
    specimen: &Specimen,
    options: &ImportOptions,
    memory: &ReadingMemory,
) -> Result<RawRecording, ImportError> {
    let mut first: Option<Lattice> = None;
    let mut magnitudes = Vec::new();
    for step in &map.steps {
        let VolumeSource { series, volume } = &step.magnitude;
        let image = files.volume(series, *volume, memory)?;
        let least = image.values.iter().copied().fold(f64::INFINITY, f64::min);
        if !(least >= 0.0) {
            return Err(ScannerError::Magnitude { series: series.clone(), least }.into());
        }
        match &mut first {
            Some(lattice) => {
                lattice.check(series, *volume, &image)?;
                magnitudes.push(image.values);
            }
            None => {
                let mut image = image;
                magnitudes.push(std::mem::take(&mut image.values));
                first = Some(Lattice::of_first(series, image)?);
            }
        }
    }
    let Some(lattice) = first else { return Err(ImportError::EmptyMask) };
    let size = lattice.size();
    let num_voxels: usize = size.iter().product();
    memory.take("the recording", (num_voxels as u64).saturating_mul(VOXEL_BYTES + 8))?;
    let mean: Vec<f64> =
        (0..num_voxels).map(|v| magnitudes.iter().map(|m| m[v]).sum::<f64>() / magnitudes.len() as f64).collect();
    let full = full_signal(&mean, map.mask_above, memory)?;
    let mut mask: Vec<bool> = mean.iter().map(|m| *m > 0.0 && *m >= map.mask_above * full).collect();
    let axes = lattice.axes(map, axes)?;
    select_region(&mut mask, size, &ImportOptions { axes, ..options.clone() })?;
    let bounds = MaskBox::of(&mask, size);
    let center_mm = match options.origin {
        GridOrigin::MaskCenter => [0.0; 3],
        GridOrigin::Positions => lattice.center_mm(&bounds, axes),
    };
    let placement = Placement::new(&mask, &bounds, lattice.edges, center_mm, axes)?;
    check_extent(specimen, &placement.grid)?;
    // Phases are cut to the box as they come; the range of their values is that of whole volumes.
    let mut values: Vec<[Vec<f64>; 3]> = Vec::with_capacity(map.steps.len());
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for step in &map.steps {
        let mut of_step = [Vec::new(), Vec::new(), Vec::new()];
        for (kept, PhaseSource { series, volume, .. }) in of_step.iter_mut().zip([&step.x, &step.y, &step.z]) {
            let image = files.volume(series, *volume, memory)?;
            lattice.check(series, *volume, &image)?;
            (low, high) = image.values.iter().fold((low, high), |(a, b), v| (a.min(*v), b.max(*v)));
            memory.take_values::<f64>("phases", placement.source.len() as u64)?;
            *kept = placement.of_array(&image.values);
            memory.give_back_values::<f64>(image.values.len());
        }
        values.push(of_step);
    }
    let range = PhaseRange::of_values(phase_range, [low, high])?;
    let steps = map.steps.iter().zip(values).zip(&magnitudes);
    let steps = steps.map(|((step, mut phase), magnitude)| {
        for (values, source) in phase.iter_mut().zip([&step.x, &step.y, &step.z]) {
            let sign = if source.is_reversed { -1.0 } else { 1.0 };
            values.iter_mut().for_each(|v| *v = sign * range.radians(*v));
        }
        RawStep {
            drive_mm: step.drive_mm,
            force_n: step.force_n,
            force_sd_n: step.force_sd_n,
            window_s: step.window_s,
            phase,
            magnitude: placement.of_array(magnitude),
            mm_per_radian: step.mm_per_radian,
        }
    });
    let notes = serde_json::json!({ "imported": {
        "phase_range": range.values(), "full_signal": full, "axes": IndexAxis::words(axes), "series": map, "region": options.region,
    } });
    Ok(RawRecording {
        id: options.id.clone(),
        specimen: specimen.clone(),
        steps: steps.collect(),
        grid: placement.grid,
        mask: placement.mask,
        noise_sd_mm: options.noise_sd_mm,
        load: None,
        notes: Some(notes),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::MemoryLimit;

    /// A small sample in much air, with a few spikes ten times as bright and a rim of half-filled voxels.
    #[test]
    fn the_full_signal_is_that_of_the_sample() {
        let memory = MemoryLimit::command().begin();
        let mut magnitude: Vec<f64> = (0..1_000_000).map(|n| f64::from(n % 50)).collect();
        for (n, m) in magnitude.iter_mut().enumerate().take(3000) {
            *m = match n {
                0..20 => 10_000.0,
                20..500 => 500.0,
                _ => 990.0 + (n % 21) as f64,
            };
        }
        let full = full_signal(&magnitude, 0.5, &memory).unwrap();
        // The median of 990 to 1010 with the rim below it.
        assert!((990.0..=1010.0).contains(&full), "{full}");
        assert_eq!(full_signal(&[0.0; 8], 0.5, &memory).unwrap(), 0.0);
    }
}
