use super::*;
use crate::voxel::{Face, MeasuredComponents};

fn memory(bytes: u64) -> crate::file::ReadingMemory {
    crate::file::MemoryLimit::body(bytes).begin()
}

fn specimen() -> Specimen {
    let specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap();
    Specimen { holes: vec![], drive_mm: vec![5.0], ..specimen }
}

fn path() -> &'static Path {
    Path::new("points.csv")
}

/// Points of a grid in any order become its voxels; missing ones leave gaps.
#[test]
fn points_on_a_grid_become_voxels() {
    let mut lines = Vec::new();
    for k in 0..4 {
        for j in 0..8 {
            for i in 0..10 {
                if (i, j, k) == (3, 4, 2) {
                    continue;
                }
                let (x, y, z) =
                    (-11.43 + 2.54 * f64::from(i), -2.8 + 0.8 * f64::from(j), -7.1625 + 4.775 * f64::from(k));
                lines.push(format!("{x},{y},{z},{},0.5,0.25,0.02", 0.7 * y));
            }
        }
    }
    lines.rotate_left(117);
    let text = format!("x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm,sd\n{}\n", lines.join("\n"));
    let points = read_points(&text, path(), None, 1.0, &memory(1 << 20)).unwrap().points;
    assert_eq!(points.len(), 319);
    let r =
        recording_from_points(&[points], &specimen(), None, None, &ImportOptions::default(), &memory(1 << 26)).unwrap();
    assert_eq!(r.grid.shape, [10, 8, 4]);
    assert_eq!(r.num_voxels(), 319);
    // A root mean square of 319 equal numbers.
    assert!(r.noise_sd_mm.unwrap().iter().all(|sd| (sd - 0.02).abs() < 1e-14));
    for v in (0..320).filter(|&v| r.mask[v]) {
        let x = r.grid.center_mm(v);
        let u = r.steps[0].displacement[v];
        assert!((u[0] - 0.7 * x[1]).abs() < 1e-12 && u[1] == 0.5 && u[2] == 0.25);
    }
}

/// What programs of cameras write before the names of the columns, and columns of strains between them, change nothing;
/// where no line names all columns, the one that comes nearest is complained of.
#[test]
fn preambles_and_other_columns_are_passed_over() {
    let read = |text: &str| read_points(text, path(), None, 1.0, &memory(1 << 20));
    let plain = read("x,y,z,ux,uy,uz\n1,2,3,0.1,0.2,0.3\n").unwrap();
    let text = "# correlated\nStep;7\n\nX [mm];Y [mm];Z [mm];exx;U [mm];V [mm];W [mm];sigma\n1;2;3;9;0,1;0,2;0,3;8\n";
    let seen = read(text).unwrap();
    assert_eq!(seen.points, plain.points);
    // A misspelt column is said, for nothing else would show that it had no part.
    assert_eq!((plain.unused_columns.len(), seen.unused_columns), (0, vec!["exx".to_string(), "sigma".into()]));
    let said = read("# correlated\nx,y,z,ux,uy\n1,2,3,0.1,0.2\n").unwrap_err().to_string();
    assert!(said.contains("line 2: there is no column uz; x,y,z,ux,uy,uz are needed"), "{said}");
}

/// Scattered points are averaged by weight in the voxels asked for, and refused without.
#[test]
fn scattered_points_are_averaged() {
    let mut text = String::from("x,y,z,ux,uy,uz,w\n");
    for n in 0..4000u32 {
        let part = |p: u32| (f64::from(n * p % 3989) / 3989.0) - 0.5;
        let (x, y, z) = (25.4 * part(7), 6.4 * part(61), 19.1 * part(389));
        text +=
            &format!("{x},{y},{z},{},0,0,{}\n", if n % 2 == 0 { 1.0 } else { 4.0 }, if n % 2 == 0 { 2.0 } else { 1.0 });
    }
    let points = read_points(&text, path(), None, 1.0, &memory(1 << 23)).unwrap().points;
    let read = |voxel| {
        recording_from_points(
            std::slice::from_ref(&points),
            &specimen(),
            voxel,
            None,
            &ImportOptions::default(),
            &memory(1 << 26),
        )
    };
    assert!(matches!(read(None).unwrap_err(), ImportError::NoGrid { .. }));
    let r = read(Some([6.35, 3.2, 9.55])).unwrap();
    assert_eq!(r.num_voxels(), 16);
    // Half of the points carry 1 with weight two, half 4 with weight one: 2; some 250 points per voxel,
    // spread 1.4: 0.09.
    assert!(r.steps[0].displacement.iter().all(|u| (u[0] - 2.0).abs() < 0.4));
}

/// Points of a face that one camera saw: neither the place along the normal nor the displacement along it is needed,
/// and where the place is given, the points must lie on the face.
#[test]
fn points_of_a_face_are_its_subsets() {
    let mut with_place = String::from("x,y,z,ux,uy\n");
    let mut plain = String::from("x,y,ux,uy\n");
    for j in 0..8 {
        for i in 0..10 {
            let (x, y) = (-11.43 + 2.54 * f64::from(i), -2.8 + 0.8 * f64::from(j));
            plain += &format!("{x},{y},{},0.5\n", 0.7 * y);
            with_place += &format!("{x},{y},9.55,{},0.5\n", 0.7 * y);
        }
    }
    let seen = |face, components| Some(Surface { face, components });
    let of_one = seen(Face::PlusZ, MeasuredComponents::InPlane);
    let read = |text: &str, surface, unit_mm| {
        let options = ImportOptions { unit_mm, ..ImportOptions::default() };
        let points = read_points(text, path(), surface, 1.0, &memory(1 << 20))?.points;
        recording_from_points(&[points], &specimen(), None, surface, &options, &memory(1 << 26))
    };
    for text in [&plain, &with_place] {
        let r = read(text, of_one, 1.0).unwrap();
        assert_eq!((r.grid.shape, r.grid.surface, r.num_voxels()), ([10, 8, 1], of_one, 80));
        for (v, u) in r.steps[0].displacement.iter().enumerate() {
            let x = r.grid.center_mm(v);
            assert!((u[0] - 0.7 * x[1]).abs() < 1e-12 && u[1] == 0.5 && u[2].is_nan());
            assert!((x[2] - 9.55).abs() < 1e-12);
        }
    }
    // Averaged in subsets of 5.08 × 1.6 mm: means of linear fields.
    let points = read_points(&plain, path(), of_one, 1.0, &memory(1 << 20)).unwrap().points;
    let options = ImportOptions::default();
    let voxel = Some([5.08, 1.6, 1.0]);
    let r = recording_from_points(&[points], &specimen(), voxel, of_one, &options, &memory(1 << 26)).unwrap();
    assert_eq!((r.grid.shape, r.num_voxels()), ([5, 4, 1], 20));
    let error = read(&with_place, seen(Face::MinusZ, MeasuredComponents::InPlane), 1.0).unwrap_err();
    assert!(matches!(error, ImportError::OffFace { face: "-z", .. }), "{error}");
    let error = read(&plain, seen(Face::PlusZ, MeasuredComponents::All), 1.0).unwrap_err();
    assert!(error.to_string().contains("there is no column uz; x,y,ux,uy,uz are needed"), "{error}");
    // The frame's origin is the block's centre, also in the face.
    assert!(read(&plain, of_one, 10.0).is_err());
}

#[test]
fn poor_tables_are_typed_errors() {
    for text in [
        "",
        "x,y,z,ux,uy\n",
        "x,y,z,ux,uy,uz\n",
        "x,y,z,ux,uy,uz\n1,2,3,4,5\n",
        "x,y,z,ux,uy,uz\n1,2,3,4,5,six\n",
        "x,y,z,ux,uy,uz\nnan,2,3,4,5,6\n",
        "x,y,z,ux,uy,uz,w\n1,2,3,4,5,6,-1\n",
    ] {
        assert!(
            matches!(read_points(text, path(), None, 1.0, &memory(2000)), Err(ImportError::Table { .. })),
            "{text}"
        );
    }
    let many = "x,y,z,ux,uy,uz\n".to_string() + &"1,2,3,4,5,6\n".repeat(11);
    assert!(matches!(read_points(&many, path(), None, 1.0, &memory(1000)), Err(ImportError::Memory(_))));
    let one = read_points("x,y,z,ux,uy,uz\n1,2,3,4,5,6\n", path(), None, 1.0, &memory(2000)).unwrap().points;
    let read = |steps: &[Vec<DisplacementPoint>]| {
        recording_from_points(steps, &specimen(), None, None, &ImportOptions::default(), &memory(1 << 26)).unwrap_err()
    };
    assert!(matches!(read(std::slice::from_ref(&one)), ImportError::NoGrid { .. }));
    assert!(matches!(read(&[one.clone(), one]), ImportError::Drives { .. }));
}

/// One table as several programs write it.
#[test]
fn tables_of_cameras_are_read() {
    let read = |text: &str, surface: &str, unit_mm: f64| {
        read_points(text, path(), surface.parse().ok(), unit_mm, &memory(1 << 20)).unwrap().points
    };
    let expected = read("x,y,z,ux,uy,uz\n1,2,9.5,0.25,,0.125\n", "+z,all", 1.0);
    for text in [
        "\"X [mm]\";\"Y [mm]\";Z [mm];U [um];V [um];W [um]\n1,0;2,0;9,5;250;;125\n",
        "x\ty\tz\tu\tv\tw\n\"1,0\"\t2.0\t9,5\t0,25\tnan\t0,125\n",
        "x_um,y_um,z_um,ux_m,uy_m,uz_m\n1000,2000,9500,2.5e-4,,1.25e-4\n",
    ] {
        let points = read(text, "+z,all", 1.0);
        assert_eq!(points.len(), 1);
        for (found, wanted) in [points[0].position, points[0].displacement]
            .iter()
            .flatten()
            .zip([expected[0].position, expected[0].displacement].iter().flatten())
        {
            // The factors of units round.
            assert!((found - wanted).abs() < 1e-14 || found.is_nan() && wanted.is_nan(), "{text}: {points:?}");
        }
    }
    let weighed = read("x,y,ux,uy,w\n1,2,3,4,5\n", "+z", 1.0);
    assert_eq!((weighed[0].weight, weighed[0].displacement[..2].to_vec()), (5.0, vec![3.0, 4.0]));
    // In a file of metres a column of millimetres is one of thousandths.
    let metres = read("x,y,ux_mm,uy\n1,2,3,4\n", "+z", 1e3);
    assert!((metres[0].displacement[0] - 3e-3).abs() < 1e-17 && metres[0].position[0].total_cmp(&1.0).is_eq());
}
