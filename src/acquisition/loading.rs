//! The loading history that goes with a scan: ramps, holds, a load cell that drifts and scatters.

use super::AcquisitionError;
use crate::homogeneous::ForceTable;
use crate::recording::LoadCurve;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use utoipa::ToSchema;

/// Streams of the random generator below this are the images'.
const STREAM: u64 = 1 << 40;

/// How the actuator moves and the load cell reads.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, ToSchema)]
pub struct LoadProgram {
    /// Rest before the first ramp, s.
    pub rest_s: f64,
    /// Speed of the ramps, mm/s.
    pub speed_mm_per_s: f64,
    /// Length of each hold, s.
    pub hold_s: f64,
    /// The scan begins this long after the ramp and ends this long before the next, s.
    pub settle_s: f64,
    /// Time between readings, s.
    pub interval_s: f64,
    /// Standard deviation of the cell's slow drift: one number per hold, N.
    pub drift_sd_n: f64,
    /// Standard deviation of a single reading, N.
    pub reading_sd_n: f64,
}

impl Default for LoadProgram {
    fn default() -> Self {
        LoadProgram {
            rest_s: 5.0,
            speed_mm_per_s: 0.5,
            hold_s: 60.0,
            settle_s: 8.0,
            interval_s: 0.5,
            drift_sd_n: 0.02,
            reading_sd_n: 0.01,
        }
    }
}

impl LoadProgram {
    fn check(&self) -> Result<(), AcquisitionError> {
        let positive = [
            ("speed_mm_per_s", self.speed_mm_per_s),
            ("interval_s", self.interval_s),
            ("the scan's window, hold_s − 2 settle_s", self.hold_s - 2.0 * self.settle_s),
        ];
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(AcquisitionError::Value { name, value, requirement: "positive and finite" });
            }
        }
        let others = [
            ("rest_s", self.rest_s),
            ("settle_s", self.settle_s),
            ("drift_sd_n", self.drift_sd_n),
            ("reading_sd_n", self.reading_sd_n),
        ];
        for (name, value) in others {
            if !(value.is_finite() && value >= 0.0) {
                return Err(AcquisitionError::Value { name, value, requirement: "finite and not negative" });
            }
        }
        Ok(())
    }
}

/// The readings of a program that holds at `drives_mm`, of a sample with the true force `force` (N over the distance
/// from rest in mm), and the window of each hold. Times and readings are rounded as a file stores them.
///
/// # Errors
/// [`AcquisitionError::Value`]; [`AcquisitionError::Force`] where the table does not reach to all drives.
pub fn loading_history(
    drives_mm: &[f64],
    force: &ForceTable,
    program: &LoadProgram,
    seed: u64,
) -> Result<(LoadCurve, Vec<[f64; 2]>), AcquisitionError> {
    program.check()?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(STREAM);
    let mut normal = |sd: f64| {
        let x: f64 = StandardNormal.sample(&mut rng);
        sd * x
    };
    let mut windows = Vec::with_capacity(drives_mm.len());
    // Corners of the drive over time, with the cell's drift.
    let mut corners = vec![[0.0, 0.0, 0.0], [program.rest_s, 0.0, 0.0]];
    for &drive in drives_mm {
        let [start, from, _] = corners[corners.len() - 1];
        let arrival = start + (drive - from).abs() / program.speed_mm_per_s;
        let drift = normal(program.drift_sd_n);
        corners.push([arrival, drive, drift]);
        corners.push([arrival + program.hold_s, drive, drift]);
        let round = |t: f64| (t / program.interval_s).round() * program.interval_s;
        windows.push([round(arrival + program.settle_s), round(arrival + program.hold_s - program.settle_s)]);
    }
    let end = corners[corners.len() - 1][0];
    let num_readings = (end / program.interval_s) as usize + 1;
    let mut load = LoadCurve::default();
    let mut piece = 0;
    for n in 0..num_readings {
        let time = n as f64 * program.interval_s;
        while piece + 2 < corners.len() && corners[piece + 1][0] <= time {
            piece += 1;
        }
        let ([t0, d0, c0], [t1, d1, c1]) = (corners[piece], corners[piece + 1]);
        let part = if t1 > t0 { ((time - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { 1.0 };
        let (drive, drift) = (d0 + part * (d1 - d0), c0 + part * (c1 - c0));
        let force = force.at(drive.abs())?.0 + drift + normal(program.reading_sd_n);
        load.time_s.push(time);
        load.drive_mm.push((1e4 * drive).round() / 1e4);
        load.force_n.push((1e4 * force).round() / 1e4);
    }
    Ok((load, windows))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_lie_in_their_holds() {
        let program = LoadProgram { drift_sd_n: 0.0, reading_sd_n: 0.0, ..LoadProgram::default() };
        let table = |sign: f64| ForceTable::new(&[0.0, 2.5, 5.0], &[0.0, sign * 5.0, sign * 11.0]).unwrap();
        let (load, windows) = loading_history(&[2.5, 5.0], &table(1.0), &program, 7).unwrap();
        for ((window, drive), force) in windows.iter().zip([2.5, 5.0]).zip([5.0, 11.0]) {
            let held = load.time_s.iter().zip(&load.drive_mm).filter(|(t, _)| (window[0]..=window[1]).contains(*t));
            assert!(held.clone().count() > 50);
            // Drives are rounded to 10⁻⁴ mm.
            held.for_each(|(_, d)| assert!((d - drive).abs() < 1e-4));
            // Readings are rounded to 10⁻⁴ N.
            assert!((load.mean_force_n(*window).unwrap() - force).abs() < 1e-4);
        }
        assert!(load.drive_mm.windows(2).all(|d| d[1] >= d[0]));
        // The other way all is negative, but for noise and drift: none here.
        let quiet = LoadProgram { drift_sd_n: 0.0, reading_sd_n: 0.0, ..LoadProgram::default() };
        let [there, back] =
            [1.0, -1.0].map(|sign| loading_history(&[sign * 2.5, sign * 5.0], &table(sign), &quiet, 3).unwrap().0);
        let is_negative = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a + b).abs() < 1e-12);
        assert!(is_negative(&there.force_n, &back.force_n) && is_negative(&there.drive_mm, &back.drive_mm));
        // The force rises with the drive: the curve between the holds is monotone (rounding 10⁻⁴).
        assert!(load.force_n.windows(2).all(|f| f[1] >= f[0] - 1e-4));
    }

    /// The drift stays within a hold and is what the mean over the window scatters by.
    #[test]
    fn drift_dominates_the_mean() {
        let program = LoadProgram { drift_sd_n: 0.1, reading_sd_n: 0.01, ..LoadProgram::default() };
        let table = ForceTable::new(&[0.0, 5.0], &[0.0, 10.0]).unwrap();
        let deviations: Vec<f64> = (0..400)
            .map(|seed| {
                let (load, windows) = loading_history(&[5.0], &table, &program, seed).unwrap();
                load.mean_force_n(windows[0]).unwrap() - 10.0
            })
            .collect();
        let sd = (deviations.iter().map(|d| d * d).sum::<f64>() / 400.0).sqrt();
        // A standard deviation from 400 draws scatters by 1/√800 = 3.5 %: four of those.
        assert!((sd / 0.1 - 1.0).abs() < 0.14, "{sd}");
    }

    #[test]
    fn bad_programs_are_refused() {
        let table = ForceTable::new(&[0.0, 1.0], &[0.0, 1.0]).unwrap();
        let program = LoadProgram { settle_s: 40.0, ..LoadProgram::default() };
        assert!(matches!(loading_history(&[1.0], &table, &program, 0), Err(AcquisitionError::Value { .. })));
        let beyond = loading_history(&[2.0], &table, &LoadProgram::default(), 0);
        assert!(matches!(beyond, Err(AcquisitionError::Force(_))));
    }
}
