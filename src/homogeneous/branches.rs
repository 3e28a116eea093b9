//! The first loading branch of a curve that is loaded and unloaded.
//!
//! An elastic material has one stress for each state. Where a test goes back, the stress on the way back is lower:
//! fitting both ways together would give a curve between them, which the material never follows. Fits of elastic
//! materials therefore take the first branch alone, and say so.

use super::csv::CsvCurve;
use serde::Serialize;

/// A way back counts from this part of the drive's whole range on; less is scatter.
const LEAST_RETURN: f64 = 0.05;
/// A single step back by more than this part of the way to the start begins another block of rows and is no unloading.
const LARGEST_STEP: f64 = 0.5;

/// What follows the first loading branch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Unloading {
    /// The drive at which the test turns, in the curve's unit (a stretch, an amount of shear, or mm).
    pub turn: f64,
    /// Rows after the turn.
    pub num_rows: usize,
    /// Work that is not given back on the way back, relative to the work done over the same drives.
    pub dissipated_part: f64,
}

/// Index of the last row of the run that begins at row `start`, and the row at which the way back is certain.
fn turn_from(drive: &[f64], start: usize, least: f64) -> Option<(usize, usize)> {
    let (mut low, mut high) = (start, start);
    for i in start + 1..drive.len() {
        if drive[i] > drive[high] {
            high = i;
        }
        if drive[i] < drive[low] {
            low = i;
        }
        // The later of both extremes is where the run that is now ending has turned.
        let (extreme, back) = if high > low { (high, drive[high] - drive[i]) } else { (low, drive[i] - drive[low]) };
        if back > least && (drive[extreme] - drive[start]).abs() > least {
            return Some((extreme, i));
        }
    }
    None
}

/// Whether the row after `extreme` jumps most of the way back to where the run began.
fn is_jump(drive: &[f64], start: usize, extreme: usize) -> bool {
    let way = (drive[extreme] - drive[start]).abs();
    (drive[extreme + 1] - drive[extreme]).abs() > LARGEST_STEP * way
}

/// How far the drive goes in all, to and fro.
fn way(drive: &[f64]) -> f64 {
    drive.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum()
}

/// ∫ stress d(drive) from `low` to `high` along rows whose drive goes one way, by the trapezoidal rule.
fn work(points: &[(f64, f64)], low: f64, high: f64) -> f64 {
    let piece = |pair: &[(f64, f64)]| {
        let [(a, s), (b, t)] = [pair[0], pair[1]];
        let (from, to) = (a.min(b).max(low), a.max(b).min(high));
        if from >= to {
            return 0.0;
        }
        let at = |x: f64| s + (t - s) * (x - a) / (b - a);
        0.5 * (at(from) + at(to)) * (to - from)
    };
    points.windows(2).map(piece).sum()
}

impl CsvCurve {
    /// Leaves the first loading branch, and says what followed it; `None`, and nothing is left out, where the test does
    /// not go back. Rows are put into the order of their times where the drive then goes a shorter way in all.
    pub fn take_first_loading(&mut self) -> Option<Unloading> {
        if self.time_s.len() == self.drive.len() && !self.time_s.is_sorted() {
            let mut order: Vec<usize> = (0..self.drive.len()).collect();
            order.sort_by(|&a, &b| self.time_s[a].total_cmp(&self.time_s[b]));
            let by_time: Vec<f64> = order.iter().map(|&i| self.drive[i]).collect();
            // Some sources have damaged times and rows in the right order: the drive says which of both is right.
            if way(&by_time) >= way(&self.drive) {
                order = (0..self.drive.len()).collect();
            }
            for list in [&mut self.time_s, &mut self.drive, &mut self.stress] {
                *list = order.iter().map(|&i| list[i]).collect();
            }
        }
        let drive = &self.drive;
        let [low, high] = drive.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], d| [l.min(*d), h.max(*d)]);
        let least = LEAST_RETURN * (high - low);
        let mut start = 0;
        let (turn, end) = loop {
            let (extreme, certain) = turn_from(drive, start, least)?;
            if !is_jump(drive, start, extreme) {
                let next = turn_from(drive, extreme, least).map_or(drive.len() - 1, |(end, _)| end);
                break (extreme, next.max(certain));
            }
            start = extreme + 1;
        };
        let points = |from: usize, to: usize| (from..=to).map(|i| (self.drive[i], self.stress[i])).collect::<Vec<_>>();
        let (out, back) = (points(start, turn), points(turn, end));
        let span = |list: &[(f64, f64)]| {
            list.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], p| [l.min(p.0), h.max(p.0)])
        };
        let ([a, b], [c, d]) = (span(&out), span(&back));
        let (low, high) = (a.max(c), b.min(d));
        let (done, given) = (work(&out, low, high), work(&back, low, high));
        let unloading = Unloading {
            turn: drive[turn],
            num_rows: drive.len() - 1 - turn,
            dissipated_part: if done == 0.0 { 0.0 } else { 1.0 - given / done },
        };
        self.drive.truncate(turn + 1);
        self.stress.truncate(turn + 1);
        self.time_s.truncate(turn + 1);
        Some(unloading)
    }
}

#[cfg(test)]
mod tests {
    use super::super::csv::{CsvOptions, read_csv};
    use super::super::deformation::HomogeneousTest;
    use super::*;

    fn curve(points: &[(f64, f64)]) -> CsvCurve {
        let rows: String = points.iter().map(|(d, s)| format!("{d},{s}\n")).collect();
        read_csv(&format!("stretch,stress_kpa\n{rows}"), HomogeneousTest::Uniaxial, &CsvOptions::default()).unwrap()
    }

    /// Out with stress 10 x, back with 8 x (x from 0 to 1), twice: a fifth of the work stays, rows after the turn go.
    #[test]
    fn the_first_branch_is_left() {
        let out: Vec<(f64, f64)> = (0..=20).map(|i| (1.0 + 0.05 * f64::from(i), 0.5 * f64::from(i))).collect();
        let back: Vec<(f64, f64)> = out.iter().rev().skip(1).map(|(d, s)| (*d, 0.8 * s)).collect();
        let mut cycles = out.clone();
        cycles.extend(back.iter().chain(&out[1..]).chain(&back).copied());
        let mut found = curve(&cycles);
        let unloading = found.take_first_loading().unwrap();
        assert_eq!((found.drive.len(), unloading.num_rows, unloading.turn), (21, 60, 2.0));
        // The first piece of the way back joins the two lines: ½ × 2 × 0.05 of 5 less than a fifth.
        assert!((unloading.dissipated_part - (0.2 - 0.01)).abs() < 1e-12, "{unloading:?}");
        assert_eq!(found.take_first_loading(), None);
    }

    /// Scatter is no way back, nor is compression written below tension, nor a descending list.
    #[test]
    fn curves_that_do_not_go_back_are_whole() {
        let scattered: Vec<(f64, f64)> =
            (0..50).map(|i| (1.0 + 0.02 * f64::from(i) + 0.02 * f64::from(i % 3), f64::from(i))).collect();
        let mut blocks: Vec<(f64, f64)> = (0..10).map(|i| (1.0 + 0.1 * f64::from(i), f64::from(i))).collect();
        blocks.extend((0..10).map(|i| (1.0 - 0.03 * f64::from(i), -f64::from(i))));
        let falling: Vec<(f64, f64)> = (0..10).map(|i| (1.0 - 0.05 * f64::from(i), -f64::from(i))).collect();
        for points in [scattered, blocks, falling] {
            let mut found = curve(&points);
            assert_eq!(found.take_first_loading(), None);
            assert_eq!(found.drive.len(), points.len());
        }
    }

    #[test]
    fn rows_out_of_order_are_put_into_the_order_of_their_times() {
        let text = "time_s,stretch,stress_kpa\n0,1,0\n2,1.2,2\n1,1.1,1\n3,1.3,3\n";
        let mut found = read_csv(text, HomogeneousTest::Uniaxial, &CsvOptions::default()).unwrap();
        assert_eq!(found.take_first_loading(), None);
        assert_eq!(found.drive, [1.0, 1.1, 1.2, 1.3]);
        // Tenths that are counted on: 0.9, 0.10, 0.11.
        let text = "time_s,stretch,stress_kpa\n0.8,1,0\n0.9,1.1,1\n0.10,1.2,2\n0.11,1.3,3\n";
        let mut found = read_csv(text, HomogeneousTest::Uniaxial, &CsvOptions::default()).unwrap();
        assert_eq!(found.take_first_loading(), None);
        assert_eq!(found.drive, [1.0, 1.1, 1.2, 1.3]);
    }
}
