//! Recordings from the files of scanners: a synthetic scan is written as DICOM and as ParaVision, in several
//! orientations, and comes back.

mod dicom;
mod paravision;
mod scene;

use dicom::{EXPLICIT, IMPLICIT, enhanced, file, single_frames};
use lambdak::file::{MemoryLimit, files_below};
use lambdak::recording::{
    DicomFiles, ImportError, ImportOptions, ParavisionStudy, RawRecording, ReadLimits, Recording, ScannerError,
    SeriesMap, StackFault, VolumeReader, raw_recording_from_series,
};
use lambdak::specimen::Specimen;
use paravision::Storage;
use scene::{LEVELS, PLAIN, Pose, Stored, scanned, series_map, stored};
use serde_json::json;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Half a step of the stored phases, and what single precision adds, rad.
const HALF_STEP: f64 = PI / LEVELS + 1e-6;

/// Turned and mirrored images of a sample that lies along the scanner's axes.
const POSES: [Pose; 4] = [
    PLAIN,
    Pose { index: [(0, true), (1, true), (2, false)], ..PLAIN },
    Pose { index: [(2, false), (0, true), (1, true)], ..PLAIN },
    Pose { index: [(1, true), (2, true), (0, true)], ..PLAIN },
];

fn read(
    files: &dyn VolumeReader,
    map: &serde_json::Value,
    range: Option<[f64; 2]>,
) -> Result<RawRecording, ImportError> {
    let specimen = Specimen::from_json(&scene::specimen().to_string()).unwrap();
    let map: SeriesMap = serde_json::from_value(map.clone()).unwrap();
    let memory = MemoryLimit::command().begin();
    raw_recording_from_series(files, &map, range, None, &specimen, &ImportOptions::default(), &memory)
}

fn open(folder: &Path) -> Result<DicomFiles, ScannerError> {
    DicomFiles::open(files_below(folder).unwrap(), 1 << 30, &MemoryLimit::command().begin())
}

fn open_study(folder: &Path) -> Result<ParavisionStudy, ScannerError> {
    ParavisionStudy::open(&files_below(folder).unwrap(), &MemoryLimit::command().begin())
}

/// Grid, mask and phases are those of the scan, but for the steps in which phases are stored.
fn assert_comes_back(scan: &RawRecording, found: &RawRecording) {
    assert_eq!(found.grid.shape, scan.grid.shape);
    for a in 0..3 {
        assert!((found.grid.voxel_mm[a] - scan.grid.voxel_mm[a]).abs() < 1e-6, "{:?}", found.grid.voxel_mm);
        // Both grids are centred on the specimen; single precision in the scan's affine.
        assert!((found.grid.origin_mm[a] - scan.grid.origin_mm[a]).abs() < 1e-5, "{:?}", found.grid.origin_mm);
    }
    assert_eq!(found.mask, scan.mask);
    assert_eq!(found.steps.len(), scan.steps.len());
    for (a, b) in scan.steps.iter().zip(&found.steps) {
        assert_eq!((a.drive_mm, a.mm_per_radian), (b.drive_mm, b.mm_per_radian));
        for axis in 0..3 {
            for v in (0..scan.mask.len()).filter(|&v| scan.mask[v] && a.phase[axis][v].is_finite()) {
                let difference = (a.phase[axis][v] - b.phase[axis][v]).abs();
                let difference = difference.min((2.0 * PI - difference).abs());
                assert!(difference <= HALF_STEP, "axis {axis}, voxel {v}: {difference} rad");
            }
        }
    }
}

/// Writes all series of a scan as single frames, each in a folder of its own.
fn write_single_frames(scan: &RawRecording, folder: &Path, pose: Pose) {
    for step in 0..scan.steps.len() {
        for which in 0..4 {
            let number = 4 * step + which + 1;
            let kind = if which == 3 { "M" } else { "P" };
            let place = folder.join(number.to_string());
            std::fs::create_dir_all(&place).unwrap();
            for (n, bytes) in single_frames(&stored(scan, step, which, pose), number, kind, None).iter().enumerate() {
                std::fs::write(place.join(format!("{:03}.dcm", 977 * n % 1000)), bytes).unwrap();
            }
        }
    }
}

fn by_number(step: usize, which: usize) -> (String, usize) {
    ((4 * step + which + 1).to_string(), 1)
}

/// However the images are turned or mirrored, the recording is the same to the bit, and that of the scan but for the
/// steps of the stored phases.
#[test]
fn single_frames_come_back_in_every_orientation() {
    let folder = tempfile::tempdir().unwrap();
    let (scan, _) = scanned(folder.path());
    let mut first: Option<RawRecording> = None;
    for (n, pose) in POSES.into_iter().enumerate() {
        let place = folder.path().join(n.to_string());
        write_single_frames(&scan, &place, pose);
        // A text and a catalogue without an image lie beside the images.
        std::fs::write(place.join("README.txt"), "none of ours").unwrap();
        std::fs::write(place.join("DICOMDIR"), file(EXPLICIT, &[])).unwrap();
        let files = open(&place).unwrap();
        assert_eq!(files.num_passed_over(), 2);
        let lines = files.lines();
        assert_eq!((lines.len(), lines[0].name.as_str(), lines[0].num_volumes), (8, "1", Some(1)));
        assert_eq!(lines[3].kinds, ["ORIGINAL\\PRIMARY\\M"]);
        let found = read(&files, &series_map(&scan, by_number), None).unwrap();
        assert_comes_back(&scan, &found);
        match &first {
            None => first = Some(found),
            Some(first) => {
                for (a, b) in first.steps.iter().zip(&found.steps) {
                    let inside = |values: &[f64]| -> Vec<f64> {
                        values.iter().zip(&scan.mask).filter(|(_, m)| **m).map(|(v, _)| *v).collect()
                    };
                    assert!((0..3).all(|c| inside(&a.phase[c]) == inside(&b.phase[c])), "{pose:?}");
                    assert_eq!(inside(&a.magnitude), inside(&b.magnitude));
                }
            }
        }
    }
}

/// A sample that lies across the scanner, images along yet other axes: `scanner_axes` says how it lay. A phase that
/// falls as the displacement rises is turned.
#[test]
fn the_sample_may_lie_across_the_scanner() {
    let folder = tempfile::tempdir().unwrap();
    let (mut scan, _) = scanned(folder.path());
    let pose = Pose { index: [(2, true), (0, false), (1, true)], patient: [(2, false), (0, true), (1, false)] };
    write_single_frames(&scan, &folder.path().join("images"), pose);
    let files = open(&folder.path().join("images")).unwrap();
    let mut map = series_map(&scan, by_number);
    let wrong = read(&files, &map, None).unwrap_err();
    assert!(matches!(wrong, ImportError::Extent { .. }), "{wrong}");
    map["scanner_axes"] = json!("z,-x,y");
    map["steps"][1]["y"]["is_reversed"] = json!(true);
    let found = read(&files, &map, None).unwrap();
    scan.steps[1].phase[1].iter_mut().for_each(|p| *p = -*p);
    assert_comes_back(&scan, &found);
}

/// One file with phases and magnitudes as volumes, of both uncompressed transfer syntaxes; slope and intercept of each
/// frame as a vendor with 12 bits writes them, and in milliradians.
#[test]
fn enhanced_images_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let (scan, _) = scanned(folder.path());
    let milliradians = (2000.0 * PI / LEVELS, -1000.0 * PI);
    for (syntax, scale) in [(IMPLICIT, (2.0, -4096.0)), (EXPLICIT, milliradians)] {
        let place = folder.path().join(syntax);
        std::fs::create_dir_all(&place).unwrap();
        for step in 0..2 {
            let phases: Vec<Stored> = [2, 0, 1].map(|which| stored(&scan, step, which, POSES[2])).to_vec();
            let bytes = enhanced(&phases, 10 + step, syntax, Some(scale));
            std::fs::write(place.join(format!("phase{step}")), bytes).unwrap();
            let bytes = enhanced(&[stored(&scan, step, 3, POSES[2])], 20 + step, syntax, None);
            std::fs::write(place.join(format!("magnitude{step}")), bytes).unwrap();
        }
        let files = open(&place).unwrap();
        let map = series_map(&scan, |step, which| match which {
            3 => (format!("1.2.3.{}", 20 + step), 1),
            _ => ((10 + step).to_string(), [2, 3, 1][which]),
        });
        let found = read(&files, &map, None).unwrap();
        assert_comes_back(&scan, &found);
        let volume = files.volume("10", 4, &MemoryLimit::command().begin()).unwrap_err();
        assert!(matches!(volume, ScannerError::NoVolume { found: 3, asked: 4, .. }), "{volume}");
    }
}

/// Slices as frames and whole volumes, either order of frame groups and bytes, two widths of numbers.
#[test]
fn paravision_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let (scan, _) = scanned(folder.path());
    let (slope, offset) = (2.0 * PI / LEVELS, -PI);
    let of = |is_flat, has_volumes_first, is_big_endian, word| Storage {
        is_flat,
        has_volumes_first,
        is_big_endian,
        word,
        slope,
        offset,
    };
    let storages = [
        of(true, false, true, "_16BIT_SGN_INT"),
        of(true, true, false, "_32BIT_SGN_INT"),
        of(false, false, false, "_16BIT_SGN_INT"),
        of(false, false, true, "_32BIT_SGN_INT"),
    ];
    for (n, (storage, pose)) in storages.into_iter().zip(POSES).enumerate() {
        let study = folder.path().join(format!("study{n}"));
        for step in 0..2 {
            let phases: Vec<Stored> = (0..3).map(|which| stored(&scan, step, which, pose)).collect();
            paravision::write(&study, 5 + step, &phases, storage);
            let magnitude = Storage { slope: 1.5, offset: 0.0, ..storage };
            paravision::write(&study, 15 + step, &[stored(&scan, step, 3, pose)], magnitude);
        }
        let files = open_study(&study).unwrap();
        let lines = files.lines();
        let five = lines.iter().find(|l| l.name == "5/1").unwrap();
        assert_eq!((five.description.as_str(), five.num_volumes), ("FLOWMAP, Bruker:FLOWMAP", Some(3)));
        let map = series_map(&scan, |step, which| match which {
            3 => (format!("{}/1", 15 + step), 1),
            _ => (format!("{}/1", 5 + step), which + 1),
        });
        let found = read(&files, &map, None).unwrap();
        assert_comes_back(&scan, &found);
    }
}

/// Images by an independent writer (pydicom, `tests/data/import/make_dicom.py`): oblique planes, slices in no order,
/// two transfer syntaxes. Positions and numbers as that script has them.
#[test]
fn files_of_another_program_are_read() {
    let place = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import/dicom");
    let files = open(&place).unwrap();
    let memory = MemoryLimit::command().begin();
    for name in ["7", "1.2.826.0.1.77", "8"] {
        let image = files.volume(name, 1, &memory).unwrap();
        assert_eq!(image.shape, [4, 3, 3, 1, 1]);
        // LPS: row (0.8, 0.6, 0), column (0, 0, −1), so that the normal is (−0.6, 0.8, 0); x and y turn for RAS.
        let expected =
            [[-0.8 * 0.5, 0.0, 0.6 * 1.25, 10.0], [-0.6 * 0.5, 0.0, -0.8 * 1.25, -20.0], [0.0, -0.75, 0.0, 5.0]];
        for (row, exact) in image.affine.iter().zip(expected) {
            // Positions are written with six decimals.
            assert!(row.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-5), "{:?}", image.affine);
        }
        for (n, value) in image.values.iter().enumerate() {
            let (i, j, k) = (n % 4, n / 4 % 3, n / 12);
            assert_eq!(*value, 0.5 * (100 * k + 10 * j + i) as f64 - 7.0, "{name}");
        }
    }
}

/// What a file promises in vain, and what no reader should believe, ends in a typed error within little memory.
#[test]
fn dicom_files_that_lie_are_typed_errors() {
    let folder = tempfile::tempdir().unwrap();
    let volume = Stored {
        size: [6, 5, 4],
        edges: [1.0, 2.0, 3.0],
        directions: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        origin: [0.0; 3],
        values: (0..120).collect(),
    };
    let good = single_frames(&volume, 1, "M", None).remove(0);
    let many = enhanced(std::slice::from_ref(&volume), 1, EXPLICIT, None);
    let place = folder.path().join("one.dcm");
    // The file itself, and headers: no more than a few times what is there.
    let limit = MemoryLimit { reading_bytes: 1 << 16, ..MemoryLimit::command() };
    let open = |bytes: &[u8]| {
        std::fs::write(&place, bytes).unwrap();
        let memory = limit.begin();
        let files = DicomFiles::open(vec![place.clone()], 1 << 30, &memory)?;
        let name = files.lines()[0].name.clone();
        files.volume(&name, 1, &memory)
    };
    assert_eq!(open(&many).unwrap().values[..6], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    for bytes in [&good, &many] {
        for length in (0..bytes.len()).step_by(3) {
            open(&bytes[..length]).unwrap_err();
        }
        // Every byte of the header in turn becomes the largest and another one: an error or an image, in no case a
        // panic.
        for at in 128..bytes.len() - 240 {
            for value in [0xFF, bytes[at] ^ 0x11] {
                let mut poor = bytes.clone();
                poor[at] = value;
                let _ = open(&poor);
            }
        }
    }
    let replaced = |bytes: &[u8], tag: [u8; 4], value: &[u8]| {
        let at = bytes.windows(4).position(|w| w == tag).unwrap() + 8;
        let mut poor = bytes.to_vec();
        poor[at..at + value.len()].copy_from_slice(value);
        open(&poor).unwrap_err()
    };
    let rows = replaced(&good, [0x28, 0, 0x10, 0], &[0xFF, 0xFF]);
    assert!(matches!(&rows, ScannerError::CutShort { what, .. } if what.contains("PixelData")), "{rows}");
    let frames = replaced(&many, [0x28, 0, 0x08, 0], b"9 ");
    assert!(matches!(frames, ScannerError::CutShort { .. }), "{frames}");
    let bits = replaced(&good, [0x28, 0, 0x00, 0x01], &[64, 0]);
    assert!(matches!(&bits, ScannerError::Header { entry, .. } if entry.starts_with("BitsAllocated")), "{bits}");
    let none = open(b"no image").unwrap_err();
    assert!(matches!(none, ScannerError::NotDicom { .. }), "{none}");
    for (syntax, name) in [("1.2.840.10008.1.2.4.70", "JPEG lossless"), ("1.2.840.10008.1.2.5", "run lengths")] {
        let message = open(&file(syntax, &[])).unwrap_err().to_string();
        assert!(message.contains(name) && message.contains("gdcmconv"), "{message}");
    }
    let small = MemoryLimit { reading_bytes: 100, ..MemoryLimit::command() };
    let refused = DicomFiles::open(vec![place.clone()], 1 << 30, &small.begin()).err().unwrap();
    assert!(matches!(refused, ScannerError::Memory(_)), "{refused}");
}

/// Series that are not complete or not regular.
#[test]
fn stacks_with_gaps_are_typed_errors() {
    let folder = tempfile::tempdir().unwrap();
    let (scan, _) = scanned(folder.path());
    let slices = single_frames(&stored(&scan, 0, 3, PLAIN), 1, "M", None);
    let volume = |slices: &[Vec<u8>]| {
        let place = folder.path().join("series");
        let _ = std::fs::remove_dir_all(&place);
        std::fs::create_dir_all(&place).unwrap();
        for (n, bytes) in slices.iter().enumerate() {
            std::fs::write(place.join(n.to_string()), bytes).unwrap();
        }
        open(&place)?.volume("1", 1, &MemoryLimit::command().begin())
    };
    volume(&slices).unwrap();
    let mut missing = slices.clone();
    missing.remove(3);
    let fault = volume(&missing).unwrap_err();
    assert!(matches!(fault, ScannerError::Stack { fault: StackFault::Distances { .. }, .. }), "{fault}");
    let mut twice = slices.clone();
    twice.push(slices[2].clone());
    let fault = volume(&twice).unwrap_err();
    assert!(
        matches!(fault, ScannerError::Stack { fault: StackFault::Incomplete { few: 1, many: 2, .. }, .. }),
        "{fault}"
    );
    let other = single_frames(&stored(&scan, 0, 3, PLAIN), 1, "P", None);
    let mut mixed = slices.clone();
    mixed[4].clone_from(&other[4]);
    let fault = volume(&mixed).unwrap_err();
    assert!(matches!(fault, ScannerError::Stack { fault: StackFault::Differ { .. }, .. }), "{fault}");
    let turned = single_frames(&stored(&scan, 0, 3, POSES[1]), 1, "M", None);
    let mut mixed = slices;
    mixed[0].clone_from(&turned[0]);
    let fault = volume(&mixed).unwrap_err();
    assert!(matches!(fault, ScannerError::Stack { fault: StackFault::Differ { .. }, .. }), "{fault}");
}

#[test]
fn paravision_that_lies_is_a_typed_error() {
    let folder = tempfile::tempdir().unwrap();
    let volume = Stored {
        size: [6, 5, 4],
        edges: [1.0, 2.0, 3.0],
        directions: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        origin: [0.0; 3],
        values: (0..120).collect(),
    };
    let storage = Storage {
        is_flat: true,
        has_volumes_first: false,
        is_big_endian: false,
        word: "_16BIT_SGN_INT",
        slope: 1.0,
        offset: 0.0,
    };
    paravision::write(folder.path(), 1, &[volume], storage);
    let place = |name: &str| folder.path().join("1/pdata/1").join(name);
    let visu = std::fs::read_to_string(place("visu_pars")).unwrap();
    let data = std::fs::read(place("2dseq")).unwrap();
    let limit = MemoryLimit { reading_bytes: 1 << 16, ..MemoryLimit::command() };
    let paths = files_below(folder.path()).unwrap();
    let open = || {
        let memory = limit.begin();
        ParavisionStudy::open(&paths, &memory)?.volume("1/1", 1, &memory)
    };
    assert_eq!(open().unwrap().values[119], 119.0);
    let with = |from: &str, to: &str| {
        assert!(visu.contains(from), "{from}");
        std::fs::write(place("visu_pars"), visu.replace(from, to)).unwrap();
        open().unwrap_err()
    };
    for (from, to) in [
        ("VisuCoreFrameCount=4", "VisuCoreFrameCount=400000"),
        ("VisuCoreSize=( 2 )\n6 5", "VisuCoreSize=( 2 )\n1000000 1000000"),
    ] {
        let error = with(from, to);
        assert!(matches!(error, ScannerError::CutShort { .. }), "{error}");
    }
    let error = with("@4*(0)", "@999999999*(0)");
    assert!(matches!(error, ScannerError::Memory(_)), "{error}");
    for (from, to) in [
        ("VisuCoreFrameCount=4", "VisuCoreFrameCount=2"),
        ("VisuCoreFrameCount=4", "VisuCoreFrameCount=-4"),
        ("(4, <FG_SLICE>", "(3, <FG_SLICE>"),
        ("_16BIT_SGN_INT", "_64BIT_FLOAT"),
        ("littleEndian", "middleEndian"),
        ("disk_normal_slice_order", "disk_reverse_slice_order"),
        ("<mm> <mm>", "<mm> <Hz>"),
        ("VisuCoreExtent=( 2 )\n6 10", "VisuCoreExtent=( 2 )\n6"),
        ("VisuCoreDataSlope=( 4 )\n1 1 1 1", "VisuCoreDataSlope=( 4 )\n1 1 1"),
        ("##$VisuCorePosition=( 4, 3 )\n0 0 0", "##$VisuCorePosition=( 4, 3 )\n0 0"),
    ] {
        let error = with(from, to);
        assert!(matches!(error, ScannerError::Header { .. }), "{to}: {error}");
    }
    for (from, to) in [("littleEndian", "bigEndian"), ("1 0 0 0 1 0 0 0 1 1 0 0", "1 0 0 0 1 0 0 0 1 0 1 0")] {
        let error = with(from, to);
        assert!(matches!(error, ScannerError::Stack { fault: StackFault::Differ { .. }, .. }), "{to}: {error}");
    }
    // Headers that are cut short anywhere.
    for length in (0..visu.len()).step_by(7) {
        std::fs::write(place("visu_pars"), &visu[..length]).unwrap();
        let _ = open();
    }
    std::fs::write(place("visu_pars"), &visu).unwrap();
    std::fs::write(place("2dseq"), &data[..data.len() - 1]).unwrap();
    assert!(matches!(open().unwrap_err(), ScannerError::CutShort { .. }));
    let without: Vec<PathBuf> = paths.iter().filter(|p| !p.ends_with("visu_pars")).cloned().collect();
    let error = ParavisionStudy::open(&without, &limit.begin()).err().unwrap();
    assert!(matches!(error, ScannerError::NoImage { what: "visu_pars", .. }), "{error}");
}

fn lambdak(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lambdak"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(arguments)
        .output()
        .unwrap()
}

/// The command: which series there are, displacements within the steps of the stored phases, forces of the loading
/// history, and a calibration of what was imported.
#[test]
fn an_import_is_calibrated() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let (scan, unwrapped) = scanned(folder.path());
    write_single_frames(&scan, &folder.path().join("images"), POSES[3]);
    std::fs::write(folder.path().join("series.json"), series_map(&scan, by_number).to_string()).unwrap();
    let (images, series, out) = (place("images"), place("series.json"), place("imported"));
    let specimen = ["--specimen", "geometries/solid-shear.json", "--form", "dicom"];
    let listed = lambdak(&[&["import", &images, "--out", &out], &specimen[..]].concat());
    let message = String::from_utf8_lossy(&listed.stderr).into_owned();
    assert_eq!(listed.status.code(), Some(2));
    assert!(message.contains("4 \"pc3d\": ") && message.contains("ORIGINAL\\PRIMARY\\M"), "{message}");
    let load = place("raw/load.csv");
    let arguments = ["import", &images, "--series", &series, "--load", &load, "--json", "--out", &out];
    let done = lambdak(&[&arguments[..], &specimen[..]].concat());
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let found = Recording::read(Path::new(&out), &ReadLimits::default()).unwrap();
    let (mut num_both, mut num_one) = (0, 0);
    for (n, (a, b)) in unwrapped.steps.iter().zip(&found.steps).enumerate() {
        for v in (0..scan.mask.len()).filter(|&v| scan.mask[v]) {
            for c in 0..3 {
                let (a, b) = (a.displacement[v][c], b.displacement[v][c]);
                if a.is_finite() != b.is_finite() {
                    num_one += 1;
                } else if a.is_finite() {
                    num_both += 1;
                    let tolerance = HALF_STEP * scan.steps[n].mm_per_radian[c] + 1e-6;
                    assert!((a - b).abs() <= tolerance, "step {n}, voxel {v}, component {c}: {a} and {b} mm");
                }
            }
        }
        // The hold is longer than the scan's window by its settling: means of 120 and 88 readings of 0.01 N each.
        let (told, read) = (a.force_n.unwrap(), b.force_n.unwrap());
        assert!((told - read).abs() < 4.0 * 0.01 * (1.0f64 / 88.0 + 1.0 / 120.0).sqrt(), "{told} and {read} N");
    }
    // Voxels at the brink of being kept may be left out by one of the ways.
    assert!(num_both > 1000 && num_one * 100 <= num_both, "{num_both} and {num_one}");
    let fit = place("fit");
    let arguments =
        ["calibrate", &out, "--terms", "1", "--mesh", "4", "--one-mesh", "--starts", "1", "--json", "--out", &fit];
    let done = lambdak(&arguments);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let result: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    let alpha = result["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "alpha_1").unwrap();
    assert!(alpha["value"].as_f64().is_some_and(f64::is_finite), "{alpha}");
    assert!(result["loss_f"].as_f64().is_some_and(|loss| loss > 0.0), "the forces were fitted");
    // Phases as they are, in a recording of their own, which the next import unwraps.
    let raw = place("raw-imported");
    let arguments = ["import", &images, "--series", &series, "--raw", "--load", &load, "--out", &raw];
    assert!(lambdak(&[&arguments[..], &specimen[..]].concat()).status.success());
    let kept = RawRecording::read(Path::new(&raw), &ReadLimits::default()).unwrap();
    assert_comes_back(&scan, &kept);
    assert!(kept.steps.iter().all(|s| s.force_n.is_some()));
    let again = place("again");
    assert!(lambdak(&["import", &raw, "--out", &again]).status.success());
    let again = Recording::read(Path::new(&again), &ReadLimits::default()).unwrap();
    assert_eq!(again.num_voxels(), found.num_voxels());
    // A range that does not hold the values, and drives at two places.
    for more in [["--phase-range", "0,100"], ["--drive", "1,2"]] {
        let refused =
            lambdak(&[&["import", &images, "--series", &series, "--out", &fit], &specimen[..], &more].concat());
        assert_eq!(refused.status.code(), Some(2), "{}", String::from_utf8_lossy(&refused.stderr));
    }
}
