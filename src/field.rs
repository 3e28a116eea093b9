//! What is wrong with single fields of a file, a request or an option: one type for every reader and every door.

mod path;
mod read;
#[cfg(feature = "schema")]
pub mod schema;
mod tag;
mod text;
mod xml;

pub use path::FieldPath;
pub use read::read;
pub(crate) use tag::file_tag;
pub use text::{printable, with_short_numbers};
pub use xml::escape_xml;

use serde::{Deserialize, Serialize};

/// A field that does not hold what it may hold.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[error("{}{} it must be {allowed}{}", self.place(), self.found(), self.advice())]
pub struct FieldError {
    /// JSON pointer (RFC 6901) to the field, such as `/holes/1/diameter_mm`; empty for the whole.
    pub pointer: String,
    /// What the field holds, as JSON; empty where the field is missing.
    pub value: String,
    /// What it may hold, as the end of "it must be …".
    pub allowed: String,
    /// What to change, as a sentence without its full stop; empty where `allowed` says it.
    pub remedy: String,
}

impl FieldError {
    /// The field at `pointer` holds `value`; it must be `allowed`.
    pub fn new(pointer: impl Into<String>, value: impl std::fmt::Display, allowed: impl Into<String>) -> FieldError {
        FieldError {
            pointer: pointer.into(),
            value: with_short_numbers(&value.to_string()),
            allowed: with_short_numbers(&allowed.into()),
            remedy: String::new(),
        }
    }

    /// With what to change.
    #[must_use]
    pub fn remedy(self, remedy: impl Into<String>) -> FieldError {
        FieldError { remedy: with_short_numbers(&remedy.into()), ..self }
    }

    /// Below another field: `prefix` comes before the pointer.
    #[must_use]
    pub fn below(self, prefix: &str) -> FieldError {
        FieldError { pointer: format!("{prefix}{}", self.pointer), ..self }
    }

    fn place(&self) -> String {
        if self.pointer.is_empty() { String::new() } else { format!("{} ", self.pointer) }
    }

    fn found(&self) -> String {
        if self.value.is_empty() { "is missing:".into() } else { format!("is {};", self.value) }
    }

    fn advice(&self) -> String {
        if self.remedy.is_empty() { String::new() } else { format!("; {}", self.remedy) }
    }
}

/// All errors in one line each.
pub fn in_lines(errors: &[FieldError]) -> String {
    errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// One step of a JSON pointer, with `~` and `/` escaped.
pub fn escaped(name: &str) -> String {
    name.replace('~', "~0").replace('/', "~1")
}

/// Adds an error for `value` outside `range` (NaN is outside every range).
pub fn within(errors: &mut Vec<FieldError>, pointer: &str, value: f64, range: std::ops::RangeInclusive<f64>) {
    if !range.contains(&value) {
        let allowed = format!("from {} to {}", range.start(), range.end());
        errors.push(FieldError::new(pointer, value, allowed));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_reads_as_a_sentence() {
        let error = FieldError::new("/holes/1/diameter_mm", -3.0, "from 0.1 to 1000").remedy("give a length in mm");
        let below = error.below("/specimen").to_string();
        assert_eq!(below, "/specimen/holes/1/diameter_mm is -3; it must be from 0.1 to 1000; give a length in mm");
        assert_eq!(FieldError::new("/a", "", "given").to_string(), "/a is missing: it must be given");
    }

    #[test]
    fn no_range_holds_nan() {
        let mut errors = Vec::new();
        within(&mut errors, "/beta", f64::NAN, 0.0..=1.0);
        within(&mut errors, "/beta", 0.5, 0.0..=1.0);
        assert_eq!(errors.len(), 1);
        assert_eq!(escaped("a/b~c"), "a~1b~0c");
    }
}
