use super::unwrap::wrapped;
use super::*;
use crate::fem::SolveOptions;
use crate::material::Material;
use crate::mesh::{MeshOptions, mesh_specimen};
use crate::recording::{Filter, RawRecording, RawStep};
use crate::sensitivity::{Encoding, ScanSettings};
use crate::specimen::Specimen;
use crate::voxel::{VoxelGrid, VoxelMask};
use std::f64::consts::TAU;

fn two_hole() -> Specimen {
    let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
    Specimen { drive_mm: vec![5.0], ..specimen }
}

fn solid() -> Specimen {
    Specimen { holes: vec![], ..two_hole() }
}

fn material() -> Material {
    Material::from_json(include_str!("../../geometries/materials/ecoflex-0020.json")).unwrap()
}

fn options(specimen: &Specimen, snr: f64, seed: u64) -> ScanOptions {
    ScanOptions {
        grid: ScanOptions::grid_around(specimen, [1.0, 0.1875, 0.75], 3, [0.3, 0.2, -0.4]).unwrap(),
        mm_per_radian: [0.1; 3],
        snr: [snr; 3],
        kspace: None,
        load: LoadProgram::default(),
        seed,
        sample: 0,
    }
}

/// In a linear field the magnitude is that of the sinc of half the phase change across the voxel, the phase that of its
/// centre; a voxel that the face halves has half the signal.
#[test]
fn gradients_lower_the_magnitude() {
    let specimen = solid();
    let mesh = mesh_specimen(&specimen, &MeshOptions::search(&specimen)).unwrap();
    let gradient = [0.05, 0.8, 0.0];
    let field: Vec<[f64; 3]> =
        mesh.nodes.iter().map(|x| [gradient[0] * x[0] + gradient[1] * x[1], 0.1 * x[1], 0.0]).collect();
    // Voxels centred on the faces x = ±12.7 and y = ±3.2.
    let grid = VoxelGrid::new([-12.7, -3.2, -0.5], [25.4 / 20.0, 0.4, 1.0], [21, 17, 2]).unwrap();
    let mm_per_radian = [0.12, 0.1, 0.1];
    let images = signal_images(&specimen, &mesh, &[&field], &grid, mm_per_radian, &|| false).unwrap();
    let sinc = |x: f64| if x.abs() < 1e-12 { 1.0 } else { x.sin() / x };
    for v in 0..grid.num_voxels() {
        let [i, j, _] = grid.indices(v);
        let (on_x, on_y) = (i == 0 || i == 20, j == 0 || j == 16);
        let value = images[0][0][v];
        let length = |on_face: bool, edge: f64| if on_face { 0.5 * edge } else { edge };
        let half_phase = |a: usize, on: bool| 0.5 * gradient[a] * length(on, grid.voxel_mm[a]) / mm_per_radian[0];
        let fill = if on_x { 0.5 } else { 1.0 } * if on_y { 0.5 } else { 1.0 };
        let exact = fill * sinc(half_phase(0, on_x)) * sinc(half_phase(1, on_y));
        // Four Gauss points at 2.7 rad across a voxel: (2.7/2)⁸/8! × their error constant 5 × 10⁻⁴ or so, 1.4 × 10⁻⁷.
        assert!((value.norm() - exact).abs() < 2e-6, "{v} {} {exact}", value.norm());
        if !on_x && !on_y {
            let x = grid.center_mm(v);
            let phase = (gradient[0] * x[0] + gradient[1] * x[1]) / mm_per_radian[0];
            assert!(wrapped(value.arg() - phase).abs() < 1e-6);
        }
    }
    // Nothing outside: noise alone is seen there.
    let far = VoxelGrid::new([30.0; 3], [1.0; 3], [2; 3]).unwrap();
    assert!(signal_images(&specimen, &mesh, &[&field], &far, mm_per_radian, &|| false).is_err());
}

/// Uniform images with noise: phases scatter by 1/(SNR × magnitude), and the empty voxels tell the noise.
#[test]
fn phase_noise_follows_the_magnitude() {
    let specimen = solid();
    let options = options(&specimen, 25.0, 3);
    let mask = VoxelMask::of_specimen(&specimen, options.grid.clone()).unwrap();
    for magnitude in [1.0, 0.5] {
        let image = || mask.spread(&vec![Complex::new(magnitude, 0.0); mask.num_voxels()], Complex::new(0.0, 0.0));
        let (phase, measured) = noisy_images([image(), image(), image()], &options, 0);
        let raw = raw_of(&specimen, &options, &mask, phase.clone(), measured);
        let n = mask.num_voxels() as f64;
        for phase in &phase {
            let sum: f64 = mask.voxels.iter().map(|&v| phase[v as usize].powi(2)).sum();
            let sd = (sum / n).sqrt();
            // 21,000 draws scatter by 0.5 %; the arctangent adds 1/(2 SNR²) = 0.3 % at half signal.
            assert!((sd * 25.0 * magnitude - 1.0).abs() < 0.02, "{sd}");
        }
        let noise = NoiseEstimate::of_step(&raw, &raw.steps[0]);
        assert_eq!(noise.source, NoiseSource::EmptyVoxels);
        // Mean of 15,000 magnitudes, each the mean of three: 0.3 %.
        assert!((noise.sd[0] * 25.0 - 1.0).abs() < 0.01, "{:?}", noise.sd);
        for sd in noise.sd_from_phases {
            // A median of 60,000 correlated differences: about 1 %.
            assert!((sd * 25.0 - 1.0).abs() < 0.04, "{sd}");
        }
    }
}

fn raw_of(
    specimen: &Specimen,
    options: &ScanOptions,
    mask: &VoxelMask,
    phase: [Vec<f64>; 3],
    magnitude: Vec<f64>,
) -> RawRecording {
    RawRecording {
        id: "test".into(),
        specimen: specimen.clone(),
        grid: options.grid.clone(),
        mask: mask.spread(&vec![true; mask.num_voxels()], false),
        steps: vec![RawStep {
            drive_mm: 5.0,
            force_n: None,
            force_sd_n: None,
            window_s: None,
            phase,
            magnitude,
            mm_per_radian: options.mm_per_radian,
        }],
        noise_sd_mm: None,
        load: None,
        notes: None,
    }
}

/// White noise through the 2×2×2 filter: √8 smaller, neighbours along one axis correlated by a half, diagonal ones by a
/// quarter.
#[test]
fn filtered_noise_is_correlated() {
    let specimen = solid();
    let options = options(&specimen, 25.0, 11);
    let mask = VoxelMask::of_specimen(&specimen, options.grid.clone()).unwrap();
    let image = || mask.spread(&vec![Complex::new(1.0, 0.0); mask.num_voxels()], Complex::new(0.0, 0.0));
    let (phase, magnitude) = noisy_images([image(), image(), image()], &options, 0);
    let raw = raw_of(&specimen, &options, &mask, phase, magnitude);
    let settings = ReconstructOptions { filter: Filter::Hamming2, ..ReconstructOptions::default() };
    let found = reconstruct(&raw, &settings).unwrap();
    let u = &found.recording.steps[0].displacement;
    let grid = &found.recording.grid;
    let inside = |v: usize| (found.sd_mm[0][v][0] - 0.1 / 25.0 / 8f64.sqrt()).abs() < 5e-5;
    let covariance = |step: [usize; 3]| {
        let (mut sum, mut n) = (0.0, 0.0);
        for v in 0..grid.num_voxels() {
            let to = grid.indices(v);
            let to = [0, 1, 2].map(|a| to[a] + step[a]);
            if (0..3).any(|a| to[a] >= grid.shape[a]) || !inside(v) || !inside(grid.index(to)) {
                continue;
            }
            sum += u[v][0] * u[grid.index(to)][0];
            n += 1.0;
        }
        sum / n
    };
    let variance = covariance([0, 0, 0]);
    // 17,000 values with some eight neighbours each: 2 % of the variance; three of those.
    assert!((variance / (0.004f64.powi(2) / 8.0) - 1.0).abs() < 0.06, "{variance}");
    for (step, exact) in [([1, 0, 0], 0.5), ([0, 1, 0], 0.5), ([0, 0, 1], 0.5), ([1, 1, 0], 0.25), ([0, 2, 0], 0.0)] {
        let correlation = covariance(step) / variance;
        assert!((correlation - exact).abs() < 0.04, "{step:?} {correlation}");
    }
}

/// The window's noise factor is that of the noise.
#[test]
fn windows_lower_the_noise() {
    let specimen = solid();
    let kspace = KSpace { keep: [0.8, 0.6, 1.0], window: Window::Hamming };
    let options = ScanOptions { kspace: Some(kspace), ..options(&specimen, 1.0, 5) };
    let zeros = || vec![Complex::new(0.0, 0.0); options.grid.num_voxels()];
    let mut noise = [zeros(), zeros(), zeros()];
    let (phase, magnitude) = noisy_images(noise.clone(), &options, 0);
    assert!(phase[0].iter().all(|p| p.abs() <= std::f64::consts::PI));
    noise[0].clear();
    let mean = magnitude.iter().sum::<f64>() / magnitude.len() as f64;
    let expected = kspace.noise_factor(options.grid.shape) * (0.25 * TAU).sqrt();
    // 34,000 × 3 magnitudes, correlated over some ten voxels: 0.5 %.
    assert!((mean / expected - 1.0).abs() < 0.02, "{mean} {expected}");
}

/// The whole way: finite elements, complex images, noise, wrapped phases, unwrapping, noise estimate. The error is what
/// the estimated noise says, no multiple of 2π is wrong, the fixed plate is found, and the same seed gives the same
/// bits.
#[test]
fn scans_are_reconstructed_to_their_noise() {
    let specimen = two_hole();
    let (mesh, solve) = (MeshOptions::search(&specimen), SolveOptions::default());
    let settings = options(&specimen, 20.0, 42);
    let make = |o: &ScanOptions| scan("test", &specimen, &material(), &mesh, &solve, o, &|| false).unwrap();
    let made = make(&settings);
    // 5 mm of drive are eight turns across the thickness.
    let again = make(&settings);
    assert_eq!(made.raw.steps[0].phase, again.raw.steps[0].phase);
    assert_eq!(made.raw.load, again.raw.load);
    let found = reconstruct(&made.raw, &ReconstructOptions::default()).unwrap();
    let result = ScanResult::new(&made, &settings, Some(&found), String::new()).unwrap();
    let step = &result.steps[0];
    for (error, component) in step.error.unwrap().iter().zip(&step.reconstruction.as_ref().unwrap().components) {
        // Some 19,000 voxels scatter by 0.5 %; partly filled and dephased voxels have phases that are not Gaussian, and
        // the magnitude that the estimate rests on is the mean of three directions.
        assert!((error.rms_over_sd - 1.0).abs() < 0.12, "{error:?}");
        assert!(error.num_wrong_turns <= 2, "{error:?}");
        assert!(component.num_kept as f64 > 0.97 * component.num_voxels as f64, "{component:?}");
        assert!(!component.anchor.is_ambiguous);
        // Noise 0.005 mm over hundreds of columns; the field bends near the plate.
        assert!(component.anchor.fixed_plate_mm.unwrap().abs() < 0.06, "{component:?}");
    }
    let moved = step.reconstruction.as_ref().unwrap().components[0].anchor.moved_plate_mm.unwrap();
    assert!((moved - 5.0).abs() < 0.06, "{moved}");
    assert!((step.force_n.unwrap() - step.true_force_n).abs() < 0.1);
    let other = make(&ScanOptions { seed: 43, ..settings.clone() });
    assert_ne!(made.raw.steps[0].phase, other.raw.steps[0].phase);
    // Written and read, the raw recording gives the same displacements to the single precision of its files.
    let folder = tempfile::tempdir().unwrap();
    made.raw.write(folder.path()).unwrap();
    let read = RawRecording::read(folder.path(), &crate::recording::ReadLimits::default()).unwrap();
    let again = reconstruct(&read, &ReconstructOptions::default()).unwrap();
    let pairs = found.recording.steps[0].displacement.iter().zip(&again.recording.steps[0].displacement);
    for (a, b) in pairs.filter(|(a, b)| a[0].is_finite() && b[0].is_finite()) {
        assert!((a[0] - b[0]).abs() < 1e-5, "{a:?} {b:?}");
    }
}

/// What a planned scan takes encoding to cost is what the synthetic scanner and the unwrapping make of it: as many
/// voxels are lost and the others have as much noise, with an encoding that loses few and one that loses the edges.
#[test]
fn encodings_cost_what_is_planned() {
    let specimen = two_hole();
    let (mesh, solve) = (MeshOptions::search(&specimen), SolveOptions::default());
    let mut model = crate::fem::ForwardModel::of_specimen(&specimen, &mesh).unwrap();
    let state = model.solve(&material(), 5.0, None, &solve, &|| false).unwrap();
    for (mm_per_radian, is_strong) in [(0.12, false), (0.075, true)] {
        let settings = ScanOptions { mm_per_radian: [mm_per_radian; 3], ..options(&specimen, 20.0, 7) };
        let made = scan("test", &specimen, &material(), &mesh, &solve, &settings, &|| false).unwrap();
        let found = reconstruct(&made.raw, &ReconstructOptions::default()).unwrap();
        let planned = ScanSettings {
            noise_sd_mm: [mm_per_radian / 20.0; 3],
            mm_per_radian: Some([mm_per_radian; 3]),
            ..ScanSettings::default()
        };
        let encoding = Encoding::of(&planned).unwrap();
        let operator =
            crate::voxel::VoxelOperator::new(&specimen, model.mesh(), &made.mask, crate::voxel::Sampling::default());
        let operator = operator.unwrap();
        let gradients = operator.deformation_gradients(&state.displacement).unwrap();
        let signal = encoding.signal_left(&made.mask, &operator.average(&state.displacement).unwrap(), &gradients);
        let (mut lost, mut sums, mut num_both) = ([0.0; 2], [0.0; 3], 0.0);
        for (n, (&voxel, left)) in made.mask.voxels.iter().zip(&signal).enumerate() {
            let measured = found.recording.steps[0].displacement[voxel as usize];
            let is_found = measured.iter().all(|u| u.is_finite());
            lost[0] += f64::from(u8::from(left[0] == 0.0));
            lost[1] += f64::from(u8::from(!is_found));
            // What a plan does not know is how much of a voxel at a face is filled.
            if left[0] > 0.0 && is_found && made.mask.material_fraction[n] > 0.999 {
                num_both += 1.0;
                for c in 0..3 {
                    let error = measured[c] - made.truth[0][n][c];
                    sums[c] += (error * left[c] / planned.noise_sd_mm[c]).powi(2);
                }
            }
        }
        let num = made.mask.num_voxels() as f64;
        let [lost, found_lost] = lost.map(|n| n / num);
        // Noise turns single differences near half a turn, and more of them at faces, where voxels are not full.
        assert!((lost - found_lost).abs() < 0.025 && (lost > 0.03) == is_strong, "{lost} {found_lost}");
        for sum in sums {
            // Some 15,000 voxels scatter by 0.6 %; phases of steep voxels are not Gaussian, nor linear within them.
            let noise = (sum / num_both).sqrt();
            assert!((noise - 1.0).abs() < 0.04, "{noise}");
        }
    }
}

#[test]
fn bad_settings_are_refused() {
    let specimen = solid();
    let good = options(&specimen, 20.0, 0);
    let (mesh, solve) = (MeshOptions::search(&specimen), SolveOptions::default());
    for bad in [
        ScanOptions { snr: [0.0, 1.0, 1.0], ..good.clone() },
        ScanOptions { snr: [f64::NAN; 3], ..good.clone() },
        ScanOptions { kspace: Some(KSpace { keep: [1.5, 1.0, 1.0], window: Window::None }), ..good.clone() },
    ] {
        let error = scan("bad", &specimen, &material(), &mesh, &solve, &bad, &|| false).unwrap_err();
        assert!(matches!(error, AcquisitionError::Value { .. }), "{error}");
    }
    assert!(ScanOptions::grid_around(&specimen, [1.0; 3], 2, [3.0, 0.0, 0.0]).is_err());
}
