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
        let mut experiment = Self::from_table(table, name, overrides).map_err(|faults| {
            let said = |fault: &Fault| {
                // A key that `quick` replaces stands there, not where it is read.
                let quick = overrides.quick.then(|| line_of(text, &format!("quick.{}", fault.key))).flatten();
                let line = quick.or_else(|| line_of(text, &fault.key));
                line.map_or_else(|| fault.to_string(), |line| format!("line {line}: {fault}"))
            };
            let all: Vec<String> = faults.iter().map(said).collect();
            refuse(all.join(&format!("\n{}: ", path.display())))
        })?;
        if let Some(folder) = path.parent().and_then(Path::to_str).filter(|_| overrides.scenes.is_empty()) {
            let scenes = experiment.scenes.iter_mut().chain(&mut experiment.optional_scenes);
            // Words are names.
            let is_path =
                |scene: &str| scene.split(':').next().is_some_and(|file| file.contains(['.', '/', '\\']));
            for scene in scenes.filter(|scene| is_path(scene)) {
                *scene = Path::new(folder).join(&*scene).to_string_lossy().into_owned();
            }
        }
        Ok(experiment)
    }

    /// The first fault of every table, if there are any.
    fn from_table(mut table: Table, name: Name, overrides: &Overrides) -> Result<Self, Vec<Fault>> {
        if let Some((key, value)) = never_right(&table) {
            return Err(vec![Fault::new(key, value, "under any key finite numbers, and no dates")]);
        }
        match table.remove("quick") {
            Some(Value::Table(quick)) if overrides.quick => replace(&mut table, quick),
            None if overrides.quick => {
                return Err(vec![Fault::new("quick", "missing", "with --quick, a table of keys to replace")]);
            }
            None | Some(Value::Table(_)) => {}
            Some(found) => return Err(vec![Fault::new("quick", found, "a table of keys to replace")]),
        }
        let mut faults = Vec::new();
        // Serde forgets the path to an error within a table that says itself of which type it is.
        let methods = list(&mut table, "methods", Labelled::read, &mut faults);
        let read = |table| {
            fault::tagged(table, "kind", |kind, config| Report::read(kind, config), || Report::NAMES.join(", "))
        };
        let reports = list(&mut table, "reports", read, &mut faults);
        let mut experiment: Self = match fault::deserialize(table) {
            Ok(experiment) if faults.is_empty() => experiment,
            Ok(_) => return Err(faults),
            Err(fault) => return Err([vec![fault], faults].concat()),
        };
        if experiment.name != Name::default() {
            return Err(vec![Fault::new("name", experiment.name, "none, the file's name is used")]);
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
        let faults: Vec<Fault> = experiment.check().err().map(Fault::from).into_iter().collect();
        let together = [experiment.check_methods(), experiment.check_clock(), experiment.check_reports()];
        let faults = [faults, together.concat()].concat();
        if faults.is_empty() { Ok(experiment) } else { Err(faults) }
    }
}

/// Takes the list of tables under `key` out of a spec, and reads each table by `read`; faults are added to `faults`.
fn list<T>(
    table: &mut Table,
    key: &str,
    read: impl Fn(Table) -> Result<T, Fault>,
    faults: &mut Vec<Fault>,
) -> Vec<T> {
    let entries = match table.remove(key) {
        None => vec![],
        Some(Value::Array(entries)) => entries,
        Some(found) => {
            faults.push(Fault::new(key, found, "a list of tables"));
            vec![]
        }
    };
    let read = |(at, entry): (usize, Value)| match entry {
        Value::Table(entry) => read(entry).map_err(|fault| fault.below(&format!("{key}[{at}]"))),
        found => Err(Fault::new(format!("{key}[{at}]"), found, "a table")),
    };
    entries
        .into_iter()
        .enumerate()
        .filter_map(|entry| read(entry).map_err(|fault| faults.push(fault)).ok())
        .collect()
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
