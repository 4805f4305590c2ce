//! Performs one run of an experiment: solves a scene by a method under observation.

use super::job::Job;
use super::judge::RayJudge;
use super::solved::Solved;
use crate::Error;
use crate::contestant::{Contestant, Labelled};
use crate::peers::Built;
use crate::rows::BoundRow;
use crate::rows::store::FinishedRun;
use crate::spec::Experiment;
use bvh_core::cost::{Measure, Objective};
use bvh_core::{Bvh, validate_references};
use bvh_scenes::Scene;
use bvh_search::{
    Budget, Deadline, Event, Judge, Observer, Outcome, Problem, SearchError, Splits, StopReason,
    exact, lower_bound, solve,
};
use indicatif::ProgressBar;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// A proven lower bound of the scene's internal area: the exact optimum where gaps are measured from it, else the bound
/// that the experiment asks for, if it asks for one.
fn bound(experiment: &Experiment, scene: &Scene, watch: &Watch) -> Result<Option<BoundRow>, Error> {
    let lower_bound = if experiment.needs_optimum(scene.boxes.len()) {
        let problem = Problem::new(&scene.boxes);
        solve(&exact::Config {}, &problem, 0, Budget::UNLIMITED, &()).map(|outcome| outcome.cost)
    } else if let Some(effort) = experiment.lower_bound {
        lower_bound::internal_area(&scene.boxes, effort, watch).map_err(SearchError::Build)
    } else {
        return Ok(None);
    };
    let lower_bound = lower_bound.map_err(Error::search(&scene.name, "the lower bound"))?;
    Ok(Some(BoundRow { scene: scene.name.clone(), objects: scene.boxes.len(), lower_bound }))
}

/// One run and its tree; `None` if it was interrupted.
pub(crate) fn perform(
    experiment: &Experiment,
    job: &Job,
    watch: &Watch,
) -> Result<Option<(FinishedRun, Bvh)>, Error> {
    if watch.cancelled() {
        return Ok(None);
    }
    let Job { scene, labelled, .. } = *job;
    let seed = job.seed(experiment);
    let limit = experiment
        .max_seconds_of(labelled)
        .map(Duration::from_secs_f64);
    let stopwatch = Stopwatch {
        watch,
        start: Instant::now(),
        deadline: limit.map(Deadline::after),
        events: Mutex::default(),
    };
    let solved = solve_or_build(experiment, job, seed, &stopwatch);
    // Cancelling kills the external program, which is not an error.
    if watch.cancelled() {
        return Ok(None);
    }
    let (outcome, seconds) = solved?;
    let valid = validate_references(&outcome.tree, &scene.boxes, &scene.primitives);
    valid.map_err(|source| Error::InvalidTree {
        scene: scene.name.clone(),
        method: labelled.label.clone(),
        source,
    })?;
    let solved = Solved { experiment, job, seed, outcome: &outcome, seconds };
    let run = solved.run_row();
    let mut finished = FinishedRun::default();
    if experiment.is_by_the_clock() {
        finished.add(&[solved.clocked_row(run)])?;
        return Ok(Some((finished, outcome.tree)));
    }
    let bounds = if job.first_of_scene { bound(experiment, scene, watch)? } else { None };
    let (renders, render_times) = match &experiment.render {
        Some(config) => config.measure(scene, &outcome.tree, &run, seconds, job.first_of_scene)?,
        None => Default::default(),
    };
    // A bound that was cut short is no result.
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

/// The tree of a job's method, and the seconds that it took.
fn solve_or_build(
    experiment: &Experiment,
    job: &Job,
    seed: u64,
    stopwatch: &Stopwatch,
) -> Result<(Outcome, f64), Error> {
    let Job { scene, labelled, .. } = *job;
    match &labelled.method {
        Contestant::Ours(method) => {
            let ray_seed = experiment.seed_of(&scene.name, "rays of the judge", job.repetition);
            let judge =
                labelled
                    .own
                    .judge
                    .as_ref()
                    .map(|rays| RayJudge { rays, scene, seed: ray_seed });
            let density = job.density(experiment)?;
            let problem = Problem {
                objective: labelled
                    .own
                    .objective
                    .unwrap_or(experiment.objective),
                splits: splits(labelled, scene),
                measure: density
                    .as_ref()
                    .map(|density| density as &dyn Measure),
                judge: judge.as_ref().map(|judge| judge as &dyn Judge),
                disabled: &labelled.own.keep,
                ..Problem::new(&scene.boxes)
            };
            let outcome = solve(method, &problem, seed, experiment.budget_of(labelled), stopwatch);
            let seconds = stopwatch.start.elapsed().as_secs_f64();
            let mut outcome = outcome.map_err(Error::search(&scene.name, &labelled.label))?;
            let own = judge.is_some() || density.is_some() || problem.splits.is_some();
            if own || labelled.own.objective.is_some() {
                outcome.cost = experiment.objective.cost(&outcome.tree);
            }
            Ok((outcome, seconds))
        }
        Contestant::Peer(peer) => {
            let scene_name = scene.name.clone();
            let library = peer.name();
            let refused = |message| Error::Library { scene: scene_name, library, message };
            let Built { tree, seconds } = peer.build(scene).map_err(refused)?;
            Ok(built(tree, seconds, &experiment.objective, stopwatch))
        }
        Contestant::External(program) => {
            let cancelled = || stopwatch.watch.cancelled();
            let (tree, seconds) = program
                .build(&scene.boxes, &scene.primitives, seed, &cancelled)
                .map_err(|source| Error::External {
                    scene: scene.name.clone(),
                    method: labelled.label.clone(),
                    command: program.command.join(" "),
                    source,
                })?;
            Ok(built(tree, seconds, &experiment.objective, stopwatch))
        }
    }
}

/// Whether and how the method may divide the scene's objects.
fn splits<'a>(labelled: &Labelled, scene: &'a Scene) -> Option<Splits<'a>> {
    let references = labelled.own.references? * scene.boxes.len() as f64;
    Splits::at_most(references as usize, &scene.boxes, &scene.primitives)
}

/// A tree by others, as a search of one evaluation, and the seconds of the building alone.
fn built(tree: Bvh, seconds: f64, objective: &Objective, stopwatch: &Stopwatch) -> (Outcome, f64) {
    let cost = objective.cost(&tree);
    let work = tree.nodes.len() as u64;
    let event = Event { evaluations: 1, work, cost, incumbent: cost };
    stopwatch.note(seconds);
    let stop = StopReason::Completed;
    (Outcome { tree, cost, evaluations: 1, work, stop, proof: None, history: vec![event] }, seconds)
}

/// Follows all runs: moves the bar, passes an interruption on.
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

/// Notes when the events of one run happen, and ends it after its seconds, if it has a limit.
struct Stopwatch<'a> {
    watch: &'a Watch<'a>,
    start: Instant,
    deadline: Option<Deadline>,
    events: Mutex<Vec<f64>>,
}

impl Stopwatch<'_> {
    fn note(&self, seconds: f64) {
        self.events
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .push(seconds);
    }

    /// When each event so far happened, in seconds since the start.
    fn seconds(&self) -> Vec<f64> {
        self.events
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .clone()
    }
}

impl Observer for Stopwatch<'_> {
    fn event(&self, event: &Event) {
        self.note(self.start.elapsed().as_secs_f64());
        self.watch.event(event);
    }

    fn cancelled(&self) -> bool {
        self.watch.cancelled()
            || self
                .deadline
                .is_some_and(|deadline| deadline.has_passed())
    }

    fn progress(&self) -> Option<f64> {
        self.deadline.map(|deadline| deadline.fraction())
    }
}
