//! Field files for ParaView: VTK's XML format for unstructured grids, numbers as base64.

use super::ReportError;
use super::base64::encode;
use super::shown_mesh::ShownMesh;
use super::solution_field::{FieldPlace, SolutionField};
use crate::field::escape_xml;
use crate::mesh::Mesh;
use std::path::Path;

/// A mesh with fields, to be written as a `.vtu` file.
///
/// Of a mesh there is what [`ShownMesh`] shows; ParaView's filter *Reflect* completes a mirrored one. Lengths in mm.
/// Tensors have nine components, row after row: F_xX, F_xY, F_xZ, F_yX, …
///
/// ```
/// use lambdak::mesh::{ElementKind, Mesh, Mirror};
/// use lambdak::report::Vtu;
/// use lambdak::specimen::Taper;
///
/// let mesh = Mesh {
///     element_kind: ElementKind::Hex27,
///     nodes: ElementKind::Hex27.node_coordinates(),
///     connectivity: (0..27).collect(),
///     taper: Taper::default(),
///     mirror: Mirror::default(),
///     fixed_nodes: vec![],
///     moved_nodes: vec![],
///     mirror_y_nodes: vec![],
///     mirror_z_nodes: vec![],
/// };
/// let mut vtu = Vtu::new(&mesh)?;
/// vtu.point_vectors("displacement_mm", &[[0.0; 3]; 27])?;
/// vtu.cell_scalars("jacobian", &[1.0])?;
/// assert!(vtu.to_xml().contains("UnstructuredGrid"));
/// # Ok::<(), lambdak::report::ReportError>(())
/// ```
pub struct Vtu<'a> {
    shown: ShownMesh<'a>,
    point_arrays: String,
    cell_arrays: String,
}

impl<'a> Vtu<'a> {
    /// A file of the mesh's reference state without fields.
    ///
    /// # Errors
    /// [`ReportError::BrokenConnectivity`], [`ReportError::UnknownNode`].
    pub fn new(mesh: &'a Mesh) -> Result<Self, ReportError> {
        Ok(Vtu { shown: ShownMesh::new(mesh)?, point_arrays: String::new(), cell_arrays: String::new() })
    }

    /// Adds one number per node of the mesh.
    ///
    /// # Errors
    /// [`ReportError::LengthMismatch`].
    pub fn point_scalars(&mut self, name: &str, values: &[f64]) -> Result<&mut Self, ReportError> {
        self.add(FieldPlace::Nodes, name, 1, values)
    }

    /// Adds one vector per node of the mesh, such as the displacement.
    ///
    /// # Errors
    /// [`ReportError::LengthMismatch`].
    pub fn point_vectors(&mut self, name: &str, values: &[[f64; 3]]) -> Result<&mut Self, ReportError> {
        self.add(FieldPlace::Nodes, name, 3, values.as_flattened())
    }

    /// Adds one number per element.
    ///
    /// # Errors
    /// [`ReportError::LengthMismatch`].
    pub fn cell_scalars(&mut self, name: &str, values: &[f64]) -> Result<&mut Self, ReportError> {
        self.add(FieldPlace::Elements, name, 1, values)
    }

    /// Adds three numbers per element, such as the principal stretches.
    ///
    /// # Errors
    /// [`ReportError::LengthMismatch`].
    pub fn cell_vectors(&mut self, name: &str, values: &[[f64; 3]]) -> Result<&mut Self, ReportError> {
        self.add(FieldPlace::Elements, name, 3, values.as_flattened())
    }

    /// Adds one tensor per element, such as F or the Cauchy stress.
    ///
    /// # Errors
    /// [`ReportError::LengthMismatch`].
    pub fn cell_tensors(&mut self, name: &str, values: &[[[f64; 3]; 3]]) -> Result<&mut Self, ReportError> {
        self.add(FieldPlace::Elements, name, 9, values.as_flattened().as_flattened())
    }

    /// Adds a field of an equilibrium.
    ///
    /// # Errors
    /// [`ReportError::LengthMismatch`].
    pub fn field(&mut self, field: &SolutionField) -> Result<&mut Self, ReportError> {
        self.add(field.place, field.name, field.num_components(), &field.values)
    }

    fn add(
        &mut self,
        place: FieldPlace,
        name: &str,
        components: usize,
        values: &[f64],
    ) -> Result<&mut Self, ReportError> {
        match place {
            FieldPlace::Nodes => {
                let shown = self.shown.of_nodes(name, components, values)?;
                self.point_arrays.push_str(&float_array(name, components, &shown));
            }
            FieldPlace::Elements => {
                self.shown.check_elements(name, components, values)?;
                self.cell_arrays.push_str(&float_array(name, components, values));
            }
        }
        Ok(self)
    }

    /// The file's text.
    pub fn to_xml(&self) -> String {
        let (num_cells, per_cell) = (self.shown.num_cells(), self.shown.nodes_per_cell());
        let connectivity = self.shown.connectivity();
        let offsets = (1..=num_cells).map(|e| (e * per_cell) as u64);
        let integers = |name: &str, values: &mut dyn Iterator<Item = u64>| {
            // VTK's ids are signed; node numbers are far below 2⁶³, so the bytes are the same.
            data_array("Int64", name, 1, &values.flat_map(u64::to_le_bytes).collect::<Vec<u8>>())
        };
        format!(
            "<?xml version=\"1.0\"?>\n\
             <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
             <UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{num_cells}\">\n\
             <PointData>\n{}</PointData>\n<CellData>\n{}</CellData>\n<Points>\n{}</Points>\n<Cells>\n{}{}{}</Cells>\n\
             </Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
            self.shown.num_points(),
            self.point_arrays,
            self.cell_arrays,
            float_array("position_mm", 3, self.shown.positions_mm().as_flattened()),
            integers("connectivity", &mut connectivity.into_iter().map(u64::from)),
            integers("offsets", &mut offsets.into_iter()),
            data_array("UInt8", "types", 1, &vec![self.shown.cell_type(); num_cells]),
        )
    }

    /// Writes the file.
    ///
    /// # Errors
    /// [`ReportError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        write_file(path, self.to_xml().as_bytes())
    }
}

/// Means over each element of values at its quadrature points: `samples` are (element, weight, values). Elements
/// without a sample get NaN.
pub fn element_means<const N: usize>(
    num_elements: usize,
    samples: impl IntoIterator<Item = (usize, f64, [f64; N])>,
) -> Vec<[f64; N]> {
    let mut sums = vec![([0.0; N], 0.0); num_elements];
    for (element, weight, values) in samples {
        if let Some((sum, total)) = sums.get_mut(element) {
            *total += weight;
            for (s, v) in sum.iter_mut().zip(values) {
                *s += weight * v;
            }
        }
    }
    sums.into_iter().map(|(sum, total)| sum.map(|s| if total > 0.0 { s / total } else { f64::NAN })).collect()
}

/// Writes a file, with the path in the error.
pub(super) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ReportError> {
    std::fs::write(path, bytes).map_err(|source| ReportError::Write { path: path.to_path_buf(), source })
}

fn float_array(name: &str, components: usize, values: &[f64]) -> String {
    data_array("Float64", name, components, &values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())
}

/// One array: its length in bytes as UInt64, then its bytes, together in base64.
fn data_array(kind: &str, name: &str, components: usize, bytes: &[u8]) -> String {
    let mut block = (bytes.len() as u64).to_le_bytes().to_vec();
    block.extend_from_slice(bytes);
    format!(
        "<DataArray type=\"{kind}\" Name=\"{}\" NumberOfComponents=\"{components}\" format=\"binary\">{}</DataArray>\n",
        escape_xml(name),
        encode(&block)
    )
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;
    use crate::mesh::{ElementKind, Mirror};
    use crate::specimen::Taper;

    /// A row of `n` cells along x; hexahedra of edge 2 mm, prisms beside one another.
    pub(in super::super) fn row_of_cells(kind: ElementKind, n: u32) -> Mesh {
        let local = kind.node_coordinates();
        let per = local.len() as u32;
        let nodes = (0..n).flat_map(|e| local.iter().map(move |p| [p[0] + 2.0 * f64::from(e), p[1], p[2]])).collect();
        Mesh {
            element_kind: kind,
            nodes,
            connectivity: (0..n * per).collect(),
            taper: Taper::default(),
            mirror: Mirror::default(),
            fixed_nodes: vec![],
            moved_nodes: vec![],
            mirror_y_nodes: vec![],
            mirror_z_nodes: vec![],
        }
    }

    #[test]
    fn files_are_well_formed_and_count_their_points() {
        for (kind, shown) in [(ElementKind::Hex27, 27), (ElementKind::Prism21, 18)] {
            let mesh = row_of_cells(kind, 2);
            let mut vtu = Vtu::new(&mesh).expect("valid mesh");
            vtu.point_vectors("u <mm>", &mesh.nodes).expect("fits");
            vtu.cell_tensors("F", &[[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, f64::NAN]]; 2]).expect("fits");
            let text = vtu.to_xml();
            assert_well_formed(&text);
            assert!(text.contains(&format!("NumberOfPoints=\"{}\" NumberOfCells=\"2\"", 2 * shown)));
            assert_eq!(text, vtu.to_xml());
        }
    }

    #[test]
    fn wrong_input_is_refused() {
        let mut mesh = row_of_cells(ElementKind::Hex27, 1);
        {
            let mut vtu = Vtu::new(&mesh).expect("valid mesh");
            assert!(matches!(
                vtu.point_scalars("p", &[1.0]).map(|_| ()),
                Err(ReportError::LengthMismatch { found: 1, expected: 27, .. })
            ));
            let path = std::env::temp_dir().join("lambdak-no-such-folder").join("x.vtu");
            assert!(matches!(vtu.write(&path), Err(ReportError::Write { .. })));
        }
        mesh.connectivity[3] = 99;
        assert!(matches!(Vtu::new(&mesh).map(|_| ()), Err(ReportError::UnknownNode { node: 99, .. })));
        mesh.connectivity.pop();
        assert!(matches!(Vtu::new(&mesh).map(|_| ()), Err(ReportError::BrokenConnectivity { found: 26, .. })));
    }

    #[test]
    fn means_are_weighted() {
        let samples = [(0, 1.0, [1.0]), (0, 3.0, [5.0]), (2, 2.0, [7.0]), (9, 1.0, [0.0])];
        let means = element_means(3, samples);
        assert!((means[0][0] - 4.0).abs() < 1e-15 && means[1][0].is_nan() && (means[2][0] - 7.0).abs() < 1e-15);
    }
}
