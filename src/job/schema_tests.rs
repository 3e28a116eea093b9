//! What schemas find in requests.

use super::schema::{FieldForm, RequestSchema};
use serde::Serialize;
use serde_json::{Value, json};
use utoipa::ToSchema;

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
    let wrong = json!({ "side": "up", "count": 0, "weight": 0.0, "inner": { "voxel_mm": [1, 2], "a/b": 1 }, "x": 1 });
    let mut found = pointers(&wrong);
    found.sort();
    assert_eq!(found, ["/count", "/inner/a~1b", "/inner/voxel_mm", "/side", "/weight", "/x"]);
    assert_eq!(pointers(&json!({ "count": 1.5 })), ["/side", "/count"]);
    assert_eq!(pointers(&json!([])), [""]);
    let text = RequestSchema::of::<Outer>().errors(&json!({ "side": "left", "count": 21 }))[0].to_string();
    assert_eq!(text, "/count is 21; it must be from 1 to 20");
}

#[test]
fn whole_numbers_may_be_written_with_a_point() {
    let schema = RequestSchema::of::<Outer>();
    let with_point = json!({ "side": "left", "count": 3.0, "weight": 2.0, "inner": { "voxel_mm": [1.0, 2.0, 3.0] } });
    assert!(schema.errors(&with_point).is_empty());
    let settled = schema.settled(&with_point);
    assert!(settled["count"].is_u64() && settled["weight"].is_f64(), "{settled}");
    assert_eq!(schema.settled(&json!({ "count": 3.5 })), json!({ "count": 3.5 }), "what is none is left as it is");
}

#[test]
fn fields_carry_form_default_and_range() {
    let fields = RequestSchema::of::<Outer>().fields();
    let field = |name: &str| fields.iter().find(|f| f.name == name).unwrap().clone();
    assert_eq!(field("side").form, FieldForm::Choice(vec!["left".into(), "right".into()]));
    let count = field("count");
    assert_eq!((count.form, count.range.as_str(), count.default), (FieldForm::Integer, "from 1 to 20", Some(json!(3))));
    assert_eq!(field("weight").range, "above 0");
    assert_eq!(field("inner/voxel_mm").form, FieldForm::Tuple(3));
    assert!(field("side").is_required && !field("count").is_required);
}
