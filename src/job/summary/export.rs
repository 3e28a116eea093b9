//! Exports as text.

use super::num;
use crate::job::export_result::{Card, ExportModelResult};

/// The constants of each card.
pub(in crate::job) fn export_material(name: &str, cards: &[Card]) -> String {
    let mut text = format!("{name}\n");
    for card in cards {
        text += &format!("\n{}\n  volume: {}\n", card.program, card.volumetric_law.meaning());
        for c in &card.constants {
            let unit = if c.unit == "1" { String::new() } else { format!(" {}", c.unit) };
            text += &format!("  {:<8} {:>14}{unit}\n", c.name, num(c.value, 6));
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

/// What is in the files.
pub(in crate::job) fn export_recording(id: &str, shape: [usize; 3], num_drives: usize, files: &[String]) -> String {
    let [nx, ny, nz] = shape;
    format!("{id}: {nx} × {ny} × {nz} voxels at {num_drives} drives\n{}\n", files.join("\n"))
}
