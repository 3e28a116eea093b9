//! Where in a JSON text something went wrong: line, column and the field's path.

/// A JSON text that does not fit the schema.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JsonProblem {
    /// Line, from 1 (0 where the position is unknown).
    pub line: usize,
    /// Column in bytes, from 1.
    pub column: usize,
    /// Path of the field, as in `holes[1].diameter_mm`; `(root)` for the whole text.
    pub field: String,
    /// What is wrong, without the position.
    pub message: String,
}

impl std::fmt::Display for JsonProblem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "line {}, column {}, field {}: {}", self.line, self.column, self.field, self.message)
    }
}

impl JsonProblem {
    /// Describes `error`, which parsing `text` gave.
    pub(crate) fn new(text: &str, error: &serde_json::Error) -> Self {
        let full = error.to_string();
        let position = format!(" at line {} column {}", error.line(), error.column());
        let message = full.strip_suffix(&position).unwrap_or(&full).to_string();
        let frames = frames_at(text, error.line(), error.column());
        let missing = message.strip_prefix("missing field `").and_then(|rest| rest.split('`').next());
        let field = match missing {
            Some(name) => {
                let parent = path(&frames[..frames.len().saturating_sub(1)]);
                if parent.is_empty() { name.to_string() } else { format!("{parent}.{name}") }
            }
            None => path(&frames),
        };
        let field = if field.is_empty() { "(root)".to_string() } else { field };
        JsonProblem { line: error.line(), column: error.column(), field, message }
    }
}

/// One open bracket of the text.
enum Frame {
    Object { key: String, is_key_next: bool },
    Array { index: usize },
}

fn path(frames: &[Frame]) -> String {
    let mut out = String::new();
    for frame in frames {
        match frame {
            Frame::Object { key, .. } if key.is_empty() => {}
            Frame::Object { key, .. } => {
                if !out.is_empty() {
                    out.push('.');
                }
                out.push_str(key);
            }
            Frame::Array { index } => out.push_str(&format!("[{index}]")),
        }
    }
    out
}

/// The brackets open at a position that serde_json reported. The reported column is that of the last byte read,
/// so a closing bracket or comma there still belongs to the value that it ends.
fn frames_at(text: &str, line: usize, column: usize) -> Vec<Frame> {
    let bytes = text.as_bytes();
    let line_start: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    let mut end = (line_start + column).min(bytes.len());
    if end > line_start && matches!(bytes[end - 1], b'}' | b']' | b',') {
        end -= 1;
    }
    let mut frames: Vec<Frame> = Vec::new();
    let mut position = 0;
    while position < end {
        match bytes[position] {
            b'{' => frames.push(Frame::Object { key: String::new(), is_key_next: true }),
            b'[' => frames.push(Frame::Array { index: 0 }),
            b'}' | b']' => {
                frames.pop();
            }
            b',' => match frames.last_mut() {
                Some(Frame::Object { is_key_next, .. }) => *is_key_next = true,
                Some(Frame::Array { index }) => *index += 1,
                None => {}
            },
            b'"' => {
                let start = position + 1;
                position = start;
                while position < bytes.len() && bytes[position] != b'"' {
                    position += if bytes[position] == b'\\' { 2 } else { 1 };
                }
                if let Some(Frame::Object { key, is_key_next }) = frames.last_mut()
                    && *is_key_next
                {
                    *key = String::from_utf8_lossy(&bytes[start..position.min(bytes.len())]).into_owned();
                    *is_key_next = false;
                }
            }
            _ => {}
        }
        position += 1;
    }
    frames
}

/// The text's `schema`, where the text is an object with a string of that name. Used to tell a wrong schema
/// from a wrong field.
pub(crate) fn schema_of(text: &str) -> Option<String> {
    #[derive(serde::Deserialize)]
    struct Header {
        schema: String,
    }
    serde_json::from_str::<Header>(text).ok().map(|header| header.schema)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::Specimen;

    fn problem(text: &str) -> JsonProblem {
        JsonProblem::new(text, &serde_json::from_str::<Specimen>(text).unwrap_err())
    }

    #[test]
    fn names_the_field_at_the_position() {
        let block = r#""block": {"length_mm": 1, "thickness_mm": 1, "width_mm": 1}"#;
        let wrong_type = format!(
            "{{\"schema\": \"specimen/1\", {block},\n \"holes\": [{{\"axis\": \"width\", \"center_mm\": [0, 0], \"diameter_mm\": 1}},\n {{\"axis\": \"width\", \"center_mm\": [0, 0], \"diameter_mm\": \"a\"}}]}}"
        );
        let found = problem(&wrong_type);
        assert_eq!((found.line, found.field.as_str()), (3, "holes[1].diameter_mm"), "{found}");

        let missing = problem(r#"{"schema": "specimen/1", "block": {"length_mm": 1, "width_mm": 1}}"#);
        assert_eq!(missing.field, "block.thickness_mm", "{missing}");

        let unknown = problem(r#"{"schema": "specimen/1", "block": {"length_mm": 1, "height_mm": 2}}"#);
        assert_eq!(unknown.field, "block.height_mm", "{unknown}");

        let variant = problem(r#"{"schema": "specimen/1", "test": "pure_shear"}"#);
        assert_eq!(variant.field, "test", "{variant}");

        let huge = problem(r#"{"schema": "specimen/1", "block": {"length_mm": 1e999}}"#);
        assert_eq!(huge.field, "block.length_mm", "{huge}");

        assert_eq!(problem("").field, "(root)");
        assert_eq!(problem("[1, 2").field, "[0]");
    }
}
