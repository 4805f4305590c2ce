//! The measurement of the runs of all methods on all scenes: in parallel or one by one.

use super::finish::Summary;
use super::jobs::{Job, Jobs};
use super::perform::perform;
use crate::Error;
use crate::rows::store::Store;
use bvh_core::Bvh;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Performs the runs that are missing or damaged in the store, and keeps each once it finishes, with
/// its tree if a later measurement needs those of its repetition.
pub(crate) fn measure(
    jobs: &Jobs,
    needs_tree: &(dyn Fn(u32) -> bool + Sync),
    store: &Store,
    summary: &mut Summary,
) -> Result<(), Error> {
    let missing = missing_runs(jobs, store, &mut summary.remarks);
    let runs = jobs.list.len();
    let finished = AtomicUsize::new(runs - missing.len());
    let bar = &jobs.watch.bar;
    bar.set_message(jobs.experiment.name.clone());
    bar.set_position((runs - missing.len()) as u64);
    bar.reset_eta();
    let run = |job: &&Job| -> Result<(), Error> {
        let Some(run) = perform(jobs, job)? else { return Ok(()) };
        store.keep(job.index, &run.rows()?)?;
        if needs_tree(job.repetition) {
            jobs.trees().insert(job.index, Arc::new(run.outcome.tree));
        }
        finished.fetch_add(1, Relaxed);
        bar.inc(1);
        Ok(())
    };
    let result = if jobs.experiment.sequential {
        missing.iter().try_for_each(run)
    } else {
        missing.par_iter().try_for_each(run)
    };
    bar.finish_and_clear();
    result?;
    match finished.into_inner() {
        finished if finished < runs => Err(Error::Interrupted { finished, runs }),
        _ => Ok(()),
    }
}

/// Returns the runs to perform, in their order, and adds a remark on damaged ones.
fn missing_runs<'j>(jobs: &'j Jobs, store: &Store, remarks: &mut Vec<String>) -> Vec<&'j Job<'j>> {
    let mut missing = Vec::new();
    for job in &jobs.list {
        match store.kept(job.index, &job.name()) {
            Ok(Some(_)) => continue,
            Ok(None) => {}
            Err(damaged) => remarks.push(format!("done again: {damaged}")),
        }
        missing.push(job);
    }
    let experiment = jobs.experiment;
    if experiment.sequential {
        // Methods alternate, so that a disturbance of the machine does not affect all repetitions
        // of one method.
        let runs_of_scene = experiment.methods.len() * experiment.repetitions as usize;
        missing.sort_by_key(|job| (job.index / runs_of_scene, job.repetition));
    }
    missing
}

/// Returns the wanted runs, each with its tree. A run that was kept from an interrupted experiment
/// is performed again: the same seed gives the same tree, so it needs no tree file.
pub(super) fn with_trees<'j, 'a>(
    jobs: &'j Jobs<'a>,
    is_wanted: impl Fn(&Job) -> bool,
) -> Result<Vec<(&'j Job<'a>, Arc<Bvh>)>, Error> {
    let mut runs = Vec::new();
    for job in jobs.list.iter().filter(|job| is_wanted(job)) {
        let known = jobs.trees().get(&job.index).cloned();
        let tree = match known {
            Some(tree) => tree,
            None => {
                let run = perform(jobs, job)?.ok_or_else(|| jobs.interrupted())?;
                jobs.trees().entry(job.index).or_insert(Arc::new(run.outcome.tree)).clone()
            }
        };
        runs.push((job, tree));
    }
    Ok(runs)
}
