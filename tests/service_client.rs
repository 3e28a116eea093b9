//! The Python client and its example run against the service.

#[path = "common/prerequisites.rs"]
mod prerequisites;
mod service_common;

use prerequisites::Missing;
use service_common::Service;
use std::process::Command;

fn python_example_runs() -> Result<(), Missing> {
    prerequisites::python()?;
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
    for part in ["gain of the best over the base", "verdict:", "residual_after_1.nii.gz", "misfit_1_2.nii.gz"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    eprintln!("{text}");
    Ok(())
}

prerequisites::test_binary!(python_example_runs);
