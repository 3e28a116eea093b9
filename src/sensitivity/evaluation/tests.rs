//! Whole evaluations on coarse meshes, and the input hash; the equilibria themselves are tested in `fem`.

use super::super::continuum::tests::block;
use super::super::information::tests::one_term;
use super::*;
use crate::fem::{SolveError, SolveOptions};
use crate::mesh::MeshOptions;
use crate::sensitivity::ProtocolMismatch;

fn scan() -> ScanSettings {
    serde_json::from_str(
        r#"{ "voxel_mm": [1.0, 0.1875, 0.75], "noise_sd_mm": [0.05, 0.05, 0.05], "force_sd_n": 0.02 }"#,
    )
    .unwrap()
}

/// Equal inputs have equal hashes; each input changes it.
#[test]
fn hash_follows_the_inputs() {
    let specimen = block("hash");
    let options = EvaluationOptions::standard(&specimen);
    let drives = DriveSelection::DriveMm(vec![2.0]);
    let hash = hash_of_inputs(&specimen, &one_term(), &scan(), &drives, &options);
    assert_eq!(hash.len(), 64);
    assert_eq!(hash, hash_of_inputs(&specimen, &one_term(), &scan(), &drives, &options));
    let protocol = Protocol { force_drive_mm: vec![1.0], ..Protocol::default() };
    let others = [
        hash_of_inputs(
            &specimen,
            &one_term(),
            &scan(),
            &drives,
            &EvaluationOptions { protocol, ..EvaluationOptions::standard(&specimen) },
        ),
        hash_of_inputs(&block("other"), &one_term(), &scan(), &drives, &options),
        hash_of_inputs(&specimen, &Material { bulk_kpa: 1.0, ..one_term() }, &scan(), &drives, &options),
        hash_of_inputs(&specimen, &one_term(), &ScanSettings { force_sd_n: 0.03, ..scan() }, &drives, &options),
        hash_of_inputs(&specimen, &one_term(), &scan(), &DriveSelection::MedianStretch(1.2), &options),
    ];
    assert!(others.iter().all(|other| *other != hash));
}

/// Voxel displacements, as the scan sees them, at a material with one parameter changed.
fn seen(specimen: &Specimen, material: &Material, options: &EvaluationOptions) -> EvaluationMaps {
    let drives = DriveSelection::DriveMm(vec![1.5]);
    evaluate(specimen, material, &coarse_scan(), &drives, options, &|| false).unwrap().1
}

fn coarse_scan() -> ScanSettings {
    ScanSettings { voxel_mm: [1.0, 0.5, 1.0], ..scan() }
}

/// The information of one drive at which `specimen` is measured as `protocol` says, on a coarse mesh.
fn information(specimen: &Specimen, scan: &ScanSettings, protocol: Protocol) -> FisherInformation {
    // One recipe for all, as a fixture carries it from sample to sample.
    let mesh = MeshOptions::scaled(&with_hole(), 2.5).carried(&with_hole(), specimen);
    let options = EvaluationOptions { mesh, protocol, ..EvaluationOptions::standard(specimen) };
    let drives = DriveSelection::DriveMm(vec![1.5]);
    evaluate(specimen, &one_term(), scan, &drives, &options, &|| false).unwrap().1.information
}

fn blocks(blocks_scanned: u32) -> Protocol {
    Protocol { blocks_scanned, ..Protocol::default() }
}

/// With the samples that `others` are beside the specimen's own.
fn beside(specimen: Specimen, others: &[&Specimen]) -> Specimen {
    let of = |s: &&Specimen| crate::specimen::Sample { block: s.block, holes: s.holes.clone() };
    Specimen { other_samples: others.iter().map(of).collect(), ..specimen }
}

fn with_hole() -> Specimen {
    let hole = crate::specimen::Hole::circle(crate::specimen::HoleAxis::Thickness, [0.5, 0.0], 3.0);
    Specimen { holes: vec![hole], ..block("hole") }
}

/// The information is that of voxel displacements and forces found by central differences of whole evaluations.
#[test]
fn information_agrees_with_differences() {
    let specimen = with_hole();
    let options = EvaluationOptions {
        mesh: MeshOptions::search(&specimen),
        solve: SolveOptions { tolerance: 1e-11, ..SolveOptions::default() },
        ..EvaluationOptions::standard(&specimen)
    };
    let base = seen(&specimen, &one_term(), &options);
    let num_voxels = base.samples[0].mask.as_ref().unwrap().num_voxels();
    let (mut fields, mut forces) = (Vec::new(), Vec::new());
    for parameter in one_term().parameters() {
        let value = one_term().value(parameter);
        let h = 1e-3 * value;
        let [plus, minus] = [h, -h].map(|step| {
            let mut material = one_term();
            material.set(parameter, value + step);
            seen(&specimen, &material, &options)
        });
        let [plus, minus] = [&plus.samples[0], &minus.samples[0]];
        let difference =
            |c: usize, v: usize| (plus.drives[0].displacement[v][c] - minus.drives[0].displacement[v][c]) / (2.0 * h);
        fields.push((0..num_voxels).map(|v| [0, 1, 2].map(|c| difference(c, v))).collect::<Vec<_>>());
        forces.push((plus.equilibria[0].force_n - minus.equilibria[0].force_n) / (2.0 * h));
    }
    let weights = vec![1.0; num_voxels];
    let by_differences =
        FisherInformation::of_drive(&one_term(), &fields, &weights, &forces, &coarse_scan().noise()).unwrap();
    let (a, b) = (base.information.matrix(), by_differences.matrix());
    for i in 0..3 {
        for j in 0..3 {
            let scale = (a[(i, i)] * a[(j, j)]).sqrt();
            // Truncation (10⁻³)² and solver residue 10⁻¹¹ / 10⁻³ over relative displacement changes of 10⁻².
            assert!((a[(i, j)] - b[(i, j)]).abs() < 1e-4 * scale, "{i} {j}: {} {}", a[(i, j)], b[(i, j)]);
        }
    }
}

/// A listed sample that equals the first is the same as two in parallel, and n blocks and a part of a scan's time weigh
/// the voxels alone.
#[test]
fn equal_blocks_and_shares_weigh_the_voxels() {
    let pair = Specimen { samples_in_parallel: 2, ..with_hole() };
    let listed = beside(with_hole(), &[&with_hole()]);
    let scan = coarse_scan();
    let of = |specimen: &Specimen, protocol: Protocol| information(specimen, &scan, protocol).matrix().clone();
    let (one, two) = (of(&pair, blocks(1)), of(&pair, blocks(2)));
    let half = of(&pair, Protocol { scan_share: vec![0.5], ..blocks(1) });
    let [listed_one, listed_two] = [1, 2].map(|n| of(&listed, blocks(n)));
    for i in 0..3 {
        for j in 0..3 {
            let scale = (two[(i, i)] * two[(j, j)]).sqrt();
            let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * scale, "{i} {j}: {a} {b}");
            // The same numbers in another order of sums.
            close(listed_one[(i, j)], one[(i, j)]);
            close(listed_two[(i, j)], two[(i, j)]);
            // V + F with one block, 2 V + F with two, V/2 + F in half of the time.
            close(two[(i, j)] - one[(i, j)], 2.0 * (one[(i, j)] - half[(i, j)]));
        }
    }
    let too_many = EvaluationOptions { protocol: blocks(3), ..EvaluationOptions::standard(&pair) };
    let drives = DriveSelection::DriveMm(vec![1.5]);
    let refused = evaluate(&pair, &one_term(), &scan, &drives, &too_many, &|| false);
    let mismatch = ProtocolMismatch::BlocksScanned { value: 3, num_samples: 2 };
    assert!(matches!(refused, Err(EvaluationError::Protocol(m)) if m == mismatch));
}

/// Unlike blocks: the information about displacements is the sum of both blocks' own, and the load cell tells the sum
/// of both forces.
#[test]
fn unlike_blocks_add_their_voxels_and_share_one_force() {
    let first = with_hole();
    let mut second = block("thicker");
    second.block.thickness_mm *= 1.4;
    // Next to no voxels, and next to no load cell.
    let forces_alone = ScanSettings { noise_sd_mm: [1e8; 3], ..coarse_scan() };
    let voxels_alone = ScanSettings { force_sd_n: 1e8, ..coarse_scan() };
    let of = |s: &Specimen, scan: &ScanSettings, n: u32| information(s, scan, blocks(n)).matrix().clone();
    // ∂F/∂ξ over σ: the information of a force is the square of it.
    let slope = |s: &Specimen| -> Vec<f64> {
        let of_force = of(s, &forces_alone, 1);
        (0..3).map(|i| of_force[(1, i)] / of_force[(1, 1)].sqrt()).collect()
    };
    let (of_first, of_second) = (slope(&first), slope(&second));
    let voxels = of(&first, &voxels_alone, 1) + of(&second, &voxels_alone, 1);
    let both = of(&beside(first, &[&second]), &coarse_scan(), 2);
    for i in 0..3 {
        for j in 0..3 {
            let force = (of_first[i] + of_second[i]) * (of_first[j] + of_second[j]);
            let scale = (both[(i, i)] * both[(j, j)]).sqrt();
            // The scans "alone" leave 10⁻¹⁸ of the other; the rest is the rounding of that small remainder's root.
            let expected = voxels[(i, j)] + force;
            assert!((both[(i, j)] - expected).abs() < 1e-6 * scale, "{i} {j}: {} {expected}", both[(i, j)]);
        }
    }
}

/// A mirrored mesh promises what the whole mesh promises.
#[test]
fn mirror_does_not_change_the_evaluation() {
    let specimen = with_hole();
    let [half, whole] = [true, false].map(|use_mirror| {
        let mut mesh = MeshOptions::search(&specimen);
        mesh.use_mirror = use_mirror;
        let options = EvaluationOptions { mesh, ..EvaluationOptions::standard(&specimen) };
        let drives = DriveSelection::DriveMm(vec![1.0, 2.0]);
        evaluate(&specimen, &one_term(), &coarse_scan(), &drives, &options, &|| false).unwrap().0
    });
    assert!(whole.statistics.num_elements > half.statistics.num_elements);
    let close = |a: f64, b: f64| {
        // The two sections are meshed alike but not identically: the meshes' own errors, below a percent.
        assert!((a / b - 1.0).abs() < 0.01, "{a} {b}");
    };
    for (a, b) in half.steps.iter().zip(&whole.steps) {
        close(a.force_n, b.force_n);
        close(a.median_stretch, b.median_stretch);
        for (a, b) in a.integrated_sensitivity.iter().zip(&b.integrated_sensitivity) {
            close(a.volume_integral, b.volume_integral);
        }
    }
    for (a, b) in half.promised_sd.iter().zip(&whole.promised_sd) {
        close(a.value.unwrap(), b.value.unwrap());
    }
    // More drives, more information.
    assert!(half.promised_sd[1].value.unwrap() < half.steps[1].promised_sd[1].value.unwrap());
}

/// The drive for a median stretch is found, and the result round-trips through JSON.
#[test]
fn evaluates_at_a_median_stretch() {
    let specimen = with_hole();
    let options = EvaluationOptions {
        mesh: MeshOptions::search(&specimen),
        bulk_log_prior_sd: Some(0.05),
        ..EvaluationOptions::standard(&specimen)
    };
    let drives = DriveSelection::MedianStretch(1.2);
    let (evaluation, maps) = evaluate(&specimen, &one_term(), &coarse_scan(), &drives, &options, &|| false).unwrap();
    assert!((evaluation.steps[0].median_stretch - 1.2).abs() <= 1e-5);
    assert!(evaluation.statistics.num_equilibria <= 8, "{}", evaluation.statistics.num_equilibria);
    assert!(evaluation.promised_sd[0].relative_sd.unwrap() < 0.05);
    assert_eq!(maps.samples[0].drives[0].states.len(), evaluation.steps[0].num_voxels);
    let text = serde_json::to_string(&evaluation).unwrap();
    let again: Evaluation = serde_json::from_str(&text).unwrap();
    assert_eq!(again.input_hash, evaluation.input_hash);
    assert_eq!(again.steps.len(), 1);
}

#[test]
fn cancellation_is_an_error() {
    let specimen = block("cancelled");
    let options = EvaluationOptions { mesh: MeshOptions::search(&specimen), ..EvaluationOptions::standard(&specimen) };
    let drives = DriveSelection::DriveMm(vec![1.0]);
    let result = evaluate(&specimen, &one_term(), &coarse_scan(), &drives, &options, &|| true);
    assert!(matches!(result, Err(EvaluationError::Solve(SolveError::Cancelled { .. }))));
}

/// Prints the paper's comparison at equal median stretch (`cargo test -- --ignored --nocapture`).
#[test]
#[ignore = "prints a table"]
fn comparison_at_equal_median_stretch() {
    for file in ["uniaxial-bar", "iso37-type4", "solid-shear", "two-hole-shear"] {
        let text = std::fs::read_to_string(format!("geometries/{file}.json")).unwrap();
        let specimen: Specimen = serde_json::from_str(&text).unwrap();
        let options = EvaluationOptions::standard(&specimen);
        let drives = DriveSelection::MedianStretch(1.2);
        let (e, _) = evaluate(&specimen, &one_term(), &scan(), &drives, &options, &|| false).unwrap();
        let s = &e.steps[0];
        println!(
            "{file}: drive {:.3} force {:.3} voxels {} lambda {:.4} k {:.3} solves {} dropped {} of {}",
            s.drive_mm,
            s.force_n,
            s.num_voxels,
            s.median_stretch,
            s.median_mode.unwrap(),
            e.statistics.num_equilibria,
            e.statistics.num_dropped_points,
            e.statistics.num_sample_points
        );
        for i in &s.integrated_sensitivity {
            println!(
                "   {} sum {:.1} mean {:.4} integral {:.1}",
                i.parameter, i.sum, i.mean_per_voxel, i.volume_integral
            );
        }
        for p in &e.promised_sd {
            println!("   {} relative sd {:?} {}", p.parameter, p.relative_sd, p.identifiable);
        }
    }
}

/// Unknown angles of the moved plate take back what they imitate of the material, the more the less they are known. On
/// half of a mirrored sample only the turn in the plane that is kept counts; the whole sample says the same of the
/// material, of which the other turns, odd across the mirror, tell nothing.
#[test]
fn a_plate_out_of_true_takes_precision_back() {
    let specimen = with_hole();
    let material = Material::new(2000.0, [(12.0, 1.5)]).unwrap();
    let drives = DriveSelection::DriveMm(vec![2.5]);
    let promised = |plate_tilt_sd_deg: f64, use_mirror: bool| -> Vec<f64> {
        let options = EvaluationOptions {
            mesh: MeshOptions { use_mirror, ..MeshOptions::search(&specimen) },
            protocol: Protocol { plate_tilt_sd_deg, ..Protocol::default() },
            ..EvaluationOptions::standard(&specimen)
        };
        let (found, _) = evaluate(&specimen, &material, &coarse_scan(), &drives, &options, &|| false).unwrap();
        found.promised_sd.iter().map(|p| p.value.unwrap()).collect()
    };
    let [known, somewhat, unknown] = [1e-9, 0.1, 5.0].map(|sd_deg| promised(sd_deg, true));
    let exactly = promised(0.0, true);
    for i in 0..exactly.len() {
        assert!((known[i] / exactly[i] - 1.0).abs() < 1e-9, "{known:?} {exactly:?}");
        assert!(somewhat[i] > exactly[i] * (1.0 - 1e-9) && unknown[i] > somewhat[i] * (1.0 - 1e-9));
    }
    assert!(unknown.iter().zip(&exactly).any(|(a, b)| *a > 1.001 * b), "{unknown:?} {exactly:?}");
    // Both meshes are the same but for rounding and where the section was divided.
    let ratios = |whole: &[f64], half: &[f64]| whole.iter().zip(half).map(|(a, b)| a / b).collect::<Vec<_>>();
    let (of_known, of_unknown) = (ratios(&promised(0.0, false), &exactly), ratios(&promised(5.0, false), &unknown));
    for (a, b) in of_known.iter().zip(&of_unknown) {
        assert!((a / b - 1.0).abs() < 1e-3, "{of_known:?} {of_unknown:?}");
    }
}

/// Forces on the way to a scan tell two terms apart; an unknown gain of the load cell takes some of that back, and a
/// gain as good as known takes nothing.
#[test]
fn forces_on_the_way_and_unknowns_of_the_set_up() {
    use crate::material::OgdenTerm;
    let specimen = with_hole();
    let material = Material {
        bulk_kpa: 2000.0,
        terms: vec![OgdenTerm { mu_kpa: 12.0, alpha: 1.5 }, OgdenTerm { mu_kpa: 2.0, alpha: 5.0 }],
        law: None,
    };
    let drives = DriveSelection::DriveMm(vec![2.5]);
    let promised = |protocol: Protocol| -> (Vec<f64>, Evaluation) {
        let options = EvaluationOptions {
            mesh: MeshOptions::search(&specimen),
            protocol,
            ..EvaluationOptions::standard(&specimen)
        };
        let (found, _) = evaluate(&specimen, &material, &coarse_scan(), &drives, &options, &|| false).unwrap();
        (found.promised_sd.iter().map(|p| p.value.unwrap()).collect(), found)
    };
    let alone = promised(Protocol::default()).0;
    let with_forces = Protocol { force_drive_mm: vec![1.0, 1.75, 2.5], ..Protocol::default() };
    let (forces, found) = promised(with_forces.clone());
    // The scanned drive has its force already.
    assert_eq!(found.force_steps.iter().map(|s| s.drive_mm).collect::<Vec<_>>(), [1.0, 1.75]);
    assert!(found.force_steps[0].force_n < found.force_steps[1].force_n);
    let (gain, _) = promised(Protocol { force_gain_sd: 0.02, ..with_forces.clone() });
    let (known, _) = promised(Protocol { force_gain_sd: 1e-9, ..with_forces.clone() });
    let (zero, _) = promised(Protocol { drive_zero_sd_mm: 0.05, force_zero_sd_n: 0.05, ..with_forces });
    for (i, sd) in forces.iter().enumerate() {
        assert!(*sd < alone[i], "{forces:?} {alone:?}");
        // An unknown never helps, but for rounding (an exponent does not feel the gain at all); one of 10⁻⁹ takes a
        // 10⁻¹⁸th.
        assert!(gain[i] > *sd * (1.0 - 1e-9) && zero[i] > *sd, "{gain:?} {zero:?} {forces:?}");
        assert!((known[i] / sd - 1.0).abs() < 1e-9, "{known:?} {forces:?}");
    }
    // The data know moduli times gain alone: no modulus is known better than the gain.
    for (i, modulus) in [(1, 12.0), (3, 2.0)] {
        assert!(gain[i] > 0.02 * modulus * (1.0 - 1e-6), "{gain:?}");
    }
}
