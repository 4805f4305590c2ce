//! The runs of an experiment as a measurement: in parallel or one by one, with progress, until done or interrupted.

use super::job::Job;
use super::measurement::{Measurement, Said, Trees, Work};
use super::perform::perform;
use crate::Error;
use crate::spec::Experiment;
use indicatif::ProgressBar;
use rayon::prelude::*;
use std::io::Write;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The runs of all methods on all scenes.
pub(crate) struct Runs;

impl Measurement for Runs {
    /// Performs the runs that the store does not have yet or has damaged, and keeps each as soon as it is finished.
    fn measure(&self, work: &mut Work) -> Result<String, Error> {
        let todo = todo(work)?;
        let progress = Progress::new(work, work.own.len() - todo.len());
        let perform = |index: &usize| progress.perform(work, *index);
        let result = if work.experiment.sequential {
            todo.iter().try_for_each(perform)
        } else {
            todo.par_iter().try_for_each(perform)
        };
        work.watch.bar.finish_and_clear();
        result?;
        let runs = work.own.len();
        match progress.finished.into_inner() {
            finished if finished < runs => Err(Error::Interrupted { finished, runs }),
            _ => {
                work.trees = progress
                    .trees
                    .into_inner()
                    .unwrap_or_else(PoisonError::into_inner);
                Ok(String::new())
            }
        }
    }
}

/// The numbers of the runs that are to be performed, in their order. Damaged ones are remarked.
fn todo(work: &mut Work) -> Result<Vec<usize>, Error> {
    let mut todo = Vec::new();
    for &index in &work.own {
        match work.store.has(index) {
            Ok(true) => continue,
            Ok(false) => {}
            Err(damaged) => work
                .remarks
                .push(format!("done again: {damaged}")),
        }
        todo.push(index);
    }
    let experiment = work.experiment;
    if experiment.sequential {
        // Methods take turns, so that a disturbance of the machine does not hit all repetitions of one method.
        let runs_of_scene = experiment.methods.len() * experiment.repetitions as usize;
        todo.sort_by_key(|&index| (index / runs_of_scene, work.jobs[index].repetition));
    }
    Ok(todo)
}

/// The runs that are finished, and the lines about them.
struct Progress {
    trees: Mutex<Trees>,
    finished: AtomicUsize,
    all: usize,
    start: Instant,
    last: Mutex<Instant>,
}

impl Progress {
    fn new(work: &Work, finished: usize) -> Self {
        work.watch
            .bar
            .set_message(work.experiment.name.to_string());
        work.watch.bar.set_position(finished as u64);
        work.watch.bar.reset_eta();
        Self {
            trees: Mutex::default(),
            finished: finished.into(),
            all: work.own.len(),
            start: Instant::now(),
            last: Mutex::new(Instant::now()),
        }
    }

    /// Performs a run and keeps it; does nothing if it is interrupted.
    fn perform(&self, work: &Work, index: usize) -> Result<(), Error> {
        let start = Instant::now();
        let job = &work.jobs[index];
        let experiment = work.experiment;
        let Some((run, tree)) = perform(experiment, job, &work.watch)? else { return Ok(()) };
        work.store.keep(index, &run)?;
        if experiment.judges().is_some() || experiment.tracing.is_some() && job.repetition == 0 {
            self.trees
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .insert(index, tree);
        }
        let finished = self.finished.fetch_add(1, Relaxed) + 1;
        work.watch.bar.inc(1);
        self.say(work, job, finished, start.elapsed());
        Ok(())
    }

    /// Prints the line about a finished run, if one is due.
    fn say(&self, work: &Work, job: &Job, finished: usize, took: Duration) {
        let mut last = self
            .last
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let Work { experiment, said, .. } = *work;
        let bar: &ProgressBar = &work.watch.bar;
        let due = match said {
            Said::Bar => false,
            Said::Progress => {
                bar.is_hidden()
                    && (finished == self.all || last.elapsed() >= Duration::from_secs(1))
            }
            Said::EveryRun => true,
        };
        if !due {
            return;
        }
        *last = Instant::now();
        let line = self.line(experiment, job, finished);
        let more = match said {
            Said::EveryRun => details(experiment, job, took),
            _ => String::new(),
        };
        // Whoever reads this may have left.
        let _ = bar.suspend(|| writeln!(std::io::stderr(), "{line}{more}"));
    }

    fn line(&self, experiment: &Experiment, job: &Job, finished: usize) -> String {
        let name = &experiment.name;
        let all = self.all;
        let seconds = self.start.elapsed().as_secs();
        let label = job.labelled.label.escape_debug();
        let scene = job.scene.name.escape_debug();
        format!("{name}: {finished} of {all} runs, {seconds} s: {label} on {scene}")
    }
}

fn details(experiment: &Experiment, job: &Job, took: Duration) -> String {
    let repetition = job.repetition;
    let seed = job.seed(experiment);
    format!(", repetition {repetition}, seed {seed}, took {:.3} s", took.as_secs_f64())
}
