//! A sweep on a file system that fills up.

#[path = "common/prerequisites.rs"]
mod prerequisites;
mod sweep_common;

use prerequisites::{Missing, Prerequisite};
use std::process::Command;
use sweep_common::*;

/// On a file system that fills up: a clear error, the results before it kept, and after making room the same table.
fn a_full_disk_loses_nothing() -> Result<(), Missing> {
    let folder = tempfile::tempdir().expect("a folder");
    let small = folder.path().join("small");
    std::fs::create_dir(&small).expect("writable");
    let mount = |options: &str| {
        let run = Command::new("mount").args(["-t", "tmpfs", "-o", options, "tmpfs"]).arg(&small).output();
        run.is_ok_and(|o| o.status.success())
    };
    if !mount("size=24k") {
        return Err(Missing::new(Prerequisite::Mount, "a small tmpfs cannot be mounted: that needs root on Linux"));
    }
    let study = write_study(folder.path(), 12, 3);
    let (out, whole) = (small.join("out"), folder.path().join("whole"));
    let full = sweep(&study, &out, &[]);
    let kept = num_lines(&out);
    let resized = mount("remount,size=16m");
    let again = sweep(&study, &out, &[]);
    let undisturbed = sweep(&study, &whole, &[]);
    let all: Vec<_> = if again.status.success() { tables(&out) } else { Vec::new() };
    let unmounted = Command::new("umount").arg(&small).status();
    let message = String::from_utf8_lossy(&full.stderr).into_owned();
    assert_eq!(full.status.code(), Some(4), "{message}");
    assert!(message.contains("cannot write") && message.contains("are kept"), "{message}");
    assert!(kept >= 2, "{kept} lines were kept");
    assert!(resized && unmounted.is_ok_and(|s| s.success()));
    assert_success(&again);
    assert!(String::from_utf8_lossy(&again.stderr).contains("resuming"));
    assert_success(&undisturbed);
    assert_eq!(all, tables(&whole));
    Ok(())
}

prerequisites::test_binary!(a_full_disk_loses_nothing);
