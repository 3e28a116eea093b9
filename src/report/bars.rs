//! Values per parameter as bars, one per specimen, with the values written.

use super::axis::Axis;
use super::color::{AXIS, EMPTY, GRID, MUTED, of_series};
use super::number::significant;
use super::svg::{NORMAL, SMALL, Svg, TITLE, TextStyle};
use super::text::{shortened, text_width, wrapped};

/// The values of one parameter.
#[derive(Clone, Debug, Default)]
pub struct BarGroup {
    /// The parameter.
    pub label: String,
    /// One value per series; NaN or infinite where there is none.
    pub values: Vec<f64>,
}

/// Horizontal bars in groups. On a logarithmic axis, where a bar's length would mean nothing, dots take their place.
#[derive(Clone, Debug, Default)]
pub struct GroupedBars {
    /// Title above.
    pub title: String,
    /// What the axis shows, with unit.
    pub axis_label: String,
    /// Names of the series, such as `base` and `best`.
    pub series: Vec<String>,
    /// The groups.
    pub groups: Vec<BarGroup>,
    /// Logarithmic axis; values that are not positive count as missing.
    pub is_log: bool,
    /// A value to mark by a line, such as 1 for ratios.
    pub reference: Option<f64>,
    /// What stands in place of a missing value; empty means `not available`.
    pub missing_label: String,
}

const PLOT: f64 = 440.0;
const BAR: f64 = 15.0;
const BETWEEN: f64 = 14.0;
/// From one line of a label to the next.
const LINE: f64 = 13.0;

impl GroupedBars {
    /// The picture.
    pub fn to_svg(&self) -> String {
        let num_series = self.series.len();
        let usable = |v: f64| v.is_finite() && (!self.is_log || v > 0.0);
        let values = || self.groups.iter().flat_map(|g| g.values.iter().take(num_series).copied());
        let reference = self.reference.filter(|r| usable(*r));
        let zero = (!self.is_log).then_some(0.0);
        let padding = if self.is_log { 0.06 } else { 0.0 };
        let covered = values().filter(|v| usable(*v)).chain(reference).chain(zero);
        let axis = Axis::covering(covered, self.is_log, padding).filter(|_| values().any(usable));
        let Some(axis) = axis else {
            return Svg::placeholder(&self.title, "no values to show");
        };
        let labels = self.groups.iter().map(|g| text_width(&g.label, NORMAL)).fold(0.0, f64::max);
        let left = (labels + 22.0).clamp(60.0, 240.0);
        let top = 56.0;
        let labels: Vec<Vec<String>> = self.groups.iter().map(|g| wrapped(&g.label, NORMAL, left - 14.0)).collect();
        // A label of many lines may be higher than its bars.
        let group_height = |g: usize| (num_series as f64 * BAR).max(labels[g].len() as f64 * LINE) + BETWEEN;
        let height: f64 = (0..self.groups.len()).map(group_height).sum();
        let mut svg = Svg::new(left + PLOT + 110.0, top + height + 46.0);
        svg.text([left, 18.0], &shortened(&self.title, TITLE, PLOT + 100.0), &TextStyle::title());
        self.draw_key(&mut svg, [left, 38.0]);

        let at = |v: f64| left + PLOT * axis.fraction(v);
        for tick in axis.ticks(6) {
            svg.line([at(tick.value), top], [at(tick.value), top + height], GRID, 1.0, "");
            svg.text([at(tick.value), top + height + 15.0], &tick.label, &TextStyle::note().middle());
        }
        svg.text([left + 0.5 * PLOT, top + height + 34.0], &self.axis_label, &TextStyle::new(NORMAL).middle());
        let mut below_last = top;
        for (g, (group, lines)) in self.groups.iter().zip(&labels).enumerate() {
            let middle = below_last + 0.5 * group_height(g);
            below_last += group_height(g);
            let y = middle - 0.5 * num_series as f64 * BAR;
            for (n, line) in lines.iter().enumerate() {
                let below = (n as f64 - 0.5 * (lines.len() - 1) as f64) * LINE;
                svg.text([left - 12.0, middle + below + 0.35 * NORMAL], line, &TextStyle::new(NORMAL).end());
            }
            for s in 0..num_series {
                let value = group.values.get(s).copied().unwrap_or(f64::NAN);
                self.draw_value(&mut svg, value, of_series(&self.series[s], s), [left, y + s as f64 * BAR], &at);
            }
        }
        let base = if self.is_log { left } else { at(0.0) };
        svg.line([base, top], [base, top + height], AXIS, 1.0, "");
        if let Some(reference) = reference {
            svg.line([at(reference), top - 4.0], [at(reference), top + height], MUTED, 1.0, "4 3");
        }
        svg.finish(&self.title)
    }

    fn draw_value(&self, svg: &mut Svg, value: f64, color: &'static str, [left, y]: [f64; 2], at: &dyn Fn(f64) -> f64) {
        let middle = y + 0.5 * BAR;
        if !value.is_finite() || (self.is_log && value <= 0.0) {
            let text = if self.missing_label.is_empty() { "not available" } else { &self.missing_label };
            let start = if self.is_log { left } else { at(0.0) };
            svg.rect([start, y + 1.0, text_width(text, SMALL) + 12.0, BAR - 2.0], EMPTY);
            svg.text([start + 6.0, middle + 0.35 * SMALL], text, &TextStyle::note());
            return;
        }
        let end = at(value);
        if self.is_log {
            svg.line([left, middle], [end, middle], GRID, 1.5, "");
            svg.circle([end, middle], 4.5, color, "#ffffff", 1.0);
        } else {
            let start = at(0.0);
            svg.rect([start.min(end), y + 1.0, (end - start).abs().max(1.0), BAR - 2.0], color);
        }
        // Right of a negative bar would be on the bar itself: start at the zero line.
        let text_at = end.max(if self.is_log { end } else { at(0.0) }) + if self.is_log { 8.0 } else { 5.0 };
        svg.text([text_at, middle + 0.35 * SMALL], &significant(value, 3), &TextStyle::new(SMALL));
    }

    fn draw_key(&self, svg: &mut Svg, [mut x, y]: [f64; 2]) {
        if self.series.len() < 2 {
            return;
        }
        for (s, name) in self.series.iter().enumerate() {
            let color = of_series(name, s);
            if self.is_log {
                svg.circle([x + 5.0, y - 4.0], 4.5, color, "#ffffff", 1.0);
            } else {
                svg.rect([x, y - 9.0, 10.0, 10.0], color);
            }
            svg.text([x + 15.0, y], name, &TextStyle::new(SMALL));
            x += 15.0 + text_width(name, SMALL) + 20.0;
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    pub(in super::super) fn sample(is_log: bool) -> GroupedBars {
        let group = |label: &str, values: &[f64]| BarGroup { label: label.into(), values: values.into() };
        GroupedBars {
            title: if is_log {
                "Promised relative standard deviation"
            } else {
                "Integrated sensitivity, sum over voxels"
            }
            .into(),
            axis_label: if is_log { "relative standard deviation, 1" } else { "𝒮 relative to the base specimen" }
                .into(),
            series: vec!["base".into(), "best".into()],
            groups: vec![
                group("κ", &[f64::INFINITY, 0.3]),
                group("μ₁", &[1.0, if is_log { 0.0021 } else { 1.42 }]),
                group("α₁", &[if is_log { 0.012 } else { 1.0 }, if is_log { 0.0034 } else { 1.87 }]),
            ],
            is_log,
            reference: Some(1.0),
            missing_label: if is_log { "not identifiable".into() } else { String::new() },
        }
    }

    #[test]
    fn values_are_written() {
        for is_log in [false, true] {
            let svg = sample(is_log).to_svg();
            assert_well_formed(&svg);
            assert!(svg.contains(if is_log { "0.00340" } else { "1.87" }));
            assert_eq!(svg, sample(is_log).to_svg());
        }
    }

    #[test]
    fn poor_data_make_a_placeholder_or_a_note() {
        assert!(GroupedBars::default().to_svg().contains("no values"));
        let mut bars = sample(true);
        bars.groups.truncate(1);
        bars.groups[0].values = vec![-1.0, f64::NAN];
        assert!(bars.to_svg().contains("no values"));
        let mut bars = sample(false);
        bars.groups[1].values = vec![-2.0];
        let svg = bars.to_svg();
        assert_well_formed(&svg);
        assert!(svg.contains("not available"));
    }
}
