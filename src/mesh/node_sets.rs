//! Which nodes lie on a held face or a mirror plane.

use super::Mesh;
use crate::specimen::TestKind;

/// The coordinate whose extreme faces are held: y (plates) or x (grips).
pub(super) fn pull_axis(test: TestKind) -> usize {
    match test {
        TestKind::DoubleLapShear => 1,
        TestKind::Uniaxial => 0,
    }
}

/// Nodes whose coordinate `axis` is `position`.
pub(super) fn nodes_on_plane(mesh: &Mesh, axis: usize, position: f64, tolerance: f64) -> Vec<u32> {
    (0..mesh.nodes.len() as u32).filter(|&n| (mesh.nodes[n as usize][axis] - position).abs() < tolerance).collect()
}
