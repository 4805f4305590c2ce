//! Reads configurations from TOML and reports every fault: the key, the line, and the accepted
//! values.

use crate::{Check, OutOfRange};
use serde::de::DeserializeOwned;
use serde_path_to_error::{Deserializer, Segment, Track};
use std::collections::HashSet;
use std::fmt;
use std::ops::Range;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

/// A rejected value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The path of the value, such as `methods[1].noise`; empty for the full text.
    pub key: String,
    /// The message after the key.
    rest: String,
}

impl Fault {
    /// Returns the rejection of the value `found` of `key`.
    pub fn new(
        key: impl fmt::Display,
        found: impl fmt::Display,
        accepted: impl fmt::Display,
    ) -> Self {
        OutOfRange::new(key, found, accepted).into()
    }

    /// Returns the same fault, with a key relative to the table or list that contains this value
    /// under `key`.
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

/// A deserializer that tracks the path of the current value.
type Tracked<'a, 'b> = Deserializer<'a, 'b, Value>;

/// Returns whether `key` is `outer` or is nested in it.
pub fn is_within(key: &str, outer: &str) -> bool {
    let below = key.strip_prefix(outer);
    below.is_some_and(|rest| outer.is_empty() || rest.is_empty() || rest.starts_with(['.', '[']))
}

/// The value of a table, if it could be read, and all faults.
pub type Read<T> = (Option<T>, Vec<Fault>);

/// Maximum number of faults reported for one table.
const MOST_FAULTS: usize = 100;

/// Deserialises a table by `read`, and checks the ranges. Serde stops at the first error, so the
/// rejected key is removed and the rest is read again, with a default instead.
fn tracked<T: Check>(
    table: Table,
    read: impl Fn(Tracked) -> Result<T, toml::de::Error>,
) -> Read<T> {
    let mut faults = Vec::<Fault>::new();
    let mut removed = Vec::new();
    let mut table = Value::Table(table);
    while faults.len() < MOST_FAULTS {
        // The path of an error is known only while serde reads the untouched table, hence the copy.
        let mut track = Track::new();
        let error = match read(Deserializer::new(table.clone(), &mut track)) {
            Err(error) => error,
            Ok(value) => {
                let mut out_of_range = value.faults();
                // A removed list counts as empty, which is no separate fault.
                out_of_range
                    .retain(|late| !faults.iter().any(|fault| is_within(&fault.key, &late.key)));
                faults.extend(out_of_range.into_iter().map(Fault::from));
                return (Some(value), faults);
            }
        };
        let path = track.path();
        let steps: Vec<&Segment> = path.iter().collect();
        // An empty path is written as a dot, which is no key.
        let key = if steps.is_empty() { String::new() } else { path.to_string() };
        // A field may be missing because it was removed after a fault.
        let is_new = |(position, name): &(String, String)| {
            error.message() != format!("missing field `{name}`") || !is_within(position, &key)
        };
        if removed.iter().all(is_new) {
            let rest = format!(": {}", error.message());
            faults.push(Fault { key: key.clone(), rest });
        }
        // Elements of lists stay, because a removal would change the indices of later elements.
        let innermost = steps.iter().rposition(|step| matches!(step, Segment::Map { .. }));
        match innermost.and_then(|last| remove(&mut table, &steps[..=last])) {
            Some(name) => removed.push((key, name)),
            None => break,
        }
    }
    (None, faults)
}

/// Removes the key at the end of the path from its table, and returns it.
fn remove(value: &mut Value, steps: &[&Segment]) -> Option<String> {
    match (steps, value) {
        ([Segment::Map { key }], Value::Table(table)) => table.remove(key).map(|_| key.clone()),
        (
            [Segment::Map { key } | Segment::Enum { variant: key }, below @ ..],
            Value::Table(table),
        ) => remove(table.get_mut(key)?, below),
        ([Segment::Seq { index }, below @ ..], Value::Array(list)) => {
            remove(list.get_mut(*index)?, below)
        }
        _ => None,
    }
}

/// Reads and checks the text of a `file` of one configuration.
///
/// # Errors
///
/// Returns all faults, one per line.
pub fn parse<T: DeserializeOwned + Check>(text: &str, file: &str) -> Result<T, String> {
    let table: Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    let (config, faults) = deserialize(table);
    config.filter(|_| faults.is_empty()).ok_or_else(|| say(&faults, text, file, None))
}

/// Deserialises a table.
pub fn deserialize<T: DeserializeOwned + Check>(table: Table) -> Read<T> {
    tracked(table, |deserializer| T::deserialize(deserializer))
}

/// Deserialises a table whose `tag` names its type, by `read`, which returns `None` for a name that
/// is not `accepted`. Serde's tagged enums would buffer the table and lose the position of errors.
pub fn tagged<T: Check>(
    mut table: Table,
    tag: &str,
    read: impl Fn(&str, Tracked) -> Result<Option<T>, toml::de::Error>,
    accepted: impl FnOnce() -> String,
) -> Read<T> {
    let name = table.remove(tag);
    let found = name.as_ref().map_or("missing".into(), Value::to_string);
    let (known, faults) = match name {
        Some(Value::String(name)) => tracked(table, |deserializer| read(&name, deserializer)),
        _ => (Some(None), vec![]),
    };
    match known {
        Some(None) => (None, vec![Fault::new(tag, found, accepted())]),
        known => (known.flatten(), faults),
    }
}

/// Formats the faults of a text in its order, one per line. Each line except the first begins with
/// `file`. Keys of the table `above` take precedence over the same keys at the top level.
pub fn say(faults: &[Fault], text: &str, file: &str, above: Option<&str>) -> String {
    let table = DeTable::parse(text).ok();
    let start = |key: &str| Some(in_table(table.as_ref()?.get_ref(), key)?.start);
    let place = |fault: &Fault| {
        let of_table = above.and_then(start);
        let replaced = above.and_then(|above| start(&format!("{above}.{}", fault.key)));
        let replaced = replaced.filter(|_| replaced != of_table);
        replaced.or_else(|| start(&fault.key))
    };
    let mut placed: Vec<(Option<usize>, &Fault)> =
        faults.iter().map(|fault| (place(fault), fault)).collect();
    // Stable: faults without a position stay first, in their order.
    placed.sort_by_key(|(position, _)| *position);
    let mut known = HashSet::new();
    placed.retain(|(_, fault)| known.insert(&fault.key));
    let line = |(position, fault): (Option<usize>, &Fault)| match position {
        Some(position) => format!("line {}: {fault}", text[..position].matches('\n').count() + 1),
        None => fault.to_string(),
    };
    placed.into_iter().map(line).collect::<Vec<_>>().join(&format!("\n{file}: "))
}

fn in_table(table: &DeTable, key: &str) -> Option<Range<usize>> {
    table.iter().find_map(|(name, value)| match key.strip_prefix(name.get_ref().as_ref())? {
        "" => Some(name.span()),
        // A name may be the beginning of another; only a dot or an index continues the path.
        rest if rest.starts_with(['.', '[']) => Some(in_value(value, rest).unwrap_or(name.span())),
        _ => None,
    })
}

fn in_value(value: &Spanned<DeValue>, key: &str) -> Option<Range<usize>> {
    match value.get_ref() {
        DeValue::Table(table) => in_table(table, key.strip_prefix('.')?),
        DeValue::Array(array) => {
            let (index, rest) = key.strip_prefix('[')?.split_once(']')?;
            let index: usize = index.parse().ok()?;
            let element = array.get(index)?;
            // A key below that is missing is reported at the line of its list's element.
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
            let message = say(&[Fault::new(key, 1, 2)], text, "", None);
            assert_eq!(message, format!("line {line}: {key} is 1; accepted: 2"));
        }
        assert_eq!(say(&[Fault::new("none", 1, 2)], text, "", None), "none is 1; accepted: 2");
    }

    #[test]
    fn faults_are_reported_in_the_order_of_the_text_and_once_each() {
        let faults = ["b", "q.a", "a", "b"].map(|key| Fault::new(key, 1, 2));
        let message = say(&faults, "a = 1\nb = 1\n[q]\na = 1\n", "f", None);
        let line = |line, key| format!("line {line}: {key} is 1; accepted: 2");
        assert_eq!(message, [line(1, "a"), line(2, "b"), line(4, "q.a")].join("\nf: "));
        let replaced = say(&faults, "a = 1\nb = 1\n[q]\na = 1\n", "f", Some("q"));
        assert_eq!(replaced, [line(2, "b"), line(4, "q.a"), line(4, "a")].join("\nf: "));
    }
}
