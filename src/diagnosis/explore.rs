use super::causes::registry;
use super::fit::*;
use super::laboratory::Laboratory;
use super::maps::*;
use super::metric::Metric;
use super::score::ScoreTest;
use crate::calibration::Observed;
use crate::material::Ogden;
use crate::mesh::MeshOptions;
use crate::recording::{ReadLimits, Recording};
use std::path::Path;
use std::time::Instant;

#[test]
#[ignore]
fn explore() {
    let folder = std::env::var("REC").unwrap();
    let f: f64 = std::env::var("MESH").ok().and_then(|v| v.parse().ok()).unwrap_or(1.7);
    let recording = Recording::read(Path::new(&folder), &ReadLimits::default()).unwrap();
    let observed = Observed::new(&recording, 0.02).unwrap();
    println!(
        "{} voxels {} outside {} noise {:?} {}",
        recording.id,
        observed.mask.num_voxels(),
        observed.num_outside,
        observed.noise_sd_mm,
        observed.is_noise_estimated
    );
    let mut lab = Laboratory::new(&observed, &MeshOptions::scaled(&observed.specimen, f)).unwrap();
    let largest = observed.steps.iter().map(|s| s.drive_mm).fold(0.0, f64::max);
    let allowance = 1e-3 * largest;
    let metric = Metric::new(&observed, allowance, &|_| true);
    let measured = lab.measured();
    let t = Instant::now();
    let settings =
        FitSettings { max_iterations: 20, bulk: BulkPrior { center_kpa: 2173.0, log_sd: 0.5 }, tolerance: 0.5 };
    let one =
        Ogden::from_json(r#"{"schema":"ogden/1","bulk_kpa":2173.0,"terms":[{"mu_kpa":15.0,"alpha":2.2}]}"#).unwrap();
    let a = fit(&mut lab, &metric, &measured, &one, &[], &settings, &|| false).unwrap();
    println!(
        "{} unknowns; one term {:?} deviance {:.1} of {} its {} rms {:.4} {:?}",
        lab.num_unknowns().unwrap(),
        a.material.terms,
        a.deviance,
        metric.num_data(),
        a.iterations,
        a.residual.rms_mm(),
        t.elapsed()
    );
    let mut best = a.clone();
    for (mu, alpha) in [(0.03, 8.0), (0.3, -3.0)] {
        let mut two = a.material.clone();
        two.terms
            .push(crate::material::OgdenTerm { mu_kpa: mu * a.material.terms[0].mu_kpa * f64::signum(alpha), alpha });
        match fit(&mut lab, &metric, &measured, &two, &[], &settings, &|| false) {
            Ok(b) => {
                println!("two terms {:?} deviance {:.1} its {}", b.material.terms, b.deviance, b.iterations);
                if b.deviance + 25.0 < best.deviance {
                    best = b;
                }
            }
            Err(e) => println!("two terms: {e}"),
        }
    }
    println!("force residual {:?} kappa {} {:?}", best.residual.force, best.material.bulk_kpa, t.elapsed());
    let columns = derivatives(&mut lab, &best.material, &[], &best.prediction).unwrap();
    let mut prior = vec![0.0; columns.len()];
    prior[0] = 4.0;
    let test = ScoreTest::new(&metric, &best.residual, &columns, &prior);
    let mut rows = Vec::new();
    for cause in registry(&observed.specimen, shear_modulus(&best.material)) {
        let mut directions = Vec::new();
        let supposed = vec![Supposed { cause: cause.clone(), values: cause.start() }];
        for (n, p) in cause.parameters().iter().enumerate() {
            if cause.name() == "fibre" && n > 0 {
                continue;
            }
            let path = |t: f64| {
                let mut s = supposed.clone();
                s[0].values[n] += t * p.scale;
                scene_of(&s)
            };
            let path: &dyn Fn(f64) -> super::scene::Scene = &path;
            directions.extend(
                lab.derivatives(&best.material, &Default::default(), &best.prediction, false, &[path], 0.02).unwrap(),
            );
        }
        let s = test.test(&directions);
        rows.push((
            s.explained,
            cause.description(),
            s.coefficients.iter().zip(cause.parameters()).map(|(c, p)| c * p.scale).collect::<Vec<_>>(),
            s.rms_mm,
        ));
    }
    println!("scores {:?}", t.elapsed());
    for moved in [true, false] {
        let (_, found) = debond_map(&mut lab, &best.material, &best.prediction, &test, moved).unwrap();
        if let Some((e, d)) = found {
            rows.push((e, format!("debond moved={moved}"), d.edges_mm.iter().flatten().copied().collect(), 0.0));
        }
    }
    println!("debond {:?}", t.elapsed());
    let (_, found) = inclusion_map(&mut lab, &best.material, &best.prediction, &test).unwrap();
    if let Some((e, d)) = found {
        use super::causes::Cause;
        rows.push((e, "inclusion".into(), d.start(), 0.0));
    }
    println!("inclusion {:?}", t.elapsed());
    for w in jumps(&observed, &best.residual) {
        println!("jump {} {:?} n {}", w.size_mm, w.location, w.voxels.len());
    }
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    for r in &rows {
        println!(
            "{:10.1}  {:.4} mm  {}  {:?}",
            r.0,
            r.3,
            r.1,
            r.2.iter().map(|x| (x * 1e4).round() / 1e4).take(8).collect::<Vec<_>>()
        );
    }
}

#[test]
#[ignore]
fn taylor() {
    let folder = std::env::var("REC").unwrap();
    let recording = Recording::read(Path::new(&folder), &ReadLimits::default()).unwrap();
    let observed = Observed::new(&recording, 0.02).unwrap();
    let mut lab = Laboratory::new(&observed, &MeshOptions::scaled(&observed.specimen, 3.0)).unwrap();
    let metric = Metric::new(&observed, 0.007, &|_| true);
    let measured = lab.measured();
    let one =
        Ogden::from_json(r#"{"schema":"ogden/1","bulk_kpa":2173.0,"terms":[{"mu_kpa":15.0,"alpha":2.2}]}"#).unwrap();
    let p = lab.predict(&one, &Default::default(), &|| false).unwrap();
    let d = derivatives(&mut lab, &one, &[], &p).unwrap();
    let r = metric.weigh(&measured.plus(-1.0, &p.trace));
    println!("deviance {}", metric.inner(&r, &r));
    for i in 0..3 {
        let w = metric.weigh(&d[i]);
        println!(
            "{i}: g {} h {} noise {} rms {} force {:?}",
            metric.inner(&w, &r),
            metric.inner(&w, &w),
            metric.noise_only(&d[i], &d[i]),
            d[i].rms_mm(),
            d[i].force
        );
        for t in [1e-2, 1e-3] {
            let mut m = one.clone();
            if i == 0 {
                m.bulk_kpa *= 1.0 + t;
            } else if i == 1 {
                m.terms[0].mu_kpa *= 1.0 + t;
            } else {
                m.terms[0].alpha *= 1.0 + t;
            }
            let q = lab.predict(&m, &Default::default(), &|| false).unwrap();
            let num = q.trace.plus(-1.0, &p.trace).scaled(1.0 / t);
            let diff = num.plus(-1.0, &d[i]);
            println!("   t {t}: error rms {} force {:?}", diff.rms_mm(), diff.force);
            let rr = metric.weigh(&measured.plus(-1.0, &q.trace));
            println!("   deviance slope {}", (metric.inner(&rr, &rr) - metric.inner(&r, &r)) / t / -2.0);
        }
    }
}

#[test]
#[ignore]
fn truth() {
    let folder = std::env::var("REC").unwrap();
    let recording = Recording::read(Path::new(&folder), &ReadLimits::default()).unwrap();
    let observed = Observed::new(&recording, 0.02).unwrap();
    let truth: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(format!("{folder}/truth.json")).unwrap()).unwrap();
    let material = Ogden::from_json(&truth["material"].to_string()).unwrap();
    for f in [3.0, 1.7, 1.35, 1.0, 0.7] {
        let mut lab = Laboratory::new(&observed, &MeshOptions::scaled(&observed.specimen, f)).unwrap();
        let measured = lab.measured();
        let p = lab.predict(&material, &Default::default(), &|| false).unwrap();
        let r = measured.plus(-1.0, &p.trace);
        print!("mesh {f}: force res {:?} ", r.force);
        for (n, s) in r.displacement.iter().enumerate() {
            for c in 0..3 {
                let ms: f64 = s.iter().map(|u| u[c] * u[c]).sum::<f64>() / s.len() as f64;
                print!(" s{n}c{c} {:.4}", ms.sqrt());
            }
        }
        println!();
        if f < 1.5 && f > 1.2 {
            // by distance from end and by y
            let mask = &observed.mask;
            for c in 0..3 {
                for k in 0..8 {
                    let (mut sum, mut n, mut m1) = (0.0, 0, 0.0);
                    for (v, u) in r.displacement[2].iter().enumerate() {
                        let x = mask.grid.center_mm(mask.voxels[v] as usize);
                        let b = ((x[1].abs() / 3.2 * 8.0) as usize).min(7);
                        if b == k {
                            sum += u[c] * u[c];
                            m1 += u[c];
                            n += 1;
                        }
                    }
                    print!(" |y|bin{k} c{c} rms {:.4} mean {:.4} n {n};", (sum / n as f64).sqrt(), m1 / n as f64);
                }
                println!();
            }
            for c in 0..3 {
                for k in 0..8 {
                    let (mut sum, mut n, mut m1) = (0.0, 0, 0.0);
                    for (v, u) in r.displacement[2].iter().enumerate() {
                        let x = mask.grid.center_mm(mask.voxels[v] as usize);
                        let b = ((x[0].abs() / 12.7 * 8.0) as usize).min(7);
                        if b == k {
                            sum += u[c] * u[c];
                            m1 += u[c];
                            n += 1;
                        }
                    }
                    print!(" |x|bin{k} c{c} rms {:.4} mean {:.4} n {n};", (sum / n as f64).sqrt(), m1 / n as f64);
                }
                println!();
            }
        }
    }
}
