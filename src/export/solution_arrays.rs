//! The arrays of a forward solution.

use super::arrays::{Axis, Tree, Values};
use super::arrays_error::ArraysError;
use crate::fem::SolveResult;
use crate::mesh::Mesh;
use crate::report::{FieldPlace, ShownMesh, SolutionField};

/// Fields of a sample at the drives (mm) at which they are written.
pub type FieldSeries = Vec<(f64, Vec<SolutionField>)>;

/// The arrays of a solution: forces at the drives and, of each sample, mesh and fields.
///
/// # Errors
/// [`ArraysError::Field`].
pub fn solution_arrays(result: &SolveResult, samples: &[(&Mesh, &FieldSeries)]) -> Result<Tree, ArraysError> {
    let mut tree = Tree::default();
    let drives = [("drive", result.steps.len())];
    let of = |value: fn(&crate::fem::SolveStep) -> f64| result.steps.iter().map(value).collect::<Vec<f64>>();
    tree.array("drive_mm", "mm", "drive", &drives, of(|s| s.drive_mm));
    tree.array("force_n", "N", "force along the drive, all samples together", &drives, of(|s| s.force_n));
    tree.array("normal_force_n", "N", "force along +y, all samples together", &drives, of(|s| s.normal_force_n));
    for (index, (mesh, series)) in samples.iter().enumerate() {
        tree.tree(format!("sample_{}", index + 1), sample_arrays(mesh, series)?);
    }
    Ok(tree)
}

fn sample_arrays(mesh: &Mesh, series: &FieldSeries) -> Result<Tree, ArraysError> {
    let shown = ShownMesh::new(mesh)?;
    let (num_nodes, num_elements, per_cell) = (shown.num_points(), shown.num_cells(), shown.nodes_per_cell());
    let mut tree = Tree::default();
    let drives: Vec<f64> = series.iter().map(|(drive, _)| *drive).collect();
    tree.array("field_drive_mm", "mm", "drives at which the fields are written", &[("drive", drives.len())], drives);
    let nodes = first_index_fastest(shown.positions_mm().as_flattened(), &[3]);
    tree.array("node_mm", "mm", "positions at rest", &[("node", num_nodes), ("component", 3)], nodes);
    let connectivity = shown.connectivity();
    let by_local = (0..per_cell).flat_map(|n| connectivity.iter().skip(n).step_by(per_cell).copied()).collect();
    let about = format!("nodes of each element in the order of VTK's cell type {}", shown.cell_type());
    let axes = [("element", num_elements), ("local_node", per_cell)];
    tree.array("element_nodes", "1", about, &axes, Values::Index(by_local));
    let fields = series.first().map_or(&[][..], |(_, fields)| &fields[..]);
    for (index, field) in fields.iter().enumerate() {
        let place = match field.place {
            FieldPlace::Nodes => ("node", num_nodes),
            FieldPlace::Elements => ("element", num_elements),
        };
        let sizes = vec![3; field.axes.len()];
        let mut values = Vec::new();
        for (_, fields) in series {
            let at_drive = fields.get(index).map_or(&[][..], |f| &f.values[..]);
            let shown = match field.place {
                FieldPlace::Nodes => &shown.of_nodes(field.name, field.num_components(), at_drive)?[..],
                FieldPlace::Elements => at_drive,
            };
            values.extend(first_index_fastest(shown, &sizes));
        }
        let mut axes: Vec<Axis> = vec![place];
        axes.extend(field.axes.iter().map(|&axis| (axis, 3)));
        axes.push(("drive", series.len()));
        tree.array(field.name, field.unit, field.about, &axes, values);
    }
    Ok(tree)
}

/// Values place after place, each with indices of these sizes whose last is fastest, as numbers with the place fastest
/// and then the indices in their order.
fn first_index_fastest(values: &[f64], sizes: &[usize]) -> Vec<f64> {
    let components: usize = sizes.iter().product();
    let mut ordered = Vec::with_capacity(values.len());
    for component in 0..components {
        // The component's indices, the first of them fastest, as a number whose last index is fastest.
        let (mut rest, mut from) = (component, 0);
        for &size in sizes {
            from = from * size + rest % size;
            rest /= size;
        }
        ordered.extend(values.iter().skip(from).step_by(components));
    }
    ordered
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two tensors T_ij = 10 place + 3 i + j, row after row, become T(place, i, j) with the place fastest.
    #[test]
    fn tensors_are_turned_over() {
        let rows: Vec<f64> = (0..2).flat_map(|p| (0..9).map(move |n| f64::from(10 * p + n))).collect();
        let turned = first_index_fastest(&rows, &[3, 3]);
        for (n, value) in turned.iter().enumerate() {
            let (place, i, j) = (n % 2, n / 2 % 3, n / 6);
            assert_eq!(*value, (10 * place + 3 * i + j) as f64);
        }
        assert_eq!(first_index_fastest(&[1.0, 2.0], &[]), [1.0, 2.0]);
        assert_eq!(first_index_fastest(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], &[3]), [1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
    }
}
