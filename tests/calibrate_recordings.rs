//! Calibration of recordings: the control recording of an independent code, and real MR-u measurements where present.
//!
//! `LAMBDAK_RECORDINGS` is the folder with `open-control`, `LAMBDAK_REAL_DATA` that with `mru/solid-5mm-a` and `-b`.
//! Without them the tests are ignored.

#[path = "common/prerequisites.rs"]
mod prerequisites;

use lambdak::calibration::{
    CalibrateOptions, CalibrationProblem, Objective, Observed, TermCount, calibrate, rms_misfit_mm,
};
use lambdak::mesh::MeshOptions;
use lambdak::recording::{ReadLimits, Recording};
use lambdak::specimen::Specimen;
use prerequisites::Missing;

fn observed(path: &std::path::Path) -> Observed {
    Observed::new(&Recording::read(path, &ReadLimits::default()).unwrap(), 0.02).unwrap()
}

fn mesh(specimen: &Specimen, factor: f64) -> MeshOptions {
    MeshOptions::scaled(specimen, factor)
}

/// κ 2173 kPa, μ₁ 17.0 kPa, α₁ 1.91 made the control; it departs in nothing but its own discretisation.
fn control_is_within_its_intervals() -> Result<(), Missing> {
    let path = prerequisites::recording("open-control")?;
    let data = [observed(&path)];
    let options = CalibrateOptions { mesh_factor: 1.1, num_starts: 2, ..CalibrateOptions::default() };
    let found = calibrate(&data, &mesh, &options, &|_| (), &|| false).unwrap();
    assert_eq!(found.selection.chosen, 1, "one term made the data");
    for (e, truth) in found.estimates.iter().zip([2173.0, 17.0, 1.91]) {
        let [low, high] = e.interval_95.map(|end| end.expect("determined"));
        println!(
            "{}: {:.4}, 95 % {low:.4} to {high:.4} (sd {:.4}, mesh {:.4}, misfit {:.4}), truth {truth}",
            e.parameter.name(),
            e.value,
            e.sd.unwrap(),
            e.mesh_error,
            e.possible_shift
        );
        assert!(low < truth && truth < high);
        // The interval is no excuse: a tenth of the value is the most that it may be off by.
        assert!((e.value / truth - 1.0).abs() < 0.1);
    }
    let (shear, interval) = found.initial_shear_modulus.unwrap();
    let [low, high] = interval.unwrap();
    println!("initial shear modulus {shear:.4}, 95 % {low:.4} to {high:.4}, truth {:.4}", 0.5 * 17.0 * 1.91);
    assert!(low < 0.5 * 17.0 * 1.91 && 0.5 * 17.0 * 1.91 < high);
    Ok(())
}

/// Two real blocks without a force: each is calibrated, and the other's displacements are predicted with its material.
/// The prediction must not be worse than the other's own fit by more than a tenth: the blocks are of one material.
fn real_blocks_predict_one_another() -> Result<(), Missing> {
    let (a, b) = (prerequisites::real_data("mru/solid-5mm-a")?, prerequisites::real_data("mru/solid-5mm-b")?);
    let data = [[observed(&a)], [observed(&b)]];
    let options = CalibrateOptions {
        terms: TermCount::Fixed(1),
        mesh_factor: 1.4,
        has_mesh_allowance: false,
        num_starts: 2,
        ..CalibrateOptions::default()
    };
    let mut materials = Vec::new();
    let mut own = Vec::new();
    for (name, data) in ["a", "b"].iter().zip(&data) {
        let found = calibrate(data, &mesh, &options, &|_| (), &|| false).unwrap();
        let (rms, count) = rms_misfit_mm(found.fit.predicted(0, 0), &data[0].steps[0].displacement);
        println!(
            "block {name}: {count} voxels, misfit {rms:.3?} mm, χ² per datum {:.1}, ℓ_u {:.3e}",
            found.fit.chi2_per_datum, found.fit.loss_u
        );
        for e in &found.estimates {
            println!("  {} {:.4} sd {:?} interval {:?}", e.parameter.name(), e.value, e.sd, e.interval_95);
        }
        assert!(found.initial_shear_modulus.is_none() && found.fit.loss_f.is_none(), "no force, no modulus");
        let held = &found.estimates[1];
        assert!(held.sd.is_none() && !held.is_identifiable, "μ₁ is assumed, not found");
        materials.push(found.fit.material.clone());
        own.push(rms);
    }
    let length = |r: [f64; 3]| r.iter().map(|x| x * x).sum::<f64>().sqrt();
    for (n, (name, data)) in ["a", "b"].iter().zip(&data).enumerate() {
        let problem = CalibrationProblem::new(data, &|s| mesh(s, 1.4), Objective::Weighted).unwrap();
        let predicted = problem.at(&materials[1 - n], &|| false).unwrap();
        let (rms, _) = rms_misfit_mm(predicted.predicted(0, 0), &data[0].steps[0].displacement);
        println!("block {name} predicted from the other: misfit {rms:.3?} mm (own fit {:.3?})", own[n]);
        assert!(length(rms) < 1.1 * length(own[n]));
    }
    Ok(())
}

prerequisites::test_binary!(control_is_within_its_intervals, real_blocks_predict_one_another);
