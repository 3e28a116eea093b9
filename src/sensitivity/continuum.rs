//! Smooth counterparts of the voxel sums, over the quadrature points of the mesh.
//!
//! A sum over voxels jumps when a wall crosses a voxel's middle; a search needs values that vary smoothly with the
//! design. With ∫ dV / V_voxel in place of Σ_voxels the sums become integrals over the specimen: the limit of small
//! voxels at a fixed number of voxels per volume. Mirrored parts count as often as they are reflected.

use super::information::{FisherInformation, InformationError, MeasurementNoise};
use super::integrated::{IntegratedSensitivity, parameter_sensitivity};
use super::joint_information::JointInformation;
use super::protocol::{Nuisance, Protocol};
use crate::fem::{ParameterSensitivity, QuadraturePoint};
use crate::kinematics::{decompose, principal_stretches};
use crate::material::Material;
use crate::mesh::{Mesh, Mirror};
use nalgebra::DMatrix;

/// How many reflected copies make the whole specimen.
pub(super) fn num_copies(mirror: Mirror) -> f64 {
    [mirror.y, mirror.z].map(|is_used| if is_used { 2.0 } else { 1.0 }).iter().product()
}

/// 𝒮 of every μᵢ and αᵢ over the whole specimen: `volume_integral` = ∫ S dV, `sum` = ∫ S dV / V_voxel,
/// `mean_per_voxel` = ∫ S dV / V.
pub fn integrate_over_quadrature(
    material: &Material,
    points: &[QuadraturePoint],
    mirror: Mirror,
    voxel_volume_mm3: f64,
) -> Vec<IntegratedSensitivity> {
    let states: Vec<_> = points.iter().map(|p| (decompose(&p.deformation_gradient), p.volume_mm3)).collect();
    let copies = num_copies(mirror);
    let volume = copies * points.iter().map(|p| p.volume_mm3).sum::<f64>();
    material
        .shear_parameters()
        .map(|parameter| {
            let half: f64 = states
                .iter()
                .map(|(s, dv)| {
                    dv * parameter_sensitivity(material, parameter, s.stretch_amplitude, s.deformation_mode).value
                })
                .sum();
            let integral = copies * half;
            IntegratedSensitivity {
                parameter: parameter.name(),
                sum: integral / voxel_volume_mm3,
                mean_per_voxel: integral / volume,
                volume_integral: integral,
                surface_integral: None,
                discretisation_relative: None,
            }
        })
        .collect()
}

/// 𝒮 as [`integrate_over_quadrature`] gives it, over all scanned blocks; `mean_per_voxel` over their whole volume.
pub fn integrate_over_blocks(
    material: &Material,
    blocks: &[ScannedBlock],
    voxel_volume_mm3: f64,
) -> Vec<IntegratedSensitivity> {
    let mut all: Vec<IntegratedSensitivity> = Vec::new();
    let mut volume_mm3 = 0.0;
    for block in blocks.iter().filter(|b| b.count > 0) {
        let (count, mirror) = (f64::from(block.count), block.mesh.mirror);
        volume_mm3 += count * num_copies(mirror) * block.points.iter().map(|p| p.volume_mm3).sum::<f64>();
        let own = integrate_over_quadrature(material, block.points, mirror, voxel_volume_mm3);
        for (index, own) in own.into_iter().enumerate() {
            if all.len() <= index {
                all.push(IntegratedSensitivity::zero_like(&own));
            }
            all[index].add_blocks(count, &own);
        }
    }
    all.iter_mut().for_each(|s| s.mean_per_voxel = s.volume_integral / volume_mm3);
    all
}

/// Fisher information of one drive with ∫ dV / V_voxel in place of the sum over voxels.
///
/// `points` come from [`crate::fem::ForwardModel::quadrature_fields`] (element after element, in the order of
/// [`crate::mesh::ElementKind::quadrature`]); `sensitivities` stand in the order of [`Material::parameters`]. Products
/// of two sensitivities are even under the mirrors, so each reflected copy adds the same.
///
/// # Errors
/// [`InformationError::InvalidSd`], [`InformationError::LengthMismatch`], [`InformationError::NotFinite`].
pub fn information_over_quadrature(
    material: &Material,
    mesh: &Mesh,
    points: &[QuadraturePoint],
    sensitivities: &[ParameterSensitivity],
    noise: &MeasurementNoise,
    voxel_volume_mm3: f64,
) -> Result<FisherInformation, InformationError> {
    let mut information = FisherInformation::none(material);
    let num = information.parameters().len();
    check_length("sensitivities", sensitivities.len(), num)?;
    let fields: Vec<(&[[f64; 3]], f64)> = sensitivities.iter().map(|s| (&s.displacement[..], s.force_n)).collect();
    let gram = gram_over_quadrature(mesh, points, &fields, noise, voxel_volume_mm3)?;
    for i in 0..num {
        for j in 0..=i {
            information.set(i, j, gram[(i, j)]);
        }
    }
    information.check_finite()?;
    Ok(information)
}

/// A force that the load cell reads, N.
#[derive(Clone, Debug)]
pub struct ForceReading {
    /// The force.
    pub force_n: f64,
    /// Its derivatives with respect to the material's parameters, in the order of [`Material::parameters`].
    pub sensitivities: Vec<f64>,
}

/// Forces and what is not known of the load cell that reads them.
#[derive(Clone, Copy, Debug)]
pub struct ForceReadings<'a> {
    /// The forces.
    pub readings: &'a [ForceReading],
    /// Tells what is not known.
    pub protocol: &'a Protocol,
}

/// A block in the scanner, on its mesh.
#[derive(Clone, Copy, Debug)]
pub struct ScannedBlock<'a> {
    /// How many such blocks are scanned.
    pub count: u32,
    /// The mesh.
    pub mesh: &'a Mesh,
    /// From [`crate::fem::ForwardModel::quadrature_fields`].
    pub points: &'a [QuadraturePoint],
    /// In the order of [`Material::parameters`].
    pub sensitivities: &'a [ParameterSensitivity],
}

/// As [`information_over_quadrature`] for a scan of some blocks and any number of forces read on the way to it, the
/// scan's own among them, with the gain and the zero of the load cell as unknown as their protocol says. (The drive's
/// zero is not among the unknowns here.)
///
/// # Errors
/// As [`information_over_quadrature`].
pub fn information_of_protocol(
    material: &Material,
    blocks: &[ScannedBlock],
    forces: &ForceReadings,
    noise: &MeasurementNoise,
    voxel_volume_mm3: f64,
) -> Result<FisherInformation, InformationError> {
    let num = material.parameters().len();
    let mut gram = DMatrix::zeros(num, num);
    for block in blocks.iter().filter(|b| b.count > 0) {
        check_length("sensitivities", block.sensitivities.len(), num)?;
        let fields: Vec<(&[[f64; 3]], f64)> = block.sensitivities.iter().map(|s| (&s.displacement[..], 0.0)).collect();
        gram +=
            gram_over_quadrature(block.mesh, block.points, &fields, noise, voxel_volume_mm3)? * f64::from(block.count);
    }
    let unknowns: Vec<(Nuisance, f64)> =
        forces.protocol.nuisances().into_iter().filter(|(n, _)| n.is_of_load_cell()).collect();
    let mut joint = JointInformation::of_scan(FisherInformation::from_matrix(material, gram)?, unknowns.len());
    for reading in forces.readings {
        check_length("a force's sensitivities", reading.sensitivities.len(), num)?;
        let of_unknown = |(unknown, _): &(Nuisance, f64)| match unknown {
            Nuisance::ForceGain => reading.force_n,
            Nuisance::ForceZero => 1.0,
            // Left out above: they change the displacements.
            Nuisance::DriveZero | Nuisance::PlateTilt(_) => 0.0,
        };
        let of_unknowns: Vec<f64> = unknowns.iter().map(of_unknown).collect();
        joint.add_force(&reading.sensitivities, &of_unknowns, noise.force_sd_n);
    }
    joint.about_material(material, &unknowns.iter().map(|u| u.1).collect::<Vec<_>>())
}

/// Products of pairs (nodal displacements in mm, force in N) in the metric of the scan's noise: ∫ aᵀ N⁻¹ b dV / V_voxel
/// and the load cell's part.
pub(super) fn gram_over_quadrature(
    mesh: &Mesh,
    points: &[QuadraturePoint],
    fields: &[(&[[f64; 3]], f64)],
    noise: &MeasurementNoise,
    voxel_volume_mm3: f64,
) -> Result<DMatrix<f64>, InformationError> {
    noise.check()?;
    let num = fields.len();
    let rule = mesh.element_kind.quadrature();
    let shape: Vec<[f64; 27]> = rule.iter().map(|(r, _)| mesh.element_kind.shape_functions(*r)).collect();
    check_length("quadrature points", points.len(), mesh.num_elements() * rule.len())?;
    for (field, _) in fields {
        check_length("a parameter's nodal sensitivities", field.len(), mesh.nodes.len())?;
    }
    let root = noise.displacement_sd_mm.map(|sd| 1.0 / sd);
    let mut sums = vec![0.0; num * num];
    let mut local = vec![[0.0; 3]; num];
    for (n, point) in points.iter().enumerate() {
        let nodes = mesh.element(point.element);
        let weights = &shape[n % rule.len()];
        for (value, (field, _)) in local.iter_mut().zip(fields) {
            *value = [0.0; 3];
            for (&node, weight) in nodes.iter().zip(weights) {
                for c in 0..3 {
                    value[c] += weight * root[c] * field[node as usize][c];
                }
            }
        }
        for i in 0..num {
            for j in 0..=i {
                let (a, b) = (local[i], local[j]);
                sums[i * num + j] += point.volume_mm3 * (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
            }
        }
    }
    let scale = num_copies(mesh.mirror) / voxel_volume_mm3;
    Ok(DMatrix::from_fn(num, num, |i, j| {
        let of_force = fields[i].1 / noise.force_sd_n * (fields[j].1 / noise.force_sd_n);
        scale * sums[i.max(j) * num + i.min(j)] + of_force
    }))
}

/// Volume-weighted median of the stretch amplitude λ; none without admissible points.
pub fn median_stretch_over_quadrature(points: &[QuadraturePoint]) -> Option<f64> {
    let mut states: Vec<(f64, f64)> = points
        .iter()
        .map(|p| (decompose(&p.deformation_gradient).stretch_amplitude, p.volume_mm3))
        .filter(|(s, _)| s.is_finite())
        .collect();
    states.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * states.iter().map(|s| s.1).sum::<f64>();
    let mut sum = 0.0;
    states.into_iter().find_map(|(stretch, volume)| {
        sum += volume;
        (sum >= half).then_some(stretch)
    })
}

/// The largest principal stretch at any quadrature point (with volume change), or NaN without points. Bonded edges are
/// singular: there it grows as the mesh is refined.
pub fn largest_principal_stretch(points: &[QuadraturePoint]) -> f64 {
    points.iter().map(|p| principal_stretches(&p.deformation_gradient)[0]).fold(f64::NAN, f64::max)
}

fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), InformationError> {
    if found == expected { Ok(()) } else { Err(InformationError::LengthMismatch { what, found, expected }) }
}

#[cfg(test)]
pub(crate) mod tests;
