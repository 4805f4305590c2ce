//! What is wrong with a spec: under which key, on which line, and what would be accepted.

use bvh_build::OutOfRange;
use serde::de::DeserializeOwned;
use serde_path_to_error::{Deserializer, Track};
use std::fmt;
use std::ops::Range;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

/// A refused value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Where it stands, as `methods[1].noise`; empty for the spec as a whole.
    pub key: String,
    /// What follows the key in the message.
    rest: String,
}

impl Fault {
    /// The refusal of the value `found` of `key`.
    pub fn new(key: impl fmt::Display, found: impl fmt::Display, accepted: impl fmt::Display) -> Self {
        OutOfRange::new(key, found, accepted).into()
    }

    /// The same fault, seen from the table or list that has the refused one under `key`.
    pub fn below(self, key: &str) -> Self {
        let dot = if self.key.is_empty() || self.key.starts_with('[') { "" } else { "." };
        Self { key: format!("{key}{dot}{}", self.key), ..self }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rest = if self.key.is_empty() { self.rest.trim_start_matches([':', ' ']) } else { &self.rest };
        write!(f, "{}{rest}", self.key)
    }
}

impl From<OutOfRange> for Fault {
    fn from(OutOfRange { key, found, accepted }: OutOfRange) -> Self {
        Self { key, rest: format!(" is {found}; accepted: {accepted}") }
    }
}

/// A table on its way to a value, with the path to where it is.
type Tracked<'a, 'b> = Deserializer<'a, 'b, Table>;

/// Deserialises a table by `read`, and names the key that an error is about.
fn tracked<T>(table: Table, read: impl FnOnce(Tracked) -> Result<T, toml::de::Error>) -> Result<T, Fault> {
    let mut track = Track::new();
    read(Deserializer::new(table, &mut track)).map_err(|error| {
        let path = track.path();
        let key = if path.iter().len() == 0 { String::new() } else { path.to_string() };
        Fault { key, rest: format!(": {}", error.message()) }
    })
}

/// Deserialises a table, and names the key that an error is about.
pub fn deserialize<T: DeserializeOwned>(table: Table) -> Result<T, Fault> {
    tracked(table, |deserializer| T::deserialize(deserializer))
}

/// Deserialises a table that says under `tag` what it is, by `read`, which returns `None` for a name that is none of
/// the `accepted` ones. Serde's own enums with a tag would buffer the table and forget where an error is.
pub fn tagged<T>(
    mut table: Table,
    tag: &str,
    read: impl FnOnce(&str, Tracked) -> Result<Option<T>, toml::de::Error>,
    accepted: impl FnOnce() -> String,
) -> Result<T, Fault> {
    let name = table.remove(tag);
    let found = name.as_ref().map_or("missing".into(), Value::to_string);
    let known = match name {
        Some(Value::String(name)) => tracked(table, |deserializer| read(&name, deserializer))?,
        _ => None,
    };
    known.ok_or_else(|| Fault::new(tag, found, accepted()))
}

/// The line of a TOML text, from 1, on which `key` stands, or the innermost table around it that is there.
pub fn line_of(text: &str, key: &str) -> Option<usize> {
    let table = DeTable::parse(text).ok()?;
    let start = in_table(table.get_ref(), key)?.start;
    Some(text[..start].matches('\n').count() + 1)
}

fn in_table(table: &DeTable, key: &str) -> Option<Range<usize>> {
    table.iter().find_map(|(name, value)| match key.strip_prefix(name.get_ref().as_ref())? {
        "" => Some(name.span()),
        rest if rest.starts_with(['.', '[']) => Some(in_value(value, rest).unwrap_or(name.span())),
        _ => None,
    })
}

fn in_value(value: &Spanned<DeValue>, key: &str) -> Option<Range<usize>> {
    match value.get_ref() {
        DeValue::Table(table) => in_table(table, key.strip_prefix('.')?),
        DeValue::Array(array) => {
            let (index, rest) = key.strip_prefix('[')?.split_once(']')?;
            let element = array.get(index.parse::<usize>().ok()?)?;
            Some(in_value(element, rest).unwrap_or(element.span()))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_of_a_key_is_found_in_tables_and_lists() {
        let text =
            "a = 1\nb = [\n  { c = 1 },\n  { c = 2 },\n]\n[d]\n\"e f\" = 1\n[[g]]\nh = 1\n[[g]]\nh = 2\n";
        for (key, line) in [("a", 1), ("b[1].c", 4), ("d.e f", 7), ("d.none", 6), ("g[1].h", 11), ("b[7]", 2)] {
            assert_eq!(line_of(text, key), Some(line), "{key}");
        }
        assert_eq!(line_of(text, "none"), None);
    }
}
