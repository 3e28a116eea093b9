//! Files read back.

use super::*;
use hdf5_pure::{DType, File};

/// A(i, j, k) = 100 i + 10 j + k with the first index fastest.
pub(in super::super) fn counted() -> Vec<f64> {
    let at = |n: usize| (100 * (n % 2) + 10 * (n / 2 % 3) + n / 6) as f64;
    (0..24).map(at).collect()
}

const AXES: [(&str, usize); 3] = [("x", 2), ("y", 3), ("drive", 4)];

pub(in super::super) fn example() -> Tree {
    let mut inner = Tree::default();
    inner.array("mask", "1", "where there is material", &[("x", 2), ("y", 2)], vec![true, false, true, true]);
    inner.array("element_nodes", "1", "nodes", &[("element", 2)], Values::Index(vec![0, 7]));
    let mut tree = Tree::default();
    tree.text("program", "lambdak µ");
    tree.names("parameters", vec!["mu_1".into(), "alpha_1".into()]);
    tree.array("displacement_mm", "mm", "displacement", &AXES, counted());
    tree.array("one", "N", "a number", &[], vec![3.5]);
    tree.array("one_drive", "N", "forces", &[("parameter", 2), ("x", 1), ("drive", 1)], vec![1.0, f64::NAN]);
    tree.tree("sample_1", inner);
    tree
}

#[test]
fn the_last_index_is_the_fastest_in_the_file() {
    let file = File::from_bytes(hdf5_file(&example()).unwrap()).unwrap();
    let array = file.dataset("displacement_mm").unwrap();
    assert_eq!(array.shape().unwrap(), [2, 3, 4]);
    let values = array.read_f64().unwrap();
    for (n, value) in values.iter().enumerate() {
        let (i, j, k) = (n / 12, n / 4 % 3, n % 4);
        assert_eq!(*value, (100 * i + 10 * j + k) as f64);
    }
    let attributes = array.attrs().unwrap();
    assert_eq!(attributes["unit"].as_str(), Some("mm"));
    assert_eq!(attributes["description"].as_str(), Some("displacement"));
    assert_eq!(attributes["axes"].as_strings().unwrap(), ["x", "y", "drive"]);
}

#[test]
fn everything_comes_back() {
    let file = File::from_bytes(hdf5_file(&example()).unwrap()).unwrap();
    assert_eq!(file.dataset("program").unwrap().read_string().unwrap(), ["lambdak µ"]);
    assert_eq!(file.dataset("parameters").unwrap().read_string().unwrap(), ["mu_1", "alpha_1"]);
    assert_eq!(file.dataset("one").unwrap().shape().unwrap(), [0u64; 0]);
    assert_eq!(file.dataset("one").unwrap().read_f64().unwrap(), [3.5]);
    let mask = file.dataset("sample_1/mask").unwrap();
    assert_eq!((mask.dtype().unwrap(), mask.read_u8().unwrap()), (DType::U8, vec![1, 1, 0, 1]));
    assert_eq!(file.dataset("sample_1/element_nodes").unwrap().read_u32().unwrap(), [0, 7]);
    let two = file.dataset("one_drive").unwrap().read_f64().unwrap();
    assert!(two[0] == 1.0 && two[1].is_nan());
}

#[test]
fn an_array_that_its_axes_do_not_fit_is_refused() {
    let mut tree = Tree::default();
    tree.array("force_n", "N", "forces", &[("drive", 3)], vec![1.0, 2.0]);
    let error = hdf5_file(&tree).unwrap_err();
    assert!(matches!(error, ArraysError::Length { found: 2, expected: 3, .. }), "{error}");
}
