//! Experiment specs: TOML in, a checked [`Experiment`] out, or an error with file, key, found and accepted.
//!
//! `read` leads from text to values, and `check` rejects what types alone do not. An entry of `methods` is a
//! [`Labelled`].

mod check;
mod name;
mod read;
mod schema;

use crate::contestant::{Contestant, Labelled};
use crate::measure::picture;
use crate::measure::{empirical_cost, ray_cost, speed};
use crate::processor::PROCESSOR;
use crate::report::Report;
use crate::stress;
use bvh_config::{Nested, config};
use bvh_core::cost::Objective;
use bvh_scenes::fnv1a;
use bvh_search::{Budget, exact};
pub use name::Name;
pub use read::Overrides;
pub use schema::{page, schema};
use std::path::{Path, PathBuf};

config! {
    serde;
    /// A checked experiment: every method on every scene, a number of times, and how to report it.
    ///
    /// These are also the keys of a spec, but for `name`, and for `quick`, a table of keys that replace others under
    /// `--quick`. Serialised, with every default spelled out, it is `resolved.toml`.
    pub struct Experiment {
        /// Name of the results folder, from the spec's file.
        name: Name;
        /// Whether this is the smaller variant of `--quick`.
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        quick: bool;
        /// The question that the experiment answers, for its readers.
        question: String;
        /// A measurement over the suite of stiff cases, in place of runs on scenes.
        suite: Option<stress::Measure>, in Nested;
        /// Names or paths of the scenes; `A..B` after a colon stands for all numbers from A to B. With `suite`, names
        /// of cases, none for all.
        scenes: Vec<String>;
        /// Scenes that are left out, with a note, where they have not been fetched.
        optional_scenes: Vec<String>;
        /// Whether glTF files may name buffers outside their own folders. Whoever made such a file then says which files are read.
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        outside_files: bool;
        /// Every run's seed is derived from this one, the experiment, the scene, the method and the repetition.
        seed: u64 = 1, in 0..=i64::MAX as u64;
        /// Runs of every method on every scene.
        repetitions: u32 = 1, in 1..;
        /// Whether runs are done one at a time, methods in turns, because their times are the result.
        sequential: bool;
        /// Whether results are kept apart by processor, in a folder of its name: they are speeds that another one has not.
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        per_processor: bool;
        /// Threads of every run; by default those of the program.
        threads: Option<u16>, in 1..=1024;
        /// What `cost` means; by default the paper's objective.
        objective: Objective;
        /// Limits of every run; by default none.
        budget: Budget = Budget::UNLIMITED;
        /// Seconds that every run of a method of ours may take, besides its `budget`. Such rows differ from run to run: they are in
        /// `timing_runs.csv` in place of `runs.csv`, with the trees' costs after the best collapse of leaves. Default none.
        max_seconds: Option<f64>, in 0.001..=1e6;
        /// The program of `scripts/ray-peers`, by which tinybvh's trees with spatial splits are costed beside such rows, if it is there.
        tinybvh: Option<PathBuf>;
        /// Effort of a lower bound of every scene's internal area; by default no bound is sought.
        lower_bound: Option<u32>;
        /// What is run, at least one; with `suite`, none for every method of the registry.
        methods: Vec<Labelled>;
        /// Measurements of every run's tree with random rays.
        rays: Vec<empirical_cost::Config>, in Nested;
        /// A picture drawn with every run's tree, and with brute force and a KD-tree.
        render: Option<picture::Config>, in Nested;
        /// Rays traced through the tree of every method's first run, in all layouts, in turns.
        tracing: Option<speed::Config>, in Nested;
        /// Rays that methods with `for_rays` are trained on, and others that judge all trees by the tests that they take.
        ray_cost: Option<ray_cost::Config>, in Nested;
        /// Tables and figures made from the rows.
        reports: Vec<Report>, in Nested;
    }
}

impl Experiment {
    /// The folder of its results within that of all results. Quick results have no speeds, and no processor.
    pub fn folder(&self) -> PathBuf {
        let name = self.name.as_str();
        if self.quick {
            Path::new("quick").join(name)
        } else if self.per_processor {
            Path::new(name).join(PROCESSOR.folder())
        } else {
            name.into()
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

    /// The rays that judge its trees, if any do.
    pub fn judges(&self) -> Option<&ray_cost::Config> {
        self.ray_cost
            .as_ref()
            .filter(|config| config.count > 0)
    }

    /// Whether gaps are measured on scenes of so many objects from their exact optimum.
    pub fn needs_optimum(&self, objects: usize) -> bool {
        objects <= exact::MOST_OBJECTS && self.reports.iter().any(Report::needs_references)
    }

    /// Whether a run of the method with this label keeps the cost of every trial: if a report reads them.
    pub fn keeps_trials_of(&self, label: &str) -> bool {
        self.reports
            .iter()
            .any(|report| report.trial_methods().contains(&label))
    }

    /// Whether runs keep their improvements: if a report reads them, or if there is none that says what is read.
    pub fn keeps_history(&self) -> bool {
        self.reports.is_empty() || self.keeps_clock()
    }

    /// Whether runs keep the times of their improvements: if a report reads them.
    pub fn keeps_clock(&self) -> bool {
        self.reports.iter().any(Report::needs_clock)
    }

    /// Whether the rows of this experiment suffice for other reports.
    pub fn keeps_rows_for(&self, reports: &[Report]) -> bool {
        let lacks_trials = |report: &Report| {
            report
                .trial_methods()
                .iter()
                .any(|label| !self.keeps_trials_of(label))
        };
        let lacks_clock = |report: &Report| report.needs_clock() && !self.keeps_clock();
        !reports
            .iter()
            .any(|report| lacks_trials(report) || lacks_clock(report))
    }

    /// The limits of a method's runs.
    pub fn budget_of(&self, labelled: &Labelled) -> Budget {
        let own = labelled.own.budget.unwrap_or(Budget::UNLIMITED);
        let lower = |a: Option<u64>, b: Option<u64>| a.into_iter().chain(b).min();
        Budget {
            max_evaluations: lower(self.budget.max_evaluations, own.max_evaluations),
            max_work: lower(self.budget.max_work, own.max_work),
        }
    }

    /// The seconds that a method's runs may take.
    pub fn max_seconds_of(&self, labelled: &Labelled) -> Option<f64> {
        let is_ours = matches!(labelled.method, Contestant::Ours(_));
        let limits = self
            .max_seconds
            .into_iter()
            .filter(|_| is_ours)
            .chain(labelled.own.max_seconds);
        limits.reduce(f64::min)
    }

    /// Whether the clock ends some of the runs, so that nothing but `timing*.csv` may have rows of them.
    pub fn is_by_the_clock(&self) -> bool {
        self.methods
            .iter()
            .any(|labelled| self.max_seconds_of(labelled).is_some())
    }

    /// The seed of one run, within 32 bits so that every spreadsheet keeps it exactly.
    pub fn seed_of(&self, scene: &str, label: &str, repetition: u32) -> u64 {
        let variant = if self.quick { "-quick" } else { "" };
        let identity =
            format!("{}\0{}{variant}\0{scene}\0{label}\0{repetition}", self.seed, self.name);
        let hash = fnv1a(identity.into_bytes());
        (hash ^ (hash >> 32)) & 0xffff_ffff
    }
}

#[cfg(test)]
mod tests;
