//! The spread found by calibrating on synthetic noisy scans beside the spread promised.

use super::axis::Axis;
use super::color::{AXIS, GRID, INK, MUTED, of_series};
use super::number::significant;
use super::svg::{NORMAL, SMALL, Svg, TITLE, TextStyle};
use super::text::{shortened, text_width};

/// One parameter of one specimen.
#[derive(Clone, Debug, Default)]
pub struct SpreadRow {
    /// Name of the specimen; rows of one specimen have one colour: `base` and `best` theirs, others in the order of
    /// first appearance.
    pub specimen: String,
    /// The parameter's symbol.
    pub parameter: String,
    /// Unit; empty for a pure number.
    pub unit: String,
    /// The value that made the synthetic scans.
    pub truth: f64,
    /// The values found, one per noise draw.
    pub found: Vec<f64>,
    /// Standard deviation promised by the Fisher information; infinite or NaN if the parameter is not identifiable.
    pub promised_sd: f64,
}

/// Rows of dots: each value found as (found − truth) / promised standard deviation.
#[derive(Clone, Debug, Default)]
pub struct SpreadPlot {
    /// Title above.
    pub title: String,
    /// The rows.
    pub rows: Vec<SpreadRow>,
}

const PLOT: f64 = 420.0;
const ROW: f64 = 34.0;
/// The axis covers at least ±3.5 and at most ±8 promised standard deviations; dots beyond are counted at the margin.
const HALF_RANGE: [f64; 2] = [3.5, 8.0];

impl SpreadPlot {
    /// The picture. The bands show one and two promised standard deviations; the bar is mean ± standard deviation
    /// found.
    pub fn to_svg(&self) -> String {
        if !self.rows.iter().any(|r| r.found.iter().any(|v| v.is_finite())) {
            return Svg::placeholder(&self.title, "no calibration was made");
        }
        let largest = self.rows.iter().flat_map(deviations).map(f64::abs).filter(|d| d.is_finite()).fold(0.0, f64::max);
        let half = (largest * 1.05).clamp(HALF_RANGE[0], HALF_RANGE[1]);
        let axis = Axis::linear(-half, half);
        let names = self.rows.iter().map(|r| text_width(&row_label(r), NORMAL)).fold(0.0, f64::max);
        let left = (names + 22.0).clamp(70.0, 260.0);
        let (top, height) = (62.0, ROW * self.rows.len() as f64);
        let columns = [left + PLOT + 74.0, left + PLOT + 148.0, left + PLOT + 196.0];
        let mut svg = Svg::new(columns[2] + 16.0, top + height + 50.0);
        svg.text([left, 18.0], &shortened(&self.title, TITLE, PLOT + 180.0), &TextStyle::title());
        let note = "dots: one noise draw each · bar: mean ± standard deviation found · bands: ±1, ±2 promised";
        svg.text([left, 36.0], note, &TextStyle::note());
        for (x, name) in columns.into_iter().zip(["found sd", "promised sd", "ratio"]) {
            svg.text([x, top - 8.0], name, &TextStyle::note().end());
        }

        let at = |v: f64| left + PLOT * axis.fraction(v);
        svg.rect([at(-2.0), top, at(2.0) - at(-2.0), height], "#f4f4f2");
        svg.rect([at(-1.0), top, at(1.0) - at(-1.0), height], "#e9e9e6");
        svg.line([at(0.0), top - 4.0], [at(0.0), top + height], MUTED, 1.0, "");
        for tick in axis.ticks(8) {
            let x = at(tick.value);
            svg.line([x, top + height], [x, top + height + 4.0], AXIS, 1.0, "");
            svg.text([x, top + height + 16.0], &tick.label, &TextStyle::note().middle());
        }
        svg.line([left, top + height], [left + PLOT, top + height], AXIS, 1.0, "");
        let label = "(found − truth) / promised standard deviation";
        svg.text([left + 0.5 * PLOT, top + height + 36.0], label, &TextStyle::new(NORMAL).middle());

        let mut specimens: Vec<&str> = Vec::new();
        for (r, row) in self.rows.iter().enumerate() {
            let color = specimens.iter().position(|s| *s == row.specimen).unwrap_or_else(|| {
                specimens.push(&row.specimen);
                specimens.len() - 1
            });
            let y = top + ROW * (r as f64 + 0.5);
            if r > 0 && self.rows[r - 1].specimen != row.specimen {
                svg.line([8.0, y - 0.5 * ROW], [columns[2], y - 0.5 * ROW], GRID, 1.0, "");
            }
            svg.text([left - 12.0, y + 0.35 * NORMAL], &row_label(row), &TextStyle::new(NORMAL).end());
            draw_row(&mut svg, row, &axis, [left, y], of_series(&row.specimen, color));
            let found_sd = standard_deviation(&row.found).map_or(f64::NAN, |(_, sd)| sd);
            let with_unit = |v: f64| {
                let unit = if v.is_finite() { row.unit.as_str() } else { "" };
                format!("{} {unit}", significant(v, 2)).trim_end().to_string()
            };
            let cells = [with_unit(found_sd), with_unit(row.promised_sd), significant(found_sd / row.promised_sd, 2)];
            for (x, cell) in columns.into_iter().zip(cells) {
                svg.text([x, y + 0.35 * SMALL], &cell, &TextStyle::new(SMALL).end());
            }
        }
        svg.finish(&self.title)
    }
}

fn row_label(row: &SpreadRow) -> String {
    format!("{}  {}", row.specimen, row.parameter)
}

fn deviations(row: &SpreadRow) -> Vec<f64> {
    if !(row.promised_sd.is_finite() && row.promised_sd > 0.0) {
        return Vec::new();
    }
    row.found.iter().map(|v| (v - row.truth) / row.promised_sd).collect()
}

/// Mean and standard deviation (n − 1) of the finite values; None for fewer than two.
fn standard_deviation(values: &[f64]) -> Option<(f64, f64)> {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    if finite.len() < 2 {
        return None;
    }
    let n = finite.len() as f64;
    let mean = finite.iter().sum::<f64>() / n;
    Some((mean, (finite.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()))
}

fn draw_row(svg: &mut Svg, row: &SpreadRow, axis: &Axis, [left, y]: [f64; 2], color: &'static str) {
    let deviations = deviations(row);
    let middle = left + 0.5 * PLOT;
    if deviations.is_empty() {
        svg.text([middle + 6.0, y + 0.35 * SMALL], "not identifiable: nothing was promised", &TextStyle::note());
        return;
    }
    let at = |v: f64| left + PLOT * axis.fraction(v);
    let (mut below, mut above, mut failed) = (0, 0, 0);
    svg.open_translucent(0.7);
    for (i, &d) in deviations.iter().enumerate() {
        if !d.is_finite() {
            failed += 1;
        } else if d < axis.low {
            below += 1;
        } else if d > axis.high {
            above += 1;
        } else {
            // Dots are shifted by turns so that equal values stay visible.
            let shift = [0.0, -3.0, 3.0, -6.0, 6.0][i % 5];
            svg.circle([at(d), y + 4.0 + 0.5 * shift], 2.6, color, "none", 0.0);
        }
    }
    svg.close_group();
    if let Some((mean, sd)) = standard_deviation(&deviations) {
        let (low, high) = ((mean - sd).max(axis.low), (mean + sd).min(axis.high));
        let bar = y - 8.0;
        if low <= high {
            svg.line([at(low), bar], [at(high), bar], INK, 1.6, "");
            for end in [low, high] {
                svg.line([at(end), bar - 3.0], [at(end), bar + 3.0], INK, 1.6, "");
            }
        }
        if (axis.low..=axis.high).contains(&mean) {
            svg.circle([at(mean), bar], 3.0, INK, "#ffffff", 1.0);
        }
    }
    if below > 0 {
        svg.text([left + 2.0, y + 8.0], &format!("◂ {below}"), &TextStyle::note());
    }
    let failures = (failed > 0).then(|| format!("{failed} failed"));
    let beyond = (above > 0).then(|| format!("{above} ▸"));
    let notes: Vec<String> = failures.into_iter().chain(beyond).collect();
    svg.text([left + PLOT - 2.0, y + 8.0], &notes.join(" · "), &TextStyle::note().end());
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    pub(in super::super) fn sample() -> SpreadPlot {
        let row = |specimen: &str, parameter: &str, unit: &str, truth: f64, sd: f64, widening: f64| SpreadRow {
            specimen: specimen.into(),
            parameter: parameter.into(),
            unit: unit.into(),
            truth,
            // Sums of three low-discrepancy numbers are near a normal distribution of variance ¼.
            found: (1..=20u32)
                .map(|i| {
                    let u = |a: f64| (f64::from(i) * a).fract() - 0.5;
                    truth + 2.0 * widening * sd * (u(0.618_034) + u(0.414_214) + u(0.236_068))
                })
                .collect(),
            promised_sd: sd,
        };
        let mut rows = vec![
            row("base", "κ", "kPa", 2173.0, f64::INFINITY, 0.0),
            row("base", "μ₁", "kPa", 17.0, 0.22, 1.1),
            row("base", "α₁", "", 1.91, 0.031, 0.9),
            row("best", "κ", "kPa", 2173.0, 410.0, 1.3),
            row("best", "μ₁", "kPa", 17.0, 0.11, 1.0),
            row("best", "α₁", "", 1.91, 0.012, 1.05),
        ];
        rows[3].found[2] = 1e5;
        rows[3].found[3] = f64::NAN;
        SpreadPlot { title: "Spread found beside spread promised, 20 noise draws".into(), rows }
    }

    #[test]
    fn rows_are_drawn() {
        let svg = sample().to_svg();
        assert_well_formed(&svg);
        assert_eq!(svg, sample().to_svg());
        assert!(svg.contains("1 ▸") && svg.contains("1 failed") && svg.contains("not identifiable"));
    }

    #[test]
    fn the_standard_deviation_is_the_sample_s() {
        let (mean, sd) = standard_deviation(&[1.0, f64::NAN, 3.0]).expect("two values");
        // Closed form: mean 2, variance (1 + 1) / (2 − 1).
        assert!((mean - 2.0).abs() < 1e-15 && (sd - 2f64.sqrt()).abs() < 1e-15);
        assert!(standard_deviation(&[1.0]).is_none());
    }

    #[test]
    fn poor_data_make_a_placeholder() {
        assert!(SpreadPlot::default().to_svg().contains("no calibration"));
        let mut plot = sample();
        plot.rows.iter_mut().for_each(|r| r.found.clear());
        assert!(plot.to_svg().contains("no calibration"));
        let mut plot = sample();
        plot.rows.iter_mut().for_each(|r| r.truth = f64::NAN);
        assert_well_formed(&plot.to_svg());
    }
}
