//! A quantity over two parameters: colours for its decimal logarithm, lines at equal ratios to its smallest value.

use super::axis::Axis;
use super::color::{AXIS, BEST, ColorMap, EMPTY, INK};
use super::frame::{Frame, draw_color_bar};
use super::svg::{Svg, TITLE, TextStyle};
use super::text::shortened;

/// One map.
#[derive(Clone, Debug, Default)]
pub struct ContourPanel {
    /// Title above.
    pub title: String,
    /// Horizontal axis with unit.
    pub x_label: String,
    /// Vertical axis with unit.
    pub y_label: String,
    /// Values along the horizontal axis, increasing.
    pub x: Vec<f64>,
    /// Values along the vertical axis, increasing.
    pub y: Vec<f64>,
    /// The quantity, positive, x fastest; NaN where there is none.
    pub values: Vec<f64>,
    /// Logarithmic horizontal axis.
    pub is_log_x: bool,
    /// Where the estimate is.
    pub mark: Option<[f64; 2]>,
}

/// Maps, three to a row.
#[derive(Clone, Debug, Default)]
pub struct ContourPlot {
    /// The maps.
    pub panels: Vec<ContourPanel>,
}

const SIZE: f64 = 190.0;
const LEFT: f64 = 62.0;
const TOP: f64 = 42.0;
const BLOCK: [f64; 2] = [LEFT + SIZE + 84.0, TOP + SIZE + 58.0];
const IN_ROW: usize = 3;
/// Cells per side: values between the given ones are interpolated.
const CELLS: usize = 48;
/// Lines at these multiples of the smallest value.
const LINES: [f64; 6] = [1.01, 1.1, 1.5, 3.0, 10.0, 100.0];

impl ContourPlot {
    /// The picture.
    pub fn to_svg(&self) -> String {
        let name = "Losses around the estimate";
        let is_usable = |p: &ContourPanel| {
            p.x.len() >= 2 && p.y.len() >= 2 && p.values.len() == p.x.len() * p.y.len() && p.smallest().is_some()
        };
        if self.panels.is_empty() || !self.panels.iter().all(is_usable) {
            return Svg::placeholder(name, "no losses to show");
        }
        let columns = self.panels.len().min(IN_ROW);
        let rows = self.panels.len().div_ceil(IN_ROW);
        let mut svg = Svg::new(columns as f64 * BLOCK[0], rows as f64 * BLOCK[1]);
        for (n, panel) in self.panels.iter().enumerate() {
            panel.draw(&mut svg, [(n % IN_ROW) as f64 * BLOCK[0], (n / IN_ROW) as f64 * BLOCK[1]]);
        }
        svg.finish(name)
    }
}

impl ContourPanel {
    fn smallest(&self) -> Option<f64> {
        self.values.iter().copied().filter(|v| v.is_finite() && *v > 0.0).min_by(f64::total_cmp)
    }

    /// log₁₀ of the quantity at parts of the way along both axes (by index), bilinear.
    fn at(&self, [s, t]: [f64; 2]) -> f64 {
        let (n, m) = (self.x.len(), self.y.len());
        let (i, j) = ((s as usize).min(n - 2), (t as usize).min(m - 2));
        let (a, b) = (s - i as f64, t - j as f64);
        let log = |i: usize, j: usize| self.values[i + n * j].log10();
        (1.0 - a) * ((1.0 - b) * log(i, j) + b * log(i, j + 1))
            + a * ((1.0 - b) * log(i + 1, j) + b * log(i + 1, j + 1))
    }

    fn draw(&self, svg: &mut Svg, [x0, y0]: [f64; 2]) {
        let (n, m) = (self.x.len(), self.y.len());
        let area = [x0 + LEFT, y0 + TOP, SIZE, SIZE];
        let frame = Frame {
            area,
            horizontal: Axis { low: self.x[0], high: self.x[n - 1], is_log: self.is_log_x },
            vertical: Axis::linear(self.y[0], self.y[m - 1]),
        };
        svg.text([area[0], y0 + 22.0], &shortened(&self.title, TITLE, SIZE + 70.0), &TextStyle::title());
        let place = |i: usize, count: usize| (i as f64 + 0.5) / CELLS as f64 * (count - 1) as f64;
        let grid: Vec<f64> = (0..CELLS * CELLS).map(|c| self.at([place(c % CELLS, n), place(c / CELLS, m)])).collect();
        let finite = || grid.iter().copied().filter(|v| v.is_finite());
        let low = self.smallest().map_or(0.0, f64::log10);
        let high = finite().fold(low, f64::max);
        let range = ColorMap::Viridis.range([low, high]);
        svg.rect(area, EMPTY);
        svg.cells(area, [CELLS, CELLS], |i, j| {
            let v = grid[i + CELLS * (CELLS - 1 - j)];
            let step = |t: f64| (64.0 * t.clamp(0.0, 1.0)).round() / 64.0;
            v.is_finite().then(|| ColorMap::Viridis.hex(step((v - range[0]) / (range[1] - range[0]))))
        });
        for ratio in LINES {
            self.draw_line(svg, area, low + ratio.log10());
        }
        svg.stroked_rect(area, "none", AXIS, 0.5);
        if let Some(mark) = self.mark {
            svg.circle(frame.at(mark), 4.0, BEST, "#ffffff", 1.2);
        }
        frame.draw_bottom(svg, &self.x_label, 4);
        frame.draw_left(svg, &self.y_label, 5, 48.0);
        draw_color_bar(
            svg,
            [area[0] + SIZE + 14.0, area[1], 10.0, SIZE],
            ColorMap::Viridis,
            range,
            [false; 2],
            "log₁₀",
        );
    }

    /// The line where log₁₀ of the quantity is `level`: marching squares on the interpolated cells.
    fn draw_line(&self, svg: &mut Svg, [left, top, w, h]: [f64; 4], level: f64) {
        let (n, m) = (self.x.len(), self.y.len());
        let part = |i: usize| i as f64 / CELLS as f64;
        let value = |i: usize, j: usize| self.at([part(i) * (n - 1) as f64, part(j) * (m - 1) as f64]) - level;
        let corners: Vec<f64> =
            (0..(CELLS + 1) * (CELLS + 1)).map(|c| value(c % (CELLS + 1), c / (CELLS + 1))).collect();
        for j in 0..CELLS {
            for i in 0..CELLS {
                let places = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
                let values = places.map(|[i, j]| corners[i + (CELLS + 1) * j]);
                let mut crossings = Vec::new();
                for k in 0..4 {
                    let (a, b) = (values[k], values[(k + 1) % 4]);
                    if a * b < 0.0 {
                        let t = a / (a - b);
                        let (p, q) = (places[k].map(part), places[(k + 1) % 4].map(part));
                        let at = [0, 1].map(|d| p[d] + t * (q[d] - p[d]));
                        crossings.push([left + w * at[0], top + h * (1.0 - at[1])]);
                    }
                }
                for pair in crossings.chunks_exact(2) {
                    svg.line(pair[0], pair[1], INK, 0.6, "");
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    #[test]
    fn maps_are_drawn_and_poor_data_make_a_placeholder() {
        let axis: Vec<f64> = (0..7).map(|i| 1.0 + f64::from(i)).collect();
        let values = (0..49).map(|c| 1e-3 * (1.0 + f64::from((c % 7 - 3) * (c % 7 - 3) + c / 7))).collect();
        let panel = ContourPanel {
            title: "ℓ".into(),
            x: axis.clone(),
            y: axis,
            values,
            is_log_x: true,
            mark: Some([4.0, 4.0]),
            ..ContourPanel::default()
        };
        let mut plot = ContourPlot { panels: vec![panel; 4] };
        assert_well_formed(&plot.to_svg());
        plot.panels[0].values[5] = f64::NAN;
        assert_well_formed(&plot.to_svg());
        plot.panels[0].values.pop();
        assert!(plot.to_svg().contains("no losses"));
    }
}
