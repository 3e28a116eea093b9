//! The correlation matrix of the parameters as a heat map.

use super::color::{AXIS, ColorMap, EMPTY, ink_on};
use super::frame::draw_color_bar;
use super::number::fixed;
use super::svg::{NORMAL, Svg, TITLE, TextStyle};
use super::text::{shortened, text_width};

/// A correlation matrix.
#[derive(Clone, Debug, Default)]
pub struct CorrelationPlot {
    /// Title above.
    pub title: String,
    /// Symbols of the parameters.
    pub labels: Vec<String>,
    /// n × n correlations in [−1, 1], row after row; NaN where a parameter is not identifiable.
    pub values: Vec<f64>,
}

const CELL: f64 = 54.0;

impl CorrelationPlot {
    /// The picture: the lower triangle with its values written.
    pub fn to_svg(&self) -> String {
        let n = self.labels.len();
        if n == 0 || self.values.len() != n * n {
            return Svg::placeholder(&self.title, "no covariance was computed");
        }
        let names = self.labels.iter().map(|l| text_width(l, NORMAL)).fold(0.0, f64::max);
        let left = (names + 20.0).clamp(40.0, 160.0);
        let top = 36.0;
        let side = n as f64 * CELL;
        let width = (left + side + 90.0).max(text_width(&self.title, TITLE) + 16.0).min(left + side + 240.0);
        let mut svg = Svg::new(width, top + side + 34.0);
        svg.text([8.0, 18.0], &shortened(&self.title, TITLE, width - 16.0), &TextStyle::title());
        for row in 0..n {
            let y = top + row as f64 * CELL;
            let label = shortened(&self.labels[row], NORMAL, left - 12.0);
            svg.text([left - 10.0, y + 0.5 * CELL + 4.0], &label, &TextStyle::new(NORMAL).end());
            let below = shortened(&self.labels[row], NORMAL, CELL);
            let middle = left + (row as f64 + 0.5) * CELL;
            svg.text([middle, top + side + 18.0], &below, &TextStyle::new(NORMAL).middle());
            for column in 0..=row {
                let x = left + column as f64 * CELL;
                let value = self.values[row * n + column];
                let area = [x + 1.0, y + 1.0, CELL - 2.0, CELL - 2.0];
                let at = [x + 0.5 * CELL, y + 0.5 * CELL + 4.0];
                if !value.is_finite() {
                    svg.rect(area, EMPTY);
                    svg.text(at, "–", &TextStyle::note().middle());
                } else if row == column {
                    svg.rect(area, EMPTY);
                    svg.text(at, "1", &TextStyle::note().middle());
                } else {
                    let rgb = ColorMap::Diverging.rgb(0.5 * (value + 1.0));
                    svg.rect(area, &super::color::hex(rgb));
                    // Two decimals would show 0.998 as 1: near the ends three are needed.
                    let decimals = if value.abs() > 0.985 { 3 } else { 2 };
                    svg.text(at, &fixed(value, decimals), &TextStyle::new(NORMAL).middle().color(ink_on(rgb)));
                }
            }
        }
        svg.line([left, top + side], [left + side, top + side], AXIS, 0.5, "");
        let bar_height = (side - 16.0).clamp(60.0, 160.0);
        let bar = [left + side + 26.0, top + 8.0, 11.0, bar_height];
        draw_color_bar(&mut svg, bar, ColorMap::Diverging, [-1.0, 1.0], [false; 2], "");
        svg.finish(&self.title)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    pub(in super::super) fn sample() -> CorrelationPlot {
        CorrelationPlot {
            title: "Correlation of the estimates".into(),
            labels: ["κ", "μ₁", "α₁", "μ₂", "α₂"].map(String::from).to_vec(),
            values: vec![
                1.0,
                0.1,
                -0.2,
                0.3,
                0.0,
                0.1,
                1.0,
                -0.9984,
                0.55,
                -0.4,
                -0.2,
                -0.9984,
                1.0,
                -0.62,
                0.21,
                0.3,
                0.55,
                -0.62,
                1.0,
                -0.93,
                f64::NAN,
                -0.4,
                0.21,
                -0.93,
                1.0,
            ],
        }
    }

    #[test]
    fn correlations_are_written() {
        let svg = sample().to_svg();
        assert_well_formed(&svg);
        assert!(svg.contains("−0.998") && svg.contains("0.55") && svg.contains(">–<"));
        assert_eq!(svg, sample().to_svg());
    }

    #[test]
    fn poor_data_make_a_placeholder() {
        assert!(CorrelationPlot::default().to_svg().contains("no covariance"));
        let mut plot = sample();
        plot.values.pop();
        assert!(plot.to_svg().contains("no covariance"));
    }
}
