//! Which axis of a biaxial test a column belongs to: by the mark that its name ends in, or has beside it.

use super::csv_columns::Header;
use super::csv_unit::Unit;

/// The marks of the first and of the second axis.
const MARKS: [[&str; 4]; 2] = [["1", "11", "x", "xx"], ["2", "22", "y", "yy"]];

/// Words beside a mark that say nothing else.
const BESIDE: [&str; 9] = ["axis", "direction", "dir", "along", "in", "arm", "achse", "richtung", "channel"];

/// Names that a mark may follow, or `x` and `y` precede, without a blank; no name begins with another one before it.
const NAMES: [&str; 15] = [
    "lambda",
    "λ",
    "stretch",
    "strain",
    "dehnung",
    "stress",
    "spannung",
    "force",
    "load",
    "kraft",
    "displacement",
    "extension",
    "weg",
    "p",
    "f",
];

fn axis_of(mark: &str) -> Option<usize> {
    MARKS.iter().position(|marks| marks.contains(&mark))
}

/// The axis of a name in lower case with single blanks, its mark, and the name without it.
fn marked(name: &str) -> Option<(usize, &str, String)> {
    let words: Vec<&str> = name.split(' ').map(|w| w.trim_matches(['(', ')', '[', ']', ',', ':'])).collect();
    let without = |index: usize, instead: &str| {
        let others = words.iter().enumerate().map(|(i, w)| if i == index { instead } else { *w });
        others.filter(|w| !w.is_empty() && !BESIDE.contains(w)).collect::<Vec<_>>().join(" ")
    };
    if let Some((index, axis)) = words.iter().enumerate().rev().find_map(|(i, w)| Some((i, axis_of(w)?))) {
        return Some((axis, words[index], without(index, "")));
    }
    words.iter().enumerate().find_map(|(index, word)| {
        NAMES.iter().find_map(|name| {
            let before = || word.strip_suffix(name).filter(|mark| ["x", "y"].contains(mark));
            let mark = word.strip_prefix(name).or_else(before)?;
            Some((axis_of(mark)?, mark, without(index, name)))
        })
    })
}

/// The columns of one axis under their names without its mark; others have no name.
pub(super) fn axis_headers(all: &[Header], axis: usize) -> Vec<Header> {
    let of = |header: &Header| {
        let own = marked(&header.name).filter(|(of, ..)| *of == axis);
        let name = own.map_or_else(String::new, |(_, mark, name)| match name.as_str() {
            // The component of the first Piola–Kirchhoff stress, whichever axis it is of.
            "p" | "pk1" => "p11".into(),
            // F₁₁ is a stretch, F₁ a force.
            "f" if mark.len() == 2 && !matches!(header.unit, Some(Unit::Force(_))) => "stretch".into(),
            "f" => "force".into(),
            _ => name,
        });
        Header { name, ..header.clone() }
    };
    all.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_found_in_names() {
        for (name, axis, without) in [
            ("stretch 1", 0, "stretch"),
            ("lambda y", 1, "lambda"),
            ("λ2", 1, "λ"),
            ("strain (x)", 0, "strain"),
            ("engineering strain yy", 1, "engineering strain"),
            ("axis 2 force", 1, "force"),
            ("nominal stress in direction 1", 0, "nominal stress"),
            ("p22", 1, "p"),
            ("fx", 0, "f"),
            ("xdisplacement", 0, "displacement"),
            ("dehnung x", 0, "dehnung"),
        ] {
            let found = marked(name).map(|(axis, _, name)| (axis, name));
            assert_eq!(found, Some((axis, without.to_string())), "{name}");
        }
        for name in ["time", "stretch", "cycle", "p12", "strain 3", "position"] {
            assert!(marked(name).is_none(), "{name}");
        }
    }
}
