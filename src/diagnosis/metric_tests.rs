use super::*;
use crate::recording::{Filter, RecordedStep, Recording};
use crate::specimen::Specimen;
use crate::voxel::VoxelGrid;

fn observed() -> Observed {
    let mut specimen = Specimen::from_json(include_str!("../../geometries/solid-shear.json")).unwrap();
    specimen.drive_mm = vec![2.0, 4.0];
    let grid = VoxelGrid::new([-8.0, -2.0, -6.0], [8.0, 2.0, 6.0], [3, 3, 3]).unwrap();
    let n = grid.num_voxels();
    let step = |drive_mm: f64| RecordedStep {
        drive_mm,
        force_n: Some(3.0 * drive_mm),
        force_sd_n: Some(0.1),
        window_s: None,
        displacement: vec![[0.0; 3]; n],
    };
    let recording = Recording {
        id: "small".into(),
        steps: vec![step(2.0), step(4.0)],
        specimen,
        grid,
        mask: vec![true; n],
        noise_sd_mm: Some([0.05, 0.04, 0.06]),
        filter: Filter::None,
        load: None,
        notes: None,
    };
    Observed::new(&recording, 0.1).unwrap()
}

fn trace(observed: &Observed, seed: u64) -> Trace {
    let mut state = seed;
    let mut next = || {
        // A linear congruential generator is random enough for a vector.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let n = observed.mask.num_voxels();
    Trace {
        displacement: (0..2).map(|_| (0..n).map(|_| [next(), next(), next()]).collect()).collect(),
        force: vec![next(), next()],
    }
}

/// The inner product is symmetric and positive, and an allowance only ever takes weight away: ⟨a, a⟩ falls as it grows.
#[test]
fn allowances_take_weight_away() {
    let observed = observed();
    let (a, b) = (trace(&observed, 1), trace(&observed, 2));
    let mut last = f64::INFINITY;
    for allowance in [1e-9, 0.01, 0.1, 1.0] {
        let metric = Metric::new(&observed, allowance, &|_| true);
        let (wa, wb) = (metric.weigh(&a), metric.weigh(&b));
        let (ab, ba) = (metric.inner(&wa, &wb), metric.inner(&wb, &wa));
        // Rounding of sums of a hundred numbers.
        assert!((ab - ba).abs() < 1e-9 * ab.abs().max(1.0), "{ab} {ba}");
        let square = metric.inner(&wa, &wa);
        assert!(square > 0.0 && square < last, "{square} {last}");
        last = square;
    }
}

/// The Woodbury form is the inverse: with x = C y built from its definition, ⟨x, b⟩ = y · b; also where the noise
/// differs over the image.
#[test]
fn inner_product_inverts_the_covariance() {
    let alike = observed();
    let mut uneven = observed();
    let relative = |v: usize| [0.5 + 0.1 * v as f64, 1.0, 3.0 - 0.1 * v as f64];
    uneven.steps[1].relative_noise = Some((0..uneven.mask.num_voxels()).map(relative).collect());
    inverts_the_covariance(&alike);
    inverts_the_covariance(&uneven);
}

fn inverts_the_covariance(observed: &Observed) {
    let allowance = 0.05;
    let metric = Metric::new(observed, allowance, &|_| true);
    let (y, b) = (trace(observed, 3), trace(observed, 4));
    // C y for displacements: noise, plus per component the boxes' sums over both steps.
    let mut x = y.scaled(0.0);
    let variances = metric.variances.clone();
    for c in 0..3 {
        let mut sums = vec![0.0; metric.num_boxes];
        for (step, field) in y.displacement.iter().enumerate() {
            for (u, boxes) in field.iter().zip(&metric.boxes) {
                for &i in boxes {
                    sums[i as usize] += metric.scale[step] * u[c];
                }
            }
        }
        for (step, field) in x.displacement.iter_mut().enumerate() {
            for (v, (u, boxes)) in field.iter_mut().zip(&metric.boxes).enumerate() {
                let noise = observed.noise_mm2(step, v)[c] * y.displacement[step][v][c];
                let smooth: f64 = boxes.iter().map(|&i| variances[i as usize] * sums[i as usize]).sum();
                u[c] = noise + metric.scale[step] * smooth;
            }
        }
    }
    let dot: f64 = y
        .displacement
        .iter()
        .flatten()
        .zip(b.displacement.iter().flatten())
        .map(|(p, q)| (0..3).map(|c| p[c] * q[c]).sum::<f64>())
        .sum();
    let mut b = b;
    b.force = vec![0.0; 2];
    let found = metric.inner(&metric.weigh(&x), &metric.weigh(&b));
    // Cancellation in the Woodbury formula: allowance² n / noise² is some hundred here.
    assert!((found - dot).abs() < 1e-9 * dot.abs().max(1.0), "{found} {dot}");
}
