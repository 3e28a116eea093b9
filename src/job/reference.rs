//! The reference of all requests, for the docs: what each kind of job takes, from the requests' own types.

use super::schema::{FieldForm, RequestField};
use super::{KINDS, Kind};

/// The reference as Markdown.
pub fn reference() -> String {
    let mut text = String::from(
        "# Requests\n\n\
         What each kind of job takes. `lambdak run KIND REQUEST.json` runs a request from a file; the service takes it by\n\
         `POST` at the address given. Fields that are left out have the default. Unknown fields are errors.\n\
         This page is written by the program (`LAMBDAK_WRITE_REFERENCE=1 cargo test --lib reference`); a test compares it.\n",
    );
    for kind in &KINDS {
        text += &section(kind);
    }
    text
}

fn section(kind: &Kind) -> String {
    let mut text = format!("\n## {}\n\n{}\n\n`POST /v1/{}`\n\n", kind.command, kind.about, kind.collection);
    text += "| field | value | default | meaning |\n|---|---|---|---|\n";
    for field in kind.fields() {
        let name = field.name.replace('/', ".");
        let default = match &field.default {
            _ if field.is_required => "required".into(),
            Some(value) if value.to_string().len() <= 40 => format!("`{value}`"),
            _ => String::new(),
        };
        text += &format!("| `{name}` | {} | {default} | {} |\n", value_in_words(&field), cell(&field.about));
    }
    text
}

fn value_in_words(field: &RequestField) -> String {
    let form = match &field.form {
        FieldForm::Number => "number".into(),
        FieldForm::Integer => "whole number".into(),
        FieldForm::Boolean => "true or false".into(),
        FieldForm::Text => "text".into(),
        FieldForm::Choice(words) => words.iter().map(|w| format!("`{w}`")).collect::<Vec<_>>().join(", "),
        FieldForm::Choices(words) => {
            format!("list of {}", words.iter().map(|w| format!("`{w}`")).collect::<Vec<_>>().join(", "))
        }
        FieldForm::Tuple(count) => format!("{count} numbers"),
        FieldForm::Numbers => "list of numbers".into(),
        FieldForm::Texts => "list of texts".into(),
        FieldForm::Objects => "list of objects".into(),
        FieldForm::Other => "object or one of several forms".into(),
    };
    if field.range.is_empty() { form } else { format!("{form} {}", field.range) }
}

/// Text that fits into a cell of a table.
fn cell(text: &str) -> String {
    text.replace('\n', " ").replace('|', "\\|")
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_example_is_a_request_that_can_be_run() {
        // Whole results would fill pages: the example of a comparison shows its form alone.
        for kind in super::KINDS.iter().filter(|kind| kind.command != "compare") {
            let example = kind.example();
            let found = kind.job(&example);
            assert!(found.is_ok(), "{}: {:?}", kind.command, found.err());
        }
    }

    #[test]
    fn the_page_is_current() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/requests.md");
        let text = super::reference();
        if std::env::var_os("LAMBDAK_WRITE_REFERENCE").is_some() {
            std::fs::write(path, &text).unwrap();
        }
        let kept = std::fs::read_to_string(path).unwrap_or_default();
        assert!(kept == text, "docs/requests.md is not what the code says; LAMBDAK_WRITE_REFERENCE=1 writes it");
    }
}
