//! What a job tells where a specimen has no equilibrium: what gives way, and where.

use super::{Context, JobError};
use crate::fem::{EndCause, ForwardModel, PathEnd, SolveError, Way};
use crate::material::Material;
use crate::mesh::MeshOptions;
use crate::specimen::Specimen;

/// `error`, which one of `samples` with its mesh ended with. Where a drive or a precompression was not reached, it is
/// asked what gave way there.
pub(super) fn no_equilibrium(
    error: &SolveError,
    samples: &[(Specimen, MeshOptions)],
    material: &Material,
    context: &Context,
) -> JobError {
    let (way, reached_mm, asked_mm) = match *error {
        SolveError::Diverged { reached_mm, asked_mm, .. } => (Way::Drive, reached_mm, asked_mm),
        SolveError::NotPrecompressed { reached_mm, asked_mm, .. } => (Way::Precompression, reached_mm, asked_mm),
        _ => return context.failed(error),
    };
    context.step("what gives way", 0, 1);
    let is_cancelled = || context.is_cancelled();
    let end_of = |(sample, mesh): &(Specimen, MeshOptions)| {
        let mut model = ForwardModel::of_specimen(sample, mesh).ok()?;
        let end = match way {
            Way::Drive => model.path_end(material, reached_mm, asked_mm, &is_cancelled),
            Way::Precompression => model.precompression_end(material, reached_mm, asked_mm, &is_cancelled),
        };
        let end = end.ok()?;
        is_an_end(&end).then_some(end)
    };
    match samples.iter().find_map(end_of) {
        Some(end) => context
            .failed(&format!("no equilibrium found beyond a {way} of {reached_mm} mm (asked: {asked_mm} mm): {end}")),
        None => context.failed(error),
    }
}

/// Whether it is this sample's path that ended.
fn is_an_end(end: &PathEnd) -> bool {
    !matches!(end.cause, EndCause::Method { failure: None, .. })
}
