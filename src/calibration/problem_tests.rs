use super::super::test_problem::{block, coarse, tight, truth};
use super::*;
use crate::acquisition::{LoadProgram, ReconstructOptions, ScanOptions, reconstruct, scan};
use crate::specimen::{Block, Sample};

/// Two unlike blocks of one test, each with a recording of its own: fitted together they give the material, the force
/// of both being in the first recording. Without the second block's part of it the modulus is far off.
#[test]
fn unlike_blocks_share_the_force_of_their_recordings() {
    let other = Sample { block: Block { thickness_mm: 5.5, ..block().block }, holes: Vec::new() };
    let specimen = Specimen { samples_in_parallel: 1, other_samples: vec![other], drive_mm: vec![3.0], ..block() };
    let recorded = |index: usize| {
        let options = ScanOptions {
            grid: ScanOptions::grid_around(&specimen.samples()[index], [1.0, 0.5, 1.0], 2, [0.0; 3]).unwrap(),
            mm_per_radian: [2.0; 3],
            snr: [1e4; 3],
            kspace: None,
            load: LoadProgram::default(),
            seed: 3,
            sample: index,
        };
        let mesh = coarse(&specimen);
        let made = scan("r", &specimen, &truth(), &mesh, &tight().solve, &options, &|| false).unwrap();
        let found = reconstruct(&made.raw, &ReconstructOptions::default()).unwrap();
        (Observed::new(&found.recording, 0.01).unwrap(), made.forces_n[0])
    };
    let [(first, force_n), (second, same_n)] = [0, 1].map(recorded);
    assert!((force_n / same_n - 1.0).abs() < 1e-9, "both are the force of both blocks: {force_n} {same_n}");
    assert_eq!((first.num_forces(), second.num_forces()), (1, 0));
    assert_eq!(second.specimen.block.thickness_mm, 5.5);
    let fitted = |observed: &[Observed]| {
        let mesh = |s: &Specimen| coarse(&specimen).carried(&specimen, s);
        let mut problem = CalibrationProblem::new(observed, &mesh, Objective::Weighted).unwrap();
        let mut start = truth();
        start.terms[0].mu_kpa *= 1.3;
        start.terms[0].alpha *= 0.8;
        problem.fit(&start, None, &tight(), &|| false).unwrap()
    };
    let both = fitted(&[first.clone(), second]);
    // The force of all samples is what is predicted, and not that of the recorded one.
    assert!((both.force_n(0, 0) / force_n - 1.0).abs() < 0.02, "{} {force_n}", both.force_n(0, 0));
    let both = both.material;
    let mut alone = first;
    alone.specimen.other_samples.clear();
    let wrong = fitted(&[alone]).material;
    let modulus = truth().initial_shear_modulus_kpa();
    // The phase of a voxel's mean signal is not the phase of its mean displacement: 10⁻³ of a voxel in bent fields.
    assert!((both.initial_shear_modulus_kpa() / modulus - 1.0).abs() < 0.02, "{both:?}");
    assert!((both.terms[0].alpha / truth().terms[0].alpha - 1.0).abs() < 0.05, "{both:?}");
    assert!(wrong.initial_shear_modulus_kpa() / modulus > 1.5, "{wrong:?}");
}
