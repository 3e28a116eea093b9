use super::super::figure::{Direction, Figure};
use super::*;

fn subject(sum: f64, sd: Option<f64>, voxel: &str) -> Subject {
    let figure = |name: &str, value, direction| Figure { name: name.into(), value, direction };
    Subject {
        schema: "evaluation/1".into(),
        conditions: vec![("voxel size in mm".into(), voxel.into())],
        inputs: vec![("mesh".into(), "100 elements".into())],
        figures: vec![
            figure("sum", Some(sum), Direction::LargerIsBetter),
            figure("sd", sd, Direction::SmallerIsBetter),
            figure("force", Some(1.0), Direction::Neutral),
        ],
        tells_of_failures: false,
        version: "0.1.0".into(),
    }
}

fn compared(base: &Subject, current: &Subject, options: CompareOptions) -> Result<Comparison, CompareError> {
    compare("test", base, current, &options)
}

#[test]
fn itself_is_the_same() {
    let s = subject(2.0, Some(0.1), "1");
    let c = compared(&s, &s, CompareOptions::default()).expect("comparable");
    assert_eq!((c.num_same, c.is_worse, c.differences.len()), (3, false, 0));
}

#[test]
fn worse_and_better_are_told_apart() {
    let (base, worse) = (subject(2.0, Some(0.1), "1"), subject(1.0, Some(0.1), "1"));
    let c = compared(&base, &worse, CompareOptions::default()).expect("comparable");
    assert_eq!((c.is_worse, c.num_worse), (true, 1));
    let c = compared(&worse, &base, CompareOptions::default()).expect("comparable");
    assert_eq!((c.is_worse, c.num_better), (false, 1));
    let strict = CompareOptions { is_strict: true, ..CompareOptions::default() };
    assert!(compared(&worse, &base, strict).expect("comparable").is_worse);
    let wide = CompareOptions { relative_tolerance: 0.6, ..CompareOptions::default() };
    assert!(!compared(&base, &worse, wide).expect("comparable").is_worse);
    // A standard deviation that is no longer determined.
    let lost = subject(2.0, None, "1");
    assert!(compared(&base, &lost, CompareOptions::default()).expect("comparable").is_worse);
}

#[test]
fn what_cannot_be_compared_says_why() {
    let (a, b) = (subject(2.0, Some(0.1), "[1.0]"), subject(2.0, Some(0.1), "[2.0]"));
    let message = compared(&a, &b, CompareOptions::default()).expect_err("other voxels").to_string();
    assert!(message.contains("voxel size in mm: [1.0] against [2.0]"), "{message}");
    let mut other_mesh = a.clone();
    other_mesh.inputs[0].1 = "90 elements".into();
    let message = compared(&a, &other_mesh, CompareOptions::default()).expect_err("other mesh").to_string();
    assert!(message.contains("mesh: 100 elements against 90 elements"), "{message}");
    let across = CompareOptions { across_inputs: true, ..CompareOptions::default() };
    assert!(compared(&a, &other_mesh, across).is_ok());
    let mut design = a.clone();
    design.schema = "design/1".into();
    assert!(compared(&a, &design, CompareOptions::default()).is_err());
    let mut fewer = a.clone();
    fewer.figures.pop();
    let message = compared(&a, &fewer, CompareOptions::default()).expect_err("a figure is missing").to_string();
    assert!(message.contains("has no 'force'"), "{message}");
    // A sweep lists the tasks that failed, and its other figures are compared all the same.
    fewer.tells_of_failures = true;
    let c = compared(&a, &fewer, CompareOptions::default()).expect("comparable");
    assert_eq!((c.num_same, c.notes.len()), (2, 1), "{:?}", c.notes);
}
