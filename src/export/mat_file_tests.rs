//! Files read back, as any MAT-file is read.

use super::super::hdf5_file::tests::{counted, example};
use super::*;
use crate::file::MemoryLimit;
use crate::recording::mat::{MatValue, read_mat};
use std::collections::BTreeMap;

fn read(tree: &Tree) -> BTreeMap<String, MatValue> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.mat");
    std::fs::write(&path, mat_file(tree).unwrap()).unwrap();
    read_mat(&path, &MemoryLimit::command().begin()).unwrap().into_iter().collect()
}

fn members(value: &MatValue) -> BTreeMap<String, MatValue> {
    let MatValue::Struct(members) = value else { panic!("{value:?} is no struct") };
    members.iter().cloned().collect()
}

#[test]
fn the_first_index_is_the_fastest_in_memory() {
    let found = read(&example());
    let (sizes, values) = found["displacement_mm"].numbers().unwrap();
    assert_eq!((sizes, values), (&[2, 3, 4][..], &counted()[..]));
    // No sizes of one at the end, and never fewer than two.
    assert_eq!(found["one_drive"].numbers().unwrap().0, [2, 1]);
    assert_eq!(found["one"].numbers().unwrap(), (&[1, 1][..], &[3.5][..]));
}

#[test]
fn everything_comes_back_and_is_told_of() {
    let found = read(&example());
    assert_eq!(found["program"], MatValue::Text("lambdak µ".into()));
    let names = ["mu_1", "alpha_1"].map(|n| MatValue::Text(n.into()));
    assert_eq!(found["parameters"].members().unwrap(), names);
    let sample = members(&found["sample_1"]);
    assert_eq!(sample["mask"].numbers().unwrap(), (&[2, 2][..], &[1.0, 0.0, 1.0, 1.0][..]));
    // Counted from 1.
    assert_eq!(sample["element_nodes"].numbers().unwrap().1, [1.0, 8.0]);
    let about = members(&found["about"]);
    assert_eq!(about["displacement_mm"], MatValue::Text("(x, y, drive), mm: displacement".into()));
    let of_sample = members(&about["sample_1"]);
    assert_eq!(of_sample["element_nodes"], MatValue::Text("(element): nodes; counted from 1".into()));
}

/// MATLAB takes a file for its own by the first bytes of the user block, and up to R2021b knows HDF5 1.8 alone.
#[test]
fn the_user_block_is_that_of_matlab() {
    let bytes = mat_file(&example()).unwrap();
    assert!(bytes.starts_with(b"MATLAB 7.3 MAT-file"));
    assert_eq!(bytes[124..128], [0x00, 0x02, b'I', b'M']);
    assert_eq!(bytes[512..521], *b"\x89HDF\r\n\x1a\n\x02");
}

#[test]
fn an_array_that_its_axes_do_not_fit_is_refused() {
    let mut tree = Tree::default();
    tree.array("force_n", "N", "forces", &[("drive", 3)], vec![1.0, 2.0]);
    assert!(matches!(mat_file(&tree), Err(ArraysError::Length { found: 2, expected: 3, .. })));
}
