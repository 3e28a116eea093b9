//! A sweep as text.

use crate::sweep::{SweepResult, SweepStudy};

/// Designs, tasks, failures.
pub(in crate::job) fn sweep(study: &SweepStudy, result: &SweepResult) -> String {
    let (designs, tasks, failed) = (study.num_points(), result.num_tasks, result.num_failed);
    format!("{}: {designs} designs, {tasks} tasks, {failed} failed\n", study.name)
}
