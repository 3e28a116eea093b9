//! Where the voxels lie in stretch amplitude λ and deformation mode k, as densities on a logarithmic colour scale.

use super::axis::Axis;
use super::color::{AXIS, ColorMap, EMPTY, GRID, MUTED};
use super::frame::{Frame, draw_color_bar};
use super::number::significant;
use super::svg::{SMALL, Svg, TITLE, TextStyle};
use super::text::shortened;

/// One panel: the densities of one specimen or one drive.
#[derive(Clone, Debug, Default)]
pub struct DensityPanel {
    /// Title above the panel.
    pub title: String,
    /// Counts or densities, not negative, λ fastest: `bin_λ + num_stretch_bins × bin_k`. Zero bins stay empty.
    pub density: Vec<f64>,
    /// The median stretch, marked by a line and written above; None for no line.
    pub median_stretch: Option<f64>,
}

/// Panels side by side (at most four in a row) with shared axes and one colour scale.
#[derive(Clone, Debug)]
pub struct DensityPlot {
    /// Ends of the λ axis.
    pub stretch_range: [f64; 2],
    /// Number of bins of λ.
    pub num_stretch_bins: usize,
    /// Ends of the k axis, usually 0 and 1.
    pub mode_range: [f64; 2],
    /// Number of bins of k.
    pub num_mode_bins: usize,
    /// What a density is, such as `voxels per bin`.
    pub density_label: String,
    /// The panels.
    pub panels: Vec<DensityPanel>,
    /// Colours.
    pub map: ColorMap,
}

const PANEL: [f64; 2] = [226.0, 196.0];
const MARGINAL: f64 = 26.0;
const GAP: f64 = 22.0;
const LEFT: f64 = 58.0;
const TOP: f64 = 30.0 + MARGINAL;
const BOTTOM: f64 = 48.0;
const RIGHT: f64 = 176.0;
const IN_ROW: usize = 4;

impl DensityPlot {
    /// The picture: k vertical, λ horizontal, colour log₁₀ of the density; above each panel its sum over k.
    pub fn to_svg(&self) -> String {
        let name = "Density of voxels over stretch amplitude λ and deformation mode k";
        let cells = self.num_stretch_bins * self.num_mode_bins;
        let usable = |v: f64| v.is_finite() && v > 0.0;
        let logs = || self.panels.iter().flat_map(|p| &p.density).filter(|v| usable(**v)).map(|v| v.log10());
        let (low, high) = logs().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let ranges_are_valid =
            [self.stretch_range, self.mode_range].iter().all(|[a, b]| a.is_finite() && b.is_finite() && a < b);
        if cells == 0 || low > high || !ranges_are_valid || self.panels.iter().any(|p| p.density.len() != cells) {
            return Svg::placeholder(name, "no voxel has a stretch and a mode");
        }
        let range = self.map.range([low, high]);

        let in_row = self.panels.len().min(IN_ROW);
        let num_rows = self.panels.len().div_ceil(IN_ROW);
        let row_height = TOP + PANEL[1] + BOTTOM;
        let width = LEFT + in_row as f64 * (PANEL[0] + GAP) - GAP + RIGHT;
        let mut svg = Svg::new(width, row_height * num_rows as f64);
        for (index, panel) in self.panels.iter().enumerate() {
            let (row, column) = (index / IN_ROW, index % IN_ROW);
            let (x, y) = (LEFT + column as f64 * (PANEL[0] + GAP), TOP + row as f64 * row_height);
            self.draw_panel(&mut svg, panel, [x, y], range, column == 0);
            if column + 1 == in_row || index + 1 == self.panels.len() {
                draw_mode_names(&mut svg, [x + PANEL[0] + 8.0, y], self.mode_range);
            }
        }
        let bar = [width - 62.0, TOP + 14.0, 12.0, PANEL[1] - 14.0];
        let label = format!("log₁₀ {}", self.density_label);
        draw_color_bar(&mut svg, bar, self.map, range, [false; 2], "");
        svg.text([width - 4.0, TOP], &label, &TextStyle::note().end());
        svg.finish(name)
    }

    fn draw_panel(&self, svg: &mut Svg, panel: &DensityPanel, [x, y]: [f64; 2], range: [f64; 2], is_first: bool) {
        let [w, h] = PANEL;
        let (nx, nk) = (self.num_stretch_bins, self.num_mode_bins);
        let frame = Frame {
            area: [x, y, w, h],
            horizontal: Axis::linear(self.stretch_range[0], self.stretch_range[1]),
            vertical: Axis::linear(self.mode_range[0], self.mode_range[1]),
        };
        svg.text([x, y - MARGINAL - 10.0], &shortened(&panel.title, TITLE, w - 78.0), &TextStyle::title());
        svg.rect([x, y, w, h], EMPTY);
        svg.cells([x, y, w, h], [nx, nk], |i, j| {
            let v = panel.density[i + nx * (nk - 1 - j)];
            // 64 steps of colour are finer than an eye tells apart in small cells and keep the file small.
            let step = |t: f64| (64.0 * t).round() / 64.0;
            (v.is_finite() && v > 0.0).then(|| self.map.hex(step((v.log10() - range[0]) / (range[1] - range[0]))))
        });
        svg.stroked_rect([x, y, w, h], "none", AXIS, 0.5);
        self.draw_marginal(svg, panel, [x, y]);
        frame.draw_bottom(svg, "stretch amplitude λ", 5);
        if is_first {
            frame.draw_left(svg, "deformation mode k", 5, 40.0);
        }
        if let Some(marked) =
            panel.median_stretch.filter(|m| (self.stretch_range[0]..=self.stretch_range[1]).contains(m))
        {
            let at = frame.at([marked, self.mode_range[0]])[0];
            svg.line([at, y - MARGINAL + 2.0], [at, y + h], MUTED, 1.0, "2 3");
            let text = format!("median {}", significant(marked, 3));
            svg.text([x + w, y - MARGINAL - 10.0], &text, &TextStyle::note().end());
        }
    }

    /// The sum over k as an area above the panel, each panel on its own linear scale.
    fn draw_marginal(&self, svg: &mut Svg, panel: &DensityPanel, [x, y]: [f64; 2]) {
        let nx = self.num_stretch_bins;
        let sums: Vec<f64> = (0..nx)
            .map(|i| (0..self.num_mode_bins).map(|k| panel.density[i + nx * k]).filter(|v| v.is_finite()).sum())
            .collect();
        let largest = sums.iter().copied().fold(0.0, f64::max);
        if largest <= 0.0 {
            return;
        }
        let step = PANEL[0] / nx as f64;
        let mut outline = vec![[x, y]];
        for (i, sum) in sums.iter().enumerate() {
            let top = y - (MARGINAL - 4.0) * sum / largest;
            outline.extend([[x + i as f64 * step, top], [x + (i + 1) as f64 * step, top]]);
        }
        outline.push([x + PANEL[0], y]);
        svg.polygon(&outline, GRID, "none", 0.0);
        svg.polyline(&outline[1..outline.len() - 1], AXIS, 0.75);
    }
}

/// What the values of k mean, right of the last panel.
fn draw_mode_names(svg: &mut Svg, [x, y]: [f64; 2], [low, high]: [f64; 2]) {
    for (k, name) in [(1.0, "uniaxial"), (0.5, "pure shear"), (0.0, "equibiaxial")] {
        let fraction = (k - low) / (high - low);
        if (-1e-9..=1.0 + 1e-9).contains(&fraction) {
            let at = y + PANEL[1] * (1.0 - fraction);
            svg.line([x - 6.0, at], [x - 1.0, at], AXIS, 1.0, "");
            svg.text([x + 2.0, at + 0.35 * SMALL], name, &TextStyle::note());
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    pub(in super::super) fn sample(num_panels: usize) -> DensityPlot {
        let (nx, nk) = (60, 50);
        let panels = (0..num_panels)
            .map(|p| {
                let spread = 0.10 + 0.07 * p as f64;
                let density = (0..nx * nk)
                    .map(|c| {
                        let (l, k) = ((c % nx) as f64 / nx as f64, (c / nx) as f64 / nk as f64);
                        let r = ((l - 0.3 - 0.1 * p as f64) / spread).powi(2) + ((k - 0.5) / (0.05 + 0.3 * l)).powi(2);
                        (900.0 * (-r).exp()).floor()
                    })
                    .collect();
                DensityPanel {
                    title: format!("two holes, {} mm", 2.5 * (p + 1) as f64),
                    density,
                    median_stretch: Some(1.4 + 0.1 * p as f64),
                }
            })
            .collect();
        DensityPlot {
            stretch_range: [1.0, 2.2],
            num_stretch_bins: nx,
            mode_range: [0.0, 1.0],
            num_mode_bins: nk,
            density_label: "voxels per bin".into(),
            panels,
            map: ColorMap::Viridis,
        }
    }

    #[test]
    fn panels_are_drawn_the_same_every_time() {
        for n in [1, 3, 6] {
            let svg = sample(n).to_svg();
            assert_well_formed(&svg);
            assert_eq!(svg, sample(n).to_svg());
            assert_eq!(svg.matches("stretch amplitude λ</text>").count(), n);
        }
    }

    #[test]
    fn poor_data_make_a_placeholder_or_empty_bins() {
        let mut plot = sample(1);
        plot.panels[0].density[3] = f64::NAN;
        plot.panels[0].density[4] = f64::INFINITY;
        plot.panels[0].median_stretch = Some(f64::NAN);
        assert_well_formed(&plot.to_svg());
        plot.panels[0].density.fill(0.0);
        assert!(plot.to_svg().contains("no voxel"));
        plot.panels[0].density.pop();
        assert!(plot.to_svg().contains("no voxel"));
        plot.panels.clear();
        assert!(plot.to_svg().contains("no voxel"));
        // A single filled bin has a colour range without length.
        let mut plot = sample(1);
        plot.panels[0].density.fill(0.0);
        plot.panels[0].density[70] = 1.0;
        assert_well_formed(&plot.to_svg());
    }
}
