//! Reading a request's JSON into a type, with a pointer to the field that does not fit.

use super::{FieldError, FieldPath};
use serde::de::value::{MapDeserializer, SeqDeserializer};
use serde::de::{DeserializeOwned, Deserializer, Expected, IntoDeserializer, Unexpected, Visitor};
use serde_json::Value;
use serde_path_to_error::Segment;
use std::fmt::Display;

/// Longest part of an offending value that an error repeats, characters.
const MAX_VALUE_LENGTH: usize = 100;

/// Reads `value` as a `T`.
///
/// # Errors
/// The first [`FieldError`], in the order of the JSON: a field that is missing, unknown or of another type.
pub fn read<T: DeserializeOwned>(value: &Value) -> Result<T, FieldError> {
    serde_path_to_error::deserialize(ValueReader(value)).map_err(|error| {
        let path = error.path().iter().fold(FieldPath::default(), |path, segment| match segment {
            Segment::Map { key } => path.name(key),
            Segment::Enum { variant } => path.name(variant),
            Segment::Seq { index } => path.index(*index),
            Segment::Unknown => path,
        });
        let pointer = path.pointer();
        let found = value.pointer(&pointer);
        error.into_inner().at(path, found)
    })
}

/// How a value misses its type.
#[derive(Debug)]
enum Misfit {
    /// It has another type, length or content.
    Expected(String),
    /// It is an object without this field.
    Missing(&'static str),
    /// Its name is none of those known.
    UnknownField(&'static [&'static str]),
    /// It is none of the texts known.
    UnknownVariant(&'static [&'static str]),
    /// What the type itself says.
    Refused(String),
}

impl Misfit {
    /// The misfit of the value `found` at `path`.
    fn at(self, path: FieldPath, found: Option<&Value>) -> FieldError {
        let shown = found.map(shortened).unwrap_or_default();
        match self {
            Misfit::Expected(allowed) => FieldError::new(path.pointer(), shown, allowed),
            Misfit::Missing(name) => FieldError::new(path.name(name).pointer(), "", "given"),
            Misfit::UnknownField(known) => {
                let remedy = format!("there is no such field; known: {}", known.join(", "));
                FieldError::new(path.pointer(), shown, "left out").remedy(remedy)
            }
            Misfit::UnknownVariant(known) => {
                let allowed = format!("one of {}", known.join(", "));
                FieldError::new(path.pointer(), shown, allowed)
            }
            Misfit::Refused(message) => {
                FieldError::new(path.pointer(), shown, "what the format allows").remedy(message)
            }
        }
    }
}

/// The beginning of a value's JSON.
pub(super) fn shortened(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(MAX_VALUE_LENGTH) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

impl Display for Misfit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{self:?}")
    }
}

impl std::error::Error for Misfit {}

impl serde::de::Error for Misfit {
    fn custom<T: Display>(message: T) -> Self {
        Misfit::Refused(message.to_string())
    }

    fn invalid_type(_: Unexpected, expected: &dyn Expected) -> Self {
        Misfit::Expected(expected.to_string())
    }

    fn invalid_value(_: Unexpected, expected: &dyn Expected) -> Self {
        Misfit::Expected(expected.to_string())
    }

    fn invalid_length(_: usize, expected: &dyn Expected) -> Self {
        Misfit::Expected(expected.to_string())
    }

    fn unknown_variant(_: &str, known: &'static [&'static str]) -> Self {
        Misfit::UnknownVariant(known)
    }

    fn unknown_field(_: &str, known: &'static [&'static str]) -> Self {
        Misfit::UnknownField(known)
    }

    fn missing_field(name: &'static str) -> Self {
        Misfit::Missing(name)
    }
}

/// A JSON value whose misfits are typed.
#[derive(Clone, Copy)]
struct ValueReader<'de>(&'de Value);

impl<'de> IntoDeserializer<'de, Misfit> for ValueReader<'de> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for ValueReader<'de> {
    type Error = Misfit;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        match self.0 {
            Value::Null => visitor.visit_unit(),
            Value::Bool(value) => visitor.visit_bool(*value),
            Value::Number(number) => match (number.as_u64(), number.as_i64(), number.as_f64()) {
                (Some(value), ..) => visitor.visit_u64(value),
                (None, Some(value), _) => visitor.visit_i64(value),
                (None, None, Some(value)) => visitor.visit_f64(value),
                (None, None, None) => Err(Misfit::Expected("a finite number".into())),
            },
            Value::String(text) => visitor.visit_borrowed_str(text),
            Value::Array(list) => {
                let mut entries = SeqDeserializer::new(list.iter().map(ValueReader));
                let read = visitor.visit_seq(&mut entries)?;
                entries.end()?;
                Ok(read)
            }
            Value::Object(fields) => {
                let pairs = fields.iter().map(|(name, value)| (name.as_str(), ValueReader(value)));
                let mut pairs = MapDeserializer::new(pairs);
                let read = visitor.visit_map(&mut pairs)?;
                pairs.end()?;
                Ok(read)
            }
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        if self.0.is_null() { visitor.visit_none() } else { visitor.visit_some(self) }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Misfit> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        match self.0 {
            Value::String(variant) => visitor.visit_enum(variant.as_str().into_deserializer()),
            // An object with one field, the variant's name; serde_json's own reader takes it apart.
            Value::Object(_) => self.0.deserialize_enum(name, variants, visitor).map_err(serde::de::Error::custom),
            _ => Err(Misfit::UnknownVariant(variants)),
        }
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map struct identifier ignored_any
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::Specimen;

    fn misfit(change: impl Fn(&mut Value)) -> FieldError {
        let mut value = serde_json::json!({
            "schema": "specimen/1", "name": "solid", "test": "double_lap_shear",
            "block": { "length_mm": 25.4, "thickness_mm": 6.4, "width_mm": 19.1 }, "drive_mm": [5.0],
            "holes": [{ "axis": "thickness", "center_mm": [0, 0], "diameter_mm": 5 }]
        });
        assert!(read::<Specimen>(&value).is_ok());
        change(&mut value);
        read::<Specimen>(&value).expect_err("it does not fit")
    }

    #[test]
    fn a_misfit_is_told_with_its_pointer() {
        let wrong = misfit(|v| v["holes"][0]["diameter_mm"] = "wide".into());
        assert_eq!((wrong.pointer.as_str(), wrong.value.as_str()), ("/holes/0/diameter_mm", "\"wide\""));
        assert_eq!(wrong.allowed, "f64");
        let missing = misfit(|v| drop(v["block"].as_object_mut().map(|b| b.remove("width_mm"))));
        assert_eq!((missing.pointer.as_str(), missing.value.as_str()), ("/block/width_mm", ""));
        let unknown = misfit(|v| v["block"]["height_mm"] = 3.into());
        assert_eq!((unknown.pointer.as_str(), unknown.value.as_str()), ("/block/height_mm", "3"));
        assert!(unknown.remedy.contains("thickness_mm"), "{unknown}");
        let variant = misfit(|v| v["test"] = "torsion".into());
        assert_eq!(
            (variant.pointer.as_str(), variant.allowed.as_str()),
            ("/test", "one of double_lap_shear, uniaxial")
        );
        let tag = misfit(|v| v["schema"] = "specimen/2".into());
        assert_eq!((tag.pointer.as_str(), tag.allowed.as_str()), ("/schema", "\"specimen/1\""));
        assert_eq!(misfit(|v| *v = "text".into()).pointer, "");
        let entries = misfit(|v| v["holes"][0]["center_mm"] = serde_json::json!([0, 0, 0]));
        assert_eq!(entries.pointer, "/holes/0/center_mm");
        assert_eq!(misfit(|v| v["drive_mm"][0] = Value::Null).pointer, "/drive_mm/0");
    }
}
