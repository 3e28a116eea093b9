//! Sections of quadrilaterals: structured grids, and an O-grid in the power-diagram cell of each hole.

use super::cells::{Style, holed_section};
use super::domain::Domain;
use super::error::MeshError;
use super::grid::{Builder, count, layered, limit_cells, line};
use super::options::MeshOptions;
use super::power::Rectangle;
use super::section::Section;

/// The best section of quadrilaterals for `domain`, or `None` where quadrilaterals are no use.
///
/// With holes, several inner rectangles around them (what is outside becomes structured strips) and several ways to
/// make cells in them are ranked on a coarse section by shape and number of cells; the first that is good enough at the
/// size asked for is taken. So the layout of cells hardly depends on the size.
///
/// # Errors
/// [`MeshError::TooManyElements`].
pub(super) fn quad_section(domain: &Domain, options: &MeshOptions) -> Result<Option<Section>, MeshError> {
    if domain.holes.is_empty() {
        return structured_section(domain, options).map(Some);
    }
    if domain.profile.is_some() || domain.holes.iter().any(|hole| hole.notch.is_some()) {
        return Ok(None);
    }
    let area = domain.area();
    limit_cells((area / options.section_size_mm.powi(2)) as usize, options)?;
    let size = (area / RANKING_CELLS).sqrt().max(options.section_size_mm);
    let coarse = MeshOptions {
        section_size_mm: size,
        hole_segments: options.hole_segments.min(8),
        radial_layers: options.radial_layers.min(2),
        ..*options
    };
    let mut ranking: Vec<(f64, Rectangle, Style)> = Vec::new();
    for rectangle in inner_rectangles(domain, size) {
        for style in styles(domain, size) {
            let Some(section) = holed_section(domain, &coarse, rectangle, style)? else { continue };
            let (worst, _) = section.min_scaled_jacobian();
            let excess = (section.num_cells() as f64 * size * size / area).max(1.0).ln();
            ranking.push((worst.min(0.5) + section.mean_shape() - 0.2 * excess, rectangle, style));
            if worst < options.min_scaled_jacobian {
                // Only if nothing else is left: its size may still make it better.
                ranking.last_mut().into_iter().for_each(|r| r.0 -= 10.0);
            }
        }
    }
    // Stable: of equals the first stays first. Scores are rounded so that mirror images rank alike.
    ranking.sort_by_key(|r| -((r.0 * 1e6).round() as i64));
    for &(_, rectangle, style) in ranking.iter().take(MAX_ATTEMPTS) {
        if let Some(section) = holed_section(domain, options, rectangle, style)?
            && section.min_scaled_jacobian().0 >= options.min_scaled_jacobian
        {
            return Ok(Some(section));
        }
    }
    Ok(None)
}

/// About so many cells have the sections that layouts are ranked by.
const RANKING_CELLS: f64 = 60.0;
/// So many layouts are tried at the size asked for.
const MAX_ATTEMPTS: usize = 8;
/// Ways to make cells: edges shorter than this many element sizes are collapsed, and the lines to the cells' corners
/// bend by this fraction.
const STYLES: [(f64, f64); 4] = [(0.45, 0.0), (0.15, 0.0), (0.45, 0.7), (0.15, 0.7)];

/// Radii that stand for holes that are not circles: of their extent across, along, and the mean of both.
const WEIGHTS: [f64; 3] = [0.5, 0.0, 1.0];

/// The ways to make cells that are tried, on elements of a size.
fn styles(domain: &Domain, size: f64) -> Vec<Style> {
    let has_circles_only = domain.holes.iter().all(|hole| hole.wall.is_circle());
    let weights = if has_circles_only { &WEIGHTS[..1] } else { &WEIGHTS[..] };
    let of_weight = |&weight: &f64| {
        STYLES.map(|(shortest, bend)| Style { shortest_mm: shortest * size, bend, power_weight: weight })
    };
    weights.iter().flat_map(of_weight).collect()
}

/// How much shorter than in a dumb-bell whose ends are three times as wide as its gauge elements are made: at least
/// where the ends are hardly wider, and at most where they are far wider.
const LEAST_SHORTER: f64 = 0.75;
const MOST_SHORTER: f64 = 2.0;
/// An arc shorter than this many element sizes is one element long, where others are at least two: half of it would be
/// the edge of a sliver, and a quadratic edge follows an arc of at most 60° well.
const SHORT_ARC: f64 = 0.2;

/// Block or dumb-bell without holes.
fn structured_section(domain: &Domain, options: &MeshOptions) -> Result<Section, MeshError> {
    let [a, b] = domain.half;
    let grading = domain.grading;
    let along = if let Some(profile) = domain.profile {
        let [x0, x1, x2] = profile.knots_mm();
        // The narrow part's elements are narrow: they are made shorter. The factors are those of ends three times as
        // wide as the gauge.
        let shorter = (profile.widening() / 3.0).clamp(LEAST_SHORTER, MOST_SHORTER);
        let n = |length: f64, factor: f64| count(length * factor * shorter, options);
        let end = line(x2, a, count(a - x2, options)?, 1.0, grading.ends);
        let least = if x1 - x0 < SHORT_ARC * options.section_size_mm { 1 } else { 2 };
        let outer = line(x1, x2, n(x2 - x1, 1.2)?.max(least), 1.0, 1.0);
        let inner = line(x0, x1, n(x1 - x0, 1.4)?.max(least), 1.0, 1.0);
        let narrow = line(-x0, x0, 2 * n(x0, 1.4)?, 1.0, 1.0);
        let mut all: Vec<f64> = end.iter().rev().chain(outer.iter().rev().skip(1)).map(|x| -x).collect();
        all.extend(inner.iter().rev().skip(1).map(|x| -x));
        all.extend(&narrow[1..]);
        for part in [inner, outer, end] {
            all.extend(&part[1..]);
        }
        all
    } else {
        let a = domain.inner_half[0];
        let within = line(-a, a, count(2.0 * a, options)?.max(2), grading.ends, grading.ends);
        layered(within, domain.half[0], true)
    };
    let lower = if domain.bottom < 0.0 { grading.sides } else { 1.0 };
    let (inner_bottom, inner_b) = (domain.inner_bottom(), domain.inner_half[1]);
    let width = inner_b - inner_bottom;
    let across_count = if domain.profile.is_some() { count(width, options)?.max(2) } else { count(width, options)? };
    let within = line(inner_bottom, inner_b, across_count, lower, grading.sides);
    let mut across = layered(within, b, domain.bottom < 0.0);
    across.iter_mut().for_each(|p| *p /= b);
    limit_cells((along.len() / 2) * (across.len() / 2), options)?;
    let mut builder = Builder::new(domain);
    builder.grid(along.len(), across.len(), |i, j| [along[i], across[j] * domain.half_width(along[i])]);
    Ok(builder.finish())
}

/// Rectangles around all holes, the whole section first. The distance kept from a hole is a multiple of its radius
/// (of one that is no circle, of the radius of the circle of its area).
fn inner_rectangles(domain: &Domain, size: f64) -> Vec<Rectangle> {
    const RADII: [f64; 4] = [f64::INFINITY, 3.4, 2.5, 1.8];
    let outer = Rectangle { low: [-domain.inner_half[0], domain.inner_bottom()], high: domain.inner_half };
    let reach = |c: usize, sign: f64, k: f64| {
        domain.holes.iter().map(|d| sign * d.center()[c] + d.reach_of_radii(c, k)).fold(f64::NEG_INFINITY, f64::max)
    };
    let has_half = domain.holes.iter().any(|d| d.is_half);
    let side = |c: usize, upper: bool, k: f64| {
        let sign = if upper { 1.0 } else { -1.0 };
        let limit = if upper { outer.high[c] } else { -outer.low[c] };
        let position = reach(c, sign, k);
        // A strip thinner than half an element is not worth its own layer.
        let no_strip = limit - position < 0.5 * size || (c == 1 && !upper && has_half);
        sign * if no_strip { limit } else { position }
    };
    let mut rectangles: Vec<Rectangle> = Vec::new();
    for k1 in RADII {
        for k0 in RADII {
            let r = Rectangle {
                low: [side(0, false, k0), side(1, false, k1)],
                high: [side(0, true, k0), side(1, true, k1)],
            };
            let same = |q: &Rectangle| {
                (0..2).all(|c| (q.low[c] - r.low[c]).abs() + (q.high[c] - r.high[c]).abs() < 1e-9 * domain.scale())
            };
            if !rectangles.iter().any(same) {
                rectangles.push(r);
            }
        }
    }
    rectangles
}
