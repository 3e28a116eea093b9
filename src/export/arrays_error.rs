//! Why arrays cannot be written.

use super::arrays::Array;
use crate::report::ReportError;

/// Why a file of arrays or fields cannot be made: a fault of the program.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ArraysError {
    /// An array has not as many numbers as its axes ask for.
    #[error("the array {name} has {found} numbers, and its axes ask for {expected}")]
    Length {
        /// Its name.
        name: String,
        /// Numbers that it has.
        found: usize,
        /// Numbers that it should have.
        expected: usize,
    },
    /// The format cannot hold it.
    #[error("the {format} file cannot be written: {reason}")]
    Write {
        /// The format.
        format: &'static str,
        /// What its writer said.
        reason: String,
    },
    /// A field does not fit its mesh.
    #[error(transparent)]
    Field(#[from] ReportError),
}

impl Array {
    /// Whether it has as many numbers as its axes ask for.
    ///
    /// # Errors
    /// [`ArraysError::Length`].
    pub(super) fn check(&self, name: &str) -> Result<(), ArraysError> {
        let (found, expected) = (self.values.len(), self.axes.iter().map(|(_, n)| n).product());
        if found == expected { Ok(()) } else { Err(ArraysError::Length { name: name.into(), found, expected }) }
    }
}
