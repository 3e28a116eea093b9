//! A shaded picture of the deformed specimen with the reference shape as a ghost.

use super::color::{AXIS, ColorMap, FAINT, MUTED};
use super::frame::draw_color_bar;
use super::svg::{SMALL, Svg, TITLE, TextStyle};
use super::text::shortened;
use std::collections::BTreeMap;

/// A facet of the surface. The corners go around it; three corners are given by repeating the last.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapeQuad {
    /// Corners in the reference state, mm.
    pub reference: [[f64; 3]; 4],
    /// Corners in the current state, mm.
    pub current: [[f64; 3]; 4],
    /// Value that gives the colour; NaN for grey.
    pub value: f64,
}

/// The deformed specimen, seen from above the front: x to the right, y up, z towards the viewer.
#[derive(Clone, Debug, Default)]
pub struct DeformedShape {
    /// Title above.
    pub title: String,
    /// What the colour shows, with unit; empty hides the colour bar.
    pub value_label: String,
    /// The surface.
    pub quads: Vec<ShapeQuad>,
    /// Colours.
    pub map: ColorMap,
    /// Ends of the colour scale; None takes the values' 1 and 99 percentiles.
    pub range: Option<[f64; 2]>,
}

/// Turn about y and tilt about the screen's horizontal, rad. Unequal angles keep the edges of a block apart.
const AZIMUTH: f64 = 0.50;
const ELEVATION: f64 = 0.52;
const PICTURE: [f64; 2] = [470.0, 300.0];
/// Reference edges with a sharper angle than this (its cosine) are drawn, on the shape and as its ghost.
const SHARP_COSINE: f64 = 0.8;

impl DeformedShape {
    /// The picture, drawn from back to front (painter's algorithm).
    pub fn to_svg(&self) -> String {
        let is_finite = |q: &&ShapeQuad| q.reference.iter().chain(&q.current).flatten().all(|c| c.is_finite());
        let quads: Vec<&ShapeQuad> = self.quads.iter().filter(is_finite).collect();
        if quads.is_empty() {
            return Svg::placeholder(&self.title, "no surface to show");
        }
        let camera = Camera::around(quads.iter().flat_map(|q| q.reference.iter().chain(&q.current)));
        let (range, is_clipped) = self.color_range(&quads);
        let mut svg = Svg::new(PICTURE[0] + 110.0, PICTURE[1] + 44.0);
        svg.text([10.0, 18.0], &shortened(&self.title, TITLE, PICTURE[0]), &TextStyle::title());

        let sharp = sharp_edges(&quads);
        let draw_ghost = |svg: &mut Svg, color: &str, dash: &str| {
            for [a, b] in sharp.values() {
                svg.line(camera.project(*a), camera.project(*b), color, 0.9, dash);
            }
        };
        draw_ghost(&mut svg, FAINT, "");
        let mut order: Vec<(f64, usize)> =
            quads.iter().enumerate().map(|(i, q)| (camera.depth(center(&q.current)), i)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        svg.open_facets();
        for (_, i) in order {
            let quad = quads[i];
            let color = self.shaded(quad, &camera, range);
            let points = quad.current.map(|p| camera.project(p));
            svg.facet(&points, &color);
            for c in 0..4 {
                let (a, b) = (c, (c + 1) % 4);
                if sharp.contains_key(&edge_key(quad.reference[a], quad.reference[b])) {
                    svg.line(points[a], points[b], "#3c3c3c", 0.8, "");
                }
            }
        }
        svg.close_group();
        svg.open_translucent(0.45);
        draw_ghost(&mut svg, MUTED, "3 3");
        svg.close_group();
        draw_triad(&mut svg, &camera, [34.0, PICTURE[1] + 14.0]);
        if !self.value_label.is_empty() {
            let bar = [PICTURE[0] + 34.0, 70.0, 12.0, PICTURE[1] - 110.0];
            draw_color_bar(&mut svg, bar, self.map, range, is_clipped, "");
            svg.text([PICTURE[0] + 104.0, 52.0], &self.value_label, &TextStyle::note().end());
        }
        svg.finish(&self.title)
    }

    fn color_range(&self, quads: &[&ShapeQuad]) -> ([f64; 2], [bool; 2]) {
        let mut values: Vec<f64> = quads.iter().map(|q| q.value).filter(|v| v.is_finite()).collect();
        values.sort_unstable_by(f64::total_cmp);
        let (Some(&low), Some(&high)) = (values.first(), values.last()) else {
            return ([0.0, 1.0], [false; 2]);
        };
        let percentile = |p: f64| values[(p * (values.len() - 1) as f64).round() as usize];
        let given = self.range.filter(|[a, b]| a.is_finite() && b.is_finite() && a < b);
        let range = given.unwrap_or_else(|| self.map.range([percentile(0.01), percentile(0.99)]));
        (range, [low < range[0], high > range[1]])
    }

    /// The facet's colour in the light from above left of the viewer. Both sides of a facet are lit alike.
    fn shaded(&self, quad: &ShapeQuad, camera: &Camera, range: [f64; 2]) -> String {
        let rgb = if quad.value.is_finite() {
            self.map.rgb((quad.value - range[0]) / (range[1] - range[0]))
        } else {
            [200.0; 3]
        };
        let n = camera.turned(normal(&quad.current));
        let light = [-0.37, 0.74, 0.56];
        let towards = if n[2] < 0.0 { -1.0 } else { 1.0 };
        let cosine = towards * (n[0] * light[0] + n[1] * light[1] + n[2] * light[2]);
        let brightness = 0.78 + 0.22 * cosine.clamp(-0.6, 1.0);
        super::color::hex(rgb.map(|c| c * brightness + 255.0 * 0.05 * cosine.max(0.0)))
    }
}

/// Parallel projection that fits the picture.
struct Camera {
    scale: f64,
    offset: [f64; 2],
}

impl Camera {
    fn around<'a>(points: impl Iterator<Item = &'a [f64; 3]>) -> Camera {
        let unit = Camera { scale: 1.0, offset: [0.0; 2] };
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in points {
            let q = unit.project(*p);
            for c in 0..2 {
                low[c] = low[c].min(q[c]);
                high[c] = high[c].max(q[c]);
            }
        }
        let margin = 24.0;
        let size = [0, 1].map(|c| (high[c] - low[c]).max(1e-9));
        let scale = [0, 1].map(|c| (PICTURE[c] - 2.0 * margin) / size[c]).into_iter().fold(f64::INFINITY, f64::min);
        let offset = [0, 1].map(|c| 0.5 * PICTURE[c] - 0.5 * scale * (low[c] + high[c]));
        Camera { scale, offset: [offset[0], offset[1] + 28.0] }
    }

    /// Right, up and towards the viewer.
    fn turned(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let (sa, ca) = AZIMUTH.sin_cos();
        let (se, ce) = ELEVATION.sin_cos();
        let (right, back) = (ca * x - sa * z, sa * x + ca * z);
        [right, ce * y - se * back, se * y + ce * back]
    }

    fn project(&self, p: [f64; 3]) -> [f64; 2] {
        let [right, up, _] = self.turned(p);
        [self.offset[0] + self.scale * right, self.offset[1] - self.scale * up]
    }

    fn depth(&self, p: [f64; 3]) -> f64 {
        self.turned(p)[2]
    }
}

fn center(corners: &[[f64; 3]; 4]) -> [f64; 3] {
    [0, 1, 2].map(|c| 0.25 * corners.iter().map(|p| p[c]).sum::<f64>())
}

/// Unit normal from the diagonals (also right for a triangle with its last corner repeated); zero if degenerate.
fn normal(p: &[[f64; 3]; 4]) -> [f64; 3] {
    let d = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|c| b[c] - a[c]);
    let (u, v) = (d(p[0], p[2]), d(p[1], p[3]));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = n.iter().map(|c| c * c).sum::<f64>().sqrt();
    if length > 0.0 { n.map(|c| c / length) } else { [0.0; 3] }
}

/// An edge, whatever its direction: its ends on a grid of 10⁻⁵ mm, far below any edge and far above rounding.
type EdgeKey = [[i64; 3]; 2];

fn edge_key(a: [f64; 3], b: [f64; 3]) -> EdgeKey {
    let [a, b] = [a, b].map(|p| p.map(|c| (c * 1e5).round() as i64));
    [a.min(b), a.max(b)]
}

/// Sharp edges of the reference surface with their ends, each once.
fn sharp_edges(quads: &[&ShapeQuad]) -> BTreeMap<EdgeKey, [[f64; 3]; 2]> {
    let mut edges = BTreeMap::new();
    for quad in quads {
        let n = normal(&quad.reference);
        for c in 0..4 {
            let (a, b) = (quad.reference[c], quad.reference[(c + 1) % 4]);
            let key = edge_key(a, b);
            if key[0] != key[1] {
                edges.entry(key).or_insert_with(|| ([a, b], Vec::new())).1.push(n);
            }
        }
    }
    let is_sharp = |normals: &[[f64; 3]]| match normals {
        [a, b] => (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).abs() < SHARP_COSINE,
        _ => true,
    };
    edges.into_iter().filter(|(_, (_, normals))| is_sharp(normals)).map(|(key, (ends, _))| (key, ends)).collect()
}

fn draw_triad(svg: &mut Svg, camera: &Camera, at: [f64; 2]) {
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let mut direction = [0.0; 3];
        direction[axis] = 1.0;
        let [right, up, _] = camera.turned(direction);
        let end = [at[0] + 24.0 * right, at[1] - 24.0 * up];
        svg.line(at, end, AXIS, 1.2, "");
        svg.text([at[0] + 33.0 * right, at[1] - 33.0 * up + 0.35 * SMALL], name, &TextStyle::note().middle());
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::test_xml::assert_well_formed;
    use super::*;

    /// A sheared block with a value that grows along x.
    pub(in super::super) fn sample() -> DeformedShape {
        let half = [12.7, 3.2, 9.55];
        let n = 14;
        let mut quads = Vec::new();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                for i in 0..n {
                    for j in 0..n {
                        let corner = |a: usize, b: usize| {
                            let mut p = [0.0; 3];
                            p[axis] = side * half[axis];
                            p[(axis + 1) % 3] = half[(axis + 1) % 3] * (2.0 * a as f64 / n as f64 - 1.0);
                            p[(axis + 2) % 3] = half[(axis + 2) % 3] * (2.0 * b as f64 / n as f64 - 1.0);
                            p
                        };
                        let reference = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                        let current = reference.map(|[x, y, z]| {
                            let bulge = 1.0 - (y / half[1]).powi(2);
                            [x + 5.0 * (y + half[1]) / 6.4, y, z * (1.0 - 0.06 * bulge * (x / half[0]).powi(2))]
                        });
                        let value = 1.2 + 0.02 * (reference[0][0] + reference[0][2]);
                        quads.push(ShapeQuad { reference, current, value });
                    }
                }
            }
        }
        DeformedShape {
            title: "Deformed at a drive of 5 mm".into(),
            value_label: "stretch amplitude λ".into(),
            quads,
            ..DeformedShape::default()
        }
    }

    #[test]
    fn a_block_has_twelve_sharp_edges() {
        let shape = sample();
        let edges = sharp_edges(&shape.quads.iter().collect::<Vec<_>>());
        assert_eq!(edges.len(), 12 * 14);
    }

    #[test]
    fn the_nearest_facet_is_drawn_last() {
        let camera = Camera { scale: 1.0, offset: [0.0; 2] };
        // Towards the viewer is up, to the front (z) and, for this turn, to the right.
        assert!(camera.depth([0.0, 0.0, 1.0]) > 0.0 && camera.depth([0.0, 1.0, 0.0]) > 0.0);
        let turned = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| camera.turned(e));
        // The view is a rotation: right-handed, so nothing is mirrored.
        let [a, b, c] = turned;
        let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        assert!((0..3).all(|i| (cross[i] - c[i]).abs() < 1e-14));
    }

    #[test]
    fn shapes_are_drawn_the_same_every_time() {
        let svg = sample().to_svg();
        assert_well_formed(&svg);
        assert_eq!(svg, sample().to_svg());
    }

    #[test]
    fn poor_data_are_left_out() {
        assert!(DeformedShape::default().to_svg().contains("no surface"));
        let mut shape = sample();
        shape.quads.iter_mut().for_each(|q| q.value = f64::NAN);
        shape.quads[0].current[0][0] = f64::NAN;
        assert_well_formed(&shape.to_svg());
        shape.quads = vec![ShapeQuad::default()];
        assert_well_formed(&shape.to_svg());
    }
}
