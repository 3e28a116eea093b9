//! What several kinds of jobs do alike where results are asked for as arrays.

use super::{Context, JobError, Outcome};
use crate::export::{ArrayFormat, FieldFormat, Tree};
use crate::provenance::VERSION;

/// The formats of arrays among those that are asked for.
pub(super) fn array_formats(formats: &[FieldFormat]) -> Vec<ArrayFormat> {
    formats.iter().filter_map(|f| f.of_arrays()).collect()
}

/// Adds the arrays of `tree` in each format that is asked for, headed by what they are of: program, hash of the input,
/// and the result as JSON.
///
/// # Errors
/// [`JobError::NoSolution`] where a file cannot be made.
pub(super) fn add_arrays(
    outcome: &mut Outcome,
    stem: &str,
    tree: Tree,
    formats: &[ArrayFormat],
    context: &Context,
) -> Result<(), JobError> {
    let mut whole = Tree::default();
    whole.text("program", format!("lambdak {VERSION}"));
    whole.text("input_hash", context.input_hash.as_str());
    whole.text("result_json", outcome.result.as_str());
    whole.members.extend(tree.members);
    for format in ArrayFormat::ALL.into_iter().filter(|f| formats.contains(f)) {
        let bytes = format.write(&whole).map_err(|e| context.failed(&e))?;
        outcome.add(format.file_name(stem), bytes);
    }
    Ok(())
}
