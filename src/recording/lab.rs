//! Displacement fields as MR-u laboratories keep them in MATLAB files.
//!
//! `U_t` is a cell per step of a cell of three arrays (or an array with the component as fourth and the step as fifth
//! index); `mask` is one in material, zero or NaN elsewhere; `X` holds three arrays of positions, `osc` the voxel's
//! edges along the array's three indices; `prescribedU` the drives. Which index runs along which axis is the
//! laboratory's choice ([`ImportOptions::axes`]); component i of the displacement is the one along the array's index i
//! unless [`ImportOptions::components`] says otherwise. An exported recording is read, too: `displacement_mm`, `mask`,
//! `voxel_mm`, `drive_mm`.

use super::import::{GridOrigin, ImportError, ImportOptions, IndexAxis, finish};
use super::mat::MatValue;
use super::placement::{MaskBox, Placement, VOXEL_BYTES, select_region};
use super::{RecordedStep, Recording};
use crate::file::ReadingMemory;
use crate::specimen::Specimen;

/// Names under which a field is looked for, first first.
const FIELD_NAMES: [&str; 6] = ["U_t", "uicorr", "ui", "U", "u", "displacement_mm"];
/// Names under which the voxel's edges are looked for.
const EDGE_NAMES: [&str; 2] = ["osc", "voxel_mm"];
/// Names under which the drives are looked for.
const DRIVE_NAMES: [&str; 2] = ["prescribedU", "drive_mm"];

/// An array of a file: sizes and numbers, first index fastest.
struct Array<'a> {
    dims: [usize; 3],
    values: &'a [f64],
}

/// The field among the variables of a file: the first of the names that it may have.
fn field_of(variables: &[(String, MatValue)]) -> Option<(&'static str, &MatValue)> {
    FIELD_NAMES.iter().find_map(|name| variables.iter().find(|(n, _)| n == name).map(|(_, value)| (*name, value)))
}

/// Names of the variables that [`recording_from_mat`] does not use.
pub fn unused_variables(variables: &[(String, MatValue)]) -> Vec<&str> {
    let field = field_of(variables).map(|(name, _)| name);
    let is_used =
        |n: &str| Some(n) == field || ["mask", "X"].contains(&n) || EDGE_NAMES.contains(&n) || DRIVE_NAMES.contains(&n);
    variables.iter().map(|(n, _)| n.as_str()).filter(|n| !is_used(n)).collect()
}

/// A recording from the variables of a MATLAB file. Variables that were not used are named in its notes.
///
/// # Errors
/// [`ImportError`].
pub fn recording_from_mat(
    variables: &[(String, MatValue)],
    specimen: &Specimen,
    options: &ImportOptions,
    memory: &ReadingMemory,
) -> Result<Recording, ImportError> {
    let find = |name: &str| variables.iter().find(|(n, _)| n == name).map(|(_, v)| v);
    let names = || variables.iter().map(|(n, _)| n.clone()).collect::<Vec<_>>().join(", ");
    let (field_name, field) =
        field_of(variables).ok_or_else(|| ImportError::Missing { what: "U_t", found: names() })?;
    let steps = steps_of(field)?;
    let dims = steps[0][0].dims;
    for array in steps.iter().flatten() {
        if array.dims != dims {
            let message = format!("its arrays have sizes {dims:?} and {:?}", array.dims);
            return Err(ImportError::Layout { name: field_name.into(), message });
        }
    }
    let num_voxels: usize = dims.iter().product();
    memory.take("the recording", (num_voxels as u64).saturating_mul(VOXEL_BYTES + 24 * steps.len() as u64))?;
    let is_measured = |v: usize| steps.iter().all(|s| s.iter().all(|a| a.values[v].is_finite()));
    let mut mask: Vec<bool> = match find("mask") {
        Some(value) => {
            let array = array_of(value, "mask")?;
            if array.dims != dims {
                let message = format!("its sizes {:?} are not the field's {dims:?}", array.dims);
                return Err(ImportError::Layout { name: "mask".into(), message });
            }
            array.values.iter().map(|m| *m > 0.5).collect()
        }
        None => (0..num_voxels).map(is_measured).collect(),
    };
    let edges = match (options.voxel_mm_by_index, EDGE_NAMES.into_iter().find_map(find), find("X")) {
        (Some(edges), _, _) => edges,
        (None, Some(osc), _) => spacing_from_osc(osc)?.map(|e| e * options.unit_mm),
        (None, None, Some(x)) => spacing_from_positions(x, dims)?.map(|e| e * options.unit_mm),
        (None, None, None) => {
            return Err(ImportError::Missing { what: "osc or X (the voxel's edges)", found: names() });
        }
    };
    select_region(&mut mask, dims, options)?;
    let bounds = MaskBox::of(&mask, dims);
    let positions_mm = match find("X") {
        Some(x) => Some(box_center(x, dims, &bounds, options)?),
        None => None,
    };
    let center = match (options.origin, positions_mm) {
        (GridOrigin::MaskCenter, _) => [0.0; 3],
        (GridOrigin::Positions, Some(center)) => center,
        (GridOrigin::Positions, None) => return Err(ImportError::Missing { what: "X (positions)", found: names() }),
    };
    let Placement { grid, mask: flags, source } = Placement::new(&mask, &bounds, edges, center, options.axes)?;
    let drives = match DRIVE_NAMES.into_iter().find_map(find).and_then(MatValue::numbers) {
        _ if options.drive_mm.len() == steps.len() => options.drive_mm.clone(),
        Some((_, values)) if options.drive_mm.is_empty() && values.len() == steps.len() => {
            values.iter().map(|d| d * options.unit_mm).collect()
        }
        _ if options.drive_mm.is_empty() && specimen.drive_mm.len() == steps.len() => specimen.drive_mm.clone(),
        _ => return Err(ImportError::Drives { found: options.drive_mm.len(), num_steps: steps.len() }),
    };
    let components = options.components.unwrap_or(options.axes);
    let recorded = steps
        .iter()
        .zip(&drives)
        .map(|(arrays, &drive_mm)| {
            let value = |v: usize, axis: usize| {
                let i = components.iter().position(|c| c.axis == axis).unwrap_or(axis);
                let sign = if components[i].is_reversed { -1.0 } else { 1.0 };
                if flags[v] { sign * arrays[i].values[source[v]] * options.unit_mm } else { f64::NAN }
            };
            RecordedStep {
                drive_mm,
                force_n: None,
                force_sd_n: None,
                window_s: None,
                displacement: (0..flags.len()).map(|v| [0, 1, 2].map(|a| value(v, a))).collect(),
            }
        })
        .collect();
    let notes = serde_json::json!({
        "imported": { "field": field_name, "ignored_variables": unused_variables(variables), "voxel_mm_by_index": edges, "region": options.region,
            "origin": options.origin, "center_of_positions_mm": positions_mm, "axes": IndexAxis::words(options.axes),
            "components": IndexAxis::words(components) },
    });
    finish(specimen, grid, flags, recorded, options, notes)
}

/// Arrays of the three components, per step.
fn steps_of(field: &MatValue) -> Result<Vec<[Array<'_>; 3]>, ImportError> {
    let layout = |message: String| ImportError::Layout { name: "U_t".into(), message };
    let triple = |members: &[MatValue]| members.len() == 3 && members.iter().all(|m| m.numbers().is_some());
    match field {
        MatValue::Cell { members, .. } if triple(members) => Ok(vec![arrays_of(members)?]),
        MatValue::Cell { members, .. } if !members.is_empty() => members
            .iter()
            .map(|step| match step.members() {
                Some(inner) if triple(inner) => arrays_of(inner),
                _ => Err(layout("each step must be a cell of three numeric arrays".into())),
            })
            .collect(),
        MatValue::Numeric { dims, values, .. } if (4..=5).contains(&dims.len()) && dims[3] == 3 => {
            let size = [dims[0], dims[1], dims[2]];
            let n: usize = size.iter().product();
            let num_steps = dims.get(4).copied().unwrap_or(1);
            if n == 0 || num_steps == 0 {
                return Err(layout("it is empty".into()));
            }
            let array =
                |s: usize, c: usize| Array { dims: size, values: &values[(3 * s + c) * n..(3 * s + c + 1) * n] };
            Ok((0..num_steps).map(|s| [array(s, 0), array(s, 1), array(s, 2)]).collect())
        }
        _ => Err(layout(
            "it must be a cell per step of three arrays, or an array with the component as fourth index".into(),
        )),
    }
}

fn arrays_of(members: &[MatValue]) -> Result<[Array<'_>; 3], ImportError> {
    Ok([array_of(&members[0], "U_t")?, array_of(&members[1], "U_t")?, array_of(&members[2], "U_t")?])
}

fn array_of<'a>(value: &'a MatValue, name: &str) -> Result<Array<'a>, ImportError> {
    let layout = |message: String| ImportError::Layout { name: name.into(), message };
    let Some((dims, values)) = value.numbers() else {
        return Err(layout("it is not an array of real numbers".into()));
    };
    let size = match dims {
        [a, b, c] => [*a, *b, *c],
        [a, b] => [*a, *b, 1],
        _ => return Err(layout(format!("its sizes are {dims:?}; three are needed"))),
    };
    if values.is_empty() || values.len() != size.iter().product::<usize>() {
        return Err(layout("it is empty".into()));
    }
    Ok(Array { dims: size, values })
}

fn spacing_from_osc(value: &MatValue) -> Result<[f64; 3], ImportError> {
    let layout = |message: String| ImportError::Layout { name: "osc".into(), message };
    match value.numbers() {
        Some((_, &[a, b, c])) if [a, b, c].iter().all(|e| e.is_finite() && e.abs() > 0.0) => Ok([a, b, c]),
        _ => Err(layout("it must hold three spacings that are not zero".into())),
    }
}

/// Centre of the mask's box in the specimen's axes by the positions in `X`, mm. Which of its three arrays runs along an
/// index is seen from which changes along it.
fn box_center(
    value: &MatValue,
    dims: [usize; 3],
    bounds: &MaskBox,
    options: &ImportOptions,
) -> Result<[f64; 3], ImportError> {
    let mut center = [0.0; 3];
    for (i, stride) in [1, dims[0], dims[0] * dims[1]].into_iter().enumerate() {
        let mut along = (0.0f64, 0.0);
        for member in value.members().unwrap_or_default() {
            let array = array_of(member, "X")?;
            let step = if dims[i] > 1 { array.values[stride] - array.values[0] } else { 0.0 };
            if step.abs() > along.0.abs() {
                along = (step, array.values[0] + step * bounds.center(i));
            }
        }
        let IndexAxis { axis, is_reversed } = options.axes[i];
        center[axis] = if is_reversed { -along.1 } else { along.1 } * options.unit_mm;
    }
    Ok(center)
}

/// Spacing along each index: whichever of the three position arrays changes along it.
fn spacing_from_positions(value: &MatValue, dims: [usize; 3]) -> Result<[f64; 3], ImportError> {
    let layout = |message: String| ImportError::Layout { name: "X".into(), message };
    let members = value.members().filter(|m| m.len() == 3);
    let members = members.ok_or_else(|| layout("it must be a cell of three arrays".into()))?;
    let mut spacing = [0.0f64; 3];
    for member in members {
        let array = array_of(member, "X")?;
        if array.dims != dims {
            return Err(layout(format!("its sizes {:?} are not the field's {dims:?}", array.dims)));
        }
        for (i, stride) in [1, dims[0], dims[0] * dims[1]].into_iter().enumerate() {
            if dims[i] > 1 {
                let step = (array.values[(dims[i] - 1) * stride] - array.values[0]) / (dims[i] - 1) as f64;
                if step.abs() > spacing[i].abs() {
                    spacing[i] = step;
                }
            }
        }
    }
    if spacing.iter().all(|s| s.is_finite() && s.abs() > 0.0) {
        Ok(spacing)
    } else {
        Err(layout(format!("the spacings along its indices are {spacing:?}")))
    }
}

#[cfg(test)]
#[path = "lab_tests.rs"]
mod tests;
