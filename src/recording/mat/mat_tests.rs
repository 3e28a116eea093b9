use super::*;
use crate::file::MemoryLimit;
use std::path::PathBuf;

/// Files written by SciPy and h5py: see `make.py` beside them.
fn file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/import").join(name)
}

fn find<'a>(variables: &'a [(String, MatValue)], name: &str) -> &'a MatValue {
    &variables.iter().find(|(n, _)| n == name).unwrap().1
}

/// Reads within memory of so many bytes.
fn read_mat(path: &Path, bytes: u64) -> Result<Vec<(String, MatValue)>, MatError> {
    super::read_mat(path, &MemoryLimit::body(bytes).begin())
}

/// The same variables from versions 5, 7 (compressed) and 7.3.
#[test]
fn all_versions_hold_the_same() {
    for name in ["v5.mat", "v7.mat", "v73.mat"] {
        let variables = read_mat(&file(name), 1_000_000).unwrap();
        let steps = find(&variables, "U_t").members().unwrap();
        assert_eq!(steps.len(), 2, "{name}");
        for (s, step) in steps.iter().enumerate() {
            let components = step.members().unwrap();
            assert_eq!(components.len(), 3);
            let (dims, values) = components[2].numbers().unwrap();
            assert_eq!(dims, [6, 4, 5], "{name}");
            for (n, value) in values.iter().enumerate() {
                let (i, k) = ((n % 6) as f64, (n / 24) as f64);
                // The same sums in double precision, in another order.
                assert!((value - (0.05 * i + 0.003 * k + (s + 1) as f64)).abs() < 1e-14, "{name} {n}");
            }
        }
        let (_, mask) = find(&variables, "mask").numbers().unwrap();
        assert_eq!(mask.iter().filter(|m| m.is_nan()).count(), 1);
        assert_eq!(find(&variables, "osc").numbers().unwrap().1, [1.0666, 4.775, 5.08]);
        assert_eq!(find(&variables, "text"), &MatValue::Text("Grüße".into()), "{name}");
        let MatValue::Numeric { values, imaginary, .. } = find(&variables, "complex") else { panic!("{name}") };
        assert_eq!((&values[..], imaginary.as_deref()), (&[1.0, 3.0][..], Some(&[2.0, -4.0][..])));
        let MatValue::Struct(fields) = find(&variables, "info") else { panic!("{name}") };
        assert_eq!(find(fields, "lambda").numbers().unwrap().1, [1.0; 3]);
        assert_eq!(find(fields, "empty").numbers().unwrap().1.len(), 0);
        if name != "v73.mat" {
            assert_eq!(find(&variables, "small").numbers().unwrap().1, [1.0, -2.0]);
            assert_eq!(find(&variables, "flags").numbers().unwrap().1, [1.0, 0.0]);
        }
    }
}

/// Every file cut anywhere, or with a byte changed, is an error or a file with other content, never a panic.
#[test]
fn damaged_files_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.mat");
    for name in ["v5.mat", "v7.mat", "v73.mat"] {
        let whole = std::fs::read(file(name)).unwrap();
        let half = whole.len() / 2;
        std::fs::write(&path, &whole[..half]).unwrap();
        assert!(read_mat(&path, 1_000_000).is_err(), "{name}");
        for n in 0..60 {
            let mut bytes = whole.clone();
            let at = n * 7919 % bytes.len();
            bytes[at] ^= 0x55;
            std::fs::write(&path, &bytes).unwrap();
            let _ = read_mat(&path, 1_000_000);
        }
    }
    for bytes in [&b""[..], &b"not a file of MATLAB"[..], &[0u8; 400][..]] {
        std::fs::write(&path, bytes).unwrap();
        assert!(matches!(read_mat(&path, 10), Err(MatError::NotMat)));
    }
    assert!(matches!(read_mat(&folder.path().join("none.mat"), 10), Err(MatError::Io(_))));
}

/// A compressed variable that promises, or holds, more than allowed ends before it is expanded.
#[test]
fn bombs_are_refused() {
    use flate2::{Compression, write::ZlibEncoder};
    use std::io::Write;
    let bomb = |promised: u32, zeros: usize| {
        let mut inner = ZlibEncoder::new(Vec::new(), Compression::best());
        inner.write_all(&14u32.to_le_bytes()).unwrap();
        inner.write_all(&promised.to_le_bytes()).unwrap();
        inner.write_all(&vec![0; zeros]).unwrap();
        let inner = inner.finish().unwrap();
        let mut bytes = vec![b' '; 124];
        bytes.extend_from_slice(&[0, 1, b'I', b'M']);
        bytes.extend_from_slice(&15u32.to_le_bytes());
        bytes.extend_from_slice(&(inner.len() as u32).to_le_bytes());
        bytes.extend_from_slice(&inner);
        bytes
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.mat");
    std::fs::write(&path, bomb(4_000_000_000, 20_000_000)).unwrap();
    assert!(matches!(read_mat(&path, 10_000), Err(MatError::Memory(_))));
    // Promises little: the rest of the stream is not expanded.
    std::fs::write(&path, bomb(64, 20_000_000)).unwrap();
    assert!(read_mat(&path, 10_000).is_err());
    // Numbers of several variables add up.
    assert!(matches!(read_mat(&file("v73.mat"), 4000), Err(MatError::Memory(_))));
}

/// An array whose sizes ask for more bytes than a number of 64 bits can count is damaged.
#[test]
fn sizes_beyond_counting_are_errors() {
    let element = |kind: u32, content: &[u8]| {
        let head = [kind.to_le_bytes(), (content.len() as u32).to_le_bytes()].concat();
        [&head[..], content, &vec![0; content.len().next_multiple_of(8) - content.len()]].concat()
    };
    let (double, sizes) =
        ([6u32, 0].map(u32::to_le_bytes).concat(), [1u32 << 31, 1 << 30].map(u32::to_le_bytes).concat());
    let parts = [element(6, &double), element(6, &sizes), element(1, b"u"), element(9, &1.0f64.to_le_bytes())];
    let mut bytes = vec![b' '; 124];
    bytes.extend_from_slice(&[0, 1, b'I', b'M']);
    bytes.extend(element(14, &parts.concat()));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.mat");
    std::fs::write(&path, bytes).unwrap();
    assert!(matches!(read_mat(&path, 10_000), Err(MatError::Damaged { .. })));
}
