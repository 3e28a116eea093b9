//! One axis: how values become positions, and where its ticks are.

use super::number::{fixed, significant, superscript, trimmed};

/// A range of values, linear or logarithmic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) is_log: bool,
}

/// A tick: value and label.
pub(super) struct Tick {
    pub(super) value: f64,
    pub(super) label: String,
}

impl Axis {
    /// A linear axis with fixed ends.
    pub(super) fn linear(low: f64, high: f64) -> Axis {
        Axis { low, high, is_log: false }
    }

    /// The axis that shows all usable values (finite; positive if logarithmic) with `padding` of its length on both
    /// sides. None without a usable value.
    pub(super) fn covering(values: impl IntoIterator<Item = f64>, is_log: bool, padding: f64) -> Option<Axis> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in values {
            if v.is_finite() && (!is_log || v > 0.0) {
                let v = if is_log { v.log10() } else { v };
                low = low.min(v);
                high = high.max(v);
            }
        }
        if low > high {
            return None;
        }
        let scale = low.abs().max(high.abs());
        if high - low <= 1e-9 * scale.max(1e-300) {
            let half = if is_log { 0.1 } else { (0.05 * scale).max(1e-12) };
            low -= half;
            high += half;
        }
        // Ends are halved first: the difference of two huge values must not overflow.
        let pad = (0.5 * high - 0.5 * low) * 2.0 * padding;
        (low, high) = (low - pad, high + pad);
        if is_log {
            (low, high) = (10f64.powf(low.max(-300.0)), 10f64.powf(high.min(300.0)));
        }
        (low.is_finite() && high.is_finite() && low < high).then_some(Axis { low, high, is_log })
    }

    /// Position of a value: 0 at the low end, 1 at the high end; NaN where it has none.
    pub(super) fn fraction(&self, value: f64) -> f64 {
        if self.is_log {
            if value <= 0.0 {
                return f64::NAN;
            }
            (value.ln() - self.low.ln()) / (self.high.ln() - self.low.ln())
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// At most about `count` ticks at round values within the axis.
    pub(super) fn ticks(&self, count: usize) -> Vec<Tick> {
        if self.is_log { self.log_ticks(count) } else { linear_ticks(self.low, self.high, count) }
    }

    fn log_ticks(&self, count: usize) -> Vec<Tick> {
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let inside = |v: f64| v >= self.low * (1.0 - 1e-9) && v <= self.high * (1.0 + 1e-9);
        for multiples in [&[1.0, 2.0, 5.0][..], &[1.0, 3.0], &[1.0]] {
            let values: Vec<f64> = (first..=last)
                .flat_map(|e| multiples.iter().map(move |m| m * 10f64.powi(e)))
                .filter(|&v| inside(v))
                .collect();
            if values.len() >= 3 && values.len() <= count + 1 {
                return values.into_iter().map(|value| Tick { value, label: log_label(value) }).collect();
            }
        }
        if self.high / self.low < 30.0 {
            return linear_ticks(self.low, self.high, count);
        }
        let stride = ((last - first) as usize / count.max(1) + 1) as i32;
        (first..=last)
            .filter(|e| e.rem_euclid(stride) == 0)
            .map(|e| 10f64.powi(e))
            .filter(|&v| inside(v))
            .map(|value| Tick { value, label: log_label(value) })
            .collect()
    }
}

fn log_label(value: f64) -> String {
    let exponent = value.log10().floor() as i32;
    if (-3..5).contains(&exponent) {
        return trimmed(significant(value, 1));
    }
    let mantissa = (value / 10f64.powi(exponent)).round();
    let power = format!("10{}", superscript(exponent));
    if mantissa > 1.5 { format!("{mantissa:.0} × {power}") } else { power }
}

fn linear_ticks(low: f64, high: f64, count: usize) -> Vec<Tick> {
    let rough = (high - low) / count.max(1) as f64;
    if !(rough.is_finite() && rough > 0.0) {
        return Vec::new();
    }
    let power = 10f64.powf(rough.log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= rough * 0.999).unwrap_or(10.0 * power);
    let (first, last) = ((low / step - 1e-6).ceil(), (high / step + 1e-6).floor());
    // An axis far from zero with a tiny length has no round values that floating point can tell apart.
    if !(first.abs() < 1e12 && last - first < 1000.0 && last >= first) {
        return Vec::new();
    }
    let largest = low.abs().max(high.abs());
    let decimals = (-step.log10() - 1e-9).ceil().max(0.0) as usize;
    (0..=(last - first) as usize)
        .map(|i| {
            let value = (first + i as f64) * step;
            let label = if largest >= 1e5 || decimals > 4 {
                let digits = (largest.log10().floor() - step.log10().floor()).clamp(0.0, 8.0) as usize;
                if value.abs() < 0.5 * step { "0".into() } else { scientific(value, digits) }
            } else {
                fixed(value, decimals)
            };
            Tick { value, label }
        })
        .collect()
}

fn scientific(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    format!("{} × 10{}", mantissa.replace('-', "−"), superscript(exponent.parse().unwrap_or(0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: Axis, count: usize) -> Vec<String> {
        axis.ticks(count).into_iter().map(|t| t.label).collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(labels(Axis::linear(0.0, 1.0), 5), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(Axis::linear(-13.0, 13.0), 6), ["−10", "−5", "0", "5", "10"]);
        assert_eq!(labels(Axis { low: 1e-3, high: 10.0, is_log: true }, 5), ["0.001", "0.01", "0.1", "1", "10"]);
        assert_eq!(labels(Axis { low: 0.9, high: 11.0, is_log: true }, 5), ["1", "2", "5", "10"]);
        assert_eq!(labels(Axis { low: 1e6, high: 1e9, is_log: true }, 5), ["10⁶", "10⁷", "10⁸", "10⁹"]);
    }

    #[test]
    fn every_axis_has_ticks_within_itself() {
        for is_log in [false, true] {
            for (a, b) in [(1.0, 1.0), (3.1, 3.2), (1e-12, 2e-12), (5.0, 9e5), (12.0, 18.0), (1e-9, 1e9)] {
                let axis = Axis::covering([a, b], is_log, 0.05).expect("usable values");
                let ticks = axis.ticks(5);
                assert!(ticks.len() >= 2 && ticks.len() <= 11, "{a} {b} {is_log}: {}", ticks.len());
                assert!(ticks.iter().all(|t| (-1e-6..=1.0 + 1e-6).contains(&axis.fraction(t.value))));
            }
        }
    }

    #[test]
    fn useless_values_make_no_axis() {
        assert!(Axis::covering([], false, 0.1).is_none());
        assert!(Axis::covering([f64::NAN, f64::INFINITY], false, 0.1).is_none());
        assert!(Axis::covering([-1.0, 0.0], true, 0.1).is_none());
        assert!(Axis::covering([-f64::MAX, f64::MAX], false, 0.1).is_none());
    }
}
