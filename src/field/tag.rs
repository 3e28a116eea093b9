//! The field of a file that names its format.

/// Defines the type of a file's `schema` field: it is written as the given text and reads nothing else.
macro_rules! file_tag {
    ($name:ident, $text:expr) => {
        /// The `schema` field of the file.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct $name;

        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str($text)
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let found = String::deserialize(deserializer)?;
                if found == $text {
                    return Ok($name);
                }
                let expected = format!("{:?}", $text);
                Err(serde::de::Error::invalid_value(serde::de::Unexpected::Str(&found), &expected.as_str()))
            }
        }

        #[cfg(feature = "schema")]
        impl utoipa::PartialSchema for $name {
            fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::schema::Schema> {
                utoipa::openapi::schema::ObjectBuilder::new()
                    .schema_type(utoipa::openapi::schema::Type::String)
                    .enum_values(Some([$text]))
                    .into()
            }
        }

        #[cfg(feature = "schema")]
        impl utoipa::ToSchema for $name {}
    };
}

pub(crate) use file_tag;
