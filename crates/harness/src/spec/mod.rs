//! Experiment specs: TOML in, a checked [`Experiment`] out, or an error with file, key, found and
//! accepted.
//!
//! `read` turns text into values, and `check` rejects faults that types alone cannot. An entry of
//! `methods` is a [`Labelled`].

mod check;
mod read;
pub mod scenes;

use crate::contestant::Labelled;
use crate::measure::picture;
use crate::measure::ray_cost;
use crate::processor::PROCESSOR;
use crate::report::Report;
use bvh_config::{Nested, config};
use bvh_core::cost::Objective;
use bvh_scenes::fnv1a;
use bvh_scenes::rays::RandomRays;
use bvh_search::{Budget, Frames};
pub use read::Overrides;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

config! {
    serde;
    /// A checked experiment: every method on every scene, with repetitions, and its reports.
    ///
    /// The fields are also the keys of a spec, except `name`, and `quick`, which in a spec is a
    /// table of keys that replace others under `--quick`. Serialised, with every default spelled
    /// out, it is `resolved.toml`.
    pub struct Experiment {
        /// Name of the results folder, from the spec's file.
        #[serde(deserialize_with = "read::read_name")]
        name: String;
        /// True for the smaller variant of `--quick`.
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        quick: bool;
        /// The question that the experiment answers, for its readers.
        question: String;
        /// A measurement over the suite of stiff cases instead of runs on scenes.
        suite: Option<bvh_stress::Effort>, in Nested;
        /// Names or paths of the scenes; `A..B` after a colon means all numbers from A to B, and
        /// `A..B/STEP` those at a step. With
        /// `suite`, names of cases, none for all. After a name, `:turn:DEGREES` and
        /// `:rotation:SEED` turn a scene of triangles.
        scenes: Vec<String>;
        /// Scenes that are skipped, with a note, if they have not been fetched.
        optional_scenes: Vec<String>;
        /// The seed from which, with the experiment, the scene, the method and the repetition,
        /// every run's seed is derived.
        seed: u64 = 1, in 0..=i64::MAX as u64;
        /// Runs of every method on every scene.
        repetitions: u32 = 1, in 1..;
        /// Whether runs are performed one at a time, with alternating methods, because their times
        /// are the result.
        sequential: bool;
        /// Whether results are kept separately for each processor, in a folder with its name,
        /// because they are speeds of this processor.
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        per_processor: bool;
        /// Threads of every run; by default the program's threads.
        threads: Option<u16>, in 1..=1024;
        /// The cost in the column `cost`; by default the paper's objective.
        objective: Objective;
        /// Limits of every run; by default none.
        budget: Budget = Budget::UNLIMITED;
        /// The methods, at least one; with `suite`, none for every method of the registry.
        methods: Vec<Labelled>;
        /// Measurements of every run's tree with random rays.
        rays: Vec<RandomRays>, in Nested;
        /// A picture drawn with every run's tree, with brute force and with a KD-tree.
        render: Option<picture::Config>, in Nested;
        /// Rays traced through the tree of every method's first run, in all layouts, interleaved,
        /// by the program in `attic/`.
        tracing: Option<toml::Table>;
        /// Rays that methods with `for_rays` are trained on, and different rays that judge all
        /// trees by the number of their tests.
        ray_cost: Option<ray_cost::Config>, in Nested;
        /// Tables and figures made from the rows.
        reports: Vec<Report>, in Nested;
    }
}

impl Experiment {
    /// The path of the experiment's folder in the results folder.
    pub fn folder(&self) -> PathBuf {
        let name = self.name.as_str();
        // Quick results hold no speeds, so they do not depend on the processor.
        if self.quick {
            Path::new("quick").join(name)
        } else if self.per_processor {
            Path::new(name).join(PROCESSOR.folder())
        } else {
            name.into()
        }
    }

    /// The rays that judge the experiment's trees, if any do.
    pub fn judges(&self) -> Option<&ray_cost::Config> {
        self.ray_cost.as_ref().filter(|config| config.count > 0)
    }

    /// Returns true if a report measures gaps, for which runs keep the times of improvements.
    pub fn needs_references(&self) -> bool {
        self.reports.iter().any(Report::needs_references)
    }

    /// The labels of the methods of which a report reads the costs of all trials.
    pub fn trial_methods(&self) -> BTreeSet<String> {
        self.reports.iter().flat_map(Report::trial_methods).collect()
    }

    /// Returns true if runs keep their improvements: if a report reads them, or if there are no
    /// reports.
    pub fn keeps_history(&self) -> bool {
        self.reports.is_empty() || self.needs_references()
    }

    /// Returns true if the rows of this experiment suffice for the reports of another one.
    pub fn keeps_rows_for(&self, other: &Self) -> bool {
        let has_clock = self.needs_references() || !other.needs_references();
        has_clock && other.trial_methods().is_subset(&self.trial_methods())
    }

    /// Returns true if boxes of some runs lie in frames.
    pub fn has_frames(&self) -> bool {
        let mut names = self.scenes.iter().chain(&self.optional_scenes);
        names.any(|name| name.contains(":turn:") || name.contains(":rotation:"))
            || self.methods.iter().any(|labelled| labelled.options.frame == Some(Frames::Auto))
    }

    /// The limits of a method's runs.
    pub fn budget_of(&self, labelled: &Labelled) -> Budget {
        let entry = labelled.options.budget.unwrap_or(Budget::UNLIMITED);
        // The lower limit wins, so that a common limit bounds every method.
        let max_evaluations = [self.budget.max_evaluations, entry.max_evaluations];
        let max_work = [self.budget.max_work, entry.max_work];
        Budget {
            max_evaluations: max_evaluations.into_iter().flatten().min(),
            max_work: max_work.into_iter().flatten().min(),
        }
    }

    /// The seed of one run, of 32 bits, which every spreadsheet represents exactly.
    pub fn seed_of(&self, scene: &str, label: &str, repetition: u32) -> u64 {
        let hash = self.hash_of(scene, label, repetition);
        // Both halves are folded together, because the low bits of FNV-1a alone mix less well.
        (hash ^ (hash >> 32)) & 0xffff_ffff
    }

    /// The identifier of one run on every machine, also after other runs have joined the spec: 16
    /// hexadecimal digits.
    pub fn run_id(&self, scene: &str, label: &str, repetition: u32) -> String {
        format!("{:016x}", self.hash_of(scene, label, repetition))
    }

    fn hash_of(&self, scene: &str, label: &str, repetition: u32) -> u64 {
        // Quick runs differ from full runs, so they must not share seeds by accident.
        let variant = if self.quick { "-quick" } else { "" };
        let identity =
            format!("{}\0{}{variant}\0{scene}\0{label}\0{repetition}", self.seed, self.name);
        fnv1a(identity.into_bytes())
    }
}

#[cfg(test)]
mod tests;
