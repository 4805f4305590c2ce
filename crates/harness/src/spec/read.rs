//! From a spec's text to a checked [`Experiment`], with what the command line changes.

use super::fault::{self, Fault, line_of};
use super::{Experiment, Labelled, Name};
use crate::Error;
use crate::files;
use crate::report::Report;
use bvh_build::Check;
use bvh_search::Method;
use serde::de::DeserializeOwned;
use std::ffi::OsStr;
use std::path::Path;
use toml::{Table, Value};

/// What the command line changes in every spec.
#[derive(Clone, Debug, Default)]
pub struct Overrides {
    /// Replaces the scenes, if any are given.
    pub scenes: Vec<String>,
    /// Replaces the seed.
    pub seed: Option<u64>,
    /// Applies the spec's `quick` table.
    pub quick: bool,
}

/// Reads and checks a file of one configuration.
pub fn configuration<C: DeserializeOwned + Check>(path: &Path) -> Result<C, Error> {
    let text = files::read_text(path)?;
    let refuse = |message: String| Error::Spec { file: path.to_owned(), message };
    let table: Table = text.parse().map_err(|error: toml::de::Error| refuse(error.to_string()))?;
    let read = || {
        let config: C = fault::deserialize(table)?;
        config.check()?;
        Ok(config)
    };
    read().map_err(|fault: Fault| {
        let line = line_of(&text, &fault.key);
        refuse(line.map_or_else(|| fault.to_string(), |line| format!("line {line}: {fault}")))
    })
}

impl Experiment {
    /// Reads and checks the spec at `path`. Does not load its scenes.
    pub fn read(path: &Path, overrides: &Overrides) -> Result<Self, Error> {
        Self::parse(path, &files::read_text(path)?, overrides)
    }

    /// Reads and checks a spec's text; `path` gives it its name.
    pub fn parse(path: &Path, text: &str, overrides: &Overrides) -> Result<Self, Error> {
        let refuse = |message: String| Error::Spec { file: path.to_owned(), message };
        let table: Table = text.parse().map_err(|error: toml::de::Error| refuse(error.to_string()))?;
        let name = path.file_stem().and_then(OsStr::to_str).ok_or("no UTF-8".to_owned());
        let name = name.and_then(|name| Name::try_from(name.to_owned()));
        let name =
            name.map_err(|message| refuse(format!("the file's name without its extension: {message}")))?;
        Self::from_table(table, name, overrides).map_err(|fault| {
            // A key that `quick` replaces stands there, not where it is read.
            let quick = overrides.quick.then(|| line_of(text, &format!("quick.{}", fault.key))).flatten();
            let line = quick.or_else(|| line_of(text, &fault.key));
            refuse(line.map_or_else(|| fault.to_string(), |line| format!("line {line}: {fault}")))
        })
    }

    fn from_table(mut table: Table, name: Name, overrides: &Overrides) -> Result<Self, Fault> {
        if let Some((key, value)) = never_right(&table) {
            return Err(Fault::new(key, value, "under any key finite numbers, and no dates"));
        }
        match table.remove("quick") {
            Some(Value::Table(quick)) if overrides.quick => replace(&mut table, quick),
            None | Some(Value::Table(_)) => {}
            Some(found) => return Err(Fault::new("quick", found, "a table of keys to replace")),
        }
        // Serde forgets the path to an error within a table that says itself of which type it is.
        let methods = list(&mut table, "methods", Labelled::read)?;
        let reports = list(&mut table, "reports", |table| {
            fault::tagged(table, "kind", |kind, config| Report::read(kind, config), || Report::NAMES.join(", "))
        })?;
        let mut experiment: Self = fault::deserialize(table)?;
        if experiment.name != Name::default() {
            return Err(Fault::new("name", experiment.name, "none, the file's name is used"));
        }
        (experiment.name, experiment.quick) = (name, overrides.quick);
        (experiment.methods, experiment.reports) = (methods, reports);
        if let Some(seed) = overrides.seed {
            experiment.seed = seed;
        }
        if !overrides.scenes.is_empty() {
            experiment.scenes.clone_from(&overrides.scenes);
            experiment.optional_scenes.clear();
        }
        if experiment.suite.is_some() && experiment.methods.is_empty() {
            experiment.methods = Method::all().into_iter().map(Labelled::new).collect();
        }
        experiment.check()?;
        experiment.check_methods()?;
        experiment.check_reports()?;
        Ok(experiment)
    }
}

/// Takes the list of tables under `key` out of a spec, and reads each table by `read`.
fn list<T>(table: &mut Table, key: &str, read: impl Fn(Table) -> Result<T, Fault>) -> Result<Vec<T>, Fault> {
    let entries = match table.remove(key) {
        None => return Ok(vec![]),
        Some(Value::Array(entries)) => entries,
        Some(found) => return Err(Fault::new(key, found, "a list of tables")),
    };
    let read = |(at, entry): (usize, Value)| match entry {
        Value::Table(entry) => read(entry).map_err(|fault| fault.below(&format!("{key}[{at}]"))),
        found => Err(Fault::new(format!("{key}[{at}]"), found, "a table")),
    };
    entries.into_iter().enumerate().map(read).collect()
}

/// The first value that no key takes, with its key: a number that is infinite or NaN, or a date.
fn never_right(table: &Table) -> Option<(String, &Value)> {
    fn within(key: String, value: &Value) -> Option<(String, &Value)> {
        match value {
            Value::Float(number) if !number.is_finite() => Some((key, value)),
            Value::Datetime(_) => Some((key, value)),
            Value::Table(table) => never_right(table).map(|(inner, value)| (format!("{key}.{inner}"), value)),
            Value::Array(array) => {
                array.iter().enumerate().find_map(|(index, value)| within(format!("{key}[{index}]"), value))
            }
            _ => None,
        }
    }
    table.iter().find_map(|(key, value)| within(key.clone(), value))
}

/// Replaces keys of `table` by those of `by`, tables key by key.
fn replace(table: &mut Table, by: Table) {
    for (key, value) in by {
        match (table.get_mut(&key), value) {
            (Some(Value::Table(old)), Value::Table(new)) => replace(old, new),
            (_, value) => {
                table.insert(key, value);
            }
        }
    }
}
