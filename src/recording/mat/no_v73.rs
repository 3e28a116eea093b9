//! In place of the reader of version 7.3, in a library that is built without it.

use super::{MatError, MatValue};
use crate::file::ReadingMemory;
use std::path::Path;

/// Nothing: the reader is a feature.
///
/// # Errors
/// [`MatError::NoHdf5`].
pub(super) fn read(_: &Path, _: &ReadingMemory) -> Result<Vec<(String, MatValue)>, MatError> {
    Err(MatError::NoHdf5)
}
