//! What a material may hold.

/// The schema that this version reads and writes.
pub const SCHEMA: &str = "ogden/1";
/// Smallest |α|. The energy divides by α.
pub const MIN_ALPHA: f64 = 1e-3;
/// Largest |α|. Beyond it λ^α overflows the range of useful stresses within the supported stretches.
pub const MAX_ALPHA: f64 = 50.0;
/// Largest modulus, kPa (1 GPa: far beyond soft matter).
pub const MAX_MODULUS_KPA: f64 = 1e6;
