//! From a spec's text to an [`Experiment`]: what the command line changes, and which key is at fault.

use super::{Contestant, Experiment, Labelled};
use crate::{Error, spec::culprit};
use bvh_search::Method;
use serde::Deserialize;
use std::path::Path;

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

impl Experiment {
    /// Reads and checks the spec at `path`. Does not load its scenes.
    pub fn read(path: &Path, overrides: &Overrides) -> Result<Self, Error> {
        let fail = |error: std::io::Error| Error::Spec { file: path.to_owned(), message: error.to_string() };
        Self::parse(path, &std::fs::read_to_string(path).map_err(fail)?, overrides)
    }

    /// Reads and checks a spec's text; `path` gives it its name.
    pub fn parse(path: &Path, text: &str, overrides: &Overrides) -> Result<Self, Error> {
        let fail = |message: String| Error::Spec { file: path.to_owned(), message };
        let mut table: toml::Table = text.parse().map_err(|error: toml::de::Error| fail(error.to_string()))?;
        if let Some((key, value)) = never_right(&table) {
            return Err(fail(format!("{key} is {value}; accepted under any key: finite numbers, no dates")));
        }
        let quick = table.remove("quick");
        let mut name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        // Parsed from the text where possible, so that errors show its line.
        let mut experiment: Self = if overrides.quick || quick.is_some() {
            if overrides.quick {
                name += "-quick";
                match quick {
                    Some(toml::Value::Table(quick)) => replace(&mut table, quick),
                    Some(found) => {
                        return Err(fail(format!("quick is {found}; accepted: a table of keys to replace")));
                    }
                    None => {}
                }
            }
            Self::deserialize(table.clone())
        } else {
            toml::from_str(text)
        }
        .map_err(|error| fail(explain(&error, table)))?;
        if !experiment.name.is_empty() {
            return Err(fail(format!(
                "name is {:?}; accepted: none, the file's name is used",
                experiment.name
            )));
        }
        experiment.name = name;
        if let Some(seed) = overrides.seed {
            experiment.seed = seed;
        }
        if !overrides.scenes.is_empty() {
            experiment.scenes.clone_from(&overrides.scenes);
            experiment.optional_scenes.clear();
        }
        if experiment.suite.is_some() && experiment.methods.is_empty() {
            let labelled = |method: Method| Labelled {
                label: method.name().into(),
                method: Contestant::Ours(method),
                budget: None,
                keep: vec![],
                seed_as: None,
            };
            experiment.methods = Method::all().into_iter().map(labelled).collect();
        }
        experiment.check().map_err(fail)?;
        Ok(experiment)
    }
}

/// The first value that no key takes, with its key: a number that is none or infinite, or a date.
fn never_right(table: &toml::Table) -> Option<(String, &toml::Value)> {
    fn within(key: String, value: &toml::Value) -> Option<(String, &toml::Value)> {
        match value {
            toml::Value::Float(number) if !number.is_finite() => Some((key, value)),
            toml::Value::Datetime(_) => Some((key, value)),
            toml::Value::Table(table) => {
                never_right(table).map(|(inner, value)| (format!("{key}.{inner}"), value))
            }
            toml::Value::Array(array) => {
                array.iter().enumerate().find_map(|(index, value)| within(format!("{key}[{index}]"), value))
            }
            _ => None,
        }
    }
    table.iter().find_map(|(key, value)| within(key.clone(), value))
}

/// What the parser says, and the key that it is about.
fn explain(error: &toml::de::Error, table: toml::Table) -> String {
    let read =
        |table| Experiment::deserialize(table).err().map(|error: toml::de::Error| error.message().to_owned());
    let said = error.to_string();
    let shown = if error.span().is_some() { &said } else { error.message() };
    match culprit::find(table, read) {
        Some(key) => format!("{} (key {key})", shown.trim()),
        None => said.trim().to_owned(),
    }
}

/// Replaces keys of `table` by those of `by`, tables key by key.
fn replace(table: &mut toml::Table, by: toml::Table) {
    for (key, value) in by {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(old)), toml::Value::Table(new)) => replace(old, new),
            (_, value) => {
                table.insert(key, value);
            }
        }
    }
}
