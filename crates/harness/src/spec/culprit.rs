//! Which key of a spec an error is about, where the parser does not say.
//!
//! Tables that name their kind are read twice, and the second reader knows neither line nor key. So the spec is read
//! again without one key after the other: the one at fault is the one without which there is no error, or another.

use toml::{Table, Value};

/// The key that a spec's error is about, as `methods[1].noise`, if it is about one. `read` gives the error; it is
/// called once for each key on the way, and each beside them.
pub fn find(spec: Table, read: impl Fn(Table) -> Option<String>) -> Option<String> {
    let mut spec = Value::Table(spec);
    let error = read_value(&read, spec.clone())?;
    let mut path: Vec<Step> = Vec::new();
    loop {
        let steps = steps(&mut spec, &path);
        let without = |step: &Step| {
            let mut spec = spec.clone();
            remove(&mut spec, &path, step);
            read_value(&read, spec)
        };
        let errors: Vec<_> = steps.iter().map(without).collect();
        let cured = errors.iter().position(Option::is_none);
        // Without the key that says what a table is there is an error too, but another one.
        let tag =
            ["kind", "method"].map(|key| Step::Key(key.into())).into_iter().find(|tag| steps.contains(tag));
        let changed = |tags: bool| {
            let mut found = steps.iter().zip(&errors);
            found
                .position(|(step, found)| (Some(step) == tag.as_ref()) == tags && *found != Some(error.clone()))
        };
        let Some(next) = cured.or_else(|| changed(false)).or_else(|| changed(true)) else { break };
        let Some(step) = steps.into_iter().nth(next) else { break };
        if let Step::Index(index) = step {
            // What follows may have the same error.
            remove(&mut spec, &path, &Step::Index(index + 1));
        }
        path.push(step);
    }
    let shown = |text: String, step: &Step| match step {
        Step::Key(key) if text.is_empty() => key.clone(),
        Step::Key(key) => format!("{text}.{key}"),
        Step::Index(index) => format!("{text}[{index}]"),
    };
    (!path.is_empty()).then(|| path.iter().fold(String::new(), shown))
}

fn read_value(read: impl Fn(Table) -> Option<String>, spec: Value) -> Option<String> {
    if let Value::Table(table) = spec { read(table) } else { None }
}

/// A step towards a value.
#[derive(Clone, Debug, PartialEq)]
enum Step {
    Key(String),
    Index(usize),
}

/// The value one step on.
fn follow<'a>(value: &'a mut Value, step: &Step) -> Option<&'a mut Value> {
    match step {
        Step::Key(key) => value.get_mut(key),
        Step::Index(index) => value.get_mut(*index),
    }
}

/// The steps on from the value at `path`: into tables, and, the last one first, into arrays of tables.
fn steps(spec: &mut Value, path: &[Step]) -> Vec<Step> {
    match path.iter().try_fold(spec, follow) {
        Some(Value::Table(table)) => table.keys().cloned().map(Step::Key).collect(),
        Some(Value::Array(array)) if array.iter().all(Value::is_table) => {
            (0..array.len()).rev().map(Step::Index).collect()
        }
        _ => Vec::new(),
    }
}

/// Removes what `step` leads to from the value at `path`; of an array also all that follows, whose order is the
/// reader's.
fn remove(spec: &mut Value, path: &[Step], step: &Step) {
    match (path.iter().try_fold(spec, follow), step) {
        (Some(Value::Table(table)), Step::Key(key)) => drop(table.remove(key)),
        (Some(Value::Array(array)), Step::Index(index)) => array.truncate(*index),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An error at the first whole number below zero, in the order of keys.
    fn negative(value: &Value) -> Option<String> {
        match value {
            Value::Integer(number) if *number < 0 => Some("a negative number".into()),
            Value::Table(table) => table.values().find_map(negative),
            Value::Array(array) => array.iter().find_map(negative),
            _ => None,
        }
    }

    #[test]
    fn the_key_without_which_there_is_no_error_is_found() {
        for (spec, expected) in [
            ("a = 1\nb = -1", Some("b")),
            ("a = 1\n[b]\nc = 1\nd = [2, -3]", Some("b.d")),
            ("a = [{ b = 1 }, { b = 1, c = -1 }, { b = 1 }]", Some("a[1].c")),
            ("a = [{ b = 1 }, { b = -1 }, { b = -1 }]", Some("a[1].b")),
            ("a = 1", None),
        ] {
            let spec: Table = spec.parse().unwrap();
            let found = find(spec, |spec| negative(&Value::Table(spec)));
            assert_eq!(found.as_deref(), expected);
        }
    }
}
