//! The specimen, and a mould for it, as exact solids in STEP files (ISO 10303-21, AP214), for CAD programs.
//!
//! Walls of holes and arcs are cylinders; walls of ellipses are ellipses extruded. The bonded faces of a wedge are
//! planes that slant, and cut the walls in ellipses. Nothing is approximated.

use super::section_loop::{inner_loops, outline, rectangle};
use super::solid::{Level, Sense, Solid, SolidBuilder};
use super::step_file::step_file;
use super::{Specimen, SpecimenError};

/// Thickness of a mould's walls and of its floor, mm.
pub const MOULD_WALL_MM: f64 = 8.0;

/// The specimen as a STEP file, mm, in the specimen's frame.
///
/// ```
/// use lambdak::specimen::{Specimen, to_step};
///
/// let specimen = Specimen::from_json(&std::fs::read_to_string("geometries/two-hole-shear.json")?)?;
/// assert!(to_step(&specimen)?.starts_with("ISO-10303-21;"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`SpecimenError`] where the specimen is invalid.
pub fn to_step(specimen: &Specimen) -> Result<String, SpecimenError> {
    specimen.validate()?;
    Ok(step_file(&specimen.name, &specimen_solid(specimen)))
}

/// An open mould for the specimen as a STEP file, mm, in the specimen's frame: a box whose cavity is the specimen, with
/// a pin where it has a hole.
///
/// Walls and floor are [`MOULD_WALL_MM`] thick. The cavity is open at one end of the extrusion (−y for holes along the
/// thickness, +z for holes along the width), and the pins end level with the box: what is poured in is struck off
/// there. There is no draft and no allowance for shrinkage. The floor under a wedge and the rim slant as its faces do,
/// over a bottom that is level.
///
/// # Errors
/// [`SpecimenError`] where the specimen is invalid.
pub fn mould_to_step(specimen: &Specimen) -> Result<String, SpecimenError> {
    specimen.validate()?;
    Ok(step_file(&format!("mould of {}", specimen.name), &mould_solid(specimen)))
}

/// The two ends of the extrusion.
fn ends(specimen: &Specimen) -> [Level; 2] {
    let half_mm = 0.5 * specimen.extrusion_mm();
    let slope_per_mm = specimen.block.taper().slope_per_mm();
    [-1.0, 1.0].map(|side| Level { middle_mm: side * half_mm, slope: side * half_mm * slope_per_mm })
}

fn specimen_solid(specimen: &Specimen) -> Solid {
    let mut loops = vec![outline(specimen)];
    loops.extend(inner_loops(specimen));
    let count = loops.len();
    let mut builder = SolidBuilder::new(specimen.extrusion_axis(), loops, ends(specimen).to_vec());
    builder.wall(0, [0, 1], Sense::Forward);
    (1..count).for_each(|hole| builder.wall(hole, [0, 1], Sense::Backward));
    let top: Vec<(usize, Sense)> = outer_and_inner(0, 1..count, Sense::Forward);
    let bottom: Vec<(usize, Sense)> = outer_and_inner(0, 1..count, Sense::Backward);
    builder.cap(&bottom, 0, Sense::Backward);
    builder.cap(&top, 1, Sense::Forward);
    builder.finish()
}

fn mould_solid(specimen: &Specimen) -> Solid {
    let outside = rectangle(specimen.section_size().map(|extent| extent + 2.0 * MOULD_WALL_MM));
    let mut loops = vec![outside, outline(specimen)];
    loops.extend(inner_loops(specimen));
    let count = loops.len();
    // Levels: below the floor, the cavity's floor, the rim.
    let [floor, rim] = ends(specimen);
    // Under all of the floor, that of the box's walls too.
    let deepest_mm = floor.slope.abs() * (0.5 * specimen.block.length_mm + MOULD_WALL_MM);
    let levels = vec![Level::straight(floor.middle_mm - deepest_mm - MOULD_WALL_MM), floor, rim];
    let mut builder = SolidBuilder::new(specimen.extrusion_axis(), loops, levels);
    builder.wall(0, [0, 2], Sense::Forward);
    builder.wall(1, [1, 2], Sense::Backward);
    builder.cap(&[(0, Sense::Backward)], 0, Sense::Backward);
    builder.cap(&outer_and_inner(1, 2..count, Sense::Forward), 1, Sense::Forward);
    builder.cap(&outer_and_inner(0, 1..2, Sense::Forward), 2, Sense::Forward);
    for pin in 2..count {
        builder.wall(pin, [1, 2], Sense::Forward);
        builder.cap(&[(pin, Sense::Forward)], 2, Sense::Forward);
    }
    builder.finish()
}

/// The bounds of a plane face seen from above: the outer one in this sense, those inside of it in the other.
fn outer_and_inner(outer: usize, inner: std::ops::Range<usize>, sense: Sense) -> Vec<(usize, Sense)> {
    let other = if sense == Sense::Forward { Sense::Backward } else { Sense::Forward };
    std::iter::once((outer, sense)).chain(inner.map(|loop_index| (loop_index, other))).collect()
}

#[cfg(test)]
#[path = "drawing_step_tests.rs"]
mod tests;
