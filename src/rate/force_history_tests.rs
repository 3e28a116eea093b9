//! Recovery of relaxations from force histories.

use super::super::force_history_input::ShearLayer;
use super::super::prony::{PronyTerm, relax};
use super::*;
use crate::homogeneous::TableError;
use crate::material::ShearTerm;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

/// A stepped history like a scan's: precondition, three holds.
fn drives() -> (Vec<f64>, Vec<f64>) {
    let corners = [
        (0.0, 0.0),
        (5.0, 0.0),
        (12.0, 3.5),
        (18.0, 3.5),
        (25.0, 0.0),
        (55.0, 0.0),
        (60.0, 2.5),
        (120.0, 2.5),
        (125.0, 5.0),
        (185.0, 5.0),
        (189.0, 7.0),
        (250.0, 7.0),
        (264.0, 0.0),
    ];
    let times: Vec<f64> = (0..=528).map(|i| 0.5 * f64::from(i)).collect();
    let drive = times
        .iter()
        .map(|&t| {
            let i = corners.partition_point(|c| c.0 <= t).clamp(1, corners.len() - 1);
            let (a, b) = (corners[i - 1], corners[i]);
            a.1 + (b.1 - a.1) * (t - a.0) / (b.0 - a.0)
        })
        .collect();
    (times, drive)
}

fn table() -> ForceTable {
    let drive: Vec<f64> = (0..=14).map(|i| 0.5 * f64::from(i)).collect();
    let force: Vec<f64> = drive.iter().map(|d| 2.2 * d + 0.004 * d * d * d).collect();
    ForceTable::odd(&drive, &force).unwrap()
}

fn history(terms: &[PronyTerm], noise: f64, seed: u64) -> ForceHistory {
    let (time_s, drive_mm) = drives();
    let elastic = table().forces(&drive_mm).unwrap();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let force_n = relax(&time_s, &elastic, terms)
        .unwrap()
        .values
        .iter()
        .map(|f| 1.1 * f + 0.02 + noise * rng.sample::<f64, _>(StandardNormal))
        .collect();
    ForceHistory { time_s, drive_mm, force_n, force_sd_n: None }
}

const TRUTH: [PronyTerm; 2] = [PronyTerm { strength: 0.25, time_s: 8.0 }, PronyTerm { strength: 0.15, time_s: 60.0 }];

/// Taylor remainders of the Jacobian in all unknowns, second order.
#[test]
fn the_jacobian_passes_the_taylor_test() {
    let h = history(&TRUTH, 0.0, 0);
    let layer = ShearLayer { gap_mm: 6.4, terms: vec![ShearTerm { modulus_kpa: 30.0, alpha: 2.2 }] };
    let options = ForceHistoryOptions { layer: Some(layer), min_drive_mm: 0.1, ..ForceHistoryOptions::default() };
    let elastic = Elastic::new(&h, &table(), &options).unwrap();
    let x = [1.1, 0.02, 0.25, 8f64.ln(), 0.15, 60f64.ln()];
    let (r, j) = elastic.evaluate(&x);
    for i in 0..6 {
        let remainder = |step: f64| {
            let mut moved = x;
            moved[i] += step;
            let mut all = moved.to_vec();
            // A second unknown moves along, so that mixed terms count.
            all[0] += step;
            let found = elastic.evaluate(&all).0;
            (found - &r - step * (j.column(i) + j.column(0))).amax()
        };
        let (coarse, fine) = (remainder(1e-2), remainder(1e-3));
        assert!(fine < 0.015 * coarse + 1e-11, "{i}: {coarse} {fine}");
    }
}

/// 120 draws at 0.5 % noise: two relaxations are chosen, and the intervals of g and τ hold the truth in 90 to 99 %
/// (binomial 95 % ± 4 %).
#[test]
fn two_relaxations_are_recovered_with_honest_intervals() {
    let draws = 120;
    let (mut chosen, mut inside) = (0, [0; 6]);
    for seed in 0..draws {
        let sequence =
            fit_force_history(&history(&TRUTH, 0.05, seed), &table(), &ForceHistoryOptions::default()).unwrap();
        chosen += usize::from(sequence.chosen().relaxations.len() == 2);
        let fit = &sequence.fits[2];
        let holds = |i: &Interval, v: f64| usize::from(i.interval_95[0] <= v && v <= i.interval_95[1]);
        for (k, truth) in TRUTH.iter().enumerate() {
            inside[2 * k] += holds(&fit.relaxations[k].strength, truth.strength);
            inside[2 * k + 1] += holds(&fit.relaxations[k].time_s, truth.time_s);
        }
        inside[4] += holds(&fit.scale, 1.1);
        inside[5] += holds(&fit.offset_n, 0.02);
    }
    println!("two chosen in {chosen} of {draws}; inside {inside:?}");
    assert!(chosen >= 114, "{chosen}");
    assert!(inside.iter().all(|&n| (108..=119).contains(&n)), "{inside:?}");
}

/// 200 elastic controls: relaxation named in at most 2 %.
#[test]
fn elastic_histories_name_no_relaxation() {
    let named = (0..200)
        .filter(|&seed| {
            let options = ForceHistoryOptions { max_terms: 2, ..ForceHistoryOptions::default() };
            let sequence = fit_force_history(&history(&[], 0.05, 1000 + seed), &table(), &options).unwrap();
            !sequence.chosen().relaxations.is_empty()
        })
        .count();
    println!("relaxation named in {named} of 200 controls");
    assert!(named <= 4, "{named}");
}

/// Shifting the clock, or the unit of force, changes nothing but the numbers' units.
#[test]
fn units_and_clock_do_not_matter() {
    let h = history(&TRUTH, 0.05, 7);
    let moved = ForceHistory {
        time_s: h.time_s.iter().map(|t| t + 1e4).collect(),
        force_n: h.force_n.iter().map(|f| 1e3 * f).collect(),
        ..h.clone()
    };
    let a = fit_force_history(&h, &table(), &ForceHistoryOptions::default()).unwrap();
    let b = fit_force_history(&moved, &table(), &ForceHistoryOptions::default()).unwrap();
    assert_eq!(a.selection.by_bic, b.selection.by_bic);
    for (p, q) in a.chosen().terms().iter().zip(b.chosen().terms()) {
        // The fits stop at 1e-10 of the sum of squares, 1e-5 of a standard deviation.
        assert!((p.strength - q.strength).abs() < 1e-4 && (p.time_s / q.time_s - 1.0).abs() < 1e-3);
    }
}

#[test]
fn bad_input_is_refused() {
    let mut h = history(&[], 0.0, 0);
    let bad = |h: &ForceHistory| fit_force_history(h, &table(), &ForceHistoryOptions::default());
    h.drive_mm[3] = 9.0;
    assert!(matches!(bad(&h), Err(ForceHistoryError::Table(TableError::Outside { .. }))));
    h.drive_mm = vec![1.0; h.time_s.len()];
    assert!(matches!(bad(&h), Err(ForceHistoryError::NoInformation { .. })));
    h.force_n[0] = f64::NAN;
    assert!(matches!(bad(&h), Err(ForceHistoryError::History(HistoryError::Value { .. }))));
    h.force_n.pop();
    assert!(matches!(bad(&h), Err(ForceHistoryError::History(HistoryError::Length { .. }))));
}
