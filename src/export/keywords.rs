//! Input files of Abaqus and CalculiX, which share their keywords.

use super::card::keyword_material;
use super::model::{MOVED, Numbered, Written};
use super::number::number;
use crate::mesh::ElementKind;
use std::fmt::Write;

/// Entries on a line of elements and sets; both programs read 16.
const PER_LINE: usize = 16;

/// Where the two programs differ.
pub(super) struct Dialect {
    /// Elements with 20 and with 15 nodes.
    elements: [&'static str; 2],
    /// Printing of the reactions, and the fields for pictures.
    output: &'static str,
}

/// Hybrid elements: their pressure is linear in an element, as ours is.
pub(super) static ABAQUS: Dialect = Dialect {
    elements: ["C3D20H", "C3D15H"],
    output: "*NODE PRINT, NSET=MOVED, TOTALS=YES, SUMMARY=NO\nRF\n*OUTPUT, FIELD, VARIABLE=PRESELECT\n",
};

/// Reduced integration, which a nearly incompressible material needs where elements have no pressure of their own.
pub(super) static CALCULIX: Dialect = Dialect {
    elements: ["C3D20R", "C3D15"],
    output: "*NODE PRINT, NSET=MOVED, TOTALS=ONLY\nRF\n*NODE FILE\nU\n*EL FILE\nS\n",
};

/// Numbers in lines of at most [`PER_LINE`], each but the last with a comma at its end.
fn lines_of(numbers: &[usize]) -> String {
    let line = |part: &[usize]| part.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    numbers.chunks(PER_LINE).map(line).collect::<Vec<_>>().join(",\n") + "\n"
}

/// The input file.
pub(super) fn deck(written: &Written, numbered: &Numbered, dialect: &Dialect) -> String {
    let name = &written.name;
    let element = match written.kind {
        ElementKind::Hex27 => dialect.elements[0],
        ElementKind::Prism21 => dialect.elements[1],
    };
    let mut text: String = written.comments.iter().map(|line| format!("** {line}\n")).collect();
    text += &format!("*HEADING\n{name}\n*NODE, NSET=ALL\n");
    for (n, x) in numbered.nodes() {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{n}, {}", x.map(number).join(", "));
    }
    let _ = writeln!(text, "*ELEMENT, TYPE={element}, ELSET=SPECIMEN");
    for (e, mut nodes) in numbered.elements() {
        nodes.insert(0, e);
        text += &lines_of(&nodes);
    }
    let held = numbered.held(&written.driven);
    for set in &held {
        let _ = write!(text, "*NSET, NSET={}\n{}", set.name, lines_of(&set.nodes));
    }
    text += &keyword_material(&written.material, name);
    let _ = write!(text, "*SOLID SECTION, ELSET=SPECIMEN, MATERIAL={name}\n*BOUNDARY\n");
    for set in &held {
        for component in (0..3).filter(|&c| set.is_zero[c]).map(|c| c + 1) {
            let _ = writeln!(text, "{}, {component}, {component}", set.name);
        }
    }
    for drive in written.drives_mm {
        let _ = write!(text, "*STEP, NLGEOM, INC=1000\n*STATIC\n0.25, 1.0, 1.0e-5, 0.5\n*BOUNDARY\n");
        for driven in &written.driven {
            let n = driven.component + 1;
            let _ = writeln!(text, "{MOVED}, {n}, {n}, {}", number(drive * driven.per_mm + driven.beside_mm));
        }
        let _ = writeln!(text, "{}*END STEP", dialect.output);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::lines_of;

    #[test]
    fn lines_hold_sixteen_numbers() {
        let text = lines_of(&(1..=21).collect::<Vec<_>>());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2);
        assert!(lines[0].ends_with("16,") && lines[1] == "17, 18, 19, 20, 21");
    }
}
