//! A service whose disk fills up.

#[path = "common/prerequisites.rs"]
mod prerequisites;
mod service_common;

use prerequisites::{Missing, Prerequisite};
use service_common::Service;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// Unmounts when dropped.
struct Mounted<'a>(&'a Path);

impl Drop for Mounted<'_> {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("--lazy").arg(self.0).status();
    }
}

/// It is not ready, says why, and lives; when there is room again it is ready again.
fn a_full_disk_is_not_ready() -> Result<(), Missing> {
    let folder = tempfile::tempdir().unwrap();
    let small = folder.path().join("small");
    std::fs::create_dir(&small).unwrap();
    let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", "size=4m", "tmpfs"]).arg(&small).output();
    if !mounted.is_ok_and(|o| o.status.success()) {
        return Err(Missing::new(Prerequisite::Mount, "a small tmpfs cannot be mounted: that needs root on Linux"));
    }
    let _mounted = Mounted(&small);
    let service = Service::start(&small.join("data"), &["--slots", "0"]);
    assert_eq!(service.get("/readyz").status, 200);
    let filler = small.join("filler");
    // As much as fits.
    assert!(std::fs::write(&filler, vec![1; 8 << 20]).is_err());
    let until = |status: u16| {
        let begin = Instant::now();
        loop {
            let reply = service.get("/readyz");
            if reply.status == status {
                return reply;
            }
            assert!(begin.elapsed() < Duration::from_secs(30), "{reply:?}");
            std::thread::sleep(Duration::from_millis(500));
        }
    };
    let full = until(503);
    assert_eq!(full.cause(), "storage");
    assert!(full.json()["detail"].as_str().unwrap().contains("disk is full"));
    assert_eq!(service.get("/healthz").status, 200);
    std::fs::remove_file(&filler).unwrap();
    until(200);
    Ok(())
}

prerequisites::test_binary!(a_full_disk_is_not_ready);
