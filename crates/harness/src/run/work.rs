//! A running experiment.

use super::job::Job;
use super::perform::{Watch, perform};
use crate::Error;
use crate::rows::store::Store;
use crate::spec::Experiment;
use bvh_core::Bvh;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// The trees of runs by the index of the run.
pub(crate) type Trees = BTreeMap<usize, Bvh>;

/// A running experiment, with everything that its measurements share.
pub(crate) struct Work<'a> {
    pub experiment: &'a Experiment,
    /// The selected runs: all runs, unless several processes share the experiment.
    pub jobs: &'a [Job<'a>],
    pub store: &'a Store,
    pub watch: Watch<'a>,
    /// True for a line on standard error about every run.
    pub verbose: bool,
    /// The trees of performed runs that later measurements need.
    pub trees: Trees,
    /// Peculiarities of scene files and damaged runs, one line each.
    pub remarks: Vec<String>,
}

impl Work<'_> {
    /// Rebuilds the wanted trees whose runs were kept from an interrupted experiment.
    pub fn complete_trees(&mut self, is_wanted: impl Fn(&Job) -> bool) -> Result<(), Error> {
        for (index, job) in self.jobs.iter().enumerate() {
            if !is_wanted(job) {
                continue;
            }
            if let Entry::Vacant(missing) = self.trees.entry(index) {
                // The same seed gives the same tree, so a kept run needs no tree file.
                let performed = perform(self.experiment, job, &self.watch)?;
                let (_, tree) = performed.ok_or(all_finished(self.jobs))?;
                missing.insert(tree);
            }
        }
        Ok(())
    }

    /// Returns the error of a measurement that is interrupted after all runs are finished.
    pub fn interrupted(&self) -> Error {
        all_finished(self.jobs)
    }
}

fn all_finished(jobs: &[Job]) -> Error {
    Error::Interrupted { finished: jobs.len(), runs: jobs.len() }
}
