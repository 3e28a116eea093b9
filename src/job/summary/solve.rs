//! A forward solution as text.

use crate::fem::SolveResult;

/// Forces and stretches at each drive.
pub(in crate::job) fn solve(name: &str, result: &SolveResult) -> String {
    let mut text = format!(
        "{name}: {} elements, {} unknowns, smallest scaled Jacobian {:.2}\n\n  drive mm     force N   normal force N   largest stretch   det F\n",
        result.num_elements, result.num_unknowns, result.min_scaled_jacobian
    );
    for step in &result.steps {
        text += &format!(
            "{:>10.3} {:>11.4} {:>16.4} {:>17.3}   {:.3} to {:.3}\n",
            step.drive_mm,
            step.force_n,
            step.normal_force_n,
            step.largest_principal_stretch,
            step.jacobian_range[0],
            step.jacobian_range[1]
        );
    }
    text
}
