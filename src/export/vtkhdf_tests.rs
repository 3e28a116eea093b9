//! Files read back.

use super::*;
use crate::mesh::{ElementKind, Mirror};
use crate::specimen::Taper;
use hdf5_pure::File;

/// Two prisms, whose bubble nodes VTK does not show.
fn prisms() -> Mesh {
    let local = ElementKind::Prism21.node_coordinates();
    let nodes = (0..2).flat_map(|e| local.iter().map(move |p| [p[0] + f64::from(e), p[1], p[2]])).collect();
    Mesh {
        element_kind: ElementKind::Prism21,
        nodes,
        connectivity: (0..42).collect(),
        taper: Taper::default(),
        mirror: Mirror::default(),
        fixed_nodes: vec![],
        moved_nodes: vec![],
        mirror_y_nodes: vec![],
        mirror_z_nodes: vec![],
    }
}

fn fields(mesh: &Mesh, drive: f64) -> Vec<SolutionField> {
    let field = |name, place, axes, values| SolutionField { name, unit: "1", about: "", place, axes, values };
    let displacement = mesh.nodes.iter().flatten().map(|x| drive * x).collect();
    vec![
        field("displacement_mm", FieldPlace::Nodes, &["component"][..], displacement),
        field("jacobian", FieldPlace::Elements, &[][..], vec![drive, 2.0 * drive]),
    ]
}

#[test]
fn every_step_begins_where_its_offset_says() {
    let mesh = prisms();
    let steps = [2.5, 5.0, 7.0].map(|drive| (drive, fields(&mesh, drive)));
    let file = File::from_bytes(vtkhdf_file(&mesh, &steps).unwrap()).unwrap();
    let root = file.group("VTKHDF").unwrap();
    assert_eq!(root.attrs().unwrap()["Type"], AttrValue::AsciiString("UnstructuredGrid".into()));
    let integers = |name: &str| file.dataset(&format!("VTKHDF/{name}")).unwrap().read_i64().unwrap();
    assert_eq!(integers("NumberOfPoints"), [36]);
    assert_eq!(integers("NumberOfCells"), [2]);
    assert_eq!(integers("NumberOfConnectivityIds"), [36]);
    assert_eq!(integers("Offsets"), [0, 18, 36]);
    assert_eq!(file.dataset("VTKHDF/Types").unwrap().read_u8().unwrap(), [32, 32]);
    assert_eq!(file.dataset("VTKHDF/Steps/Values").unwrap().read_f64().unwrap(), [2.5, 5.0, 7.0]);
    let points = file.dataset("VTKHDF/Points").unwrap().read_f64().unwrap();
    let displacement = file.dataset("VTKHDF/PointData/displacement_mm").unwrap();
    assert_eq!(displacement.shape().unwrap(), [108, 3]);
    let (displacement, jacobian) =
        (displacement.read_f64().unwrap(), file.dataset("VTKHDF/CellData/jacobian").unwrap().read_f64().unwrap());
    let point_offsets = integers("Steps/PointDataOffsets/displacement_mm");
    let cell_offsets = integers("Steps/CellDataOffsets/jacobian");
    for (step, (drive, _)) in steps.iter().enumerate() {
        let from = 3 * point_offsets[step] as usize;
        // The field is the position times the drive, so it says to which node and step it belongs.
        for (x, u) in points.iter().zip(&displacement[from..]) {
            assert_eq!(*u, drive * x);
        }
        assert_eq!(jacobian[cell_offsets[step] as usize..][..2], [*drive, 2.0 * drive]);
    }
    for name in ["PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"] {
        assert_eq!(integers(&format!("Steps/{name}")), [0, 0, 0]);
    }
}

#[test]
fn a_drive_without_a_field_is_refused() {
    let mesh = prisms();
    let mut steps = [1.0, 2.0].map(|drive| (drive, fields(&mesh, drive)));
    steps[1].1.pop();
    let error = vtkhdf_file(&mesh, &steps).unwrap_err().to_string();
    assert_eq!(error, "field jacobian has 0 values, the mesh has 2 elements");
}
