//! Forces and displacements of an independent finite-element code (tests/data/reference, made with FElupe) reproduced.
//!
//! Forces: the bound is the reference's stated error plus that of our standard mesh, 2.5 times its difference from a
//! mesh with elements 0.7 times the size (the factor for order 1.4; the bonded edges are singular). One of three drives
//! per case may miss it if it lies within the reference's extrapolations at orders 0.8 to 2.5, the range that the
//! reference allows itself: three meshes do not determine the order (0.26 was observed for the bar, 2.2 for the solid
//! block whose edges are singular).
//!
//! Displacements: compared as vectors, on the finer mesh, with three times the stated error plus what the reference
//! misses where symmetry gives the exact value (u_x = drive/2 on x = 0, u_y = 0 at the centre). The stated error is
//! half a Richardson step per component on sequences that are not monotone; the reference misses the exact value by up
//! to ten of these, as the last test shows. Ours is exact there.

mod common;

use lambdak::fem::{Equilibrium, ForwardModel, SolveOptions};
use lambdak::material::Material;
use lambdak::mesh::{Locator, Mesh};
use lambdak::specimen::Specimen;
use serde_json::Value;

/// Displacement at a point of the whole specimen: mirrored into the meshed part and back.
fn displacement_at(mesh: &Mesh, locator: &Locator, found: &Equilibrium, point: [f64; 3]) -> [f64; 3] {
    let mut sign = [1.0; 3];
    for (axis, is_mirror) in [(1, mesh.mirror.y), (2, mesh.mirror.z)] {
        if is_mirror && point[axis] < 0.0 {
            sign[axis] = -1.0;
        }
    }
    let inside = [0, 1, 2].map(|i| sign[i] * point[i]);
    let location = locator.locate(mesh, inside).unwrap_or_else(|| panic!("{point:?} is outside the mesh"));
    let shape = mesh.element_kind.shape_functions(location.reference_coordinates);
    let mut u = [0.0; 3];
    for (&v, n) in mesh.element(location.element as usize).iter().zip(shape) {
        for i in 0..3 {
            u[i] += n * found.displacement[v as usize][i];
        }
    }
    [0, 1, 2].map(|i| sign[i] * u[i])
}

fn vector(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|i| value[i].as_f64().unwrap())
}

struct Solved {
    model: ForwardModel,
    locator: Locator,
    path: Vec<Equilibrium>,
}

fn solved(specimen: &Specimen, material: &Material, factor: f64) -> Solved {
    let mut model = common::model(specimen, factor);
    let path =
        model.solve_path(material, &specimen.drive_mm, &SolveOptions::default(), &common::never).expect("converges");
    let locator = Locator::new(model.mesh());
    Solved { model, locator, path }
}

/// Reference length of a vector of per-component errors.
fn length(x: [f64; 3]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| a[i] - b[i])
}

/// Error of the standard mesh over its difference from one with elements 0.7 times the size, at order 1.4.
const FROM_DIFFERENCE: f64 = 2.5;

fn check(name: &str, text: &str) {
    let reference: Value = serde_json::from_str(text).unwrap();
    let specimen = Specimen::from_json(&reference["specimen"].to_string()).unwrap();
    let material = Material::from_json(&reference["material"].to_string()).unwrap();
    let [standard, fine] = [1.0, 0.7].map(|factor| solved(&specimen, &material, factor));
    let mut failures = Vec::new();
    let mut num_beyond = 0;
    for (step, expected) in reference["extrapolated"].as_array().unwrap().iter().enumerate() {
        let drive = expected["drive_mm"].as_f64().unwrap();
        assert!((fine.path[step].drive_mm - drive).abs() < 1e-12);
        let force = &expected["force_x_n"];
        let (value, error) = (force["value"].as_f64().unwrap(), force["error"].as_f64().unwrap());
        let (ours, finer) = (standard.path[step].force_n, fine.path[step].force_n);
        let own = FROM_DIFFERENCE * (ours - finer).abs();
        if (ours - value).abs() > error + own {
            let of = |mesh: usize| {
                reference["meshes"][mesh]["steps"][step]["force_x_n"].as_f64().expect("three meshes of the reference")
            };
            let extrapolated = |order: f64| of(2) + (of(2) - of(1)) / ((1.0f64 / 0.7).powf(order) - 1.0);
            let (a, b) = (extrapolated(0.8), extrapolated(2.5));
            num_beyond += 1;
            println!(
                "{name} {drive} mm: beyond the stated error; extrapolations at orders 0.8 and 2.5: {a:.5}, {b:.5}"
            );
            let is_explained = ours + own >= a.min(b) && ours - own <= a.max(b);
            if num_beyond > 1 || !is_explained {
                failures
                    .push(format!("{name} {drive} mm force {ours:.5} ± {own:.5}, reference {value:.5} ± {error:.5}"));
            }
        }
        let mut known_miss = 0.0f64;
        for entry in expected["u_mm"].as_object().unwrap().values() {
            // All specimens are symmetric in x.
            if vector(&entry["at_mm"])[0] == 0.0 {
                known_miss = known_miss.max((vector(&entry["value"])[0] - 0.5 * drive).abs());
            }
        }
        let mut worst = (0.0, 0.0, String::new());
        for (point, entry) in expected["u_mm"].as_object().unwrap() {
            let at = vector(&entry["at_mm"]);
            let (value, error) = (vector(&entry["value"]), length(vector(&entry["error"])));
            let [ours, finer] =
                [&standard, &fine].map(|s| displacement_at(s.model.mesh(), &s.locator, &s.path[step], at));
            let own = FROM_DIFFERENCE * length(minus(ours, finer));
            let off = length(minus(finer, value));
            if off > 3.0 * error + known_miss + own {
                failures.push(format!(
                    "{name} {drive} mm {point}: {finer:.5?} ± {own:.1e}, reference {value:.5?} ± {error:.1e}, off {off:.1e}"
                ));
            }
            if off / error > worst.0 {
                worst = (off / error, off, point.clone());
            }
        }
        println!(
            "| {name} | {drive} | {ours:.4} ± {own:.4} | {value:.4} ± {error:.4} | {:+.2} % |",
            100.0 * (ours / value - 1.0)
        );
        println!(
            "{name} {drive} mm: force {ours:.5} (finer {finer:.5}) N, reference {value:.5} ± {error:.5}: {:+.2} ({:+.2}) \
             errors, {:+.3} ({:+.3}) %; worst displacement {:.1} errors, {:.1e} mm at {}",
            (ours - value) / error,
            (finer - value) / error,
            100.0 * (ours / value - 1.0),
            100.0 * (finer / value - 1.0),
            worst.0,
            worst.1,
            worst.2
        );
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn solid_one_term() {
    check("solid-one", include_str!("data/reference/solid-one.json"));
}

#[test]
fn solid_two_terms() {
    check("solid-two", include_str!("data/reference/solid-two.json"));
}

#[test]
fn two_hole_one_term() {
    check("two_hole-one", include_str!("data/reference/two_hole-one.json"));
}

#[test]
fn two_hole_two_terms() {
    check("two_hole-two", include_str!("data/reference/two_hole-two.json"));
}

#[test]
fn bar_one_term() {
    check("bar-one", include_str!("data/reference/bar-one.json"));
}

#[test]
fn bar_two_terms() {
    check("bar-two", include_str!("data/reference/bar-two.json"));
}

/// The block with two holes is symmetric under a half turn about z once half of the drive is taken off, so the
/// displacement at the centre is (drive/2, 0, 0) exactly. The reference misses it by several of its stated errors.
#[test]
fn stated_errors_of_displacements_are_too_small_where_the_answer_is_known() {
    let reference: Value = serde_json::from_str(include_str!("data/reference/two_hole-two.json")).unwrap();
    let mut worst = 0.0f64;
    for step in reference["extrapolated"].as_array().unwrap() {
        let exact = [0.5 * step["drive_mm"].as_f64().unwrap(), 0.0, 0.0];
        let centre = &step["u_mm"]["centre"];
        let (value, error) = (vector(&centre["value"]), vector(&centre["error"]));
        for i in 0..3 {
            worst = worst.max((value[i] - exact[i]).abs() / error[i]);
        }
    }
    println!("the reference misses the exact displacement of the centre by up to {worst:.1} stated errors");
    assert!(worst > 3.0);
}
