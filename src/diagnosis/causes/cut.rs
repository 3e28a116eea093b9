//! The sample is cut: a slit through it, without loss of material.

use crate::diagnosis::cause::{Category, Cause, CauseName, CauseParameter};
use crate::diagnosis::entry::{Entry, Origin};
use crate::diagnosis::location::Location;
use crate::diagnosis::scene::{MovedCut, Scene};
use crate::mesh::{Cut, clearance_mm, half_extents_mm, section_axes, takes_cuts};
use crate::specimen::Specimen;
use std::sync::Arc;

const NAME: CauseName = CauseName::new("cut");
/// What a laboratory can do about it.
const REMEDY: &str = "Cast the sample anew and take it out of the mould without tearing it; look for the slit at the place that is \
    given, opened by hand.";
/// Its line in the registry.
pub(super) const ENTRY: Entry = Entry { name: NAME, remedy: REMEDY, origin: Origin::LookAlike };

/// A cut keeps this far from the holes and the outline where its mesh is made, mm.
const CLEARANCE_MM: f64 = 0.5;
/// Shortest half length at the start, mm, and by how much it is shortened until it keeps clear.
const LEAST_HALF_MM: f64 = 0.8;
const SHORTER_MM: f64 = 0.2;
/// Points of a cut that must keep clear.
const NUM_POINTS: usize = 9;
/// A cut may move and grow by this much from where its mesh was made, mm.
const LARGEST_MOVE_MM: f64 = 4.0;
/// A fit that moved or lengthened a cut by more than this goes on from a mesh made anew, mm.
const MESHED_ANEW_MM: f64 = 1.0;

/// A straight slit through the section, from face to face along the extrusion; both sides are free.
pub struct Slit {
    /// Where the mesh has it, and from where the fit starts.
    start: Cut,
    axes: [usize; 2],
}

impl Slit {
    /// The slits through a place of a specimen, one along each axis of its section, of at most this half length; none
    /// where there is no room.
    pub(super) fn across(specimen: &Specimen, place_mm: [f64; 3], half_length_mm: f64) -> Vec<Slit> {
        if !takes_cuts(specimen) {
            return Vec::new();
        }
        let axes = section_axes(specimen);
        let center_mm = axes.map(|a| place_mm[a]);
        let turns = [0.0, std::f64::consts::FRAC_PI_2];
        let of_turn = |turn_rad: f64| Slit::clear(specimen, Cut { center_mm, half_length_mm, turn_rad });
        turns.into_iter().filter_map(of_turn).collect()
    }

    /// A slit like `cut`, shortened until it keeps clear of holes and outline.
    fn clear(specimen: &Specimen, mut cut: Cut) -> Option<Slit> {
        let is_clear = |cut: &Cut| {
            let [from, to] = cut.ends_mm();
            (0..NUM_POINTS).all(|n| {
                let part = n as f64 / (NUM_POINTS - 1) as f64;
                let p = [0, 1].map(|c| from[c] + part * (to[c] - from[c]));
                clearance_mm(specimen, p) >= CLEARANCE_MM
            })
        };
        while cut.half_length_mm >= LEAST_HALF_MM {
            if is_clear(&cut) {
                return Some(Slit { start: cut, axes: section_axes(specimen) });
            }
            cut.half_length_mm -= SHORTER_MM;
        }
        None
    }

    fn cut(&self, values: &[f64]) -> Cut {
        Cut { center_mm: [values[0], values[1]], half_length_mm: values[2], turn_rad: values[3].to_radians() }
    }
}

impl Cause for Slit {
    fn name(&self) -> CauseName {
        NAME
    }

    fn category(&self) -> Category {
        Category::Geometry
    }

    fn description(&self) -> String {
        let names = self.axes.map(|a| ["x", "y", "z"][a]);
        let [a, b] = self.start.center_mm;
        format!("the sample is cut through, near {} = {a:.1}, {} = {b:.1} mm", names[0], names[1])
    }

    fn parameters(&self) -> Vec<CauseParameter> {
        let names = self.axes.map(|a| ["x", "y", "z"][a]);
        let Cut { center_mm: [a, b], half_length_mm, turn_rad } = self.start;
        let turn = turn_rad.to_degrees();
        let around = |x: f64| [x - LARGEST_MOVE_MM, x + LARGEST_MOVE_MM];
        vec![
            CauseParameter::new(format!("center_{}_mm", names[0]), 0.5, around(a)),
            CauseParameter::new(format!("center_{}_mm", names[1]), 0.5, around(b)),
            CauseParameter::new("half_length_mm", 0.5, [0.3 * half_length_mm, half_length_mm + LARGEST_MOVE_MM]),
            CauseParameter::new(format!("turn_from_{}_to_x_degrees", names[1]), 5.0, [turn - 40.0, turn + 40.0]),
        ]
    }

    fn start(&self) -> Vec<f64> {
        let Cut { center_mm: [a, b], half_length_mm, turn_rad } = self.start;
        vec![a, b, half_length_mm, turn_rad.to_degrees()]
    }

    /// The place of its start, in tenths of a millimetre, and whether it lies along x.
    fn variant(&self) -> [i64; 3] {
        let [a, b] = self.start.center_mm.map(|x| (10.0 * x).round() as i64);
        [a, b, i64::from(self.start.turn_rad > 0.5)]
    }

    fn is_idealised(&self) -> bool {
        true
    }

    fn apply(&self, values: &[f64], scene: &mut Scene) {
        scene.cut = Some(MovedCut { meshed: self.start, cut: self.cut(values) });
    }

    /// The same slit with a mesh made for where it is.
    fn look_alikes(&self, values: &[f64], specimen: &Specimen) -> Vec<Arc<dyn Cause>> {
        let cut = self.cut(values);
        let [from, to] = [self.start.ends_mm(), cut.ends_mm()];
        let moved = (0..2).map(|n| (from[n][0] - to[n][0]).hypot(from[n][1] - to[n][1])).fold(0.0, f64::max);
        let anew = (moved > MESHED_ANEW_MM).then(|| Slit::clear(specimen, cut)).flatten();
        anew.into_iter().map(|slit| Arc::new(slit) as Arc<dyn Cause>).collect()
    }

    fn location(&self, values: &[f64], specimen: &Specimen) -> Option<Location> {
        let cut = self.cut(values);
        let [from, to] = cut.ends_mm();
        let through = 3 - self.axes[1];
        let (mut center_mm, mut extent_mm) = ([0.0; 3], [0.0; 3]);
        for c in 0..2 {
            center_mm[self.axes[c]] = cut.center_mm[c];
            extent_mm[self.axes[c]] = (to[c] - from[c]).abs();
        }
        extent_mm[through] = 2.0 * half_extents_mm(specimen)[through];
        Some(Location { region: "slit through the sample, its faces free".into(), center_mm, extent_mm })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Beside a hole slits keep clear of it and of the outline; inside one there is no room.
    #[test]
    fn starts_keep_clear() {
        let specimen = Specimen::from_json(include_str!("../../../geometries/two-hole-shear.json")).unwrap();
        let slits = Slit::across(&specimen, [9.3, 0.4, -1.5], 3.0);
        assert_eq!(slits.len(), 2);
        for slit in &slits {
            let cut = slit.start;
            for end in cut.ends_mm().into_iter().chain([cut.center_mm]) {
                assert!(clearance_mm(&specimen, end) > 0.99 * CLEARANCE_MM, "{cut:?}");
            }
        }
        // The hole's wall is at x = 6.73 mm, the end at 12.7 mm: along x there is less room than across.
        assert!((slits[0].start.half_length_mm - 3.0).abs() < 1e-12 && slits[1].start.half_length_mm < 2.4);
        assert!(Slit::across(&specimen, [4.2, 0.0, 0.5], 3.0).is_empty());
    }

    /// Where a fit has moved a slit far, it goes on from a mesh of its own; else not.
    #[test]
    fn slits_that_moved_are_meshed_anew() {
        let specimen = Specimen::from_json(include_str!("../../../geometries/solid-shear.json")).unwrap();
        let slit = Slit::across(&specimen, [3.0, 0.0, 1.0], 2.0).swap_remove(0);
        let [a, b, half, turn] = [3.0, 1.0, 2.0, 0.0];
        assert!(slit.look_alikes(&[a + 0.3, b, half, turn], &specimen).is_empty());
        let anew = slit.look_alikes(&[a, b + 1.0, half + 1.5, turn], &specimen);
        assert_eq!(anew.iter().map(|c| c.start()).collect::<Vec<_>>(), [vec![a, b + 1.0, half + 1.5, turn]]);
    }
}
