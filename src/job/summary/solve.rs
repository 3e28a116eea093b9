//! A forward solution as text.

use super::num;
use crate::fem::SolveResult;

/// Forces and stretches at each drive.
pub(in crate::job) fn solve(name: &str, result: &SolveResult) -> String {
    let mut text = format!(
        "{name}: {} elements, {} unknowns, smallest scaled Jacobian {}\n\n  drive mm     force N                normal force N         largest stretch   det F\n",
        result.num_elements,
        result.num_unknowns,
        num(result.min_scaled_jacobian, 4)
    );
    for step in &result.steps {
        text += &format!(
            "{:>10} {:>11} {:<10} {:>13} {:<10} {:>13}   {} to {}\n",
            num(step.drive_mm, 5),
            num(step.force_n, 5),
            within(step.force_discretisation_n),
            num(step.normal_force_n, 5),
            within(step.normal_force_discretisation_n),
            num(step.largest_principal_stretch, 4),
            num(step.jacobian_range[0], 4),
            num(step.jacobian_range[1], 4)
        );
        if !step.force_by_kind_n.is_empty() {
            let forces: Vec<String> = step.force_by_kind_n.iter().map(|f| num(*f, 5)).collect();
            text += &format!("           each kind of sample: {} N\n", forces.join(", "));
        }
        if !step.contact.is_none() {
            text += &format!("           beyond contact, which is not modelled: {}\n", step.contact.in_words());
        }
    }
    if result.steps.iter().any(|s| s.force_discretisation_n.is_some()) {
        text += "±: what the mesh may put a force wrong by, from coarser meshes\n";
    }
    text
}

/// A bound of the mesh's error, as it stands behind a number.
fn within(bound: Option<f64>) -> String {
    // Of what is zero by symmetry there is nothing to say.
    bound.filter(|b| *b > 0.0).map_or_else(String::new, |bound| format!("± {}", num(bound, 2)))
}
