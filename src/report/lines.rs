//! Curves over one axis, as lines with points; and steps, for histograms.

use super::axis::Axis;
use super::color::{INK, SERIES};
use super::frame::Frame;
use super::svg::{SMALL, Svg, TITLE, TextStyle};
use super::text::{shortened, text_width};

/// One curve.
#[derive(Clone, Debug, Default)]
pub struct Line {
    /// Name in the key; may be empty.
    pub name: String,
    /// (x, y) from left to right; what is not finite is left out.
    pub points: Vec<[f64; 2]>,
    /// Mark the points.
    pub has_marks: bool,
    /// Low and high end of what is uncertain at each point, drawn as a band; nothing where there are fewer than points.
    pub band: Vec<[f64; 2]>,
}

/// Curves with shared axes.
#[derive(Clone, Debug, Default)]
pub struct LinePlot {
    /// Title above.
    pub title: String,
    /// Horizontal axis with unit.
    pub x_label: String,
    /// Vertical axis with unit.
    pub y_label: String,
    /// Logarithmic vertical axis: values that are not positive are left out.
    pub is_log: bool,
    /// The curves.
    pub lines: Vec<Line>,
}

const AREA: [f64; 4] = [70.0, 54.0, 400.0, 230.0];

impl LinePlot {
    /// The picture.
    pub fn to_svg(&self) -> String {
        let usable = |p: &&[f64; 2]| p.iter().all(|v| v.is_finite()) && (!self.is_log || p[1] > 0.0);
        let points = || self.lines.iter().flat_map(|l| &l.points).filter(usable);
        let horizontal = Axis::covering(points().map(|p| p[0]), false, 0.02);
        let zero = (!self.is_log && points().all(|p| p[1] >= 0.0)).then_some(0.0);
        let bands = self.lines.iter().flat_map(|l| l.band.iter().flatten().copied());
        let vertical = Axis::covering(points().map(|p| p[1]).chain(zero).chain(bands), self.is_log, 0.04);
        let (Some(horizontal), Some(vertical)) = (horizontal, vertical) else {
            return Svg::placeholder(&self.title, "no values to show");
        };
        let [x, y, w, h] = AREA;
        let frame = Frame { area: AREA, horizontal, vertical };
        let mut svg = Svg::new(x + w + 24.0, y + h + 46.0);
        svg.text([x, 18.0], &shortened(&self.title, TITLE, w), &TextStyle::title());
        frame.draw_grid(&mut svg, 0, 6);
        frame.draw_bottom(&mut svg, &self.x_label, 7);
        frame.draw_left(&mut svg, &self.y_label, 6, 54.0);
        let mut key = x;
        for (n, line) in self.lines.iter().enumerate() {
            let color = SERIES[(n + 1) % SERIES.len()];
            let at: Vec<[f64; 2]> = line.points.iter().filter(usable).map(|p| frame.at(*p)).collect();
            if line.band.len() == line.points.len() && !self.is_log {
                let edge = |end: usize| line.points.iter().zip(&line.band).map(move |(p, band)| [p[0], band[end]]);
                let around: Vec<[f64; 2]> = edge(0).chain(edge(1).rev()).map(|p| frame.at(p)).collect();
                if around.iter().flatten().all(|v| v.is_finite()) {
                    svg.open_translucent(0.2);
                    svg.polygon(&around, color, "none", 0.0);
                    svg.close_group();
                }
            }
            svg.polyline(&at, color, 1.5);
            if line.has_marks {
                at.iter().for_each(|p| svg.circle(*p, 3.0, color, "#ffffff", 0.8));
            }
            if !line.name.is_empty() {
                svg.line([key, 36.0], [key + 16.0, 36.0], color, 2.0, "");
                svg.text([key + 21.0, 40.0], &line.name, &TextStyle::new(SMALL).color(INK));
                key += 21.0 + text_width(&line.name, SMALL) + 18.0;
            }
        }
        svg.finish(&self.title)
    }
}

/// Residuals over their standard deviations as densities, one curve per series, beside the standard normal density.
pub fn residual_histogram(title: &str, series: &[(String, Vec<f64>)]) -> LinePlot {
    const BINS: usize = 60;
    const END: f64 = 6.0;
    let width = 2.0 * END / BINS as f64;
    let mut lines: Vec<Line> = series
        .iter()
        .map(|(name, values)| {
            let mut counts = vec![0usize; BINS];
            let mut total = 0usize;
            for v in values.iter().filter(|v| v.is_finite()) {
                total += 1;
                let bin = (v + END) / width;
                if (0.0..BINS as f64).contains(&bin) {
                    counts[bin as usize] += 1;
                }
            }
            let mut points = Vec::with_capacity(2 * BINS);
            for (b, n) in counts.iter().enumerate() {
                let density = *n as f64 / (total.max(1) as f64 * width);
                let left = -END + b as f64 * width;
                points.extend([[left, density], [left + width, density]]);
            }
            Line { name: name.clone(), points, ..Line::default() }
        })
        .collect();
    let normal = (0..=120)
        .map(|n| {
            let x = -END + f64::from(n) * END / 60.0;
            [x, (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()]
        })
        .collect();
    lines.push(Line { name: "standard normal".into(), points: normal, ..Line::default() });
    LinePlot {
        title: title.into(),
        x_label: "(data − model) / noise".into(),
        y_label: "density".into(),
        is_log: false,
        lines,
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    #[test]
    fn lines_are_drawn_and_poor_data_make_a_placeholder() {
        let values = (0..1000).map(|n| f64::from(n) / 250.0 - 2.0).collect();
        let mut plot = residual_histogram("residuals", &[("x".into(), values)]);
        let svg = plot.to_svg();
        assert_well_formed(&svg);
        assert!(svg.contains("standard normal"));
        // Densities integrate to one.
        let area: f64 = plot.lines[0].points.windows(2).map(|w| (w[1][0] - w[0][0]) * w[0][1]).sum();
        assert!((area - 1.0).abs() < 1e-12);
        plot.is_log = true;
        plot.lines[0].points[3] = [f64::NAN, 1.0];
        assert_well_formed(&plot.to_svg());
        plot.lines.clear();
        assert!(plot.to_svg().contains("no values"));
    }
}
