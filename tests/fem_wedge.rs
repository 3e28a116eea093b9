//! A wedge as a specimen: equilibria against closed forms and symmetries, voxels against quadrature, a scan that gives
//! its material, and what is refused.

mod common;

use common::{model, never, off_axis, ogden, solid, solve, specimen, two_terms};
use lambdak::calibration::{
    Boundary, CalibrateOptions, CalibrationError, Observed, SyntheticScan, TermCount, calibrate,
};
use lambdak::diagnosis::{DiagnosisError, Laboratory};
use lambdak::fem::{Equilibrium, ForwardModel, QuadraturePoint, SolveOptions};
use lambdak::kinematics::{determinant, inverse, principal_stretches};
use lambdak::material::{Material, energy_density};
use lambdak::mesh::{MeshOptions, mesh_specimen};
use lambdak::recording::Filter;
use lambdak::sensitivity::{DriveSelection, EvaluationOptions, Protocol, ScanSettings, evaluate};
use lambdak::specimen::{HoleAxis, Sample, Specimen, TestKind};
use lambdak::voxel::{Face, MeasuredComponents, Sampling, Surface, VoxelGrid, VoxelMask, VoxelOperator};

fn wedged(mut specimen: Specimen, wedge_mm: f64) -> Specimen {
    specimen.block.wedge_mm = wedge_mm;
    assert_eq!(specimen.validate(), Ok(()));
    specimen
}

fn block(extents: [f64; 3]) -> Specimen {
    specimen(TestKind::DoubleLapShear, extents, HoleAxis::Thickness, &[])
}

/// The force is the work of the stresses on any displacement that moves the plate by 1 mm, per mm: here of
/// u_x = Y/thickness + 1/2, which the elements hold exactly, by its gradient in closed form.
#[test]
fn the_force_is_the_virtual_work_of_the_stresses() {
    let (specimen, material, drive) = (wedged(off_axis(), -3.0), two_terms(), 4.0);
    let mut model = model(&specimen, 2.0);
    let state = solve(&mut model, &material, drive).unwrap();
    let (taper, thickness) = (specimen.block.taper(), specimen.block.thickness_mm);
    let work_of = |q: &QuadraturePoint| {
        let f = q.deformation_gradient;
        let back = inverse(&f).expect("a deformation");
        // P = J σ F⁻ᵀ; its first row times the gradient of u_x.
        let first = |j: usize| (0..3).map(|c| q.cauchy_stress[0][c] * back[j][c]).sum::<f64>() * determinant(&f);
        let [of_x, of_y] = taper.flattening_slopes(q.position);
        q.volume_mm3 * (first(0) * of_x + first(1) * of_y) / thickness
    };
    let fields = model.quadrature_fields(&material, &state);
    // kPa mm² are mN.
    let work_n = 1e-3 * model.multiplicity() * fields.iter().map(work_of).sum::<f64>();
    println!("{} N by the plates, {work_n} N by the stresses", state.force_n);
    // The solver's residual, and the digits of stresses that pressures nearly cancel.
    assert!((work_n / state.force_n - 1.0).abs() < 1e-7);
}

/// Turned by half a turn about z, a wedge is that of the opposite sign with the plates exchanged; seen in a mirror it
/// is that of the opposite sign driven the other way. Both are the same force.
#[test]
fn turned_and_mirrored_wedges_take_the_same_force() {
    let material = two_terms();
    let at = |wedge_mm: f64, drive: f64| {
        let driven = Specimen { drive_mm: vec![drive], ..wedged(solid(), wedge_mm) };
        solve(&mut model(&driven, 2.5), &material, drive).unwrap()
    };
    let [a, turned, mirrored] = [at(3.0, 4.0), at(-3.0, 4.0), at(-3.0, -4.0)];
    println!("{} N, {} N, {} N", a.force_n, turned.force_n, mirrored.force_n);
    // The solver's residual; the meshes are mirror images of each other to rounding.
    assert!((turned.force_n / a.force_n - 1.0).abs() < 1e-8 && (mirrored.force_n / a.force_n + 1.0).abs() < 1e-8);
    assert!((turned.normal_force_n / a.normal_force_n - 1.0).abs() < 1e-7);
}

/// Forces of an even block and of a wedge of the same middle at a small drive, per mm, N/mm.
fn stiffnesses(extents: [f64; 3], wedge_mm: f64, material: &Material) -> [f64; 2] {
    [0.0, wedge_mm].map(|wedge_mm| {
        let specimen = wedged(block(extents), wedge_mm);
        let options = MeshOptions {
            section_size_mm: extents[0] / 16.0,
            levels: 4,
            grading: 0.25,
            ..MeshOptions::standard(&specimen)
        };
        let mut model = ForwardModel::new(mesh_specimen(&specimen, &options).unwrap(), &specimen).unwrap();
        let drive = 1e-3 * extents[1];
        // Of materials that hardly change their volume, residuals do not fall to the 10⁻¹¹ of other tests.
        let options = SolveOptions { tolerance: 1e-8, ..SolveOptions::default() };
        model.solve(material, drive, None, &options, &never).unwrap().force_n / drive
    })
}

/// A thin layer is sheared by drive/thickness everywhere but at its ends, which take from the force of a wedge what
/// they take from that of an even layer: the difference is G W (∫ dx/thickness − L/thickness). That holds of
/// incompressible materials too: seen from the middle of the gap its plates go ± half of the drive, and as both faces
/// slant alike the gap at a place stays as it is and nothing has to flow along.
#[test]
fn a_thin_wedge_is_sheared_place_by_place() {
    let shear_kpa = 20.0;
    for (bulk_kpa, [length, thickness, width], wedge) in
        [(shear_kpa, [40.0, 1.0, 20.0], 0.6), (2e6, [20.0, 1.0, 60.0], 0.3)]
    {
        let [even, slanted] = stiffnesses([length, thickness, width], wedge, &ogden(bulk_kpa, &[(20.0, 2.0)]));
        let per_mm = ((1.0 + 0.5 * wedge) / (1.0 - 0.5 * wedge)).ln() * length / wedge - length / thickness;
        let expected = 1e-3 * shear_kpa * width * per_mm;
        println!("{even} N/mm even, {slanted} N/mm slanted, {} more; expected {expected}", slanted - even);
        // What is left is of the order of thickness/length of the difference: a fortieth and a twentieth.
        assert!(((slanted - even) / expected - 1.0).abs() < thickness / length);
    }
}

/// Sums over the filled parts of all voxels of a grid are integrals over the wedge: volume, displacement, its gradient
/// and, as voxels are small, the energy of the mean deformation.
#[test]
fn voxels_add_up_to_integrals() {
    let specimen = wedged(off_axis(), 4.0);
    let (material, drive) = (ogden(60.0, &[(17.0, 1.91)]), 3.0);
    let mut model = model(&specimen, 1.6);
    let state = solve(&mut model, &material, drive).unwrap();
    let grid = VoxelGrid::new([-12.9, -4.3, -9.7], [0.6, 0.22, 0.5], [44, 40, 40]).unwrap();
    let mask = VoxelMask::from_flags(&specimen, grid.clone(), &vec![true; grid.num_voxels()], 0.02).unwrap();
    let operator = VoxelOperator::new(&specimen, model.mesh(), &mask, Sampling::default()).unwrap();
    let deformations = operator.deformation_gradients(&state.displacement).unwrap();
    let fields = model.quadrature_fields(&material, &state);
    let by_quadrature = |of: &dyn Fn(&[[f64; 3]; 3]) -> f64| -> f64 {
        fields.iter().map(|q| q.volume_mm3 * of(&q.deformation_gradient)).sum()
    };
    let by_voxels = |of: &dyn Fn(&[[f64; 3]; 3]) -> f64| -> f64 {
        let filled = mask.material_fraction.iter().zip(&deformations);
        filled.map(|(part, f)| part * grid.voxel_volume_mm3() * of(f)).sum()
    };
    let volume = specimen.volume_mm3();
    let shear = by_quadrature(&|f| f[0][1]);
    // Slices of cut voxels are good to a thousandth of them, and slivers are left out; coarse arcs to as much of the
    // holes.
    assert!((by_voxels(&|_| 1.0) / volume - 1.0).abs() < 1e-3 && (by_quadrature(&|_| 1.0) / volume - 1.0).abs() < 1e-3);
    for i in 0..3 {
        for j in 0..3 {
            let [a, b] = [by_voxels(&|f| f[i][j]), by_quadrature(&|f| f[i][j])];
            println!("F_{i}{j}: {a} by voxels, {b} by quadrature");
            assert!((a - b).abs() < 2e-3 * shear, "{i} {j}: {a} {b}");
        }
    }
    let energy = |f: &[[f64; 3]; 3]| energy_density(&material, principal_stretches(f));
    let [a, b] = [by_voxels(&energy), by_quadrature(&energy)];
    println!("energy: {a} by voxels, {b} by quadrature");
    // Means over voxels next to the singular edges lose some energy: less of it the smaller they are.
    assert!(a < b && (a / b - 1.0).abs() < 0.02, "{a} {b}");
}

/// Unlike samples may each be a wedge of its own, driven at an angle and precompressed; their forces add.
#[test]
fn forces_of_unlike_wedges_add() {
    let mut specimen = wedged(block([12.0, 4.0, 9.0]), 1.5);
    specimen.drive_angle_deg = 25.0;
    specimen.precompression_mm = 0.2;
    specimen.drive_mm = vec![2.0];
    let other = wedged(block([14.0, 5.0, 8.0]), -2.0);
    specimen.other_samples = vec![Sample { block: other.block, holes: vec![] }];
    assert_eq!(specimen.validate(), Ok(()));
    assert_eq!(Specimen::from_json(&specimen.to_json()).unwrap(), specimen);
    let options = EvaluationOptions {
        mesh: MeshOptions::scaled(&specimen.samples()[0], 2.0),
        ..EvaluationOptions::standard(&specimen.samples()[0])
    };
    let scan = ScanSettings { voxel_mm: [1.0; 3], ..ScanSettings::default() };
    let drives = DriveSelection::DriveMm(specimen.drive_mm.clone());
    let force = |s: &Specimen| {
        let options = EvaluationOptions {
            mesh: options.mesh.carried(&specimen.samples()[0], &s.samples()[0]),
            ..options.clone()
        };
        evaluate(s, &two_terms(), &scan, &drives, &options, &|| false).unwrap().0.steps[0].force_n
    };
    let [first, second] = [0, 1].map(|n| force(&specimen.samples()[n]));
    let together = force(&specimen);
    println!("{first} N and {second} N are {together} N");
    // The solver's tolerance.
    assert!((together / (first + second) - 1.0).abs() < 1e-6);
}

/// An evaluation sees as many voxels as fill the wedge, of its volume and of a free face; a wedge of 0 in the file is
/// no wedge, to the last bit.
#[test]
fn an_evaluation_sees_the_wedge() {
    let even = block([12.0, 4.0, 9.0]);
    let scan = ScanSettings { voxel_mm: [0.5, 0.25, 0.5], ..ScanSettings::default() };
    let drives = DriveSelection::DriveMm(vec![2.0]);
    let evaluated = |s: &Specimen, scan: &ScanSettings| {
        let options = EvaluationOptions { mesh: MeshOptions::scaled(s, 2.0), ..EvaluationOptions::standard(s) };
        evaluate(s, &two_terms(), scan, &drives, &options, &|| false).unwrap().0
    };
    let zero = even.to_json().replace("\"width_mm\": 9.0", "\"width_mm\": 9.0, \"wedge_mm\": 0.0");
    assert!(zero.contains("wedge_mm"));
    let zero = Specimen::from_json(&zero).unwrap();
    assert!(!zero.to_json().contains("wedge_mm"), "files of even blocks stay as they were");
    assert_eq!(evaluated(&zero, &scan), evaluated(&even, &scan));
    let slanted = wedged(even.clone(), 2.0);
    let [e, s] = [evaluated(&even, &scan), evaluated(&slanted, &scan)];
    println!(
        "{} and {} voxels, {} and {} N",
        e.steps[0].num_voxels, s.steps[0].num_voxels, e.steps[0].force_n, s.steps[0].force_n
    );
    // Both have the volume of 12 × 4 × 9 mm; voxels of 0.25 mm at slanted faces come and go in whole rows.
    let ratio = s.steps[0].num_voxels as f64 / e.steps[0].num_voxels as f64;
    assert!((ratio - 1.0).abs() < 0.04, "{ratio}");
    assert!((s.voxel_material_volume_mm3 / slanted.volume_mm3() - 1.0).abs() < 0.04, "{}", s.voxel_material_volume_mm3);
    // The thin end is sheared most.
    assert!(s.steps[0].largest_voxel_stretch > e.steps[0].largest_voxel_stretch);
    let surface = Some(Surface { face: Face::PlusZ, components: MeasuredComponents::All });
    let seen = evaluated(&slanted, &ScanSettings { surface, ..scan });
    let area = seen.subset_material_area_mm2.unwrap();
    println!("{area} mm² of the free face, {} subsets", seen.steps[0].num_voxels);
    assert!((area / 48.0 - 1.0).abs() < 0.04);
}

fn scanned(specimen: &Specimen, truth: &Material) -> lambdak::recording::Recording {
    let scan =
        ScanSettings { voxel_mm: [0.8; 3], noise_sd_mm: [0.01; 3], force_sd_n: 0.005, ..ScanSettings::default() };
    let (mesh, solve) = (MeshOptions::scaled(specimen, 1.6), SolveOptions::default());
    let made = SyntheticScan::new(specimen, truth, &scan, &Protocol::default(), &mesh, &solve, &|| false).unwrap();
    made.recording("wedge", specimen, &made.draw(3, 0), Filter::None).unwrap()
}

/// A recording of a wedge gives its material; taken for an even block it is another experiment.
#[test]
fn a_scan_of_a_wedge_gives_the_material() {
    let specimen = Specimen { drive_mm: vec![2.0, 4.0], ..wedged(off_axis(), 2.5) };
    let truth = ogden(400.0, &[(17.0, 1.91)]);
    let recording = scanned(&specimen, &truth);
    recording.check_motion().unwrap();
    let options = CalibrateOptions { terms: TermCount::Fixed(1), mesh_factor: 2.0, ..CalibrateOptions::default() };
    let fitted = |recording| {
        let data = [Observed::new(recording, 0.005).unwrap()];
        calibrate(&data, &MeshOptions::scaled, &options, &|_| (), &|| false).unwrap()
    };
    let found = fitted(&recording);
    for (e, truth) in found.estimates.iter().zip([400.0, 17.0, 1.91]) {
        let [low, high] = e.interval_95.map(|end| end.expect("determined"));
        println!("{}: {:.4}, 95 % {low:.4} to {high:.4}, truth {truth}", e.parameter.name(), e.value);
        assert!(low < truth && truth < high && (e.value / truth - 1.0).abs() < 0.1);
    }
    let mut untold = recording.clone();
    untold.specimen.block.wedge_mm = 0.0;
    let [with, without] = [found.fit.chi2_per_datum, fitted(&untold).fit.chi2_per_datum];
    println!("chi2 per datum {with}, {without} with the wedge left out");
    // Half of the gap changes by 0.6 mm at the ends, a fifth of it, where displacements are of some mm.
    assert!(without > 10.0 * with);
}

/// Diagnoses and measured boundaries are of even blocks, and say so.
#[test]
fn diagnoses_and_measured_boundaries_are_refused() {
    let specimen = Specimen { drive_mm: vec![1.5], ..wedged(block([12.0, 4.0, 9.0]), 1.0) };
    let recording = scanned(&specimen, &ogden(400.0, &[(17.0, 1.91)]));
    let observed = Observed::new(&recording, 0.005).unwrap();
    match Laboratory::new(&observed, &MeshOptions::scaled(&specimen, 2.0)) {
        Err(DiagnosisError::Wedge { value_mm }) => assert_eq!(value_mm.to_bits(), 1f64.to_bits()),
        other => panic!("{:?}", other.map(|_| ())),
    }
    let refused = observed.with_boundary(Boundary::Measured).map(|_| ());
    assert!(matches!(refused, Err(CalibrationError::NoMeasuredBoundary { .. })), "{refused:?}");
}

/// Displacements of a wedge's mesh are those of its nodes: of a state, no node on a plate leaves it.
#[test]
fn plates_keep_their_faces() {
    let specimen = wedged(off_axis(), 3.0);
    let mut model = model(&specimen, 2.5);
    let Equilibrium { displacement, .. } = solve(&mut model, &two_terms(), 3.0).unwrap();
    let mesh = model.mesh();
    for (nodes, along) in [(&mesh.fixed_nodes, 0.0), (&mesh.moved_nodes, 3.0)] {
        assert!(!nodes.is_empty());
        for &n in nodes {
            let u = displacement[n as usize];
            // Imposed.
            assert!((u[0] - along).abs() < 1e-12 && u[1].abs() < 1e-12 && u[2].abs() < 1e-12);
        }
    }
}
