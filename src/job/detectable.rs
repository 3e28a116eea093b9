//! What a diagnosis of an evaluated scan would find.

use super::{Context, JobError, cost};
use crate::diagnosis::{DiagnosisError, DiagnosisOptions, PlannedScan, detectable};
use crate::field::FieldError;
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::sensitivity::{DetectableSize, Evaluation, Protocol, ScanSettings};
use crate::specimen::Specimen;
use crate::voxel::VoxelGrid;

/// Most voxels of all drives: the changes with some seventy parameters of causes are held at once, each of 24 bytes a
/// voxel, in two forms.
const MAX_VALUES: usize = 300_000;
/// Equilibria on the diagnosis' mesh that one drive takes, its derivatives with all causes included.
const EQUILIBRIA: f64 = 4.0;

/// Whether what would be found can be told of a scan.
pub(super) fn check_detectable(
    specimen: &Specimen,
    scan: &ScanSettings,
    protocol: &Protocol,
    num_drives: usize,
) -> Result<(), FieldError> {
    let refused = |allowed: &str| FieldError::new("/has_detectable", true, allowed);
    scan.needs_volume("a diagnosis, whose errors are told, is of scans of the volume: leave out has_detectable")
        .and_then(|()| {
            scan.needs_even_noise("what a diagnosis would find is told of even noise: leave out one of the two")
        })
        .map_err(|e| e.below("/scan"))?;
    if !specimen.other_samples.is_empty() || protocol.blocks_scanned > 1 {
        let allowed = "false where the specimen has other_samples or several blocks are scanned";
        return Err(refused(allowed).remedy("a diagnosis is of one block alone: evaluate that one by itself"));
    }
    if !specimen.is_driven_along_x() {
        let remedy = "a diagnosis is of drives along x alone; leave out drive_angle_deg";
        return Err(refused("false where the specimen has a drive_angle_deg").remedy(remedy));
    }
    if !specimen.block.taper().is_even() {
        let remedy = "a diagnosis is of blocks of even thickness alone; set block.wedge_mm to 0";
        return Err(refused("false where the specimen is a wedge").remedy(remedy));
    }
    let num_voxels = VoxelGrid::covering(specimen, scan.voxel_mm).map_or(0, |grid| grid.num_voxels());
    if num_voxels * num_drives > MAX_VALUES {
        let allowed = format!("false above {MAX_VALUES} voxels of all drives together");
        let remedy = format!("there are {num_voxels} voxels at {num_drives} drives; use larger voxels or fewer drives");
        return Err(refused(&allowed).remedy(remedy));
    }
    Ok(())
}

/// Processor seconds of what would be found; none where the specimen cannot be meshed.
pub(super) fn detection_seconds(specimen: &Specimen, scan: &ScanSettings, num_drives: usize) -> Option<f64> {
    let factor = DiagnosisOptions::default().mesh_factor;
    let mesh = MeshOptions { use_mirror: false, ..MeshOptions::scaled(specimen, factor) };
    Some(EQUILIBRIA * cost::seconds(specimen, &mesh, Some((scan.voxel_mm, scan.surface)), num_drives)?)
}

/// The smallest errors that a diagnosis of an evaluated scan would name, by its default settings.
///
/// # Errors
/// [`JobError`]: the whole sample cannot be meshed or has no equilibrium, or the work was cancelled.
pub(super) fn detectable_sizes(
    specimen: &Specimen,
    material: &Material,
    protocol: &Protocol,
    evaluation: &Evaluation,
    context: &Context,
) -> Result<Vec<DetectableSize>, JobError> {
    let drives_mm: Vec<f64> = evaluation.steps.iter().map(|s| s.drive_mm).collect();
    let forces_n: Vec<f64> = evaluation.steps.iter().map(|s| s.force_n).collect();
    let planned = PlannedScan {
        specimen,
        scan: &evaluation.scan,
        drives_mm: &drives_mm,
        forces_n: &forces_n,
        time_shares: &protocol.scan_share,
    };
    let found = detectable(&planned, material, &DiagnosisOptions::default(), &|| context.is_cancelled());
    let found = found.map_err(|e| match e {
        DiagnosisError::Solve(_) => context.failed(&e),
        other => FieldError::new("/has_detectable", true, "false for this specimen").remedy(other.to_string()).into(),
    })?;
    Ok(found.iter().map(|d| d.row()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::defaults;

    #[test]
    fn what_is_too_much_is_refused_with_a_remedy() {
        let (specimen, plain) = (defaults::two_hole_shear(), Protocol::default());
        let scan = ScanSettings::default();
        assert_eq!(check_detectable(&specimen, &scan, &plain, 3), Ok(()));
        // 21,250 voxels at each drive.
        let many = check_detectable(&specimen, &scan, &plain, 15).expect_err("too many voxels");
        let both = Protocol { blocks_scanned: 2, ..plain };
        let blocks = check_detectable(&specimen, &scan, &both, 1).expect_err("two blocks");
        assert_eq!([&many.pointer, &blocks.pointer], ["/has_detectable", "/has_detectable"]);
        assert!(detection_seconds(&specimen, &scan, 3) > detection_seconds(&specimen, &scan, 1));
    }
}
