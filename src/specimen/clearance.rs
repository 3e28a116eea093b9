//! Clearances between solids by parry3d, independent of the closed forms in `geometry`.

use super::{LigamentKind, SectionEdge, Specimen};
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query;
use parry3d_f64::shape::{Cuboid, Cylinder};

impl Specimen {
    /// The distance between a hole and another hole or a side, as solids: cylinders as long as the extrusion, and
    /// a slab of material-free space beyond the side. mm; 0 where they overlap. It checks
    /// [`Specimen::ligaments`] by another way of computing; agreement to about 1e-6 of the block's length.
    ///
    /// `None` for holes that are not circles, for the curved sides of a dumb-bell, for an index without a hole, and
    /// where a size is not positive.
    pub fn solid_clearance_mm(&self, kind: LigamentKind) -> Option<f64> {
        let half_extrusion = 0.5 * self.extrusion_mm();
        // parry's cylinders run along y: the frame here is (x, extrusion, lateral).
        let cylinder_of = |index: usize| {
            let hole = self.holes.get(index)?;
            let is_positive = hole.shape.is_none() && hole.diameter_mm > 0.0 && half_extrusion > 0.0;
            let place = Pose::translation(hole.center_mm[0], 0.0, hole.center_mm[1]);
            is_positive.then(|| (place, Cylinder::new(half_extrusion, 0.5 * hole.diameter_mm)))
        };
        match kind {
            LigamentKind::HoleHole(i, j) => {
                let (place, hole) = cylinder_of(i)?;
                let (other_place, other) = cylinder_of(j)?;
                query::distance(&place, &hole, &other_place, &other).ok().map(|found| found.distance)
            }
            LigamentKind::HoleEdge(i, edge) => {
                let is_end = matches!(edge, SectionEdge::MinusX | SectionEdge::PlusX);
                if self.outline.dumbbell().is_some() && !is_end {
                    return None;
                }
                let (place, hole) = cylinder_of(i)?;
                let [length, lateral] = self.section_size();
                // As wide as the section and as deep: the nearest point of the slab is then on its face.
                let slab = Cuboid::new(Vector::new(0.5 * length, half_extrusion, 0.5 * lateral));
                let slab_place = match edge {
                    SectionEdge::MinusX => Pose::translation(-length, 0.0, 0.0),
                    SectionEdge::PlusX => Pose::translation(length, 0.0, 0.0),
                    SectionEdge::MinusLateral => Pose::translation(0.0, 0.0, -lateral),
                    SectionEdge::PlusLateral => Pose::translation(0.0, 0.0, lateral),
                };
                query::distance(&place, &hole, &slab_place, &slab).ok().map(|found| found.distance)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::specimen::sampling::valid_specimen;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn closed_forms_equal_distances_of_solids(specimen in valid_specimen()) {
            for ligament in specimen.ligaments() {
                if let Some(clearance) = specimen.solid_clearance_mm(ligament.kind) {
                    // parry's GJK stops at about 1e-7 relative on curved shapes.
                    let tolerance = 1e-5 * specimen.block.length_mm;
                    prop_assert!(
                        (clearance - ligament.length_mm).abs() < tolerance,
                        "{}: {} against {}", ligament.kind, clearance, ligament.length_mm
                    );
                }
            }
        }
    }
}
