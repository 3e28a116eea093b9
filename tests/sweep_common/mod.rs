//! What the sweep tests share: a small study, running the real binary, comparing tables.

#![allow(dead_code)] // Each test binary uses a part.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// The command under test.
pub fn lambdak() -> Command {
    Command::new(env!("CARGO_BIN_EXE_lambdak"))
}

/// A study of `count` designs on the coarsest mesh; every fifth or so cannot be made.
pub fn write_study(folder: &Path, count: usize, seed: u64) -> PathBuf {
    let study = serde_json::json!({
        "schema": "sweep-study/1",
        "name": "small sweep",
        "base": {
            "schema": "specimen/1", "name": "one hole", "test": "double_lap_shear",
            "block": { "length_mm": 12.0, "thickness_mm": 6.0, "width_mm": 10.0 },
            "holes": [{ "axis": "thickness", "center_mm": [0.0, 0.0], "diameter_mm": 3.0 }],
            "drive_mm": [1.0, 2.0]
        },
        "materials": [{
            "name": "soft",
            "material": { "schema": "ogden/1", "bulk_kpa": 2173.0, "terms": [{ "mu_kpa": 17.0, "alpha": 1.91 }] }
        }],
        "scan": { "voxel_mm": [1.0, 1.0, 1.0], "noise_sd_mm": [0.05, 0.05, 0.05], "force_sd_n": 0.02 },
        "variables": [
            { "name": "diameter_mm", "sets": ["holes[0].diameter_mm"], "range": { "min": 1.5, "max": 6.0 } },
            { "name": "offset_mm", "sets": ["holes[0].x_mm"], "range": { "min": 0.0, "max": 4.0 } }
        ],
        "sampling": { "kind": "latin_hypercube", "count": count },
        "mesh": 3.0,
        "seed": seed
    });
    let path = folder.join("study.json");
    std::fs::write(&path, study.to_string()).expect("writable");
    path
}

/// Runs `lambdak sweep STUDY --out OUT …` to its end.
pub fn sweep(study: &Path, out: &Path, more: &[&str]) -> Output {
    lambdak().arg("sweep").arg(study).arg("--out").arg(out).args(more).output().expect("the binary runs")
}

/// Starts it.
pub fn start(study: &Path, out: &Path, more: &[&str]) -> Child {
    lambdak()
        .arg("sweep")
        .arg(study)
        .arg("--out")
        .arg(out)
        .args(more)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the binary runs")
}

pub fn assert_success(output: &Output) {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Bytes of the tables and of the result.
pub fn tables(out: &Path) -> Vec<Vec<u8>> {
    ["table.csv", "table.parquet", "sweep.json", "report.html"]
        .iter()
        .map(|name| std::fs::read(out.join(name)).unwrap_or_else(|e| panic!("{name}: {e}")))
        .collect()
}

/// Panics unless all tables and results are the same to the byte.
pub fn assert_same_tables(a: &Path, b: &Path) {
    for (index, (x, y)) in tables(a).iter().zip(tables(b)).enumerate() {
        assert!(*x == y, "file {index} differs between {} and {}", a.display(), b.display());
    }
}

/// Whole lines of all shards' files, headers included.
pub fn num_lines(out: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(out) else { return 0 };
    entries
        .flatten()
        .filter(|e| e.file_name().to_string_lossy().starts_with("shard-"))
        .map(|e| std::fs::read(e.path()).map_or(0, |b| b.iter().filter(|c| **c == b'\n').count()))
        .sum()
}
