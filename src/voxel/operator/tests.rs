//! Closed forms on hand-made meshes: affine and polynomial fields, mirrors, the transpose, timing.

use super::super::mask::tests::{solid, two_hole};
use super::super::{Face, MeasuredComponents, Surface, VoxelGrid};
use super::*;
use crate::kinematics::decompose;
use crate::mesh::{ElementKind, MeshOptions, Mirror, mesh_specimen};
use crate::specimen::{Taper, TestKind};

/// A structured mesh of hexahedra of the solid block (or its half z ≥ 0): a section in (x, y), its nodes moved by a
/// smooth map so that the cells are curved while the block's faces stay in place, extruded along z.
pub(crate) fn block_mesh(specimen: &Specimen, num: [usize; 3], mirror: Mirror, bend: f64) -> Mesh {
    let b = &specimen.block;
    let high = [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm];
    let low = [-high[0], if mirror.y { 0.0 } else { -high[1] }, if mirror.z { 0.0 } else { -high[2] }];
    let count = num.map(|n| 2 * n + 1);
    let mut nodes = Vec::new();
    for k in 0..count[2] {
        for j in 0..count[1] {
            for i in 0..count[0] {
                let t = [(i, 0), (j, 1), (k, 2)].map(|(n, a)| n as f64 / (count[a] - 1) as f64);
                let bump = bend * (std::f64::consts::PI * t[0]).sin() * (std::f64::consts::PI * t[1]).sin();
                nodes.push([0, 1, 2].map(|a| low[a] + (high[a] - low[a]) * t[a] + bump * [1.0, 0.3, 0.0][a]));
            }
        }
    }
    let mut connectivity = Vec::new();
    for k in 0..num[2] {
        for j in 0..num[1] {
            for i in 0..num[0] {
                for c in 0..3 {
                    for b in 0..3 {
                        for a in 0..3 {
                            let n = 2 * i + a + count[0] * (2 * j + b + count[1] * (2 * k + c));
                            connectivity.push(n as u32);
                        }
                    }
                }
            }
        }
    }
    Mesh {
        element_kind: ElementKind::Hex27,
        nodes,
        connectivity,
        taper: Taper::default(),
        mirror,
        fixed_nodes: vec![],
        moved_nodes: vec![],
        mirror_y_nodes: vec![],
        mirror_z_nodes: vec![],
    }
}

const NO_MIRROR: Mirror = Mirror { y: false, z: false };
const MIRROR_Z: Mirror = Mirror { y: false, z: true };

/// u = (F − I) X at the nodes.
fn affine(mesh: &Mesh, f: &Tensor) -> Vec<[f64; 3]> {
    mesh.nodes.iter().map(|x| [0, 1, 2].map(|i| (0..3).map(|j| f[i][j] * x[j]).sum::<f64>() - x[i])).collect()
}

/// Subsets of a face see an affine field at their centres on the face, also on the half that is mirrored and not
/// meshed, and lose no sample point; where holes open in the face its gradient is exact, too.
#[test]
fn subsets_see_the_face() {
    // Mirror symmetric in z.
    let f = [[1.2, 0.5, 0.0], [0.02, 0.9, 0.0], [0.0, 0.0, 1.1]];
    let (block, bar) = (solid(), Specimen { test: TestKind::Uniaxial, ..two_hole() });
    for (specimen, face, mirror) in [
        (&block, Face::PlusZ, NO_MIRROR),
        (&block, Face::PlusZ, MIRROR_Z),
        (&block, Face::MinusZ, MIRROR_Z),
        (&bar, Face::MinusY, NO_MIRROR),
    ] {
        let mesh = block_mesh(specimen, [5, 3, 4], mirror, 0.4);
        let surface = Surface { face, components: MeasuredComponents::All };
        // The block's edges are whole multiples: no subset overhangs.
        let grid = VoxelGrid::planned(specimen, [2.54, 0.64, 1.91], Some(surface)).unwrap();
        let mask = VoxelMask::of_specimen(specimen, grid).unwrap();
        let operator = VoxelOperator::new(specimen, &mesh, &mask, Sampling::default()).unwrap();
        assert_eq!(operator.num_dropped_points(), 0);
        let u = affine(&mesh, &f);
        let averages = operator.average(&u).unwrap();
        for ((found, voxel), part) in averages.iter().zip(&mask.voxels).zip(&mask.material_fraction) {
            let x = mask.grid.center_mm(*voxel as usize);
            assert!((x[face.axis()] - face.position_mm(specimen)).abs() < 1e-12);
            for i in (0..3).filter(|_| *part > 1.0 - 1e-9) {
                let exact = (0..3).map(|j| f[i][j] * x[j]).sum::<f64>() - x[i];
                assert!((found[i] - exact).abs() < 1e-11, "{face:?} {found:?} {exact}");
            }
        }
        for found in operator.deformation_gradients(&u).unwrap() {
            // As for volumes: rounding of positions / element size.
            assert!((0..9).all(|n| (found[n / 3][n % 3] - f[n / 3][n % 3]).abs() < 1e-11));
        }
    }
}

/// A homogeneous deformation is measured exactly: F, and u at the centroid of the material part.
#[test]
fn homogeneous_deformation_is_exact() {
    let f = [[1.2, 0.5, 0.1], [0.02, 0.9, -0.1], [0.0, 0.2, 1.1]];
    for specimen in [solid(), two_hole()] {
        let mesh = block_mesh(&specimen, [5, 3, 4], NO_MIRROR, 0.4);
        let mask = VoxelMask::covering(&specimen, [2.0, 0.5, 1.5]).unwrap();
        let operator = VoxelOperator::new(&specimen, &mesh, &mask, Sampling::default()).unwrap();
        assert_eq!(operator.num_dropped_points(), 0);
        let u = affine(&mesh, &f);
        let expected = decompose(&f);
        for found in operator.deformation_gradients(&u).unwrap() {
            for i in 0..3 {
                for j in 0..3 {
                    // Isoparametric elements hold affine fields exactly; rounding of positions / element size.
                    assert!((found[i][j] - f[i][j]).abs() < 1e-11);
                }
            }
            assert!((decompose(&found).stretch_amplitude - expected.stretch_amplitude).abs() < 1e-11);
        }
        for ((mean, &voxel), fraction) in
            operator.average(&u).unwrap().iter().zip(&mask.voxels).zip(&mask.material_fraction)
        {
            if *fraction > 1.0 - 1e-12 {
                let x = mask.grid.center_mm(voxel as usize);
                for i in 0..3 {
                    let exact = (0..3).map(|j| f[i][j] * x[j]).sum::<f64>() - x[i];
                    // As above, times the block's size of ten.
                    assert!((mean[i] - exact).abs() < 1e-10);
                }
            }
        }
    }
}

/// The same on real meshes: quadrilaterals and triangles, holes along either axis, the dumb-bell.
#[test]
fn homogeneous_deformation_on_real_meshes() {
    use crate::specimen::{Block, Hole, HoleAxis, Outline, TestKind};
    // Without z shear and, where y mirrors, without y shear.
    let sheared = [[1.2, 0.5, 0.0], [0.02, 0.9, 0.0], [0.0, 0.0, 1.1]];
    let stretched = [[1.2, 0.0, 0.0], [0.0, 0.9, 0.0], [0.0, 0.0, 1.1]];
    let across = Hole::circle(HoleAxis::Width, [3.0, 0.2], 3.0);
    let dumbbell = Specimen {
        test: TestKind::Uniaxial,
        block: Block::new(35.0, 2.0, 6.0),
        outline: Outline::Iso37Type4,
        ..solid()
    };
    for specimen in [two_hole(), Specimen { holes: vec![across], ..solid() }, dumbbell] {
        let f = if specimen.test == TestKind::Uniaxial { stretched } else { sheared };
        for force_prisms in [false, true] {
            let mesh =
                mesh_specimen(&specimen, &MeshOptions { force_prisms, ..MeshOptions::search(&specimen) }).unwrap();
            let mask = VoxelMask::covering(&specimen, [0.8, 0.4, 0.6]).unwrap();
            let operator = VoxelOperator::new(&specimen, &mesh, &mask, Sampling::default()).unwrap();
            // Coarse quadratic arcs leave the wall by some micrometres; few sample points lie that close to it.
            assert!(operator.num_dropped_points() * 500 < operator.num_points(), "{}", operator.num_dropped_points());
            for found in operator.deformation_gradients(&affine(&mesh, &f)).unwrap() {
                for (found, exact) in found.iter().flatten().zip(f.iter().flatten()) {
                    // Isoparametric elements hold affine fields exactly; rounding of positions / element size.
                    assert!((found - exact).abs() < 1e-10);
                }
            }
        }
    }
}

/// A quadratic field on straight elements: the voxel's mean is that of the polynomial, x̄² + h²/12.
#[test]
fn quadratic_field_has_the_exact_mean() {
    let specimen = solid();
    let mesh = block_mesh(&specimen, [4, 2, 3], NO_MIRROR, 0.0);
    let grid = VoxelGrid::new([-3.0, -1.0, 0.5], [0.5, 0.25, 0.6], [12, 6, 9]).unwrap();
    let mask = VoxelMask::of_specimen(&specimen, grid).unwrap();
    let operator = VoxelOperator::new(&specimen, &mesh, &mask, Sampling::default()).unwrap();
    let field: Vec<[f64; 3]> = mesh.nodes.iter().map(|x| [x[0] * x[0], x[1] * x[2], x[2] * x[2]]).collect();
    let (mean, gradient) = (operator.average(&field).unwrap(), operator.average_gradient(&field).unwrap());
    let h = mask.grid.voxel_mm;
    for (v, &voxel) in mask.voxels.iter().enumerate() {
        let x = mask.grid.center_mm(voxel as usize);
        let exact = [x[0] * x[0] + h[0] * h[0] / 12.0, x[1] * x[2], x[2] * x[2] + h[2] * h[2] / 12.0];
        let slope = [[2.0 * x[0], 0.0, 0.0], [0.0, x[2], x[1]], [0.0, 0.0, 2.0 * x[2]]];
        for i in 0..3 {
            // Two Gauss points are exact for cubics; rounding of values of order ten.
            assert!((mean[v][i] - exact[i]).abs() < 1e-11);
            for j in 0..3 {
                assert!((gradient[v][i][j] - slope[i][j]).abs() < 1e-11);
            }
        }
    }
}

/// The half mesh gives what the full mesh gives for a field that mirrors: u_x, u_y even and u_z odd in z. Quadratic, so
/// that both meshes hold it exactly; the grid has voxels across the mirror plane.
#[test]
fn mirrored_half_equals_the_whole() {
    let specimen = solid();
    let mask = VoxelMask::covering(&specimen, [1.9, 0.7, 1.3]).unwrap();
    let results = [(NO_MIRROR, 8), (MIRROR_Z, 4)].map(|(mirror, num_z)| {
        let mesh = block_mesh(&specimen, [4, 3, num_z], mirror, 0.0);
        let field: Vec<[f64; 3]> =
            mesh.nodes.iter().map(|x| [x[2] * x[2] + x[0] * x[1], x[1] * x[1], x[2] * (1.0 + 0.2 * x[0])]).collect();
        let operator = VoxelOperator::new(&specimen, &mesh, &mask, Sampling::default()).unwrap();
        (operator.average(&field).unwrap(), operator.average_gradient(&field).unwrap())
    });
    let [(whole, whole_gradient), (half, half_gradient)] = results;
    for v in 0..mask.num_voxels() {
        for i in 0..3 {
            // Both are exact up to rounding of values of order 100.
            assert!((whole[v][i] - half[v][i]).abs() < 1e-10);
            for j in 0..3 {
                assert!((whole_gradient[v][i][j] - half_gradient[v][i][j]).abs() < 1e-10);
            }
        }
    }
}

/// ⟨w, A u⟩ = ⟨Aᵀ w, u⟩.
#[test]
fn transpose_is_the_adjoint() {
    let specimen = solid();
    let mesh = block_mesh(&specimen, [3, 2, 2], MIRROR_Z, 0.2);
    let mask = VoxelMask::covering(&specimen, [2.1, 0.9, 1.7]).unwrap();
    let operator = VoxelOperator::new(&specimen, &mesh, &mask, Sampling::default()).unwrap();
    let wave = |n: usize, s: f64| [0, 1, 2].map(|a| (s * n as f64 + f64::from(a)).sin());
    let u: Vec<[f64; 3]> = (0..mesh.nodes.len()).map(|n| wave(n, 0.7)).collect();
    let w: Vec<[f64; 3]> = (0..mask.num_voxels()).map(|n| wave(n, 1.3)).collect();
    let inner = |a: &[[f64; 3]], b: &[[f64; 3]]| -> f64 {
        a.iter().zip(b).map(|(a, b)| a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).sum()
    };
    let (left, right) =
        (inner(&w, &operator.average(&u).unwrap()), inner(&operator.average_transposed(&w).unwrap(), &u));
    // Sums of some thousand terms of order one.
    assert!((left - right).abs() < 1e-11);
}

/// A superposed rotation turns F by R and leaves (λ, k) alone.
#[test]
fn rotation_invariance() {
    let specimen = solid();
    let mesh = block_mesh(&specimen, [3, 2, 3], NO_MIRROR, 0.3);
    let mask = VoxelMask::covering(&specimen, [2.0, 0.8, 2.0]).unwrap();
    let operator = VoxelOperator::new(&specimen, &mesh, &mask, Sampling::default()).unwrap();
    let u: Vec<[f64; 3]> = mesh.nodes.iter().map(|x| [0.1 * x[1] * x[1], 0.02 * x[0], 0.03 * x[2] * x[0]]).collect();
    let (s, c) = 0.7f64.sin_cos();
    let turned: Vec<[f64; 3]> = mesh
        .nodes
        .iter()
        .zip(&u)
        .map(|(x, u)| {
            let y = [x[0] + u[0], x[1] + u[1], x[2] + u[2]];
            [c * y[0] - s * y[1] - x[0], s * y[0] + c * y[1] - x[1], u[2]]
        })
        .collect();
    let (a, b) = (operator.deformation_gradients(&u).unwrap(), operator.deformation_gradients(&turned).unwrap());
    for (f, g) in a.iter().zip(&b) {
        let (f, g) = (decompose(f), decompose(g));
        // Averages are linear, so the rotation commutes with them up to rounding.
        assert!((f.stretch_amplitude - g.stretch_amplitude).abs() < 1e-11);
        assert!((f.deformation_mode.unwrap() - g.deformation_mode.unwrap()).abs() < 1e-9);
    }
}

#[test]
fn mismatched_input_is_an_error() {
    let specimen = solid();
    let mesh = block_mesh(&specimen, [2, 1, 1], MIRROR_Z, 0.0);
    let mask = VoxelMask::covering(&specimen, [3.0, 1.0, 3.0]).unwrap();
    let operator = VoxelOperator::new(&specimen, &mesh, &mask, Sampling::default()).unwrap();
    assert!(matches!(operator.average(&[[0.0; 3]]), Err(VoxelError::LengthMismatch { .. })));
    let far = VoxelMask { grid: VoxelGrid { origin_mm: [50.0; 3], ..mask.grid.clone() }, ..mask };
    assert!(matches!(
        VoxelOperator::new(&specimen, &mesh, &far, Sampling::default()),
        Err(VoxelError::OutsideMesh { .. })
    ));
    let none = Sampling { cut_slices: 0, ..Sampling::default() };
    assert!(matches!(
        VoxelOperator::new(&specimen, &mesh, &far, none),
        Err(VoxelError::InvalidSampling { value: 0, .. })
    ));
}

fn wedge(mut specimen: Specimen, wedge_mm: f64) -> Specimen {
    specimen.block.wedge_mm = wedge_mm;
    specimen
}

/// A grid that covers a wedge wherever it lies, and all voxels that hold any of it.
fn all_of(specimen: &Specimen, voxel_mm: [f64; 3]) -> VoxelMask {
    let extents = specimen.block.extents_mm();
    let shape = [0, 1, 2].map(|a| (extents[a] / voxel_mm[a]).ceil() as usize + 2);
    let origin = [0, 1, 2].map(|a| -0.5 * extents[a] - [0.3, 0.4, 0.7][a] * voxel_mm[a]);
    let grid = VoxelGrid::new(origin, voxel_mm, shape).unwrap();
    VoxelMask::from_flags(specimen, grid.clone(), &vec![true; grid.num_voxels()], 0.0).unwrap()
}

/// In a wedge too an affine field has an exact gradient, and inner voxels the exact mean.
#[test]
fn homogeneous_deformation_of_wedges() {
    // Mirror symmetric in z.
    let f = [[1.2, 0.5, 0.0], [0.02, 0.9, 0.0], [0.0, 0.0, 1.1]];
    for specimen in [wedge(solid(), 3.0), wedge(two_hole(), -4.0)] {
        for force_prisms in [false, true] {
            let mesh =
                mesh_specimen(&specimen, &MeshOptions { force_prisms, ..MeshOptions::search(&specimen) }).unwrap();
            let mask = VoxelMask::covering(&specimen, [0.8, 0.4, 0.6]).unwrap();
            let operator = VoxelOperator::new(&specimen, &mesh, &mask, Sampling::default()).unwrap();
            // As without a wedge.
            assert!(operator.num_dropped_points() * 500 < operator.num_points(), "{}", operator.num_dropped_points());
            let u = affine(&mesh, &f);
            for found in operator.deformation_gradients(&u).unwrap() {
                for (found, exact) in found.iter().flatten().zip(f.iter().flatten()) {
                    // As without a wedge; the locator loses a digit or two more.
                    assert!((found - exact).abs() < 1e-9, "{found} {exact}");
                }
            }
            let whole = mask.material_fraction.iter().map(|part| *part > 1.0 - 1e-9);
            for ((mean, &voxel), _) in
                operator.average(&u).unwrap().iter().zip(&mask.voxels).zip(whole).filter(|(_, is_whole)| *is_whole)
            {
                let x = mask.grid.center_mm(voxel as usize);
                for i in 0..3 {
                    let exact = (0..3).map(|j| f[i][j] * x[j]).sum::<f64>() - x[i];
                    assert!((mean[i] - exact).abs() < 1e-9, "{mean:?} {exact}");
                }
            }
        }
    }
}

/// Over all voxels, filled parts add up to the volume, and means to the first and second moments of the wedge:
/// ∫ x dV = W w L²/12 and ∫ y² dV = W/12 ∫ t(x)³ dx.
#[test]
fn moments_of_a_wedge() {
    let (specimen, w) = (wedge(solid(), 4.0), 4.0);
    let [length, thickness, width] = [25.4, 6.4, 19.1];
    let mesh = mesh_specimen(&specimen, &MeshOptions::standard(&specimen)).unwrap();
    let mask = all_of(&specimen, [1.0, 0.4, 0.75]);
    let operator = VoxelOperator::new(&specimen, &mesh, &mask, Sampling::default()).unwrap();
    assert_eq!(operator.num_dropped_points(), 0);
    let field: Vec<[f64; 3]> = mesh.nodes.iter().map(|x| [x[0], x[1] * x[1], 0.0]).collect();
    let means = operator.average(&field).unwrap();
    let volume_mm3 = mask.grid.voxel_volume_mm3();
    let sum = |of: usize| -> f64 {
        means.iter().zip(&mask.material_fraction).map(|(mean, part)| volume_mm3 * part * mean[of]).sum()
    };
    // Slices of voxels that the faces cut: of second order in 1/32 of them.
    assert!((mask.material_volume_mm3() / (length * thickness * width) - 1.0).abs() < 1e-5);
    let first = width * w * length * length / 12.0;
    // Six slices of each cut voxel, about a sixth of all; its part is known to 32.
    assert!((sum(0) / first - 1.0).abs() < 1e-3, "{} {first}", sum(0));
    let [a, b] = specimen.block.end_thicknesses_mm();
    let second = width * length * (b.powi(4) - a.powi(4)) / (4.0 * w) / 12.0;
    assert!((sum(1) / second - 1.0).abs() < 1e-3, "{} {second}", sum(1));
}

/// Filled parts of a wedge with holes add up to its closed form, of a free face to the face's area; at least half
/// filled voxels lie in it with their centres.
#[test]
fn filled_parts_of_wedges() {
    for specimen in [wedge(two_hole(), 6.0), wedge(two_hole(), -2.0)] {
        let all = all_of(&specimen, [0.7, 0.3, 0.6]);
        // Slices of voxels that walls cut, as in blocks.
        assert!((all.material_volume_mm3() / specimen.volume_mm3() - 1.0).abs() < 2e-4);
        let half = VoxelMask::covering(&specimen, [0.7, 0.3, 0.6]).unwrap();
        let in_layers = half.voxels.iter().map(|&v| half.grid.center_mm(v as usize));
        // The faces slant by less than a layer across a voxel.
        assert!(in_layers.into_iter().all(|x| x[1].abs() <= specimen.half_gap_mm(x[0]) + 1e-9));
        for face in [Face::MinusZ, Face::PlusZ] {
            let surface = Surface { face, components: MeasuredComponents::InPlane };
            let grid = VoxelGrid::planned(&specimen, [0.35, 0.2, 1.0], Some(surface)).unwrap();
            let seen = VoxelMask::from_flags(&specimen, grid.clone(), &vec![true; grid.num_voxels()], 0.0).unwrap();
            // Half of a subset at an edge of the grid may be missing: 0.1 of 6.4 mm.
            assert!((seen.material_area_mm2().unwrap() / (25.4 * 6.4) - 1.0).abs() < 0.02);
            let mesh = mesh_specimen(&specimen, &MeshOptions::search(&specimen)).unwrap();
            let operator = VoxelOperator::new(&specimen, &mesh, &seen, Sampling::default()).unwrap();
            let f = [[1.2, 0.5, 0.0], [0.02, 0.9, 0.0], [0.0, 0.0, 1.1]];
            for found in operator.deformation_gradients(&affine(&mesh, &f)).unwrap() {
                assert!((0..9).all(|n| (found[n / 3][n % 3] - f[n / 3][n % 3]).abs() < 1e-9));
            }
        }
    }
}
