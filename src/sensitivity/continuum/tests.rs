//! Homogeneous fields in closed form, and agreement with the voxel sums.

use super::super::information::tests::one_term;
use super::super::{PartialVoxels, integrate_over_voxels};
use super::*;
use crate::mesh::{MeshOptions, mesh_specimen};
use crate::specimen::{Block, Outline, Specimen, TestKind};
use crate::voxel::{Sampling, VoxelMask, VoxelOperator};

/// A block whose extents are whole voxels, so that voxels and quadrature cover the same volume.
pub(crate) fn block(name: &str) -> Specimen {
    Specimen {
        name: name.into(),
        test: TestKind::DoubleLapShear,
        block: Block::new(12.0, 4.0, 9.0),
        outline: Outline::Block,
        holes: vec![],
        drive_mm: vec![2.0],
        drive_angle_deg: 0.0,
        precompression_mm: 0.0,
        samples_in_parallel: 1,
        other_samples: Vec::new(),
    }
}

/// Quadrature points of a given displacement field, as the forward model would list them.
pub(crate) fn quadrature_points(mesh: &Mesh, u: &[[f64; 3]]) -> Vec<QuadraturePoint> {
    let mut points = Vec::new();
    for element in 0..mesh.num_elements() {
        for (r, w) in mesh.element_kind.quadrature() {
            let (n, g) = (mesh.element_kind.shape_functions(r), mesh.element_kind.shape_gradients(r));
            let (mut map, mut slope, mut position) = ([[0.0; 3]; 3], [[0.0; 3]; 3], [0.0; 3]);
            for (a, &node) in mesh.element(element).iter().enumerate() {
                for i in 0..3 {
                    position[i] += n[a] * mesh.nodes[node as usize][i];
                    for j in 0..3 {
                        map[i][j] += mesh.nodes[node as usize][i] * g[a][j];
                        slope[i][j] += u[node as usize][i] * g[a][j];
                    }
                }
            }
            let inverse = crate::kinematics::inverse(&map).unwrap();
            let mut f = crate::kinematics::IDENTITY;
            for i in 0..3 {
                for j in 0..3 {
                    f[i][j] += (0..3).map(|m| slope[i][m] * inverse[m][j]).sum::<f64>();
                }
            }
            points.push(QuadraturePoint {
                element,
                position,
                volume_mm3: w * crate::kinematics::determinant(&map),
                deformation_gradient: f,
                cauchy_stress: [[0.0; 3]; 3],
            });
        }
    }
    points
}

/// Made-up smooth fields of the right symmetry for κ, μ and α.
pub(crate) fn made_up_sensitivities(mesh: &Mesh) -> Vec<ParameterSensitivity> {
    let size = [1e-6, 1e-3, 5e-3];
    one_term()
        .parameters()
        .into_iter()
        .enumerate()
        .map(|(n, parameter)| ParameterSensitivity {
            parameter,
            displacement: mesh
                .nodes
                .iter()
                .map(|x| {
                    let w = 0.2 + 0.1 * n as f64;
                    [(w * x[0]).sin() * x[1], (w * x[1] + x[0]).cos(), x[2] * (w * x[0]).cos()].map(|v| size[n] * v)
                })
                .collect(),
            force_n: size[n] * 40.0,
        })
        .collect()
}

/// Homogeneous shear on the half mesh: the whole specimen's integrals in closed form.
#[test]
fn homogeneous_shear_is_exact() {
    let specimen = block("continuum");
    let mesh = mesh_specimen(&specimen, &MeshOptions::search(&specimen)).unwrap();
    assert!(mesh.mirror.z);
    let u: Vec<[f64; 3]> = mesh.nodes.iter().map(|x| [0.6 * x[1], 0.0, 0.0]).collect();
    let points = quadrature_points(&mesh, &u);
    let lambda = 0.3 + 1.09f64.sqrt();
    let exact = super::super::mu_sensitivity(lambda, 0.5, 1.91).value;
    let found = &integrate_over_quadrature(&one_term(), &points, mesh.mirror, 0.5)[0];
    // The quadrature has the block's exact volume; rounding only.
    assert!((found.volume_integral / (432.0 * exact) - 1.0).abs() < 1e-11);
    assert!((found.sum / (864.0 * exact) - 1.0).abs() < 1e-11);
    assert!((found.mean_per_voxel / exact - 1.0).abs() < 1e-11);
    assert!((median_stretch_over_quadrature(&points).unwrap() - lambda).abs() < 1e-12);
    assert!((largest_principal_stretch(&points) - lambda).abs() < 1e-12);
    assert!(largest_principal_stretch(&[]).is_nan() && median_stretch_over_quadrature(&[]).is_none());
}

/// Voxel sums tend to the continuum values as voxels shrink; voxel averages lose the variance inside a voxel.
#[test]
fn voxel_sums_tend_to_the_continuum() {
    let specimen = block("limit");
    let mesh = mesh_specimen(&specimen, &MeshOptions::standard(&specimen)).unwrap();
    let u: Vec<[f64; 3]> =
        mesh.nodes.iter().map(|x| [0.5 * x[1] + 0.03 * x[1] * x[1], 0.01 * x[1] * x[0], 0.005 * x[2] * x[0]]).collect();
    let points = quadrature_points(&mesh, &u);
    let sensitivities = made_up_sensitivities(&mesh);
    let noise = MeasurementNoise { displacement_sd_mm: [0.05, 0.04, 0.03], force_sd_n: 0.02 };
    let errors = [1.0, 0.5].map(|size: f64| {
        let voxel = [size, 0.5 * size, size];
        let mask = VoxelMask::covering(&specimen, voxel).unwrap();
        let operator = VoxelOperator::new(&specimen, &mesh, &mask, Sampling::default()).unwrap();
        let states: Vec<_> = operator.deformation_gradients(&u).unwrap().iter().map(decompose).collect();
        let fields: Vec<_> = sensitivities.iter().map(|s| operator.average(&s.displacement).unwrap()).collect();
        let forces: Vec<f64> = sensitivities.iter().map(|s| s.force_n).collect();
        let volume = mask.grid.voxel_volume_mm3();
        let by_voxel =
            FisherInformation::of_drive(&one_term(), &fields, &PartialVoxels::Uniform.weights(&mask), &forces, &noise)
                .unwrap();
        let smooth = information_over_quadrature(&one_term(), &mesh, &points, &sensitivities, &noise, volume).unwrap();
        let (a, b) = (
            integrate_over_voxels(&one_term(), &states, &mask, 1.0),
            integrate_over_quadrature(&one_term(), &points, mesh.mirror, volume),
        );
        let integral =
            a.iter().zip(&b).map(|(a, b)| (a.volume_integral / b.volume_integral - 1.0).abs()).fold(0.0, f64::max);
        let sd = (0..3)
            .map(|i| (by_voxel.covariance().sd(i).unwrap() / smooth.covariance().sd(i).unwrap() - 1.0).abs())
            .fold(0.0, f64::max);
        [integral, sd]
    });
    for n in 0..2 {
        // The variance inside a voxel goes with its size squared; the mesh's own error bounds the rest.
        assert!(errors[1][n] < 0.35 * errors[0][n] + 1e-6, "{errors:?}");
        // Averaging over a voxel of 1 mm takes (w h)²/24 = 4 % from a wave of wave number w = 1/mm.
        assert!(errors[0][n] < 0.05, "{errors:?}");
    }
}

#[test]
fn mismatches_are_errors() {
    let specimen = block("mismatch");
    let mesh = mesh_specimen(&specimen, &MeshOptions::search(&specimen)).unwrap();
    let points = quadrature_points(&mesh, &vec![[0.0; 3]; mesh.nodes.len()]);
    let sensitivities = made_up_sensitivities(&mesh);
    let noise = MeasurementNoise { displacement_sd_mm: [0.05; 3], force_sd_n: 0.02 };
    let short = information_over_quadrature(&one_term(), &mesh, &points[1..], &sensitivities, &noise, 1.0);
    assert!(matches!(short, Err(InformationError::LengthMismatch { what: "quadrature points", .. })));
    let few = information_over_quadrature(&one_term(), &mesh, &points, &sensitivities[..1], &noise, 1.0);
    assert!(matches!(few, Err(InformationError::LengthMismatch { what: "sensitivities", .. })));
}
