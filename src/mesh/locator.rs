//! Which element holds a point, and where in it.

use super::element::{lagrange, section_shape};
use super::{ElementKind, Mesh};
use crate::specimen::Taper;

/// Newton on the inverse map stops when the reference coordinates move less than this.
const TOLERANCE: f64 = 1e-12;
/// Points this far outside an element, in reference coordinates, still belong to it: neighbours overlap so that no
/// point falls between them.
const MARGIN: f64 = 1e-8;
/// Newton iterations; 3–5 are usual, more means the point is far outside the element.
const MAX_ITERATIONS: usize = 12;

/// A point inside an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Location {
    /// Element index.
    pub element: u32,
    /// (ξ, η, ζ) as in [`ElementKind`].
    pub reference_coordinates: [f64; 3],
}

/// A line along the extrusion: a cell of the section and the place in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Index of the cell: the element's index in its layer.
    pub cell: u32,
    /// (ξ, η) as in [`ElementKind`].
    pub section_coordinates: [f64; 2],
}

/// Shape functions of a cell of the section in a column. Those of an element are their products with those along the
/// extrusion ([`LevelShape`]): node s + n k, of n nodes of a section, has function s of the column and k of the level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnShape {
    /// Index of the cell.
    pub cell: u32,
    /// Values; past the cell's nodes zero, like the slopes.
    pub values: [f64; 9],
    /// Derivatives along x, mm⁻¹.
    pub along_x: [f64; 9],
    /// Derivatives along the other axis of the section, mm⁻¹.
    pub across: [f64; 9],
}

/// Shape functions of a layer at a position along the extrusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelShape {
    /// Index of the layer.
    pub layer: usize,
    /// Values.
    pub values: [f64; 3],
    /// Derivatives along the extrusion, mm⁻¹.
    pub slopes: [f64; 3],
}

/// Finds points in an extruded mesh, of a wedge in flattened coordinates. The section's cells are sorted into uniform
/// bins by their bounding boxes; the inverse map is Newton's method in the section and a quadratic equation along the
/// extrusion.
#[derive(Clone, Debug)]
pub struct Locator {
    /// 1 (y) or 2 (z).
    extrusion_axis: usize,
    b_axis: usize,
    /// How the mesh's layers rise along x; in flattened coordinates they are plane.
    taper: Taper,
    num_cells: usize,
    /// Lower bound, bin size and number of bins in (a, b).
    low: [f64; 2],
    bin_size: [f64; 2],
    num_bins: [usize; 2],
    /// Start of each bin in `entries`.
    starts: Vec<u32>,
    entries: Vec<u32>,
    /// Bounding box of each cell, with margin: low and high.
    boxes: Vec<[[f64; 2]; 2]>,
    /// Positions of the nodes of each cell.
    cells: Vec<[[f64; 2]; 9]>,
    /// Lower, middle and upper position of each layer, in ζ's order.
    layers: Vec<[f64; 3]>,
}

impl Locator {
    /// Prepares `mesh`, which must come from [`super::mesh_specimen`] or [`super::morphed`]: elements ordered layer by
    /// layer, every layer the same section.
    pub fn new(mesh: &Mesh) -> Self {
        let kind = mesh.element_kind;
        let per_level = kind.num_nodes() / 3;
        let extrusion_axis = extrusion_axis(mesh);
        let b_axis = 3 - extrusion_axis;
        let position = |element: usize, n: usize| mesh.taper.flattened(mesh.nodes[mesh.element(element)[n] as usize]);
        let total = mesh.num_elements();
        let layer_of = |e: usize| [0, 1, 2].map(|k| position(e, k * per_level)[extrusion_axis]);
        // Elements of the first layer share its levels.
        let first = if total > 0 { layer_of(0) } else { [0.0; 3] };
        let thickness = (first[2] - first[0]).abs();
        let num_cells = (0..total).take_while(|&e| (layer_of(e)[0] - first[0]).abs() < 1e-6 * thickness).count().max(1);
        let layers = (0..total).step_by(num_cells).map(layer_of).collect();
        let mut cells = Vec::with_capacity(num_cells);
        let mut boxes = Vec::with_capacity(num_cells);
        for cell in 0..num_cells.min(total) {
            let mut points = [[0.0; 2]; 9];
            for (n, point) in points.iter_mut().enumerate().take(per_level) {
                let p = position(cell, n);
                *point = [p[0], p[b_axis]];
            }
            let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
            for p in &points[..per_level] {
                for c in 0..2 {
                    (low[c], high[c]) = (low[c].min(p[c]), high[c].max(p[c]));
                }
            }
            // A quadratic curve can leave the box of its nodes by an eighth of its extent at most.
            for c in 0..2 {
                let margin = 0.13 * (high[c] - low[c]);
                (low[c], high[c]) = (low[c] - margin, high[c] + margin);
            }
            boxes.push([low, high]);
            cells.push(points);
        }
        let mut locator = Locator {
            extrusion_axis,
            b_axis,
            taper: mesh.taper,
            num_cells,
            low: [0.0; 2],
            bin_size: [1.0; 2],
            num_bins: [1; 2],
            starts: Vec::new(),
            entries: Vec::new(),
            boxes,
            cells,
            layers,
        };
        locator.fill_bins();
        locator
    }

    fn fill_bins(&mut self) {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for [l, h] in &self.boxes {
            for c in 0..2 {
                (low[c], high[c]) = (low[c].min(l[c]), high[c].max(h[c]));
            }
        }
        if self.boxes.is_empty() {
            (low, high) = ([0.0; 2], [1.0; 2]);
        }
        // About four bins per cell.
        let extent = [high[0] - low[0], high[1] - low[1]];
        let size = (extent[0] * extent[1] / (4.0 * self.boxes.len().max(1) as f64)).sqrt();
        self.low = low;
        self.num_bins = extent.map(|e| ((e / size).ceil() as usize).clamp(1, 4096));
        self.bin_size = [extent[0] / self.num_bins[0] as f64, extent[1] / self.num_bins[1] as f64];
        let mut bins = vec![Vec::new(); self.num_bins[0] * self.num_bins[1]];
        for (cell, [l, h]) in self.boxes.iter().enumerate() {
            let ([i0, j0], [i1, j1]) = (self.bin(*l), self.bin(*h));
            for j in j0..=j1 {
                for i in i0..=i1 {
                    bins[i + self.num_bins[0] * j].push(cell as u32);
                }
            }
        }
        self.starts.push(0);
        for bin in bins {
            self.entries.extend(bin);
            self.starts.push(self.entries.len() as u32);
        }
    }

    /// Bin of a point, clamped to the grid.
    fn bin(&self, p: [f64; 2]) -> [usize; 2] {
        // `as` saturates: negative and NaN go to bin 0.
        [0, 1].map(|c| (((p[c] - self.low[c]) / self.bin_size[c]) as usize).min(self.num_bins[c] - 1))
    }

    /// The element that holds `point` (mm, reference frame), or `None` outside the mesh. Points on a shared face belong
    /// to one of its elements, always the same. Points of the mirrored half must be reflected by the caller.
    pub fn locate(&self, mesh: &Mesh, point: [f64; 3]) -> Option<Location> {
        let point = self.taper.flattened(point);
        let (layer, zeta) = self.layer(point[self.extrusion_axis])?;
        let column = self.locate_column(mesh, [point[0], point[self.b_axis]])?;
        Some(self.at(column, layer, zeta))
    }

    /// Where a line along the extrusion meets the section: the part of [`Self::locate`] that takes nearly all its time,
    /// for callers with many points on one line. `section_point` is (x, z) or (x, y), mm; see [`Self::extrusion_axis`].
    pub fn locate_column(&self, mesh: &Mesh, section_point: [f64; 2]) -> Option<Column> {
        let [i, j] = self.bin(section_point);
        let bin = i + self.num_bins[0] * j;
        self.entries[self.starts[bin] as usize..self.starts[bin + 1] as usize].iter().find_map(|&cell| {
            let [low, high] = self.boxes[cell as usize];
            let is_near = (0..2).all(|c| section_point[c] >= low[c] && section_point[c] <= high[c]);
            if !is_near {
                return None;
            }
            let section_coordinates = invert(mesh.element_kind, &self.cells[cell as usize], section_point)?;
            Some(Column { cell, section_coordinates })
        })
    }

    /// The point of a column at `position` (mm) along the extrusion, of a wedge in flattened coordinates.
    pub fn locate_in_column(&self, column: Column, position: f64) -> Option<Location> {
        let (layer, zeta) = self.layer(position)?;
        Some(self.at(column, layer, zeta))
    }

    /// The shape functions of a column; `None` where its cell is flat there.
    pub fn column_shape(&self, mesh: &Mesh, column: Column) -> Option<ColumnShape> {
        let points = &self.cells[column.cell as usize];
        let (values, slopes) = section_shape(mesh.element_kind, column.section_coordinates);
        // ∂(x, b)/∂(ξ, η).
        let mut j = [[0.0; 2]; 2];
        for (point, slope) in points.iter().zip(&slopes) {
            for c in 0..2 {
                j[c][0] += point[c] * slope[0];
                j[c][1] += point[c] * slope[1];
            }
        }
        let det = j[0][0] * j[1][1] - j[0][1] * j[1][0];
        let of_det = 1.0 / det;
        let along_x = slopes.map(|s| (s[0] * j[1][1] - s[1] * j[1][0]) * of_det);
        let across = slopes.map(|s| (s[1] * j[0][0] - s[0] * j[0][1]) * of_det);
        of_det.is_finite().then_some(ColumnShape { cell: column.cell, values, along_x, across })
    }

    /// The shape functions along the extrusion at a position (mm); `None` outside the mesh or where it is flat.
    /// Position and slopes are in the flattened coordinates of a wedge ([`Self::taper`]).
    pub fn level_shape(&self, position: f64) -> Option<LevelShape> {
        let (layer, zeta) = self.layer(position)?;
        let [start, middle, end] = self.layers[layer];
        let (values, slopes) = lagrange(zeta);
        let of_slope = 1.0 / (0.5 * (end - start) + (start + end - 2.0 * middle) * zeta);
        of_slope.is_finite().then_some(LevelShape { layer, values, slopes: slopes.map(|s| s * of_slope) })
    }

    /// The element of a cell in a layer.
    pub fn element(&self, cell: u32, layer: usize) -> u32 {
        (layer * self.num_cells) as u32 + cell
    }

    /// How the layers rise along x: columns and levels are those of the mesh in flattened coordinates.
    pub fn taper(&self) -> Taper {
        self.taper
    }

    /// Coordinate index of the extrusion: 1 (y) or 2 (z).
    pub fn extrusion_axis(&self) -> usize {
        self.extrusion_axis
    }

    fn at(&self, column: Column, layer: usize, zeta: f64) -> Location {
        let [xi, eta] = column.section_coordinates;
        Location { element: self.element(column.cell, layer), reference_coordinates: [xi, eta, zeta] }
    }

    fn layer(&self, position: f64) -> Option<(usize, f64)> {
        self.layers.iter().enumerate().find_map(|(layer, &[start, middle, end])| {
            // Middle nodes stay midway under affine scaling; one Newton step from the linear map corrects the rest.
            let mut zeta = (2.0 * position - start - end) / (end - start);
            let bend = start + end - 2.0 * middle;
            for _ in 0..2 {
                let value = middle + 0.5 * (end - start) * zeta + 0.5 * bend * zeta * zeta;
                zeta -= (value - position) / (0.5 * (end - start) + bend * zeta);
            }
            (zeta.abs() <= 1.0 + MARGIN).then_some((layer, zeta.clamp(-1.0, 1.0)))
        })
    }
}

/// The coordinate along which the first element's nodes of one level do not vary.
pub(super) fn extrusion_axis(mesh: &Mesh) -> usize {
    if mesh.num_elements() == 0 {
        return 1;
    }
    let nodes = mesh.element(0);
    let (p, q) = (mesh.nodes[nodes[0] as usize], mesh.nodes[nodes[2 * (nodes.len() / 3)] as usize]);
    if (q[1] - p[1]).abs() > (q[2] - p[2]).abs() { 1 } else { 2 }
}

/// Reference coordinates of `p` in a cell, clamped to it, if it lies inside within the margin.
fn invert(kind: ElementKind, points: &[[f64; 2]; 9], p: [f64; 2]) -> Option<[f64; 2]> {
    let count = kind.num_nodes() / 3;
    let mut xi = match kind {
        ElementKind::Hex27 => [0.0, 0.0],
        ElementKind::Prism21 => [1.0 / 3.0, 1.0 / 3.0],
    };
    for _ in 0..MAX_ITERATIONS {
        let (n, g) = section_shape(kind, xi);
        let mut r = [-p[0], -p[1]];
        let mut j = [[0.0; 2]; 2];
        for a in 0..count {
            for c in 0..2 {
                r[c] += n[a] * points[a][c];
                j[c][0] += points[a][c] * g[a][0];
                j[c][1] += points[a][c] * g[a][1];
            }
        }
        let det = j[0][0] * j[1][1] - j[0][1] * j[1][0];
        let step = [(j[1][1] * r[0] - j[0][1] * r[1]) / det, (j[0][0] * r[1] - j[1][0] * r[0]) / det];
        // Far outside, the quadratic map folds: keep the iterate near the cell.
        xi = [0, 1].map(|c| (xi[c] - step[c]).clamp(-2.0, 2.0));
        if step[0].abs().max(step[1].abs()) < TOLERANCE {
            return clamp_inside(kind, xi);
        }
        if !step[0].is_finite() || !step[1].is_finite() {
            return None;
        }
    }
    None
}

fn clamp_inside(kind: ElementKind, [xi, eta]: [f64; 2]) -> Option<[f64; 2]> {
    match kind {
        ElementKind::Hex27 => (xi.abs().max(eta.abs()) <= 1.0 + MARGIN).then(|| [xi, eta].map(|x| x.clamp(-1.0, 1.0))),
        ElementKind::Prism21 => {
            let inside = xi >= -MARGIN && eta >= -MARGIN && xi + eta <= 1.0 + MARGIN;
            inside.then(|| {
                let (x, y) = (xi.max(0.0), eta.max(0.0));
                let excess = (x + y).max(1.0);
                [x / excess, y / excess]
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_specimens::{Random, bar, dumbbell, two_holes, width_holes};
    use crate::mesh::{MeshOptions, mesh_specimen};

    /// Points made from reference coordinates are found again, in the same element or on its boundary.
    #[test]
    fn finds_points_again() {
        let mut random = Random::new(7);
        for (specimen, force_prisms) in
            [(two_holes(), false), (two_holes(), true), (bar(), false), (width_holes(), false), (dumbbell(), false)]
        {
            let options = MeshOptions { force_prisms, ..MeshOptions::search(&specimen) };
            let mesh = mesh_specimen(&specimen, &options).unwrap();
            let locator = Locator::new(&mesh);
            for element in 0..mesh.num_elements() {
                for _ in 0..8 {
                    let mut xi = [0; 3].map(|_| random.between(-1.0, 1.0));
                    if mesh.element_kind == ElementKind::Prism21 {
                        (xi[0], xi[1]) = (0.5 * (xi[0] + 1.0), 0.5 * (xi[1] + 1.0));
                        if xi[0] + xi[1] > 1.0 {
                            (xi[0], xi[1]) = (1.0 - xi[0], 1.0 - xi[1]);
                        }
                    }
                    let point = position(&mesh, element, xi);
                    let found = locator.locate(&mesh, point).unwrap();
                    let back = position(&mesh, found.element as usize, found.reference_coordinates);
                    // Newton stops at 1e-12 of elements of a few mm.
                    assert!(back.iter().zip(point).all(|(b, p)| (b - p).abs() < 1e-10));
                    let axis = locator.extrusion_axis();
                    let column = locator.locate_column(&mesh, [point[0], point[3 - axis]]).unwrap();
                    assert_eq!(locator.locate_in_column(column, point[axis]), Some(found));
                    let column = locator.column_shape(&mesh, column).unwrap();
                    check_shapes(&mesh, found, &column, &locator.level_shape(point[axis]).unwrap(), axis);
                    let inside = xi.iter().all(|x| x.abs() < 0.999) && mesh.element_kind == ElementKind::Hex27;
                    assert!(!inside || found.element as usize == element);
                }
            }
            // Nodes lie on boundaries of elements and must be found too; points in the holes and outside must not.
            assert!(mesh.nodes.iter().all(|&p| locator.locate(&mesh, p).is_some()));
            for hole in &specimen.holes {
                let other = if specimen.holes[0].axis == crate::specimen::HoleAxis::Width { 1 } else { 2 };
                let mut p = [hole.center_mm[0], 0.0, 0.0];
                p[other] = hole.center_mm[1];
                assert!(locator.locate(&mesh, p).is_none());
            }
            let block = specimen.block;
            assert!(locator.locate(&mesh, [0.51 * block.length_mm, 0.0, 0.0]).is_none());
            assert!(locator.locate(&mesh, [0.3 * block.length_mm, 0.51 * block.thickness_mm, 0.1]).is_none());
            assert!(locator.locate(&mesh, [f64::NAN, 0.0, 0.0]).is_none());
            assert!(locator.locate(&mesh, [0.0, f64::NAN, 0.0]).is_none());
        }
    }

    /// The products of the shape functions of a column and a level are those of the element, and give the positions of
    /// the nodes the gradient that positions have: the identity.
    fn check_shapes(mesh: &Mesh, found: Location, column: &ColumnShape, level: &LevelShape, axis: usize) {
        let n = mesh.element_kind.shape_functions(found.reference_coordinates);
        let per_level = mesh.element_kind.num_nodes() / 3;
        let mut gradient = [[0.0; 3]; 3];
        for (a, &node) in mesh.element(found.element as usize).iter().enumerate() {
            let (s, k) = (a % per_level, a / per_level);
            // Sums of a few products of numbers of the order of 1.
            assert!((column.values[s] * level.values[k] - n[a]).abs() < 1e-14);
            let mut slope = [column.along_x[s] * level.values[k]; 3];
            slope[3 - axis] = column.across[s] * level.values[k];
            slope[axis] = column.values[s] * level.slopes[k];
            for i in 0..3 {
                for j in 0..3 {
                    gradient[i][j] += mesh.nodes[node as usize][i] * slope[j];
                }
            }
        }
        for i in 0..3 {
            for j in 0..3 {
                // Positions of 10 mm in elements of a tenth of that, and rounding.
                assert!((gradient[i][j] - f64::from(i == j)).abs() < 1e-12, "{gradient:?}");
            }
        }
    }

    fn position(mesh: &Mesh, element: usize, xi: [f64; 3]) -> [f64; 3] {
        let n = mesh.element_kind.shape_functions(xi);
        let mut p = [0.0; 3];
        for (&node, weight) in mesh.element(element).iter().zip(n) {
            for (sum, x) in p.iter_mut().zip(mesh.nodes[node as usize]) {
                *sum += weight * x;
            }
        }
        p
    }
}
