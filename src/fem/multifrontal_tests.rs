use super::super::crew::Crew;
use super::super::fronts::Fronts;
use super::super::substitution::FactorByFronts;
use super::*;
use faer::Side;
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};

/// The lower triangle of a matrix, column by column.
struct Matrix {
    pointers: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
}

/// Nodes of a box in the order of nested dissection: halves first, then the plane between them.
fn dissected(from: [usize; 3], to: [usize; 3], order: &mut Vec<[usize; 3]>) {
    let size = [0, 1, 2].map(|i| to[i] - from[i]);
    let axis = (0..3).max_by_key(|&i| size[i]).unwrap();
    if size[axis] < 3 {
        for x in from[0]..to[0] {
            for y in from[1]..to[1] {
                order.extend((from[2]..to[2]).map(|z| [x, y, z]));
            }
        }
        return;
    }
    let middle = from[axis] + size[axis] / 2;
    let with = |mut corner: [usize; 3], at: usize| {
        corner[axis] = at;
        corner
    };
    dissected(from, with(to, middle), order);
    dissected(with(from, middle + 1), to, order);
    dissected(with(from, middle), with(to, middle + 1), order);
}

/// A Laplacian of 27 points on a grid with a mass, in an order of nested dissection.
fn grid(size: [usize; 3], mass: f64) -> Matrix {
    let mut order = Vec::new();
    dissected([0; 3], size, &mut order);
    let place_of: std::collections::HashMap<[usize; 3], usize> =
        order.iter().enumerate().map(|(k, &at)| (at, k)).collect();
    let mut matrix = Matrix { pointers: vec![0], rows: Vec::new(), values: Vec::new() };
    for (k, at) in order.iter().enumerate() {
        let mut column = vec![(k, mass)];
        for step in 0..27usize {
            let [a, b, c] = [step % 3, step / 3 % 3, step / 9];
            let near = [at[0] + a, at[1] + b, at[2] + c].map(|i| i.wrapping_sub(1));
            if let Some(&other) = place_of.get(&near).filter(|other| **other != k) {
                column[0].1 += 1.0;
                if other > k {
                    column.push((other, -1.0));
                }
            }
        }
        column.sort_unstable_by_key(|entry| entry.0);
        matrix.rows.extend(column.iter().map(|entry| entry.0));
        matrix.values.extend(column.iter().map(|entry| entry.1));
        matrix.pointers.push(matrix.rows.len());
    }
    matrix
}

fn analysed(matrix: &Matrix) -> SymbolicCholesky<usize> {
    let n = matrix.pointers.len() - 1;
    let (mut pointers, mut rows) = (vec![0], Vec::new());
    for i in 0..n {
        // The transpose, slowly.
        rows.extend((0..=i).filter(|&j| matrix.rows[matrix.pointers[j]..matrix.pointers[j + 1]].contains(&i)));
        pointers.push(rows.len());
    }
    let upper = SymbolicSparseColMatRef::new_checked(n, n, &pointers, None, &rows);
    let parameters = CholeskySymbolicParams {
        supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
        ..Default::default()
    };
    factorize_symbolic_cholesky(upper, Side::Upper, SymmetricOrdering::Identity, parameters).unwrap()
}

fn supernodes(symbolic: &SymbolicCholesky<usize>) -> &SymbolicSupernodalCholesky<usize> {
    match symbolic.raw() {
        SymbolicCholeskyRaw::Supernodal(supernodal) => supernodal,
        SymbolicCholeskyRaw::Simplicial(_) => panic!("supernodes were asked for"),
    }
}

fn times(matrix: &Matrix, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    for j in 0..x.len() {
        for p in matrix.pointers[j]..matrix.pointers[j + 1] {
            let (i, value) = (matrix.rows[p], matrix.values[p]);
            y[i] += value * x[j];
            if i != j {
                y[j] += value * x[i];
            }
        }
    }
    y
}

/// The factor and the solutions of three right-hand sides.
fn solved(matrix: &Matrix, symbolic: &SymbolicCholesky<usize>, crew: &Crew) -> (Vec<f64>, Vec<f64>) {
    let (supernodal, n) = (supernodes(symbolic), matrix.pointers.len() - 1);
    let fronts = Fronts::new(supernodal);
    let lower = Lower { pointers: &matrix.pointers, rows: &matrix.rows, values: &matrix.values };
    let mut values = vec![0.0; supernodal.len_val()];
    let mut arenas = Arenas::default();
    // Twice: the second finds the memory as the first left it.
    for _ in 0..2 {
        factorise(&fronts, supernodal, &lower, &mut values, &mut arenas, crew).unwrap();
    }
    let mut x: Vec<f64> = (0..3 * n).map(|i| (i as f64).sin()).collect();
    FactorByFronts { fronts: &fronts, symbolic: supernodal, values: &values }.solve(&mut x, crew);
    (values, x)
}

/// A x is the right-hand side to rounding (condition number about 50, sums of 27 terms), on trees of one task and of
/// many with fronts that are shared, and what several threads find is what one finds to the last bit.
#[test]
fn a_factor_solves_its_matrix_on_any_number_of_threads() {
    for (size, is_divided) in [([1, 1, 1], false), ([5, 4, 3], false), ([13, 14, 15], true)] {
        let matrix = grid(size, 1.0);
        let symbolic = analysed(&matrix);
        let fronts = Fronts::new(supernodes(&symbolic));
        assert_eq!(!fronts.top.is_empty(), is_divided, "{size:?}: {:.1e} operations", fronts.work);
        let (alone, x) = solved(&matrix, &symbolic, &Crew::of(1));
        let n = matrix.pointers.len() - 1;
        for (column, x) in x.chunks_exact(n).enumerate() {
            for (i, b) in times(&matrix, x).iter().enumerate() {
                assert!((b - ((column * n + i) as f64).sin()).abs() < 1e-12, "{size:?}: {i}");
            }
        }
        for threads in [2, 3] {
            let (values, found) = solved(&matrix, &symbolic, &Crew::of(threads));
            assert!(values.iter().zip(&alone).all(|(a, b)| a.to_bits() == b.to_bits()), "{size:?}, {threads}");
            assert!(found.iter().zip(&x).all(|(a, b)| a.to_bits() == b.to_bits()), "{size:?}, {threads}");
        }
    }
}

/// Every front belongs to one task or to the top, and updates that are there at the same time do not overlap.
#[test]
fn the_tree_is_divided_without_rest() {
    let symbolic = analysed(&grid([13, 14, 15], 1.0));
    let fronts = Fronts::new(supernodes(&symbolic));
    let num = supernodes(&symbolic).n_supernodes();
    let mut count = vec![0; num];
    fronts.tasks.iter().flat_map(|t| t.fronts.clone()).for_each(|s| count[s] += 1);
    fronts.top.iter().for_each(|&s| count[s as usize] += 1);
    assert!(count.iter().all(|&c| c == 1));
    let tasks: f64 = fronts.tasks.iter().map(|t| t.work).sum();
    assert!(tasks < fronts.work && fronts.tasks.iter().all(|t| t.work <= fronts.work / 16.0));
    for s in 0..num {
        let here = fronts.place(s);
        for &child in fronts.children(s) {
            let place = fronts.place(child as usize);
            let end = place.offset + fronts.num_below(child as usize).pow(2);
            assert!(place.task != here.task || end <= here.made_at, "{s}: {place:?} {here:?}");
        }
    }
}

/// A pivot that is not positive is told with its column, whoever meets it.
#[test]
fn a_matrix_that_is_not_positive_definite_is_told() {
    let mut matrix = grid([13, 14, 15], 1.0);
    let symbolic = analysed(&matrix);
    let n = matrix.pointers.len() - 1;
    for column in [10, n - 10] {
        let diagonal = matrix.pointers[column];
        let kept = std::mem::replace(&mut matrix.values[diagonal], -1.0);
        let supernodal = supernodes(&symbolic);
        let lower = Lower { pointers: &matrix.pointers, rows: &matrix.rows, values: &matrix.values };
        let mut values = vec![0.0; supernodal.len_val()];
        for threads in [1, 2] {
            let fronts = Fronts::new(supernodal);
            let found = factorise(&fronts, supernodal, &lower, &mut values, &mut Arenas::default(), &Crew::of(threads));
            assert_eq!(found.unwrap_err().0, column);
        }
        matrix.values[diagonal] = kept;
    }
}
