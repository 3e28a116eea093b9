use super::super::observed_forces::read_on_the_way;
use super::super::test_problem::{block, coarse, scan, tight, truth};
use super::super::{SyntheticScan, VerifyOptions, verify};
use super::*;
use crate::calibration::Observed;
use crate::recording::{Filter, LoadCurve};
use crate::sensitivity::{DriveSelection, EvaluationOptions, evaluate};

fn protocol() -> Protocol {
    Protocol { force_drive_mm: vec![1.0, 2.5], force_gain_sd: 0.02, force_zero_sd_n: 0.03, ..Protocol::default() }
}

/// What is promised of a fit whose forces are weighed by their covariance is what an evaluation promises that estimates
/// gain and zero beside the material: two derivations of one thing.
#[test]
fn a_fit_promises_what_an_evaluation_does() {
    let (specimen, mesh) = (block(), coarse(&block()));
    let fit = tight();
    let options = VerifyOptions {
        truth_mesh: mesh,
        fit_mesh: mesh,
        correction_mesh: None,
        protocol: protocol(),
        draws: 0,
        seed: 1,
        fit,
    };
    let spreads = verify(&specimen, &truth(), &scan(), &options, &|| (), &|| false).unwrap();
    let evaluation =
        EvaluationOptions { mesh, solve: fit.solve, protocol: protocol(), ..EvaluationOptions::standard(&specimen) };
    let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
    let (found, _) = evaluate(&specimen, &truth(), &scan(), &drives, &evaluation, &|| false).unwrap();
    for (spread, promised) in spreads.iter().zip(&found.promised_sd) {
        let (ours, theirs) = (spread.promised_sd.unwrap(), promised.value.unwrap());
        // Equilibria to 10⁻¹¹ and rounding of sums over voxels.
        assert!((ours / theirs - 1.0).abs() < 1e-6, "{}: {ours} {theirs}", spread.parameter);
    }
    // Displacements do not tell how stiff the sample is: the modulus is known no better than the cell's gain.
    let (modulus, cell) = (&spreads[1], protocol());
    assert!(modulus.promised_sd.unwrap() > 0.99 * cell.force_gain_sd * modulus.truth);
    let perfect = Protocol { force_gain_sd: 0.0, ..cell };
    let known =
        verify(&specimen, &truth(), &scan(), &VerifyOptions { protocol: perfect, ..options }, &|| (), &|| false);
    assert!(known.unwrap()[1].promised_sd.unwrap() < modulus.promised_sd.unwrap());
}

/// Scatter and mean of fits to draws, each with a gain and a zero of its own, are the promised ones.
#[test]
fn fits_scatter_as_promised() {
    let (specimen, mesh, draws) = (block(), coarse(&block()), 32usize);
    let options = VerifyOptions { protocol: protocol(), draws, ..VerifyOptions::new(&specimen, draws, 5) };
    let options = VerifyOptions { truth_mesh: mesh, fit_mesh: mesh, correction_mesh: None, ..options };
    for s in verify(&specimen, &truth(), &scan(), &options, &|| (), &|| false).unwrap() {
        let promised = s.promised_sd.unwrap();
        let ratio = s.found_sd / promised;
        // 99.9 % of s/σ of 32 draws lie between 0.62 and 1.42 (χ² with 31 degrees of freedom).
        assert!(ratio > 0.62 && ratio < 1.42, "{}: {ratio}", s.parameter);
        let shift = (s.mean - s.truth) / promised * (draws as f64).sqrt();
        assert!(shift.abs() < 3.5, "{}: {shift}", s.parameter);
    }
}

/// Readings come from the load curve, where it first passes the drive; scanned drives are not read twice, and what the
/// curve does not hold is an error that says so.
#[test]
fn forces_are_read_from_the_load_curve() {
    let synthetic = {
        let (mesh, solve) = (coarse(&block()), tight().solve);
        SyntheticScan::new(&block(), &truth(), &scan(), &protocol(), &mesh, &solve, &|| false).unwrap()
    };
    let data = synthetic.noiseless();
    let mut recording = synthetic.recording("r", &block(), data, Filter::None).unwrap();
    let observed = Observed::new(&recording, 0.5).unwrap().with_protocol(&recording, &protocol(), 0.5).unwrap();
    for (read, made) in observed.on_the_way.iter().zip(&data.on_the_way) {
        assert!((read.force.value_n - made.force.value_n).abs() < 1e-12 * made.force.value_n);
        assert_eq!((read.drive_mm, read.force.sd_n), (made.drive_mm, made.force.sd_n));
    }
    assert_eq!(observed.on_the_way.len(), 2);
    // Rest, 2 mm, back to 1 mm and on: 1.5 mm is first passed between the first two readings.
    recording.load = Some(LoadCurve {
        time_s: vec![0.0, 1.0, 2.0, 3.0],
        drive_mm: vec![0.0, 2.0, 1.0, 4.0],
        force_n: vec![0.0, 8.0, 3.0, 20.0],
    });
    let at = |drive_mm: f64| {
        let asked = Protocol { force_drive_mm: vec![drive_mm, 4.0], ..Protocol::default() };
        read_on_the_way(&recording, &asked, 0.5).collect::<Result<Vec<_>, _>>()
    };
    let read = at(1.5).unwrap();
    assert_eq!((read.len(), read[0].force.value_n), (1, 6.0));
    // Of several, those that are there.
    let asked = Protocol { force_drive_mm: vec![1.5, 2.5], ..protocol() };
    recording.load.as_mut().unwrap().drive_mm[3] = 2.2;
    let (found, missing) = Observed::new(&recording, 0.5).unwrap().with_readings_found(&recording, &asked, 0.5);
    assert_eq!(found.on_the_way.iter().map(|r| r.drive_mm).collect::<Vec<_>>(), [1.5]);
    assert_eq!(found.load_cell, LoadCell::of_protocol(&asked));
    assert!(missing.len() == 1 && missing[0].to_string().contains("2.5 mm"), "{missing:?}");
    recording.load = None;
    let error = read_on_the_way(&recording, &protocol(), 0.5).next().unwrap().unwrap_err();
    assert!(error.to_string().contains("1 mm") && error.to_string().contains("no load curve"), "{error}");
}
