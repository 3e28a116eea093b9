//! Trade-off of two quantities over designs: information against force.

use super::axis::Axis;
use super::color::{ACCENT, AXIS, BASE, BEST, FAINT, MUTED};
use super::frame::Frame;
use super::labels::LabelPlacer;
use super::svg::{SMALL, Svg, TITLE, TextStyle};
use super::text::{shortened, text_width};

/// What a point of the trade-off is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// Breaks a limit.
    Infeasible,
    /// Feasible, but another design is better in both quantities.
    Dominated,
    /// On the front: no design is better in both.
    Front,
    /// The base specimen.
    Base,
    /// The chosen design.
    Best,
}

/// One design.
#[derive(Clone, Debug)]
pub struct ParetoPoint {
    /// Horizontal quantity.
    pub x: f64,
    /// Vertical quantity.
    pub y: f64,
    /// Written beside the point, such as its rank; may be empty.
    pub label: String,
    /// What it is.
    pub kind: PointKind,
}

/// A scatter plot of designs with the Pareto front as a staircase.
#[derive(Clone, Debug, Default)]
pub struct ParetoPlot {
    /// Title above.
    pub title: String,
    /// Horizontal axis with unit.
    pub x_label: String,
    /// Vertical axis with unit.
    pub y_label: String,
    /// Logarithmic horizontal axis.
    pub is_log_x: bool,
    /// Logarithmic vertical axis.
    pub is_log_y: bool,
    /// Larger x is better (decides how the front is drawn).
    pub larger_x_is_better: bool,
    /// Larger y is better.
    pub larger_y_is_better: bool,
    /// The designs.
    pub points: Vec<ParetoPoint>,
}

const AREA: [f64; 4] = [68.0, 56.0, 520.0, 330.0];

impl ParetoPlot {
    /// The picture.
    pub fn to_svg(&self) -> String {
        let usable = |p: &&ParetoPoint| {
            let good = |v: f64, is_log: bool| v.is_finite() && (!is_log || v > 0.0);
            good(p.x, self.is_log_x) && good(p.y, self.is_log_y)
        };
        let mut points: Vec<&ParetoPoint> = self.points.iter().filter(usable).collect();
        let horizontal = Axis::covering(points.iter().map(|p| p.x), self.is_log_x, 0.06);
        let vertical = Axis::covering(points.iter().map(|p| p.y), self.is_log_y, 0.07);
        let (Some(horizontal), Some(vertical)) = (horizontal, vertical) else {
            return Svg::placeholder(&self.title, "no design was evaluated");
        };
        let [x, y, w, h] = AREA;
        let frame = Frame { area: AREA, horizontal, vertical };
        let mut svg = Svg::new(x + w + 24.0, y + h + 50.0);
        svg.text([x, 18.0], &shortened(&self.title, TITLE, w), &TextStyle::title());
        frame.draw_grid(&mut svg, 6, 6);
        let front = self.draw_front(&mut svg, &frame, &points);
        frame.draw_bottom(&mut svg, &self.x_label, 6);
        frame.draw_left(&mut svg, &self.y_label, 6, 50.0);

        // Important points last, so that they lie on top.
        points.sort_by_key(|p| p.kind as usize);
        let mut placer = LabelPlacer::new([x + 2.0, y - 8.0, x + w + 20.0, y + h - 2.0]);
        for p in &points {
            let radius = draw_mark(&mut svg, frame.at([p.x, p.y]), p.kind);
            if p.kind != PointKind::Infeasible {
                placer.occupy(frame.at([p.x, p.y]), radius);
            }
        }
        // The staircase is taken as well, in steps shorter than a label is high.
        for pair in front.windows(2) {
            let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            let steps = (length / 6.0).ceil();
            for i in 0..steps as usize {
                let t = i as f64 / steps;
                placer.occupy([0, 1].map(|c| pair[0][c] + t * (pair[1][c] - pair[0][c])), 1.0);
            }
        }
        for p in points.iter().rev().filter(|p| !p.label.is_empty()) {
            if let Some((at, anchor)) = placer.place(frame.at([p.x, p.y]), &p.label, 8.0) {
                let style = match p.kind {
                    PointKind::Best => TextStyle::new(SMALL).color(BEST).bold(),
                    PointKind::Base => TextStyle::new(SMALL).bold(),
                    PointKind::Front => TextStyle::new(SMALL).color(ACCENT),
                    PointKind::Dominated | PointKind::Infeasible => TextStyle::note(),
                };
                svg.text(at, &p.label, &style.anchor(anchor));
            }
        }
        let dropped = self.points.len() - points.len();
        draw_key(&mut svg, [x, 38.0], &points, dropped);
        svg.finish(&self.title)
    }

    /// The front as a staircase: between two front designs nothing better than their corner is known.
    fn draw_front(&self, svg: &mut Svg, frame: &Frame, points: &[&ParetoPoint]) -> Vec<[f64; 2]> {
        let is_on_front = |p: &&&ParetoPoint| matches!(p.kind, PointKind::Front | PointKind::Best);
        let sign = if self.larger_x_is_better { -1.0 } else { 1.0 };
        let mut front: Vec<[f64; 2]> = points.iter().filter(is_on_front).map(|p| [p.x, p.y]).collect();
        front.sort_by(|a, b| (sign * a[0]).total_cmp(&(sign * b[0])));
        let mut line: Vec<[f64; 2]> = Vec::new();
        let mut best = f64::NEG_INFINITY;
        for p in front {
            let y = if self.larger_y_is_better { p[1] } else { -p[1] };
            // A best design that is not on the front (chosen by another measure) does not bend it.
            if y <= best {
                continue;
            }
            best = y;
            if let Some(&[_, last]) = line.last() {
                line.push([p[0], last]);
            }
            line.push(p);
        }
        let line: Vec<[f64; 2]> = line.into_iter().map(|p| frame.at(p)).collect();
        svg.polyline(&line, "#9dbbd4", 1.5);
        line
    }
}

/// Draws a point and returns its radius, px.
fn draw_mark(svg: &mut Svg, at: [f64; 2], kind: PointKind) -> f64 {
    let [x, y] = at;
    match kind {
        PointKind::Infeasible => {
            svg.line([x - 2.5, y - 2.5], [x + 2.5, y + 2.5], FAINT, 1.2, "");
            svg.line([x - 2.5, y + 2.5], [x + 2.5, y - 2.5], FAINT, 1.2, "");
            2.5
        }
        PointKind::Dominated => {
            svg.circle(at, 3.0, "#ffffff", AXIS, 1.0);
            3.5
        }
        PointKind::Front => {
            svg.circle(at, 4.0, ACCENT, "#ffffff", 1.0);
            4.5
        }
        PointKind::Base => {
            svg.polygon(&[[x, y - 6.5], [x + 6.5, y], [x, y + 6.5], [x - 6.5, y]], BASE, "#ffffff", 1.0);
            6.5
        }
        PointKind::Best => {
            svg.circle(at, 6.0, BEST, "#ffffff", 1.2);
            6.5
        }
    }
}

fn draw_key(svg: &mut Svg, [mut x, y]: [f64; 2], points: &[&ParetoPoint], dropped: usize) {
    for (kind, name) in [
        (PointKind::Best, "chosen"),
        (PointKind::Base, "base"),
        (PointKind::Front, "front"),
        (PointKind::Dominated, "dominated"),
        (PointKind::Infeasible, "infeasible"),
    ] {
        if points.iter().any(|p| p.kind == kind) {
            draw_mark(svg, [x + 5.0, y - 4.0], kind);
            svg.text([x + 15.0, y], name, &TextStyle::new(SMALL));
            x += 15.0 + text_width(name, SMALL) + 18.0;
        }
    }
    if dropped > 0 {
        svg.text([x, y], &format!("{dropped} without values"), &TextStyle::new(SMALL).color(MUTED));
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    pub(in super::super) fn sample() -> ParetoPlot {
        let mut points = Vec::new();
        for i in 0..90u32 {
            // Low-discrepancy points (golden ratio and √2): repeatable and without clusters.
            let (a, b) = ((f64::from(i) * 0.618_034).fract(), (f64::from(i) * 0.414_214).fract());
            let force = 4.0 + 14.0 * a;
            let kind = if force > 15.0 { PointKind::Infeasible } else { PointKind::Dominated };
            points.push(ParetoPoint {
                x: force,
                y: 0.4 + 1.4 * a.sqrt() * (0.4 + 0.55 * b),
                label: String::new(),
                kind,
            });
        }
        for (i, t) in [0.05, 0.2, 0.35, 0.5, 0.62, 0.78f64].into_iter().enumerate() {
            let kind = if i == 5 { PointKind::Best } else { PointKind::Front };
            let label = format!("{}", 6 - i);
            points.push(ParetoPoint { x: 4.0 + 14.0 * t, y: 0.45 + 1.42 * t.sqrt(), label, kind });
        }
        points.push(ParetoPoint { x: 10.5, y: 1.0, label: "base".into(), kind: PointKind::Base });
        points.push(ParetoPoint { x: f64::NAN, y: 1.0, label: "lost".into(), kind: PointKind::Infeasible });
        ParetoPlot {
            title: "Information against force".into(),
            x_label: "largest force / N".into(),
            y_label: "objective relative to the base specimen".into(),
            is_log_x: false,
            is_log_y: false,
            larger_x_is_better: false,
            larger_y_is_better: true,
            points,
        }
    }

    #[test]
    fn designs_are_drawn_and_labelled() {
        let svg = sample().to_svg();
        assert_well_formed(&svg);
        assert_eq!(svg, sample().to_svg());
        assert!(svg.contains(">base</text>") && svg.contains("1 without values") && !svg.contains("lost"));
    }

    #[test]
    fn poor_data_make_a_placeholder() {
        assert!(ParetoPlot::default().to_svg().contains("no design"));
        let mut plot = sample();
        plot.points.truncate(1);
        for (is_log_x, is_log_y) in [(false, false), (true, true)] {
            (plot.is_log_x, plot.is_log_y) = (is_log_x, is_log_y);
            assert_well_formed(&plot.to_svg());
        }
        plot.points[0].x = -1.0;
        assert!(plot.to_svg().contains("no design"));
    }
}
