//! The exchange formats as the OpenAPI document shows them. The library's own types read them; these only describe.
//! A test reads every example with the library's types.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How the specimen is held and moved.
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum TestSchema {
    /// Faces y = ±thickness/2 bonded to plates.
    DoubleLapShear,
    /// Faces x = ±length/2 bonded to grips.
    Uniaxial,
}

/// Direction of a hole.
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AxisSchema {
    /// Along y, centred at (x, z).
    Thickness,
    /// Along z, centred at (x, y).
    Width,
}

/// Outline in the (x, z) section.
#[derive(Serialize, Deserialize, ToSchema)]
pub enum OutlineSchema {
    /// The plain block.
    #[serde(rename = "block")]
    Block,
    /// ISO 37 type 4 dumb-bell.
    #[serde(rename = "iso37_type4")]
    Iso37Type4,
}

/// The bounding block.
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BlockSchema {
    /// Extent along x, mm.
    #[schema(minimum = 0.2, maximum = 1000.0)]
    pub length_mm: f64,
    /// Extent along y, mm.
    #[schema(minimum = 0.2, maximum = 1000.0)]
    pub thickness_mm: f64,
    /// Extent along z, mm.
    #[schema(minimum = 0.2, maximum = 1000.0)]
    pub width_mm: f64,
}

/// A circular hole through the whole block.
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct HoleSchema {
    /// Direction of the axis.
    pub axis: AxisSchema,
    /// Centre, mm.
    #[schema(min_items = 2, max_items = 2)]
    pub center_mm: [f64; 2],
    /// Diameter, mm.
    #[schema(minimum = 0.1, maximum = 1000.0)]
    pub diameter_mm: f64,
}

/// A specimen (`specimen/1`).
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SpecimenSchema {
    /// Always `specimen/1`.
    #[schema(pattern = "^specimen/1$")]
    pub schema: String,
    /// Free name.
    #[schema(max_length = 200)]
    pub name: String,
    /// How it is held and moved.
    pub test: TestSchema,
    /// Bounding block.
    pub block: BlockSchema,
    /// Outline; `block` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub outline: Option<OutlineSchema>,
    /// Holes, all with one axis.
    #[serde(default)]
    #[schema(max_items = 64)]
    pub holes: Vec<HoleSchema>,
    /// Drives, mm, increasing.
    #[schema(min_items = 1, max_items = 1000)]
    pub drive_mm: Vec<f64>,
    /// Samples that share the load cell.
    #[serde(default)]
    #[schema(minimum = 1, maximum = 64)]
    pub samples_in_parallel: u32,
}

/// A term of the strain energy.
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TermSchema {
    /// μ, kPa.
    pub mu_kpa: f64,
    /// α.
    pub alpha: f64,
}

/// An Ogden material (`ogden/1`).
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialSchema {
    /// Always `ogden/1`.
    #[schema(pattern = "^ogden/1$")]
    pub schema: String,
    /// κ, kPa.
    #[schema(exclusive_minimum = 0.0)]
    pub bulk_kpa: f64,
    /// Terms.
    #[schema(min_items = 1)]
    pub terms: Vec<TermSchema>,
}

/// The scan: grid and noise.
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ScanSchema {
    /// Edges of a voxel, mm.
    #[schema(min_items = 3, max_items = 3)]
    pub voxel_mm: [f64; 3],
    /// Standard deviation of a voxel's displacement, mm.
    #[schema(min_items = 3, max_items = 3)]
    pub noise_sd_mm: [f64; 3],
    /// Standard deviation of the force, N.
    #[schema(exclusive_minimum = 0.0)]
    pub force_sd_n: f64,
    /// Weight of partly filled voxels: `uniform` or `signal`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(pattern = "^(uniform|signal)$", nullable = false)]
    pub partial_voxels: Option<String>,
}

/// A material prior of a study.
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PriorSchema {
    /// Name in results.
    pub name: String,
    /// Central values.
    pub material: MaterialSchema,
    /// Relative standard deviation of the prior.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 0.5)]
    pub relative_sd: f64,
    /// Weight in averages over materials.
    #[serde(default)]
    #[schema(exclusive_minimum = 0.0)]
    pub weight: f64,
}

/// A study (`study/1`), with specimen and materials spelled out.
#[derive(Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StudySchema {
    /// Always `study/1`.
    #[schema(pattern = "^study/1$")]
    pub schema: String,
    /// Free name.
    #[schema(max_length = 200)]
    pub name: String,
    /// What designs are compared with.
    pub base: SpecimenSchema,
    /// Material priors; the first is the main one.
    #[schema(min_items = 1)]
    pub materials: Vec<PriorSchema>,
    /// The scan.
    pub scan: ScanSchema,
    /// What may vary: tests, hole_count, axes, drive_mm, length_mm, thickness_mm, width_mm.
    #[schema(value_type = Object)]
    pub vary: serde_json::Value,
    /// What can be made and measured.
    #[schema(value_type = Object)]
    pub limits: serde_json::Value,
    /// What is sought: kind, combine, guard_promised_sd.
    #[serde(default)]
    #[schema(value_type = Object)]
    pub objective: serde_json::Value,
    /// How hard: explore, refine, iterations, confirm.
    #[serde(default)]
    #[schema(value_type = Object)]
    pub budget: serde_json::Value,
    /// The proof: is_on, draws.
    #[serde(default)]
    #[schema(value_type = Object)]
    pub verification: serde_json::Value,
    /// Seed of everything random.
    #[serde(default)]
    pub seed: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shipped_files_fit() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/geometries");
        let mut count = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "json") {
                let _: SpecimenSchema = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
                count += 1;
            }
        }
        assert!(count >= 4);
        let _: MaterialSchema =
            serde_json::from_str(include_str!("../../../geometries/materials/ecoflex-0020.json")).unwrap();
    }
}
