//! Exports as text.

use crate::job::export_material::Card;
use crate::job::export_model::ExportModelResult;
use crate::report::plain_number;

/// The constants of each card.
pub(in crate::job) fn export_material(name: &str, cards: &[Card]) -> String {
    let mut text = format!("{name}\n");
    for card in cards {
        text += &format!("\n{}: {}\n", card.program, card.volumetric_law.meaning());
        for c in &card.constants {
            let unit = if c.unit == "1" { "" } else { c.unit.as_str() };
            text += &format!("  {:<8} {:>14} {unit}\n", c.name, plain_number(c.value, 6));
        }
    }
    text
}

/// The mesh, and what reactions are multiplied by.
pub(in crate::job) fn export_model(result: &ExportModelResult) -> String {
    let files: Vec<&str> = result.files.iter().map(|f| f.file).collect();
    format!(
        "{}: {} elements; forces of the whole test are reactions times {}\n{}\n",
        result.name,
        result.num_elements,
        result.reaction_multiplier,
        files.join("\n")
    )
}
