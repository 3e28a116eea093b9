//! Point clouds as CSV: `x,y,z,ux,uy,uz` with optional `w` (weight) and `sd`, in the specimen's frame; one file per
//! step. Points of digital volume correlation are voxels; those of a face that cameras saw are subsets of that face,
//! and need no column of what is not measured: the place along the normal, and with one camera the displacement along
//! it.

use super::import::{ImportError, ImportOptions, finish};
use super::{RecordedStep, Recording};
use crate::file::ReadingMemory;
use crate::specimen::Specimen;
use crate::voxel::{Surface, VoxelGrid};
use std::path::Path;

/// Positions of one grid plane agree to this part of the spacing.
const PLANE_TOLERANCE: f64 = 0.02;

/// What a voxel takes beside its displacements while points are averaged: four sums and a flag, bytes.
const VOXEL_BYTES: u64 = 33;
/// More columns than any table of points has.
const MAX_COLUMNS: usize = 64;

/// A grid with more voxels per point than this is none: scattered points have planes of their own.
const SPARSEST: f64 = 20.0;

/// A point with its displacement; lengths in the file's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplacementPoint {
    /// Reference position; NaN along the normal of a face where the file does not say it.
    pub position: [f64; 3],
    /// Displacement; NaN where missing or not measured.
    pub displacement: [f64; 3],
    /// Weight in a voxel's mean, one where the file has none.
    pub weight: f64,
    /// Standard deviation of each component, where the file has one.
    pub sd: Option<f64>,
}

/// A table of points.
#[derive(Clone, Debug, PartialEq)]
pub struct PointTable {
    /// The points, in the order of the lines.
    pub points: Vec<DisplacementPoint>,
    /// Names of the columns that were not used, in lower case: what a program writes beside the displacements, and
    /// what is misspelt.
    pub unused_columns: Vec<String>,
}

/// Reads a table with a header, whose cells are parted by commas, or by semicolons or tabs, where numbers may have
/// decimal commas. Lines before the header are skipped; columns of another name are not used. The order of columns is
/// free. A name may carry a unit (`x_mm`, `U [um]`); other numbers have the file's, `unit_mm`. The displacements may be
/// called `u`, `v`, `w`. Of points on a `surface`, the position along its normal may be left out, and the displacement
/// along it where it is not measured.
///
/// # Errors
/// [`ImportError::Table`].
pub fn read_points(
    text: &str,
    path: &Path,
    surface: Option<Surface>,
    unit_mm: f64,
    memory: &ReadingMemory,
) -> Result<PointTable, ImportError> {
    let fail = |line: usize, message: String| ImportError::Table { path: path.into(), line, message };
    let needed = needed_columns(surface);
    let Some(header) = header_of(text, needed) else {
        let (line, missing) = missing_column(text, needed);
        let all: Vec<&str> = COLUMNS.into_iter().zip(needed).filter(|(_, n)| *n).map(|(name, _)| name).collect();
        return Err(fail(line, format!("there is no column {missing}; {} are needed", all.join(","))));
    };
    let Header { line, separator, names, units_mm } = header;
    if names.len() > MAX_COLUMNS {
        return Err(fail(line, format!("more than {MAX_COLUMNS} columns")));
    }
    let lines = text.lines().enumerate().skip(line);
    let column = |name: &str| names.iter().position(|n| n == name);
    let columns = COLUMNS.map(column);
    let (weight_column, sd_column) = (column("w"), column("sd"));
    let mut points = Vec::new();
    for (n, line) in lines {
        if line.trim().is_empty() {
            continue;
        }
        // A list that grows holds its old place beside the new one.
        memory.take_values::<[DisplacementPoint; 2]>("the points", 1)?;
        let fields: Vec<&str> = line.split(separator).take(names.len()).map(|f| f.trim().trim_matches('"')).collect();
        let number = |column: usize| -> Result<f64, ImportError> {
            let value: Result<f64, _> = match fields.get(column) {
                Some(&("" | "nan" | "NaN")) => Ok(f64::NAN),
                Some(text) if separator != ',' && !text.contains('.') => text.replacen(',', ".", 1).parse(),
                Some(text) => text.parse(),
                None => return Err(fail(n + 1, format!("{} fields where {} are needed", fields.len(), names.len()))),
            };
            let in_unit = units_mm[column].map_or(1.0, |own_mm| own_mm / unit_mm);
            value.map(|v| v * in_unit).map_err(|_| fail(n + 1, format!("'{}' is not a number", fields[column])))
        };
        let mut values = [0.0; 6];
        for (value, &column) in values.iter_mut().zip(&columns) {
            *value = column.map_or(Ok(f64::NAN), number)?;
        }
        let [x, y, z, ux, uy, uz] = values;
        if [x, y, z].iter().zip(columns).any(|(p, column)| column.is_some() && !p.is_finite()) {
            return Err(fail(n + 1, "a position is not finite".into()));
        }
        let weight = weight_column.map_or(Ok(1.0), number)?;
        if !(weight >= 0.0 && weight.is_finite()) {
            return Err(fail(n + 1, format!("weight {weight} is not a finite number from zero up")));
        }
        let sd = sd_column.map(number).transpose()?;
        points.push(DisplacementPoint { position: [x, y, z], displacement: [ux, uy, uz], weight, sd });
    }
    if points.is_empty() {
        return Err(fail(1, "there is no point".into()));
    }
    let used = || columns.into_iter().chain([weight_column, sd_column]).flatten();
    let unused = names.iter().enumerate().filter(|(n, name)| !name.is_empty() && used().all(|column| column != *n));
    Ok(PointTable { unused_columns: unused.map(|(_, name)| name.clone()).collect(), points })
}

/// The line of a table that names its columns.
struct Header {
    /// Its number, from 1.
    line: usize,
    separator: char,
    names: Vec<String>,
    units_mm: Vec<Option<f64>>,
}

/// Lines among which the header is looked for: those before it say how the table was made.
const MOST_LINES_BEFORE: usize = 200;

fn lines_with_names(text: &str) -> impl Iterator<Item = Header> {
    text.lines().take(MOST_LINES_BEFORE).enumerate().map(|(n, line)| {
        let cells = line.trim().trim_start_matches('\u{feff}');
        let separator = [';', '\t'].into_iter().find(|s| cells.contains(*s)).unwrap_or(',');
        let (names, units_mm) = names_and_units(cells.split(separator).take(MAX_COLUMNS + 1));
        Header { line: n + 1, separator, names, units_mm }
    })
}

/// The first line that names all columns that are needed.
fn header_of(text: &str, needed: [bool; 6]) -> Option<Header> {
    lines_with_names(text).find(|header| missing_in(header, needed).is_none())
}

fn missing_in(header: &Header, needed: [bool; 6]) -> Option<&'static str> {
    let has = |name: &str| header.names.iter().any(|n| n == name);
    COLUMNS.into_iter().zip(needed).find(|(name, is_needed)| *is_needed && !has(name)).map(|(name, _)| name)
}

/// The line that comes nearest to a header, and the first column that it lacks.
fn missing_column(text: &str, needed: [bool; 6]) -> (usize, &'static str) {
    let known = |header: &Header| header.names.iter().filter(|n| COLUMNS.contains(&n.as_str())).count();
    let nearest = lines_with_names(text).reduce(|best, next| if known(&next) > known(&best) { next } else { best });
    nearest.map_or((1, COLUMNS[0]), |header| (header.line, missing_in(&header, needed).unwrap_or(COLUMNS[0])))
}

/// Names of columns in lower case, and the units that they end in, mm.
fn names_and_units<'a>(cells: impl Iterator<Item = &'a str>) -> (Vec<String>, Vec<Option<f64>>) {
    let of_cell = |cell: &str| {
        let text = cell.trim().trim_matches('"').trim().to_lowercase();
        let end = text.rfind(['_', '[', '(']).unwrap_or(text.len());
        let unit_mm = match text[end..].trim_matches(['_', '[', ']', '(', ')', ' ']) {
            "mm" => 1.0,
            "um" | "µm" | "μm" => 1e-3,
            "m" => 1e3,
            _ => return (text, None),
        };
        (text[..end].trim_end().to_string(), Some(unit_mm))
    };
    let (mut names, units_mm): (Vec<String>, Vec<Option<f64>>) = cells.map(of_cell).unzip();
    let has = |name: &str| names.iter().any(|n| n == name);
    // Programs of cameras call the displacements so; beside other names `w` is a weight.
    if has("u") && has("v") && !["ux", "uy", "uz"].into_iter().any(has) {
        for name in &mut names {
            if let Some((_, ours)) = [("u", "ux"), ("v", "uy"), ("w", "uz")].into_iter().find(|(own, _)| own == name) {
                *name = ours.into();
            }
        }
    }
    (names, units_mm)
}

/// The columns of positions and displacements.
const COLUMNS: [&str; 6] = ["x", "y", "z", "ux", "uy", "uz"];

/// Which of them a table must have.
fn needed_columns(surface: Option<Surface>) -> [bool; 6] {
    let Some(surface) = surface else { return [true; 6] };
    let (measured, normal) = (surface.measured(), surface.face.axis());
    std::array::from_fn(|n| if n < 3 { n != normal } else { measured[n - 3] })
}

/// A recording from one point cloud per step. Points on a regular grid become its voxels; others are averaged, by
/// weight, in voxels of `voxel_mm` on the grid that covers the specimen. With a `surface`, the points lie on that face,
/// and voxels are its subsets.
///
/// # Errors
/// [`ImportError`].
pub fn recording_from_points(
    steps: &[Vec<DisplacementPoint>],
    specimen: &Specimen,
    voxel_mm: Option<[f64; 3]>,
    surface: Option<Surface>,
    options: &ImportOptions,
    memory: &ReadingMemory,
) -> Result<Recording, ImportError> {
    let drives = match options.drive_mm.len() {
        n if n == steps.len() => &options.drive_mm,
        0 if specimen.drive_mm.len() == steps.len() => &specimen.drive_mm,
        found => return Err(ImportError::Drives { found, num_steps: steps.len() }),
    };
    let all = || steps.iter().flatten().map(|p| p.position.map(|x| x * options.unit_mm));
    let grid = match voxel_mm {
        Some(voxel) => VoxelGrid::planned(specimen, voxel, surface)?,
        None => {
            let num_points = steps.iter().map(Vec::len).sum::<usize>();
            memory.take_values::<f64>("the points' planes", num_points as u64)?;
            regular_grid(all, specimen, surface)?
        }
    };
    check_on_face(all(), specimen, &grid)?;
    let bytes = VOXEL_BYTES + 24 * steps.len() as u64;
    memory.take("the recording", (grid.num_voxels() as u64).saturating_mul(bytes))?;
    let index = |position: [f64; 3]| -> Option<usize> {
        let mut n = [0; 3];
        for a in (0..3).filter(|&a| grid.normal_axis() != Some(a)) {
            let at = ((position[a] - grid.origin_mm[a]) / grid.voxel_mm[a]).round();
            if !(at >= 0.0 && at < grid.shape[a] as f64) {
                return None;
            }
            n[a] = at as usize;
        }
        Some(grid.index(n))
    };
    let mut mask = vec![false; grid.num_voxels()];
    let mut recorded = Vec::new();
    let (mut num_outside, mut variance, mut num_sd) = (0usize, 0.0, 0.0);
    for (points, &drive_mm) in steps.iter().zip(drives) {
        let mut sums = vec![[0.0; 4]; grid.num_voxels()];
        for p in points {
            let Some(v) = index(p.position.map(|x| x * options.unit_mm)) else {
                num_outside += 1;
                continue;
            };
            mask[v] = true;
            if grid.is_complete(&p.displacement) {
                for a in 0..3 {
                    sums[v][a] += p.weight * p.displacement[a] * options.unit_mm;
                }
                sums[v][3] += p.weight;
            }
            if let Some(sd) = p.sd.filter(|sd| sd.is_finite()) {
                variance += (sd * options.unit_mm).powi(2);
                num_sd += 1.0;
            }
        }
        let mean = |s: &[f64; 4]| if s[3] > 0.0 { [s[0] / s[3], s[1] / s[3], s[2] / s[3]] } else { [f64::NAN; 3] };
        let mut displacement: Vec<[f64; 3]> = sums.iter().map(mean).collect();
        grid.fill_unmeasured(&mut displacement, f64::NAN);
        recorded.push(RecordedStep { drive_mm, force_n: None, force_sd_n: None, window_s: None, displacement });
    }
    // A standard deviation of single points is that of a voxel only where each voxel is one point.
    let from_file = (num_sd > 0.0 && voxel_mm.is_none()).then(|| [f64::sqrt(variance / num_sd); 3]);
    let options = ImportOptions { noise_sd_mm: options.noise_sd_mm.or(from_file), ..options.clone() };
    let notes = serde_json::json!({ "imported": { "points_outside_the_grid": num_outside } });
    finish(specimen, grid, mask, recorded, &options, notes)
}

/// Whether all points lie on the face of the grid, where it has one.
fn check_on_face(
    mut points: impl Iterator<Item = [f64; 3]>,
    specimen: &Specimen,
    grid: &VoxelGrid,
) -> Result<(), ImportError> {
    let Some(Surface { face, .. }) = grid.surface else { return Ok(()) };
    let (axis, expected_mm) = (face.axis(), face.position_mm(specimen));
    let in_face = (0..3).filter(|&a| a != axis).map(|a| grid.voxel_mm[a]);
    let allowed_mm = 0.5 * in_face.fold(f64::INFINITY, f64::min);
    // A place that is not said is on the face.
    match points.find(|p| (p[axis] - expected_mm).abs() > allowed_mm) {
        None => Ok(()),
        Some(p) => {
            let (axis, found_mm) = (["x", "y", "z"][axis], p[axis]);
            Err(ImportError::OffFace { axis, found_mm, face: face.name(), expected_mm, allowed_mm })
        }
    }
}

/// The grid on which all points lie.
fn regular_grid<I: Iterator<Item = [f64; 3]>>(
    points: impl Fn() -> I,
    specimen: &Specimen,
    surface: Option<Surface>,
) -> Result<VoxelGrid, ImportError> {
    let fail = |message: String| ImportError::NoGrid { message };
    let (mut origin, mut voxel, mut shape) = ([0.0; 3], [1.0; 3], [1; 3]);
    let normal = surface.map(|s| s.face.axis());
    for a in (0..3).filter(|&a| normal != Some(a)) {
        let name = ["x", "y", "z"][a];
        let mut values: Vec<f64> = points().map(|p| p[a]).collect();
        values.sort_by(f64::total_cmp);
        let (low, high) = (values[0], values[values.len() - 1]);
        let gaps = values.windows(2).map(|w| w[1] - w[0]);
        let largest = gaps.clone().fold(0.0, f64::max);
        if !(largest > 0.0) {
            return Err(fail(format!("all points have {name} = {low}")));
        }
        // The smallest gap that is not rounding is the spacing; gaps within a plane are below a part of it.
        let spacing = gaps.filter(|g| *g > PLANE_TOLERANCE * largest).fold(f64::INFINITY, f64::min);
        let count = ((high - low) / spacing).round();
        let spacing = (high - low) / count;
        for value in &values {
            let at = (value - low) / spacing;
            if (at - at.round()).abs() > 5.0 * PLANE_TOLERANCE {
                return Err(fail(format!("{name} = {value} mm lies between planes {spacing} mm apart")));
            }
        }
        (origin[a], voxel[a], shape[a]) = (low, spacing, count as usize + 1);
    }
    let num_points = points().count();
    if shape.iter().map(|&n| n as f64).product::<f64>() > SPARSEST * num_points as f64 {
        return Err(fail(format!("{shape:?} planes for {num_points} points")));
    }
    let Some(surface) = surface else { return Ok(VoxelGrid::new(origin, voxel, shape)?) };
    let normal = surface.face.axis();
    origin[normal] = surface.face.position_mm(specimen);
    voxel[normal] = (0..3).filter(|&a| a != normal).map(|a| voxel[a]).fold(f64::INFINITY, f64::min);
    Ok(VoxelGrid::new(origin, voxel, shape)?.on_surface(specimen, surface)?)
}

#[cfg(test)]
#[path = "points_tests.rs"]
mod tests;
