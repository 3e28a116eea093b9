//! Values that a study spells out, or that it names a file for.

use super::study_error::StudyError;
use crate::field::FieldError;
use crate::file::read_text_limited;
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

/// Largest file that a study may name, bytes: specimens and materials take a few kilobytes.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// A value, or the file that holds it.
#[derive(Clone, Debug)]
pub(crate) enum Inline<T> {
    /// A path, relative to the study's folder.
    File(PathBuf),
    /// The value itself.
    Value(T),
}

/// A text is a path, an object the value.
impl<'de, T: Deserialize<'de>> Deserialize<'de> for Inline<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct TextOrObject<T>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>> Visitor<'de> for TextOrObject<T> {
            type Value = Inline<T>;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("an object, or the name of a file")
            }

            fn visit_str<E>(self, name: &str) -> Result<Inline<T>, E> {
                Ok(Inline::File(name.into()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Inline<T>, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(Inline::Value)
            }
        }

        deserializer.deserialize_any(TextOrObject(PhantomData))
    }
}

impl<T> Inline<T> {
    /// The value, or what the file named beside the study holds.
    ///
    /// # Errors
    /// [`StudyError::File`].
    pub(crate) fn resolve<E: fmt::Display>(
        self,
        folder: &Path,
        parse: impl Fn(&str) -> Result<T, E>,
    ) -> Result<T, StudyError> {
        match self {
            Inline::Value(value) => Ok(value),
            Inline::File(name) => {
                let path = folder.join(name);
                let text = read_text_limited(&path, MAX_FILE_BYTES)
                    .map_err(|e| StudyError::File { path: path.clone(), message: e.to_string() })?;
                parse(&text).map_err(|e| StudyError::File { path, message: e.to_string() })
            }
        }
    }

    /// The value of a request, which names no files.
    ///
    /// # Errors
    /// A [`FieldError`] at `pointer` where a file is named.
    pub(crate) fn spelled_out(self, pointer: &str) -> Result<T, FieldError> {
        match self {
            Inline::Value(value) => Ok(value),
            Inline::File(name) => {
                let value = format!("{:?}", name.display().to_string());
                Err(FieldError::new(pointer, value, "an object")
                    .remedy("a request holds the specimen or material itself, not the name of a file"))
            }
        }
    }
}
