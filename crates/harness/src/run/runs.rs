//! The runs of all methods on all scenes: in parallel or one by one.

use super::job::Job;
use super::perform::{Trees, Work, perform};
use crate::Error;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

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
        match work.store.kept(job.index, &job.name()) {
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
