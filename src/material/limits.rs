//! What a material may hold.

/// The schema that this version reads and writes.
pub const SCHEMA: &str = "ogden/1";
/// Smallest |α|. The energy divides by α.
pub const MIN_ALPHA: f64 = 1e-3;
/// Largest |α|. Beyond it λ^α overflows the range of useful stresses within the supported stretches.
pub const MAX_ALPHA: f64 = 50.0;
/// Largest modulus, kPa (1 GPa: far beyond soft matter).
pub const MAX_MODULUS_KPA: f64 = 1e6;
/// The schema of Yeoh's material.
pub const YEOH_SCHEMA: &str = "yeoh/1";
/// The schema of Gent's material.
pub const GENT_SCHEMA: &str = "gent/1";
/// The schema of Arruda and Boyce's material.
pub const ARRUDA_BOYCE_SCHEMA: &str = "arruda_boyce/1";
/// The schema of the neo-Hookean material.
pub const NEO_HOOKEAN_SCHEMA: &str = "neo_hookean/1";
/// The schema of Mooney and Rivlin's material.
pub const MOONEY_RIVLIN_SCHEMA: &str = "mooney_rivlin/1";
/// All schemas of materials.
pub(super) const SCHEMAS: [&str; 6] =
    [SCHEMA, NEO_HOOKEAN_SCHEMA, MOONEY_RIVLIN_SCHEMA, YEOH_SCHEMA, GENT_SCHEMA, ARRUDA_BOYCE_SCHEMA];
/// Smallest J_m of Gent's law: below it the chains are at their end at a stretch of 1.06.
pub const MIN_CHAIN_LIMIT: f64 = 1e-2;
/// Largest J_m. Beyond it the law cannot be told from the neo-Hookean one.
pub const MAX_CHAIN_LIMIT: f64 = 1e6;
/// Smallest λ_m of Arruda and Boyce's law: chains lock at rest.
pub const MIN_LOCKING_STRETCH: f64 = 1.0;
/// Largest λ_m. Beyond it the law cannot be told from the neo-Hookean one.
pub const MAX_LOCKING_STRETCH: f64 = 1e3;
