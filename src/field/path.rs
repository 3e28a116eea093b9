//! Where a field stands: names and indices from the outside in.

use super::escaped;
use std::fmt;

/// The way to a field of a value, as in `holes[1].diameter_mm`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FieldPath(Vec<Segment>);

#[derive(Clone, Debug, PartialEq, Eq)]
enum Segment {
    Name(String),
    Index(usize),
}

impl FieldPath {
    /// The field `name` of the value itself.
    pub fn of(name: &str) -> FieldPath {
        FieldPath::default().name(name)
    }

    /// The field `name` of what the path leads to.
    #[must_use]
    pub fn name(mut self, name: &str) -> FieldPath {
        self.0.push(Segment::Name(name.into()));
        self
    }

    /// The entry with this index (from 0) of what the path leads to.
    #[must_use]
    pub fn index(mut self, index: usize) -> FieldPath {
        self.0.push(Segment::Index(index));
        self
    }

    /// The same way as a JSON pointer (RFC 6901): `/holes/1/diameter_mm`; empty for the value itself.
    pub fn pointer(&self) -> String {
        let step = |segment: &Segment| match segment {
            Segment::Name(name) => format!("/{}", escaped(name)),
            Segment::Index(index) => format!("/{index}"),
        };
        self.0.iter().map(step).collect()
    }
}

impl fmt::Display for FieldPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, segment) in self.0.iter().enumerate() {
            match segment {
                Segment::Name(name) if position == 0 => f.write_str(name)?,
                Segment::Name(name) => write!(f, ".{name}")?,
                Segment::Index(index) => write!(f, "[{index}]")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_written_in_two_ways() {
        let path = FieldPath::of("holes").index(1).name("a/b");
        assert_eq!((path.to_string().as_str(), path.pointer().as_str()), ("holes[1].a/b", "/holes/1/a~1b"));
        assert_eq!(FieldPath::default().pointer(), "");
    }
}
