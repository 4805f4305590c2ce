//! Reads a spec's text, with the overrides of the command line, into a checked [`Experiment`].

use super::{Experiment, Labelled};
use crate::Error;
use crate::peers;
use crate::report::Report;
use bvh_config::{OutOfRange, fault};
use bvh_scenes::files::read_text;
use bvh_scenes::subset;
use bvh_search::Method;
use serde::{Deserialize, Deserializer, de};
use std::ffi::OsStr;
use std::path::Path;
use toml::{Table, Value};

/// The keys that the command line changes in every spec.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Overrides {
    /// Scene to run on instead of the spec's scenes, by name or path of a mesh file; may be
    /// repeated.
    #[arg(long = "scene", value_name = "NAME|PATH")]
    pub scenes: Vec<String>,
    /// Seed instead of the spec's.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Run the spec's smaller variant, into the folder `quick` of the results.
    #[arg(long)]
    pub quick: bool,
}

impl Overrides {
    /// Names the spec in a fault of its scenes, unless the command line names the scenes.
    pub fn named(&self, spec: &Path, error: Error) -> Error {
        match error {
            Error::Scene(fault) if self.scenes.is_empty() => {
                Error::Spec { file: spec.to_owned(), message: format!("scenes: {fault}") }
            }
            error => error,
        }
    }
}

impl Experiment {
    /// Reads and checks the spec at `path`. Does not load its scenes.
    pub fn read(path: &Path, overrides: &Overrides) -> Result<Self, Error> {
        Self::parse(path, &read_text(path)?, overrides)
    }

    /// Reads and checks a spec's text; `path` determines the experiment's name.
    pub fn parse(path: &Path, text: &str, overrides: &Overrides) -> Result<Self, Error> {
        let rejected = |message: String| Error::Spec { file: path.to_owned(), message };
        let table: Table =
            text.parse().map_err(|error: toml::de::Error| rejected(error.to_string()))?;
        let name = name_of(path).map_err(|message| {
            rejected(format!("the file's name without its extension: {message}"))
        })?;
        // A key that `quick` replaces is written there, not where it is read.
        let above = overrides.quick.then_some("quick");
        let mut experiment = Self::from_table(table, name, overrides)
            .map_err(|fault| rejected(fault.in_text(text, above)))?;
        // Paths in a spec are relative to its folder, those on the command line to the shell's.
        if overrides.scenes.is_empty()
            && let Some(folder) = path.parent()
        {
            let scenes = experiment.scenes.iter_mut().chain(&mut experiment.optional_scenes);
            for scene in scenes.filter(|scene| is_path(scene)) {
                let path = folder.join(&*scene);
                *scene = path.to_string_lossy().into_owned();
            }
        }
        Ok(experiment)
    }

    fn from_table(
        mut table: Table,
        name: String,
        overrides: &Overrides,
    ) -> Result<Self, OutOfRange> {
        check_numbers(&table, "")?;
        match table.remove("quick") {
            Some(Value::Table(quick)) if overrides.quick => replace(&mut table, quick),
            None if overrides.quick => {
                let accepted = "with --quick, a table of keys to replace";
                return Err(OutOfRange::new("quick", "missing", accepted));
            }
            None | Some(Value::Table(_)) => {}
            Some(found) => {
                return Err(OutOfRange::new("quick", found, "a table of keys to replace"));
            }
        }
        // Serde loses the path to an error within an internally tagged enum, so entries are read
        // singly.
        let methods = list(&mut table, "methods", Labelled::read)?;
        let reports = list(&mut table, "reports", |table| {
            let accepted = || Report::NAMES.join(", ");
            fault::tagged(table, "kind", |kind, config| Report::read(kind, config), accepted)
        })?;
        let mut experiment: Self = fault::deserialize(table)?;
        if !experiment.name.is_empty() {
            return Err(OutOfRange::new("name", experiment.name, "none, the file's name is used"));
        }
        experiment.name = name;
        experiment.quick = overrides.quick;
        experiment.methods = methods;
        experiment.reports = reports;
        if let Some(seed) = overrides.seed {
            experiment.seed = seed;
        }
        if !overrides.scenes.is_empty() {
            experiment.scenes.clone_from(&overrides.scenes);
            experiment.optional_scenes.clear();
        }
        experiment.optional_scenes =
            experiment.optional_scenes.iter().flat_map(|name| subset::expand(name)).collect();
        // The suite is about all methods; a list in the spec would miss new ones.
        if experiment.suite.is_some() && experiment.methods.is_empty() {
            experiment.methods = Method::all().into_iter().map(Labelled::new).collect();
        }
        if let Some(keys) = experiment.tracing.take() {
            let resolved = (peers::others("tracing")?.tracing.resolve)(keys);
            experiment.tracing = Some(resolved.map_err(|fault| fault.below("tracing"))?);
        }
        experiment.check_together()?;
        Ok(experiment)
    }
}

/// The accepted names, for error messages.
const ACCEPTED: &str = "names that do not begin with a dot, are not `quick`, and have \
     no /, \\, : or control characters";

/// Rejects a name that is not safe for a folder in the results: one that leads outside, or that the
/// harness gives to one of its files.
fn check_name(name: &str) -> Result<(), String> {
    let is_reserved = name.starts_with('.') || name == "quick";
    // Separators of paths, on any system, and characters that terminals obey.
    let is_forbidden = |c: char| c.is_control() || ['/', '\\', ':'].contains(&c);
    if is_reserved || name.contains(is_forbidden) {
        return Err(format!("{name:?} is not the name of an experiment; accepted: {ACCEPTED}"));
    }
    Ok(())
}

/// Reads a checked name.
pub(super) fn read_name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    let name = String::deserialize(deserializer)?;
    check_name(&name).map_err(de::Error::custom)?;
    Ok(name)
}

fn name_of(path: &Path) -> Result<String, String> {
    let stem = path.file_stem().and_then(OsStr::to_str).ok_or("no UTF-8")?;
    check_name(stem)?;
    Ok(stem.to_owned())
}

/// Returns true if a scene is a mesh file; plain words are names.
fn is_path(scene: &str) -> bool {
    let file = scene.split(':').next().unwrap_or_default();
    file.contains(['.', '/', '\\'])
}

/// Removes the list of tables under `key` from a spec and reads each table by `read`.
fn list<T>(
    table: &mut Table,
    key: &str,
    read: impl Fn(Table) -> Result<T, OutOfRange>,
) -> Result<Vec<T>, OutOfRange> {
    let entries = match table.remove(key) {
        None => vec![],
        Some(Value::Array(entries)) => entries,
        Some(found) => return Err(OutOfRange::new(key, found, "a list of tables")),
    };
    let read_entry = |(index, entry)| {
        let value = match entry {
            Value::Table(entry) => read(entry),
            found => Err(OutOfRange::new("", found, "a table")),
        };
        value.map_err(|fault| fault.below(format!("{key}[{index}]")))
    };
    entries.into_iter().enumerate().map(read_entry).collect()
}

/// Rejects values that no key accepts: infinite numbers, NaN, and dates.
fn check_numbers(table: &Table, above: &str) -> Result<(), OutOfRange> {
    fn check(key: &str, value: &Value) -> Result<(), OutOfRange> {
        match value {
            Value::Table(table) => check_numbers(table, &format!("{key}.")),
            Value::Array(list) => list
                .iter()
                .enumerate()
                .try_for_each(|(index, value)| check(&format!("{key}[{index}]"), value)),
            Value::Float(number) if number.is_finite() => Ok(()),
            Value::Float(_) | Value::Datetime(_) => {
                Err(OutOfRange::new(key, value, "under any key finite numbers, and no dates"))
            }
            _ => Ok(()),
        }
    }
    table.iter().try_for_each(|(key, value)| check(&format!("{above}{key}"), value))
}

/// Replaces keys of `table` by the keys of `replacements`, nested tables key by key.
fn replace(table: &mut Table, replacements: Table) {
    for (key, value) in replacements {
        match (table.get_mut(&key), value) {
            // A quick variant names only the keys that it changes, also within tables.
            (Some(Value::Table(old)), Value::Table(new)) => replace(old, new),
            (_, value) => {
                table.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_elsewhere_or_are_reserved_are_rejected() {
        for good in ["table4", "two words", "größe", "v1.2", "a..b"] {
            assert_eq!(check_name(good), Ok(()));
        }
        let leading_elsewhere = [".", "..", "a/b", "..\\x", "c:x"];
        let reserved = [".lock", ".partial", "quick"];
        let control = ["a\u{1b}[2J", "a\0"];
        for wrong in leading_elsewhere.iter().chain(&reserved).chain(&control) {
            assert!(check_name(wrong).is_err(), "{wrong:?}");
        }
    }
}
