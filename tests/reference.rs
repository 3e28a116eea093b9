//! Forces and displacements of an independent finite-element code (tests/data/reference, made with FElupe) reproduced.
//!
//! The bound on each difference is the reference's stated error plus our own discretisation error, estimated as the
//! difference between the standard mesh and one 1.5 times coarser (first order or better: singular bonded edges).

mod common;

use lambdak::fem::{Equilibrium, ForwardModel, SolveOptions};
use lambdak::material::Ogden;
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

fn solved(specimen: &Specimen, material: &Ogden, factor: f64) -> Solved {
    let mut model = common::model(specimen, factor);
    let path =
        model.solve_path(material, &specimen.drive_mm, &SolveOptions::default(), &common::never).expect("converges");
    let locator = Locator::new(model.mesh());
    Solved { model, locator, path }
}

fn check(name: &str, text: &str) {
    let reference: Value = serde_json::from_str(text).unwrap();
    let specimen = Specimen::from_json(&reference["specimen"].to_string()).unwrap();
    let material = Ogden::from_json(&reference["material"].to_string()).unwrap();
    let [fine, coarse] = [1.0, 1.5].map(|factor| solved(&specimen, &material, factor));
    let mut failures = Vec::new();
    for (step, expected) in reference["extrapolated"].as_array().unwrap().iter().enumerate() {
        let drive = expected["drive_mm"].as_f64().unwrap();
        assert!((fine.path[step].drive_mm - drive).abs() < 1e-12);
        let samples = f64::from(specimen.samples_in_parallel);
        let mut compare = |what: String, stated: (f64, f64), ours: f64, other: f64| {
            let (value, error) = stated;
            let own = (ours - other).abs();
            if (ours - value).abs() > error + own {
                failures.push(format!("{what}: {ours:.6} ± {own:.1e}, reference {value:.6} ± {error:.1e}"));
            }
            (ours - value) / error
        };
        let stated = |v: &Value| (v["value"].as_f64().unwrap(), v["error"].as_f64().unwrap());
        let force = stated(&expected["force_x_n"]);
        let (ours, other) = (fine.path[step].force_n, coarse.path[step].force_n);
        let units = compare(format!("{name} {drive} mm force"), force, ours, other);
        let mut worst: (f64, String) = (0.0, String::new());
        for (point, entry) in expected["u_mm"].as_object().unwrap() {
            let at = vector(&entry["at_mm"]);
            let (value, error) = (vector(&entry["value"]), vector(&entry["error"]));
            let [ours, other] =
                [&fine, &coarse].map(|s| displacement_at(s.model.mesh(), &s.locator, &s.path[step], at));
            for i in 0..3 {
                let what = format!("{name} {drive} mm {point} u{}", ["x", "y", "z"][i]);
                let units = compare(what, (value[i], error[i]), ours[i], other[i]);
                if units.abs() > worst.0.abs() {
                    worst = (units, format!("{point} u{} by {:.1e} mm", ["x", "y", "z"][i], ours[i] - value[i]));
                }
            }
        }
        let normal = expected["force_y_n_per_sample"].get("value").and_then(Value::as_f64);
        let normal = normal.map_or(String::new(), |n| {
            format!("; normal force {:.4} (reference {n:.4})", fine.path[step].normal_force_n / samples)
        });
        println!(
            "{name} {drive} mm: force {ours:.5} N, reference {:.5} ± {:.5} ({units:+.2} errors, {:+.3} %), own mesh \
             error {:.4} N; worst displacement {:+.1} errors ({}){normal}",
            force.0,
            force.1,
            100.0 * (ours / force.0 - 1.0),
            (ours - other).abs(),
            worst.0,
            worst.1
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
