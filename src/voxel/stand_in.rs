//! Stand-ins until the mesh and specimen rooms are merged.
use crate::mesh::Mesh;
use crate::specimen::Specimen;

pub(crate) trait HalfWidth {
    fn half_width_mm(&self, x: f64) -> f64;
}
impl HalfWidth for Specimen {
    fn half_width_mm(&self, _x: f64) -> f64 {
        0.5 * self.block.width_mm
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Location {
    pub element: u32,
    pub reference_coordinates: [f64; 3],
}
pub(crate) struct Locator {
    boxes: Vec<[[f64; 2]; 3]>,
}
impl Locator {
    pub fn new(mesh: &Mesh) -> Self {
        let boxes = (0..mesh.num_elements())
            .map(|e| {
                let mut b = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
                for &n in mesh.element(e) {
                    for a in 0..3 {
                        b[a][0] = b[a][0].min(mesh.nodes[n as usize][a] - 1e-9);
                        b[a][1] = b[a][1].max(mesh.nodes[n as usize][a] + 1e-9);
                    }
                }
                b
            })
            .collect();
        Locator { boxes }
    }
    pub fn locate(&self, mesh: &Mesh, p: [f64; 3]) -> Option<Location> {
        for (e, b) in self.boxes.iter().enumerate() {
            if (0..3).all(|a| p[a] >= b[a][0] && p[a] <= b[a][1])
                && let Some(r) = super::tracker::inverse_map(mesh, e, p, super::tracker::center(mesh.element_kind))
            {
                return Some(Location { element: e as u32, reference_coordinates: r });
            }
        }
        None
    }
}
