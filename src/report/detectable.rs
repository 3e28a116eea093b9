//! How small errors of an experiment may be and still be named: a bar for each, on a logarithmic axis.

use super::axis::Axis;
use super::color::{AXIS, EMPTY, GRID, SERIES};
use super::number::significant;
use super::svg::{NORMAL, SMALL, Svg, TextStyle};
use super::text::{shortened, text_width};
use crate::sensitivity::{DetectableSize, DetectionLimit};

const PLOT: f64 = 380.0;
const ROW: f64 = 20.0;
/// The widest label, px.
const WIDEST: f64 = 420.0;
const TITLE: &str = "Smallest errors that would be named with 90 % probability";

/// Bars of the sizes, coloured by what keeps smaller ones from being named; shorter is better. Sizes are in the units
/// that the parameters' names end with, all on one axis. Of a cause with many parameters the largest size stands for
/// all ([`telling`]).
pub fn detectable_picture(sizes: &[DetectableSize]) -> String {
    let rows = telling(sizes);
    let found = rows.iter().filter_map(|(row, _)| row.size);
    let Some(axis) = Axis::covering(found, true, 0.06) else {
        return Svg::placeholder(TITLE, "nothing would be named");
    };
    let labels: Vec<String> = rows.iter().map(|(row, num)| label_of(row, *num)).collect();
    let left = labels.iter().map(|l| text_width(l, NORMAL)).fold(60.0, f64::max).min(WIDEST) + 22.0;
    let (top, height) = (58.0, ROW * rows.len() as f64);
    let mut svg = Svg::new(left + PLOT + 150.0, top + height + 46.0);
    svg.text([12.0, 18.0], TITLE, &TextStyle::title());
    let mut x = 12.0;
    for limit in [DetectionLimit::Noise, DetectionLimit::Allowance, DetectionLimit::Rival] {
        svg.rect([x, 29.0, 10.0, 10.0], color_of(limit));
        let words = format!("limited by {}", limit.words());
        svg.text([x + 15.0, 38.0], &words, &TextStyle::new(SMALL));
        x += 15.0 + text_width(&words, SMALL) + 20.0;
    }
    let at = |size: f64| left + PLOT * axis.fraction(size);
    for tick in axis.ticks(6) {
        svg.line([at(tick.value), top], [at(tick.value), top + height], GRID, 1.0, "");
        svg.text([at(tick.value), top + height + 15.0], &tick.label, &TextStyle::note().middle());
    }
    let axis_label = "size, in the unit of each parameter";
    svg.text([left + 0.5 * PLOT, top + height + 34.0], axis_label, &TextStyle::new(NORMAL).middle());
    for (n, ((row, _), label)) in rows.iter().zip(&labels).enumerate() {
        let y = top + ROW * n as f64;
        let baseline = y + 0.5 * ROW + 4.0;
        svg.text([left - 12.0, baseline], &shortened(label, NORMAL, WIDEST), &TextStyle::new(NORMAL).end());
        let (end, text) = match row.size {
            Some(size) => (at(size), significant(size, 3)),
            None => (left, format!("never: {}", row.limited_by.words())),
        };
        let color = if row.size.is_some() { color_of(row.limited_by) } else { EMPTY };
        svg.rect([left, y + 4.0, (end - left).max(1.0), ROW - 8.0], color);
        let rival = row.rival.as_ref().map_or_else(String::new, |name| format!(" ({name})"));
        svg.text([end + 6.0, baseline], &format!("{text}{rival}"), &TextStyle::new(SMALL));
    }
    svg.line([left, top], [left, top + height], AXIS, 1.0, "");
    svg.finish(TITLE)
}

/// Most parameters of a cause that are shown one by one.
const MOST_SHOWN: usize = 6;

/// The sizes that tables and pictures show, each with the number of parameters that it stands for: all of them, but of
/// a cause with more than six parameters (a background) the largest alone.
pub fn telling(sizes: &[DetectableSize]) -> Vec<(&DetectableSize, usize)> {
    let is_same = |a: &DetectableSize, b: &DetectableSize| a.cause == b.cause && a.description == b.description;
    let mut shown = Vec::new();
    for cause in sizes.chunk_by(is_same) {
        let value = |row: &DetectableSize| row.size.unwrap_or(f64::INFINITY);
        match cause.iter().max_by(|a, b| value(a).total_cmp(&value(b))) {
            Some(largest) if cause.len() > MOST_SHOWN => shown.push((largest, cause.len())),
            _ => shown.extend(cause.iter().map(|row| (row, 1))),
        }
    }
    shown
}

/// Cause and parameter; of several holes, which one.
fn label_of(row: &DetectableSize, num: usize) -> String {
    let which = which_of(row);
    let hardest = if num > 1 { format!(", hardest of {num}") } else { String::new() };
    format!("{}{which}: {}{hardest}", row.cause, row.parameter)
}

/// The number in a cause's description (that of a hole), with a space before it; empty where there is none.
pub fn which_of(row: &DetectableSize) -> String {
    let number: String =
        row.description.chars().skip_while(|c| !c.is_ascii_digit()).take_while(|c| c.is_ascii_digit()).collect();
    if number.is_empty() { number } else { format!(" {number}") }
}

fn color_of(limit: DetectionLimit) -> &'static str {
    match limit {
        DetectionLimit::Noise => SERIES[2],
        DetectionLimit::Allowance => SERIES[1],
        DetectionLimit::Rival => SERIES[4],
        DetectionLimit::Drives => EMPTY,
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    pub(in super::super) fn sample() -> Vec<DetectableSize> {
        let row = |cause: &str, description: &str, parameter: &str, size: Option<f64>, limited_by| DetectableSize {
            cause: cause.into(),
            description: description.into(),
            parameter: parameter.into(),
            size,
            largest: 5.0,
            limited_by,
            rival: (limited_by == DetectionLimit::Rival).then(|| "compliance".into()),
        };
        let mut all = vec![
            row("gain", "a factor", "relative_gain_error_x", Some(0.011), DetectionLimit::Rival),
            row("hole", "hole 0 is off", "diameter_error_mm", Some(0.12), DetectionLimit::Allowance),
            row("hole", "hole 1 is off", "diameter_error_mm", Some(0.13), DetectionLimit::Noise),
            row("slack", "the drive lags", "slack_mm", None, DetectionLimit::Drives),
        ];
        let of_background = |n: usize| {
            let size = Some(0.01 * n as f64);
            row("background", "smooth", &format!("u_x_{n}_mm"), size, DetectionLimit::Noise)
        };
        all.extend((1..=30).map(of_background));
        all
    }

    #[test]
    fn every_size_has_a_bar() {
        let svg = detectable_picture(&sample());
        assert_well_formed(&svg);
        for text in ["hole 1: diameter_error_mm", "0.0110 (compliance)", "never: one drive alone", "hardest of 30"] {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(svg.matches("u_x_").count(), 1, "of many parameters one stands for all");
        assert!(svg.contains("u_x_30_mm"));
    }

    #[test]
    fn without_sizes_it_says_so() {
        assert!(detectable_picture(&[]).contains("nothing would be named"));
    }
}
