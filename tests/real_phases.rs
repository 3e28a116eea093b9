//! Real raw recordings, where they are at hand: `LAMBDAK_REAL_DATA` names the folder that holds `mru`.

#[path = "common/prerequisites.rs"]
mod prerequisites;

use lambdak::acquisition::{ReconstructOptions, reconstruct, unwrap};
use lambdak::recording::{Image, RawRecording, ReadLimits, Recording};
use prerequisites::Missing;

/// The unwrapped phases give the displacements published beside them, up to one constant per component (the publication
/// moved the fixed face to zero), but for few voxels, nearly all of them marked there as unreliable.
fn real_phases_give_the_published_displacements() -> Result<(), Missing> {
    for name in ["solid-5mm-a", "solid-5mm-b"] {
        let path = prerequisites::real_data(&format!("mru/{name}"))?;
        let raw = RawRecording::read(&path.join("recording-raw.json"), &ReadLimits::default()).unwrap();
        let reliable = std::fs::File::open(path.join("mask_reliable.nii.gz")).unwrap();
        let reliable = Image::read(reliable, &lambdak::file::MemoryLimit::command().begin()).unwrap().values;
        let published = Recording::read(&path, &ReadLimits::default()).unwrap();
        let methods = [unwrap::Method::Margin, unwrap::Method::SecondDifference, unwrap::Method::LeastSquares];
        for (method, needs_agreement) in methods.iter().flat_map(|m| [(*m, false), (*m, true)]) {
            let options = ReconstructOptions {
                unwrap: unwrap::UnwrapOptions { method, needs_agreement, ..unwrap::UnwrapOptions::default() },
                ..ReconstructOptions::default()
            };
            let found = reconstruct(&raw, &options).unwrap();
            for axis in 0..3 {
                let turn = std::f64::consts::TAU * raw.steps[0].mm_per_radian[axis];
                let all: Vec<f64> = found.recording.steps[0]
                    .displacement
                    .iter()
                    .zip(&published.steps[0].displacement)
                    .map(|(a, b)| a[axis] - b[axis])
                    .collect();
                let mut differences: Vec<f64> = all.iter().copied().filter(|d| d.is_finite()).collect();
                differences.sort_by(f64::total_cmp);
                let constant = differences[differences.len() / 2];
                let num_off = differences.iter().filter(|d| (*d - constant).abs() > 0.5 * turn).count();
                let is_reliable_and_off = |(d, r): &(&f64, &f64)| **r > 0.5 && (*d - constant).abs() > 0.5 * turn;
                let num_reliable_off = all.iter().zip(&reliable).filter(is_reliable_and_off).count();
                let rms = |worst: f64| {
                    let near: Vec<f64> = differences.iter().map(|d| d - constant).filter(|d| d.abs() < worst).collect();
                    (near.iter().map(|d| d * d).sum::<f64>() / near.len() as f64).sqrt()
                };
                let c = &found.steps[0].components[axis];
                eprintln!(
                    "{name} {method:?} agreement {needs_agreement} {}: kept {} of {} (low {}, disputed {}, inconsistent {}, unconnected {}); constant {constant:.4} mm; \
                     {num_off} voxels a turn off, {num_reliable_off} of them called reliable; the others rms {:.1e} mm; noise {:.4} mm (published {:?})",
                    ["x", "y", "z"][axis],
                    c.num_kept,
                    c.num_voxels,
                    c.num_low_signal,
                    c.num_disputed,
                    c.num_inconsistent,
                    c.num_unconnected,
                    rms(0.5 * turn),
                    c.median_sd_mm,
                    published.noise_sd_mm.map(|sd| sd[axis]),
                );
                // The files store displacements in single precision, some to 10⁻⁴ mm.
                assert!(rms(0.5 * turn) < 1e-3);
                // The publication's own unwrapping is not a truth where it calls itself unreliable.
                assert!(num_reliable_off <= differences.len() / 500, "{num_reliable_off} of {}", differences.len());
                assert!(c.num_kept as f64 > 0.8 * c.num_voxels as f64);
            }
        }
    }
    Ok(())
}

prerequisites::test_binary!(real_phases_give_the_published_displacements);
