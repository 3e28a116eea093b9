//! Measured curves with their fits, and the residuals beneath.

use super::axis::Axis;
use super::color::{AXIS, SERIES};
use super::frame::Frame;
use super::svg::{SMALL, Svg, TITLE, TextStyle};
use super::text::{shortened, text_width};

/// What a measured point is drawn as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// A circle.
    #[default]
    Circle,
    /// A square.
    Square,
}

impl Mark {
    /// Draws it around `at`; `radius` is half of its width.
    fn draw(self, svg: &mut Svg, at: [f64; 2], radius: f64, fill: &str, color: &str, width: f64) {
        match self {
            Mark::Circle => svg.circle(at, radius, fill, color, width),
            Mark::Square => {
                svg.stroked_rect([at[0] - radius, at[1] - radius, 2.0 * radius, 2.0 * radius], fill, color, width);
            }
        }
    }
}

/// One measured curve and the models drawn with it.
#[derive(Clone, Debug, Default)]
pub struct CurveSeries {
    /// Name in the legend.
    pub name: String,
    /// Measured points (x, y).
    pub points: Vec<[f64; 2]>,
    /// Modelled values at the same x, the one to judge first; drawn full, the others dashed.
    pub models: Vec<Vec<f64>>,
    /// Whether the curve was predicted, not fitted: hollow marks.
    pub is_predicted: bool,
    /// What its points are drawn as.
    pub mark: Mark,
}

/// Measured curves with their fits above, data − model below.
#[derive(Clone, Debug, Default)]
pub struct CurvesPlot {
    /// Title above.
    pub title: String,
    /// Horizontal axis with unit.
    pub x_label: String,
    /// Vertical axis with unit.
    pub y_label: String,
    /// The curves.
    pub series: Vec<CurveSeries>,
}

const AREA: [f64; 4] = [96.0, 40.0, 520.0, 280.0];
const BELOW: [f64; 4] = [96.0, 340.0, 520.0, 110.0];
/// Ticks of the residuals.
const TICKS_BELOW: usize = 3;
/// Most marks drawn per curve; longer recordings are thinned evenly.
const MAX_MARKS: usize = 120;

impl CurvesPlot {
    /// The picture.
    pub fn to_svg(&self) -> String {
        let points = || self.series.iter().flat_map(|s| s.points.iter());
        let models = || self.series.iter().flat_map(|s| s.models.iter().flatten().copied());
        let horizontal = Axis::covering(points().map(|p| p[0]), false, 0.03);
        let vertical = Axis::covering(points().map(|p| p[1]).chain(models()), false, 0.05);
        let (Some(horizontal), Some(vertical)) = (horizontal, vertical) else {
            return Svg::placeholder(&self.title, "no curve has a point");
        };
        let left = self.series.iter().flat_map(|s| residuals(s, 0)).map(|p| p[1]);
        let frame = Frame { area: AREA, horizontal, vertical };
        let below = Axis::covering(left, false, 0.1).map(|vertical| Frame { area: BELOW, horizontal, vertical });
        let mut svg = Svg::new(AREA[0] + AREA[2] + 180.0, BELOW[1] + BELOW[3] + 50.0);
        svg.text([AREA[0], 18.0], &shortened(&self.title, TITLE, 600.0), &TextStyle::title());
        frame.draw_grid(&mut svg, 6, 6);
        if let Some(below) = &below {
            below.draw_grid(&mut svg, 6, TICKS_BELOW);
            let zero = below.at([horizontal.low, 0.0])[1];
            if zero > BELOW[1] && zero < BELOW[1] + BELOW[3] {
                svg.line([BELOW[0], zero], [BELOW[0] + BELOW[2], zero], AXIS, 1.0, "");
            }
        }
        for (i, series) in self.series.iter().enumerate() {
            let color = SERIES[(i + 1) % SERIES.len()];
            let fill = if series.is_predicted { "#ffffff" } else { color };
            let stride = series.points.len().div_ceil(MAX_MARKS).max(1);
            for p in series.points.iter().step_by(stride) {
                series.mark.draw(&mut svg, frame.at(*p), 2.4, fill, color, 1.0);
            }
            for (m, model) in series.models.iter().enumerate().rev() {
                let line: Vec<[f64; 2]> = series.points.iter().zip(model).map(|(p, v)| frame.at([p[0], *v])).collect();
                if m == 0 {
                    svg.polyline(&line, color, 1.6);
                } else {
                    for pair in line.windows(2) {
                        svg.line(pair[0], pair[1], color, 0.9, "3 3");
                    }
                }
            }
            if let Some(below) = &below {
                let line: Vec<[f64; 2]> = residuals(series, 0).map(|p| below.at(p)).collect();
                svg.polyline(&line, color, 1.2);
            }
            let y = AREA[1] + 12.0 + 18.0 * i as f64;
            let x = AREA[0] + AREA[2] + 14.0;
            series.mark.draw(&mut svg, [x, y - 4.0], 3.0, fill, color, 1.2);
            let suffix = if series.is_predicted { " (predicted)" } else { "" };
            let name = shortened(&format!("{}{suffix}", series.name), SMALL, 150.0);
            svg.text([x + 9.0, y], &name, &TextStyle::new(SMALL));
        }
        // Beside the longest number at a tick.
        let widest = |axis: &Axis, num_ticks: usize| {
            axis.ticks(num_ticks).iter().map(|tick| text_width(&tick.label, SMALL)).fold(0.0, f64::max)
        };
        let of_below = below.as_ref().map_or(0.0, |below| widest(&below.vertical, TICKS_BELOW));
        let label_offset = (widest(&vertical, 6).max(of_below) + 18.0).clamp(50.0, AREA[0] - 12.0);
        frame.draw_left(&mut svg, &self.y_label, 6, label_offset);
        frame.draw_bottom(&mut svg, if below.is_some() { "" } else { &self.x_label }, 6);
        if let Some(below) = &below {
            below.draw_left(&mut svg, "data − model", TICKS_BELOW, label_offset);
            below.draw_bottom(&mut svg, &self.x_label, 6);
        }
        svg.finish(&self.title)
    }
}

fn residuals(series: &CurveSeries, model: usize) -> impl Iterator<Item = [f64; 2]> + '_ {
    let values = series.models.get(model).map_or(&[][..], |m| m);
    series.points.iter().zip(values).map(|(p, v)| [p[0], p[1] - v])
}

#[cfg(test)]
mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    #[test]
    fn any_values_make_a_picture() {
        for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0, 1e300] {
            let series = CurveSeries {
                name: "a <b> & \"c\"".into(),
                points: vec![[1.0, 0.0], [1.5, bad], [2.0, 3.0]],
                models: vec![vec![0.1, 1.0, bad], vec![0.0; 3]],
                is_predicted: true,
                mark: Mark::Square,
            };
            let plot = CurvesPlot { title: "t".into(), series: vec![series.clone(), series], ..CurvesPlot::default() };
            let svg = plot.to_svg();
            assert_well_formed(&svg);
            assert!(!svg.contains("NaN") && !svg.contains("inf"));
        }
        assert!(CurvesPlot::default().to_svg().contains("no curve has a point"));
    }
}
