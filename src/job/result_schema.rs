//! What the result of a kind of job looks like, as JSON Schema for the document of the service.

use super::schema::RequestSchema;
use crate::field::FieldError;
use serde_json::{Value, json};
use utoipa::ToSchema;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::Schema;

/// The schemas of a kind's results: one, or several of which every result has one.
#[derive(Clone, Default)]
pub struct ResultSchema {
    /// Names of the results' own schemas.
    pub names: Vec<String>,
    /// All schemas by name: the results' own and those that they refer to. Of a result within another one the first
    /// says most.
    pub parts: Vec<(String, RefOr<Schema>)>,
}

impl ResultSchema {
    /// Results of the type `T`, whose field `schema` always holds `tag`.
    pub fn of<T: ToSchema>(tag: &str) -> ResultSchema {
        ResultSchema::with::<T>(tag, &[])
    }

    /// As [`of`](Self::of), with further fields that are texts and always there.
    pub fn with<T: ToSchema>(tag: &str, texts: &[(&str, &str)]) -> ResultSchema {
        let name = T::name().into_owned();
        let mut parts = vec![(name.clone(), tagged(&T::schema(), tag, texts))];
        T::schemas(&mut parts);
        ResultSchema { names: vec![name], parts }
    }

    /// Every field of a result that is not what its schema says: the first schema's of those that `result` fits best.
    pub fn errors(&self, result: &Value) -> Vec<FieldError> {
        let all = self.names.iter().map(|name| RequestSchema::among(name, &self.parts).errors(result));
        all.min_by_key(Vec::len).unwrap_or_default()
    }

    /// These, or the other ones.
    pub fn or(mut self, other: ResultSchema) -> ResultSchema {
        self.names.extend(other.names);
        self.parts.extend(other.parts);
        self
    }
}

/// The schema of a result whose field `schema` holds `tag` alone, and which has further texts.
fn tagged(schema: &RefOr<Schema>, tag: &str, texts: &[(&str, &str)]) -> RefOr<Schema> {
    let mut object = serde_json::to_value(schema).unwrap_or_default();
    object["properties"]["schema"] = json!({ "type": "string", "enum": [tag], "description": "The format." });
    let mut required = vec![Value::from("schema")];
    for (name, about) in texts {
        object["properties"][name] = json!({ "type": "string", "description": about });
        required.push(Value::from(*name));
    }
    match object.get_mut("required").and_then(Value::as_array_mut) {
        Some(list) => {
            required.retain(|name| !list.contains(name));
            list.extend(required);
        }
        None => object["required"] = required.into(),
    }
    serde_json::from_value(object).unwrap_or_else(|_| schema.clone())
}
