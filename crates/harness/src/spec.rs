//! Experiment specs: TOML in, a checked [`Experiment`] out, or an error with file, key, found and accepted.

use crate::peers::Peer;
use crate::report::Report;
use crate::scene::{Scene, fnv1a};
use crate::{Error, culprit, part, rays, render, suite, tracing};
use bvh_core::cost::Objective;
use bvh_search::{Budget, Method, Omission, Problem, exact, solve};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::path::Path;

/// A checked experiment: every method on every scene, so many times, and how to report it.
///
/// These are also the keys of a spec, except that `quick` may hold a table of keys that replace others under
/// `--quick`. Serialised, with every default spelled out, it is `resolved.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Name of the results folder: the spec file's stem, `-quick` appended under `--quick`.
    #[serde(default)]
    pub name: String,
    /// What the experiment asks, for its readers.
    pub question: String,
    /// A measurement over the suite of stiff cases, in place of runs on scenes. Default none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub suite: Option<suite::Measure>,
    /// Names or paths of the scenes; `A..B` after a colon stands for all numbers from A to B. With `suite`, names of
    /// cases, none for all.
    #[serde(default)]
    pub scenes: Vec<String>,
    /// Scenes that are left out, with a note, where they have not been fetched. Default none.
    #[serde(default)]
    pub optional_scenes: Vec<String>,
    /// Every run's seed is derived from this one, the experiment, the scene, the method and the repetition. Default 1.
    #[serde(default = "one")]
    pub seed: u64,
    /// Runs of every method on every scene, at least 1. Default 1.
    #[serde(default = "one")]
    pub repetitions: u32,
    /// One run at a time, methods in turns, because their times are the result. Default false.
    #[serde(default)]
    pub sequential: bool,
    /// Threads that every run has in place of all, at least 1. Default none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub threads: Option<u16>,
    /// What `cost` means. Default the paper's objective.
    #[serde(default)]
    pub objective: Objective,
    /// Limits of every run. Default none.
    #[serde(default)]
    pub budget: Budget,
    /// Effort of a lower bound of every scene's internal area. Default none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lower_bound: Option<u32>,
    /// What is run, at least one; with `suite`, none for every method of the registry.
    #[serde(default)]
    pub methods: Vec<Labelled>,
    /// Measurements of every run's tree with random rays. Default none.
    #[serde(default)]
    pub rays: Vec<rays::Config>,
    /// A picture drawn with every run's tree, and with brute force and a KD-tree. Default none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub render: Option<render::experiment::Config>,
    /// Rays traced through the tree of every method's first run, in all layouts, in turns. Default none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tracing: Option<tracing::Config>,
    /// Tables and figures made from the rows. Default none.
    #[serde(default)]
    pub reports: Vec<Report>,
}

/// A method with the label that tables and figures show, by default its name, and limits of its own, if it has any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Table", into = "toml::Table")]
pub struct Labelled {
    /// Unique within the experiment.
    pub label: String,
    /// What is run.
    pub method: Contestant,
    /// Limits of its runs besides the experiment's: the lower of both counts. Default none.
    pub budget: Option<Budget>,
    /// What its runs do although the scene does not need it, to measure what leaving it out saves. Default nothing.
    pub keep: Vec<Omission>,
    /// Label whose seeds its runs have, for methods that are to differ in nothing else. Default its own.
    pub seed_as: Option<String>,
}

/// A method of ours, or another library.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
#[allow(missing_docs, reason = "said above")]
pub enum Contestant {
    Ours(Method),
    Peer(Peer),
}

impl TryFrom<toml::Table> for Labelled {
    type Error = String;

    fn try_from(mut table: toml::Table) -> Result<Self, String> {
        let known = |name: &String| Method::NAMES.iter().chain(Peer::NAMES).any(|known| known == name);
        let mut text = |key: &str| match table.remove(key) {
            Some(toml::Value::String(text)) => Ok(Some(text)),
            Some(found) => Err(format!("{key} is {found}; accepted: a text")),
            None => Ok(None),
        };
        let (label, seed_as) = (text("label")?, text("seed_as")?);
        let budget = table.remove("budget").map(Budget::deserialize).transpose();
        let budget = budget.map_err(|error| format!("budget: {}", error.message()))?;
        let keep = table.remove("keep").map_or(Ok(vec![]), Vec::deserialize);
        let keep = keep.map_err(|error| format!("keep: {}", error.message()))?;
        let name = match table.get("method") {
            Some(toml::Value::String(name)) if known(name) => name.clone(),
            found => {
                let found = found.map_or_else(|| "is missing".to_owned(), |found| format!("is {found}"));
                let (ours, peers) = (Method::NAMES.join(", "), Peer::NAMES.join(", "));
                return Err(format!("method {found}; accepted: {ours}, or the libraries {peers}"));
            }
        };
        let method = if Method::NAMES.contains(&name.as_str()) {
            Method::deserialize(table).map(Contestant::Ours)
        } else {
            Peer::deserialize(table).map(Contestant::Peer)
        };
        let method = method.map_err(|error| format!("{name}: {}", error.message()))?;
        Ok(Self { label: label.unwrap_or(name), method, budget, keep, seed_as })
    }
}

impl From<Labelled> for toml::Table {
    fn from(labelled: Labelled) -> Self {
        let mut table = Self::try_from(&labelled.method).unwrap_or_default();
        table.insert("label".into(), labelled.label.into());
        if let Some(budget) = labelled.budget.and_then(|budget| toml::Value::try_from(budget).ok()) {
            table.insert("budget".into(), budget);
        }
        if !labelled.keep.is_empty()
            && let Ok(keep) = toml::Value::try_from(labelled.keep)
        {
            table.insert("keep".into(), keep);
        }
        if let Some(label) = labelled.seed_as {
            table.insert("seed_as".into(), label.into());
        }
        table
    }
}

fn one<T: From<u8>>() -> T {
    1.into()
}

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
        let quick = table.remove("quick");
        if let Some((key, value)) = never_right(&table) {
            return Err(fail(format!("{key} is {value}; accepted under any key: finite numbers, no dates")));
        }
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

    /// Everything that types alone do not say.
    fn check(&self) -> Result<(), String> {
        if self.suite.is_some() {
            if let Some(unknown) = self.scenes.iter().find(|id| suite::examine::case(id).is_none()) {
                return Err(format!("scene {unknown} is no case of the suite; accepted: S01 to S45"));
            }
            if let Some(Labelled { label, .. }) =
                self.methods.iter().find(|labelled| matches!(labelled.method, Contestant::Peer(_)))
            {
                return Err(format!("{label} is another library; accepted in the suite: its key `peers`"));
            }
        } else if self.scenes.is_empty() {
            return Err("scenes is empty; accepted: at least one name or path".into());
        }
        let scenes = self.scenes.iter().map(|name| part::names(name)).fold(0, u64::saturating_add);
        if let Some(none) = self.scenes.iter().find(|name| part::names(name) == 0) {
            return Err(format!("scenes: {none:?} ends before it begins; accepted: A..B with A up to B"));
        }
        let runs =
            [self.methods.len() as u64, self.repetitions.into()].into_iter().fold(scenes, u64::saturating_mul);
        if runs > MOST_RUNS {
            return Err(format!(
                "scenes, methods and repetitions make {runs} runs; accepted: up to {MOST_RUNS}"
            ));
        }
        if let Objective::Sah(constants) = self.objective {
            for (key, value) in [("traversal", constants.traversal), ("intersection", constants.intersection)] {
                if value < 0.0 {
                    return Err(format!("objective.sah.{key} is {value}; accepted: 0 or more"));
                }
            }
        }
        if self.methods.is_empty() {
            return Err("methods is empty; accepted: at least one table with a `method`".into());
        }
        if self.repetitions == 0 {
            return Err("repetitions is 0; accepted: 1 or more".into());
        }
        if i64::try_from(self.seed).is_err() {
            return Err(format!("seed is {}; accepted: 0 to {}", self.seed, i64::MAX));
        }
        if let Some(index) = self.rays.iter().position(|rays| rays.count == 0) {
            return Err(format!("rays[{index}].count is 0; accepted: 1 or more"));
        }
        self.render.map_or(Ok(()), |render| render.check())?;
        if self.threads == Some(0) {
            return Err("threads is 0; accepted: 1 or more".into());
        }
        if let Some(tracing) = &self.tracing {
            for (key, value) in [("count", tracing.count), ("rounds", tracing.rounds)] {
                if value == 0 {
                    return Err(format!("tracing.{key} is 0; accepted: 1 or more"));
                }
                if value > MOST_RAYS {
                    return Err(format!("tracing.{key} is {value}; accepted: 1 to {MOST_RAYS}"));
                }
            }
        }
        let mut labels = HashSet::new();
        for (index, Labelled { label, method, .. }) in self.methods.iter().enumerate() {
            if !labels.insert(label) {
                return Err(format!(
                    "methods[{index}].label is {label:?} for the second time; accepted: unique labels"
                ));
            }
            let method = match method {
                Contestant::Ours(method) => method,
                Contestant::Peer(peer) => match peer.missing_feature() {
                    Some(feature) => {
                        let (name, ours) = (peer.name(), Method::NAMES.join(", "));
                        return Err(format!(
                            "methods[{index}].method is {name:?}, another library, which needs `cargo run --release -p \
                             harness --features {feature}`; accepted without: {ours}"
                        ));
                    }
                    None => continue,
                },
            };
            // A search checks its own parameters before it looks at the scene: let it, on the scene of nothing.
            let budget = Budget { max_evaluations: Some(1), max_work: None };
            let nothing = Problem { objective: self.objective, ..Problem::new(&[]) };
            solve(method, &nothing, 0, budget, &())
                .map_err(|error| format!("methods[{index}] ({label}): {error}"))?;
        }
        for (index, report) in self.reports.iter().enumerate() {
            for label in report.labels() {
                if !labels.contains(label) {
                    let known: Vec<_> = self.methods.iter().map(|method| method.label.as_str()).collect();
                    let known = known.join(", ");
                    let key = key_of(report, label).unwrap_or_default();
                    return Err(format!("reports[{index}] names method {label:?}{key}; accepted: {known}"));
                }
            }
        }
        Ok(())
    }

    /// Loads the scenes, those optional ones that are there included. Returns them and the names of those left out.
    pub fn load_scenes(&self) -> Result<(Vec<Scene>, Vec<String>), Error> {
        let names = self.scenes.iter().flat_map(|name| part::expand(name));
        let mut scenes = names.map(|name| Scene::load(&name)).collect::<Result<Vec<_>, _>>()?;
        let mut left_out = Vec::new();
        for name in &self.optional_scenes {
            match Scene::load(name) {
                Ok(scene) => scenes.push(scene),
                Err(_) => left_out.push(name.clone()),
            }
        }
        let mut names = HashSet::new();
        match scenes.iter().find(|scene| !names.insert(&scene.name)) {
            Some(twice) => Err(Error::Usage(format!("two scenes are called {}; name each once", twice.name))),
            None => Ok((scenes, left_out)),
        }
    }

    /// The runs on one scene in order: method, repetition, and whether it is the first.
    pub fn runs(&self) -> impl Iterator<Item = (&Labelled, u32, bool)> {
        let of = |labelled| (0..self.repetitions).map(move |repetition| (labelled, repetition));
        self.methods
            .iter()
            .flat_map(of)
            .enumerate()
            .map(|(index, (labelled, repetition))| (labelled, repetition, index == 0))
    }

    /// Whether gaps are measured on scenes of so many objects from their exact optimum.
    pub fn needs_optimum(&self, objects: usize) -> bool {
        objects <= exact::MOST_OBJECTS && self.reports.iter().any(Report::needs_references)
    }

    /// The limits of a method's runs.
    pub fn budget_of(&self, labelled: &Labelled) -> Budget {
        let own = labelled.budget.unwrap_or_default();
        let lower = |a: Option<u64>, b: Option<u64>| a.into_iter().chain(b).min();
        Budget {
            max_evaluations: lower(self.budget.max_evaluations, own.max_evaluations),
            max_work: lower(self.budget.max_work, own.max_work),
        }
    }

    /// The seed of one run, within 32 bits so that every spreadsheet keeps it exactly.
    pub fn seed_of(&self, scene: &str, label: &str, repetition: u32) -> u64 {
        let identity = format!("{}\0{}\0{scene}\0{label}\0{repetition}", self.seed, self.name);
        let hash = fnv1a(identity.into_bytes());
        (hash ^ (hash >> 32)) & 0xffff_ffff
    }
}

/// Most runs of an experiment.
const MOST_RUNS: u64 = 10_000_000;

/// Most rays of a kind, all in memory at once.
const MOST_RAYS: u32 = 100_000_000;

/// Under which key a report names a method, for the message.
fn key_of(report: &Report, label: &str) -> Option<String> {
    fn names(value: &toml::Value, label: &str) -> bool {
        match value {
            toml::Value::String(text) => text == label,
            toml::Value::Array(array) => array.iter().any(|value| names(value, label)),
            toml::Value::Table(table) => table.iter().any(|(key, value)| key != "name" && names(value, label)),
            _ => false,
        }
    }
    let texts = ["kind", "source", "title", "reason", "file"];
    let table = toml::Table::try_from(report).ok()?;
    let (key, value) =
        table.iter().find(|(key, value)| !texts.contains(&key.as_str()) && names(value, label))?;
    // One of several tables: the key in it, too.
    let of_table = |table: &toml::Value| {
        let found = table.as_table()?.iter().find(|(key, value)| *key != "name" && names(value, label));
        Some(found?.0.clone())
    };
    let inner = value.as_array().and_then(|tables| tables.iter().find_map(of_table));
    Some(inner.map_or_else(|| format!(" under {key}"), |inner| format!(" under {inner} of {key}")))
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

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "question = 'q'\nscenes = ['escher']\nmethods = [{ method = 'grasp', noise = 0.1 }]\n";

    fn read(text: &str, overrides: &Overrides) -> Result<Experiment, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("spec.toml");
        std::fs::write(&path, text).unwrap();
        Experiment::read(&path, overrides).map_err(|error| error.to_string())
    }

    #[test]
    fn wrong_keys_and_values_are_named_with_what_would_be_accepted() {
        for (wrong, parts) in [
            ("alpa = 1\n", &["spec.toml", "alpa", "expected one of", "repetitions"][..]),
            ("repetitions = 0\n", &["repetitions is 0", "1 or more"]),
            ("repetitions = 'x'\n", &["repetitions", "x", "line"]),
            ("seed = -1\n", &["seed", "-1"]),
            ("name = 'x'\n", &["name", "the file's name is used"]),
            ("objective = 'volume'\n", &["volume", "internal_area"]),
            ("budget = { seconds = 1 }\n", &["seconds", "max_evaluations"]),
            ("[[reports]]\nkind = 'pie'\n", &["pie", "table"]),
            ("rays = [{ family = 'lines', query = 'any', count = 0 }]\n", &["rays[0].count is 0"]),
            ("tracing = { rounds = 0 }\n", &["tracing.rounds is 0", "1 or more"]),
            ("threads = 0\n", &["threads is 0", "1 or more"]),
            ("repetitions = 4294967295\n", &["repetitions", "4294967295 runs"]),
            ("optional_scenes = []\nscenes = ['a:0..4294967295']\n", &["scenes", "4294967296 runs"]),
            ("scenes = ['a:0..9999:0..99999:0..4294967295']\n", &["scenes", "4294967296000000000 runs"]),
            ("scenes = ['a:5..4']\n", &["scenes", "a:5..4", "A up to B"]),
            ("tracing = { count = 4294967295 }\n", &["tracing.count", "1 to 100000000"]),
            ("objective = { sah = { traversal = -1.0 } }\n", &["objective.sah.traversal is -1"]),
            ("rays = [{ count = nan }]\n", &["rays[0].count is nan", "finite"]),
            ("rays = [{ family = 'curves', query = 'any', count = 1 }]\n", &["curves", "inside"]),
        ] {
            let good = if wrong.contains("scenes = ['a") {
                GOOD.replace("scenes = ['escher']\n", "")
            } else {
                GOOD.into()
            };
            let message = read(&format!("{good}{wrong}"), &Overrides::default()).unwrap_err();
            assert!(parts.iter().all(|part| message.contains(part)), "{wrong}: {message}");
        }
    }

    #[test]
    fn wrong_methods_are_named_with_what_would_be_accepted() {
        for (methods, parts) in [
            ("[]", &["methods is empty"][..]),
            ("[{ noise = 0.1 }]", &["method is missing", "grasp"]),
            ("[{ method = 'grep' }]", &["\"grep\"", "muller_fellner"]),
            ("[{ method = 'obvhs', preset = 'best' }]", &["obvhs", "best", "very_slow"]),
            ("[{ method = 'grasp', alpa = 1 }]", &["grasp", "alpa", "noise"]),
            ("[{ method = 'grasp', noise = 1.5 }]", &["methods[0]", "noise is 1.5", "0 to 1"]),
            ("[{ method = 'grasp', label = 3 }]", &["label is 3"]),
            ("[{ method = 'grasp', budget = { max_seconds = 3 } }]", &["max_seconds", "max_work"]),
            ("[{ method = 'grasp' }, { method = 'grasp' }]", &["methods[1].label", "second time"]),
        ] {
            let text = format!("question = 'q'\nscenes = ['escher']\nmethods = {methods}\n");
            let message = read(&text, &Overrides::default()).unwrap_err();
            assert!(parts.iter().all(|part| message.contains(part)), "{methods}: {message}");
        }
    }

    #[test]
    fn another_library_is_accepted_exactly_with_its_feature() {
        for name in Peer::NAMES {
            let text = format!("question = 'q'\nscenes = ['escher']\nmethods = [{{ method = '{name}' }}]\n");
            let Contestant::Peer(peer) = toml::from_str::<Experiment>(&text).unwrap().methods.remove(0).method
            else {
                panic!("{name} is no library");
            };
            let read = read(&text, &Overrides::default());
            match peer.missing_feature() {
                Some(feature) => {
                    let message = read.unwrap_err();
                    let parts = ["methods[0].method", name, "--features", feature, "muller_fellner"];
                    assert!(parts.iter().all(|part| message.contains(part)), "{message}");
                }
                None => assert!(read.is_ok(), "{read:?}"),
            }
        }
    }

    #[test]
    fn quick_replaces_keys_and_names_its_results_apart() {
        let text = format!("{GOOD}repetitions = 5\n[quick]\nrepetitions = 2\n");
        let quick = read(&text, &Overrides { quick: true, ..Default::default() }).unwrap();
        assert_eq!((quick.repetitions, quick.name.as_str()), (2, "spec-quick"));
        assert_eq!(read(&text, &Overrides::default()).unwrap().repetitions, 5);
    }

    #[test]
    fn a_resolved_spec_spells_out_every_default_and_reads_back_as_itself() {
        let good = GOOD.replace("0.1 }", "0.1, budget = { max_work = 9 } }");
        let experiment = read(&good, &Overrides::default()).unwrap();
        let text = toml::to_string(&experiment).unwrap();
        assert!(text.contains("trials = 100") && text.contains("skip_same_order = true"), "{text}");
        assert_eq!(toml::from_str::<Experiment>(&text).unwrap(), experiment);
    }

    #[test]
    fn of_two_limits_the_lower_one_counts() {
        let good = GOOD.replace("0.1 }", "0.1, budget = { max_work = 9 } }");
        let budget = |of_all: &str| {
            let experiment = read(&format!("{good}budget = {of_all}\n"), &Overrides::default()).unwrap();
            experiment.budget_of(&experiment.methods[0])
        };
        let (max_evaluations, max_work) = (Some(3), Some(5));
        assert_eq!(budget("{ max_work = 5 }"), Budget { max_work, max_evaluations: None });
        assert_eq!(budget("{ max_evaluations = 3 }"), Budget { max_evaluations, max_work: Some(9) });
    }

    #[test]
    fn seeds_differ_between_runs_and_follow_the_spec_alone() {
        let experiment = read(GOOD, &Overrides::default()).unwrap();
        let mut seeds: Vec<u64> =
            (0..100).map(|repetition| experiment.seed_of("escher", "grasp", repetition)).collect();
        seeds.push(experiment.seed_of("bijou", "grasp", 0));
        let distinct: HashSet<_> = seeds.iter().collect();
        assert_eq!(distinct.len(), seeds.len());
        assert_eq!(seeds[0], read(GOOD, &Overrides::default()).unwrap().seed_of("escher", "grasp", 0));
    }
}
