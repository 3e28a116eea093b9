//! Shapes, numbers and lists in words.

use crate::specimen::{HoleAxis, Specimen};

/// "a", "a and b", "a, b and c".
pub fn listed(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Two significant digits of what is below ten, else none behind the point that say nothing: 0.27, 3.4, 45, 0.1875.
pub fn short_number(value: f64) -> String {
    let exact = format!("{value}");
    // What people wrote is kept as they wrote it.
    if exact.len() <= 6 {
        return exact;
    }
    let digits = if value.abs() >= 10.0 || value.abs() < f64::MIN_POSITIVE {
        0
    } else {
        (1 - value.abs().log10().floor() as i32).clamp(0, 12) as usize
    };
    format!("{value:.digits$}")
}

/// The holes of one sample in brief, equal outlines together: `2 × ⌀5.0 + slot 8.0 × 4.0 at 30°`.
pub fn holes_in_brief(specimen: &Specimen) -> String {
    let mut groups: Vec<(String, usize)> = Vec::new();
    for hole in &specimen.holes {
        let outline = match hole.shape {
            None if hole.is_notch => format!("notch R{:.2}", 0.5 * hole.diameter_mm),
            None => format!("⌀{:.1}", hole.diameter_mm),
            Some(shape) => {
                let (kind, angle) = (shape.kind.name(), shape.angle_deg);
                format!("{kind} {:.1} × {:.1} at {angle:.0}°", shape.length_mm, hole.diameter_mm)
            }
        };
        match groups.iter_mut().find(|(d, _)| *d == outline) {
            Some((_, count)) => *count += 1,
            None => groups.push((outline, 1)),
        }
    }
    let list: Vec<String> = groups.into_iter().map(|(d, n)| if n > 1 { format!("{n} × {d}") } else { d }).collect();
    let along_width = specimen.hole_axis() == Some(HoleAxis::Width);
    match list.as_slice() {
        [] => "solid".into(),
        list => format!("{}{}", list.join(" + "), if along_width { " (along the width)" } else { "" }),
    }
}

/// How many holes and notches all samples have together: "no hole", "one hole", "2 holes and one notch".
pub(super) fn holes_in_words(specimen: &Specimen) -> String {
    let samples = specimen.samples();
    let [notches, holes] =
        [true, false].map(|is_notch| samples.iter().flat_map(|s| &s.holes).filter(|h| h.is_notch == is_notch).count());
    let of_kind = |(count, one, several): (usize, &str, &str)| match count {
        0 => None,
        1 => Some(format!("one {one}")),
        n => Some(format!("{n} {several}")),
    };
    match [(holes, "hole", "holes"), (notches, "notch", "notches")].into_iter().filter_map(of_kind).collect::<Vec<_>>()
    {
        none if none.is_empty() => "no hole".into(),
        some => listed(&some),
    }
}

/// The block of one sample: length × thickness × width, mm; of a wedge its thickness at both ends.
pub fn block_in_brief(specimen: &Specimen) -> String {
    let b = &specimen.block;
    if b.taper().is_even() {
        return format!("{:.1} × {:.2} × {:.1}", b.length_mm, b.thickness_mm, b.width_mm);
    }
    let [from, to] = b.end_thicknesses_mm();
    format!("{:.1} × {from:.2} to {to:.2} × {:.1}", b.length_mm, b.width_mm)
}

/// How the plates are before the drive, in words; `None` where they are as far apart as the sample is thick.
pub fn plates_in_words(specimen: &Specimen) -> Option<String> {
    let (way, by_mm) = specimen.plates_before_drive()?;
    Some(format!("plates {way} by {by_mm:.2} mm"))
}

/// One sample in words: a block of … mm without holes, or with these.
pub fn sample_in_words(specimen: &Specimen) -> String {
    let kind = match (specimen.outline.dumbbell(), specimen.block.taper().is_even()) {
        (Some(_), _) => "dumb-bell",
        (None, true) => "block",
        (None, false) => "wedge",
    };
    let mut block = format!("a {kind} of {} mm (length × thickness × width)", block_in_brief(specimen));
    if let Some(gauge) = specimen.outline.dumbbell() {
        let [width, length] = [gauge.gauge_width_mm, gauge.gauge_length_mm];
        block += &format!(
            ", its gauge {width:.1} mm wide and {length:.1} mm long, with radii of {:.1} mm,",
            gauge.fillet_radius_mm
        );
    }
    if specimen.holes.is_empty() {
        return format!("{block} without holes");
    }
    let direction = specimen.extrusion_axis().name();
    let plural = match (specimen.holes.len(), specimen.holes.iter().filter(|hole| hole.is_notch).count()) {
        (1, 0) => "a hole",
        (_, 0) => "holes",
        (1, _) => "a notch",
        (all, notches) if all == notches => "notches",
        _ => "holes and notches",
    };
    let brief = holes_in_brief(specimen).replace(" (along the width)", "");
    format!("{block} with {plural} along the {direction}, {brief} mm")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::{HoleKind, HoleShape};

    #[test]
    fn lists_and_numbers() {
        let of = |n: usize| listed(&(0..n).map(|i| i.to_string()).collect::<Vec<_>>());
        assert_eq!([of(0), of(1), of(2), of(3)], ["", "0", "0 and 1", "0, 1 and 2"]);
        let numbers = [0.2724891, 3.44444, 45.057, 0.1875, 7.0, 0.02, 123.456];
        assert_eq!(numbers.map(short_number), ["0.27", "3.4", "45.057", "0.1875", "7", "0.02", "123"]);
    }

    #[test]
    fn shapes() {
        let text = include_str!("../../geometries/two-hole-shear.json");
        let mut specimen = Specimen::from_json(text).expect("the published specimen");
        assert_eq!(holes_in_brief(&specimen), "2 × ⌀5.0");
        let words = sample_in_words(&specimen);
        let expected =
            "a block of 25.4 × 6.40 × 19.1 mm (length × thickness × width) with holes along the thickness, 2 × ⌀5.0 mm";
        assert_eq!(words, expected);
        let shape = HoleShape { kind: HoleKind::Slot, length_mm: 8.0, angle_deg: 30.0 };
        specimen.holes[0].shape = Some(shape);
        assert_eq!(holes_in_brief(&specimen), "slot 8.0 × 5.0 at 30° + ⌀5.0");
        assert_eq!(holes_in_words(&specimen), "2 holes");
        specimen.holes[0].is_notch = true;
        assert_eq!(holes_in_words(&specimen), "one hole and one notch");
        specimen.holes.clear();
        assert_eq!([holes_in_brief(&specimen), holes_in_words(&specimen)], ["solid", "no hole"]);
        assert!(sample_in_words(&specimen).ends_with("without holes"));
    }
}
