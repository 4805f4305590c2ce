//! Reads configurations from TOML. An error names the line, the key and the accepted values.

use crate::{Check, OutOfRange};
use serde::de::DeserializeOwned;
use serde_path_to_error::{Deserializer, Track};
use std::ops::Range;
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

impl OutOfRange {
    /// Returns the message with the line of the key in the text. A key of the table `above` takes
    /// precedence over the same key at the top level.
    pub fn in_text(&self, text: &str, above: Option<&str>) -> String {
        let root = DeTable::parse(text).map(|table| DeValue::Table(table.into_inner())).ok();
        let start = |key: &str| Some(place(root.as_ref()?, key)?.start);
        let of_table = above.and_then(start);
        let replaced = above.and_then(|above| start(&format!("{above}.{}", self.key)));
        let place = replaced.filter(|_| replaced != of_table).or_else(|| start(&self.key));
        place.map_or_else(
            || self.to_string(),
            |at| format!("line {}: {self}", text[..at].matches('\n').count() + 1),
        )
    }
}

type Tracked<'a, 'b> = Deserializer<'a, 'b, Value>;

fn tracked<T: Check>(
    table: Table,
    read: impl FnOnce(Tracked) -> Result<T, toml::de::Error>,
) -> Result<T, OutOfRange> {
    let mut track = Track::new();
    let value = read(Deserializer::new(Value::Table(table), &mut track)).map_err(|error| {
        let path = track.path();
        // An empty path is written as a dot, which is no key.
        let key = if path.iter().len() == 0 { String::new() } else { path.to_string() };
        OutOfRange { key, separator: ": ", message: error.message().into() }
    })?;
    value.check()?;
    Ok(value)
}

/// Reads and checks the text of a file of one configuration.
///
/// # Errors
///
/// Returns the first fault with its line.
pub fn parse<T: DeserializeOwned + Check>(text: &str) -> Result<T, String> {
    let table: Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    deserialize(table).map_err(|fault| fault.in_text(text, None))
}

/// Deserialises a table.
pub fn deserialize<T: DeserializeOwned + Check>(table: Table) -> Result<T, OutOfRange> {
    tracked(table, |deserializer| T::deserialize(deserializer))
}

/// Deserialises a table whose `tag` names its type, by `read`, which returns `None` for a name that
/// is not `accepted`. Serde's tagged enums would buffer the table and lose the position of errors.
pub fn tagged<T: Check>(
    mut table: Table,
    tag: &str,
    read: impl FnOnce(&str, Tracked) -> Result<Option<T>, toml::de::Error>,
    accepted: impl FnOnce() -> String,
) -> Result<T, OutOfRange> {
    let name = table.remove(tag);
    let found = name.as_ref().map_or("missing".into(), Value::to_string);
    let known = match name {
        Some(Value::String(name)) => tracked(table, |deserializer| read(&name, deserializer))?,
        _ => None,
    };
    known.ok_or_else(|| OutOfRange::new(tag, found, accepted()))
}

/// Returns the bytes of the name or the element that a path below a value leads to, or of the last
/// one that exists.
fn place(value: &DeValue, path: &str) -> Option<Range<usize>> {
    let path = path.strip_prefix('.').unwrap_or(path);
    match value {
        DeValue::Table(table) => table.iter().find_map(|(name, value)| {
            let below = path.strip_prefix(name.get_ref().as_ref())?;
            // A name may be the beginning of another; only a dot or an index continues the path.
            let is_name = below.is_empty() || below.starts_with(['.', '[']);
            is_name.then(|| place(value.get_ref(), below).unwrap_or(name.span()))
        }),
        DeValue::Array(array) => {
            let (index, below) = path.strip_prefix('[')?.split_once(']')?;
            let element = array.get(index.parse::<usize>().ok()?)?;
            Some(place(element.get_ref(), below).unwrap_or(element.span()))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_of_a_key_is_found_in_tables_and_lists() {
        let text = "a = 1\nb = [\n  { c = 1 },\n  { c = 2 },\n]\n[d]\n\"e f\" = 1\n[[g]]\nh = 1\n[[g]]\nh = 2\n";
        for (key, line) in
            [("a", 1), ("b[1].c", 4), ("d.e f", 7), ("d.none", 6), ("g[1].h", 11), ("b[7]", 2)]
        {
            let message = OutOfRange::new(key, 1, 2).in_text(text, None);
            assert_eq!(message, format!("line {line}: {key} is 1; accepted: 2"));
        }
        assert_eq!(OutOfRange::new("none", 1, 2).in_text(text, None), "none is 1; accepted: 2");
        let replaced = OutOfRange::new("a", 1, 2).in_text("a = 1\n[q]\na = 1\n", Some("q"));
        assert_eq!(replaced, "line 3: a is 1; accepted: 2");
    }
}
