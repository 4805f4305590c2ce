//! Reads configurations from TOML, and names everything that is wrong: the key, the line, and what would be accepted.

use crate::{Check, OutOfRange};
use serde::de::DeserializeOwned;
use serde_path_to_error::{Deserializer, Segment, Track};
use std::collections::HashSet;
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
    pub fn new(
        key: impl fmt::Display,
        found: impl fmt::Display,
        accepted: impl fmt::Display,
    ) -> Self {
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
        let rest =
            if self.key.is_empty() { self.rest.trim_start_matches([':', ' ']) } else { &self.rest };
        write!(f, "{}{rest}", self.key)
    }
}

impl From<OutOfRange> for Fault {
    fn from(OutOfRange { key, found, accepted }: OutOfRange) -> Self {
        Self { key, rest: format!(" is {found}; accepted: {accepted}") }
    }
}

/// A table on its way to a value, with the path to where it is.
type Tracked<'a, 'b> = Deserializer<'a, 'b, Value>;

/// Whether `key` is `outer`, or stands somewhere below it.
pub fn is_within(key: &str, outer: &str) -> bool {
    let below = key.strip_prefix(outer);
    below.is_some_and(|rest| outer.is_empty() || rest.is_empty() || rest.starts_with(['.', '[']))
}

/// What a table says, if that can be told, and everything that is wrong with it.
pub type Read<T> = (Option<T>, Vec<Fault>);

/// Most faults that one table is searched for.
const MOST_FAULTS: usize = 100;

/// Deserialises a table by `read`, and checks the ranges. Serde stops at the first error: what it refuses is left out, and the
/// rest is read again, with a default in its place.
fn tracked<T: Check>(
    table: Table,
    read: impl Fn(Tracked) -> Result<T, toml::de::Error>,
) -> Read<T> {
    let mut faults = Vec::<Fault>::new();
    let mut left_out = Vec::new();
    let mut table = Value::Table(table);
    while faults.len() < MOST_FAULTS {
        let mut track = Track::new();
        let error = match read(Deserializer::new(table.clone(), &mut track)) {
            Err(error) => error,
            Ok(value) => {
                let ranges = value.faults().into_iter().map(Fault::from);
                // A list is empty if an element was refused.
                let apart = |late: &Fault| {
                    !faults
                        .iter()
                        .any(|fault| is_within(&fault.key, &late.key))
                };
                let ranges: Vec<Fault> = ranges.filter(apart).collect();
                return (Some(value), [faults, ranges].concat());
            }
        };
        let path = track.path();
        let key = if path.iter().len() == 0 { String::new() } else { path.to_string() };
        // A field may be missing because it has been left out.
        let is_new = |(at, name): &(String, String)| {
            error.message() != format!("missing field `{name}`") || !is_within(at, &key)
        };
        if left_out.iter().all(is_new) {
            faults.push(Fault { key: key.clone(), rest: format!(": {}", error.message()) });
        }
        let steps: Vec<&Segment> = path.iter().collect();
        // Elements of lists stay, lest others change their numbers.
        let innermost = steps
            .iter()
            .rposition(|step| matches!(step, Segment::Map { .. }));
        match innermost.and_then(|last| leave_out(&mut table, &steps[..=last])) {
            Some(name) => left_out.push((key, name)),
            None => break,
        }
    }
    (None, faults)
}

/// Takes the key to which the steps lead out of a table, and returns it.
fn leave_out(value: &mut Value, steps: &[&Segment]) -> Option<String> {
    match (steps, value) {
        ([Segment::Map { key }], Value::Table(table)) => table.remove(key).map(|_| key.clone()),
        (
            [Segment::Map { key } | Segment::Enum { variant: key }, below @ ..],
            Value::Table(table),
        ) => leave_out(table.get_mut(key)?, below),
        ([Segment::Seq { index }, below @ ..], Value::Array(list)) => {
            leave_out(list.get_mut(*index)?, below)
        }
        _ => None,
    }
}

/// Reads and checks the text of a `file` of one configuration.
///
/// # Errors
///
/// Everything that is wrong with it, a line each.
pub fn parse<T: DeserializeOwned + Check>(text: &str, file: &str) -> Result<T, String> {
    let table: Table = text
        .parse()
        .map_err(|error: toml::de::Error| error.to_string())?;
    let (config, faults) = deserialize(table);
    config
        .filter(|_| faults.is_empty())
        .ok_or_else(|| say(&faults, text, file, None))
}

/// Deserialises a table.
pub fn deserialize<T: DeserializeOwned + Check>(table: Table) -> Read<T> {
    tracked(table, |deserializer| T::deserialize(deserializer))
}

/// Deserialises a table that says under `tag` what it is, by `read`, which returns `None` for a name that is none of
/// the `accepted` ones. Serde's own enums with a tag would buffer the table and forget where an error is.
pub fn tagged<T: Check>(
    mut table: Table,
    tag: &str,
    read: impl Fn(&str, Tracked) -> Result<Option<T>, toml::de::Error>,
    accepted: impl FnOnce() -> String,
) -> Read<T> {
    let name = table.remove(tag);
    let found = name
        .as_ref()
        .map_or("missing".into(), Value::to_string);
    let (known, faults) = match name {
        Some(Value::String(name)) => tracked(table, |deserializer| read(&name, deserializer)),
        _ => (Some(None), vec![]),
    };
    match known {
        Some(None) => (None, vec![Fault::new(tag, found, accepted())]),
        known => (known.flatten(), faults),
    }
}

/// All that is wrong with a text, a line each, in its order; each line but the first begins with `file`. What stands in the table
/// `above` goes before what stands on top.
pub fn say(faults: &[Fault], text: &str, file: &str, above: Option<&str>) -> String {
    let table = DeTable::parse(text).ok();
    let start = |key: &str| Some(in_table(table.as_ref()?.get_ref(), key)?.start);
    let place = |fault: &Fault| {
        let of_table = above.and_then(start);
        let replaced = above.and_then(|above| start(&format!("{above}.{}", fault.key)));
        let replaced = replaced.filter(|_| replaced != of_table);
        replaced.or_else(|| start(&fault.key))
    };
    let mut placed: Vec<(Option<usize>, &Fault)> = faults
        .iter()
        .map(|fault| (place(fault), fault))
        .collect();
    placed.sort_by_key(|(at, _)| *at);
    let mut known = HashSet::new();
    placed.retain(|(_, fault)| known.insert(&fault.key));
    let line = |(at, fault): (Option<usize>, &Fault)| match at {
        Some(at) => format!("line {}: {fault}", text[..at].matches('\n').count() + 1),
        None => fault.to_string(),
    };
    placed
        .into_iter()
        .map(line)
        .collect::<Vec<_>>()
        .join(&format!("\n{file}: "))
}

fn in_table(table: &DeTable, key: &str) -> Option<Range<usize>> {
    table
        .iter()
        .find_map(|(name, value)| match key.strip_prefix(name.get_ref().as_ref())? {
            "" => Some(name.span()),
            rest if rest.starts_with(['.', '[']) => {
                Some(in_value(value, rest).unwrap_or(name.span()))
            }
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
        let text = "a = 1\nb = [\n  { c = 1 },\n  { c = 2 },\n]\n[d]\n\"e f\" = 1\n[[g]]\nh = 1\n[[g]]\nh = 2\n";
        for (key, line) in
            [("a", 1), ("b[1].c", 4), ("d.e f", 7), ("d.none", 6), ("g[1].h", 11), ("b[7]", 2)]
        {
            let said = say(&[Fault::new(key, 1, 2)], text, "", None);
            assert_eq!(said, format!("line {line}: {key} is 1; accepted: 2"));
        }
        assert_eq!(say(&[Fault::new("none", 1, 2)], text, "", None), "none is 1; accepted: 2");
    }

    #[test]
    fn faults_are_said_in_the_order_of_the_text_and_once_each() {
        let faults = ["b", "q.a", "a", "b"].map(|key| Fault::new(key, 1, 2));
        let said = say(&faults, "a = 1\nb = 1\n[q]\na = 1\n", "f", None);
        let line = |line, key| format!("line {line}: {key} is 1; accepted: 2");
        assert_eq!(said, [line(1, "a"), line(2, "b"), line(4, "q.a")].join("\nf: "));
        let replaced = say(&faults, "a = 1\nb = 1\n[q]\na = 1\n", "f", Some("q"));
        assert_eq!(replaced, [line(2, "b"), line(4, "q.a"), line(4, "a")].join("\nf: "));
    }
}
