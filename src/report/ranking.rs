//! Two rankings of the same designs side by side: where they agree and where not.

use super::color::{BASE, BEST, FAINT, MUTED};
use super::number::significant;
use super::svg::{NORMAL, SMALL, Svg, TITLE, TextStyle};
use super::text::shortened;

/// One design with its two values.
#[derive(Clone, Debug, Default)]
pub struct RankedItem {
    /// Name of the design.
    pub label: String,
    /// Value of the left measure; NaN ranks last.
    pub left: f64,
    /// Value of the right measure; NaN ranks last.
    pub right: f64,
    /// The base specimen (grey).
    pub is_base: bool,
    /// The chosen design (highlighted).
    pub is_best: bool,
}

/// A slope chart: rank by one measure on the left, by another on the right.
#[derive(Clone, Debug, Default)]
pub struct RankingPlot {
    /// Title above.
    pub title: String,
    /// Name and unit of the left measure.
    pub left_label: String,
    /// Name and unit of the right measure.
    pub right_label: String,
    /// Larger left values are better.
    pub larger_left_is_better: bool,
    /// Larger right values are better.
    pub larger_right_is_better: bool,
    /// The designs.
    pub items: Vec<RankedItem>,
}

const ROW: f64 = 22.0;
const SIDE: f64 = 230.0;
const PLOT: f64 = 250.0;
const TOP: f64 = 74.0;

impl RankingPlot {
    /// The picture. Steep lines are designs that the two measures disagree on.
    pub fn to_svg(&self) -> String {
        let n = self.items.len();
        if n == 0 {
            return Svg::placeholder(&self.title, "no designs to rank");
        }
        let left = ranks(&self.items.iter().map(|i| i.left).collect::<Vec<_>>(), self.larger_left_is_better);
        let right = ranks(&self.items.iter().map(|i| i.right).collect::<Vec<_>>(), self.larger_right_is_better);
        let mut svg = Svg::new(2.0 * SIDE + PLOT, TOP + n as f64 * ROW + 10.0);
        svg.text([10.0, 18.0], &shortened(&self.title, TITLE, 2.0 * SIDE + PLOT - 20.0), &TextStyle::title());
        let note = match kendall(&left, &right) {
            Some(tau) => format!("rank correlation (Kendall's τ) {}", super::number::fixed(tau, 2)),
            None => String::new(),
        };
        svg.text([10.0, 36.0], &note, &TextStyle::note());
        let [x0, x1] = [SIDE, SIDE + PLOT];
        let style = TextStyle::new(SMALL).bold();
        svg.text([x0 - 8.0, TOP - 14.0], &shortened(&self.left_label, SMALL, SIDE - 12.0), &style.end());
        svg.text([x1 + 8.0, TOP - 14.0], &shortened(&self.right_label, SMALL, SIDE - 12.0), &style);
        let y = |rank: usize| TOP + (rank as f64 + 0.5) * ROW;

        // Highlighted designs last, so that their lines lie on top.
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by_key(|&i| (self.items[i].is_best, self.items[i].is_base, left[i].abs_diff(right[i])));
        for i in order {
            let item = &self.items[i];
            let change = left[i].abs_diff(right[i]);
            let (color, width) = match (item.is_best, item.is_base) {
                (true, _) => (BEST, 2.4),
                (_, true) => (BASE, 2.4),
                // A third of the list is a real disagreement.
                _ if 3 * change >= n.max(3) => (MUTED, 1.4),
                _ => (FAINT, 1.2),
            };
            let (a, b) = ([x0, y(left[i])], [x1, y(right[i])]);
            svg.line(a, b, color, width, "");
            svg.circle(a, 3.2, color, "#ffffff", 1.0);
            svg.circle(b, 3.2, color, "#ffffff", 1.0);
            let name = shortened(&item.label, NORMAL, SIDE - 110.0);
            let style = match (item.is_best, item.is_base) {
                (true, _) => TextStyle::new(NORMAL).color(BEST).bold(),
                (_, true) => TextStyle::new(NORMAL).bold(),
                _ => TextStyle::new(NORMAL),
            };
            for (at, rank, value, sign) in [(a, left[i], item.left, -1.0), (b, right[i], item.right, 1.0)] {
                let anchored = |s: TextStyle| if sign < 0.0 { s.end() } else { s };
                let text_y = at[1] + 4.0;
                svg.text([at[0] + sign * 9.0, text_y], &format!("{}", rank + 1), &anchored(TextStyle::note()));
                svg.text([at[0] + sign * 30.0, text_y], &significant(value, 3), &anchored(TextStyle::new(SMALL)));
                svg.text([at[0] + sign * 88.0, text_y], &name, &anchored(style));
            }
        }
        svg.finish(&self.title)
    }
}

/// Rank of each value, 0 for the best; equal values keep their order, NaN comes last.
fn ranks(values: &[f64], larger_is_better: bool) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    let key = |i: usize| match (values[i].is_nan(), larger_is_better) {
        (true, _) => f64::INFINITY,
        (_, true) => -values[i],
        (_, false) => values[i],
    };
    order.sort_by(|&a, &b| key(a).total_cmp(&key(b)).then(values[a].is_nan().cmp(&values[b].is_nan())));
    let mut ranks = vec![0; values.len()];
    for (rank, i) in order.into_iter().enumerate() {
        ranks[i] = rank;
    }
    ranks
}

/// Kendall's τ of two rankings without ties: share of agreeing pairs minus share of disagreeing ones.
fn kendall(a: &[usize], b: &[usize]) -> Option<f64> {
    let n = a.len();
    if n < 2 {
        return None;
    }
    let mut sum = 0i64;
    for i in 0..n {
        for j in 0..i {
            sum += if (a[i] < a[j]) == (b[i] < b[j]) { 1 } else { -1 };
        }
    }
    Some(sum as f64 / (n * (n - 1) / 2) as f64)
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    pub(in super::super) fn sample() -> RankingPlot {
        let values =
            [(1.87, 0.012), (1.74, 0.009), (1.71, 0.031), (1.52, 0.014), (1.40, 0.011), (1.22, 0.022), (1.0, 0.010)];
        let items = values
            .into_iter()
            .enumerate()
            .map(|(i, (left, right))| RankedItem {
                label: if i == 6 { "base".into() } else { format!("design {}", i + 1) },
                left,
                right,
                is_base: i == 6,
                is_best: i == 0,
            })
            .collect();
        RankingPlot {
            title: "Do integrated sensitivity and Fisher information agree?".into(),
            left_label: "integrated sensitivity, ratio to base".into(),
            right_label: "worst relative standard deviation".into(),
            larger_left_is_better: true,
            larger_right_is_better: false,
            items,
        }
    }

    #[test]
    fn ranks_and_their_correlation() {
        assert_eq!(ranks(&[2.0, f64::NAN, 3.0, 1.0], true), [1, 3, 0, 2]);
        assert_eq!(ranks(&[2.0, f64::NAN, 3.0, f64::INFINITY], false), [0, 3, 1, 2]);
        // Equal and reversed orders have τ = 1 and −1 by definition.
        assert_eq!(kendall(&[0, 1, 2], &[0, 1, 2]), Some(1.0));
        assert_eq!(kendall(&[0, 1, 2], &[2, 1, 0]), Some(-1.0));
        assert_eq!(kendall(&[0], &[0]), None);
    }

    #[test]
    fn slopes_are_drawn() {
        let svg = sample().to_svg();
        assert_well_formed(&svg);
        assert_eq!(svg, sample().to_svg());
        assert!(RankingPlot::default().to_svg().contains("no designs"));
        let mut plot = sample();
        plot.items.iter_mut().for_each(|i| i.left = f64::NAN);
        assert_well_formed(&plot.to_svg());
    }
}
