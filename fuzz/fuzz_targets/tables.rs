//! Load curves and tables of points: comma-separated text of machines and other programs.
#![no_main]

use lambdak::homogeneous::{CsvOptions, HomogeneousTest, read_biaxial_csv, read_csv};
use lambdak::recording::{LoadCurve, read_points};
use lambdak::voxel::{Face, MeasuredComponents, Surface};
use lambdak_fuzz::memory;
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let path = Path::new("table.csv");
    for (length_mm, area_mm2) in [(None, None), (Some(20.0), Some(5.0))] {
        let options = CsvOptions { length_mm, area_mm2, ..CsvOptions::default() };
        for test in [HomogeneousTest::Uniaxial, HomogeneousTest::SimpleShear] {
            if let Ok(curve) = read_csv(text, test, &options) {
                assert_eq!(curve.drive.len(), curve.stress.len());
                assert!(curve.drive.iter().chain(&curve.stress).all(|x| x.is_finite()));
            }
        }
    }
    if let Ok(test) = read_biaxial_csv(text, &CsvOptions::default()) {
        assert!(test.stresses.iter().flatten().all(|stress| stress.len() == test.drives.len()));
        assert!(test.drives.iter().flatten().chain(test.stresses.iter().flatten().flatten()).all(|x| x.is_finite()));
    }
    let _ = LoadCurve::from_csv(text, path);
    for face in [None, Some(Face::PlusZ)] {
        let surface = face.map(|face| Surface { face, components: MeasuredComponents::InPlane });
        let _ = read_points(text, path, surface, 1.0, &memory());
    }
});
