//! A sweep killed and resumed, in shards, or undisturbed leaves the same tables to the byte; bad input loses nothing.

mod sweep_common;

use std::time::Duration;
use sweep_common::*;

const DESIGNS: usize = 16;

/// A small generator (splitmix64): where the kills fall.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[test]
fn killed_resumed_sharded_and_undisturbed_runs_agree() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = write_study(folder.path(), DESIGNS, 7);
    let whole = folder.path().join("whole");
    assert_success(&sweep(&study, &whole, &[]));

    // One thread and two, killed at random moments after one to three further results.
    let killed = folder.path().join("killed");
    let (mut state, mut kills) = (11, 0);
    loop {
        let before = num_lines(&killed);
        let more = before + 1 + (random(&mut state) % 3) as usize;
        let mut child = start(&study, &killed, &["--threads", if kills % 2 == 0 { "2" } else { "1" }]);
        let status = loop {
            if let Some(status) = child.try_wait().expect("it can be asked") {
                break Some(status);
            }
            if num_lines(&killed) >= more {
                std::thread::sleep(Duration::from_millis(random(&mut state) % 120));
                child.kill().expect("SIGKILL");
                child.wait().expect("it ends");
                break None;
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        match status {
            Some(status) => {
                assert!(status.success());
                break;
            }
            None => kills += 1,
        }
        assert!(kills < 100, "it gets no further");
    }
    assert!(kills >= 3, "{kills} kills");
    assert_same_tables(&whole, &killed);
    // Each task exactly one line, and the header.
    assert_eq!(num_lines(&killed), DESIGNS + 1);

    // Four shards in two folders, merged into a third.
    let (a, b, merged) = (folder.path().join("a"), folder.path().join("b"), folder.path().join("merged"));
    for (index, out) in [(1, &a), (2, &b), (4, &b)] {
        assert_success(&sweep(&study, out, &["--shard", &format!("{index}/4")]));
    }
    let merge =
        || lambdak().args(["sweep", "merge"]).args([&a, &b]).arg("--out").arg(&merged).output().expect("it runs");
    let incomplete = merge();
    let message = String::from_utf8_lossy(&incomplete.stderr).into_owned();
    assert_eq!(incomplete.status.code(), Some(2), "{message}");
    assert!(message.contains("4 of 16 results are missing") && message.contains("--shard 3/4"), "{message}");
    assert_success(&sweep(&study, &a, &["--shard", "3/4"]));
    assert_success(&merge());
    assert_same_tables(&whole, &merged);
}

#[test]
fn a_changed_study_and_damaged_files_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = write_study(folder.path(), 2, 1);
    let out = folder.path().join("out");
    assert_success(&sweep(&study, &out, &[]));
    let before = tables(&out);
    let refused = |code: i32, expected: &str, output: std::process::Output| {
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{message}");
        assert!(message.contains(expected), "{message}");
    };
    let changed = write_study(folder.path(), 2, 2);
    refused(2, "belongs to another study", sweep(&changed, &out, &[]));
    let shard = out.join("shard-1-of-1.jsonl");
    let text = std::fs::read_to_string(&shard).expect("readable");
    std::fs::write(&shard, text.replacen("\"task\":", "\"tusk\":", 1)).expect("writable");
    refused(2, "line 2 is damaged", sweep(&write_study(folder.path(), 2, 1), &out, &[]));
    std::fs::write(&shard, "not a shard\n").expect("writable");
    refused(2, "is not a shard", sweep(&write_study(folder.path(), 2, 1), &out, &[]));
    std::fs::write(&shard, text).expect("writable");
    assert_success(&sweep(&write_study(folder.path(), 2, 1), &out, &[]));
    assert_eq!(before, tables(&out));
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).expect("writable");
    std::fs::copy(out.join("study.json"), empty.join("study.json")).expect("writable");
    refused(2, "holds no shards", lambdak().args(["sweep", "merge"]).arg(&empty).output().expect("it runs"));
    refused(2, "'5/4' is not I/N", sweep(&study, &out, &["--shard", "5/4"]));
}
