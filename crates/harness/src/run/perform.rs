//! Performs one run of an experiment: applies a method to a scene and observes it.

use super::finished::Finished;
use super::jobs::{Job, Jobs};
use super::watch::Stopwatch;
use crate::Error;
use crate::contestant::Contestant;
use crate::peers::{Built, Peer, Task};
use crate::rows::kept_run::RunName;
use crate::spec::Experiment;
use crate::spec::scenes::in_chosen_frame;
use bvh_core::cost::Measure;
use bvh_core::{Bvh, validate, validate_references};
use bvh_scenes::Scene;
use bvh_scenes::rays::{RandomRays, empirical_cost};
use bvh_search::{
    Event, Frames, Judge, Method, Observer, Outcome, Problem, Splits, StopReason, solve,
};
use std::borrow::Cow;

/// Performs one run; returns `None` if it was interrupted.
pub(crate) fn perform<'a>(jobs: &'a Jobs, job: &'a Job) -> Result<Option<Finished<'a>>, Error> {
    let Jobs { experiment, watch, .. } = jobs;
    if watch.cancelled() {
        return Ok(None);
    }
    let stopwatch = Stopwatch::start(watch);
    let scene = match job.labelled.options.frame {
        Some(Frames::Auto) => {
            let budget = experiment.budget_of(job.labelled);
            Cow::Owned(in_chosen_frame(job.scene, budget, &stopwatch)?)
        }
        _ => Cow::Borrowed(job.scene),
    };
    let result = match &job.labelled.method {
        Contestant::Ours(method) => search(experiment, job, &scene, method, &stopwatch),
        Contestant::Peer(peer) => build(experiment, job, &scene, peer, &stopwatch),
    };
    // Cancelling kills the external program, which is not an error.
    if watch.cancelled() {
        return Ok(None);
    }
    let (mut outcome, seconds) = result?;
    outcome.tree.frame = scene.frame;
    // A method's defect must not become a published number.
    let valid = match scene.frame {
        // Nothing that divides objects is accepted with frames.
        Some(_) => validate(&outcome.tree, &scene.boxes),
        None => validate_references(&outcome.tree, &scene.boxes, &scene.primitives),
    };
    valid.map_err(|source| {
        let RunName { scene, method, .. } = job.name();
        Error::InvalidTree { scene, method, source }
    })?;
    let event_seconds = stopwatch.into_seconds();
    Ok(Some(Finished { jobs, job, scene, outcome, seconds, event_seconds }))
}

/// Builds the tree of another library or program, as the outcome of a search of one evaluation.
fn build(
    experiment: &Experiment,
    job: &Job,
    scene: &Scene,
    peer: &Peer,
    stopwatch: &Stopwatch,
) -> Result<(Outcome, f64), Error> {
    let Scene { boxes, primitives: objects, .. } = scene;
    let cancelled = || stopwatch.cancelled();
    let task = Task { boxes, objects, seed: job.seed, cancelled: &cancelled };
    let Built { tree, seconds } = peer.build(&task).map_err(|source| {
        let RunName { scene, method, .. } = job.name();
        Error::Library { scene, method, source }
    })?;
    // It reports no events; its end is the only one.
    stopwatch.note(seconds);
    let cost = experiment.objective.cost(&tree);
    let work = tree.nodes.len() as u64;
    let history = vec![Event { evaluations: 1, work, cost, incumbent: cost }];
    let stop = StopReason::Completed;
    Ok((Outcome { tree, cost, evaluations: 1, work, stop, proof: None, history }, seconds))
}

/// Applies one of our methods with all options of its entry.
fn search(
    experiment: &Experiment,
    job: &Job,
    scene: &Scene,
    method: &Method,
    stopwatch: &Stopwatch,
) -> Result<(Outcome, f64), Error> {
    let labelled = job.labelled;
    let options = &labelled.options;
    // The judge's rays differ from the rays of all measurements.
    let ray_seed = experiment.seed_of(&scene.name, "rays of the judge", job.repetition);
    let judge = options.judge.as_ref().map(|rays| RayJudge { rays, scene, seed: ray_seed });
    let density = job.density(experiment)?;
    let most = options.references.map(|most| (most * scene.boxes.len() as f64) as usize);
    let problem = Problem {
        objective: options.objective.unwrap_or(experiment.objective),
        splits: most.and_then(|most| Splits::at_most(most, &scene.boxes, &scene.primitives)),
        measure: density.as_ref().map(|density| density as &dyn Measure),
        judge: judge.as_ref().map(|judge| judge as &dyn Judge),
        disabled: &options.keep,
        ..Problem::new(&scene.boxes)
    };
    let result = solve(method, &problem, job.seed, experiment.budget_of(labelled), stopwatch);
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
