//! Relaxation found in the load histories of recordings made by an independent finite element code, with the elastic
//! force from our own finite elements.

mod common;

use lambdak::fem::SolveOptions;
use lambdak::homogeneous::ShearTerm;
use lambdak::material::Material;
use lambdak::rate::{
    ForceHistory, ForceHistoryOptions, ForceHistorySequence, ForceTable, ShearLayer, fit_force_history,
};
use lambdak::specimen::Specimen;

const SPECIMEN: &str = include_str!("../geometries/two-hole-shear.json");

/// The two-hole specimen's force over drive for a material, on a coarse mesh.
fn table(material: &Material) -> ForceTable {
    let specimen = Specimen::from_json(SPECIMEN).unwrap();
    let mut model = common::model(&specimen, 1.8);
    let drives: Vec<f64> = (1..=7).map(f64::from).collect();
    let path = model.solve_path(material, &drives, &SolveOptions::default(), &common::never).unwrap();
    let forces: Vec<f64> = path.iter().map(|e| e.force_n).collect();
    println!("elastic forces {forces:?}");
    ForceTable::odd(&drives, &forces).unwrap()
}

fn analyse(text: &str, material: &Material) -> ForceHistorySequence {
    let mut history = ForceHistory { time_s: Vec::new(), drive_mm: Vec::new(), force_n: Vec::new(), force_sd_n: None };
    for line in text.lines().skip(1) {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        history.time_s.push(cells[0]);
        history.drive_mm.push(cells[1]);
        history.force_n.push(cells[2]);
    }
    let terms = material.terms.iter().map(|t| ShearTerm { modulus_kpa: t.mu_kpa * t.alpha, alpha: t.alpha }).collect();
    let layer = ShearLayer { gap_mm: 6.4, terms };
    let options = ForceHistoryOptions { layer: Some(layer), min_drive_mm: 1.0, ..ForceHistoryOptions::default() };
    let found = fit_force_history(&history, &table(material), &options).unwrap();
    for (model, fit) in found.selection.models.iter().zip(&found.fits) {
        println!(
            "{}: BIC {:.1}, rms {:.4} N, scale {:?}, offset {:?}",
            model.name, model.bic, fit.rms_error_n, fit.scale, fit.offset_n
        );
        for r in &fit.relaxations {
            println!("  g {:?} tau {:?}", r.strength, r.time_s);
        }
    }
    found
}

/// g = 0.25, 0.15 and τ = 8, 60 s behind the force of a history: at least two relaxations are chosen (the load
/// cell's slow drift may look like a third), and two come out as follows. The layer between the plates
/// is not homogeneous (two holes) and the mesh is coarse: the strengths' sum comes out within a tenth, each time within
/// a factor of two, the stiffness within 5 %.
#[test]
fn the_relaxations_of_a_recording_are_found() {
    let text = include_str!("data/recordings/open-relaxation-load.csv");
    let found = analyse(text, &common::ogden(2100.0, &[(15.5, 2.2)]));
    assert!(found.chosen().relaxations.len() >= 2, "{:?}", found.selection);
    let fit = &found.fits[2];
    let terms = fit.terms();
    let sum: f64 = terms.iter().map(|t| t.strength).sum();
    assert!((sum / 0.4 - 1.0).abs() < 0.1, "{terms:?}");
    for (found, tau) in terms.iter().zip([8.0, 60.0]) {
        assert!((0.5..2.0).contains(&(found.time_s / tau)), "{terms:?}");
    }
    assert!((fit.scale.value - 1.0).abs() < 0.05, "{:?}", fit.scale);
}

/// An elastic recording: no relaxation.
#[test]
fn an_elastic_recording_names_none() {
    let text = include_str!("data/recordings/open-control-load.csv");
    let found = analyse(text, &common::one_term());
    assert!(found.chosen().relaxations.is_empty());
}
