//! Fields of all drives as one VTKHDF file for ParaView (5.12 and later).
//!
//! The layout is that of VTK's documentation, *VTKHDF File Format*, `UnstructuredGrid` with `Steps`, version 2.0. The
//! mesh stands once; every field is one array, step after step, and offsets say where each step's part begins. Time is
//! the drive, mm.

use super::arrays_error::ArraysError;
use crate::mesh::Mesh;
use crate::report::{FieldPlace, ShownMesh, SolutionField};
use hdf5_pure::{AttrValue, DatasetBuilder, FileBuilder, GroupBuilder, LibVer};

/// Version of the format.
const VERSION: [i64; 2] = [2, 0];

/// The bytes of a file with the fields at each drive (mm); every drive has the same fields.
///
/// What is shown of the mesh, and how tensors are laid out, is as in [`crate::report::Vtu`].
///
/// # Errors
/// [`ArraysError`].
pub fn vtkhdf_file(mesh: &Mesh, steps: &[(f64, Vec<SolutionField>)]) -> Result<Vec<u8>, ArraysError> {
    let shown = ShownMesh::new(mesh)?;
    let mut file = FileBuilder::new();
    file.with_libver_bounds(LibVer::Earliest, LibVer::V18);
    let mut root = file.create_group("VTKHDF");
    root.set_attr("Version", AttrValue::I64Array(VERSION.to_vec()));
    root.set_attr("Type", AttrValue::AsciiString("UnstructuredGrid".into()));
    add_mesh(&mut root, &shown);
    let (mut of_points, mut of_cells) = (root.create_group("PointData"), root.create_group("CellData"));
    let mut times = root.create_group("Steps");
    let (mut point_offsets, mut cell_offsets) =
        (times.create_group("PointDataOffsets"), times.create_group("CellDataOffsets"));
    let fields = steps.first().map_or(&[][..], |(_, fields)| &fields[..]);
    for (index, field) in fields.iter().enumerate() {
        let values = joined(&shown, index, field, steps)?;
        let components = field.num_components();
        let (group, offsets, count) = match field.place {
            FieldPlace::Nodes => (&mut of_points, &mut point_offsets, shown.num_points()),
            FieldPlace::Elements => (&mut of_cells, &mut cell_offsets, shown.num_cells()),
        };
        let shape = [(steps.len() * count) as u64, components as u64];
        let dataset = group.create_dataset(field.name);
        dataset.with_f64_data(&values).with_shape(if components == 1 { &shape[..1] } else { &shape });
        integers(offsets.create_dataset(field.name), (0..steps.len()).map(|step| step * count));
    }
    let num_steps = steps.len();
    times.set_attr("NSteps", AttrValue::I64(num_steps as i64));
    times.create_dataset("Values").with_f64_data(&steps.iter().map(|(drive, _)| *drive).collect::<Vec<_>>());
    integers(times.create_dataset("NumberOfParts"), std::iter::repeat_n(1, num_steps));
    // Every step shows the one part and the one mesh that there is.
    for name in ["PartOffsets", "PointOffsets"] {
        integers(times.create_dataset(name), std::iter::repeat_n(0, num_steps));
    }
    for name in ["CellOffsets", "ConnectivityIdOffsets"] {
        integers(times.create_dataset(name), std::iter::repeat_n(0, num_steps)).with_shape(&[num_steps as u64, 1]);
    }
    times.add_group(point_offsets.finish());
    times.add_group(cell_offsets.finish());
    for group in [of_points, of_cells, times] {
        root.add_group(group.finish());
    }
    file.add_group(root.finish());
    file.finish().map_err(|e| ArraysError::Write { format: "VTKHDF", reason: e.to_string() })
}

/// The one part: points, cells, and how many there are.
fn add_mesh(root: &mut GroupBuilder, shown: &ShownMesh) {
    let connectivity = shown.connectivity();
    let (num_points, num_cells, per_cell) = (shown.num_points(), shown.num_cells(), shown.nodes_per_cell());
    let counts =
        [("NumberOfPoints", num_points), ("NumberOfCells", num_cells), ("NumberOfConnectivityIds", connectivity.len())];
    for (name, count) in counts {
        integers(root.create_dataset(name), std::iter::once(count));
    }
    let positions = shown.positions_mm();
    root.create_dataset("Points").with_f64_data(positions.as_flattened()).with_shape(&[num_points as u64, 3]);
    integers(root.create_dataset("Connectivity"), connectivity.iter().map(|&n| n as usize));
    integers(root.create_dataset("Offsets"), (0..=num_cells).map(|cell| cell * per_cell));
    root.create_dataset("Types").with_u8_data(&vec![shown.cell_type(); num_cells]);
}

/// The values of the field of this index at every drive, one after the other.
fn joined(
    shown: &ShownMesh,
    index: usize,
    first: &SolutionField,
    steps: &[(f64, Vec<SolutionField>)],
) -> Result<Vec<f64>, ArraysError> {
    let mut all = Vec::new();
    for (_, fields) in steps {
        // A drive without the field has no values, which is refused as any wrong number of them is.
        let values = fields.get(index).filter(|f| f.name == first.name).map_or(&[][..], |f| &f.values[..]);
        match first.place {
            FieldPlace::Nodes => all.extend(shown.of_nodes(first.name, first.num_components(), values)?),
            FieldPlace::Elements => {
                shown.check_elements(first.name, first.num_components(), values)?;
                all.extend_from_slice(values);
            }
        }
    }
    Ok(all)
}

fn integers(dataset: &mut DatasetBuilder, values: impl Iterator<Item = usize>) -> &mut DatasetBuilder {
    dataset.with_i64_data(&values.map(|v| v as i64).collect::<Vec<_>>())
}

#[cfg(test)]
#[path = "vtkhdf_tests.rs"]
mod tests;
