//! A request's type as JSON Schema: what its fields may hold, and which of them do not.
//!
//! The schema comes from the request's own type ([`utoipa::ToSchema`]), so that the OpenAPI document, the options of
//! the command, the reference in the docs and the check before a job starts cannot differ.

use crate::field::{FieldError, escaped};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use utoipa::ToSchema;

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

    fn resolved<'a>(&'a self, schema: &'a Value) -> &'a Value {
        let name = schema.get("$ref").and_then(Value::as_str).and_then(|r| r.rsplit('/').next());
        name.and_then(|n| self.components.get(n)).unwrap_or(schema)
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
    fn check_branches(&self, branches: &[Value], value: &Value, pointer: &str, errors: &mut Vec<FieldError>) {
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

    fn check_object(&self, schema: &Value, fields: &Map<String, Value>, pointer: &str, errors: &mut Vec<FieldError>) {
        let properties = schema.get("properties").and_then(Value::as_object);
        for name in schema.get("required").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str) {
            if !fields.contains_key(name) {
                errors.push(FieldError::new(format!("{pointer}/{}", escaped(name)), "", "given"));
            }
        }
        let is_required = |name: &str| {
            let required = schema.get("required").and_then(Value::as_array);
            required.is_some_and(|r| r.iter().any(|n| n.as_str() == Some(name)))
        };
        let is_closed = schema.get("additionalProperties") == Some(&Value::Bool(false));
        for (name, value) in fields {
            let place = format!("{pointer}/{}", escaped(name));
            match properties.and_then(|p| p.get(name)) {
                // A field that may be left out may be null as well.
                Some(_) if value.is_null() && !is_required(name) => {}
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
        "integer" => value.is_u64() || value.is_i64(),
        "number" => value.is_number(),
        _ => true,
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Serialize;
    use serde_json::json;

    #[derive(Serialize, ToSchema)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Inner {
        /// Edges, mm.
        #[schema(min_items = 3, max_items = 3)]
        voxel_mm: [f64; 3],
    }

    #[derive(Serialize, ToSchema)]
    #[serde(rename_all = "snake_case")]
    #[allow(dead_code)]
    enum Word {
        Left,
        Right,
    }

    #[derive(Serialize, ToSchema)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Outer {
        /// Which side.
        side: Word,
        /// How often.
        #[serde(default)]
        #[schema(minimum = 1, maximum = 20, default = 3)]
        count: usize,
        /// Weight.
        #[schema(exclusive_minimum = 0.0)]
        weight: Option<f64>,
        /// The grid.
        inner: Option<Inner>,
    }

    fn pointers(value: &Value) -> Vec<String> {
        RequestSchema::of::<Outer>().errors(value).into_iter().map(|e| e.pointer).collect()
    }

    #[test]
    fn all_errors_are_named_at_once() {
        assert!(pointers(&json!({ "side": "left" })).is_empty());
        assert!(pointers(&json!({ "side": "left", "weight": null, "inner": { "voxel_mm": [1, 2, 3] } })).is_empty());
        let wrong =
            json!({ "side": "up", "count": 0, "weight": 0.0, "inner": { "voxel_mm": [1, 2], "a/b": 1 }, "x": 1 });
        let mut found = pointers(&wrong);
        found.sort();
        assert_eq!(found, ["/count", "/inner/a~1b", "/inner/voxel_mm", "/side", "/weight", "/x"]);
        assert_eq!(pointers(&json!({ "count": 1.5 })), ["/side", "/count"]);
        assert_eq!(pointers(&json!([])), [""]);
        let text = RequestSchema::of::<Outer>().errors(&json!({ "side": "left", "count": 21 }))[0].to_string();
        assert_eq!(text, "/count is 21; it must be from 1 to 20");
    }

    #[test]
    fn fields_carry_form_default_and_range() {
        let fields = RequestSchema::of::<Outer>().fields();
        let field = |name: &str| fields.iter().find(|f| f.name == name).unwrap().clone();
        assert_eq!(field("side").form, FieldForm::Choice(vec!["left".into(), "right".into()]));
        let count = field("count");
        assert_eq!(
            (count.form, count.range.as_str(), count.default),
            (FieldForm::Integer, "from 1 to 20", Some(json!(3)))
        );
        assert_eq!(field("weight").range, "above 0");
        assert_eq!(field("inner/voxel_mm").form, FieldForm::Tuple(3));
        assert!(field("side").is_required && !field("count").is_required);
    }
}
