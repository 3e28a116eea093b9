//! Displacement images on turned and mirrored grids, with vectors in every frame: the recording is always the same.

use super::*;
use crate::recording::nifti::INTENT_DISPLACEMENT;

/// A block of 8 × 4 × 6 mm.
fn specimen() -> Specimen {
    let text = r#"{ "schema": "specimen/1", "name": "block", "test": "double_lap_shear",
        "block": { "length_mm": 8.0, "thickness_mm": 4.0, "width_mm": 6.0 },
        "holes": [], "drive_mm": [1.0], "samples_in_parallel": 1 }"#;
    Specimen::from_json(text).unwrap()
}

/// A displacement without symmetries, mm, at a place (mm) in the specimen's frame.
fn displacement([x, y, z]: [f64; 3]) -> [f64; 3] {
    [0.1 * y + 0.01 * x, 0.02 * z - 0.005 * x * y, 0.03 * x + 0.001 * z * z]
}

const VOXEL: [f64; 3] = [1.0, 0.5, 1.5];
const SHAPE: [usize; 3] = [8, 8, 4];

/// The rotation by `angle` (rad) about `axis`.
fn rotation(axis: usize, angle: f64) -> [[f64; 3]; 3] {
    let (s, c) = angle.sin_cos();
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut r = [[0.0; 3]; 3];
    r[axis][axis] = 1.0;
    (r[a][a], r[b][b], r[a][b], r[b][a]) = (c, c, -s, s);
    r
}

fn times(r: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| (0..3).map(|j| r[i][j] * v[j]).sum())
}

fn memory() -> crate::file::ReadingMemory {
    crate::file::MemoryLimit::body(1 << 24).begin()
}

/// An image whose index i runs along `axes[i]` of the specimen, which lies in the scanner turned by `turn`.
fn image(axes: [IndexAxis; 3], turn: &[[f64; 3]; 3], frame: VectorFrame, intent: i16) -> NamedImage {
    let size = axes.map(|a| SHAPE[a.axis]);
    let unit = |i: usize| {
        let mut u = [0.0; 3];
        u[axes[i].axis] = if axes[i].is_reversed { -1.0 } else { 1.0 };
        u
    };
    let columns = [0, 1, 2].map(|i| times(turn, unit(i)).map(|x| x * VOXEL[axes[i].axis]));
    // Anywhere in the scanner: imports centre the sample.
    let affine = [0, 1, 2].map(|c| [columns[0][c], columns[1][c], columns[2][c], 17.0 * c as f64 - 5.0]);
    let n: usize = size.iter().product();
    let mut values = vec![0.0; 3 * n];
    for v in 0..n {
        let at = [v % size[0], v / size[0] % size[1], v / (size[0] * size[1])];
        let mut x = [0.0; 3];
        for i in 0..3 {
            let from_centre = at[i] as f64 - 0.5 * (size[i] as f64 - 1.0);
            let sign = if axes[i].is_reversed { -1.0 } else { 1.0 };
            x[axes[i].axis] = sign * from_centre * VOXEL[axes[i].axis];
        }
        let u = displacement(x);
        let ras = times(turn, u);
        let stored = match frame {
            VectorFrame::Ras => ras,
            VectorFrame::Lps => [-ras[0], -ras[1], ras[2]],
            VectorFrame::Index => [0, 1, 2].map(|i| {
                let sign = if axes[i].is_reversed { -1.0 } else { 1.0 };
                sign * u[axes[i].axis]
            }),
        };
        for c in 0..3 {
            values[c * n + v] = stored[c];
        }
    }
    let shape = [size[0], size[1], size[2], 1, 3];
    let image = Image { shape, affine, intent, values, unit_mm: Some(1.0) };
    NamedImage { path: "u.nii.gz".into(), image }
}

fn axes(text: &str) -> [IndexAxis; 3] {
    ImportOptions::parse_axes(text).unwrap()
}

fn check(recording: &Recording) {
    assert_eq!(recording.grid.shape, SHAPE);
    for (v, u) in recording.steps[0].displacement.iter().enumerate() {
        let n = recording.grid.indices(v);
        let x = [0, 1, 2].map(|a| (n[a] as f64 - 0.5 * (SHAPE[a] as f64 - 1.0)) * VOXEL[a]);
        let expected = displacement(x);
        // Rotations round.
        assert!((0..3).all(|c| (u[c] - expected[c]).abs() < 1e-12), "{n:?}: {u:?} {expected:?}");
    }
}

/// Every order and direction of indices, without and with the sample turned in the scanner, in all three frames.
#[test]
fn turned_and_mirrored_grids_give_the_same_recording() {
    let turns = [rotation(0, 0.0), rotation(2, 0.2), rotation(1, -0.35), rotation(0, 1.9)];
    for text in ["x,y,z", "-x,y,z", "y,z,x", "-z,-y,x", "z,-x,-y"] {
        let along = axes(text);
        for turn in &turns {
            for (frame, intent) in
                [(VectorFrame::Ras, INTENT_DISPLACEMENT), (VectorFrame::Lps, INTENT_VECTOR), (VectorFrame::Index, 0)]
            {
                let named = image(along, turn, frame, intent);
                let options = ImportOptions { axes: along, ..ImportOptions::default() };
                // The intent says the first two; nothing says the third.
                let given = (frame == VectorFrame::Index).then_some(frame);
                check(&recording_from_images(&[named], &specimen(), given, &options, &memory()).unwrap());
            }
        }
    }
}

/// Where the scanner's axes are nearly the specimen's, the affine says which index runs along which.
#[test]
fn axes_follow_from_the_affine() {
    for text in ["x,y,z", "-x,-y,z", "y,z,x", "-z,y,-x"] {
        for turn in [rotation(0, 0.0), rotation(2, 0.2)] {
            let named = image(axes(text), &turn, VectorFrame::Ras, INTENT_DISPLACEMENT);
            assert_eq!(axes_of_affine(&named).unwrap(), axes(text), "{text}");
        }
    }
}

/// Zeros or no numbers around the sample, as registration programs write them, are no part of it: the box that is
/// centred is the sample's.
#[test]
fn zeros_around_the_sample_are_a_mask() {
    let inner = image(axes("x,y,z"), &rotation(0, 0.0), VectorFrame::Ras, INTENT_DISPLACEMENT);
    let options = ImportOptions { axes: axes("x,y,z"), ..ImportOptions::default() };
    for around in [0.0, f64::NAN] {
        // One layer of voxels before and three behind along the length, two behind along the thickness.
        let (before, shape) = (1, [SHAPE[0] + 4, SHAPE[1] + 2, SHAPE[2]]);
        let (n, large) = (SHAPE.iter().product::<usize>(), shape.iter().product::<usize>());
        let mut values = vec![around; 3 * large];
        for v in 0..n {
            let at = [v % SHAPE[0], v / SHAPE[0] % SHAPE[1], v / (SHAPE[0] * SHAPE[1])];
            for c in 0..3 {
                values[c * large + at[0] + before + shape[0] * (at[1] + shape[1] * at[2])] =
                    inner.image.values[c * n + v];
            }
        }
        let image = Image { shape: [shape[0], shape[1], shape[2], 1, 3], values, ..inner.image.clone() };
        let named = NamedImage { path: "u.nii.gz".into(), image };
        check(&recording_from_images(&[named], &specimen(), None, &options, &memory()).unwrap());
    }
}

#[test]
fn masks_and_times_are_read_and_other_grids_refused() {
    let plain = rotation(0, 0.0);
    let along = axes("x,y,z");
    let options = ImportOptions { axes: along, drive_mm: vec![0.5, 1.0], ..ImportOptions::default() };
    let one = image(along, &plain, VectorFrame::Ras, INTENT_DISPLACEMENT);
    let n: usize = SHAPE.iter().product();
    // Two times: half the displacement, then all of it.
    let mut two = NamedImage { path: "u.nii".into(), image: one.image.clone() };
    two.image.shape[3] = 2;
    two.image.values =
        one.image.values.chunks(n).flat_map(|c| c.iter().map(|u| 0.5 * u).chain(c.iter().copied())).collect();
    let scalar = Image { shape: [8, 8, 4, 1, 1], values: vec![1.0; n], intent: 0, ..one.image.clone() };
    let mask = NamedImage { path: "mask.nii".into(), image: scalar };
    let recording = recording_from_images(&[two, mask], &specimen(), None, &options, &memory()).unwrap();
    let [half, whole] = [0, 1].map(|s| recording.steps[s].displacement[100][0]);
    assert!((whole - 2.0 * half).abs() < 1e-15 && half.abs() > 1e-3);
    // FSL keeps the components in the place of times.
    let mut fsl = NamedImage { path: "u.nii".into(), image: one.image.clone() };
    fsl.image.shape = [8, 8, 4, 3, 1];
    let one_drive = ImportOptions { drive_mm: vec![1.0], ..options.clone() };
    check(&recording_from_images(&[fsl], &specimen(), None, &one_drive, &memory()).unwrap());
    let mut other = image(along, &plain, VectorFrame::Ras, 0);
    other.image.affine[0][0] *= 1.01;
    let error = recording_from_images(&[one, other], &specimen(), None, &options, &memory()).unwrap_err();
    assert!(error.to_string().contains("resample"), "{error}");
    let mut sheared = image(along, &plain, VectorFrame::Ras, 0);
    sheared.image.affine[0][1] = 0.1;
    let error = recording_from_images(&[sheared], &specimen(), None, &options, &memory()).unwrap_err();
    assert!(error.to_string().contains("shears"), "{error}");
    let mut two_components = image(along, &plain, VectorFrame::Ras, 0);
    two_components.image.shape[4] = 2;
    let error = recording_from_images(&[two_components], &specimen(), None, &options, &memory()).unwrap_err();
    assert!(error.to_string().contains("shape"), "{error}");
}
