//! The dimensions that a design is made to, those that mirror images share together.

use super::rounding::{notch_center, shapes_of};
use super::words::listed;
use crate::specimen::{Hole, HoleAxis, MAX_PRECOMPRESSION, MIRROR_TOLERANCE_MM, Outline, Specimen};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What of a sample a dimension is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DimensionKind {
    /// Of the block, along x.
    Length,
    /// Of the block, along y.
    Thickness,
    /// Of the block, along z.
    Width,
    /// Of a dumb-bell.
    GaugeWidth,
    /// Of a dumb-bell, between its arcs.
    GaugeLength,
    /// Of a dumb-bell's arcs.
    FilletRadius,
    /// Of holes; of those that are longer than wide their extent across.
    Diameter,
    /// Of holes that are longer than wide.
    HoleLength,
    /// Distance of holes' centres from the middle along x.
    X,
    /// Distance of holes' centres from the middle across x.
    Other,
}

/// A dimension of a sample.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Dimension {
    /// Place of the sample among those of the fixture, from 0.
    pub sample: usize,
    /// What it is.
    pub kind: DimensionKind,
    /// The holes that share it, numbered from 1 as on the drawing; none of the block's own.
    pub holes: Vec<usize>,
}

impl Dimension {
    /// All of a specimen. A hole on a centre line has no distance from it.
    pub(super) fn all_of(specimen: &Specimen) -> Vec<Dimension> {
        use DimensionKind as K;
        let mut all = Vec::new();
        for (sample, shape) in specimen.samples().iter().enumerate() {
            let kinds: &[K] = match shape.outline {
                Outline::Block => &[K::Length, K::Thickness, K::Width],
                // A die cuts the rest.
                Outline::Iso37Type4 => &[K::Thickness],
                Outline::Dumbbell(_) => {
                    &[K::Length, K::Thickness, K::Width, K::GaugeWidth, K::GaugeLength, K::FilletRadius]
                }
            };
            all.extend(kinds.iter().map(|&kind| Dimension { sample, kind, holes: Vec::new() }));
            for group in mirror_images(&shape.holes) {
                let hole = &shape.holes[group[0]];
                let size = hole.axis.section_of(&shape.block);
                let is_free = |c: usize| {
                    let away = hole.center_mm[c].abs();
                    let is_on_side = hole.is_notch && (away - 0.5 * size[c]).abs() < MIRROR_TOLERANCE_MM;
                    away > MIRROR_TOLERANCE_MM && !is_on_side
                };
                let has = [
                    (K::Diameter, true),
                    (K::HoleLength, hole.shape.is_some()),
                    (K::X, is_free(0)),
                    (K::Other, is_free(1)),
                ];
                let holes: Vec<usize> = group.iter().map(|h| h + 1).collect();
                let kinds = has.into_iter().filter(|(_, has)| *has).map(|(kind, _)| kind);
                all.extend(kinds.map(|kind| Dimension { sample, kind, holes: holes.clone() }));
            }
        }
        all
    }

    /// What it is as drawn, mm.
    pub(super) fn drawn_mm(&self, specimen: &Specimen) -> f64 {
        use DimensionKind as K;
        let samples = specimen.samples();
        let Some(sample) = samples.get(self.sample) else { return 0.0 };
        let hole = self.holes.first().and_then(|number| sample.holes.get(number - 1));
        let of_hole = |of: fn(&Hole) -> f64| hole.map_or(0.0, of);
        let gauge = sample.outline.dumbbell();
        match self.kind {
            K::Length => sample.block.length_mm,
            K::Thickness => sample.block.thickness_mm,
            K::Width => sample.block.width_mm,
            K::GaugeWidth => gauge.map_or(0.0, |g| g.gauge_width_mm),
            K::GaugeLength => gauge.map_or(0.0, |g| g.gauge_length_mm),
            K::FilletRadius => gauge.map_or(0.0, |g| g.fillet_radius_mm),
            K::Diameter => of_hole(|h| h.diameter_mm),
            K::HoleLength => of_hole(|h| h.length_mm()),
            K::X => of_hole(|h| h.center_mm[0].abs()),
            K::Other => of_hole(|h| h.center_mm[1].abs()),
        }
    }

    /// The specimen with it larger by so much, mm, all else held; notches stay on their sides, and plates are brought
    /// no further than they may be.
    pub(super) fn changed(&self, specimen: &Specimen, by_mm: f64) -> Specimen {
        use DimensionKind as K;
        let mut made = specimen.clone();
        if let Some(gauge) = made.outline.free_gauge_mut() {
            match self.kind {
                K::GaugeWidth => gauge.gauge_width_mm += by_mm,
                K::GaugeLength => gauge.gauge_length_mm += by_mm,
                K::FilletRadius => gauge.fillet_radius_mm += by_mm,
                _ => {}
            }
        }
        let Some((block, holes)) = shapes_of(&mut made).nth(self.sample) else { return specimen.clone() };
        let drawn = *block;
        match self.kind {
            K::Length => block.length_mm += by_mm,
            K::Thickness => block.thickness_mm += by_mm,
            K::Width => block.width_mm += by_mm,
            _ => {}
        }
        for (h, hole) in holes.iter_mut().enumerate() {
            if self.holes.contains(&(h + 1)) {
                match self.kind {
                    K::Diameter => hole.diameter_mm += by_mm,
                    K::HoleLength => hole.shape.iter_mut().for_each(|shape| shape.length_mm += by_mm),
                    K::X => hole.center_mm[0] += by_mm * hole.center_mm[0].signum(),
                    K::Other => hole.center_mm[1] += by_mm * hole.center_mm[1].signum(),
                    _ => {}
                }
            }
            if hole.is_notch {
                hole.center_mm = notch_center(hole, &drawn, block, |value| value);
            }
        }
        let ends_mm = shapes_of(&mut made).flat_map(|(block, _)| block.end_thicknesses_mm());
        let most_mm = MAX_PRECOMPRESSION * ends_mm.fold(f64::INFINITY, f64::min).max(0.0);
        made.precompression_mm = made.precompression_mm.clamp(-most_mm, most_mm);
        made
    }

    /// What it is called: `length`, `⌀ of holes 1 and 2`, `z of hole 3 of sample 2`.
    pub(super) fn words(&self, specimen: &Specimen) -> String {
        use DimensionKind as K;
        let samples = specimen.samples();
        let is_along_thickness = samples.get(self.sample).is_none_or(|s| s.extrusion_axis() == HoleAxis::Thickness);
        let what = match self.kind {
            K::Length => "length",
            K::Thickness => "thickness",
            K::Width => "width",
            K::GaugeWidth => "gauge width",
            K::GaugeLength => "gauge length",
            K::FilletRadius => "fillet radius",
            K::Diameter => "⌀",
            K::HoleLength => "length",
            K::X => "x",
            K::Other if is_along_thickness => "z",
            K::Other => "y",
        };
        let numbers = listed(&self.holes.iter().map(usize::to_string).collect::<Vec<_>>());
        let of_holes = match self.holes.len() {
            0 => String::new(),
            1 => format!(" of hole {numbers}"),
            _ => format!(" of holes {numbers}"),
        };
        let of_sample = if samples.len() > 1 { format!(" of sample {}", self.sample + 1) } else { String::new() };
        format!("{what}{of_holes}{of_sample}")
    }
}

/// Places of holes, those together that are mirror images of one another.
fn mirror_images(holes: &[Hole]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (h, hole) in holes.iter().enumerate() {
        let is_image = |first: &Hole| {
            let signs = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
            let is_alike = first.axis == hole.axis && first.is_notch == hole.is_notch;
            is_alike && signs.iter().any(|s| first.mirrored(*s).difference_mm(hole) < MIRROR_TOLERANCE_MM)
        };
        match groups.iter_mut().find(|group| is_image(&holes[group[0]])) {
            Some(group) => group.push(h),
            None => groups.push(vec![h]),
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_holes() -> Specimen {
        Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).expect("the published specimen")
    }

    /// The published specimen has two mirrored holes on the middle line along x: their diameter and their distance, and
    /// none from that line.
    #[test]
    fn mirrored_holes_share_their_dimensions() {
        let specimen = two_holes();
        let all = Dimension::all_of(&specimen);
        let words: Vec<String> = all.iter().map(|d| d.words(&specimen)).collect();
        assert_eq!(words, ["length", "thickness", "width", "⌀ of holes 1 and 2", "x of holes 1 and 2"]);
        let drawn: Vec<f64> = all.iter().map(|d| d.drawn_mm(&specimen)).collect();
        assert_eq!(drawn, [25.4, 6.4, 19.1, 5.0, 4.2333]);
    }

    /// Every dimension is changed by what is asked, and no other one; the holes stay mirror images.
    #[test]
    fn one_dimension_is_changed() {
        let specimen = two_holes();
        let all = Dimension::all_of(&specimen);
        for changed in &all {
            let made = changed.changed(&specimen, 0.1);
            assert_eq!(Dimension::all_of(&made), all);
            for other in &all {
                let by_mm = other.drawn_mm(&made) - other.drawn_mm(&specimen);
                let expected = if other == changed { 0.1 } else { 0.0 };
                assert!((by_mm - expected).abs() < 1e-12, "{changed:?} {other:?} {by_mm}");
            }
        }
    }

    /// Of a block whose plates are pulled apart as far as may be, a thinner one is still valid.
    #[test]
    fn plates_keep_their_limit() {
        let specimen = Specimen { precompression_mm: -1.6, ..two_holes() };
        assert_eq!(specimen.validate(), Ok(()));
        for dimension in Dimension::all_of(&specimen) {
            let both = [-0.1, 0.1].map(|by_mm| dimension.changed(&specimen, by_mm));
            assert!(both.iter().all(|s| s.validate().is_ok()), "{dimension:?}");
        }
    }

    /// A notch in an end moves with the end, which is no dimension of its own.
    #[test]
    fn notches_stay_on_their_sides() {
        let mut specimen = two_holes();
        specimen.holes = [-12.7, 12.7].map(|x| Hole::notch(HoleAxis::Thickness, [x, 2.0], 4.0)).to_vec();
        let all = Dimension::all_of(&specimen);
        let kinds: Vec<DimensionKind> = all.iter().filter(|d| !d.holes.is_empty()).map(|d| d.kind).collect();
        assert_eq!(kinds, [DimensionKind::Diameter, DimensionKind::Other]);
        let longer = all[0].changed(&specimen, 0.2);
        assert!(longer.holes.iter().all(|h| (h.center_mm[0].abs() - 12.8).abs() < 1e-12), "{:?}", longer.holes);
    }
}
