//! Times whole calibrations of the two-hole double-lap shear specimen at 5 mm: from a blind start to the converged
//! estimate, model and voxel operator included. `cargo bench --bench calibration`.
//!
//! The data come from a finer mesh, with noise of 0.05 mm and 0.02 N. The meshes are chosen by the force's error
//! against the limit 10.462 N (two samples, independent reference): about 1.2 %, that of 18 thousand unknowns of
//! quadratic tetrahedra, and a mesh of 18 thousand unknowns. CPU seconds of this thread.

use lambdak::calibration::{CalibrationProblem, FitOptions, Objective, Observed, SyntheticScan};
use lambdak::fem::SolveOptions;
use lambdak::material::Material;
use lambdak::mesh::MeshOptions;
use lambdak::recording::Filter;
use lambdak::sensitivity::ScanSettings;
use lambdak::specimen::Specimen;

/// CPU seconds of this thread so far; wall time where the system does not say.
fn cpu_seconds(begin: std::time::Instant) -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    match text.split_whitespace().next().and_then(|t| t.parse::<f64>().ok()) {
        Some(nanoseconds) => nanoseconds * 1e-9,
        None => begin.elapsed().as_secs_f64(),
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let begin = std::time::Instant::now();
    let mut specimen = Specimen::from_json(include_str!("../geometries/two-hole-shear.json"))?;
    specimen.drive_mm = vec![5.0];
    let scan = ScanSettings::default();
    let never = || false;
    let cases = [
        ("one term", include_str!("../geometries/materials/ecoflex-0020.json"), 37.0, 50.0),
        ("two terms", include_str!("../geometries/materials/ecoflex-0020-two-term.json"), 137.0, 100.0),
    ];
    for (name, text, other_seconds, wanted) in cases {
        let truth = Material::from_json(text)?;
        let fine = MeshOptions { grading: 0.4, ..MeshOptions::scaled(&specimen, 0.7) };
        let synthetic = SyntheticScan::new(
            &specimen,
            &truth,
            &scan,
            &lambdak::sensitivity::Protocol::default(),
            &fine,
            &SolveOptions::default(),
            &never,
        )?;
        let recording = synthetic.recording("bench", &specimen, &synthetic.draw(1, 0), Filter::None)?;
        let observed = [Observed::new(&recording, scan.force_sd_n)?];
        // 30 % off in every parameter.
        let mut start = truth.clone();
        start.bulk_kpa *= 2.0;
        for (n, term) in start.terms.iter_mut().enumerate() {
            let sign = if n % 2 == 0 { 0.3 } else { -0.3 };
            term.mu_kpa *= 1.0 + sign;
            term.alpha *= 1.0 - sign;
        }
        println!("{name}: other tools {other_seconds} CPU s, wanted 1/{wanted}: {:.3} s", other_seconds / wanted);
        for (mesh_name, mesh) in [
            ("search, mirrored", MeshOptions::search(&specimen)),
            ("1.5, mirrored", MeshOptions::scaled(&specimen, 1.5)),
            ("1.2, mirrored", MeshOptions::scaled(&specimen, 1.2)),
            ("1.2, whole specimen", MeshOptions { use_mirror: false, ..MeshOptions::scaled(&specimen, 1.2) }),
        ] {
            let at_start = cpu_seconds(begin);
            let problem = CalibrationProblem::new(&observed, &|_| mesh, Objective::Weighted)?;
            let prepared = cpu_seconds(begin);
            let fit = problem.fit(&start, None, &FitOptions::default(), &never)?;
            let done = cpu_seconds(begin);
            let mut truth_here = problem.force_at(&truth, &never)?;
            let force = truth_here.pop().and_then(|mut f| f.pop()).unwrap_or(f64::NAN);
            println!(
                "  {mesh_name:<20} {:>6} unknowns, force {:+.2} %: {:.3} s in all (1/{:.0}), {:.3} s of it mesh and voxels; \
                 {} iterations, {} equilibria, {} Newton iterations, {} factorisations; {}",
                problem.num_unknowns()[0],
                100.0 * (force / 10.462 - 1.0),
                done - at_start,
                other_seconds / (done - at_start),
                prepared - at_start,
                fit.iterations,
                fit.work.equilibria,
                fit.work.newton_iterations,
                fit.work.factorisations,
                if fit.is_converged { "converged" } else { "NOT converged" },
            );
        }
    }
    Ok(())
}
