//! The runs of all methods on all scenes: in parallel or one by one, with progress reports.

use super::job::Job;
use super::perform::{Watch, perform};
use crate::Error;
use crate::rows::store::Store;
use crate::spec::Experiment;
use bvh_core::Bvh;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::Write;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

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
    let missing = missing_runs(work)?;
    let progress = Progress::new(work, work.jobs.len() - missing.len());
    let result = if work.experiment.sequential {
        missing.iter().try_for_each(|job| progress.perform(work, job))
    } else {
        missing.par_iter().try_for_each(|job| progress.perform(work, job))
    };
    work.watch.bar.finish_and_clear();
    result?;
    let runs = work.jobs.len();
    match progress.finished.into_inner() {
        finished if finished < runs => Err(Error::Interrupted { finished, runs }),
        _ => {
            work.trees = progress.trees.into_inner().unwrap_or_else(PoisonError::into_inner);
            Ok(())
        }
    }
}

/// Returns the runs to perform, in their order, and adds a remark on damaged ones.
fn missing_runs<'a>(work: &mut Work<'a>) -> Result<Vec<&'a Job<'a>>, Error> {
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
    Ok(missing)
}

/// The finished runs and the reports about them.
struct Progress {
    trees: Mutex<Trees>,
    finished: AtomicUsize,
    total: usize,
    start: Instant,
}

impl Progress {
    fn new(work: &Work, finished: usize) -> Self {
        work.watch.bar.set_message(work.experiment.name.to_string());
        work.watch.bar.set_position(finished as u64);
        work.watch.bar.reset_eta();
        Self {
            trees: Mutex::default(),
            finished: finished.into(),
            total: work.jobs.len(),
            start: Instant::now(),
        }
    }

    /// Performs a run and keeps it unless it is interrupted.
    fn perform(&self, work: &Work, job: &Job) -> Result<(), Error> {
        let start = Instant::now();
        let experiment = work.experiment;
        let Some((run, tree)) = perform(work, job)? else { return Ok(()) };
        work.store.keep(job.index, &run)?;
        if experiment.judges().is_some() || experiment.tracing.is_some() && job.repetition == 0 {
            self.trees.lock().unwrap_or_else(PoisonError::into_inner).insert(job.index, tree);
        }
        let finished = self.finished.fetch_add(1, Relaxed) + 1;
        work.watch.bar.inc(1);
        if work.verbose {
            self.report(work, job, finished, start.elapsed());
        }
        Ok(())
    }

    /// Prints a line about a finished run.
    fn report(&self, work: &Work, job: &Job, finished: usize, duration: Duration) {
        let Experiment { name, .. } = work.experiment;
        let total = self.total;
        let since_start = self.start.elapsed().as_secs();
        // Names of files may hold characters that a terminal would obey.
        let label = job.labelled.label.escape_debug();
        let scene = job.scene.name.escape_debug();
        let repetition = job.repetition;
        let seed = job.seed(work.experiment);
        let seconds = duration.as_secs_f64();
        let line = format!(
            "{name}: {finished} of {total} runs, {since_start} s: {label} on {scene}, repetition \
             {repetition}, seed {seed}, took {seconds:.3} s"
        );
        // A closed standard error must not end the experiment.
        let _ = work.watch.bar.suspend(|| writeln!(std::io::stderr(), "{line}"));
    }
}
