//! The Python client and its example run against the service.

mod service_common;

use service_common::Service;
use std::process::Command;

#[test]
fn python_example_runs() {
    if !Command::new("python3").arg("--version").output().is_ok_and(|o| o.status.success()) {
        eprintln!("skipped: python_example_runs needs python3");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &[]);
    let out = Command::new("python3")
        .arg("-B")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/api/python/example.py"))
        .arg(format!("http://{}", service.address))
        .output()
        .unwrap();
    let (text, errors) = (String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
    assert!(out.status.success(), "{text}\n{errors}");
    for part in ["gain of the best over the base", "verdict:", "residual-after_1.nii.gz", "misfit_1_2.nii.gz"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    eprintln!("{text}");
}
