//! Options of the command as fields of a request: names are translated here, everything else comes from the request's
//! type.

use super::error::CliError;
use super::input;
use crate::job::{FieldForm, RequestField};
use crate::mesh::MeshSize;
use crate::voxel::Surface;
use clap::{Arg, ArgAction, ArgMatches};
use serde_json::{Map, Value};
use std::path::Path;

/// How an option's text becomes the value of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Written {
    /// As the field's form says.
    AsIs,
    /// The name of a JSON file that holds the value.
    JsonFile,
    /// The name of a file whose text is the value.
    TextFile,
    /// The flag turns the field off.
    Off,
    /// A face, and after a comma which components are seen of it: `+z`, `+z,all`.
    FaceSeen,
    /// A named element size or a factor, for a field that holds the factor.
    MeshFactor,
    /// `auto` leaves the field out.
    OrAuto,
}

/// An option and the field that it sets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flag {
    /// Name of the option.
    pub name: &'static str,
    /// Name of the field; of a field within a field with a slash.
    pub field: &'static str,
    /// How the text is read.
    pub written: Written,
}

impl Flag {
    /// An option whose text is read as the field's form says.
    pub(super) const fn of(name: &'static str, field: &'static str) -> Flag {
        Flag { name, field, written: Written::AsIs }
    }

    /// The same, read in another way.
    pub(super) const fn read(name: &'static str, field: &'static str, written: Written) -> Flag {
        Flag { name, field, written }
    }

    /// Whether the option takes no value.
    fn is_switch(self, field: &RequestField) -> bool {
        self.written == Written::Off || (self.written == Written::AsIs && field.form == FieldForm::Boolean)
    }

    /// The option, with the field's description, range and default.
    pub(super) fn arg(self, field: &RequestField) -> Arg {
        let mut help = field.about.trim_end_matches('.').replace('`', "");
        if self.written == Written::Off {
            help = format!("Turns off: {}", help.trim_start_matches("Whether "));
        }
        if !field.range.is_empty() {
            help += &format!(" ({})", field.range);
        }
        if let FieldForm::Choice(words) | FieldForm::Choices(words) = &field.form {
            help += &format!(" ({})", words.iter().map(|w| kebab(w)).collect::<Vec<_>>().join(", "));
        }
        match &field.default {
            Some(default) if !self.is_switch(field) => help += &format!(" [default: {}]", plain(default)),
            _ => {}
        }
        let arg = Arg::new(self.name).long(self.name).help(help);
        if self.is_switch(field) {
            return arg.action(ArgAction::SetTrue);
        }
        let name = match (self.written, &field.form) {
            (Written::JsonFile | Written::TextFile, _) => "FILE",
            (Written::MeshFactor, _) => "SIZE",
            (Written::FaceSeen, _) => "FACE",
            (_, FieldForm::Tuple(2)) => "LOW,HIGH",
            (_, FieldForm::Tuple(_)) => "X,Y,Z",
            (_, FieldForm::Numbers | FieldForm::Texts | FieldForm::Choices(_)) => "LIST",
            (_, FieldForm::Number | FieldForm::Integer) => "NUMBER",
            _ => "VALUE",
        };
        arg.value_name(name).allow_hyphen_values(true).action(ArgAction::Set)
    }

    /// Sets the field of `request` to what the command line says, where it says anything.
    pub(super) fn apply(
        self,
        fields: &[RequestField],
        matches: &ArgMatches,
        request: &mut Value,
    ) -> Result<(), CliError> {
        let named = |name: &str| fields.iter().find(|f| f.name == name);
        let Some(field) = named(self.field) else { return Ok(()) };
        if self.is_switch(field) {
            if matches.get_flag(self.name) {
                self.set_within(named, request, (self.written != Written::Off).into());
            }
            return Ok(());
        }
        let Some(text) = matches.get_one::<String>(self.name) else { return Ok(()) };
        let value = match self.written {
            Written::JsonFile => input::read_json(Path::new(text))?,
            Written::TextFile => input::read_table(Path::new(text))?.into(),
            Written::OrAuto if text == "auto" => return Ok(()),
            Written::MeshFactor => {
                let size: MeshSize =
                    text.parse().map_err(|e: crate::field::FieldError| self.wrong(text, &e.allowed))?;
                size.factor().into()
            }
            Written::FaceSeen => {
                let seen: Surface = text.parse().map_err(|e: crate::field::FieldError| self.wrong(text, &e.allowed))?;
                serde_json::to_value(seen).map_err(|e| self.wrong(text, &e.to_string()))?
            }
            _ => self.value(field, text)?,
        };
        self.set_within(named, request, value);
        Ok(())
    }

    /// Sets the field. A field within a field that is left out begins with that field's default.
    fn set_within<'a>(self, named: impl Fn(&str) -> Option<&'a RequestField>, request: &mut Value, value: Value) {
        if let Some((outer, _)) = self.field.split_once('/')
            && request.get(outer).is_none()
        {
            let default = named(outer).and_then(|f| f.default.clone());
            set(request, outer, default.unwrap_or_else(|| Value::Object(Map::new())));
        }
        set(request, self.field, value);
    }

    fn wrong(self, text: &str, allowed: &str) -> CliError {
        CliError::Option { option: self.name, message: format!("'{text}' is not {allowed}") }
    }

    fn number(self, text: &str, field: &RequestField) -> Result<Value, CliError> {
        let range = if field.range.is_empty() { String::new() } else { format!(" {}", field.range) };
        // A whole number keeps all its digits.
        if let Ok(whole) = text.trim().parse::<u64>() {
            return Ok(whole.into());
        }
        if field.form == FieldForm::Integer {
            return Err(self.wrong(text, &format!("a whole number{range}")));
        }
        let number = text.trim().parse::<f64>().ok().and_then(serde_json::Number::from_f64);
        number.map(Value::Number).ok_or_else(|| self.wrong(text, &format!("a number{range}")))
    }

    fn word(self, words: &[String], text: &str) -> Result<Value, CliError> {
        let word = words.iter().find(|w| **w == text || kebab(w) == text.to_lowercase());
        let all = || words.iter().map(|w| kebab(w)).collect::<Vec<_>>().join(" or ");
        Ok(word.ok_or_else(|| self.wrong(text, &all()))?.clone().into())
    }

    fn value(self, field: &RequestField, text: &str) -> Result<Value, CliError> {
        let list = |text: &str| -> Result<Vec<Value>, CliError> {
            text.split(',').map(|part| self.number(part, field)).collect()
        };
        Ok(match &field.form {
            FieldForm::Number | FieldForm::Integer => self.number(text, field)?,
            FieldForm::Tuple(count) => {
                let numbers = list(text)?;
                match numbers.len() as u64 {
                    1 => vec![numbers[0].clone(); usize::try_from(*count).unwrap_or(1)].into(),
                    n if n == *count => numbers.into(),
                    _ => return Err(self.wrong(text, &format!("one number or {count}, such as 1,0.1875,0.75"))),
                }
            }
            FieldForm::Numbers => list(text)?.into(),
            FieldForm::Texts => text.split(',').map(|t| Value::from(t.trim())).collect::<Vec<_>>().into(),
            FieldForm::Choice(words) => self.word(words, text)?,
            FieldForm::Choices(words) => {
                let found = text.split(',').map(|t| self.word(words, t.trim()));
                found.collect::<Result<Vec<Value>, CliError>>()?.into()
            }
            FieldForm::Boolean | FieldForm::Text | FieldForm::Objects | FieldForm::Other => text.into(),
        })
    }
}

fn kebab(word: &str) -> String {
    word.replace('_', "-")
}

/// A default as it would be typed.
fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => kebab(text),
        Value::Array(items) => items.iter().map(plain).collect::<Vec<_>>().join(","),
        other => other.to_string(),
    }
}

/// Sets a field, or a field within a field.
pub(super) fn set(request: &mut Value, field: &str, value: Value) {
    let mut slot = request;
    for name in field.split('/') {
        slot = &mut slot[name];
    }
    *slot = value;
}
