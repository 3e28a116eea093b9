//! What a job tells where a specimen has no equilibrium: what gives way, and where.

use super::{Context, JobError};
use crate::fem::{EndCause, ForwardModel, PathEnd, SolveError};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;

/// `error`, which one of `samples` with its mesh ended with. Where a drive was not reached, it is asked what gave way
/// there.
pub(super) fn no_equilibrium(
    error: &SolveError,
    samples: &[(Specimen, MeshOptions)],
    material: &Material,
    context: &Context,
) -> JobError {
    let &SolveError::Diverged { reached_mm, asked_mm, .. } = error else { return context.failed(error) };
    context.step("what gives way", 0, 1);
    let end_of = |(sample, mesh): &(Specimen, MeshOptions)| {
        let mut model = ForwardModel::of_specimen(sample, mesh).ok()?;
        let end = model.path_end(material, reached_mm, asked_mm, &|| context.is_cancelled()).ok()?;
        is_an_end(&end).then_some(end)
    };
    match samples.iter().find_map(end_of) {
        Some(end) => context
            .failed(&format!("no equilibrium found beyond a drive of {reached_mm} mm (asked: {asked_mm} mm): {end}")),
        None => context.failed(error),
    }
}

/// Whether it is this sample's path that ended.
fn is_an_end(end: &PathEnd) -> bool {
    !matches!(end.cause, EndCause::Method { failure: None, .. })
}
