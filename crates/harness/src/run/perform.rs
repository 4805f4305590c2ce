//! Performs one run of an experiment: applies a method to a scene and observes it.

use super::job::Job;
use super::runs::Work;
use super::solved::Solved;
use crate::Error;
use crate::contestant::{Contestant, Labelled};
use crate::peers::{self, Built, Task};
use crate::rows::BoundRow;
use crate::rows::finished_run::FinishedRun;
use crate::spec::Experiment;
use bvh_core::cost::{Measure, Objective};
use bvh_core::{Bvh, validate_references};
use bvh_scenes::Scene;
use bvh_scenes::rays::{RandomRays, empirical_cost};
use bvh_search::{Event, Judge, Method, Observer, Outcome, Problem, Splits, StopReason, solve};
use indicatif::ProgressBar;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

/// Computes the lower bound of the scene's internal area that the experiment requests, if any.
fn bound(experiment: &Experiment, scene: &Scene, watch: &Watch) -> Result<Option<BoundRow>, Error> {
    let Some(effort) = experiment.lower_bound else { return Ok(None) };
    let others = peers::others("lower_bound").map_err(|fault| Error::Usage(fault.to_string()))?;
    let lower_bound = (others.lower_bound)(&scene.boxes, effort, watch)
        .map_err(Error::search(&scene.name, "the lower bound"))?;
    Ok(Some(BoundRow { scene: scene.name.clone(), objects: scene.boxes.len(), lower_bound }))
}

/// Performs one run. Returns its rows and its tree, or `None` if it was interrupted.
pub(crate) fn perform(work: &Work, job: &Job) -> Result<Option<(FinishedRun, Bvh)>, Error> {
    let Work { experiment, watch, .. } = work;
    if watch.cancelled() {
        return Ok(None);
    }
    let Job { scene, labelled, .. } = *job;
    let seed = job.seed(experiment);
    let stopwatch = Stopwatch { watch, start: Instant::now(), events: Mutex::default() };
    let result = solve_or_build(experiment, job, seed, &stopwatch);
    // Cancelling kills the external program, which is not an error.
    if watch.cancelled() {
        return Ok(None);
    }
    let (outcome, seconds) = result?;
    // A method's defect must not become a published number.
    let valid = validate_references(&outcome.tree, &scene.boxes, &scene.primitives);
    valid.map_err(|source| Error::InvalidTree {
        scene: scene.name.clone(),
        method: labelled.label.clone(),
        source,
    })?;
    let solved = Solved { experiment, job, seed, outcome: &outcome, seconds };
    let run = solved.run_row(work.bases[&scene.name]);
    let mut finished = FinishedRun::here();
    let bounds = if job.first_of_scene { bound(experiment, scene, watch)? } else { None };
    let (renders, render_times) = match &experiment.render {
        Some(config) => config.measure(scene, &outcome.tree, &run, seconds, job.first_of_scene)?,
        None => Default::default(),
    };
    // An interrupted bound is not a result.
    if watch.cancelled() {
        return Ok(None);
    }
    finished.add(&[run])?;
    finished.add(&solved.history_rows())?;
    finished.add(&solved.trial_rows())?;
    finished.add(&[solved.timing_row()])?;
    finished.add(&solved.ray_rows())?;
    finished.add(&solved.clock_rows(&stopwatch.seconds()))?;
    finished.add(bounds.as_slice())?;
    finished.add(&renders)?;
    finished.add(&render_times)?;
    Ok(Some((finished, outcome.tree)))
}

/// Returns the tree of a job's method and the seconds that the method needed.
fn solve_or_build(
    experiment: &Experiment,
    job: &Job,
    seed: u64,
    stopwatch: &Stopwatch,
) -> Result<(Outcome, f64), Error> {
    let Job { scene, labelled, .. } = *job;
    let peer = match &labelled.method {
        Contestant::Ours(method) => return search(experiment, job, method, seed, stopwatch),
        Contestant::Peer(peer) => peer,
    };
    let cancelled = || stopwatch.watch.cancelled();
    let task =
        Task { boxes: &scene.boxes, objects: &scene.primitives, seed, cancelled: &cancelled };
    let Built { tree, seconds } = peer.build(&task).map_err(|source| Error::Library {
        scene: scene.name.clone(),
        method: labelled.label.clone(),
        source,
    })?;
    // Third-party methods report no events; their end is the only one.
    stopwatch.note(seconds);
    Ok((single_evaluation(tree, &experiment.objective), seconds))
}

/// Applies one of our methods with all options of its entry.
fn search(
    experiment: &Experiment,
    job: &Job,
    method: &Method,
    seed: u64,
    stopwatch: &Stopwatch,
) -> Result<(Outcome, f64), Error> {
    let Job { scene, labelled, .. } = *job;
    let options = &labelled.options;
    // The judge's rays differ from the rays of all measurements.
    let ray_seed = experiment.seed_of(&scene.name, "rays of the judge", job.repetition);
    let judge = options.judge.as_ref().map(|rays| RayJudge { rays, scene, seed: ray_seed });
    let density = job.density(experiment)?;
    let problem = Problem {
        objective: options.objective.unwrap_or(experiment.objective),
        splits: splits(labelled, scene),
        measure: density.as_ref().map(|density| density as &dyn Measure),
        judge: judge.as_ref().map(|judge| judge as &dyn Judge),
        disabled: &options.keep,
        ..Problem::new(&scene.boxes)
    };
    let result = solve(method, &problem, seed, experiment.budget_of(labelled), stopwatch);
    let seconds = stopwatch.start.elapsed().as_secs_f64();
    let mut outcome = result.map_err(Error::search(&scene.name, &labelled.label))?;
    // Rows compare all methods by the experiment's objective, whatever the search minimised.
    let has_other_measure = judge.is_some() || density.is_some() || problem.splits.is_some();
    if has_other_measure || options.objective.is_some() {
        outcome.cost = experiment.objective.cost(&outcome.tree);
    }
    Ok((outcome, seconds))
}

/// Judges a tree by the mean number of box tests of random rays, the same rays for every tree.
///
/// Ng & Trifonov 2003, section 4: 'The intention was to use actual simulation instead of the cost
/// function for evaluating fitness, but using a small number of rays gave unstable evaluations and
/// poor performance.'
///
/// Differs from the paper: the rays are the same for all trees of a run. The paper leaves this
/// open, but new rays for every evaluation would explain the instability.
#[derive(Debug)]
struct RayJudge<'a> {
    rays: &'a RandomRays,
    scene: &'a Scene,
    /// Seed of the rays. Every repetition uses different rays, and none of them reappear in the
    /// final measurement.
    seed: u64,
}

impl Judge for RayJudge<'_> {
    fn judge(&self, tree: &Bvh) -> f64 {
        empirical_cost(self.rays, &self.scene.primitives, tree, self.seed).boxes.mean
    }
}

/// Returns how the method may divide the scene's objects, if it may.
fn splits<'a>(labelled: &Labelled, scene: &'a Scene) -> Option<Splits<'a>> {
    let references = labelled.options.references? * scene.boxes.len() as f64;
    Splits::at_most(references as usize, &scene.boxes, &scene.primitives)
}

/// Describes a third-party tree as the outcome of a search of one evaluation.
fn single_evaluation(tree: Bvh, objective: &Objective) -> Outcome {
    let cost = objective.cost(&tree);
    let work = tree.nodes.len() as u64;
    let history = vec![Event { evaluations: 1, work, cost, incumbent: cost }];
    let stop = StopReason::Completed;
    Outcome { tree, cost, evaluations: 1, work, stop, proof: None, history }
}

/// Observes all runs: moves the bar and forwards an interruption.
pub(crate) struct Watch<'a> {
    pub bar: ProgressBar,
    pub interrupted: &'a AtomicBool,
}

impl Observer for Watch<'_> {
    fn event(&self, _event: &Event) {
        self.bar.tick();
    }

    fn cancelled(&self) -> bool {
        self.interrupted.load(Relaxed)
    }
}

/// Records the times of a run's events.
struct Stopwatch<'a> {
    watch: &'a Watch<'a>,
    start: Instant,
    events: Mutex<Vec<f64>>,
}

impl Stopwatch<'_> {
    fn note(&self, seconds: f64) {
        self.events.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(seconds);
    }

    /// Returns the time of each event so far, in seconds since the start.
    fn seconds(&self) -> Vec<f64> {
        self.events.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone()
    }
}

impl Observer for Stopwatch<'_> {
    fn event(&self, event: &Event) {
        self.note(self.start.elapsed().as_secs_f64());
        self.watch.event(event);
    }

    fn cancelled(&self) -> bool {
        self.watch.cancelled()
    }
}
