//! Experiment specs: TOML in, a checked [`Experiment`] out, or an error with file, key, found and accepted.
//!
//! `read` is the way from text to values, `check` what types alone do not say, `ranges`
//! that of numbers, `method` one entry of `methods`.

mod check;
mod culprit;
mod method;
mod ranges;
mod read;

use crate::measure::{empirical_cost, speed};
use crate::report::Report;
use crate::scenes::fnv1a;
use crate::{render, stress};
use bvh_core::cost::Objective;
use bvh_search::{Budget, exact};
pub use method::{Contestant, Labelled};
pub use read::Overrides;
use serde::{Deserialize, Serialize};

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
    pub suite: Option<stress::Measure>,
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
    pub rays: Vec<empirical_cost::Config>,
    /// A picture drawn with every run's tree, and with brute force and a KD-tree. Default none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub render: Option<render::experiment::Config>,
    /// Rays traced through the tree of every method's first run, in all layouts, in turns. Default none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tracing: Option<speed::Config>,
    /// Tables and figures made from the rows. Default none.
    #[serde(default)]
    pub reports: Vec<Report>,
}

fn one<T: From<u8>>() -> T {
    1.into()
}

impl Experiment {
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

#[cfg(test)]
mod tests;
