//! The file form and its schema say the same as the types and the validators.

use super::super::{MAX_DIAMETER_MM, MAX_DRIVES, MAX_HOLES, MAX_SIZE_MM, MIN_DIAMETER_MM, MIN_SIZE_MM};
use super::*;
use serde_json::{Value, json};
use utoipa::{PartialSchema, ToSchema};

/// Schemas by name: that of a specimen and all that it refers to.
fn schemas() -> Value {
    let mut named = vec![(Specimen::name().into_owned(), Specimen::schema())];
    Specimen::schemas(&mut named);
    serde_json::to_value(named.into_iter().collect::<std::collections::BTreeMap<_, _>>()).expect("it serialises")
}

fn property<'a>(schemas: &'a Value, schema: &str, name: &str) -> &'a Value {
    let property = &schemas[schema]["properties"][name];
    let reference = property["$ref"].as_str().and_then(|r| r.rsplit('/').next());
    reference.map_or(property, |name| &schemas[name])
}

#[test]
fn the_schema_has_the_limits_of_the_validator() {
    let schemas = schemas();
    let of = |schema, name| property(&schemas, schema, name);
    let extent = of("BlockSchema", "width_mm");
    assert_eq!((extent["minimum"].as_f64(), extent["maximum"].as_f64()), (Some(MIN_SIZE_MM), Some(MAX_SIZE_MM)));
    let diameter = of("HoleSchema", "diameter_mm");
    let limits = (diameter["minimum"].as_f64(), diameter["maximum"].as_f64());
    assert_eq!(limits, (Some(MIN_DIAMETER_MM), Some(MAX_DIAMETER_MM)));
    assert_eq!(of("SpecimenSchema", "holes")["maxItems"], json!(MAX_HOLES));
    assert_eq!(of("SpecimenSchema", "drive_mm")["maxItems"], json!(MAX_DRIVES));
    assert_eq!(of("SpecimenSchema", "schema")["enum"], json!([SCHEMA]));
    assert_eq!(schemas["HoleSchema"]["additionalProperties"], json!(false));
}

/// Every reference leads somewhere.
#[test]
fn references_are_defined() {
    fn visit(value: &Value, schemas: &Value) {
        match value {
            Value::Object(fields) => {
                if let Some(name) = fields.get("$ref").and_then(Value::as_str).and_then(|r| r.rsplit('/').next()) {
                    assert!(schemas.get(name).is_some(), "{name} is not defined");
                }
                fields.values().for_each(|v| visit(v, schemas));
            }
            Value::Array(list) => list.iter().for_each(|v| visit(v, schemas)),
            _ => {}
        }
    }
    let schemas = schemas();
    visit(&schemas, &schemas);
}

/// The tag stands first, and is needed to read.
#[test]
fn the_tag_is_of_the_file() {
    let text = include_str!("../../geometries/two-hole-shear.json");
    let specimen = Specimen::from_json(text).expect("it is valid");
    let written = serde_json::to_string(&specimen).expect("it serialises");
    assert!(written.starts_with(r#"{"schema":"specimen/1","name":"#), "{written}");
    let mut value = serde_json::to_value(&specimen).expect("it serialises");
    assert_eq!(serde_json::from_value::<Specimen>(value.clone()).expect("it reads back"), specimen);
    value.as_object_mut().map(|fields| fields.remove("schema"));
    assert!(serde_json::from_value::<Specimen>(value.clone()).is_err(), "without a tag");
    value["schema"] = json!("specimen/2");
    assert!(serde_json::from_value::<Specimen>(value).is_err(), "with another tag");
}
