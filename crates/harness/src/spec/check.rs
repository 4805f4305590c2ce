//! What types alone do not say of a spec, part by part. Messages name the key, what was found, what would be accepted.

use super::{Contestant, Experiment, Labelled, ranges};
use crate::report::Report;
use crate::{scenes::subset, stress};
use bvh_search::{Budget, Method, Problem, solve};
use std::collections::HashSet;

/// Most runs of an experiment.
const MOST_RUNS: u64 = 10_000_000;

impl Experiment {
    /// Everything that types alone do not say.
    pub(super) fn check(&self) -> Result<(), String> {
        self.check_scenes()?;
        self.check_runs()?;
        ranges::check(self)?;
        self.check_labels()?;
        self.methods.iter().enumerate().try_for_each(|(index, method)| self.check_method(index, method))?;
        self.reports.iter().enumerate().try_for_each(|(index, report)| self.check_report(index, report))
    }

    /// Their names; whether they are there is found when they are loaded.
    fn check_scenes(&self) -> Result<(), String> {
        if self.suite.is_some() {
            if let Some(unknown) = self.scenes.iter().find(|id| stress::by_id(id).is_none()) {
                return Err(format!("scene {unknown} is no case of the suite; accepted: S01 to S45"));
            }
        } else if self.scenes.is_empty() {
            return Err("scenes is empty; accepted: at least one name or path".into());
        }
        match self.scenes.iter().find(|name| subset::names(name) == 0) {
            Some(none) => Err(format!("scenes: {none:?} ends before it begins; accepted: A..B with A up to B")),
            None => Ok(()),
        }
    }

    /// That there are some, and not too many.
    pub(crate) fn check_runs(&self) -> Result<(), String> {
        let scenes = self.scenes.iter().map(|name| subset::names(name)).fold(0, u64::saturating_add);
        let runs =
            [self.methods.len() as u64, self.repetitions.into()].into_iter().fold(scenes, u64::saturating_mul);
        if runs > MOST_RUNS {
            return Err(format!(
                "scenes, methods and repetitions make {runs} runs; accepted: up to {MOST_RUNS}"
            ));
        }
        if self.methods.is_empty() {
            return Err("methods is empty; accepted: at least one table with a `method`".into());
        }
        Ok(())
    }

    /// No two methods have the same.
    fn check_labels(&self) -> Result<(), String> {
        let mut labels = HashSet::new();
        match self.methods.iter().enumerate().find(|(_, method)| !labels.insert(&method.label)) {
            Some((index, Labelled { label, .. })) => {
                Err(format!("methods[{index}].label is {label:?} for the second time; accepted: unique labels"))
            }
            None => Ok(()),
        }
    }

    /// Its parameters; of another library, whether it is compiled in.
    fn check_method(&self, index: usize, labelled: &Labelled) -> Result<(), String> {
        let label = &labelled.label;
        match &labelled.method {
            Contestant::Peer(_) if self.suite.is_some() => {
                Err(format!("{label} is another library; accepted in the suite: its key `peers`"))
            }
            Contestant::Peer(peer) => match peer.missing_feature() {
                Some(feature) => {
                    let (name, ours) = (peer.name(), Method::NAMES.join(", "));
                    Err(format!(
                        "methods[{index}].method is {name:?}, another library, which needs `cargo run --release -p \
                         harness --features {feature}`; accepted without: {ours}"
                    ))
                }
                None => peer.check().map_err(|error| format!("methods[{index}] ({label}): {error}")),
            },
            Contestant::Ours(method) => {
                // A search checks its own parameters before it looks at the scene: let it, on the scene of nothing.
                let budget = Budget { max_evaluations: Some(1), max_work: None };
                let nothing = Problem { objective: self.objective, ..Problem::new(&[]) };
                let tried = solve(method, &nothing, 0, budget, &());
                tried.map(drop).map_err(|error| format!("methods[{index}] ({label}): {error}"))
            }
        }
    }

    /// That it speaks of methods that there are.
    fn check_report(&self, index: usize, report: &Report) -> Result<(), String> {
        let known: Vec<&str> = self.methods.iter().map(|method| method.label.as_str()).collect();
        match report.labels().into_iter().find(|label| !known.contains(&label.as_str())) {
            Some(label) => {
                let (known, key) = (known.join(", "), key_of(report, label).unwrap_or_default());
                Err(format!("reports[{index}] names method {label:?}{key}; accepted: {known}"))
            }
            None => Ok(()),
        }
    }
}

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
