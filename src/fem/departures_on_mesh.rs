//! Departures with their fields evaluated on a mesh.

use super::departures::{Departures, FIRM_BOND_KPA_PER_MM, Field};
use super::element_data::MAX_GROUPS;
use super::plates::Plates;
use crate::material::{LANES, Lanes};
use crate::mesh::Mesh;

/// Reference positions (mm) of an element's quadrature points: `[i][group]`.
pub(super) type PointPositions = [[Lanes; MAX_GROUPS]; 3];

/// Departures with their fields at the quadrature points and released nodes of a mesh.
pub(super) struct DeparturesOnMesh {
    /// The departures themselves.
    pub(super) departures: Departures,
    /// Per element: factor on the isochoric stiffness at the quadrature points. Empty where there is none.
    pub(super) factor: Vec<[Lanes; MAX_GROUPS]>,
    /// Per element: ln of the volume ratio free of pressure at the quadrature points. Empty where there is none.
    pub(super) growth: Vec<[Lanes; MAX_GROUPS]>,
    /// Stiffness of the spring at each released node, kPa·mm.
    pub(super) springs: Vec<(u32, f64)>,
}

impl DeparturesOnMesh {
    /// `departures` on `mesh`; `points` gives the quadrature points of every element and is only asked where a field needs
    /// them.
    pub(super) fn new<'p>(
        departures: &Departures,
        mesh: &Mesh,
        plates: &Plates,
        points: &dyn Fn() -> &'p [PointPositions],
    ) -> DeparturesOnMesh {
        let firm = FIRM_BOND_KPA_PER_MM;
        let on_points = |field: &Option<Field>| match field {
            Some(field) => points().iter().map(|positions| at_points(field, positions)).collect(),
            None => Vec::new(),
        };
        let springs = plates
            .released
            .iter()
            .map(|&(v, area)| {
                let bond = departures.bond_kpa_per_mm.as_ref().map_or(firm, |b| b.at(mesh.nodes[v as usize]));
                (v, bond.clamp(0.0, firm) * area)
            })
            .collect();
        DeparturesOnMesh {
            factor: on_points(&departures.stiffness_factor),
            growth: on_points(&departures.log_growth),
            springs,
            departures: departures.clone(),
        }
    }
}

fn at_points(field: &Field, positions: &PointPositions) -> [Lanes; MAX_GROUPS] {
    let mut values = [Lanes::ZERO; MAX_GROUPS];
    for (g, value) in values.iter_mut().enumerate() {
        for l in 0..LANES {
            value.0[l] = field.at([0, 1, 2].map(|i| positions[i][g].0[l]));
        }
    }
    values
}
