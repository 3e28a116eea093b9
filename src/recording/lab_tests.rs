use super::super::mat::read_mat;
use super::*;
use crate::recording::RecordingError;
use std::path::PathBuf;

fn memory() -> crate::file::ReadingMemory {
    crate::file::MemoryLimit::command().begin()
}

fn specimen() -> Specimen {
    let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
    Specimen { holes: vec![], drive_mm: vec![2.5, 5.0], ..specimen }
}

fn variables(name: &str) -> Vec<(String, MatValue)> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/import").join(name);
    read_mat(&path, &memory()).unwrap()
}

/// Indices (thickness, width, length) become (y, z, x), components likewise.
#[test]
fn laboratory_fields_become_recordings() {
    for name in ["v5.mat", "v7.mat", "v73.mat"] {
        let r = recording_from_mat(&variables(name), &specimen(), &ImportOptions::default(), &memory()).unwrap();
        assert_eq!(r.grid.shape, [5, 6, 4], "{name}");
        assert_eq!(r.grid.voxel_mm, [5.08, 1.0666, 4.775]);
        assert!((r.grid.origin_mm[1] + 2.5 * 1.0666).abs() < 1e-12);
        assert_eq!(r.num_voxels(), 119);
        assert_eq!(r.steps.iter().map(|s| s.drive_mm).collect::<Vec<_>>(), [2.5, 5.0]);
        for v in 0..r.grid.num_voxels() {
            let [k, i, j] = r.grid.indices(v).map(|n| n as f64);
            for (s, step) in r.steps.iter().enumerate() {
                let s = (s + 1) as f64;
                let exact = [0.05 * i + 0.003 * k + s, 0.01 * i + 0.1 * s, -0.02 * j];
                let u = step.displacement[v];
                if r.mask[v] {
                    assert!((0..3).all(|a| (u[a] - exact[a]).abs() < 1e-14), "{name} {v}");
                } else {
                    assert!(u.iter().all(|x| x.is_nan()));
                }
            }
        }
        let notes = r.notes.unwrap().to_string();
        assert!(notes.contains("\"info\"") && !notes.contains("prescribedU"), "{notes}");
    }
}

/// Spacings from the positions, with the unit, and axes turned round: component and position change sign together.
#[test]
fn positions_units_and_signs_are_heeded() {
    let options = ImportOptions {
        axes: ImportOptions::parse_axes("-y,z,-x").unwrap(),
        drive_mm: vec![1.0, 2.0],
        ..ImportOptions::default()
    };
    let r = recording_from_mat(&variables("positions.mat"), &specimen(), &options, &memory()).unwrap();
    assert!((0..3).all(|a| (r.grid.voxel_mm[a] - [5.08, 1.0666, 4.775][a]).abs() < 1e-12));
    assert_eq!(r.num_voxels(), 120);
    for v in 0..120 {
        let [k, i, _] = r.grid.indices(v);
        let (k, i) = ((4 - k) as f64, (5 - i) as f64);
        let u = r.steps[1].displacement[v];
        assert!((u[0] + 0.05 * i + 0.003 * k + 2.0).abs() < 1e-14 && (u[1] + 0.01 * i + 0.2).abs() < 1e-14);
    }
    let small = ImportOptions { unit_mm: 1e-3, ..options };
    let error = recording_from_mat(&variables("positions.mat"), &specimen(), &small, &memory()).unwrap_err();
    assert!(matches!(error, ImportError::Extent { .. }), "{error}");
    for bad in ["x,y", "x,y,y", "x,y,w", ""] {
        assert!(ImportOptions::parse_axes(bad).is_none());
    }
}

#[test]
fn one_block_of_two_is_chosen() {
    let one = Specimen { drive_mm: vec![5.0], ..specimen() };
    let read = |region| {
        recording_from_mat(
            &variables("two_blocks.mat"),
            &one,
            &ImportOptions { region, ..ImportOptions::default() },
            &memory(),
        )
    };
    assert!(matches!(read(None).unwrap_err(), ImportError::Regions { num_regions: 2, asked: None }));
    assert!(matches!(read(Some(3)).unwrap_err(), ImportError::Regions { num_regions: 2, asked: Some(3) }));
    for (region, value) in [(1, 0.5), (2, 0.25)] {
        let r = read(Some(region)).unwrap();
        assert_eq!(r.grid.shape, [5, 6, 4]);
        assert!(r.steps[0].displacement.iter().all(|u| *u == [0.0, value, 0.0]));
    }
}

#[test]
fn poor_files_are_typed_errors() {
    let read = |v: &[(String, MatValue)]| {
        recording_from_mat(v, &specimen(), &ImportOptions::default(), &memory()).unwrap_err()
    };
    assert!(matches!(read(&[]), ImportError::Missing { what: "U_t", .. }));
    let without = |name: &str| -> Vec<_> { variables("v5.mat").into_iter().filter(|(n, _)| n != name).collect() };
    assert!(matches!(read(&without("osc")), ImportError::Missing { .. }));
    let with = |name: &str, value: MatValue| {
        let mut list = without(name);
        list.push((name.into(), value));
        list
    };
    assert!(matches!(read(&with("U_t", MatValue::Text("no".into()))), ImportError::Layout { .. }));
    let flat = MatValue::Numeric { dims: vec![2, 2], values: vec![1.0; 4], imaginary: None };
    assert!(matches!(read(&with("mask", flat.clone())), ImportError::Layout { .. }));
    assert!(matches!(read(&with("osc", flat)), ImportError::Layout { .. }));
    let zeros = MatValue::Numeric { dims: vec![6, 4, 5], values: vec![0.0; 120], imaginary: None };
    assert!(matches!(read(&with("mask", zeros)), ImportError::EmptyMask));
    let options = ImportOptions { drive_mm: vec![1.0], ..ImportOptions::default() };
    let error = recording_from_mat(&variables("v5.mat"), &specimen(), &options, &memory()).unwrap_err();
    assert!(matches!(error, ImportError::Drives { found: 1, num_steps: 2 }));
}

fn scale(value: &mut MatValue, factor: f64) {
    match value {
        MatValue::Cell { members, .. } => members.iter_mut().for_each(|member| scale(member, factor)),
        MatValue::Numeric { values, .. } => values.iter_mut().for_each(|x| *x *= factor),
        other => panic!("{other:?}"),
    }
}

/// Displacements whose order is not that of the indices; positions that are the specimen's own.
#[test]
fn components_and_positions_may_be_stated() {
    let options = |components: Option<&str>, origin| ImportOptions {
        components: components.and_then(ImportOptions::parse_axes),
        origin,
        drive_mm: vec![1.0, 2.0],
        ..ImportOptions::default()
    };
    let read =
        |name: &str, options: &ImportOptions| recording_from_mat(&variables(name), &specimen(), options, &memory());
    // A tenth of the displacements, which are no deformation that keeps the volume in either order.
    let mut small = variables("positions.mat");
    small.iter_mut().filter(|v| v.0 == "U_t").for_each(|v| scale(&mut v.1, 0.1));
    let tenth = |components: Option<&str>| {
        let options = ImportOptions { drive_mm: vec![0.1, 0.2], ..options(components, GridOrigin::MaskCenter) };
        recording_from_mat(&small, &specimen(), &options, &memory()).unwrap()
    };
    let (by_index, stated) = (tenth(None), tenth(Some("z,-x,y")));
    let (a, b) = (by_index.steps[1].displacement[7], stated.steps[1].displacement[7]);
    // Along the indices they are y, z, x.
    assert_eq!([b[2], b[0], b[1]], [a[1], -a[2], a[0]]);
    // X begins at zero along every index: its frame is not the specimen's, whose origin is the block's centre.
    let elsewhere = read("positions.mat", &options(None, GridOrigin::Positions)).unwrap_err();
    assert!(matches!(elsewhere, ImportError::Recording(RecordingError::Position { .. })), "{elsewhere}");
    let mut shifted = variables("positions.mat");
    let positions = shifted.iter_mut().find(|v| v.0 == "X").map(|v| &mut v.1);
    let Some(MatValue::Cell { members, .. }) = positions else { panic!("X is a cell") };
    for member in members {
        let MatValue::Numeric { values, .. } = member else { panic!("X holds numbers") };
        let last = values.last().copied().unwrap();
        values.iter_mut().for_each(|x| *x += 0.25 - 0.5 * last);
    }
    let placed = recording_from_mat(&shifted, &specimen(), &options(None, GridOrigin::Positions), &memory()).unwrap();
    for (found, centred) in placed.grid.origin_mm.iter().zip(by_index.grid.origin_mm) {
        assert!((found - centred - 0.25).abs() < 1e-12, "{found} {centred}");
    }
    assert!((by_index.grid.origin_mm[0] + 2.0 * 5.08).abs() < 1e-12);
    let without = read("v5.mat", &options(None, GridOrigin::Positions)).unwrap_err();
    assert!(matches!(without, ImportError::Missing { .. }), "{without}");
}
