//! The first loading branch of a curve that is loaded and unloaded.
//!
//! An elastic material has one stress for each state. Where a test goes back, the stress on the way back is lower:
//! fitting both ways together would give a curve between them, which the material never follows. Fits of elastic
//! materials therefore take the first branch alone, and say so.

use super::csv::CsvCurve;
use super::csv_biaxial::BiaxialCsv;
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

/// The order of the rows by their times, where they have them and the drive then goes a shorter way in all: some
/// sources have damaged times and rows in the right order.
fn order_by_time(time_s: &[f64], drive: &[f64]) -> Option<Vec<usize>> {
    if time_s.len() != drive.len() || time_s.is_sorted() {
        return None;
    }
    let mut order: Vec<usize> = (0..drive.len()).collect();
    order.sort_by(|&a, &b| time_s[a].total_cmp(&time_s[b]));
    let by_time: Vec<f64> = order.iter().map(|&i| drive[i]).collect();
    (way(&by_time) < way(drive)).then_some(order)
}

fn reorder<T: Copy>(list: &mut Vec<T>, order: &[usize]) {
    *list = order.iter().map(|&i| list[i]).collect();
}

fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)])
}

/// The rows of the first way there and back.
struct Turn {
    start: usize,
    /// The last row of the way there.
    at: usize,
    /// The last row of the way back.
    end: usize,
}

impl Turn {
    /// The first one of a drive; none where it does not go back.
    fn of(drive: &[f64]) -> Option<Turn> {
        let [low, high] = range(drive.iter().copied());
        let least = LEAST_RETURN * (high - low);
        let mut start = 0;
        loop {
            let (at, certain) = turn_from(drive, start, least)?;
            if !is_jump(drive, start, at) {
                let next = turn_from(drive, at, least).map_or(drive.len() - 1, |(end, _)| end);
                return Some(Turn { start, at, end: next.max(certain) });
            }
            start = at + 1;
        }
    }

    /// The work done on the way there and given on the way back by a stress over its drive, where both ways lie.
    fn work(&self, drive: &[f64], stress: &[f64]) -> [f64; 2] {
        let points = |from: usize, to: usize| (from..=to).map(|i| (drive[i], stress[i])).collect::<Vec<_>>();
        let (out, back) = (points(self.start, self.at), points(self.at, self.end));
        let ([a, b], [c, d]) = (range(out.iter().map(|p| p.0)), range(back.iter().map(|p| p.0)));
        let (low, high) = (a.max(c), b.min(d));
        [work(&out, low, high), work(&back, low, high)]
    }

    /// What follows it in all `num_rows` rows of `drive`.
    fn unloading(&self, drive: &[f64], [done, given]: [f64; 2]) -> Unloading {
        Unloading {
            turn: drive[self.at],
            num_rows: drive.len() - 1 - self.at,
            dissipated_part: if done == 0.0 { 0.0 } else { 1.0 - given / done },
        }
    }
}

impl CsvCurve {
    /// Leaves the first loading branch, and says what followed it; `None`, and nothing is left out, where the test does
    /// not go back. Rows are put into the order of their times where the drive then goes a shorter way in all.
    pub fn take_first_loading(&mut self) -> Option<Unloading> {
        if let Some(order) = order_by_time(&self.time_s, &self.drive) {
            for list in [&mut self.time_s, &mut self.drive, &mut self.stress] {
                reorder(list, &order);
            }
        }
        let turn = Turn::of(&self.drive)?;
        let unloading = turn.unloading(&self.drive, turn.work(&self.drive, &self.stress));
        self.drive.truncate(turn.at + 1);
        self.stress.truncate(turn.at + 1);
        self.time_s.truncate(turn.at + 1);
        Some(unloading)
    }
}

impl BiaxialCsv {
    /// The same of a biaxial test, which turns where the drive with the larger range does; the work is that of all
    /// stresses that were measured.
    pub fn take_first_loading(&mut self) -> Option<Unloading> {
        let of_axis = |axis: usize, drives: &[[f64; 2]]| drives.iter().map(|d| d[axis]).collect::<Vec<f64>>();
        let extent = |axis: usize| {
            let [low, high] = range(self.drives.iter().map(|d| d[axis]));
            high - low
        };
        let leading = usize::from(extent(1) > extent(0));
        if let Some(order) = order_by_time(&self.time_s, &of_axis(leading, &self.drives)) {
            reorder(&mut self.time_s, &order);
            reorder(&mut self.drives, &order);
            self.stresses.iter_mut().flatten().for_each(|stress| reorder(stress, &order));
        }
        let drives = [0, 1].map(|axis| of_axis(axis, &self.drives));
        let turn = Turn::of(&drives[leading])?;
        let measured = drives.iter().zip(&self.stresses).filter_map(|(drive, stress)| Some((drive, stress.as_ref()?)));
        let work = measured.map(|(drive, stress)| turn.work(drive, stress));
        let unloading = turn.unloading(&drives[leading], work.fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]));
        self.drives.truncate(turn.at + 1);
        self.time_s.truncate(turn.at + 1);
        self.stresses.iter_mut().flatten().for_each(|stress| stress.truncate(turn.at + 1));
        Some(unloading)
    }
}

#[cfg(test)]
mod tests {
    use super::super::csv::{CsvOptions, read_csv};
    use super::super::csv_biaxial::read_biaxial_csv;
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

    /// A strip whose width is held but for scatter, there and back, with a fifth less of both stresses on the way back:
    /// the work of both counts, over what their own stretches go.
    #[test]
    fn a_biaxial_test_turns_with_its_leading_drive() {
        let row = |i: i32, part: f64| {
            let e = 0.05 * f64::from(i);
            let width = 1.0 + 1e-3 * f64::from(i % 2);
            format!("{},{width},{},{}\n", 1.0 + e, part * 10.0 * e, part * 5.0 * e)
        };
        let rows: String = (0..=20).map(|i| row(i, 1.0)).chain((0..20).rev().map(|i| row(i, 0.8))).collect();
        let text = format!("stretch_1,stretch_2,stress_1_kpa,stress_2_kpa\n{rows}");
        let mut found = read_biaxial_csv(&text, &CsvOptions::default()).unwrap();
        let unloading = found.take_first_loading().unwrap();
        assert_eq!((found.drives.len(), unloading.num_rows, unloading.turn), (21, 20, 2.0));
        assert!(found.stresses.iter().flatten().all(|stress| stress.len() == 21));
        // The stress over the scattered width does a thousandth of the work of the other.
        assert!((unloading.dissipated_part - (0.2 - 0.01)).abs() < 5e-3, "{unloading:?}");
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
