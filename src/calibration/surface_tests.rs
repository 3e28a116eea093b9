//! Displacements of a face, as cameras measure them, are observations like voxels: fits find the truth, by the standard
//! deviations that were promised.

use super::test_problem::{block, coarse, scan, truth};
use super::*;
use crate::fem::SolveOptions;
use crate::recording::Filter;
use crate::sensitivity::{Protocol, ScanSettings};
use crate::voxel::{Face, MeasuredComponents, Surface};

fn seen(face: Face, components: MeasuredComponents) -> ScanSettings {
    let surface = Some(Surface { face, components });
    // An edge along the normal of a micrometre: it must not matter.
    ScanSettings { voxel_mm: [0.5, 0.5, 1e-3], noise_sd_mm: [0.01, 0.01, 0.01], surface, ..scan() }
}

/// Noisy recordings of the sheared block's side face by one camera, fitted on the mesh that made them: they scatter as
/// promised, and χ² per datum is that of two components.
#[test]
fn what_is_promised_of_a_face_is_found() {
    let (specimen, n) = (block(), 24);
    let options = VerifyOptions {
        truth_mesh: coarse(&specimen),
        fit_mesh: coarse(&specimen),
        correction_mesh: None,
        protocol: Protocol::default(),
        draws: n,
        seed: 5,
        fit: FitOptions::default(),
    };
    let scan = seen(Face::PlusZ, MeasuredComponents::InPlane);
    let report = verify_in_full(&specimen, &truth(), &scan, &options, &|| (), &|| false).unwrap();
    let degrees = (n - 1) as f64;
    for s in &report.spreads {
        let promised = s.promised_sd.unwrap();
        assert_eq!((s.draws, s.failed_draws, s.limited_draws), (n, 0, 0));
        // s²/σ² is χ² over its degrees of freedom, whose standard deviation is √(2/f): 3.5 of them, 99.95 %. Of κ,
        // known to some tens of percent, the estimate is not quite linear in the noise: a tenth more.
        let ratio = (s.found_sd / promised).powi(2);
        assert!((ratio - 1.0).abs() < 3.5 * (2.0 / degrees).sqrt() + 0.1, "{}: {ratio}", s.parameter);
        let shift = (s.mean - s.truth) / promised * (n as f64).sqrt();
        assert!(shift.abs() < 3.5, "{}: {shift}", s.parameter);
        assert!(s.discretisation_bias.unwrap().abs() < 0.03 * promised, "the fit's tolerance alone");
    }
    // 24 × 8 subsets of two components, and a force: √(2/N) of each of n draws.
    let num_data = 2.0 * 24.0 * 8.0 + 1.0;
    let mean = report.fits.iter().map(|f| f.as_ref().unwrap().chi2_per_datum).sum::<f64>() / n as f64;
    assert!((mean - 1.0).abs() < 3.5 * (2.0 / (num_data * n as f64)).sqrt(), "{mean}");
}

/// The noise of a recording that does not state it is estimated in the components that are measured.
#[test]
fn the_noise_of_a_face_is_estimated() {
    let scan = seen(Face::PlusZ, MeasuredComponents::InPlane);
    let (specimen, solve) = (block(), SolveOptions::default());
    let (mesh, plain) = (coarse(&specimen), Protocol::default());
    let made = SyntheticScan::new(&specimen, &truth(), &scan, &plain, &mesh, &solve, &|| false).unwrap();
    let mut recording = made.recording("face", &specimen, &made.draw(3, 0), Filter::None).unwrap();
    recording.noise_sd_mm = None;
    let [x, y, z] = Observed::new(&recording, 0.01).unwrap().noise_sd_mm;
    // The median of about 170 correlated differences: 10 %; and what is not quadratic near the bonds.
    assert!((x / 0.01 - 1.0).abs() < 0.3 && (y / 0.01 - 1.0).abs() < 0.3, "{x} {y}");
    assert_eq!(z, f64::INFINITY);
}
