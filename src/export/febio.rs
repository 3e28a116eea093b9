//! Models of FEBio (`febio_spec` 4.0).

use super::card::febio_material;
use super::model::{MOVED, Numbered, Written};
use super::number::number;
use crate::mesh::ElementKind;
use std::fmt::Write;

/// Steps of time from one drive to the next, where none has to be repeated.
const STEPS_PER_DRIVE: usize = 10;

fn list(numbers: &[usize]) -> String {
    numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(",")
}

/// A load curve of these values at the times 0, 1, 2, …
fn curve(id: usize, interpolation: &str, values: impl Iterator<Item = f64>) -> String {
    let points: String = values.enumerate().map(|(t, v)| format!("        <pt>{t},{}</pt>\n", number(v))).collect();
    format!(
        "    <load_controller id=\"{id}\" type=\"loadcurve\">\n      <interpolate>{interpolation}</interpolate>\n      \
         <extend>CONSTANT</extend>\n      <points>\n{points}      </points>\n    </load_controller>\n"
    )
}

fn control(num_drives: usize) -> String {
    let (steps, size) = (STEPS_PER_DRIVE * num_drives, number(1.0 / STEPS_PER_DRIVE as f64));
    format!(
        "  <Control>\n    <analysis>STATIC</analysis>\n    <time_steps>{steps}</time_steps>\n    \
         <step_size>{size}</step_size>\n    <plot_level>PLOT_MUST_POINTS</plot_level>\n    \
         <output_level>OUTPUT_MUST_POINTS</output_level>\n    <time_stepper type=\"default\">\n      \
         <max_retries>10</max_retries>\n      <opt_iter>15</opt_iter>\n      <dtmin>1.0e-4</dtmin>\n      \
         <dtmax lc=\"2\">1.0</dtmax>\n    </time_stepper>\n  </Control>\n"
    )
}

/// The model: the time t is at the drive of number t.
pub(super) fn deck(written: &Written, numbered: &Numbered) -> String {
    let (name, drives_mm) = (&written.name, written.drives_mm);
    let element = match written.kind {
        ElementKind::Hex27 => "hex20",
        ElementKind::Prism21 => "penta15",
    };
    // Two minus signs end a comment in XML.
    let comment = written.comments.join("\n  ").replace("--", "- -");
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!-- {comment} -->\n<febio_spec version=\"4.0\">\n  \
         <Module type=\"solid\">\n    <units>mm-N-s</units>\n  </Module>\n{}  <Material>\n{}  </Material>\n  <Mesh>\n    \
         <Nodes name=\"nodes\">\n",
        control(drives_mm.len()),
        febio_material(&written.material, name, "    "),
    );
    for (n, x) in numbered.nodes() {
        // Writing to a string does not fail.
        let _ = writeln!(text, "      <node id=\"{n}\">{}</node>", x.map(number).join(","));
    }
    let _ = write!(text, "    </Nodes>\n    <Elements type=\"{element}\" name=\"specimen\">\n");
    for (e, nodes) in numbered.elements() {
        let _ = writeln!(text, "      <elem id=\"{e}\">{}</elem>", list(&nodes));
    }
    text += "    </Elements>\n";
    let held = numbered.held(&written.driven);
    for set in &held {
        let _ = writeln!(text, "    <NodeSet name=\"{}\">{}</NodeSet>", set.name, list(&set.nodes));
    }
    let _ = write!(
        text,
        "  </Mesh>\n  <MeshDomains>\n    <SolidDomain name=\"specimen\" mat=\"{name}\"/>\n  </MeshDomains>\n  <Boundary>\n"
    );
    for set in &held {
        let [x, y, z] = set.is_zero.map(u8::from);
        let _ = writeln!(
            text,
            "    <bc name=\"{0}_zero\" node_set=\"{0}\" type=\"zero displacement\">\n      <x_dof>{x}</x_dof>\n      \
             <y_dof>{y}</y_dof>\n      <z_dof>{z}</z_dof>\n    </bc>",
            set.name
        );
    }
    let drives = std::iter::once(0.0).chain(drives_mm.iter().copied());
    let beside = std::iter::once(0.0).chain(drives_mm.iter().map(|_| 1.0));
    let largest_steps = (0..=drives_mm.len()).map(|_| 1.0 / STEPS_PER_DRIVE as f64);
    let is_beside = written.driven.iter().any(|d| d.beside_mm.abs() > 0.0);
    for driven in &written.driven {
        let axis = ["x", "y", "z"][driven.component];
        let name = if written.driven.len() > 1 { format!("drive_{axis}") } else { "drive".into() };
        // What is across the drive follows a curve of its own.
        let (curve, value) = match driven.beside_mm {
            mm if mm.abs() > 0.0 => (3, number(mm)),
            _ => (1, number(driven.per_mm)),
        };
        let _ = write!(
            text,
            "    <bc name=\"{name}\" node_set=\"{MOVED}\" type=\"prescribed displacement\">\n      <dof>{axis}</dof>\n      \
             <value lc=\"{curve}\">{value}</value>\n      <relative>0</relative>\n    </bc>\n"
        );
    }
    let _ = write!(
        text,
        "  </Boundary>\n  <LoadData>\n{}{}{}  </LoadData>\n",
        curve(1, "LINEAR", drives),
        curve(2, "STEP", largest_steps),
        if is_beside { curve(3, "LINEAR", beside) } else { String::new() },
    );
    let moved = held.iter().find(|s| s.name == MOVED).map(|s| list(&s.nodes)).unwrap_or_default();
    let _ = write!(
        text,
        "  <Output>\n    <plotfile type=\"febio\">\n      <var type=\"displacement\"/>\n      <var type=\"stress\"/>\n      \
         <var type=\"reaction forces\"/>\n    </plotfile>\n    <logfile>\n      \
         <node_data data=\"Rx;Ry;Rz\" delim=\",\" file=\"reactions.csv\">{moved}</node_data>\n    </logfile>\n  </Output>\n\
         </febio_spec>\n"
    );
    text
}
