//! Carries out the runs of an experiment: in parallel or one by one, with progress, until done or interrupted.

use crate::Error;
use crate::run::clocked;
use crate::run::finish::{Summary, conclude};
use crate::run::job::{Job, Watch, base_cost, perform};
use crate::run::provenance::Provenance;
use crate::run::ray_cost;
use crate::run::reference::BestKnown;
use crate::run::resolved::{Resolved, load_scenes, to_toml};
use crate::run::shard::Shard;
use crate::run::store::{Existing, Store};
use crate::run::target::Target;
use crate::run::trace::{Trees, trace};
use crate::scenes::Scene;
use crate::spec::Experiment;
use crate::stress::Measure;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How much of an experiment is to be done.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extent {
    /// What happens to the results that are there already.
    pub existing: Existing,
    /// Do these runs only, and leave them to be [merged](crate::run::merge::merge).
    pub shard: Option<Shard>,
    /// What is said of the runs on standard error.
    pub said: Said,
}

/// What is said of runs on standard error while they are carried out.
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

/// Runs `experiment` into `out/NAME/`. As soon as `interrupted` becomes true, the unfinished runs are given up and the
/// finished ones are kept.
pub fn execute(
    experiment: &Experiment,
    out: &Path,
    extent: Extent,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    let whole_only = [
        (experiment.suite.is_some(), "the suite of cases is not done in parts"),
        (experiment.tracing.is_some(), "rays are timed against each other, not in parts"),
        (experiment.judges().is_some(), "trees are judged by rays beside each other, not in parts"),
    ];
    if let Some((_, why)) = whole_only.iter().find(|(whole, _)| *whole && extent.shard.is_some()) {
        return Err(Error::Usage(format!("{}: {why}", experiment.name)));
    }
    if let Some(measure) = &experiment.suite {
        return over_suite(experiment, measure, out, extent.existing, interrupted);
    }
    let Some(threads) = experiment.threads else { return run(experiment, out, extent, interrupted) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build();
    let pool = pool.map_err(|error| Error::Usage(format!("threads = {threads}: {error}")))?;
    pool.install(|| run(experiment, out, extent, interrupted))
}

fn run(
    experiment: &Experiment,
    out: &Path,
    extent: Extent,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    let (scenes, left_out) = load_scenes(experiment)?;
    let mut remarks: Vec<String> = scenes.iter().filter_map(|scene| scene.remark.clone()).collect();
    remarks.dedup();
    let resolved = Resolved::new(experiment, &scenes);
    let Target { folder, beside } = Target::choose(out, &resolved, extent.existing, extent.shard.is_some())?;
    let store = Store::open(&folder, &to_toml(&resolved)?, extent.existing)?;
    let jobs = jobs(experiment, &scenes)?;
    let own: Vec<usize> =
        (0..jobs.len()).filter(|&index| extent.shard.is_none_or(|shard| shard.has(index))).collect();
    let watch = Watch { bar: progress(own.len() as u64), interrupted };
    watch.bar.set_message(experiment.name.to_string());
    let (mut trees, redone) = perform_all(experiment, &jobs, &own, &store, &watch, extent.said)?;
    remarks.extend(redone);
    let provenance = Provenance::gather();
    if let Some(shard) = extent.shard {
        store.keep_shard(&to_toml(&provenance)?)?;
        let text = format!("{} runs, part {shard}; `harness merge` joins the parts.\n", own.len());
        return Ok(Summary { text, left_out, remarks, folder, beside });
    }
    let mut traced = String::new();
    if let Some(config) = &experiment.tracing {
        traced = trace(experiment, config, &jobs, &mut trees, &watch, &store)?;
    }
    if let Some(config) = experiment.judges() {
        ray_cost::judge(experiment, config, &jobs, &mut trees, &watch, &store)?;
    }
    if let Some(program) = &experiment.tinybvh {
        traced = clocked::cost_peers(program, &scenes, &store)?;
    }
    let best_known = if beside.is_some() { BestKnown::Read(out) } else { BestKnown::Improve(out) };
    let text = conclude(&resolved, best_known, &provenance, store)? + &traced;
    Ok(Summary { text, left_out, remarks, folder, beside })
}

/// All runs, scene by scene, in the order of the spec.
fn jobs<'a>(experiment: &'a Experiment, scenes: &'a [Scene]) -> Result<Vec<Job<'a>>, Error> {
    let bases = scenes.par_iter().map(|scene| base_cost(scene, &experiment.objective));
    let bases = bases.collect::<Result<Vec<_>, _>>()?;
    let of_scene = |(scene, base): (&'a Scene, f64)| {
        experiment.runs().map(move |(labelled, repetition, first_of_scene)| Job {
            scene,
            base,
            labelled,
            repetition,
            first_of_scene,
        })
    };
    Ok(scenes.iter().zip(bases).flat_map(of_scene).collect())
}

/// Performs the runs in `own` that the store does not have yet or has damaged, and keeps each as soon as it is finished.
/// Returns the trees to be traced of the runs that were performed now, and what was damaged.
fn perform_all(
    experiment: &Experiment,
    jobs: &[Job],
    own: &[usize],
    store: &Store,
    watch: &Watch,
    said: Said,
) -> Result<(Trees, Vec<String>), Error> {
    let (mut todo, mut redone) = (Vec::new(), Vec::new());
    for &index in own {
        match store.has(index) {
            Ok(true) => continue,
            Ok(false) => {}
            Err(damaged) => redone.push(format!("done again: {damaged}")),
        }
        todo.push(index);
    }
    if experiment.sequential {
        // Methods take turns, so that a disturbance of the machine does not hit all repetitions of one method.
        let scene = |index: usize| index / (experiment.methods.len() * experiment.repetitions as usize);
        todo.sort_by_key(|&index| (scene(index), jobs[index].repetition));
    }
    let trees = Mutex::new(Trees::new());
    let finished = AtomicUsize::new(own.len() - todo.len());
    let lines = Lines { said, all: own.len(), start: Instant::now(), last: Mutex::new(Instant::now()) };
    watch.bar.set_position(finished.load(Relaxed) as u64);
    watch.bar.reset_eta();
    let work = |&index: &usize| -> Result<(), Error> {
        let start = Instant::now();
        if let Some((run, tree)) = perform(experiment, &jobs[index], watch)? {
            store.keep(index, &run)?;
            if experiment.judges().is_some() || experiment.tracing.is_some() && jobs[index].repetition == 0 {
                trees.lock().unwrap_or_else(PoisonError::into_inner).insert(index, tree);
            }
            let finished = finished.fetch_add(1, Relaxed) + 1;
            watch.bar.inc(1);
            lines.say(experiment, &jobs[index], finished, start.elapsed(), &watch.bar);
        }
        Ok(())
    };
    let result =
        if experiment.sequential { todo.iter().try_for_each(work) } else { todo.par_iter().try_for_each(work) };
    watch.bar.finish_and_clear();
    result?;
    match finished.into_inner() {
        all if all == own.len() => Ok((trees.into_inner().unwrap_or_else(PoisonError::into_inner), redone)),
        finished => Err(Error::Interrupted { finished, runs: own.len() }),
    }
}

/// What is said of finished runs, line by line.
struct Lines {
    said: Said,
    all: usize,
    start: Instant,
    last: Mutex<Instant>,
}

impl Lines {
    fn say(&self, experiment: &Experiment, job: &Job, finished: usize, took: Duration, bar: &ProgressBar) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let due = match self.said {
            Said::Bar => false,
            Said::Progress => {
                bar.is_hidden() && (finished == self.all || last.elapsed() >= Duration::from_secs(1))
            }
            Said::EveryRun => true,
        };
        if !due {
            return;
        }
        *last = Instant::now();
        let (scene, label) = (job.scene.name.escape_debug(), job.labelled.label.escape_debug());
        let (name, all, seconds) = (&experiment.name, self.all, self.start.elapsed().as_secs());
        let mut line = format!("{name}: {finished} of {all} runs, {seconds} s: {label} on {scene}");
        if self.said == Said::EveryRun {
            let (repetition, seed) = (job.repetition, job.seed(experiment));
            line += &format!(", repetition {repetition}, seed {seed}, took {:.3} s", took.as_secs_f64());
        }
        // Whoever reads this may have left.
        let _ = bar.suspend(|| writeln!(std::io::stderr(), "{line}"));
    }
}

/// Measures over the suite of stiff cases; always from the start.
fn over_suite(
    experiment: &Experiment,
    measure: &Measure,
    out: &Path,
    existing: Existing,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    let resolved = Resolved::new(experiment, &[]);
    let Target { folder, beside } = Target::choose(out, &resolved, existing, false)?;
    let resolved = to_toml(&resolved)?;
    let store = Store::open(&folder, &resolved, Existing::Replace)?;
    let text = match measure {
        Measure::Stability(config) => {
            let interrupted = || interrupted.load(Relaxed);
            config.execute(&experiment.scenes, &experiment.methods, &store, &interrupted)?
        }
        Measure::Precision(config) => config.execute(&store)?,
    };
    store.write("resolved.toml", resolved.as_bytes())?;
    store.write("provenance.toml", to_toml(&Provenance::gather())?.as_bytes())?;
    store.finish()?;
    Ok(Summary { text, left_out: vec![], remarks: vec![], folder, beside })
}

/// A bar with the time left; hidden unless standard error is a terminal.
fn progress(runs: u64) -> ProgressBar {
    let bar = ProgressBar::new(runs);
    let template = "{msg} {wide_bar} {pos}/{len} runs, {eta} left";
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}
