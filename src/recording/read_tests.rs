use super::*;
use crate::recording::Samples;

fn specimen() -> Specimen {
    Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap()
}

fn small() -> Recording {
    let grid = VoxelGrid::new([-1.5, 0.25, 2.0], [1.0, 0.1875, 0.75], [3, 4, 2]).unwrap();
    let n = grid.num_voxels();
    let mut mask = vec![true; n];
    mask[5] = false;
    let displacement =
        (0..n).map(|v| if mask[v] { [v as f64, -0.5 * v as f64, 0.125] } else { [f64::NAN; 3] }).collect::<Vec<_>>();
    Recording {
        id: "small".into(),
        specimen: specimen(),
        grid,
        mask,
        steps: vec![RecordedStep {
            drive_mm: 2.5,
            force_n: Some(5.0),
            force_sd_n: Some(0.02),
            window_s: Some([1.0, 3.0]),
            displacement,
        }],
        noise_sd_mm: Some([0.05; 3]),
        filter: Filter::None,
        load: Some(LoadCurve { time_s: vec![0.0, 0.5], drive_mm: vec![0.0, 2.5], force_n: vec![0.0, 5.0] }),
        notes: None,
    }
}

fn written() -> (tempfile::TempDir, Recording) {
    let folder = tempfile::tempdir().unwrap();
    let recording = small();
    recording.write(folder.path()).unwrap();
    (folder, recording)
}

fn read(folder: &Path) -> Result<Recording, RecordingError> {
    Recording::read(folder, &ReadLimits::default())
}

#[test]
fn what_is_written_is_read() {
    let (folder, recording) = written();
    let again = read(folder.path()).unwrap();
    // The affine is stored in single precision, which holds these numbers exactly; so do the displacements.
    assert_eq!(again.grid, recording.grid);
    assert_eq!(again.mask, recording.mask);
    assert_eq!(again.load, recording.load);
    for (a, b) in again.steps[0].displacement.iter().zip(&recording.steps[0].displacement) {
        assert!(a == b || (a[0].is_nan() && b[0].is_nan()), "{a:?} {b:?}");
    }
    assert_eq!(again.num_voxels(), 23);
}

#[test]
fn bad_files_are_typed_errors() {
    let edit = |from: &str, to: &str| {
        let (folder, _) = written();
        let path = folder.path().join("recording.json");
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replace(from, to)).unwrap();
        read(folder.path()).unwrap_err()
    };
    assert!(matches!(edit("\"u_1.nii.gz\"", "\"../u_1.nii.gz\""), RecordingError::FileName { .. }));
    assert!(matches!(edit("\"u_1.nii.gz\"", "\"missing.nii.gz\""), RecordingError::File { .. }));
    assert!(matches!(edit("\"u_1.nii.gz\"", "\"mask.nii.gz\""), RecordingError::Image { .. }));
    assert!(matches!(edit("mru-recording/1", "mru-recording/9"), RecordingError::Json(_)));
    assert!(matches!(edit("\"force_n\"", "\"farce_n\""), RecordingError::Json(_)));
    assert!(matches!(edit("0.02", "-0.02"), RecordingError::Value { .. }));
}

#[test]
fn bad_images_are_typed_errors() {
    let (folder, mut recording) = written();
    let path = folder.path().join("u_1.nii.gz");
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let damaged = read(folder.path()).unwrap_err();
    assert!(matches!(damaged, RecordingError::Image { source: NiftiError::Damaged(_), .. }), "{damaged}");
    let rewrite = |image: &Image| {
        image.write_gz(std::fs::File::create(&path).unwrap(), Samples::Float32).unwrap();
        read(folder.path()).unwrap_err()
    };
    let good = Image::read(&whole[..], 1000).unwrap();
    let intent = rewrite(&Image { intent: 0, ..good.clone() });
    assert!(matches!(intent, RecordingError::Image { source: NiftiError::Intent { found: 0 }, .. }), "{intent}");
    let mut turned = good.clone();
    turned.affine[0][0] = -1.0;
    assert!(matches!(rewrite(&turned), RecordingError::Image { source: NiftiError::Orientation, .. }));
    let mut shifted = good.clone();
    shifted.affine[1][3] += 0.1;
    assert!(matches!(rewrite(&shifted), RecordingError::Grid { .. }));
    let missing = rewrite(&Image { values: vec![f64::NAN; good.values.len()], ..good });
    assert!(matches!(missing, RecordingError::NoDisplacement { step: 1, num_voxels: 23 }), "{missing}");
    recording.mask.fill(false);
    recording.write(folder.path()).unwrap();
    assert!(matches!(read(folder.path()).unwrap_err(), RecordingError::EmptyMask));
}

/// A file whose header promises too much, or that expands to more than its header promises, costs little memory.
#[test]
fn bombs_are_refused() {
    let image = |n: usize| Image {
        shape: [n, 1, 1, 1, 1],
        affine: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        intent: 0,
        values: vec![0.0; 1 << 20],
    };
    let mut file = Vec::new();
    image(1000).write_gz(&mut file, Samples::Uint8).unwrap();
    // A megabyte of zeros after the thousand promised: read as a thousand.
    assert_eq!(Image::read(&file[..], 1000).unwrap().values.len(), 1000);
    let error = Image::read(&file[..], 999).unwrap_err();
    assert!(matches!(error, NiftiError::TooLarge { values: 1000, limit: 999 }), "{error}");
}

#[test]
fn load_curves_are_checked() {
    let path = Path::new("load.csv");
    let bad = [
        "",
        "a,b,c\n",
        "time_s,drive_mm,force_n\n",
        "time_s,drive_mm,force_n\n0,1\n",
        "time_s,drive_mm,force_n\n0,1,nan\n",
        "time_s,drive_mm,force_n\n1,0,0\n0,0,0\n",
    ];
    for text in bad {
        assert!(matches!(LoadCurve::from_csv(text, path), Err(RecordingError::LoadCurve { .. })), "{text}");
    }
    let curve = LoadCurve::from_csv("time_s,drive_mm,force_n\n0,0,1\n1,0,3\n2,0,9\n", path).unwrap();
    assert_eq!(curve.mean_force_n([0.0, 1.0]), Some(2.0));
    assert_eq!(curve.mean_force_n([5.0, 6.0]), None);
}
