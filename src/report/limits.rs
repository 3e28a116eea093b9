//! How far a design is from each of its limits.

use super::color::{ACCENT, AXIS, BAD};
use super::number::{signed_percent, significant};
use super::svg::{NORMAL, SMALL, Svg, TITLE, TextStyle};
use super::text::{shortened, text_width};

/// One limit.
#[derive(Clone, Debug, Default)]
pub struct LimitBar {
    /// What is limited.
    pub name: String,
    /// Unit of value and limit.
    pub unit: String,
    /// Value of the design.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// Margin relative to the limit; negative where it is broken.
    pub margin_relative: f64,
    /// The limit holds.
    pub is_satisfied: bool,
}

/// Bars of relative margins: broken limits first, then the closest.
#[derive(Clone, Debug, Default)]
pub struct LimitsPlot {
    /// Title above.
    pub title: String,
    /// The limits, in any order.
    pub limits: Vec<LimitBar>,
}

const PLOT: f64 = 260.0;
const ROW: f64 = 24.0;
/// Margins beyond this share of the limit are cut: they are far away, which is all that matters.
const LARGEST: f64 = 1.0;

impl LimitsPlot {
    /// The picture. A broken limit's bar goes to the left and is red.
    pub fn to_svg(&self) -> String {
        if self.limits.is_empty() {
            return Svg::placeholder(&self.title, "no limits were set");
        }
        let mut limits: Vec<&LimitBar> = self.limits.iter().collect();
        limits
            .sort_by(|a, b| a.is_satisfied.cmp(&b.is_satisfied).then(a.margin_relative.total_cmp(&b.margin_relative)));
        let names = limits.iter().map(|l| text_width(&l.name, NORMAL)).fold(0.0, f64::max);
        let left = (names + 20.0).clamp(80.0, 300.0);
        let (top, height) = (48.0, ROW * limits.len() as f64);
        let least = limits.iter().map(|l| l.margin_relative).filter(|m| m.is_finite()).fold(0.0, f64::min);
        let low = if least < 0.0 { least.max(-LARGEST) } else { 0.0 };
        let at = |margin: f64| left + PLOT * (margin.clamp(low, LARGEST) - low) / (LARGEST - low);
        let value_at = left + PLOT + 74.0;
        let values = limits.iter().map(|l| text_width(&value_text(l), SMALL)).fold(80.0, f64::max);
        let mut svg = Svg::new(value_at + values + 12.0, top + height + 14.0);
        svg.text([left, 18.0], &shortened(&self.title, TITLE, PLOT + 240.0), &TextStyle::title());
        svg.text([left, top - 8.0], "margin relative to the limit", &TextStyle::note());
        svg.text([value_at, top - 8.0], "value (limit)", &TextStyle::note());
        for (row, limit) in limits.iter().enumerate() {
            let y = top + row as f64 * ROW;
            let text_y = y + 0.5 * ROW + 4.0;
            let color = if limit.is_satisfied { ACCENT } else { BAD };
            let name = shortened(&limit.name, NORMAL, left - 14.0);
            let style = TextStyle::new(NORMAL).end();
            svg.text([left - 12.0, text_y], &name, &if limit.is_satisfied { style } else { style.color(BAD) });
            let mut end = at(0.0);
            if limit.margin_relative.is_finite() {
                let margin = at(limit.margin_relative);
                svg.rect([margin.min(end), y + 6.0, (margin - end).abs().max(1.5), ROW - 12.0], color);
                end = end.max(margin);
            }
            let is_cut = limit.margin_relative > LARGEST;
            let percent = if is_cut { "> 100 %".into() } else { signed_percent(limit.margin_relative) };
            svg.text([end + 6.0, text_y], &percent, &TextStyle::new(SMALL).color(color));
            svg.text([value_at, text_y], &value_text(limit), &TextStyle::new(SMALL));
        }
        svg.line([at(0.0), top - 2.0], [at(0.0), top + height + 2.0], AXIS, 1.0, "");
        svg.finish(&self.title)
    }
}

fn value_text(limit: &LimitBar) -> String {
    let text = format!("{} ({}) {}", significant(limit.value, 3), significant(limit.limit, 3), limit.unit);
    text.trim_end().to_string()
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    pub(in super::super) fn sample(is_broken: bool) -> LimitsPlot {
        let bar = |name: &str, unit: &str, value: f64, limit: f64, margin: f64| LimitBar {
            name: name.into(),
            unit: unit.into(),
            value,
            limit,
            margin_relative: margin,
            is_satisfied: margin >= 0.0,
        };
        let mut limits = vec![
            bar("largest drive", "mm", 7.0, 7.0, 0.0),
            bar("ligament hole 1 – hole 2", "mm", 3.02, 2.0, 0.51),
            bar("ligament hole 2 – edge x+", "mm", 2.1, 2.0, 0.05),
            bar("largest force", "N", 9.2, 20.0, 0.54),
            bar("largest local stretch", "", 2.31, 3.0, 0.23),
            bar("voxels across a ligament", "", 9.0, 3.0, 2.0),
        ];
        if is_broken {
            limits.push(bar("ligament hole 1 – edge z−", "mm", 1.4, 2.0, -0.3));
            limits.push(bar("unknown", "mm", f64::NAN, 2.0, f64::NAN));
        }
        LimitsPlot { title: "Limits of the chosen design".into(), limits }
    }

    #[test]
    fn closest_limit_comes_first() {
        let svg = sample(false).to_svg();
        assert_well_formed(&svg);
        assert!(svg.find("largest drive") < svg.find("edge x+") && svg.contains("&gt; 100 %"));
        assert_well_formed(&sample(true).to_svg());
        assert_eq!(svg, sample(false).to_svg());
    }

    #[test]
    fn no_limits_make_a_placeholder() {
        assert!(LimitsPlot::default().to_svg().contains("no limits"));
    }
}
