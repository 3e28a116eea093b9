//! A request's type as JSON Schema: what its fields may hold, and which of them do not.
//!
//! The schema comes from the request's own type ([`utoipa::ToSchema`]), so that the OpenAPI document, the options of
//! the command, the reference in the docs and the check before a job starts cannot differ.

use crate::field::{FieldError, escaped};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use utoipa::ToSchema;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::Schema;

/// The JSON Schema of a type with everything that it refers to.
#[derive(Clone, Debug)]
pub struct RequestSchema {
    root: Value,
    components: BTreeMap<String, Value>,
}

/// How the value of a request's field looks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FieldForm {
    /// A number.
    Number,
    /// A whole number.
    Integer,
    /// True or false.
    Boolean,
    /// Text.
    Text,
    /// One of these words.
    Choice(Vec<String>),
    /// A list of these words.
    Choices(Vec<String>),
    /// This many numbers.
    Tuple(u64),
    /// A list of numbers.
    Numbers,
    /// A list of texts.
    Texts,
    /// A list of objects.
    Objects,
    /// An object, or one of several forms.
    Other,
}

/// A field of a request, for options and the reference.
#[derive(Clone, Debug, PartialEq)]
pub struct RequestField {
    /// Name; of a field of a field with a slash, such as `scan/voxel_mm`.
    pub name: String,
    /// What it means.
    pub about: String,
    /// How its value looks.
    pub form: FieldForm,
    /// Its value where it is left out.
    pub default: Option<Value>,
    /// What numbers it may hold, in words; empty for any.
    pub range: String,
    /// Whether it must be given.
    pub is_required: bool,
}

impl RequestSchema {
    /// The schema of `T`.
    pub fn of<T: ToSchema>() -> RequestSchema {
        let mut parts = Vec::new();
        T::schemas(&mut parts);
        let value = |schema| serde_json::to_value(schema).unwrap_or_default();
        let components = parts.into_iter().map(|(name, schema)| (name, value(schema))).collect();
        RequestSchema { root: value(T::schema()), components }
    }

    /// One of several schemas that refer to each other by their names.
    pub fn among(name: &str, parts: &[(String, RefOr<Schema>)]) -> RequestSchema {
        let value = |schema| serde_json::to_value(schema).unwrap_or_default();
        let components: BTreeMap<String, Value> = parts.iter().map(|(name, s)| (name.clone(), value(s))).collect();
        RequestSchema { root: components.get(name).cloned().unwrap_or_default(), components }
    }

    fn resolved<'a>(&'a self, schema: &'a Value) -> &'a Value {
        let name = schema.get("$ref").and_then(Value::as_str).and_then(|r| r.rsplit('/').next());
        name.and_then(|n| self.components.get(n)).unwrap_or(schema)
    }

    /// `value` with whole numbers written as such where the schema asks for them: to JSON Schema 7.0 is one, too.
    pub fn settled(&self, value: &Value) -> Value {
        let mut settled = value.clone();
        self.settle(&self.root, &mut settled);
        settled
    }

    fn settle(&self, schema: &Value, value: &mut Value) {
        let schema = self.resolved(schema);
        for name in ["allOf", "oneOf", "anyOf"] {
            for part in schema.get(name).and_then(Value::as_array).into_iter().flatten() {
                self.settle(part, value);
            }
        }
        match value {
            Value::Number(number) => {
                let is_wanted = type_names(schema).is_some_and(|t| t.contains(&"integer") && !t.contains(&"number"));
                if let Some(whole) = number.as_f64().filter(|v| is_wanted && number.is_f64() && is_whole(*v)) {
                    *number = (whole as i64).into();
                }
            }
            Value::Array(items) => {
                let each = schema.get("items");
                each.into_iter().for_each(|each| items.iter_mut().for_each(|item| self.settle(each, item)));
            }
            Value::Object(fields) => {
                for (name, field) in schema.get("properties").and_then(Value::as_object).into_iter().flatten() {
                    fields.get_mut(name).into_iter().for_each(|inner| self.settle(field, inner));
                }
            }
            Value::Null | Value::Bool(_) | Value::String(_) => {}
        }
    }

    /// Every field of `value` that does not hold what it may hold.
    pub fn errors(&self, value: &Value) -> Vec<FieldError> {
        let mut errors = Vec::new();
        self.check(&self.root, value, "", &mut errors);
        errors
    }

    fn check(&self, schema: &Value, value: &Value, pointer: &str, errors: &mut Vec<FieldError>) {
        let schema = self.resolved(schema);
        for part in schema.get("allOf").and_then(Value::as_array).into_iter().flatten() {
            self.check(part, value, pointer, errors);
        }
        if let Some(branches) = schema.get("oneOf").or_else(|| schema.get("anyOf")).and_then(Value::as_array) {
            self.check_branches(branches, value, pointer, errors);
        }
        if let Some(allowed) = schema.get("enum").and_then(Value::as_array)
            && !allowed.contains(value)
        {
            let words: Vec<String> = allowed.iter().map(Value::to_string).collect();
            return errors.push(FieldError::new(pointer, shown(value), words.join(" or ")));
        }
        if let Some(types) = type_names(schema)
            && !types.iter().any(|t| is_of_type(value, t))
        {
            let words: Vec<&str> = types.iter().map(|t| type_in_words(t)).collect();
            return errors.push(FieldError::new(pointer, shown(value), words.join(" or ")));
        }
        match value {
            Value::Number(number) => check_number(schema, number.as_f64().unwrap_or(f64::NAN), pointer, errors),
            Value::String(text) => {
                check_count(schema, ["minLength", "maxLength"], text.chars().count(), pointer, errors)
            }
            Value::Array(items) => {
                check_count(schema, ["minItems", "maxItems"], items.len(), pointer, errors);
                if let Some(each) = schema.get("items") {
                    for (index, item) in items.iter().enumerate() {
                        self.check(each, item, &format!("{pointer}/{index}"), errors);
                    }
                }
            }
            Value::Object(fields) => self.check_object(schema, fields, pointer, errors),
            Value::Null | Value::Bool(_) => {}
        }
    }

    /// One branch must fit; of those that do not, the errors of the one that fits best are told.
    /// Files of several formats say themselves which one is meant.
    fn check_branches(&self, branches: &[Value], value: &Value, pointer: &str, errors: &mut Vec<FieldError>) {
        let formats: Option<Vec<&Value>> = branches.iter().map(|branch| self.format_of(branch)).collect();
        if let (Some(formats), Value::Object(fields)) = (formats, value) {
            let said = fields.get("schema");
            if let Some(at) = said.and_then(|said| formats.iter().position(|format| *format == said)) {
                return self.check(&branches[at], value, pointer, errors);
            }
            let words: Vec<String> = formats.into_iter().map(Value::to_string).collect();
            let said = said.map(shown).unwrap_or_default();
            return errors.push(FieldError::new(format!("{pointer}/schema"), said, words.join(" or ")));
        }
        let mut best: Option<Vec<FieldError>> = None;
        for branch in branches {
            let mut found = Vec::new();
            self.check(branch, value, pointer, &mut found);
            if found.is_empty() {
                return;
            }
            // A branch whose type is another one says nothing about the fields.
            let depth = |list: &[FieldError]| list.iter().map(|e| e.pointer.len()).max().unwrap_or(0);
            let rank = |list: &[FieldError]| (usize::MAX - depth(list), list.len());
            if best.as_ref().is_none_or(|b| rank(&found) < rank(b)) {
                best = Some(found);
            }
        }
        errors.extend(best.unwrap_or_default());
    }

    /// The only text that the field `schema` of an object may hold; `None` of other types.
    fn format_of<'a>(&'a self, schema: &'a Value) -> Option<&'a Value> {
        let field = self.resolved(self.resolved(schema).get("properties")?.get("schema")?);
        match field.get("enum").and_then(Value::as_array)?.as_slice() {
            [only] => Some(only),
            _ => None,
        }
    }

    fn check_object(&self, schema: &Value, fields: &Map<String, Value>, pointer: &str, errors: &mut Vec<FieldError>) {
        let properties = schema.get("properties").and_then(Value::as_object);
        for name in schema.get("required").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str) {
            if !fields.contains_key(name) {
                errors.push(FieldError::new(format!("{pointer}/{}", escaped(name)), "", "given"));
            }
        }
        let is_closed = schema.get("additionalProperties") == Some(&Value::Bool(false));
        for (name, value) in fields {
            let place = format!("{pointer}/{}", escaped(name));
            match properties.and_then(|p| p.get(name)) {
                Some(field) => self.check(field, value, &place, errors),
                None if is_closed => {
                    let known: Vec<&str> = properties.into_iter().flatten().map(|(n, _)| n.as_str()).collect();
                    let remedy = format!("the known fields are {}", known.join(", "));
                    errors.push(FieldError::new(place, shown(value), "left out").remedy(remedy));
                }
                None => {}
            }
        }
    }

    /// The fields of the type, those of fields that are objects of few plain fields included.
    pub fn fields(&self) -> Vec<RequestField> {
        let mut fields = Vec::new();
        self.collect_fields("", &self.root, &mut fields);
        fields
    }

    fn collect_fields(&self, prefix: &str, schema: &Value, fields: &mut Vec<RequestField>) {
        let schema = self.resolved(schema);
        let required: Vec<&str> =
            schema.get("required").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str).collect();
        for (name, property) in schema.get("properties").and_then(Value::as_object).into_iter().flatten() {
            let inner = self.without_null(property);
            let text = |s: &Value| s.get("description").and_then(Value::as_str).map(String::from);
            let name_of_field = format!("{prefix}{name}");
            fields.push(RequestField {
                about: text(property).or_else(|| text(inner)).unwrap_or_default(),
                form: self.form_of(inner),
                default: property.get("default").or_else(|| inner.get("default")).cloned(),
                range: range_in_words(inner),
                is_required: required.contains(&name.as_str()),
                name: name_of_field.clone(),
            });
            if prefix.is_empty() && inner.get("properties").is_some() {
                self.collect_fields(&format!("{name_of_field}/"), inner, fields);
            }
        }
    }

    fn form_of(&self, schema: &Value) -> FieldForm {
        form_of(schema, schema.get("items").map(|items| self.resolved(items)))
    }

    /// The schema of a value that is there, of a field that may be null.
    fn without_null<'a>(&'a self, schema: &'a Value) -> &'a Value {
        let schema = self.resolved(schema);
        let branches = schema.get("oneOf").and_then(Value::as_array);
        let is_null = |s: &&Value| s.get("type").and_then(Value::as_str) == Some("null");
        match branches.map(|b| b.iter().filter(|s| !is_null(s)).collect::<Vec<_>>()) {
            Some(rest) if rest.len() == 1 => self.resolved(rest[0]),
            _ => schema,
        }
    }
}

/// JSON of a value, cut where it is long.
fn shown(value: &Value) -> String {
    let text = value.to_string();
    if text.chars().count() <= 80 { text } else { text.chars().take(77).chain("...".chars()).collect() }
}

fn type_names(schema: &Value) -> Option<Vec<&str>> {
    match schema.get("type")? {
        Value::String(name) => Some(vec![name]),
        Value::Array(names) => Some(names.iter().filter_map(Value::as_str).collect()),
        _ => None,
    }
}

fn is_of_type(value: &Value, name: &str) -> bool {
    match name {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        "integer" => value.is_u64() || value.is_i64() || value.as_f64().is_some_and(is_whole),
        "number" => value.is_number(),
        _ => true,
    }
}

/// Whether a number is a whole one that every reader of JSON holds exactly.
fn is_whole(value: f64) -> bool {
    value.fract() == 0.0 && value.abs() < (1u64 << 53) as f64
}

fn type_in_words(name: &str) -> &str {
    match name {
        "boolean" => "true or false",
        "string" => "a text",
        "array" => "a list",
        "object" => "an object",
        "integer" => "a whole number",
        "number" => "a number",
        other => other,
    }
}

fn limit(schema: &Value, name: &str) -> Option<f64> {
    schema.get(name).and_then(Value::as_f64)
}

fn check_number(schema: &Value, value: f64, pointer: &str, errors: &mut Vec<FieldError>) {
    let is_within = limit(schema, "minimum").is_none_or(|l| value >= l)
        && limit(schema, "maximum").is_none_or(|l| value <= l)
        && limit(schema, "exclusiveMinimum").is_none_or(|l| value > l)
        && limit(schema, "exclusiveMaximum").is_none_or(|l| value < l);
    if !is_within {
        errors.push(FieldError::new(pointer, value, range_in_words(schema)));
    }
}

fn check_count(schema: &Value, names: [&str; 2], count: usize, pointer: &str, errors: &mut Vec<FieldError>) {
    let [least, most] = names.map(|name| schema.get(name).and_then(Value::as_u64));
    let count = count as u64;
    if least.is_none_or(|l| count >= l) && most.is_none_or(|m| count <= m) {
        return;
    }
    let what = if names[0] == "minItems" { "entries" } else { "characters" };
    let allowed = match (least, most) {
        (Some(l), Some(m)) if l == m => format!("{l} {what}"),
        (Some(l), Some(m)) => format!("{l} to {m} {what}"),
        (Some(l), None) => format!("at least {l} {what}"),
        (None, most) => format!("at most {} {what}", most.unwrap_or(0)),
    };
    errors.push(FieldError::new(pointer, format!("{count} {what}"), allowed));
}

/// The numbers that a schema allows, as the end of "it must be …"; empty for any.
fn range_in_words(schema: &Value) -> String {
    let low = limit(schema, "minimum").map(|l| (l, "at least"));
    let low = low.or_else(|| limit(schema, "exclusiveMinimum").map(|l| (l, "above")));
    let high = limit(schema, "maximum").map(|h| (h, "at most"));
    let high = high.or_else(|| limit(schema, "exclusiveMaximum").map(|h| (h, "below")));
    match (low, high) {
        (Some((l, "at least")), Some((h, "at most"))) => format!("from {} to {}", short(l), short(h)),
        (Some((l, from)), Some((h, to))) => format!("{from} {} and {to} {}", short(l), short(h)),
        (Some((l, word)), None) | (None, Some((l, word))) => format!("{word} {}", short(l)),
        (None, None) => String::new(),
    }
}

/// A limit without a row of zeros.
fn short(limit: f64) -> String {
    let is_plain = limit == 0.0 || (1e-4..1e6).contains(&limit.abs());
    if is_plain { limit.to_string() } else { format!("{limit:e}") }
}

/// The words of a schema that allows some words alone.
fn words_of(schema: &Value) -> Option<Vec<String>> {
    let words = schema.get("enum").and_then(Value::as_array)?;
    Some(words.iter().filter_map(Value::as_str).map(String::from).collect())
}

/// The form of a field; `items` is the schema of a list's entries.
fn form_of(schema: &Value, items: Option<&Value>) -> FieldForm {
    if let Some(words) = words_of(schema) {
        return FieldForm::Choice(words);
    }
    if let Some(words) = items.and_then(words_of) {
        return FieldForm::Choices(words);
    }
    let is_text = |s: &Value| type_names(s).is_some_and(|t| t.contains(&"string"));
    let is_number = |s: &Value| type_names(s).is_some_and(|t| t.contains(&"number") || t.contains(&"integer"));
    match type_names(schema).and_then(|t| t.into_iter().find(|t| *t != "null")) {
        Some("number") => FieldForm::Number,
        Some("integer") => FieldForm::Integer,
        Some("boolean") => FieldForm::Boolean,
        Some("string") => FieldForm::Text,
        Some("array") if items.is_some_and(is_text) => FieldForm::Texts,
        Some("array") if items.is_some_and(is_number) => {
            let [least, most] = ["minItems", "maxItems"].map(|n| schema.get(n).and_then(Value::as_u64));
            match (least, most) {
                (Some(l), Some(m)) if l == m => FieldForm::Tuple(l),
                _ => FieldForm::Numbers,
            }
        }
        Some("array") => FieldForm::Objects,
        _ => FieldForm::Other,
    }
}
