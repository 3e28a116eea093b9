//! The search's progress: every evaluation and the best so far.

use super::axis::Axis;
use super::color::{ACCENT, AXIS, BASE, BEST, FAINT, MUTED};
use super::frame::Frame;
use super::number::significant;
use super::svg::{SMALL, Svg, TITLE, TextStyle};
use super::text::{shortened, text_width};

/// One evaluation, in the order of the search.
#[derive(Clone, Debug, Default)]
pub struct HistoryPoint {
    /// Value of the objective; NaN where the evaluation failed.
    pub value: f64,
    /// All limits hold.
    pub is_feasible: bool,
    /// Name of the search's phase, such as `explore`, `refine`, `confirm`; may be empty.
    pub phase: String,
}

/// Objective over evaluations.
#[derive(Clone, Debug, Default)]
pub struct HistoryPlot {
    /// Title above.
    pub title: String,
    /// Vertical axis with unit.
    pub y_label: String,
    /// Larger values are better.
    pub larger_is_better: bool,
    /// Logarithmic vertical axis.
    pub is_log: bool,
    /// Value of the base specimen, marked by a line.
    pub base: Option<f64>,
    /// The evaluations.
    pub points: Vec<HistoryPoint>,
}

const AREA: [f64; 4] = [68.0, 62.0, 560.0, 250.0];

impl HistoryPlot {
    /// The picture.
    pub fn to_svg(&self) -> String {
        let usable = |v: f64| v.is_finite() && (!self.is_log || v > 0.0);
        let base = self.base.filter(|b| usable(*b));
        let feasible = || self.points.iter().filter(|p| p.is_feasible && usable(p.value)).map(|p| p.value);
        // Infeasible values may be far off: the axis follows the feasible ones if there are any.
        let shown: Vec<f64> = if feasible().next().is_some() {
            feasible().chain(base).collect()
        } else {
            self.points.iter().map(|p| p.value).chain(base).collect()
        };
        let vertical = Axis::covering(shown, self.is_log, 0.07).filter(|_| !self.points.is_empty());
        let Some(vertical) = vertical else {
            return Svg::placeholder(&self.title, "no evaluation has a value");
        };
        let [x, y, w, h] = AREA;
        let count = self.points.len() as f64;
        let frame = Frame { area: AREA, horizontal: Axis::linear(0.0, count.max(2.0) * 1.01), vertical };
        let mut svg = Svg::new(x + w + 84.0, y + h + 50.0);
        svg.text([x, 18.0], &shortened(&self.title, TITLE, w), &TextStyle::title());
        frame.draw_grid(&mut svg, 0, 6);
        self.draw_phases(&mut svg, &frame);
        if let Some(base) = base {
            let at = frame.at([0.0, base])[1];
            svg.line([x, at], [x + w, at], BASE, 1.0, "4 3");
            svg.text([x + w + 6.0, at + 0.35 * SMALL], "base", &TextStyle::new(SMALL).color(BASE));
        }
        let best = self.draw_points(&mut svg, &frame);
        if let Some(&(n, last)) = best.last() {
            let mut line: Vec<[f64; 2]> = Vec::new();
            for &(i, value) in &best {
                if let Some(&[_, before]) = line.last() {
                    line.push([i, before]);
                }
                line.push([i, value]);
            }
            line.push([count.max(n), last]);
            let line: Vec<[f64; 2]> = line.into_iter().map(|p| frame.at(p)).collect();
            svg.polyline(&line, BEST, 2.0);
            let mut at = frame.at([0.0, last])[1] + 0.35 * SMALL;
            if let Some(base) = base {
                // Keeps clear of the base's label.
                let label = frame.at([0.0, base])[1] + 0.35 * SMALL;
                if (at - label).abs() < 13.0 {
                    at = if at <= label { label - 13.0 } else { label + 13.0 };
                }
            }
            let text = format!("best {}", significant(last, 3));
            svg.text([x + w + 6.0, at], &text, &TextStyle::new(SMALL).color(BEST).bold());
        }
        frame.draw_bottom(&mut svg, "evaluations", 8);
        frame.draw_left(&mut svg, &self.y_label, 6, 50.0);
        svg.finish(&self.title)
    }

    /// Draws the evaluations; returns number and value wherever the best so far improves.
    fn draw_points(&self, svg: &mut Svg, frame: &Frame) -> Vec<(f64, f64)> {
        let bottom = frame.area[1] + frame.area[3];
        let mut best: Vec<(f64, f64)> = Vec::new();
        let (mut num_failed, mut num_outside) = (0, 0);
        for (i, point) in self.points.iter().enumerate() {
            let number = i as f64 + 1.0;
            if !point.value.is_finite() {
                num_failed += 1;
                let at = frame.at([number, frame.vertical.low])[0];
                svg.line([at, bottom - 7.0], [at, bottom], FAINT, 1.0, "");
                continue;
            }
            let fraction = frame.vertical.fraction(point.value);
            if !(0.0..=1.0).contains(&fraction) {
                num_outside += 1;
                continue;
            }
            let (fill, edge) = if point.is_feasible { (ACCENT, "#ffffff") } else { ("#ffffff", FAINT) };
            svg.circle(frame.at([number, point.value]), 2.6, fill, edge, 0.8);
            let is_better = best.last().is_none_or(|&(_, b)| (point.value > b) == self.larger_is_better);
            if point.is_feasible && is_better {
                best.push((number, point.value));
            }
        }
        let mut notes = vec!["blue: feasible".to_string(), "grey ring: breaks a limit".to_string()];
        if num_failed > 0 {
            notes.push(format!("tick at the axis: {num_failed} failed"));
        }
        if num_outside > 0 {
            notes.push(format!("{num_outside} beyond the axis"));
        }
        svg.text([frame.area[0], 35.0], &notes.join(" · "), &TextStyle::note());
        best
    }

    fn draw_phases(&self, svg: &mut Svg, frame: &Frame) {
        let [_, y, _, h] = frame.area;
        let mut start = 0;
        while start < self.points.len() {
            let phase = &self.points[start].phase;
            let length = self.points[start..].iter().take_while(|p| p.phase == *phase).count();
            let (from, to) =
                (frame.at([start as f64 + 0.5, 1.0])[0], frame.at([(start + length) as f64 + 0.5, 1.0])[0]);
            if start > 0 {
                svg.line([from, y - 12.0], [from, y + h], AXIS, 0.75, "1 3");
            }
            if text_width(phase, SMALL) < to - from {
                svg.text([from + 4.0, y - 4.0], phase, &TextStyle::new(SMALL).color(MUTED));
            }
            start += length;
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    pub(in super::super) fn sample() -> HistoryPlot {
        let points = (0..120u32)
            .map(|i| {
                let (t, r) = (f64::from(i) / 120.0, (f64::from(i) * 0.618_034).fract());
                let value = if i % 23 == 7 { f64::NAN } else { 0.8 + 0.9 * t.sqrt() - 0.6 * r * (1.0 - 0.7 * t) };
                let phase = if i < 60 {
                    "explore"
                } else if i < 110 {
                    "refine"
                } else {
                    "confirm"
                };
                HistoryPoint { value, is_feasible: i % 5 != 3, phase: phase.into() }
            })
            .collect();
        HistoryPlot {
            title: "Progress of the search".into(),
            y_label: "objective relative to the base".into(),
            larger_is_better: true,
            is_log: false,
            base: Some(1.0),
            points,
        }
    }

    #[test]
    fn progress_is_drawn() {
        let svg = sample().to_svg();
        assert_well_formed(&svg);
        assert_eq!(svg, sample().to_svg());
        assert!(svg.contains("explore") && svg.contains("failed") && svg.contains("best 1.6"), "{svg}");
    }

    #[test]
    fn poor_data_make_a_placeholder() {
        assert!(HistoryPlot::default().to_svg().contains("no evaluation"));
        let mut plot = sample();
        plot.points.iter_mut().for_each(|p| p.value = f64::NAN);
        plot.base = None;
        assert!(plot.to_svg().contains("no evaluation"));
        let mut plot = sample();
        plot.points.truncate(1);
        plot.is_log = true;
        assert_well_formed(&plot.to_svg());
        plot.points[0].is_feasible = false;
        assert_well_formed(&plot.to_svg());
    }
}
