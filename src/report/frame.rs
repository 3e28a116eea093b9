//! The frame of a plot: axes, ticks, grid lines and colour bars.

use super::axis::Axis;
use super::color::{AXIS, ColorMap, GRID};
use super::svg::{NORMAL, SMALL, Svg, TextStyle};

/// A rectangle of the picture with a horizontal and a vertical axis.
pub(super) struct Frame {
    /// Left, top, width, height, px.
    pub(super) area: [f64; 4],
    pub(super) horizontal: Axis,
    pub(super) vertical: Axis,
}

impl Frame {
    /// Position of a pair of values, px.
    pub(super) fn at(&self, value: [f64; 2]) -> [f64; 2] {
        let [x, y, w, h] = self.area;
        [x + w * self.horizontal.fraction(value[0]), y + h * (1.0 - self.vertical.fraction(value[1]))]
    }

    /// Horizontal axis with ticks below the frame, label beneath.
    pub(super) fn draw_bottom(&self, svg: &mut Svg, label: &str, num_ticks: usize) {
        let [x, y, w, h] = self.area;
        svg.line([x, y + h], [x + w, y + h], AXIS, 1.0, "");
        for tick in self.horizontal.ticks(num_ticks) {
            let at = x + w * self.horizontal.fraction(tick.value);
            svg.line([at, y + h], [at, y + h + 4.0], AXIS, 1.0, "");
            svg.text([at, y + h + 16.0], &tick.label, &TextStyle::note().middle());
        }
        svg.text([x + 0.5 * w, y + h + 34.0], label, &TextStyle::new(NORMAL).middle());
    }

    /// Vertical axis with ticks left of the frame; the label stands `label_offset` px left of it, turned.
    pub(super) fn draw_left(&self, svg: &mut Svg, label: &str, num_ticks: usize, label_offset: f64) {
        let [x, y, _, h] = self.area;
        svg.line([x, y], [x, y + h], AXIS, 1.0, "");
        for tick in self.vertical.ticks(num_ticks) {
            let at = y + h * (1.0 - self.vertical.fraction(tick.value));
            svg.line([x - 4.0, at], [x, at], AXIS, 1.0, "");
            svg.text([x - 7.0, at + 0.35 * SMALL], &tick.label, &TextStyle::note().end());
        }
        svg.text([x - label_offset, y + 0.5 * h], label, &TextStyle::new(NORMAL).middle().vertical());
    }

    /// Faint lines at the ticks of the axes.
    pub(super) fn draw_grid(&self, svg: &mut Svg, num_horizontal: usize, num_vertical: usize) {
        let [x, y, w, h] = self.area;
        if num_horizontal > 0 {
            for tick in self.horizontal.ticks(num_horizontal) {
                let at = x + w * self.horizontal.fraction(tick.value);
                svg.line([at, y], [at, y + h], GRID, 1.0, "");
            }
        }
        if num_vertical > 0 {
            for tick in self.vertical.ticks(num_vertical) {
                let at = y + h * (1.0 - self.vertical.fraction(tick.value));
                svg.line([x, at], [x + w, at], GRID, 1.0, "");
            }
        }
    }
}

/// A vertical colour bar in `area` for values from `range[0]` to `range[1]`; `label` above it. Where `is_clipped`,
/// values beyond that end have its colour, and the end carries a ≤ or ≥.
pub(super) fn draw_color_bar(
    svg: &mut Svg,
    [x, y, w, h]: [f64; 4],
    map: ColorMap,
    range: [f64; 2],
    is_clipped: [bool; 2],
    label: &str,
) {
    const STEPS: usize = 96;
    svg.cells([x, y, w, h], [1, STEPS], |_, j| Some(map.hex(1.0 - (j as f64 + 0.5) / STEPS as f64)));
    svg.stroked_rect([x, y, w, h], "none", AXIS, 0.5);
    let axis = Axis::linear(range[0], range[1]);
    for tick in axis.ticks(((h / 32.0) as usize).clamp(2, 6)) {
        let at = y + h * (1.0 - axis.fraction(tick.value));
        svg.line([x + w, at], [x + w + 4.0, at], AXIS, 1.0, "");
        svg.text([x + w + 7.0, at + 0.35 * SMALL], &tick.label, &TextStyle::note());
    }
    for (end, mark, dy) in [(1, "▲", -3.0), (0, "▼", h + 10.0)] {
        if is_clipped[end] {
            svg.text([x + 0.5 * w, y + dy], mark, &TextStyle::new(9.0).middle().color(AXIS));
        }
    }
    svg.text([x, y - 14.0], label, &TextStyle::note());
}
