use super::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::PI;

const SHAPE: [usize; 3] = [26, 38, 26];

/// A field that is hard to unwrap.
struct Case {
    name: &'static str,
    /// Turns of the phase along a line of voxels through the thickness.
    num_turns: f64,
    /// Standard deviation of the phase at full signal, rad.
    noise: f64,
    /// Amplitude of disturbances like those at the ends of a sample, rad.
    wave: f64,
    has_holes: bool,
}

const CASES: [Case; 6] = [
    Case { name: "shear, 5 turns per line", num_turns: 5.0, noise: 0.1, wave: 2.0, has_holes: false },
    Case { name: "the same, two holes", num_turns: 5.0, noise: 0.1, wave: 2.0, has_holes: true },
    Case { name: "noise 0.3 rad, holes", num_turns: 5.0, noise: 0.3, wave: 2.0, has_holes: true },
    Case { name: "noise 0.5 rad, holes", num_turns: 5.0, noise: 0.5, wave: 2.0, has_holes: true },
    Case { name: "shear, 11 turns per line, holes", num_turns: 11.0, noise: 0.1, wave: 3.0, has_holes: true },
    Case { name: "the same, noise 0.3 rad", num_turns: 11.0, noise: 0.3, wave: 3.0, has_holes: true },
];

/// True phase, measured phase, standard deviation (as the magnitude tells it).
fn image(case: &Case, seed: u64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let [nx, ny, nz] = SHAPE;
    let (mut truth, mut phase, mut sd) = (Vec::new(), Vec::new(), Vec::new());
    for v in 0..nx * ny * nz {
        let at = |n: usize, of: usize| (n as f64 + 0.5) / of as f64 - 0.5;
        let (x, y, z) = (at(v % nx, nx), at(v / nx % ny, ny), at(v / (nx * ny), nz));
        let end = (-((0.5 - x.abs()) / 0.12)).exp();
        let value = TAU * case.num_turns * (y + 0.03 * (TAU * y).sin()) + case.wave * end * (TAU * (y + 0.7 * z)).sin();
        // Low signal: a hole of air, and a rim around it.
        let distance =
            [[-0.17, 0.0], [0.17, 0.0]].iter().map(|c| (x - c[0]).hypot(1.3 * (z - c[1]))).fold(9.0, f64::min);
        let magnitude = match case.has_holes {
            true if distance < 0.1 => 1e-3,
            true if distance < 0.14 => 0.4,
            _ => 1.0,
        };
        let noise = |rng: &mut ChaCha8Rng| -> f64 { StandardNormal.sample(rng) };
        let (re, im) = (magnitude + case.noise * noise(&mut rng), case.noise * noise(&mut rng));
        truth.push(value);
        phase.push(wrapped(value + im.atan2(re)));
        sd.push(case.noise / re.hypot(im).max(1e-9));
    }
    (truth, phase, sd)
}

/// Kept voxels with another number of turns than the truth (up to one number for all), before and after exclusion.
fn num_wrong(truth: &[f64], phase: &[f64]) -> usize {
    let turns: Vec<i64> =
        truth.iter().zip(phase).filter(|(_, p)| p.is_finite()).map(|(t, p)| ((p - t) / TAU).round() as i64).collect();
    let mut sorted = turns.clone();
    sorted.sort_unstable();
    let usual = sorted[sorted.len() / 2];
    turns.iter().filter(|t| **t != usual).count()
}

/// The table of docs/unwrapping.md; `cargo test unwrapping_table -- --nocapture --ignored` prints it.
#[test]
#[ignore = "prints the table of docs/unwrapping.md"]
fn unwrapping_table() {
    for case in &CASES {
        for method in [Method::Margin, Method::SecondDifference, Method::LeastSquares] {
            let (mut wrong, mut kept_wrong, mut left_out, mut total, mut seconds) = (0, [0; 2], [0; 2], 0, 0.0);
            for seed in 0..10 {
                let (truth, phase, sd) = image(case, seed);
                let image = WrappedImage { shape: SHAPE, phase: &phase, sd: &sd };
                let used: Vec<u32> = (0..sd.len() as u32).filter(|&v| sd[v as usize] <= 0.7).collect();
                let graph = Graph::new(&image, &used);
                let start = std::time::Instant::now();
                let whole = unwrapped_by(method, &graph);
                seconds += start.elapsed().as_secs_f64();
                let true_used: Vec<f64> = used.iter().map(|&v| truth[v as usize]).collect();
                wrong += num_wrong(&true_used, &whole);
                for (n, needs_agreement) in [false, true].into_iter().enumerate() {
                    let options = UnwrapOptions { method, needs_agreement, ..UnwrapOptions::default() };
                    let result = unwrap(&image, &options);
                    kept_wrong[n] += num_wrong(&truth, &result.phase);
                    left_out[n] += result.num_disputed + result.num_inconsistent + result.num_unconnected;
                }
                total += used.len();
            }
            let percent = |n: usize| 100.0 * n as f64 / total as f64;
            println!(
                "| {} | {method:?} | {:.3} % | {:.2} % | {:.4} % | {:.2} % | {:.4} % | {:.0} ms |",
                case.name,
                percent(wrong),
                percent(left_out[0]),
                percent(kept_wrong[0]),
                percent(left_out[1]),
                percent(kept_wrong[1]),
                100.0 * seconds
            );
        }
    }
}

/// A shear of eleven turns along each line of voxels, with waves at the ends and two holes without signal: every method
/// finds the truth in all but a few of the voxels that it keeps, and keeps nearly all with signal.
#[test]
fn steep_shear_with_holes_is_unwrapped() {
    let case = Case { name: "", num_turns: 11.0, noise: 0.1, wave: 3.0, has_holes: true };
    let (truth, phase, sd) = image(&case, 99);
    for method in [Method::Margin, Method::SecondDifference, Method::LeastSquares] {
        let image = WrappedImage { shape: SHAPE, phase: &phase, sd: &sd };
        let result = unwrap(&image, &UnwrapOptions { method, ..UnwrapOptions::default() });
        let n = result.num_voxels;
        let num_left_out =
            result.num_low_signal + result.num_disputed + result.num_inconsistent + result.num_unconnected;
        assert_eq!(n, result.num_kept + num_left_out);
        assert_eq!(result.num_kept, result.phase.iter().filter(|p| p.is_finite()).count());
        // A voxel of air has any phase; by chance one in some hundred of them agrees with its neighbours, a turn off.
        assert!(num_wrong(&truth, &result.phase) < 10, "{method:?}");
        // The holes are 7 % of the image, their rims 3 %.
        assert!(result.num_kept as f64 > 0.88 * n as f64, "{method:?} {result:?}", result = result.num_kept);
    }
}

/// Without noise, a wrapped linear field of any number of turns comes back exactly, up to whole turns.
#[test]
fn clean_fields_come_back() {
    let shape = [7, 9, 5];
    let truth: Vec<f64> =
        (0..315).map(|v| 2.9 * (v / 7 % 9) as f64 - 1.3 * (v % 7) as f64 + 0.7 * (v / 63) as f64).collect();
    let phase: Vec<f64> = truth.iter().map(|t| wrapped(*t)).collect();
    let sd = vec![0.01; 315];
    for method in [Method::Margin, Method::SecondDifference, Method::LeastSquares] {
        let image = WrappedImage { shape, phase: &phase, sd: &sd };
        let result = unwrap(&image, &UnwrapOptions { method, ..UnwrapOptions::default() });
        assert_eq!(result.num_kept, 315);
        let first = result.phase[0] - truth[0];
        assert!((first / TAU - (first / TAU).round()).abs() < 1e-12);
        // Rounding of sums of order thirty.
        assert!(result.phase.iter().zip(&truth).all(|(p, t)| (p - t - first).abs() < 1e-12), "{method:?}");
    }
}

/// Two regions without a voxel between them: the smaller one's turns are unknown, so it is left out and counted.
#[test]
fn islands_are_left_out() {
    let shape = [9, 4, 4];
    let phase: Vec<f64> = (0..144).map(|v| wrapped(0.9 * (v % 9) as f64)).collect();
    let sd: Vec<f64> = (0..144).map(|v| if v % 9 == 5 { 2.0 } else { 0.05 }).collect();
    let image = WrappedImage { shape, phase: &phase, sd: &sd };
    let result = unwrap(&image, &UnwrapOptions::default());
    assert_eq!((result.num_kept, result.num_low_signal, result.num_unconnected), (80, 16, 48));
    // Nothing at all: nothing is kept.
    let none = WrappedImage { shape, phase: &phase, sd: &vec![f64::INFINITY; 144] };
    assert_eq!(unwrap(&none, &UnwrapOptions::default()).num_kept, 0);
}

/// A dislocation: the phase winds once around a line, so no unwrapping is right everywhere. The kept voxels still agree
/// with all their kept neighbours.
#[test]
fn dislocations_are_cut_open() {
    let shape = [16, 16, 3];
    let phase: Vec<f64> = (0..768).map(|v| ((v / 16 % 16) as f64 - 7.5).atan2((v % 16) as f64 - 7.5)).collect();
    for method in [Method::Margin, Method::SecondDifference, Method::LeastSquares] {
        let image = WrappedImage { shape, phase: &phase, sd: &vec![0.05; 768] };
        let result = unwrap(&image, &UnwrapOptions { method, ..UnwrapOptions::default() });
        let num_left_out = result.num_disputed + result.num_inconsistent;
        assert!(num_left_out >= 3 * 6, "{method:?} {num_left_out}");
        for v in 0..768 {
            for (stride, n) in [(1, 16), (16, 16), (256, 3)] {
                if v / stride % n + 1 < n {
                    let step = result.phase[v + stride] - result.phase[v];
                    assert!(!(step.abs() > PI * (1.0 + 1e-9)), "{method:?} {step}");
                }
            }
        }
    }
}
