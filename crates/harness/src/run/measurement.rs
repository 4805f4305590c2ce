//! The shape of a measurement: it fills the folder of an experiment's results with rows.

use super::job::Job;
use super::perform::{Watch, perform};
use crate::Error;
use crate::rows::store::Store;
use crate::spec::Experiment;
use bvh_core::Bvh;
use bvh_scenes::Scene;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// The trees of runs, by the number of their run.
pub(crate) type Trees = BTreeMap<usize, Bvh>;

/// A part of an experiment that makes rows of its own.
pub(crate) trait Measurement {
    /// The reason why it cannot be done in parts, if it cannot.
    fn whole_only(&self) -> Option<&'static str> {
        None
    }

    /// Writes the rows. Returns remarks for the terminal, which follow the tables.
    fn measure(&self, work: &mut Work) -> Result<String, Error>;
}

/// An experiment under way, with everything that its measurements share.
pub(crate) struct Work<'a> {
    pub experiment: &'a Experiment,
    pub scenes: &'a [Scene],
    /// All runs of the experiment.
    pub jobs: &'a [Job<'a>],
    /// The numbers of the runs that are to be performed here: all, or a part of them.
    pub own: Vec<usize>,
    pub store: &'a Store,
    pub watch: Watch<'a>,
    pub said: Said,
    /// The trees of performed runs that later measurements need.
    pub trees: Trees,
    /// One line each on what the user should know of scene files and damaged runs.
    pub remarks: Vec<String>,
}

impl Work<'_> {
    /// Rebuilds those of the wanted trees that are missing, because their runs were kept from an interrupted experiment.
    pub fn complete_trees(&mut self, wanted: impl Fn(&Job) -> bool) -> Result<(), Error> {
        for (index, job) in self
            .jobs
            .iter()
            .enumerate()
            .filter(|(_, job)| wanted(job))
        {
            if let Entry::Vacant(missing) = self.trees.entry(index) {
                let performed = perform(self.experiment, job, &self.watch)?;
                let (_, tree) = performed.ok_or(all_finished(self.jobs))?;
                missing.insert(tree);
            }
        }
        Ok(())
    }

    /// The failure of a measurement that is interrupted after all runs are finished.
    pub fn interrupted(&self) -> Error {
        all_finished(self.jobs)
    }
}

fn all_finished(jobs: &[Job]) -> Error {
    Error::Interrupted { finished: jobs.len(), runs: jobs.len() }
}

/// The reports of progress on standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Said {
    /// Nothing but a bar where there is a terminal.
    Bar,
    /// A bar where there is a terminal, elsewhere a line a second at most, and the last.
    #[default]
    Progress,
    /// A line for every run.
    EveryRun,
}
