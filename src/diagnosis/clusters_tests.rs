use super::*;
use crate::diagnosis::evidence::EVIDENCE;
use crate::diagnosis::fit::{derivatives, fit};
use crate::diagnosis::laboratory::Laboratory;
use crate::diagnosis::prior::BulkPrior;
use crate::diagnosis::scene::Scene;
use crate::diagnosis::test_recordings::{FORCE_SD_N, MESH_FACTOR, NOISE_MM, Noise, material, recorded};
use crate::mesh::MeshOptions;

/// What is left where neighbours share it: one draw per column, component and drive, of this size.
const SHARED_MM: f64 = 0.01;
/// Realisations of what is left.
const DRAWS: usize = 100;

/// The scatter of μ and α over residuals of noise alone and of noise that columns share, against the standard
/// deviations of the normal matrix and of clusters.
#[test]
fn shared_residuals_widen_intervals_as_much_as_they_scatter_estimates() {
    let recording = recorded(&material(), &Scene::default(), MESH_FACTOR);
    let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
    let mut laboratory = Laboratory::new(&observed, &MeshOptions::scaled(&observed.specimen, MESH_FACTOR)).unwrap();
    let metric = Metric::new(&observed, 1e-6, &|_| true);
    let bulk = BulkPrior { center_kpa: material().bulk_kpa, log_sd: 0.5 };
    let settings = FitSettings {
        max_iterations: 12,
        bulk,
        shear: None,
        tolerance: 0.1 * EVIDENCE,
        relative_tolerance: 0.0,
        goal: None,
    };
    let measured = laboratory.measured();
    let fitted = fit(&mut laboratory, &metric, &measured, &material(), &[], &settings, &|| false).unwrap();
    let columns = derivatives(&mut laboratory, &fitted.material, &[], &fitted.prediction).unwrap();
    let scales = scales(&fitted.material, &[]);
    let column_of = columns_of(&observed);
    let mut random = Noise(7);
    for (shared_mm, model_holds) in [(0.0, true), (SHARED_MM, false)] {
        // μ and α; κ is hardly known.
        let mut square = [0.0; 2];
        let mut clustered = [0.0; 2];
        for _ in 0..DRAWS {
            let mut left = fitted.clone();
            for field in &mut left.residual.displacement {
                let shared: Vec<[f64; 3]> =
                    (0..24).map(|_| [0, 1, 2].map(|_: usize| shared_mm * random.next())).collect();
                for (u, &column) in field.iter_mut().zip(&column_of) {
                    *u = [0, 1, 2].map(|c| shared[column][c] + NOISE_MM * random.next());
                }
            }
            left.residual.force = left.residual.force.iter().map(|_| 0.0).collect();
            let measured = left.residual.plus(1.0, &left.prediction.trace);
            let (matrix, gradient) =
                normal_system(&metric, &measured, &left.prediction, &left.material, &[], &settings, &columns);
            let shift = matrix.cholesky().unwrap().solve(&gradient);
            let sd = clustered_sd(&observed, &metric, &left, &settings, &columns).unwrap();
            for n in 0..2 {
                square[n] += (scales[n + 1] * shift[n + 1]).powi(2) / DRAWS as f64;
                clustered[n] += sd[n + 1] / DRAWS as f64;
            }
        }
        for n in 0..2 {
            let (found, model) = (square[n].sqrt(), fitted.sd[n + 1]);
            println!("shared {shared_mm}: scatter {found:.4}, clusters {:.4}, model {model:.4}", clustered[n]);
            // A hundred draws know a standard deviation to 7 %; two dozen clusters know one to 15 %, less a few per
            // cent of bias, and their mean over draws is known better.
            assert!((0.75..1.35).contains(&(clustered[n] / found)), "{} {found}", clustered[n]);
            assert_eq!(model > 0.75 * found, model_holds, "{model} {found}");
        }
    }
}

/// Every voxel lies in one of the columns, and none of them is empty.
#[test]
fn columns_hold_all_voxels() {
    let recording = recorded(&material(), &Scene::default(), MESH_FACTOR);
    let observed = Observed::new(&recording, FORCE_SD_N).unwrap();
    let column_of = columns_of(&observed);
    let mut seen = column_of.clone();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen, (0..24).collect::<Vec<_>>());
    assert_eq!(column_of.len(), observed.mask.num_voxels());
}
