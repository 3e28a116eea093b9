//! JSON schemas of numbers, texts and lists whose limits are constants.
//!
//! The attributes of `utoipa` take literals only. So that a limit stands once, a field whose limit is a constant refers
//! to a named schema: `#[schema(value_type = Name)]`, with `Name` defined by the macro `schema_type`.

use std::ops::RangeInclusive;
use utoipa::ToSchema;
use utoipa::openapi::Ref;
use utoipa::openapi::schema::{ArrayBuilder, KnownFormat, ObjectBuilder, SchemaFormat, Type};

/// A number.
pub fn number() -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::Number).format(Some(SchemaFormat::KnownFormat(KnownFormat::Double)))
}

/// A number within a range, both ends included.
pub fn number_within(range: RangeInclusive<f64>) -> ObjectBuilder {
    number().minimum(Some(*range.start())).maximum(Some(*range.end()))
}

/// A number above a limit, which is not included.
pub fn number_above(limit: f64) -> ObjectBuilder {
    number().exclusive_minimum(Some(limit))
}

/// An integer within a range, both ends included.
pub fn integer_within(range: RangeInclusive<usize>) -> ObjectBuilder {
    ObjectBuilder::new()
        .schema_type(Type::Integer)
        .format(Some(SchemaFormat::KnownFormat(KnownFormat::Int64)))
        .minimum(Some(*range.start() as f64))
        .maximum(Some(*range.end() as f64))
}

/// A text of at most `max_length` characters.
pub fn text(max_length: usize) -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::String).max_length(Some(max_length))
}

/// A list of numbers with this schema, with this many entries.
pub fn numbers(number: ObjectBuilder, count: RangeInclusive<usize>) -> ArrayBuilder {
    ArrayBuilder::new().items(number).min_items(Some(*count.start())).max_items(Some(*count.end()))
}

/// A list of values of another named schema, with this many entries.
pub fn list_of<T: ToSchema>(count: RangeInclusive<usize>) -> ArrayBuilder {
    let list = ArrayBuilder::new().items(Ref::from_schema_name(T::name())).max_items(Some(*count.end()));
    if *count.start() > 0 { list.min_items(Some(*count.start())) } else { list }
}

/// Defines types that stand for JSON schemas: name, schema (a builder) and, after `of`, the type that it refers to.
macro_rules! schema_type {
    ($($(#[doc = $doc:literal])+ $visibility:vis $name:ident = $schema:expr $(, of $item:ty)?;)+) => {$(
        $(#[doc = $doc])+
        $visibility enum $name {}

        impl utoipa::PartialSchema for $name {
            fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::schema::Schema> {
                $schema.description(Some(concat!($($doc),+).trim())).into()
            }
        }

        impl utoipa::ToSchema for $name {
            fn schemas(
                _schemas: &mut Vec<(String, utoipa::openapi::RefOr<utoipa::openapi::schema::Schema>)>,
            ) {
                $(
                    _schemas.push((
                        <$item as utoipa::ToSchema>::name().into_owned(),
                        <$item as utoipa::PartialSchema>::schema(),
                    ));
                    <$item as utoipa::ToSchema>::schemas(_schemas);
                )?
            }
        }
    )+};
}

/// Gives a type the JSON schema of another one, its form in files.
macro_rules! schema_of_file {
    ($type:ty, $file:ty) => {
        impl utoipa::PartialSchema for $type {
            fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::schema::Schema> {
                <$file as utoipa::PartialSchema>::schema()
            }
        }

        impl utoipa::ToSchema for $type {
            fn name() -> std::borrow::Cow<'static, str> {
                <$file as utoipa::ToSchema>::name()
            }

            fn schemas(schemas: &mut Vec<(String, utoipa::openapi::RefOr<utoipa::openapi::schema::Schema>)>) {
                <$file as utoipa::ToSchema>::schemas(schemas);
            }
        }
    };
}

/// Largest seed: the largest whole number that every reader of JSON holds exactly, 2⁵³ − 1.
const MAX_SEED: usize = (1 << 53) - 1;

schema_type! {
    /// A seed of random numbers.
    pub Seed = integer_within(0..=MAX_SEED);
}

pub(crate) use {schema_of_file, schema_type};
