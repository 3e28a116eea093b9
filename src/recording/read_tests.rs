use super::*;
use crate::file::{MemoryError, MemoryLimit};
use crate::recording::{RawRecording, RawStep, Samples};
use crate::voxel::{Face, MeasuredComponents};

/// Memory for so many numbers.
fn numbers(count: u64) -> crate::file::ReadingMemory {
    MemoryLimit::body(8 * count).begin()
}

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

/// Two layers of the grid as cameras at +z would have it, with one camera.
fn of_a_face() -> Recording {
    let surface = Surface { face: Face::PlusZ, components: MeasuredComponents::InPlane };
    let grid = VoxelGrid::planned(&specimen(), [2.0, 0.8, 1.0], Some(surface)).unwrap();
    let n = grid.num_voxels();
    let moved = |v: usize| [2.5 * (grid.center_mm(v)[1] / 6.4 + 0.5), 0.01, f64::NAN];
    let step = RecordedStep { displacement: (0..n).map(moved).collect(), ..small().steps.remove(0) };
    let noise_sd_mm = Some([0.005, 0.005, f64::INFINITY]);
    Recording { grid, mask: vec![true; n], steps: vec![step], noise_sd_mm, ..small() }
}

/// What cameras saw of a face comes back with its face, and with nothing of the component that they do not measure.
#[test]
fn recordings_of_a_face_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let recording = of_a_face();
    recording.write(folder.path()).unwrap();
    let again = read(folder.path()).unwrap();
    assert_eq!((again.grid.surface, again.grid.shape), (recording.grid.surface, [13, 8, 1]));
    assert_eq!(again.noise_sd_mm, recording.noise_sd_mm);
    assert!(again.steps[0].displacement.iter().all(|u| again.is_complete(u) && u[2].is_nan()));
    let path = folder.path().join("recording.json");
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("null"), "{text}");
    let edit = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replace(from, to)).unwrap();
        read(folder.path()).unwrap_err()
    };
    let off = edit("\"+z\"", "\"-z\"");
    assert!(matches!(off, RecordingError::Voxel(VoxelError::OffFace { .. })), "{off}");
    let bonded = edit("\"+z\"", "\"+y\"");
    assert!(matches!(bonded, RecordingError::Voxel(VoxelError::HiddenFace { .. })), "{bonded}");
    let filtered = edit("\"none\"", "\"hamming2\"");
    assert!(matches!(filtered, RecordingError::Voxel(VoxelError::FilteredSurface)), "{filtered}");
    // With heights, their noise must be stated, and there must be some.
    let heights = edit("\"in_plane\"", "\"all\"");
    assert!(matches!(heights, RecordingError::Value { .. } | RecordingError::NoDisplacement { .. }), "{heights}");
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
    for drive in ["0.0", "-2.5", "1e9"] {
        let refused = edit("\"drive_mm\": 2.5", &format!("\"drive_mm\": {drive}"));
        assert!(matches!(refused, RecordingError::Drive { step: 0, .. }), "{drive}: {refused}");
    }
    assert!(matches!(edit("0.1875", "0.2"), RecordingError::VoxelMismatch { .. }));
    let raw = r#""raw": {"phase": ["a", "b", "c"], "magnitude": "m", "mm_per_radian": [1, 1, 1]}, "displacement""#;
    assert!(matches!(edit("\"displacement\"", raw), RecordingError::TwoKinds { step: 0 }));
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
    let good = Image::read(&whole[..], &numbers(1000)).unwrap();
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
        unit_mm: Some(1.0),
    };
    let mut file = Vec::new();
    image(1000).write_gz(&mut file, Samples::Uint8).unwrap();
    // A megabyte of zeros after the thousand promised: read as a thousand.
    assert_eq!(Image::read(&file[..], &numbers(1000)).unwrap().values.len(), 1000);
    let error = Image::read(&file[..], &numbers(999)).unwrap_err();
    let too_much = MemoryError::TooMuch { what: "an image", wanted_bytes: 8000, limit_bytes: 7992 };
    assert!(matches!(&error, NiftiError::Memory(found) if *found == too_much), "{error}");
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

/// Images written by nibabel (see `make.py` beside them): other byte order, kinds of numbers, scaled integers, qform.
#[test]
fn images_of_nibabel_are_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import");
    let image = |name: &str| Image::read(std::fs::File::open(folder.join(name)).unwrap(), &numbers(1000)).unwrap();
    for name in ["float64_big.nii", "uint8.nii.gz", "float32_qform.nii.gz", "int16_scaled.nii.gz"] {
        let found = image(name);
        assert_eq!(found.shape, [3, 4, 2, 1, 1], "{name}");
        let affine = [[1.0, 0.0, 0.0, -2.5], [0.0, 0.1875, 0.0, -0.375], [0.0, 0.0, 0.75, 1.5]];
        for (v, value) in found.values.iter().enumerate() {
            let (i, j, k) = (v % 3, v / 3 % 4, v / 12);
            let number = (8 * i + 2 * j + k) as f64;
            let is_scaled = name.starts_with("int16");
            // Scaled integers hold 11.5 in 65,536 steps; the others hold small whole numbers exactly.
            let (exact, tolerance) = if is_scaled { (0.5 * number - 1.0, 2e-4) } else { (number, 1e-12) };
            assert!((value - exact).abs() < tolerance, "{name} {v} {value}");
        }
        for i in 0..3 {
            for j in 0..4 {
                // Single precision, through a quaternion for the qform.
                assert!((found.affine[i][j] - affine[i][j]).abs() < 1e-6, "{name}");
            }
        }
    }
    let vector = image("displacement.nii.gz");
    assert_eq!((vector.shape, vector.intent), ([3, 4, 2, 1, 3], 1006));
    assert!(vector.values[0].is_nan() && vector.values[24].is_nan());
    assert_eq!((vector.values[1], vector.values[25], vector.values[49]), (8.0, -8.0, 4.0));
}

/// A raw recording comes back as written; each reader refuses the other's kind.
#[test]
fn raw_recordings_round_trip() {
    let (folder, recording) = written();
    let n = recording.grid.num_voxels();
    assert!(matches!(
        RawRecording::read(folder.path(), &ReadLimits::default()),
        Err(RecordingError::NotRaw { step: 1 })
    ));
    let values = |f: f64| (0..n).map(|v| f * (v as f64 - 11.0) / 16.0).collect::<Vec<f64>>();
    let raw = RawRecording {
        id: "raw".into(),
        specimen: recording.specimen.clone(),
        grid: recording.grid.clone(),
        mask: recording.mask.clone(),
        steps: vec![RawStep {
            drive_mm: 2.5,
            force_n: None,
            force_sd_n: None,
            window_s: None,
            phase: [values(1.0), values(-0.5), values(0.25)],
            magnitude: (0..n).map(|v| v as f64).collect(),
            mm_per_radian: [0.1, 0.2, 0.3],
        }],
        noise_sd_mm: None,
        load: None,
        notes: Some(serde_json::json!({ "who": "test" })),
    };
    let folder = tempfile::tempdir().unwrap();
    raw.write(folder.path()).unwrap();
    let digest = || RawRecording::read_with_digest(folder.path(), &ReadLimits::default()).unwrap().digest;
    let again = RawRecording::read(&folder.path().join("recording.json"), &ReadLimits::default()).unwrap();
    let before = digest();
    assert_eq!((&again.grid, &again.mask, &again.notes), (&raw.grid, &raw.mask, &raw.notes));
    // Sixteenths are exact in single precision.
    assert_eq!(again.steps[0].phase, raw.steps[0].phase);
    assert_eq!(again.steps[0].magnitude, raw.steps[0].magnitude);
    assert_eq!(again.steps[0].mm_per_radian, [0.1, 0.2, 0.3]);
    assert!(matches!(read(folder.path()), Err(RecordingError::Raw { step: 1 })));
    let mut brighter = raw.clone();
    brighter.steps[0].magnitude[2] += 1.0;
    brighter.write(folder.path()).unwrap();
    assert_ne!(digest(), before);
    let mut turned = raw.clone();
    turned.steps[0].phase[1][3] = 4.0;
    turned.write(folder.path()).unwrap();
    assert!(matches!(
        RawRecording::read(folder.path(), &ReadLimits::default()),
        Err(RecordingError::Value { requirement: "a phase in (−π, π]", .. })
    ));
    let mut scaled = raw;
    scaled.steps[0].mm_per_radian[2] = 0.0;
    scaled.write(folder.path()).unwrap();
    assert!(matches!(RawRecording::read(folder.path(), &ReadLimits::default()), Err(RecordingError::Value { .. })));
}

/// What says where the data begin is a number of bytes, or the image is refused.
#[test]
fn data_begin_at_a_whole_number_of_bytes() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import/float64_big.nii");
    let mut plain = std::fs::read(file).unwrap();
    for offset in [f32::NAN, f32::INFINITY, -352.0, 100.0, 352.5, 1e9] {
        plain[108..112].copy_from_slice(&offset.to_be_bytes());
        let refused = Image::read(&plain[..], &numbers(1000)).unwrap_err();
        assert!(matches!(refused, NiftiError::Offset { .. }), "{offset}: {refused}");
    }
}

/// Units, components and a stream that expands without end are refused with little memory.
#[test]
fn wrong_units_shapes_and_endless_streams_are_refused() {
    use flate2::{Compression, write::GzEncoder};
    use std::io::Write;
    let mut plain = Vec::new();
    let file = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import/float64_big.nii")).unwrap();
    plain.extend_from_slice(&file);
    plain[123] = 1;
    assert!(matches!(Image::read(&plain[..], &numbers(1000)), Err(NiftiError::Units { code: 1 })));
    // A header that promises 32767³ numbers, followed by 64 MiB of zeros in 64 kB of gzip.
    let mut huge = file;
    for at in [42, 44, 46] {
        huge[at..at + 2].copy_from_slice(&32767i16.to_be_bytes());
    }
    let mut bomb = GzEncoder::new(Vec::new(), Compression::best());
    bomb.write_all(&huge).unwrap();
    for _ in 0..64 {
        bomb.write_all(&[0; 1 << 20]).unwrap();
    }
    let bomb = bomb.finish().unwrap();
    let memory = MemoryLimit::command().begin();
    assert!(matches!(Image::read(&bomb[..], &memory), Err(NiftiError::Memory(MemoryError::TooMuch { .. }))));
    let (folder, _) = written();
    let mask = std::fs::read(folder.path().join("mask.nii.gz")).unwrap();
    let whole = Image::read(&mask[..], &numbers(1000)).unwrap();
    let path = folder.path().join("u_1.nii.gz");
    let scalar = Image { intent: 1006, ..whole };
    scalar.write_gz(std::fs::File::create(path).unwrap(), Samples::Float32).unwrap();
    assert!(matches!(
        read(folder.path()),
        Err(RecordingError::Image { source: NiftiError::Shape { expected_components: 3, .. }, .. })
    ));
}

/// The digest covers every file that is read and no other.
#[test]
fn a_digest_tells_what_was_read() {
    let digest = |folder: &Path| Recording::read_with_digest(folder, &ReadLimits::default()).expect("it reads").digest;
    let (folder, mut recording) = written();
    let first = digest(folder.path());
    assert_eq!(first.len(), 64);
    std::fs::write(folder.path().join("notes.txt"), "unrelated").expect("written");
    assert_eq!(digest(folder.path()), first, "another file of the folder");
    let rewritten = |recording: &Recording| {
        recording.write(folder.path()).expect("written");
        digest(folder.path())
    };
    assert_eq!(rewritten(&recording), first, "the same content");
    recording.steps[0].displacement[0][2] += 0.5;
    let moved = rewritten(&recording);
    assert_ne!(moved, first, "a changed voxel");
    recording.load.as_mut().expect("a curve").force_n[1] += 0.5;
    let loaded = rewritten(&recording);
    assert_ne!(loaded, moved, "a changed line of the load curve");
    recording.mask[0] = false;
    let masked = rewritten(&recording);
    assert_ne!(masked, loaded, "a changed mask");
    recording.id = "other".into();
    assert_ne!(rewritten(&recording), masked, "a changed recording.json");
}

/// Bytes behind an image's data belong to the file, and to its digest.
#[test]
fn a_digest_covers_whole_files() {
    use std::io::Write;
    let (folder, _) = written();
    let digest = || Recording::read_with_digest(folder.path(), &ReadLimits::default()).expect("it reads").digest;
    let before = digest();
    let image = folder.path().join("u_1.nii.gz");
    let mut file = std::fs::OpenOptions::new().append(true).open(image).expect("it is there");
    file.write_all(b"more").expect("written");
    assert_ne!(digest(), before);
}

#[test]
fn files_that_are_too_large_are_refused_while_reading() {
    let (folder, _) = written();
    let size = std::fs::metadata(folder.path().join("recording.json")).expect("it is there").len();
    let limits = ReadLimits { max_file_bytes: size - 1, ..ReadLimits::default() };
    let refused = Recording::read(folder.path(), &limits).expect_err("refused");
    assert!(matches!(refused, RecordingError::TooLarge { limit, .. } if limit == size - 1), "{refused}");
}

/// A pipe has no other end here: to open it would wait for ever.
#[cfg(unix)]
#[test]
fn what_is_no_regular_file_is_refused() {
    let (folder, _) = written();
    let replace = |name: &str, make: &dyn Fn(&Path)| {
        let path = folder.path().join(name);
        std::fs::remove_file(&path).expect("it is there");
        make(&path);
        read(folder.path()).expect_err("refused")
    };
    let pipe = |path: &Path| {
        assert!(std::process::Command::new("mkfifo").arg(path).status().expect("mkfifo runs").success());
    };
    let device = |path: &Path| std::os::unix::fs::symlink("/dev/zero", path).expect("linked");
    let folder_at = |path: &Path| std::fs::create_dir(path).expect("made");
    assert!(matches!(replace("u_1.nii.gz", &pipe), RecordingError::NotRegular { .. }));
    assert!(matches!(replace("load.csv", &device), RecordingError::NotRegular { .. }));
    assert!(matches!(replace("mask.nii.gz", &folder_at), RecordingError::NotRegular { .. }));
    assert!(matches!(replace("recording.json", &pipe), RecordingError::NotRegular { .. }));
}
