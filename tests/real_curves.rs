//! Published curves of real materials: fits, predictions of tests kept back, and what an elastic material leaves out.
//!
//! The data are not part of the project. Set `LAMBDAK_REAL_DATA` to the folder that holds `classical`,
//! `soft_robotics_db_tension`, `ecoflex_compression`, `vhb4910_load_unload` and `oca_shear`; without it every test is
//! ignored. Sources: Treloar 1944 (Trans. Faraday Soc. 40), Meunier et al. 2008 (Polymer Testing 27, 765), Marechal et
//! al. 2020 (doi 10.1089/soro.2019.0115), Dawood et al. 2026, Liu et al. 2024 (Comput. Methods Appl. Mech. Eng.
//! 430, 117248).

#[path = "common/prerequisites.rs"]
mod prerequisites;

use lambdak::homogeneous::{
    CsvOptions, Curve, CurveFitOptions, HomogeneousTest, StressUnit, compare_laws, fit_curves, fit_terms, matches_of,
    read_csv,
};
use lambdak::material::LawKind;
use lambdak::rate::{Hypothesis, LoadCurve, LoadCurveOptions, LoadCurveVerdict, analyse_load_curve};
use prerequisites::Missing;
use std::path::{Path, PathBuf};

fn never() -> bool {
    false
}

fn curve(path: &Path, test: HomogeneousTest, options: &CsvOptions) -> Curve {
    let csv = read_csv(&std::fs::read_to_string(path).unwrap(), test, options).unwrap();
    let name = path.file_stem().unwrap().to_string_lossy().into_owned();
    Curve::new(&name, test, &csv.drive, &csv.stress).unwrap()
}

fn classical(folder: &Path, source: &str) -> [Curve; 3] {
    let mpa = CsvOptions { stress_unit: Some(StressUnit::MPa), ..CsvOptions::default() };
    [("UT", HomogeneousTest::Uniaxial), ("ET", HomogeneousTest::Equibiaxial), ("PS", HomogeneousTest::PureShear)]
        .map(|(name, test)| curve(&folder.join(format!("{source}_{name}.csv")), test, &mpa))
}

/// Treloar's rubber, three tests together, three terms: each R² at least 0.995.
fn treloar_three_terms_meet_three_tests() -> Result<(), Missing> {
    let folder = prerequisites::real_data("classical")?;
    let curves = classical(&folder, "Treloar_1944");
    let sequence = fit_curves(&curves, &CurveFitOptions::default()).unwrap();
    for fit in &sequence.fits {
        println!("{} terms:", fit.num_terms);
        for p in &fit.parameters {
            println!("  {} {:.5} {:?}", p.name, p.value, p.interval_95);
        }
        for m in &fit.curves {
            println!("  {} R² {:.5}, relative error {:.2} %", m.name, m.r_squared, 100.0 * m.relative_rms_error);
        }
    }
    println!("chosen {}; {:?}", sequence.chosen().num_terms, sequence.fits[2].initial_shear_modulus_kpa);
    assert!(sequence.fits[2].curves.iter().all(|m| m.r_squared >= 0.995), "{:?}", sequence.fits[2].curves);
    Ok(())
}

/// Treloar's rubber is what laws of chains that come to their end were made for: with two parameters they describe it
/// better, by BIC, than two of Ogden's terms with four, and their shear modulus is that of the literature, about
/// 0.3 MPa.
fn treloar_is_a_network_of_chains() -> Result<(), Missing> {
    let folder = prerequisites::real_data("classical")?;
    let curves = classical(&folder, "Treloar_1944");
    let options = CurveFitOptions::default();
    let comparison = compare_laws(&curves, &fit_curves(&curves, &options).unwrap(), &options).unwrap();
    let of = |law: Option<LawKind>, num_terms: usize| {
        let found = comparison.laws.iter().find(|e| e.law == law && e.num_terms == num_terms).unwrap();
        println!("{}: {} parameters, BIC {:.1}", found.name, found.num_parameters, found.bic);
        found
    };
    let two_terms = of(None, 2);
    for law in [LawKind::Gent, LawKind::ArrudaBoyce] {
        let found = of(Some(law), 0);
        assert!(found.num_parameters == 2 && two_terms.num_parameters == 4);
        assert!(found.bic < two_terms.bic, "{} {}", found.bic, two_terms.bic);
        let modulus = found.initial_shear_modulus_kpa.value;
        assert!((250.0..350.0).contains(&modulus), "{modulus}");
    }
    Ok(())
}

/// Meunier's silicone: fitted in uniaxial tension and compression and in pure shear, equibiaxial predicted.
fn meunier_equibiaxial_is_predicted() -> Result<(), Missing> {
    let folder = prerequisites::real_data("classical")?;
    let [uniaxial, equibiaxial, pure_shear] = classical(&folder, "Meunier_2008");
    let fitted = [uniaxial, pure_shear];
    let options = CurveFitOptions { also_stable_at: equibiaxial.states.clone(), ..CurveFitOptions::default() };
    let sequence = fit_curves(&fitted, &options).unwrap();
    for fit in &sequence.fits {
        let kept = fit.matches(std::slice::from_ref(&equibiaxial)).unwrap();
        println!(
            "{} terms: fitted R² {:.5} {:.5}; equibiaxial predicted R² {:.5}, rms {:.1} kPa ({:.2} %)",
            fit.num_terms,
            fit.curves[0].r_squared,
            fit.curves[1].r_squared,
            kept[0].r_squared,
            kept[0].rms_error_kpa,
            100.0 * kept[0].relative_rms_error
        );
    }
    let kept = sequence.chosen().matches(&[equibiaxial]).unwrap();
    println!("chosen {} terms", sequence.chosen().num_terms);
    // The bulge test turns up beyond a stretch of 1.8, which the other two tests do not show: the prediction misses it
    // (an error of about a fifth). What is asked is the curve below that.
    assert!(kept[0].r_squared > 0.8, "{kept:?}");
    Ok(())
}

/// Nineteen silicones to failure: every curve is read and fitted, and three terms leave little.
fn silicones_in_tension_are_all_fitted() -> Result<(), Missing> {
    let folder = prerequisites::real_data("soft_robotics_db_tension")?;
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|p| p.extension().is_some_and(|e| e == "csv") && !p.ends_with("META.csv"));
    files.sort();
    assert!(files.len() >= 19);
    for path in files {
        let c = curve(&path, HomogeneousTest::Uniaxial, &CsvOptions::default());
        let sequence = fit_curves(std::slice::from_ref(&c), &CurveFitOptions::default()).unwrap();
        let (best, g) = (sequence.chosen(), sequence.chosen().initial_shear_modulus_kpa);
        println!(
            "{:<28} terms {} R² {:.5} error {:.2} % shear modulus {:.1} ({:.1} to {:.1}) kPa",
            c.name,
            best.num_terms,
            best.curves[0].r_squared,
            100.0 * best.curves[0].relative_rms_error,
            g.value,
            g.interval_95[0],
            g.interval_95[1]
        );
        let richest = sequence.fits.last().unwrap();
        assert!(richest.curves[0].r_squared > 0.995, "{}: {:?}", c.name, richest.curves);
    }
    Ok(())
}

/// Compressed Ecoflex cylinders: one specimen fitted, the other predicted.
fn compressed_cylinders_predict_each_other() -> Result<(), Missing> {
    let folder = prerequisites::real_data("ecoflex_compression")?;
    for grade in ["EF10_0T", "EF30_0T", "EF50_0T"] {
        let read = |name: &str| {
            let mut c =
                curve(&folder.join(format!("{grade}_{name}.csv")), HomogeneousTest::Uniaxial, &CsvOptions::default());
            // Every tenth reading: ten a second say little more.
            c.states = c.states.into_iter().step_by(10).collect();
            c.nominal_stress_kpa = c.nominal_stress_kpa.into_iter().step_by(10).collect();
            c
        };
        let fit = fit_terms(&[read("A1")], 2, &CurveFitOptions::default()).unwrap();
        for name in ["A1", "A5", "B1"] {
            let m = &matches_of(&fit.law, None, &[read(name)]).unwrap()[0];
            println!(
                "{grade} fitted on A1, {name}: R² {:.5}, error {:.2} %",
                m.r_squared,
                100.0 * m.relative_rms_error
            );
            assert!(m.r_squared > 0.98, "{m:?}");
        }
    }
    Ok(())
}

fn load_curve(path: &Path, test: HomogeneousTest) -> LoadCurve {
    let csv = read_csv(&std::fs::read_to_string(path).unwrap(), test, &CsvOptions::default()).unwrap();
    // Rows out of order, as some sources have them, are sorted by time.
    let mut order: Vec<usize> = (0..csv.drive.len()).collect();
    order.sort_by(|&a, &b| csv.time_s[a].total_cmp(&csv.time_s[b]));
    let pick = |v: &[f64]| order.iter().map(|&i| v[i]).collect::<Vec<_>>();
    let name = path.file_stem().unwrap().to_string_lossy().into_owned();
    LoadCurve::new(&name, test, &pick(&csv.time_s), &pick(&csv.drive), &pick(&csv.stress)).unwrap()
}

fn print(v: &LoadCurveVerdict) {
    println!("{:?}: {}", v.verdict, v.summary);
    for c in &v.causes {
        println!("  {} ({}) ΔBIC {:.1} {:?}", c.name, c.model, c.delta_bic, c.ambiguous_with);
        for p in &c.parameters {
            println!("    {} {:.4} {:?}", p.name, p.value, p.interval_95);
        }
    }
    for h in v.hypotheses.iter() {
        println!(
            "  stage {} {} ΔBIC {:.1} F {:.1} p {:.1e}{}",
            h.stage,
            h.name,
            h.delta_bic,
            h.f_value,
            h.f_probability,
            if h.is_taken { " taken" } else { "" }
        );
    }
    for m in &v.fitted {
        println!(
            "  fitted {}: {:.2} % → {:.2} %",
            m.before.name,
            100.0 * m.before.relative_rms_error,
            100.0 * m.after.relative_rms_error
        );
    }
    for m in &v.kept_back {
        println!(
            "  KEPT BACK {}: {:.2} % → {:.2} %",
            m.before.name,
            100.0 * m.before.relative_rms_error,
            100.0 * m.after.relative_rms_error
        );
    }
    println!(
        "  naive modulus {:?}, equilibrium modulus {:?}",
        v.naive_material.initial_shear_modulus_kpa, v.material.initial_shear_modulus_kpa
    );
}

/// VHB 4910 at three rates: two fitted, the third predicted; relaxation is named and the prediction improves.
fn vhb_third_rate_is_predicted() -> Result<(), Missing> {
    let folder = prerequisites::real_data("vhb4910_load_unload")?;
    for amplitude in ["1d5", "2d0", "2d5"] {
        for held in ["0d01", "0d03", "0d05"] {
            let curves: Vec<LoadCurve> = ["0d01", "0d03", "0d05"]
                .iter()
                .map(|rate| {
                    let c = load_curve(
                        &folder.join(format!("loading_{amplitude}_unloading_{rate}.csv")),
                        HomogeneousTest::Uniaxial,
                    );
                    if *rate == held { c.kept_back() } else { c }
                })
                .collect();
            let v = analyse_load_curve(&curves, &LoadCurveOptions::default(), &never).unwrap();
            print(&v);
            assert!(v.causes.iter().any(|c| c.name == Hypothesis::Relaxation.name()), "{}", v.summary);
            let k = &v.kept_back[0];
            assert!(k.after.rms_error_kpa < k.before.rms_error_kpa, "{}", v.summary);
        }
    }
    Ok(())
}

/// An optically clear adhesive in shear at three rates, each kept back in turn.
fn adhesive_third_rate_is_predicted() -> Result<(), Missing> {
    let folder = prerequisites::real_data("oca_shear")?;
    let names = ["monotonic_shear_0d01", "monotonic_shear_0d1", "monotonic_shear_1"];
    for held in names {
        let curves: Vec<LoadCurve> = names
            .iter()
            .map(|name| {
                let c = load_curve(&folder.join(format!("{name}.csv")), HomogeneousTest::SimpleShear);
                if *name == held { c.kept_back() } else { c }
            })
            .collect();
        let v = analyse_load_curve(&curves, &LoadCurveOptions::default(), &never).unwrap();
        print(&v);
        assert!(v.causes.iter().any(|c| c.name == Hypothesis::Relaxation.name()), "{}", v.summary);
    }
    Ok(())
}

/// The same adhesive, stepped relaxation: two ramp rates fitted, the third predicted.
fn adhesive_relaxation_is_predicted() -> Result<(), Missing> {
    let folder = prerequisites::real_data("oca_shear")?;
    let names = ["shear_relaxation_1", "shear_relaxation_2", "shear_relaxation_5"];
    for held in names {
        let curves: Vec<LoadCurve> = names
            .iter()
            .map(|name| {
                let c = load_curve(&folder.join(format!("{name}.csv")), HomogeneousTest::SimpleShear);
                if *name == held { c.kept_back() } else { c }
            })
            .collect();
        let v = analyse_load_curve(&curves, &LoadCurveOptions::default(), &never).unwrap();
        print(&v);
        let k = &v.kept_back[0];
        assert!(v.causes.iter().any(|c| c.name == Hypothesis::Relaxation.name()), "{}", v.summary);
        assert!(k.after.rms_error_kpa < k.before.rms_error_kpa, "{}", v.summary);
    }
    Ok(())
}

prerequisites::test_binary!(
    treloar_three_terms_meet_three_tests,
    treloar_is_a_network_of_chains,
    meunier_equibiaxial_is_predicted,
    silicones_in_tension_are_all_fitted,
    compressed_cylinders_predict_each_other,
    vhb_third_rate_is_predicted,
    adhesive_third_rate_is_predicted,
    adhesive_relaxation_is_predicted,
);
