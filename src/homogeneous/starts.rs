//! Where fits start: at given exponents the stress is linear in c, so a grid of exponents is searched by linear fits.

use super::curve::Curve;
use super::curve_law::OgdenTerms;
use super::deformation::incompressible_derivative;
use super::fit_options::CurveFitOptions;
use crate::material::{InvariantLaw, LawKind, LawParameter, ShearTerm, first_invariant_less_3};
use nalgebra::{DMatrix, DVector};

/// Distance of the grid's exponents.
const GRID_STEP: f64 = 1.0;
/// A start's vanishing term is raised to this part of the largest one at its own scale.
const SMALL_PART: f64 = 1e-3;
/// The end of a law lies at this multiple of the largest Ī₁ − 3 of the data at least.
const ROOM: f64 = 1.2;

/// The most promising starts with `num_terms` terms, best first; no two are neighbours on the grid.
pub(super) fn starts(curves: &[Curve], num_terms: usize, options: &CurveFitOptions) -> Vec<OgdenTerms> {
    let [low, high] = options.alpha_range;
    let count = ((high - low) / GRID_STEP).floor() as usize;
    let mut grid: Vec<f64> = (0..=count).map(|i| high - GRID_STEP * i as f64).collect();
    if options.neo_hookean && !grid.iter().any(|a| (a - 2.0).abs() < 1e-9) {
        grid.push(2.0);
        grid.sort_by(|a, b| b.total_cmp(a));
    }
    let columns = Columns::new(curves, &grid);
    let mut found: Vec<(f64, Vec<usize>, Vec<f64>)> = Vec::new();
    let mut chosen = Vec::new();
    combinations(&grid, num_terms, options, &mut chosen, &mut |set| {
        // All c positive; and, from three terms on, free signs as well.
        if let Some((cost, c)) = columns.fit(set, true) {
            found.push((cost, set.to_vec(), c));
        }
        if num_terms >= 3
            && let Some((cost, c)) = columns.fit(set, false)
            && c.iter().any(|v| *v < 0.0)
            && c.iter().sum::<f64>() > 0.0
        {
            found.push((cost, set.to_vec(), c));
        }
    });
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out: Vec<OgdenTerms> = Vec::new();
    // Half of the places for each kind of sign.
    for is_positive in [true, false] {
        let mut kept: Vec<&Vec<usize>> = Vec::new();
        for (_, set, c) in found.iter().filter(|f| f.2.iter().all(|v| *v > 0.0) == is_positive) {
            if kept.len() == options.num_starts {
                break;
            }
            let is_neighbour = |other: &&&Vec<usize>| other.iter().zip(set).all(|(a, b)| a.abs_diff(*b) <= 1);
            if kept.iter().find(is_neighbour).is_some() {
                continue;
            }
            kept.push(set);
            let terms: Vec<ShearTerm> =
                set.iter().zip(c).map(|(&i, &c)| ShearTerm { modulus_kpa: c, alpha: grid[i] }).collect();
            let held = if options.neo_hookean { terms.iter().position(|t| (t.alpha - 2.0).abs() < 1e-9) } else { None };
            out.push(OgdenTerms { terms, held });
        }
    }
    // c·D/α is singular in μ = c/α at α = 0 for the compressible form: step off it.
    for start in &mut out {
        for (i, term) in start.terms.iter_mut().enumerate() {
            if term.alpha.abs() < 0.1 && start.held != Some(i) {
                term.alpha = 0.1;
            }
        }
    }
    out
}

/// Starts of a law in the first invariant: its own, with the shear modulus of the neo-Hookean material nearest to the
/// curves, and with room for every state where the law has an end.
pub(super) fn law_starts(curves: &[Curve], kind: LawKind) -> Vec<InvariantLaw> {
    // Where no positive modulus comes near, the scale of the stresses is as good a start as any.
    let scale = curves.iter().map(Curve::scale_kpa).fold(0.0, f64::max);
    let shear_kpa = Columns::new(curves, &[2.0]).fit(&[0], true).map_or(scale, |(_, c)| 0.5 * c[0]);
    let states = curves.iter().flat_map(|c| &c.states);
    let largest = states.map(|s| first_invariant_less_3(s.log_stretches())).fold(0.0, f64::max);
    let with_room = |mut law: InvariantLaw| {
        if law.largest_x() < ROOM * largest {
            law.set(LawParameter::Limit, ROOM * largest);
        }
        law
    };
    kind.starts(shear_kpa).into_iter().map(with_room).collect()
}

/// Calls `visit` with every set of grid indices whose exponents keep their distance (and hold 2 where asked).
fn combinations(
    grid: &[f64],
    num_terms: usize,
    options: &CurveFitOptions,
    chosen: &mut Vec<usize>,
    visit: &mut dyn FnMut(&[usize]),
) {
    if chosen.len() == num_terms {
        let has_two = chosen.iter().any(|&i| (grid[i] - 2.0).abs() < 1e-9);
        if has_two || !options.neo_hookean {
            visit(chosen);
        }
        return;
    }
    let first = chosen.last().map_or(0, |i| i + 1);
    for i in first..grid.len() {
        // Room of a tenth: an exponent near zero is moved by that much.
        let keeps_distance = chosen.last().is_none_or(|&l| grid[l] - grid[i] >= options.min_alpha_gap + 0.11);
        if keeps_distance {
            chosen.push(i);
            combinations(grid, num_terms, options, chosen, visit);
            chosen.pop();
        }
    }
}

/// Weighted columns of the linear problem, as Gram matrix with unit diagonal.
struct Columns {
    gram: DMatrix<f64>,
    right: DVector<f64>,
    norm: Vec<f64>,
    data: f64,
}

impl Columns {
    fn new(curves: &[Curve], grid: &[f64]) -> Columns {
        let num_data = curves.iter().map(|c| c.states.len()).sum();
        let mut matrix = DMatrix::zeros(num_data, grid.len());
        let mut data = DVector::zeros(num_data);
        let mut row = 0;
        for curve in curves {
            let weight = 1.0 / curve.weight_kpa();
            for (state, &stress) in curve.states.iter().zip(&curve.nominal_stress_kpa) {
                for (j, &alpha) in grid.iter().enumerate() {
                    let term = ShearTerm { modulus_kpa: 1.0, alpha };
                    matrix[(row, j)] = weight * incompressible_derivative(&term, state)[0];
                }
                data[row] = weight * stress;
                row += 1;
            }
        }
        let norm: Vec<f64> = (0..grid.len()).map(|j| matrix.column(j).norm().max(1e-300)).collect();
        for (j, n) in norm.iter().enumerate() {
            matrix.column_mut(j).scale_mut(1.0 / n);
        }
        Columns {
            gram: matrix.transpose() * &matrix,
            right: matrix.transpose() * &data,
            norm,
            data: data.norm_squared(),
        }
    }

    /// Σ squares and c of the linear fit; with `is_positive` the columns that would be negative are left out and then
    /// given a small part.
    fn fit(&self, set: &[usize], is_positive: bool) -> Option<(f64, Vec<f64>)> {
        let mut used: Vec<usize> = (0..set.len()).collect();
        let solution = loop {
            let m = used.len();
            let gram = DMatrix::from_fn(m, m, |a, b| {
                // A ridge keeps nearly parallel columns from cancelling each other.
                self.gram[(set[used[a]], set[used[b]])] + if a == b { 1e-12 } else { 0.0 }
            });
            let right = DVector::from_fn(m, |a, _| self.right[set[used[a]]]);
            let solution = gram.cholesky()?.solve(&right);
            if !is_positive || solution.iter().all(|v| *v > 0.0) {
                break solution;
            }
            let worst = (0..m).min_by(|&a, &b| solution[a].total_cmp(&solution[b]))?;
            used.remove(worst);
            if used.is_empty() {
                return None;
            }
        };
        let gain: f64 = used.iter().enumerate().map(|(a, &u)| solution[a] * self.right[set[u]]).sum();
        let largest = solution.amax();
        let mut c: Vec<f64> = set.iter().map(|&i| SMALL_PART * largest / self.norm[i]).collect();
        for (a, &u) in used.iter().enumerate() {
            c[u] = solution[a] / self.norm[set[u]];
        }
        Some((self.data - gain, c))
    }
}
