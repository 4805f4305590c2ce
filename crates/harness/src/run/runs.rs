//! The runs of all methods on all scenes: in parallel or one by one.

use super::job::Job;
use super::perform::{Watch, perform};
use crate::Error;
use crate::rows::store::Store;
use crate::spec::Experiment;
use bvh_core::Bvh;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

/// The trees of runs by the index of the run.
pub(crate) type Trees = BTreeMap<usize, Bvh>;

/// A running experiment, with everything that its measurements share.
pub(crate) struct Work<'a> {
    pub experiment: &'a Experiment,
    /// The selected runs: all runs, unless several processes share the experiment.
    pub jobs: &'a [Job<'a>],
    /// The costs of the greedy trees by scene.
    pub bases: BTreeMap<String, f64>,
    pub store: &'a Store,
    pub watch: Watch<'a>,
    /// The trees of performed runs that later measurements need.
    pub trees: Trees,
    /// Peculiarities of scene files and damaged runs, one line each.
    pub remarks: Vec<String>,
}

impl Work<'_> {
    /// Rebuilds the wanted trees whose runs were kept from an interrupted experiment.
    pub fn complete_trees(&mut self, is_wanted: impl Fn(&Job) -> bool) -> Result<(), Error> {
        for (index, job) in self.jobs.iter().enumerate() {
            if is_wanted(job) && !self.trees.contains_key(&index) {
                // The same seed gives the same tree, so a kept run needs no tree file.
                let performed = perform(self, job)?;
                let (_, tree) = performed.ok_or_else(|| self.interrupted())?;
                self.trees.insert(index, tree);
            }
        }
        Ok(())
    }

    /// Returns the error of a measurement that is interrupted after all runs are finished.
    pub fn interrupted(&self) -> Error {
        Error::Interrupted { finished: self.jobs.len(), runs: self.jobs.len() }
    }
}

/// Performs the runs that are missing or damaged in the store, and keeps each once it finishes.
pub(crate) fn measure(work: &mut Work) -> Result<(), Error> {
    let missing = missing_runs(work);
    let experiment = work.experiment;
    let runs = work.jobs.len();
    let finished = AtomicUsize::new(runs - missing.len());
    let trees: Mutex<Trees> = Mutex::default();
    let bar = &work.watch.bar;
    bar.set_message(experiment.name.clone());
    bar.set_position((runs - missing.len()) as u64);
    bar.reset_eta();
    let run = |job: &&Job| -> Result<(), Error> {
        let Some((run, tree)) = perform(work, job)? else { return Ok(()) };
        work.store.keep(job.index, &run)?;
        if experiment.judges().is_some() || experiment.tracing.is_some() && job.repetition == 0 {
            trees.lock().unwrap_or_else(PoisonError::into_inner).insert(job.index, tree);
        }
        finished.fetch_add(1, Relaxed);
        bar.inc(1);
        Ok(())
    };
    let result = if experiment.sequential {
        missing.iter().try_for_each(run)
    } else {
        missing.par_iter().try_for_each(run)
    };
    bar.finish_and_clear();
    result?;
    match finished.into_inner() {
        finished if finished < runs => Err(Error::Interrupted { finished, runs }),
        _ => {
            work.trees = trees.into_inner().unwrap_or_else(PoisonError::into_inner);
            Ok(())
        }
    }
}

/// Returns the runs to perform, in their order, and adds a remark on damaged ones.
fn missing_runs<'a>(work: &mut Work<'a>) -> Vec<&'a Job<'a>> {
    let mut missing = Vec::new();
    for job in work.jobs {
        match work.store.kept(job.index) {
            Ok(Some(_)) => continue,
            Ok(None) => {}
            Err(damaged) => work.remarks.push(format!("done again: {damaged}")),
        }
        missing.push(job);
    }
    let experiment = work.experiment;
    if experiment.sequential {
        // Methods alternate, so that a disturbance of the machine does not affect all repetitions
        // of one method.
        let runs_of_scene = experiment.methods.len() * experiment.repetitions as usize;
        missing.sort_by_key(|job| (job.index / runs_of_scene, job.repetition));
    }
    missing
}
