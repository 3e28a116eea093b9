//! Taylor tests: first-order remainders of every derivative shrink by four when the step is halved.

mod common;

use common::{
    bar, ellipse_and_slot, model, never, norm, norm_of_sum, off_axis, short_dumbbell, solve, tight, two_holes,
    two_terms,
};
use lambdak::fem::{Departures, Equilibrium, ForwardModel, ParameterSensitivity, PlateMotion};
use lambdak::material::Material;
use lambdak::mesh::{DesignVariable, MeshOptions, mesh_specimen, morphed, shape_velocity};
use lambdak::specimen::Specimen;

/// A state along a path: displacement, force, and sensitivities to each material parameter.
struct State {
    equilibrium: Equilibrium,
    sensitivities: Vec<ParameterSensitivity>,
}

fn state(model: &mut ForwardModel, material: &Material, drive: f64, start: Option<&Equilibrium>) -> State {
    let equilibrium = model.solve(material, drive, start, &tight(), &never).unwrap();
    let sensitivities = model.tangent(material, &equilibrium).unwrap().material_sensitivities().unwrap();
    State { equilibrium, sensitivities }
}

/// Remainders |q(t) − q(0) − t q′| at two steps, one half of the other: `(at t, at t/2)` and the change itself.
/// The ratio is 4 up to third-order terms; where the remainder is below `floor` of the change times t there is no
/// second derivative to see, and it is enough that it is small.
fn judge(what: &str, remainders: [f64; 2], change: f64, failures: &mut Vec<String>) {
    let ratio = remainders[0] / remainders[1];
    let relative = remainders[0] / change.max(1e-300);
    println!("{what}: ratio {ratio:.3}, remainder / change {relative:.1e}");
    // Remainders near the solver's tolerance (1e-11 of the state, 1e-8 of a change of 1e-3) have no order.
    let is_linear = relative < 2e-6;
    if !(is_linear || (ratio > 3.7 && ratio < 4.3)) {
        failures.push(format!("{what}: remainders {remainders:?}, ratio {ratio:.3}, change {change:.3e}"));
    }
}

fn check_path(
    name: &str,
    specimen: &Specimen,
    drive: f64,
    path: Option<DesignVariable>,
    step: f64,
    failures: &mut Vec<String>,
) {
    let material = two_terms();
    let mut base_model = model(specimen, 2.5);
    let base = state(&mut base_model, &material, drive, None);
    let velocity = path.map(|variable| shape_velocity(base_model.mesh(), specimen, variable));
    let rate = if path.is_none() { 1.0 } else { 0.0 };
    let derivative = base_model
        .tangent(&material, &base.equilibrium)
        .and_then(|mut tangent| tangent.path_sensitivity(&base.sensitivities, velocity.as_deref(), rate))
        .unwrap();
    let steps = [step, 0.5 * step];
    let states = steps.map(|t| match &velocity {
        Some(v) => {
            let mut moved = ForwardModel::new(morphed(base_model.mesh(), v, t), specimen).unwrap();
            state(&mut moved, &material, drive, Some(&base.equilibrium))
        }
        None => state(&mut base_model, &material, drive + t, Some(&base.equilibrium)),
    });
    let vectors = |what: String, f: &dyn Fn(&State) -> &[[f64; 3]], slope: &[[f64; 3]], failures: &mut Vec<String>| {
        let mut remainders = [0.0; 2];
        let mut change = 0.0;
        for k in 0..2 {
            let difference: Vec<[f64; 3]> =
                f(&states[k]).iter().zip(f(&base)).map(|(a, b)| [0, 1, 2].map(|i| a[i] - b[i])).collect();
            remainders[k] = norm_of_sum(&difference, -steps[k], slope);
            if k == 0 {
                change = norm(&difference);
            }
        }
        judge(&what, remainders, change, failures);
    };
    let scalars = |what: String, f: &dyn Fn(&State) -> f64, slope: f64, failures: &mut Vec<String>| {
        let d = [0, 1].map(|k: usize| f(&states[k]) - f(&base));
        judge(&what, [0, 1].map(|k: usize| (d[k] - steps[k] * slope).abs()), d[0].abs(), failures);
    };
    vectors(format!("{name} u'"), &|s| &s.equilibrium.displacement, &derivative.displacement, failures);
    scalars(format!("{name} F'"), &|s| s.equilibrium.force_n, derivative.force_n, failures);
    for (k, p) in derivative.parameters.iter().enumerate() {
        let of = p.parameter.name();
        vectors(format!("{name} s'({of})"), &|s| &s.sensitivities[k].displacement, &p.displacement, failures);
        scalars(format!("{name} F_{of}'"), &|s| s.sensitivities[k].force_n, p.force_n, failures);
    }
}

fn check_material(name: &str, specimen: &Specimen, drive: f64, failures: &mut Vec<String>) {
    let material = two_terms();
    let mut model = model(specimen, 2.5);
    let base = solve(&mut model, &material, drive).unwrap();
    for sensitivity in model.tangent(&material, &base).unwrap().material_sensitivities().unwrap() {
        let value = material.value(sensitivity.parameter);
        let steps = [0.04 * value, 0.02 * value];
        let states = steps.map(|t| {
            let mut changed = material.clone();
            changed.set(sensitivity.parameter, value + t);
            model.solve(&changed, drive, Some(&base), &tight(), &never).unwrap()
        });
        let (mut du, mut df) = ([0.0; 2], [0.0; 2]);
        let mut change = 0.0;
        for k in 0..2 {
            let difference: Vec<[f64; 3]> = states[k]
                .displacement
                .iter()
                .zip(&base.displacement)
                .map(|(a, b)| [0, 1, 2].map(|i| a[i] - b[i]))
                .collect();
            du[k] = norm_of_sum(&difference, -steps[k], &sensitivity.displacement);
            df[k] = (states[k].force_n - base.force_n - steps[k] * sensitivity.force_n).abs();
            if k == 0 {
                change = norm(&difference);
            }
        }
        let of = sensitivity.parameter.name();
        judge(&format!("{name} du/d{of}"), du, change, failures);
        judge(&format!("{name} dF/d{of}"), df, (states[0].force_n - base.force_n).abs(), failures);
    }
}

#[test]
fn material_derivatives_are_of_second_order() {
    let mut failures = Vec::new();
    check_material("two holes", &two_holes(), 5.0, &mut failures);
    check_material("bar", &bar(), 20.0, &mut failures);
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// The moved plate turned about each axis; on half of a mirrored sample it turns about the one across the mirror alone.
#[test]
fn derivatives_by_a_turning_plate_are_of_second_order() {
    let (specimen, material, drive) = (two_holes(), two_terms(), 5.0);
    let meshed = |use_mirror: bool| {
        let options = MeshOptions { use_mirror, ..MeshOptions::scaled(&specimen, 2.5) };
        ForwardModel::new(mesh_specimen(&specimen, &options).unwrap(), &specimen).unwrap()
    };
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut model = meshed(false);
    let base = model.solve(&material, drive, None, &tight(), &never).unwrap();
    let mut failures = Vec::new();
    for about in axes {
        let mut tangent = model.tangent(&material, &base).unwrap();
        let change = tangent.change_of_turning_plate(about).unwrap();
        let derivative = tangent.sensitivities(&[change]).unwrap().swap_remove(0);
        let steps = [0.02, 0.01];
        let states = steps.map(|t| {
            let turn = PlateMotion { rotation_rad: about.map(|w| t * w), ..PlateMotion::default() };
            let mut turned = model.departed(&Departures { moved_plate: turn, ..Departures::default() });
            turned.solve(&material, drive, Some(&base), &tight(), &never).unwrap()
        });
        let differences = states.each_ref().map(|s| -> Vec<[f64; 3]> {
            let pairs = s.displacement.iter().zip(&base.displacement);
            pairs.map(|(a, b)| [0, 1, 2].map(|i| a[i] - b[i])).collect()
        });
        let remainders = [0, 1].map(|k: usize| norm_of_sum(&differences[k], -steps[k], &derivative.displacement));
        judge(&format!("plate about {about:?} u'"), remainders, norm(&differences[0]), &mut failures);
        let of_force = states.each_ref().map(|s| s.force_n - base.force_n);
        let remainders = [0, 1].map(|k: usize| (of_force[k] - steps[k] * derivative.force_n).abs());
        judge(&format!("plate about {about:?} F'"), remainders, of_force[0].abs(), &mut failures);
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    let mut half = meshed(true);
    let base = half.solve(&material, drive, None, &tight(), &never).unwrap();
    let tangent = half.tangent(&material, &base).unwrap();
    assert_eq!(axes.map(|about| tangent.change_of_turning_plate(about).is_some()), [false, false, true]);
}

#[test]
fn drive_derivatives_are_of_second_order() {
    let mut failures = Vec::new();
    check_path("two holes, drive", &two_holes(), 5.0, None, 0.05, &mut failures);
    check_path("bar, drive", &bar(), 20.0, None, 0.2, &mut failures);
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn shape_derivatives_are_of_second_order() {
    use DesignVariable::{
        BlockLength, BlockThickness, BlockWidth, FilletRadius, GaugeLength, GaugeWidth, HoleAngle, HoleDiameter,
        HoleLength, HoleOther, HoleX,
    };
    let mut failures = Vec::new();
    for variable in [HoleX(0), HoleOther(1), HoleDiameter(0), BlockLength, BlockThickness, BlockWidth] {
        check_path(&format!("off-axis holes, {variable:?}"), &off_axis(), 5.0, Some(variable), 0.02, &mut failures);
    }
    let with_outlines = ellipse_and_slot();
    // A degree moves the ends of these holes by 0.05 mm.
    for (variable, step) in [
        (HoleLength(0), 0.02),
        (HoleLength(1), 0.02),
        (HoleAngle(0), 0.5),
        (HoleAngle(1), 0.5),
        (HoleDiameter(1), 0.02),
    ] {
        let name = format!("ellipse and slot, {variable:?}");
        check_path(&name, &with_outlines, 5.0, Some(variable), step, &mut failures);
    }
    let mut wedge = off_axis();
    wedge.block.wedge_mm = -2.8;
    for variable in [HoleX(0), HoleOther(1), HoleDiameter(0), BlockLength, BlockThickness, BlockWidth] {
        check_path(&format!("wedge, {variable:?}"), &wedge, 3.5, Some(variable), 0.02, &mut failures);
    }
    for variable in [HoleDiameter(0), BlockThickness] {
        check_path(&format!("bar, {variable:?}"), &bar(), 20.0, Some(variable), 0.02, &mut failures);
    }
    let dumbbell = short_dumbbell();
    for variable in [GaugeWidth, GaugeLength, FilletRadius, BlockWidth, BlockLength] {
        check_path(&format!("dumb-bell, {variable:?}"), &dumbbell, 10.0, Some(variable), 0.02, &mut failures);
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
