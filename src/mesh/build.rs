//! From a specimen to its mesh: section, extrusion, node sets.

use super::check::orient_and_limit;
use super::domain::Domain;
use super::error::MeshError;
use super::grading::{divide, with_middles};
use super::grid::layered;
use super::node_sets::{nodes_on_plane, pull_axis};
use super::options::MeshOptions;
use super::parting::part;
use super::quads::quad_section;
use super::section::Section;
use super::triangles::triangle_section;
use super::{ElementKind, Mesh};
use crate::specimen::Specimen;

/// Meshes `specimen` (the half or quarter with positive coordinates where it is mirrored).
///
/// The section is a structured grid (no holes), or O-grids in the holes' power-diagram cells, or triangles where
/// neither suits; it is extruded in levels. Curved walls carry exact nodes at element corners and middles. Equal input
/// gives equal bits.
///
/// # Errors
/// Any [`MeshError`]; in particular [`MeshError::LigamentTooThin`] for holes that touch, and [`MeshError::PoorElement`]
/// if even the triangles are worse than `options.min_scaled_jacobian`.
pub fn mesh_specimen(specimen: &Specimen, options: &MeshOptions) -> Result<Mesh, MeshError> {
    let domain = Domain::new(specimen, options)?;
    let section = if options.force_prisms { None } else { quad_section(&domain, options)? };
    let section = match section {
        Some(section) => section,
        None => triangle_section(&domain, options)?,
    };
    orient_and_limit(&section, options)?;
    extrude(&domain, options, &section)
}

/// As [`mesh_specimen`], of triangles whose edges follow straight `lines` of the section (x and z of both ends, mm; for
/// holes along z: x and y), through the whole extrusion: a patch of a bonded face ends at element edges. Lines may meet
/// at their ends and end on the outline, and must keep clear of the holes.
///
/// # Errors
/// As [`mesh_specimen`]; [`MeshError::Triangulation`] where parts of lines cross each other or a hole.
pub fn mesh_specimen_along(
    specimen: &Specimen,
    options: &MeshOptions,
    lines: &[[[f64; 2]; 2]],
) -> Result<Mesh, MeshError> {
    let mut domain = Domain::new(specimen, &MeshOptions { use_mirror: false, ..*options })?;
    domain.lines = lines.to_vec();
    let section = triangle_section(&domain, options)?;
    orient_and_limit(&section, options)?;
    extrude(&domain, options, &section)
}

/// As [`mesh_specimen_along`] one line of the section, on which the elements part.
///
/// # Errors
/// As [`mesh_specimen_along`].
pub(super) fn mesh_specimen_parted(
    specimen: &Specimen,
    options: &MeshOptions,
    line: [[f64; 2]; 2],
) -> Result<Mesh, MeshError> {
    let mut domain = Domain::new(specimen, &MeshOptions { use_mirror: false, ..*options })?;
    domain.lines = vec![line];
    let mut section = triangle_section(&domain, options)?;
    orient_and_limit(&section, options)?;
    part(&mut section, line, domain.scale());
    extrude(&domain, options, &section)
}

fn extrude(domain: &Domain, options: &MeshOptions, section: &Section) -> Result<Mesh, MeshError> {
    let half = domain.extrusion_half;
    let (inner_half, ratio) = (domain.inner_extrusion_half, domain.grading.extrusion);
    let mut levels: Vec<f64> = if domain.extrusion_mirrored {
        divide(options.levels.div_ceil(2), 1.0, ratio).iter().map(|u| inner_half * u).collect()
    } else {
        divide(options.levels, ratio, ratio).iter().map(|u| inner_half * (2.0 * u - 1.0)).collect()
    };
    levels = layered(with_middles(&levels), half, !domain.extrusion_mirrored);
    if domain.extrusion_axis == 1 {
        // (x, z, −y) is right-handed: go down in y so that Jacobians are positive.
        levels.reverse();
    }
    let layers = levels.len() / 2;
    let elements = layers * section.num_cells();
    if elements > options.max_elements {
        return Err(MeshError::TooManyElements { elements, limit: options.max_elements });
    }
    let in_section = section.points.len();
    let mut nodes = Vec::with_capacity(levels.len() * in_section);
    for &level in &levels {
        for p in &section.points {
            let mut node = [0.0; 3];
            (node[0], node[domain.b_axis], node[domain.extrusion_axis]) = (p[0], p[1], level);
            nodes.push(node);
        }
    }
    let mut connectivity = Vec::with_capacity(3 * layers * section.cells.len());
    for layer in 0..layers {
        for cell in 0..section.num_cells() {
            for k in 0..3 {
                let offset = ((2 * layer + k) * in_section) as u32;
                connectivity.extend(section.cell(cell).iter().map(|n| n + offset));
            }
        }
    }
    let element_kind = if section.nodes_per_cell == 9 { ElementKind::Hex27 } else { ElementKind::Prism21 };
    let mut mesh = Mesh {
        element_kind,
        nodes,
        connectivity,
        taper: domain.taper,
        mirror: domain.mirror,
        fixed_nodes: Vec::new(),
        moved_nodes: Vec::new(),
        mirror_y_nodes: Vec::new(),
        mirror_z_nodes: Vec::new(),
    };
    let mut half_extents = [domain.half[0]; 3];
    (half_extents[domain.b_axis], half_extents[domain.extrusion_axis]) = (domain.half[1], half);
    let axis = pull_axis(domain.test);
    let tolerance = 1e-9 * domain.scale().max(2.0 * half);
    mesh.fixed_nodes = nodes_on_plane(&mesh, axis, -half_extents[axis], tolerance);
    mesh.moved_nodes = nodes_on_plane(&mesh, axis, half_extents[axis], tolerance);
    if domain.mirror.y {
        mesh.mirror_y_nodes = nodes_on_plane(&mesh, 1, 0.0, tolerance);
    }
    if domain.mirror.z {
        mesh.mirror_z_nodes = nodes_on_plane(&mesh, 2, 0.0, tolerance);
    }
    for node in &mut mesh.nodes {
        *node = domain.taper.raised(*node);
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_specimens::two_holes;

    /// A corner patch: the mesh is one of the specimen, and element edges without a gap follow both lines.
    #[test]
    fn elements_end_at_lines() {
        let specimen = two_holes();
        let half = [0.5 * specimen.block.length_mm, 0.5 * specimen.block.width_mm];
        let lines = [[[9.1, 2.3], [9.1, half[1]]], [[9.1, 2.3], [half[0], 2.3]]];
        let mesh = mesh_specimen_along(&specimen, &MeshOptions::search(&specimen), &lines).unwrap();
        mesh.check(&specimen).unwrap();
        let top = 0.5 * specimen.block.thickness_mm;
        for (along, across, at, from) in [(2, 0, 9.1, 2.3), (0, 2, 2.3, 9.1)] {
            let end = [half[0], 0.0, half[1]][along];
            let mut covered = 0.0;
            for e in 0..mesh.num_elements() {
                for face in mesh.element_kind.faces().iter().filter(|f| f.len() == 7) {
                    let corners: Vec<[f64; 3]> =
                        face[..3].iter().map(|&a| mesh.nodes[mesh.element(e)[a] as usize]).collect();
                    if corners.iter().any(|x| (x[1] - top).abs() > 1e-9) {
                        continue;
                    }
                    for k in 0..3 {
                        let (p, q) = (corners[k], corners[(k + 1) % 3]);
                        let is_on = |x: [f64; 3]| (x[across] - at).abs() < 1e-9 && x[along] > from - 1e-9;
                        if is_on(p) && is_on(q) {
                            covered += (p[along] - q[along]).abs();
                        }
                    }
                }
            }
            // An edge inside the face belongs to two triangles.
            assert!((covered - 2.0 * (end - from)).abs() < 1e-9, "{covered} of {}", 2.0 * (end - from));
        }
    }

    #[test]
    fn crossing_lines_are_refused() {
        let specimen = two_holes();
        let lines = [[[9.0, -3.0], [9.0, 3.0]], [[8.1, 0.13], [10.7, 0.17]]];
        let made = mesh_specimen_along(&specimen, &MeshOptions::search(&specimen), &lines);
        assert!(matches!(made, Err(MeshError::Triangulation { .. })), "{:?}", made.map(|m| m.num_elements()));
    }
}
