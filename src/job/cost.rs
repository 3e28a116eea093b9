//! What a job will take, before it runs: estimates to decide by.
//!
//! All are counted in equilibria: what one drive of an evaluation takes ([`seconds_per_drive`]) on the job's mesh,
//! times how many of them the job's kind needs. How many that is was measured with the release profile on one thread:
//! the processor seconds of a whole job over those of one equilibrium at each of its drives.

use super::request::RecordingOutline;
use crate::mesh::{CoarserMeshes, MeshOptions, mesh_specimen};
use crate::specimen::Specimen;
use crate::voxel::{Surface, VoxelGrid};

/// Equilibria per recorded drive of a calibration with one term: 3.5 to 9 on scans at two drives of the shipped solid
/// and two-hole blocks, at the standard element size and twice that.
const FIRST_TERM: f64 = 5.5;
/// The same of every start of a further term (two terms: 7 to 25 in all).
const START_OF_A_TERM: f64 = 2.2;
/// Terms tried where a rule decides their number (7 to 45 equilibria in all).
const TERMS_OF_A_RULE: usize = 3;
/// The same of each parameter's profile (2.7 on the two-hole block at three drives).
const PROFILE: f64 = 2.7;
/// The same of the contours of the losses (12 there).
const CONTOURS: f64 = 12.0;
/// The same of a diagnosis: 28 and 52 on those blocks, where nothing was wrong; about 140 with two to four causes at
/// once.
const DIAGNOSIS: f64 = 60.0;

/// Processor seconds of one drive of an evaluation with a material of one term. From the release build on one thread of
/// the development machine: eight evaluations of the shipped specimens (1,393 to 11,687 nodes, 2,000 to 21,000
/// voxels; 0.15 s to 2.5 s a drive) give 2.28 s at 10,000 nodes with the power 1.4, each within a factor of 2.3; voxels
/// eight times as many cost 2 µs each. Material terms and other machines change it: an estimate to decide by, not a
/// promise.
pub fn seconds_per_drive(num_nodes: usize, num_voxels: usize) -> f64 {
    2.28 * (num_nodes as f64 / 1e4).powf(1.4) + 2e-6 * num_voxels as f64
}

/// Processor seconds of `num_drives` drives of all samples of a specimen on a mesh, each seen by a scan with these
/// voxels, of the volume or of a surface, where there is one; none where a sample cannot be meshed or the scan has no
/// grid. Meshes once.
pub(super) fn seconds(
    specimen: &Specimen,
    mesh: &MeshOptions,
    scan: Option<([f64; 3], Option<Surface>)>,
    num_drives: usize,
) -> Option<f64> {
    let of_sample = |sample: &Specimen| {
        let num_nodes = mesh_specimen(sample, &mesh.carried(specimen, sample)).ok()?.nodes.len();
        let num_voxels = match scan {
            Some((voxel_mm, surface)) => VoxelGrid::planned(sample, voxel_mm, surface).ok()?.num_voxels(),
            None => 0,
        };
        Some(seconds_per_drive(num_nodes, num_voxels) * num_drives as f64)
    };
    specimen.samples().iter().map(of_sample).sum()
}

/// The same on the coarser meshes that say what `mesh` may put the results wrong by; nothing where a sample cannot be
/// meshed so coarsely.
pub(super) fn of_coarser_meshes(
    specimen: &Specimen,
    mesh: &MeshOptions,
    scan: Option<([f64; 3], Option<Surface>)>,
    num_drives: usize,
) -> f64 {
    let meshes = CoarserMeshes::of(mesh, specimen).into_iter().flat_map(|coarser| coarser.options);
    meshes.filter_map(|mesh| seconds(specimen, &mesh, scan, num_drives)).sum()
}

/// Processor seconds of `count` tasks, of which `of` estimates one by its index: from the first, the middle and the
/// last.
pub(super) fn of_many(count: usize, of: impl Fn(usize) -> Option<f64>) -> Option<f64> {
    let found: Vec<f64> = [0, count / 2, count.checked_sub(1)?].into_iter().filter_map(of).collect();
    (!found.is_empty()).then(|| count as f64 * found.iter().sum::<f64>() / found.len() as f64)
}

/// Processor seconds of one equilibrium at every drive of every recording; none where there is no recording, or its
/// specimen cannot be meshed.
fn of_equilibria(recordings: &[RecordingOutline], mesh_factor: f64) -> Option<f64> {
    let of = |r: &RecordingOutline| {
        let mesh = mesh_specimen(&r.specimen, &MeshOptions::scaled(&r.specimen, mesh_factor)).ok()?;
        Some(seconds_per_drive(mesh.nodes.len(), r.num_voxels) * r.num_drives as f64)
    };
    let each: Vec<f64> = recordings.iter().map(of).collect::<Option<_>>()?;
    (!each.is_empty()).then(|| each.iter().sum())
}

/// How much a calibration is asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct CalibrationEffort {
    /// Number of terms; decided by a rule where it is left out.
    pub num_terms: Option<usize>,
    /// Starts of every further term.
    pub num_starts: usize,
    /// Whether there are profiles of all parameters.
    pub has_profiles: bool,
    /// Whether there are contours.
    pub has_contours: bool,
}

/// Processor seconds of a calibration on recordings.
pub(super) fn of_calibration(
    recordings: &[RecordingOutline],
    mesh_factor: f64,
    effort: CalibrationEffort,
) -> Option<f64> {
    let num_terms = effort.num_terms.unwrap_or(TERMS_OF_A_RULE);
    let further = START_OF_A_TERM * (num_terms.saturating_sub(1) * effort.num_starts) as f64;
    // Each term has two parameters, and the bulk modulus is one.
    let profiles = if effort.has_profiles { PROFILE * (1 + 2 * num_terms) as f64 } else { 0.0 };
    let contours = if effort.has_contours { CONTOURS } else { 0.0 };
    Some(of_equilibria(recordings, mesh_factor)? * (FIRST_TERM + further + profiles + contours))
}

/// Processor seconds of a diagnosis of each of the recordings.
pub(super) fn of_diagnosis(recordings: &[RecordingOutline], mesh_factor: f64) -> Option<f64> {
    Some(of_equilibria(recordings, mesh_factor)? * DIAGNOSIS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline(num_drives: usize) -> RecordingOutline {
        let specimen = super::super::defaults::two_hole_shear();
        RecordingOutline { specimen, num_voxels: 1000, num_drives }
    }

    #[test]
    fn more_of_anything_costs_more() {
        let plain = CalibrationEffort { num_terms: Some(1), num_starts: 3, has_profiles: false, has_contours: false };
        let of = |recordings: &[RecordingOutline], mesh_factor: f64, effort| {
            of_calibration(recordings, mesh_factor, effort).expect("an estimate")
        };
        let one = of(&[outline(2)], 2.0, plain);
        assert!((of(&[outline(4)], 2.0, plain) / one - 2.0).abs() < 1e-12, "in proportion to the drives");
        assert!((of(&[outline(2), outline(2)], 2.0, plain) / one - 2.0).abs() < 1e-12, "and to the recordings");
        assert!(of(&[outline(2)], 1.0, plain) > one);
        for effort in [
            CalibrationEffort { num_terms: Some(2), ..plain },
            CalibrationEffort { num_terms: None, ..plain },
            CalibrationEffort { has_profiles: true, ..plain },
            CalibrationEffort { has_contours: true, ..plain },
        ] {
            assert!(of(&[outline(2)], 2.0, effort) > one, "{effort:?}");
        }
        assert!(of_diagnosis(&[outline(2)], 2.0).expect("an estimate") > one);
        assert_eq!(of_calibration(&[], 2.0, plain), None, "of nothing, nothing is known");
    }
}
