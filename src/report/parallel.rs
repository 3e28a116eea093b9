//! Parallel coordinates: every design of a sweep as a line across its variables and responses.

use super::axis::Axis;
use super::color::{AXIS, ColorMap, MUTED};
use super::frame::draw_color_bar;
use super::svg::{SMALL, Svg, TITLE, TextStyle};
use super::text::shortened;

/// One vertical axis.
#[derive(Clone, Debug, Default)]
pub struct ParallelAxis {
    /// Name and unit.
    pub label: String,
    /// Value of every design; a line is broken where it is not finite.
    pub values: Vec<f64>,
}

/// A parallel-coordinates plot; the last axis colours the lines.
#[derive(Clone, Debug, Default)]
pub struct ParallelPlot {
    /// Title above.
    pub title: String,
    /// The axes from left to right, all with as many values.
    pub axes: Vec<ParallelAxis>,
}

const LEFT: f64 = 70.0;
const TOP: f64 = 66.0;
const HEIGHT: f64 = 270.0;
const STEP: f64 = 120.0;
/// Most lines drawn: more would be a blot. Every n-th design is taken.
const MAX_LINES: usize = 1000;

impl ParallelPlot {
    /// The picture.
    pub fn to_svg(&self) -> String {
        let axes: Vec<(&ParallelAxis, Axis)> = self
            .axes
            .iter()
            .filter_map(|a| Some((a, Axis::covering(a.values.iter().copied(), false, 0.02)?)))
            .collect();
        let (Some((color, color_axis)), true) = (axes.last(), axes.len() >= 2) else {
            return Svg::placeholder(&self.title, "no design was evaluated");
        };
        let width = LEFT + (axes.len() - 1) as f64 * STEP + 140.0;
        let mut svg = Svg::new(width, TOP + HEIGHT + 30.0);
        svg.text([12.0, 18.0], &shortened(&self.title, TITLE, width - 24.0), &TextStyle::title());
        let at = |axis: usize, fraction: f64| [LEFT + axis as f64 * STEP, TOP + HEIGHT * (1.0 - fraction)];
        let count = color.values.len();
        let stride = count.div_ceil(MAX_LINES).max(1);
        // Best last, so that it lies on top; what has no colour is not drawn.
        let mut order: Vec<usize> = (0..count).step_by(stride).filter(|&i| color.values[i].is_finite()).collect();
        order.sort_by(|a, b| color.values[*a].total_cmp(&color.values[*b]).then(a.cmp(b)));
        let opacity = if order.len() > 60 { 0.45 } else { 0.8 };
        svg.open_translucent(opacity);
        for &i in &order {
            let ink = ColorMap::Viridis.hex(color_axis.fraction(color.values[i]));
            let points: Vec<Option<[f64; 2]>> = axes
                .iter()
                .enumerate()
                .map(|(k, (a, axis))| a.values.get(i).filter(|v| v.is_finite()).map(|v| at(k, axis.fraction(*v))))
                .collect();
            for run in points.split(Option::is_none) {
                let line: Vec<[f64; 2]> = run.iter().flatten().copied().collect();
                svg.polyline(&line, &ink, 1.1);
            }
        }
        svg.close_group();
        for (k, (a, axis)) in axes.iter().enumerate() {
            svg.line(at(k, 0.0), at(k, 1.0), AXIS, 1.0, "");
            for tick in axis.ticks(5) {
                let [x, y] = at(k, axis.fraction(tick.value));
                svg.line([x - 4.0, y], [x, y], AXIS, 1.0, "");
                svg.text([x - 6.0, y + 0.35 * SMALL], &tick.label, &TextStyle::note().end());
            }
            // Neighbouring labels stand on two levels.
            let [x, y] = at(k, 1.0);
            let level = if k % 2 == 0 { 24.0 } else { 9.0 };
            let label = shortened(&a.label, SMALL, 1.85 * STEP);
            svg.text([x, y - level], &label, &TextStyle::new(SMALL).middle());
        }
        let [x, y] = at(axes.len() - 1, 1.0);
        draw_color_bar(
            &mut svg,
            [x + 40.0, y + 20.0, 12.0, HEIGHT - 40.0],
            ColorMap::Viridis,
            [color_axis.low, color_axis.high],
            [false, false],
            "",
        );
        if stride > 1 {
            let note = format!("one in {stride} of {count} designs");
            svg.text([LEFT, TOP + HEIGHT + 22.0], &note, &TextStyle::new(SMALL).color(MUTED));
        }
        svg.finish(&self.title)
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    #[test]
    fn lines_are_drawn_and_thinned() {
        let axis = |label: &str, n: u32, f: fn(u32) -> f64| ParallelAxis {
            label: label.into(),
            values: (0..n).map(f).collect(),
        };
        for n in [1, 30, 2500] {
            let plot = ParallelPlot {
                title: "Designs & responses".into(),
                axes: vec![
                    axis("drive / mm", n, |i| f64::from(i % 7)),
                    axis("hole / mm", n, |i| if i % 5 == 0 { f64::NAN } else { f64::from(i % 3) }),
                    axis("force / N", n, f64::from),
                ],
            };
            let svg = plot.to_svg();
            assert_well_formed(&svg);
            assert_eq!(svg.contains("one in 3 of 2500 designs"), n == 2500);
        }
        assert!(ParallelPlot::default().to_svg().contains("no design"));
    }
}
