//! Meshes of wedges: geometry, places, slopes and shape velocities.

use super::locator::Locator;
use super::test_specimens::{Random, changed, off_axis, solid, two_holes};
use super::*;
use crate::specimen::{Hole, HoleAxis, HoleKind, HoleShape, Specimen};

fn wedged(mut specimen: Specimen, wedge_mm: f64) -> Specimen {
    specimen.block.wedge_mm = wedge_mm;
    specimen.validate().expect("a specimen");
    specimen
}

/// Two notches in the ends and one in a side, a slot and an ellipse.
fn with_outlines() -> Specimen {
    let mut specimen = solid();
    let end = 0.5 * specimen.block.length_mm;
    let shape = |kind, angle_deg| Some(HoleShape { kind, length_mm: 4.5, angle_deg });
    specimen.holes = vec![
        Hole::notch(HoleAxis::Thickness, [end - 0.5, 1.0], 4.0),
        Hole::notch(HoleAxis::Thickness, [-end - 0.4, -2.0], 5.0),
        Hole { shape: shape(HoleKind::Ellipse, 30.0), ..Hole::circle(HoleAxis::Thickness, [-4.0, 3.0], 2.5) },
        Hole { shape: shape(HoleKind::Slot, -50.0), ..Hole::circle(HoleAxis::Thickness, [4.5, -3.5], 2.5) },
    ];
    specimen
}

fn wedges() -> Vec<Specimen> {
    vec![wedged(solid(), 3.0), wedged(two_holes(), -2.5), wedged(off_axis(), 6.4), wedged(with_outlines(), -4.0)]
}

/// Faces, volume, node sets and Jacobians are right, mirrored in z where the holes are; refined as well.
#[test]
fn meshes_are_those_of_the_wedge() {
    for specimen in wedges() {
        let is_mirrored = specimen.mirror_defect_mm([1.0, 1.0, -1.0]) < 1e-9;
        for options in [MeshOptions::search(&specimen), MeshOptions::standard(&specimen)] {
            for force_prisms in [false, true] {
                let mesh = mesh_specimen(&specimen, &MeshOptions { force_prisms, ..options }).unwrap();
                mesh.check(&specimen).unwrap();
                assert_eq!((mesh.mirror.y, mesh.mirror.z), (false, is_mirrored), "{}", specimen.name);
                let half_mm = |n: &u32| specimen.half_gap_mm(mesh.nodes[*n as usize][0]);
                for (nodes, side) in [(&mesh.fixed_nodes, -1.0), (&mesh.moved_nodes, 1.0)] {
                    // One rounding of a length of some mm.
                    assert!(nodes.iter().all(|n| (mesh.nodes[*n as usize][1] - side * half_mm(n)).abs() < 1e-14));
                }
                if let Some(Refinement { mesh: fine, .. }) = refined(&mesh) {
                    // The quadratic map of a wedge's elements is exact: nodes of the fine mesh lie on its faces.
                    assert!((fine.volume() / mesh.volume() - 1.0).abs() < 1e-12);
                    let on_face = |n: &u32| {
                        let x = fine.nodes[*n as usize];
                        (x[1].abs() - specimen.half_gap_mm(x[0])).abs() < 1e-12
                    };
                    assert!(fine.fixed_nodes.iter().chain(&fine.moved_nodes).all(on_face));
                    let num_on_faces = (0..fine.nodes.len() as u32).filter(on_face).count();
                    assert_eq!(num_on_faces, fine.fixed_nodes.len() + fine.moved_nodes.len());
                }
            }
        }
        // A mesh of the even block is none of the wedge, and the other way round.
        let mut even = specimen.clone();
        even.block.wedge_mm = 0.0;
        let options = MeshOptions::search(&specimen);
        let mut unlike = mesh_specimen(&even, &options).unwrap();
        assert!(matches!(unlike.check(&specimen), Err(MeshError::WrongTaper { .. })));
        unlike.taper = specimen.block.taper();
        assert!(unlike.check(&specimen).is_err());
        assert!(mesh_specimen(&specimen, &options).unwrap().check(&even).is_err());
    }
}

/// Without holes nothing is curved: volume and bonded area are closed forms to rounding.
#[test]
fn volume_and_bonded_area_are_closed_forms() {
    let specimen = wedged(solid(), 5.0);
    let mesh =
        mesh_specimen(&specimen, &MeshOptions { use_mirror: false, ..MeshOptions::standard(&specimen) }).unwrap();
    let [length, thickness, width] = [25.4, 6.4, 19.1];
    assert!((mesh.volume() / (length * thickness * width) - 1.0).abs() < 1e-12);
    let slanted = 2.0 * width * f64::hypot(length, 2.5);
    assert!((mesh.face_areas().iter().sum::<f64>() / slanted - 1.0).abs() < 1e-12);
}

#[test]
fn what_is_no_wedge_is_refused() {
    let mut pulled = super::test_specimens::bar();
    pulled.block.wedge_mm = 0.5;
    let mut across = super::test_specimens::width_holes();
    across.block.wedge_mm = 0.5;
    let (mut no_end, mut endless) = (solid(), solid());
    no_end.block.wedge_mm = 12.8;
    endless.block.wedge_mm = f64::NAN;
    for specimen in [pulled, across, no_end, endless] {
        let made = mesh_specimen(&specimen, &MeshOptions::search(&solid()));
        assert!(matches!(made, Err(MeshError::UnsupportedWedge { .. })), "{:?}", made.map(|m| m.num_elements()));
    }
}

/// The inverse of a matrix whose determinant is not zero.
fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let m = nalgebra::Matrix3::from_fn(|i, j| m[i][j]).try_inverse().unwrap();
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)]))
}

/// Points made from reference coordinates are found again, and the gradient of any nodal field by columns, levels and
/// the chain rule is that of the element itself; so the gradient of a linear field is exact.
#[test]
fn places_and_gradients_are_those_of_the_elements() {
    let mut random = Random::new(11);
    for specimen in wedges() {
        for force_prisms in [false, true] {
            let options = MeshOptions { force_prisms, ..MeshOptions::search(&specimen) };
            let mesh = mesh_specimen(&specimen, &options).unwrap();
            let (kind, locator) = (mesh.element_kind, Locator::new(&mesh));
            let field: Vec<f64> = mesh.nodes.iter().map(|_| random.between(-1.0, 1.0)).collect();
            assert!(mesh.nodes.iter().all(|&x| locator.locate(&mesh, x).is_some()));
            let [length, ..] = specimen.block.extents_mm();
            let beyond = 1.001 * specimen.half_gap_mm(0.4 * length);
            assert!(locator.locate(&mesh, [0.4 * length, beyond, 0.1]).is_none());
            for element in 0..mesh.num_elements() {
                let mut xi = [0; 3].map(|_| random.between(-0.9, 0.9));
                if kind == ElementKind::Prism21 {
                    (xi[0], xi[1]) = (0.3 + 0.2 * xi[0], 0.3 + 0.2 * xi[1]);
                }
                let n = kind.shape_functions(xi);
                let nodes = mesh.element(element);
                let point = [0, 1, 2].map(|i| nodes.iter().zip(&n).map(|(&v, n)| n * mesh.nodes[v as usize][i]).sum());
                let found = locator.locate(&mesh, point).unwrap();
                assert_eq!(found.element as usize, element);
                // Newton stops at 1e-12; some digits go to the inverse of the map.
                assert!((0..3).all(|i| (found.reference_coordinates[i] - xi[i]).abs() < 1e-9));
                let slopes = kind.shape_gradients(xi);
                let back = inverse(mesh.geometry_gradient(element, &slopes));
                let own = |j: usize| -> f64 {
                    let along = |a: usize| (0..3).map(|c| slopes[a][c] * back[c][j]).sum::<f64>();
                    nodes.iter().enumerate().map(|(a, &v)| field[v as usize] * along(a)).sum()
                };
                let flat = locator.taper().flattened(point);
                let [flat_x, flat_y] = locator.taper().flattening_slopes(point);
                let column = locator.locate_column(&mesh, [flat[0], flat[2]]).unwrap();
                let (column, level) =
                    (locator.column_shape(&mesh, column).unwrap(), locator.level_shape(flat[1]).unwrap());
                let per_level = nodes.len() / 3;
                let mut gradient = [0.0; 3];
                for (a, &v) in nodes.iter().enumerate() {
                    let (s, k) = (a % per_level, a / per_level);
                    let along = column.values[s] * level.slopes[k];
                    let slope = [
                        column.along_x[s] * level.values[k] + along * flat_x,
                        along * flat_y,
                        column.across[s] * level.values[k],
                    ];
                    (0..3).for_each(|j| gradient[j] += field[v as usize] * slope[j]);
                }
                for j in 0..3 {
                    // Values of order 1 in elements of order 1 mm, with the digits that the place lost.
                    assert!((gradient[j] - own(j)).abs() < 1e-8, "{gradient:?} {}", own(j));
                }
            }
        }
    }
}

/// The moved mesh is one of the changed wedge. Steps of length, which change the taper at second order too, and of
/// notches, whose walls follow to first order, are small.
#[test]
fn the_morphed_mesh_is_a_mesh_of_the_changed_wedge() {
    use DesignVariable::*;
    for specimen in wedges() {
        let num_holes = specimen.holes.len();
        let of_holes = (0..num_holes).flat_map(|i| [HoleX(i), HoleOther(i), HoleDiameter(i)]);
        for variable in of_holes.chain([BlockThickness, BlockWidth, BlockLength]) {
            let is_small = variable == BlockLength || specimen.holes.iter().any(|hole| hole.is_notch);
            let step = if is_small { 2e-4 } else { 0.05 };
            let options = MeshOptions { use_mirror: false, ..MeshOptions::search(&specimen) };
            let mesh = mesh_specimen(&specimen, &options).unwrap();
            let after = changed(&specimen, variable, step);
            let mut moved = morphed(&mesh, &shape_velocity(&mesh, &specimen, variable), step);
            moved.taper = after.block.taper();
            let result = moved.check(&after);
            assert!(result.is_ok(), "{variable:?} of {}: {result:?}", specimen.name);
        }
    }
}
