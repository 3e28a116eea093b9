//! The bounds of what a file of a specimen may hold, whatever the rest of it says.

/// The schema that this version reads and writes.
pub const SCHEMA: &str = "specimen/1";
/// Smallest extent of a block, mm.
pub const MIN_SIZE_MM: f64 = 0.2;
/// Largest extent of a block, mm.
pub const MAX_SIZE_MM: f64 = 1000.0;
/// Smallest diameter of a hole, mm.
pub const MIN_DIAMETER_MM: f64 = 0.1;
/// Largest diameter of a hole, mm.
pub const MAX_DIAMETER_MM: f64 = MAX_SIZE_MM;
/// Smallest radius of a dumb-bell's arcs, mm.
pub const MIN_FILLET_MM: f64 = 0.1;
/// Most holes.
pub const MAX_HOLES: usize = 64;
/// Most samples that share a load cell.
pub const MAX_SAMPLES_IN_PARALLEL: u32 = 64;
/// Most kinds of samples beside the first one: each is a model of its own.
pub const MAX_OTHER_SAMPLES: usize = 7;
/// Longest name, characters.
pub const MAX_NAME_LENGTH: usize = 200;
