//! What the document says, and whether it is true.

use super::service_common::Service;
use lambdak::job::KINDS;
use serde_json::{Value, json};

#[test]
fn openapi_document_is_current() {
    let (_, text) = lambdak::service::open_api();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/api/openapi.json");
    if std::env::var_os("LAMBDAK_WRITE_OPENAPI").is_some() {
        std::fs::write(path, &text).unwrap();
    }
    let kept = std::fs::read_to_string(path).unwrap();
    assert!(kept == text, "api/openapi.json is not what the code says; LAMBDAK_WRITE_OPENAPI=1 writes it");
    let document: Value = serde_json::from_str(&text).unwrap();
    assert!(document["openapi"].as_str().unwrap().starts_with("3.1"));
    for kind in &KINDS {
        assert!(document["paths"][format!("/v1/{}", kind.collection)].is_object(), "{} is not described", kind.command);
    }
    let mut untold = Vec::new();
    find_untold_lists(&document["components"], "", &mut untold);
    assert!(untold.is_empty(), "lists of which nothing, or a tuple, is said: {untold:?}");
    let mut names = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            names.push(operation["operationId"].as_str().unwrap_or_else(|| panic!("{method} {path}")).to_string());
            for (media_type, content) in operation["requestBody"]["content"].as_object().into_iter().flatten() {
                let is_binary = content["schema"]["$ref"] == "#/components/schemas/Binary";
                assert!(is_binary || content.get("example").is_some(), "{method} {path} {media_type}");
            }
        }
    }
    let count = names.len();
    names.sort();
    names.dedup();
    assert_eq!(names.len(), count, "an operationId is there twice");
    assert_eq!(document["components"]["schemas"]["Binary"]["format"], "binary");
    let mut bare = Vec::new();
    find_bare_objects(&document, "", &mut bare);
    // Results of other programs' versions are compared as they are.
    bare.retain(|path| !path.contains("/ComparedPair/"));
    assert!(bare.is_empty(), "objects without fields: {bare:?}");
}

/// What the document shows as a request is one: the service takes it, but for recordings that it does not have.
#[test]
fn every_example_of_the_document_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let document = service.get("/openapi.json").json();
    let mut taken = 0;
    for (path, item) in document["paths"].as_object().unwrap() {
        let Some(body) = item["post"]["requestBody"]["content"].get("application/json") else { continue };
        let example = body.get("example").unwrap_or_else(|| panic!("{path} has no example"));
        // Whole results would fill pages: the example of a comparison shows its form alone.
        if path == "/v1/comparisons" {
            continue;
        }
        // The check of a specimen starts nothing anyway.
        let reply = service.post(&format!("{path}?dry_run=true"), example);
        let body = reply.json();
        let names_recording = body["errors"][0]["pointer"].as_str().is_some_and(|p| p.starts_with("/recording"));
        assert!(reply.status == 200 || reply.status == 422 && names_recording, "{path}: {body}");
        taken += 1;
    }
    assert!(taken > 0, "the document has no request with a JSON body");
}

/// Schemas of lists that do not say what every entry is, which generators of clients do not know.
fn find_untold_lists(value: &Value, path: &str, found: &mut Vec<String>) {
    if value["type"] == "array" && !value["items"].is_object() {
        found.push(path.into());
    }
    for (name, inner) in value.as_object().into_iter().flatten() {
        // Examples are no schemas.
        if name != "example" && name != "default" {
            find_untold_lists(inner, &format!("{path}/{name}"), found);
        }
    }
    value.as_array().into_iter().flatten().for_each(|inner| find_untold_lists(inner, path, found));
}

/// Schemas of objects of which nothing is said.
fn find_bare_objects(value: &Value, path: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) => {
            let says = ["properties", "additionalProperties", "allOf", "oneOf"].iter().any(|k| fields.contains_key(*k));
            if fields.get("type") == Some(&json!("object")) && !says {
                found.push(path.into());
            }
            for (name, value) in fields {
                // Examples are no schemas.
                if name != "example" && name != "default" {
                    find_bare_objects(value, &format!("{path}/{name}"), found);
                }
            }
        }
        Value::Array(items) => {
            for (index, value) in items.iter().enumerate() {
                find_bare_objects(value, &format!("{path}/{index}"), found);
            }
        }
        _ => {}
    }
}
