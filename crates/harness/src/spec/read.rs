//! Reads a spec's text, with the overrides of the command line, into a checked [`Experiment`].

use super::{Experiment, Labelled, Name, check};
use crate::Error;
use crate::report::Report;
use bvh_config::fault::{self, Fault, Read};
use bvh_scenes::files::read_text;
use bvh_search::Method;
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
    /// Let a glTF file name buffers outside its own folder. Its author then chooses which files are
    /// read.
    #[arg(long)]
    pub outside_files: bool,
    /// Seed instead of the spec's.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Run the spec's smaller variant, into the folder `quick` of the results.
    #[arg(long)]
    pub quick: bool,
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
        let mut experiment = Self::from_table(table, name, overrides).map_err(|faults| {
            rejected(fault::say(&faults, text, &path.to_string_lossy(), above))
        })?;
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

    /// Returns the experiment, or all faults of the spec.
    fn from_table(mut table: Table, name: Name, overrides: &Overrides) -> Result<Self, Vec<Fault>> {
        let mut faults = Vec::new();
        remove_unacceptable(&mut table, "", &mut faults);
        match table.remove("quick") {
            Some(Value::Table(quick)) if overrides.quick => replace(&mut table, quick),
            None if overrides.quick => {
                let accepted = "with --quick, a table of keys to replace";
                faults.push(Fault::new("quick", "missing", accepted));
            }
            None | Some(Value::Table(_)) => {}
            Some(found) => faults.push(Fault::new("quick", found, "a table of keys to replace")),
        }
        let mut labels = labels(table.get("methods"));
        // Serde loses the path to an error within an internally tagged enum, so entries are read
        // singly.
        let (methods, method_indices) = list(&mut table, "methods", Labelled::read, &mut faults);
        let (reports, report_indices) = list(&mut table, "reports", read_report, &mut faults);
        let (experiment, key_faults) = fault::deserialize::<Self>(table);
        faults.extend(key_faults);
        let Some(mut experiment) = experiment else { return Err(faults) };
        if experiment.name != Name::default() {
            faults.push(Fault::new("name", experiment.name, "none, the file's name is used"));
        }
        experiment.name = name;
        experiment.quick = overrides.quick;
        experiment.methods = methods;
        experiment.reports = reports;
        if let Some(seed) = overrides.seed {
            experiment.seed = seed;
        }
        // The command line can only allow more than the spec, never less.
        experiment.outside_files |= overrides.outside_files;
        if !overrides.scenes.is_empty() {
            experiment.scenes.clone_from(&overrides.scenes);
            experiment.optional_scenes.clear();
        }
        // The suite is about all methods; a list in the spec would miss new ones.
        if experiment.suite.is_some() && labels.is_empty() {
            experiment.methods = Method::all().into_iter().map(Labelled::new).collect();
            labels = experiment.methods.iter().map(|method| Some(method.label.clone())).collect();
        }
        // A value that was rejected now looks missing, which is not a second fault.
        let mut together = experiment.check_together();
        together.retain(|late| !faults.iter().any(|fault| fault::is_within(&fault.key, &late.key)));
        together.extend(check::unique(&labels));
        together.extend(experiment.check_methods(&method_indices));
        together.extend(experiment.check_ends(&method_indices, &faults));
        together.extend(experiment.check_reports(&labels, &report_indices));
        faults.extend(together);
        if faults.is_empty() { Ok(experiment) } else { Err(faults) }
    }
}

fn name_of(path: &Path) -> Result<Name, String> {
    let stem = path.file_stem().and_then(OsStr::to_str).ok_or("no UTF-8")?;
    Name::try_from(stem.to_owned())
}

/// Returns true if a scene is a mesh file; plain words are names.
fn is_path(scene: &str) -> bool {
    let file = scene.split(':').next().unwrap_or_default();
    file.contains(['.', '/', '\\'])
}

fn read_report(table: Table) -> Read<Report> {
    let accepted = || Report::NAMES.join(", ");
    fault::tagged(table, "kind", |kind, config| Report::read(kind, config), accepted)
}

/// Returns the labels of the entries of `methods`, `None` for those without a readable one.
fn labels(methods: Option<&Value>) -> Vec<Option<String>> {
    let entries = methods.and_then(Value::as_array);
    let entries = entries.into_iter().flatten();
    entries
        .map(|entry| {
            // Labels are read before the entries, so that a faulty entry does not hide its label
            // from reports.
            let label = entry.get("label").or(entry.get("method"))?;
            Some(label.as_str()?.to_owned())
        })
        .collect()
}

/// Removes the list of tables under `key` from a spec and reads each table by `read`.
///
/// Returns the values that could be read, with their indices in the list; adds faults to `faults`.
fn list<T>(
    table: &mut Table,
    key: &str,
    read: impl Fn(Table) -> Read<T>,
    faults: &mut Vec<Fault>,
) -> (Vec<T>, Vec<usize>) {
    let entries = match table.remove(key) {
        None => vec![],
        Some(Value::Array(entries)) => entries,
        Some(found) => {
            faults.push(Fault::new(key, found, "a list of tables"));
            vec![]
        }
    };
    let mut values = Vec::new();
    let mut indices = Vec::new();
    for (index, entry) in entries.into_iter().enumerate() {
        let (value, entry_faults) = match entry {
            Value::Table(entry) => read(entry),
            found => (None, vec![Fault::new("", found, "a table")]),
        };
        let entry_faults = entry_faults.into_iter();
        faults.extend(entry_faults.map(|fault| fault.below(&format!("{key}[{index}]"))));
        if let Some(value) = value {
            values.push(value);
            indices.push(index);
        }
    }
    (values, indices)
}

/// Removes values that no key accepts: infinite numbers, NaN, and dates.
fn remove_unacceptable(table: &mut Table, above: &str, faults: &mut Vec<Fault>) {
    fn is_acceptable(key: &str, value: &mut Value, faults: &mut Vec<Fault>) -> bool {
        match value {
            Value::Table(table) => remove_unacceptable(table, &format!("{key}."), faults),
            Value::Array(list) => {
                // Every element is visited, so that each one is named.
                let mut is_list_acceptable = true;
                for (index, value) in list.iter_mut().enumerate() {
                    is_list_acceptable &= is_acceptable(&format!("{key}[{index}]"), value, faults);
                }
                return is_list_acceptable;
            }
            Value::Float(number) if number.is_finite() => {}
            Value::Float(_) | Value::Datetime(_) => {
                faults.push(Fault::new(key, value, "under any key finite numbers, and no dates"));
                return false;
            }
            _ => {}
        }
        true
    }
    table.retain(|key, value| is_acceptable(&format!("{above}{key}"), value, faults));
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
