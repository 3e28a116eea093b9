//! Times each stage of solve and evaluate on the two-hole double-lap shear specimen (full model, 5 mm), at about 20, 70
//! and 200 thousand unknowns, and of one design evaluation. `cargo bench --bench stages [-- 20k]`.
//!
//! Medians of repeated runs, wall seconds on all threads (of one with `RAYON_NUM_THREADS=1`), and the ratio of each
//! stage to the whole forward solution. Then how fast assembly and factorisation go, against the rate at which this
//! machine multiplies matrices that fit into its caches, in the same precision and on as many threads.

use faer::linalg::matmul::matmul;
use faer::traits::ComplexField;
use faer::{Accum, Mat, Par};
use lambdak::fem::{ForwardModel, SolveOptions};
use lambdak::material::Material;
use lambdak::mesh::{DesignVariable, MeshOptions, mesh_specimen, shape_velocity};
use lambdak::sensitivity::{DriveSelection, EvaluationOptions, ScanSettings, Scanner, evaluate};
use lambdak::specimen::Specimen;
use lambdak::voxel::Sampling;
use std::hint::black_box;
use std::time::Instant;

fn median(runs: usize, mut work: impl FnMut()) -> f64 {
    let mut seconds: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    seconds[runs / 2]
}

/// Rows and columns of the matrices whose product tells the machine's rate: large enough to reach it, and three of them
/// fit into the caches of a core in single precision.
const MULTIPLIED: usize = 512;

/// Operations per second of products of dense matrices of this precision, one on each thread at the same time: the most
/// that a computation made of such products can reach.
fn multiplication_rate<T: ComplexField + From<f32>>() -> f64 {
    let n = MULTIPLIED;
    let a = Mat::<T>::from_fn(n, n, |i, j| T::from((i % 7) as f32 - (j % 5) as f32));
    let seconds = median(9, || {
        rayon::broadcast(|_| {
            let mut product = Mat::<T>::zeros(n, n);
            for _ in 0..8 {
                matmul(product.as_mut(), Accum::Replace, a.as_ref(), a.as_ref(), T::from(1.0), Par::Seq);
            }
            black_box(&product);
        });
    });
    8.0 * rayon::current_num_threads() as f64 * 2.0 * (n as f64).powi(3) / seconds
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let specimen = Specimen::from_json(include_str!("../geometries/two-hole-shear.json"))?;
    let material = Material::from_json(include_str!("../geometries/materials/ecoflex-0020.json"))?;
    let scan = ScanSettings::default();
    let (single_rate, double_rate) = (multiplication_rate::<f32>(), multiplication_rate::<f64>());
    let chosen: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    for (label, factor, runs) in [("search", 1.8, 9), ("20k", 1.15, 5), ("70k", 0.73, 3), ("200k", 0.5, 1)] {
        if !chosen.is_empty() && !chosen.iter().any(|c| c == label) {
            continue;
        }
        let options = if label == "search" {
            MeshOptions::search(&specimen)
        } else {
            MeshOptions { use_mirror: false, ..MeshOptions::scaled(&specimen, factor) }
        };
        let mesh_seconds = median(runs, || {
            black_box(mesh_specimen(&specimen, &options).is_ok());
        });
        let setup = median(runs, || {
            black_box(ForwardModel::of_specimen(&specimen, &options).is_ok());
        });
        let mut model = ForwardModel::of_specimen(&specimen, &options)?;
        let solve = SolveOptions::default();
        let mut state = model.solve(&material, 5.0, None, &solve, &|| false)?;
        let forward = median(runs, || {
            if let Ok(found) = model.solve(&material, 5.0, None, &solve, &|| false) {
                state = found;
            }
        });
        let sensitivities = model.tangent(&material, &state)?.material_sensitivities()?;
        let sensitivity_seconds = median(runs, || {
            if let Ok(found) = model.solve(&material, 5.0, Some(&state), &solve, &|| false) {
                state = found;
            }
            let found = model.tangent(&material, &state).and_then(|mut tangent| tangent.material_sensitivities());
            black_box(found.is_ok());
        });
        let warm = median(runs, || {
            if let Ok(found) = model.solve(&material, 5.0, Some(&state), &solve, &|| false) {
                state = found;
            }
        });
        let velocity = shape_velocity(model.mesh(), &specimen, DesignVariable::HoleDiameter(0));
        let gradient = median(runs, || {
            let g = model
                .tangent(&material, &state)
                .and_then(|mut tangent| tangent.path_sensitivity(&sensitivities, Some(&velocity), 0.0));
            black_box(g.is_ok());
        });
        let assembly = median(runs, || {
            black_box(model.assemble_stage(&material, &state).is_ok());
        });
        let factor_seconds = median(runs, || {
            black_box(model.factorise_stage().is_ok());
        });
        let back_solve = median(runs, || {
            black_box(model.back_solve_stage().is_ok());
        });
        let voxel_setup = median(runs, || {
            black_box(Scanner::new(&specimen, model.mesh(), &scan, Sampling::default()).is_ok());
        });
        let whole = median(runs.min(3), || {
            let options = EvaluationOptions { mesh: options, ..EvaluationOptions::standard(&specimen) };
            let drives = DriveSelection::DriveMm(vec![5.0]);
            black_box(evaluate(&specimen, &material, &scan, &drives, &options, &|| false).is_ok());
        });
        println!(
            "{label}: {} unknowns, {} elements, instructions {}, force {:.4} N, {} Newton iterations",
            model.num_unknowns(),
            model.mesh().num_elements(),
            model.instruction_set(),
            state.force_n,
            model.statistics().newton_iterations
        );
        for (stage, seconds) in [
            ("mesh", mesh_seconds),
            ("order and symbolic factorisation", setup),
            ("assembly, once", assembly),
            ("factorisation, once", factor_seconds),
            ("back-solve, once", back_solve),
            ("forward solution from rest to 5 mm", forward),
            ("material sensitivities, all", sensitivity_seconds - warm),
            ("shape gradient, one variable, with those of the sensitivities", gradient),
            ("voxel operator", voxel_setup),
            ("whole evaluation at one drive", whole),
        ] {
            println!("  {stage:<62} {seconds:>9.4} s  {:>7.3} of the forward solution", seconds / forward);
        }
        for (stage, operations, seconds, peak) in [
            ("factorisation, in single precision", model.factor_operations(), factor_seconds, single_rate),
            ("assembly, products of the stiffness alone", Some(model.stiffness_operations()), assembly, double_rate),
        ] {
            let Some(operations) = operations else { continue };
            let (rate, peak) = (1e-9 * operations / seconds, 1e-9 * peak);
            println!(
                "  {stage:<42} {:>9.3} GFLOP at {rate:>6.1} GFLOP/s, {:.2} of the {peak:.1} of matrix products",
                1e-9 * operations,
                rate / peak
            );
        }
    }
    Ok(())
}
