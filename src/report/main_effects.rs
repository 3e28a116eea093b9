//! Main effects: a response against each variable of a sweep in turn, the others being averaged over.

use super::axis::Axis;
use super::color::{ACCENT, BEST, FAINT};
use super::frame::Frame;
use super::svg::{SMALL, Svg, TITLE, TextStyle};
use super::text::shortened;

/// One variable.
#[derive(Clone, Debug, Default)]
pub struct MainEffect {
    /// Name and unit.
    pub label: String,
    /// Its value in every design.
    pub values: Vec<f64>,
}

/// A panel per variable: every design as a point, the mean over groups of equal or neighbouring values as a line.
#[derive(Clone, Debug, Default)]
pub struct MainEffectsPlot {
    /// Title above.
    pub title: String,
    /// Response with unit.
    pub response_label: String,
    /// Response of every design; what is not finite is left out.
    pub response: Vec<f64>,
    /// The variables.
    pub effects: Vec<MainEffect>,
}

const PANEL: [f64; 2] = [220.0, 170.0];
const LEFT: f64 = 64.0;
const TOP: f64 = 40.0;
const GAP: [f64; 2] = [22.0, 58.0];
const PER_ROW: usize = 3;
/// Groups of values where a variable has more values than these.
const MAX_GROUPS: usize = 8;

impl MainEffectsPlot {
    /// The picture.
    pub fn to_svg(&self) -> String {
        let Some(vertical) = Axis::covering(self.response.iter().copied(), false, 0.06) else {
            return Svg::placeholder(&self.title, "no design was evaluated");
        };
        let effects: Vec<(&MainEffect, Axis)> = self
            .effects
            .iter()
            .filter_map(|e| Some((e, Axis::covering(e.values.iter().copied(), false, 0.05)?)))
            .collect();
        if effects.is_empty() {
            return Svg::placeholder(&self.title, "no variable has values");
        }
        let num_columns = effects.len().min(PER_ROW);
        let num_rows = effects.len().div_ceil(PER_ROW);
        let width = LEFT + num_columns as f64 * (PANEL[0] + GAP[0]);
        let mut svg = Svg::new(width, TOP + num_rows as f64 * (PANEL[1] + GAP[1]));
        svg.text([12.0, 18.0], &shortened(&self.title, TITLE, width - 24.0), &TextStyle::title());
        for (index, (effect, horizontal)) in effects.into_iter().enumerate() {
            let x = LEFT + (index % PER_ROW) as f64 * (PANEL[0] + GAP[0]);
            let y = TOP + (index / PER_ROW) as f64 * (PANEL[1] + GAP[1]);
            let frame = Frame { area: [x, y, PANEL[0], PANEL[1]], horizontal, vertical };
            frame.draw_grid(&mut svg, 4, 5);
            let pairs: Vec<[f64; 2]> = effect
                .values
                .iter()
                .zip(&self.response)
                .filter(|(v, r)| v.is_finite() && r.is_finite())
                .map(|(v, r)| [*v, *r])
                .collect();
            for pair in &pairs {
                svg.circle(frame.at(*pair), 1.8, FAINT, "none", 0.0);
            }
            let means: Vec<[f64; 2]> = group_means(&pairs).into_iter().map(|p| frame.at(p)).collect();
            svg.polyline(&means, ACCENT, 1.8);
            for at in means {
                svg.circle(at, 3.2, BEST, "#ffffff", 1.0);
            }
            frame.draw_bottom(&mut svg, &shortened(&effect.label, SMALL, PANEL[0]), 4);
            if index % PER_ROW == 0 {
                frame.draw_left(&mut svg, &shortened(&self.response_label, SMALL, PANEL[1] + 30.0), 5, 48.0);
            }
        }
        svg.finish(&self.title)
    }
}

/// Mean value and mean response of groups of equal values, or of about equally many neighbouring ones.
fn group_means(pairs: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut sorted = pairs.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut groups: Vec<Vec<[f64; 2]>> = Vec::new();
    for pair in &sorted {
        match groups.last_mut() {
            Some(group) if group[0][0].total_cmp(&pair[0]).is_eq() => group.push(*pair),
            _ => groups.push(vec![*pair]),
        }
    }
    if groups.len() > MAX_GROUPS {
        groups = sorted.chunks(sorted.len().div_ceil(MAX_GROUPS)).map(<[_]>::to_vec).collect();
    }
    let mean = |group: &Vec<[f64; 2]>| [0, 1].map(|c| group.iter().map(|p| p[c]).sum::<f64>() / group.len() as f64);
    groups.iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    #[test]
    fn equal_values_are_one_group_and_many_values_a_few() {
        let grid: Vec<[f64; 2]> = (0..12).map(|i| [f64::from(i % 3), f64::from(i)]).collect();
        // Values 0, 1, 2 hold the responses 0 3 6 9, 1 4 7 10, 2 5 8 11.
        assert_eq!(group_means(&grid), vec![[0.0, 4.5], [1.0, 5.5], [2.0, 6.5]]);
        let many: Vec<[f64; 2]> = (0..80).map(|i| [f64::from(i), 1.0]).collect();
        assert_eq!(group_means(&many).len(), MAX_GROUPS);
    }

    #[test]
    fn pictures_are_well_formed_with_and_without_data() {
        let effect = |label: &str| MainEffect { label: label.into(), values: (0..9).map(f64::from).collect() };
        let mut plot = MainEffectsPlot {
            title: "What <each> variable does".into(),
            response_label: "force / N".into(),
            response: (0..9).map(|i| f64::from(i * i)).collect(),
            effects: ["a", "b", "c", "d"].map(effect).into(),
        };
        plot.response[3] = f64::NAN;
        assert_well_formed(&plot.to_svg());
        plot.response = vec![f64::NAN; 9];
        assert!(plot.to_svg().contains("no design"));
        assert_well_formed(&MainEffectsPlot::default().to_svg());
    }
}
