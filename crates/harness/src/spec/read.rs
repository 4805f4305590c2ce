//! From a spec's text to a checked [`Experiment`], with what the command line changes.

use super::{Experiment, Labelled, Name, check};
use crate::Error;
use crate::report::Report;
use bvh_config::fault::{self, Fault, Read};
use bvh_scenes::read_text;
use bvh_search::Method;
use std::ffi::OsStr;
use std::path::Path;
use toml::{Table, Value};

/// What the command line changes in every spec.
#[derive(Clone, Debug, Default)]
pub struct Overrides {
    /// Replaces the scenes, if any are given.
    pub scenes: Vec<String>,
    /// Allows glTF files to name buffers outside their folders.
    pub outside_files: bool,
    /// Replaces the seed.
    pub seed: Option<u64>,
    /// Applies the spec's `quick` table.
    pub quick: bool,
}

impl Experiment {
    /// Reads and checks the spec at `path`. Does not load its scenes.
    pub fn read(path: &Path, overrides: &Overrides) -> Result<Self, Error> {
        Self::parse(path, &read_text(path)?, overrides)
    }

    /// Reads and checks a spec's text; `path` gives it its name.
    pub fn parse(path: &Path, text: &str, overrides: &Overrides) -> Result<Self, Error> {
        let refuse = |message: String| Error::Spec { file: path.to_owned(), message };
        let table: Table = text
            .parse()
            .map_err(|error: toml::de::Error| refuse(error.to_string()))?;
        let name = path
            .file_stem()
            .and_then(OsStr::to_str)
            .ok_or("no UTF-8".to_owned());
        let name = name.and_then(|name| Name::try_from(name.to_owned()));
        let name = name.map_err(|message| {
            refuse(format!("the file's name without its extension: {message}"))
        })?;
        // A key that `quick` replaces stands there, not where it is read.
        let above = overrides.quick.then_some("quick");
        let mut experiment = Self::from_table(table, name, overrides)
            .map_err(|faults| refuse(fault::say(&faults, text, &path.to_string_lossy(), above)))?;
        if let Some(folder) = path
            .parent()
            .and_then(Path::to_str)
            .filter(|_| overrides.scenes.is_empty())
        {
            let scenes = experiment
                .scenes
                .iter_mut()
                .chain(&mut experiment.optional_scenes);
            // Words are names.
            let is_path = |scene: &str| {
                scene
                    .split(':')
                    .next()
                    .is_some_and(|file| file.contains(['.', '/', '\\']))
            };
            for scene in scenes.filter(|scene| is_path(scene)) {
                *scene = Path::new(folder)
                    .join(&*scene)
                    .to_string_lossy()
                    .into_owned();
            }
        }
        Ok(experiment)
    }

    /// The experiment, or everything that is wrong with it.
    fn from_table(mut table: Table, name: Name, overrides: &Overrides) -> Result<Self, Vec<Fault>> {
        let mut faults = Vec::new();
        leave_out_never_right(&mut table, "", &mut faults);
        match table.remove("quick") {
            Some(Value::Table(quick)) if overrides.quick => replace(&mut table, quick),
            None if overrides.quick => {
                faults.push(Fault::new(
                    "quick",
                    "missing",
                    "with --quick, a table of keys to replace",
                ));
            }
            None | Some(Value::Table(_)) => {}
            Some(found) => faults.push(Fault::new("quick", found, "a table of keys to replace")),
        }
        let mut labels = labels(table.get("methods"));
        // Serde forgets the path to an error within a table that says itself of which type it is.
        let (methods, methods_at) = list(&mut table, "methods", Labelled::read, &mut faults);
        let read = |table| {
            fault::tagged(
                table,
                "kind",
                |kind, config| Report::read(kind, config),
                || Report::NAMES.join(", "),
            )
        };
        let (reports, reports_at) = list(&mut table, "reports", read, &mut faults);
        let (experiment, of_others) = fault::deserialize::<Self>(table);
        faults.extend(of_others);
        let Some(mut experiment) = experiment else { return Err(faults) };
        if experiment.name != Name::default() {
            faults.push(Fault::new("name", experiment.name, "none, the file's name is used"));
        }
        (experiment.name, experiment.quick) = (name, overrides.quick);
        (experiment.methods, experiment.reports) = (methods, reports);
        if let Some(seed) = overrides.seed {
            experiment.seed = seed;
        }
        experiment.outside_files |= overrides.outside_files;
        if !overrides.scenes.is_empty() {
            experiment.scenes.clone_from(&overrides.scenes);
            experiment.optional_scenes.clear();
        }
        if experiment.suite.is_some() && labels.is_empty() {
            experiment.methods = Method::all()
                .into_iter()
                .map(Labelled::new)
                .collect();
            labels = experiment
                .methods
                .iter()
                .map(|method| Some(method.label.clone()))
                .collect();
        }
        // What is refused already is missing, and a list empty, for no other reason.
        let apart = |late: &Fault| {
            !faults
                .iter()
                .any(|fault| fault::is_within(&fault.key, &late.key))
        };
        let together = [
            experiment
                .check_together()
                .into_iter()
                .filter(apart)
                .collect(),
            check::unique(&labels),
            experiment.check_methods(&methods_at),
            experiment.check_ends(&methods_at, &faults),
            experiment.check_reports(&labels, &reports_at),
            experiment.check_clock(),
        ];
        let faults = [faults, together.concat()].concat();
        if faults.is_empty() { Ok(experiment) } else { Err(faults) }
    }
}

/// The labels of the entries of `methods`, as far as they can be told.
fn labels(methods: Option<&Value>) -> Vec<Option<String>> {
    let label = |entry: &Value| {
        Some(
            entry
                .get("label")
                .or(entry.get("method"))?
                .as_str()?
                .to_owned(),
        )
    };
    methods
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .map(label)
        .collect()
}

/// Takes the list of tables under `key` out of a spec, and reads each table by `read`. Returns what could be read with its place in
/// the list; faults are added to `faults`.
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
    let mut read = |(at, entry): (usize, Value)| {
        let (value, of_entry) = match entry {
            Value::Table(entry) => read(entry),
            found => (None, vec![Fault::new("", found, "a table")]),
        };
        faults.extend(
            of_entry
                .into_iter()
                .map(|fault| fault.below(&format!("{key}[{at}]"))),
        );
        Some((value?, at))
    };
    entries
        .into_iter()
        .enumerate()
        .filter_map(&mut read)
        .unzip()
}

/// Takes out what no key takes: numbers that are infinite or NaN, and dates.
fn leave_out_never_right(table: &mut Table, above: &str, faults: &mut Vec<Fault>) {
    fn is_right(key: &str, value: &mut Value, faults: &mut Vec<Fault>) -> bool {
        match value {
            Value::Table(table) => leave_out_never_right(table, &format!("{key}."), faults),
            Value::Array(list) => {
                let mut right = true;
                for (index, value) in list.iter_mut().enumerate() {
                    right &= is_right(&format!("{key}[{index}]"), value, faults);
                }
                return right;
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
    table.retain(|key, value| is_right(&format!("{above}{key}"), value, faults));
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
