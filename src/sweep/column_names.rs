//! Names of the table's columns that a variable may not take.

/// Columns before the variables and after them that do not depend on the material.
const FIXED: [&str; 20] = [
    "task",
    "design",
    "material",
    "status",
    "failure_kind",
    "failure_reason",
    "step",
    "step_drive_mm",
    "force_n",
    "normal_force_n",
    "volume_mm3",
    "num_voxels",
    "median_stretch",
    "median_mode",
    "largest_voxel_stretch",
    "largest_principal_stretch",
    "condition_number_all_drives",
    "num_unknowns",
    "evaluation_hash",
    "num_voxels_without_mode",
];

/// Whether a variable may not have this name.
pub(super) fn is_reserved(name: &str) -> bool {
    FIXED.contains(&name)
        || ["sensitivity_", "promised_sd_", "relative_sd_"].iter().any(|prefix| name.starts_with(prefix))
}
