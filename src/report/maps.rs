//! Voxel fields as maps: middle slices and means, at true aspect ratio.

use super::axis::Axis;
use super::color::{AXIS, ColorMap, EMPTY};
use super::frame::{Frame, draw_color_bar};
use super::number::{fixed, trimmed};
use super::svg::{SMALL, Svg, TITLE, TextStyle};
use super::text::shortened;

/// One scalar field on the voxel grid.
#[derive(Clone, Debug, Default)]
pub struct VoxelField {
    /// Title above the maps.
    pub title: String,
    /// Unit, beside the colour bar; empty for a pure number.
    pub unit: String,
    /// Values, x fastest: `i + nx (j + ny k)`; NaN outside the material.
    pub values: Vec<f64>,
    /// Colours.
    pub map: ColorMap,
    /// Ends of the colour scale, to compare pictures; None takes the field's 0.5 and 99.5 percentiles.
    pub range: Option<[f64; 2]>,
}

/// Maps of several fields on one grid. Each field has four maps: the slice through the middle voxel and the mean over
/// the third direction, in x–z (above) and x–y (below). A grid of one layer along y or z has one map, of that layer.
#[derive(Clone, Debug, Default)]
pub struct VoxelMaps {
    /// Voxels along x, y, z.
    pub shape: [usize; 3],
    /// Centre of voxel (0, 0, 0), mm.
    pub origin_mm: [f64; 3],
    /// Edges of a voxel, mm.
    pub voxel_mm: [f64; 3],
    /// The fields, two to a row.
    pub fields: Vec<VoxelField>,
}

const MAP_WIDTH: f64 = 186.0;
const LARGEST_HEIGHT: f64 = 260.0;
const LEFT: f64 = 46.0;
const TOP: f64 = 46.0;
const GAP: f64 = 14.0;
const BAR: f64 = 76.0;
const BETWEEN: f64 = 30.0;
/// Between a map and the one below it.
const GAP_BELOW: f64 = 22.0;

impl VoxelMaps {
    /// The picture.
    pub fn to_svg(&self) -> String {
        self.drawn(&[false, true])
    }

    /// The slices alone: for fields whose mean says nothing, such as wrapped phases.
    pub fn slices_to_svg(&self) -> String {
        self.drawn(&[false])
    }

    /// A column of maps for each entry: the slice (false) or the mean (true).
    fn drawn(&self, kinds: &[bool]) -> String {
        let name = "Maps of voxel fields";
        let num_voxels: usize = self.shape.iter().product();
        let grid_is_valid = self.voxel_mm.iter().all(|v| v.is_finite() && *v > 0.0)
            && self.origin_mm.iter().all(|v| v.is_finite())
            && num_voxels > 0;
        if !grid_is_valid || self.fields.is_empty() || self.fields.iter().any(|f| f.values.len() != num_voxels) {
            return Svg::placeholder(name, "no voxels to show");
        }
        let extent = [0, 1, 2].map(|a| self.shape[a] as f64 * self.voxel_mm[a]);
        let views = self.views();
        // The mean over one layer is that layer.
        let kinds = if views.len() == 1 { &[false] } else { kinds };
        let highest = views.iter().map(|view| extent[view.vertical]).fold(0.0, f64::max);
        let scale = (MAP_WIDTH / extent[0]).min(LARGEST_HEIGHT / highest);
        let size = extent.map(|e| e * scale);
        let block = [LEFT + maps_width(kinds, size[0]) + BAR, TOP + views_height(&views, size) + 46.0];
        let columns = self.fields.len().min(2);
        let rows = self.fields.len().div_ceil(2);
        let width = columns as f64 * (block[0] + BETWEEN) - BETWEEN;
        let mut svg = Svg::new(width.max(300.0), rows as f64 * block[1]);
        for (index, field) in self.fields.iter().enumerate() {
            let corner = [(index % 2) as f64 * (block[0] + BETWEEN), (index / 2) as f64 * block[1]];
            self.draw_field(&mut svg, field, corner, size, (&views, kinds));
        }
        svg.finish(name)
    }

    /// x–z above x–y; of one layer along y or z, the one of the two that shows it.
    fn views(&self) -> Vec<View> {
        let (xz, xy) = (View { vertical: 2, third: 1 }, View { vertical: 1, third: 2 });
        match self.shape {
            [_, 1, nz] if nz > 1 => vec![xz],
            [_, ny, 1] if ny > 1 => vec![xy],
            _ => vec![xz, xy],
        }
    }

    /// Draws the maps of a field, which are `size` large along x, y and z, at the corner.
    fn draw_field(
        &self,
        svg: &mut Svg,
        field: &VoxelField,
        [x0, y0]: [f64; 2],
        size: [f64; 3],
        (views, kinds): (&[View], &[bool]),
    ) {
        let w = size[0];
        let title_width = maps_width(kinds, w);
        svg.text([x0 + LEFT, y0 + 16.0], &shortened(&field.title, TITLE, title_width), &TextStyle::title());
        let Some((range, is_clipped)) = color_range(field) else {
            svg.text([x0 + LEFT, y0 + TOP + 20.0], "no voxel has a value", &TextStyle::note());
            return;
        };
        for (number, &View { vertical, third }) in views.iter().enumerate() {
            let (height, top) =
                (size[vertical], y0 + TOP + views_height(&views[..number], size) + GAP_BELOW * number.min(1) as f64);
            for (column, &is_mean) in kinds.iter().enumerate() {
                let left = x0 + LEFT + column as f64 * (w + GAP);
                let values = self.section(field, vertical, third, is_mean);
                let cells = [self.shape[0], self.shape[vertical]];
                svg.rect([left, top, w, height], EMPTY);
                svg.cells([left, top, w, height], cells, |i, j| {
                    let v = values[i + cells[0] * (cells[1] - 1 - j)];
                    let step = |t: f64| (64.0 * t.clamp(0.0, 1.0)).round() / 64.0;
                    v.is_finite().then(|| field.map.hex(step((v - range[0]) / (range[1] - range[0]))))
                });
                svg.stroked_rect([left, top, w, height], "none", AXIS, 0.5);
                let frame =
                    Frame { area: [left, top, w, height], horizontal: self.axis(0), vertical: self.axis(vertical) };
                let third_name = ["x", "y", "z"][third];
                let middle = self.origin_mm[third] + (self.shape[third] / 2) as f64 * self.voxel_mm[third];
                let caption = if is_mean {
                    format!("mean over {third_name}")
                } else {
                    format!("slice {third_name} = {} mm", trimmed(fixed(middle, 2)))
                };
                svg.text([left, top - 5.0], &caption, &TextStyle::note());
                if number + 1 == views.len() {
                    frame.draw_bottom(svg, "", 5);
                    svg.text([left + w, top + height + 30.0], "x / mm", &TextStyle::note().end());
                }
                if column == 0 {
                    let num_ticks = if height < 44.0 { 2 } else { ((height / 26.0) as usize).clamp(4, 6) };
                    frame.draw_left(svg, "", num_ticks, 0.0);
                    let label = ["x / mm", "y / mm", "z / mm"][vertical];
                    let style = TextStyle::new(SMALL).color(super::color::MUTED).middle().vertical();
                    svg.text([left - 34.0, top + 0.5 * height], label, &style);
                }
            }
        }
        let bar = [x0 + LEFT + maps_width(kinds, w) + 14.0, y0 + TOP, 11.0, views_height(views, size)];
        draw_color_bar(svg, bar, field.map, range, is_clipped, &field.unit);
    }

    fn axis(&self, direction: usize) -> Axis {
        let low = self.origin_mm[direction] - 0.5 * self.voxel_mm[direction];
        Axis::linear(low, low + self.shape[direction] as f64 * self.voxel_mm[direction])
    }

    /// Values over x and `vertical` (x fastest): the middle slice of `third`, or the mean over its finite values.
    fn section(&self, field: &VoxelField, vertical: usize, third: usize, is_mean: bool) -> Vec<f64> {
        let [nx, ny, _] = self.shape;
        let value = |i: usize, v: usize, t: usize| {
            let (j, k) = if vertical == 1 { (v, t) } else { (t, v) };
            field.values[i + nx * (j + ny * k)]
        };
        let mut out = Vec::with_capacity(nx * self.shape[vertical]);
        for v in 0..self.shape[vertical] {
            for i in 0..nx {
                out.push(if is_mean {
                    let finite = (0..self.shape[third]).map(|t| value(i, v, t)).filter(|x| x.is_finite());
                    let (sum, count) = finite.fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
                    if count > 0.0 { sum / count } else { f64::NAN }
                } else {
                    value(i, v, self.shape[third] / 2)
                });
            }
        }
        out
    }
}

/// A map: its vertical direction (1 for y, 2 for z), and the one that is cut or averaged.
#[derive(Clone, Copy)]
struct View {
    vertical: usize,
    third: usize,
}

/// Height of maps above each other.
fn views_height(views: &[View], size: [f64; 3]) -> f64 {
    views.iter().map(|view| size[view.vertical]).sum::<f64>() + GAP_BELOW * views.len().saturating_sub(1) as f64
}

/// Width of the maps of one field beside each other.
fn maps_width(kinds: &[bool], width: f64) -> f64 {
    kinds.len() as f64 * (width + GAP) - GAP
}

/// Ends of the colour scale, and whether values lie beyond them. None without a finite value.
fn color_range(field: &VoxelField) -> Option<([f64; 2], [bool; 2])> {
    let mut values: Vec<f64> = field.values.iter().copied().filter(|v| v.is_finite()).collect();
    values.sort_unstable_by(f64::total_cmp);
    let (&low, &high) = (values.first()?, values.last()?);
    let percentile = |p: f64| values[(p * (values.len() - 1) as f64).round() as usize];
    let given = field.range.filter(|[a, b]| a.is_finite() && b.is_finite() && a < b);
    let range = given.unwrap_or_else(|| field.map.range([percentile(0.005), percentile(0.995)]));
    Some((range, [low < range[0], high > range[1]]))
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    pub(in super::super) fn sample() -> VoxelMaps {
        let shape = [25, 34, 25];
        let voxel_mm: [f64; 3] = [1.0, 0.1875, 0.75];
        let origin_mm = [0, 1, 2].map(|a| -0.5 * (shape[a] as f64 - 1.0) * voxel_mm[a]);
        let field = |f: &dyn Fn([f64; 3]) -> f64| {
            let mut values = Vec::new();
            for k in 0..shape[2] {
                for j in 0..shape[1] {
                    for i in 0..shape[0] {
                        let p = [
                            origin_mm[0] + i as f64 * voxel_mm[0],
                            origin_mm[1] + j as f64 * voxel_mm[1],
                            origin_mm[2] + k as f64 * voxel_mm[2],
                        ];
                        let r = (p[0].abs() - 4.2333).hypot(p[2]);
                        values.push(if r < 2.5 { f64::NAN } else { f(p) + 0.3 / (r - 2.0) });
                    }
                }
            }
            values
        };
        VoxelMaps {
            shape,
            origin_mm,
            voxel_mm,
            fields: vec![
                VoxelField {
                    title: "Stretch amplitude λ".into(),
                    values: field(&|p| 1.3 + 0.004 * p[0] * p[1]),
                    ..VoxelField::default()
                },
                VoxelField {
                    title: "Displacement along x, u₁".into(),
                    unit: "mm".into(),
                    values: field(&|p| 2.5 + 0.8 * p[1]),
                    map: ColorMap::Magma,
                    range: None,
                },
                VoxelField {
                    title: "Sensitivity S_α₁".into(),
                    unit: "kPa".into(),
                    values: field(&|p| 3.0 * (0.4 * p[0]).sin()),
                    map: ColorMap::Diverging,
                    range: None,
                },
                VoxelField { title: "Nothing".into(), values: vec![f64::NAN; 25 * 34 * 25], ..VoxelField::default() },
            ],
        }
    }

    #[test]
    fn maps_are_drawn_the_same_every_time() {
        let svg = sample().to_svg();
        assert_well_formed(&svg);
        assert_eq!(svg, sample().to_svg());
        assert!(svg.contains("no voxel has a value"));
        assert!(svg.len() < 300_000, "{}", svg.len());
    }

    #[test]
    fn sections_take_the_right_voxels() {
        let maps = VoxelMaps {
            shape: [2, 3, 2],
            origin_mm: [0.0; 3],
            voxel_mm: [1.0; 3],
            fields: vec![VoxelField { values: (0..12).map(f64::from).collect(), ..VoxelField::default() }],
        };
        let field = &maps.fields[0];
        // x–z through j = 1: i + 2 (1 + 3 k).
        assert_eq!(maps.section(field, 2, 1, false), [2.0, 3.0, 8.0, 9.0]);
        assert_eq!(maps.section(field, 2, 1, true), [2.0, 3.0, 8.0, 9.0]);
        assert_eq!(maps.section(field, 1, 2, false), [6.0, 7.0, 8.0, 9.0, 10.0, 11.0]);
        assert_eq!(maps.section(field, 1, 2, true), [3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    }

    #[test]
    fn poor_data_make_a_placeholder() {
        assert!(VoxelMaps::default().to_svg().contains("no voxels"));
        let mut maps = sample();
        maps.fields[0].values.pop();
        assert!(maps.to_svg().contains("no voxels"));
        let mut maps = sample();
        maps.voxel_mm[1] = f64::NAN;
        assert!(maps.to_svg().contains("no voxels"));
        let mut maps = sample();
        maps.fields[0].values.fill(2.0);
        assert_well_formed(&maps.to_svg());
    }
}
