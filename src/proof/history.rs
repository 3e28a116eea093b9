//! The load curve of an experiment: what a load cell would have read, with what time and the cell add to it.

use super::draw::{Draw, HiddenCause};
use super::experiment::Experiment;
use crate::homogeneous::{ForceTable, TableError};
use crate::recording::LoadCurve;

/// The load cell: drift of each hold and a single reading, N.
pub(super) const DRIFT_SD_N: f64 = 0.02;
const READING_SD_N: f64 = 0.03;
/// The loading: time between readings, rest, hold, and what of a hold is not scanned, s; speed, mm/s.
const INTERVAL_S: f64 = 0.5;
const REST_S: f64 = 8.0;
const HOLD_S: f64 = 56.0;
const SETTLE_S: f64 = 7.0;
const SPEED_MM_PER_S: f64 = 0.5;
/// The first cycle goes this much beyond the largest drive.
pub(super) const BEYOND: f64 = 1.1;

/// What a load cell would have read.
pub(super) struct History {
    /// The load curve.
    pub(super) load: LoadCurve,
    /// From when to when each step is scanned, s.
    pub(super) windows_s: Vec<[f64; 2]>,
    /// The mean force of each, N.
    pub(super) means_n: Vec<f64>,
}

/// The load curve of a first cycle beyond the largest drive and then the steps with holds; windows and mean forces of
/// the steps. `curve` is the elastic force (N) over drive (mm) from rest to beyond the largest drive.
///
/// # Errors
/// [`TableError`] where the drives of `curve` do not rise.
pub(super) fn history(
    curve: &[[f64; 2]],
    steps_mm: &[f64],
    experiment: &Experiment,
    noise: &mut Draw,
) -> Result<History, TableError> {
    let [table_mm, forces]: [Vec<f64>; 2] = [0, 1].map(|i| curve.iter().map(|point| point[i]).collect());
    let table = ForceTable::new(&table_mm, &forces)?;
    let beyond = table.range()[1];
    let mut corners = vec![[0.0, 0.0], [REST_S, 0.0]];
    let ramp = |corners: &mut Vec<[f64; 2]>, to: f64| {
        let [t, from] = corners[corners.len() - 1];
        corners.push([t + (to - from).abs() / SPEED_MM_PER_S, to]);
    };
    let hold = |corners: &mut Vec<[f64; 2]>, time: f64| {
        let [t, at] = corners[corners.len() - 1];
        corners.push([t + time, at]);
    };
    ramp(&mut corners, beyond);
    ramp(&mut corners, 0.0);
    hold(&mut corners, 3.0 * REST_S);
    let mut windows = Vec::new();
    for &drive in steps_mm {
        ramp(&mut corners, drive);
        let arrival = corners[corners.len() - 1][0];
        hold(&mut corners, HOLD_S);
        windows.push([arrival + SETTLE_S, arrival + HOLD_S - SETTLE_S]);
    }
    ramp(&mut corners, 0.0);
    let end = corners[corners.len() - 1][0];
    let mut load = LoadCurve::default();
    let mut piece = 0;
    let (mut memory, mut last_elastic, mut furthest) = (0.0, 0.0, 0.0f64);
    let mut drift = DRIFT_SD_N * noise.normal();
    for n in 0..=(end / INTERVAL_S) as usize {
        let time = n as f64 * INTERVAL_S;
        while piece + 2 < corners.len() && corners[piece + 1][0] <= time {
            piece += 1;
            drift = DRIFT_SD_N * noise.normal();
        }
        let ([t0, d0], [t1, d1]) = (corners[piece], corners[piece + 1]);
        let drive = if t1 > t0 { d0 + (d1 - d0) * ((time - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { d1 };
        let elastic = table.at(drive)?.0;
        let mut force = elastic;
        for hidden in &experiment.hidden {
            match hidden.cause {
                HiddenCause::Relaxation => {
                    // The force itself relaxes (Fung's quasi-linear model), which the diagnosis does not suppose.
                    let tau = hidden.center_mm[0];
                    let new = (elastic - last_elastic) * (-0.5 * INTERVAL_S / tau).exp();
                    memory = memory * (-INTERVAL_S / tau).exp() + new;
                    force += hidden.strength * memory;
                }
                HiddenCause::Mullins => {
                    // Softening in proportion to how far the drive has been, of a form of its own.
                    furthest = furthest.max(drive);
                    force *= 1.0 - hidden.strength * (1.0 - (-3.0 * (furthest - drive) / beyond).exp());
                }
                HiddenCause::Cell => force += hidden.strength,
                _ => {}
            }
        }
        last_elastic = elastic;
        load.time_s.push(time);
        load.drive_mm.push(drive);
        load.force_n.push(force + drift + READING_SD_N * noise.normal());
    }
    let means_n = windows
        .iter()
        .map(|[start, end]| {
            let inside: Vec<f64> = load
                .time_s
                .iter()
                .zip(&load.force_n)
                .filter(|(t, _)| **t >= *start && **t <= *end)
                .map(|(_, f)| *f)
                .collect();
            inside.iter().sum::<f64>() / inside.len().max(1) as f64
        })
        .collect();
    Ok(History { load, windows_s: windows, means_n })
}
