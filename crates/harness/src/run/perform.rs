//! Performs one run of an experiment: applies a method to a scene and observes it.

use super::job::Job;
use crate::Error;
use crate::contestant::Contestant;
use crate::measure::picture;
use crate::peers::{Built, Peer, Task};
use crate::rows::finished_run::FinishedRun;
use crate::rows::store::Store;
use crate::rows::{ClockRow, HistoryRow, RayRow, RunRow, TimingRow, TrialRow};
use crate::spec::Experiment;
use crate::spec::turn::{in_chosen_frame, turn_of};
use bvh_core::cost::{self, Measure, SahConstants};
use bvh_core::{Bvh, validate, validate_references};
use bvh_scenes::Scene;
use bvh_scenes::rays::{Family, RandomRays, empirical_cost};
use bvh_scenes::trace::Query;
use bvh_search::{
    Event, Frames, Judge, Method, Observer, Outcome, Problem, Splits, StopReason, solve,
};
use indicatif::ProgressBar;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

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

/// Performs one run. Returns its rows and its tree, or `None` if it was interrupted.
pub(crate) fn perform(work: &Work, job: &Job) -> Result<Option<(FinishedRun, Bvh)>, Error> {
    let Work { experiment, watch, .. } = work;
    if watch.cancelled() {
        return Ok(None);
    }
    let Job { labelled, repetition, first_of_scene, .. } = *job;
    let seed = job.seed(experiment);
    let stopwatch = Stopwatch { watch, start: Instant::now(), events: Mutex::default() };
    let mut scene = Cow::Borrowed(job.scene);
    if labelled.options.frame == Some(Frames::Auto) {
        let framed = in_chosen_frame(&scene, experiment.budget_of(labelled), &stopwatch);
        scene = Cow::Owned(framed?);
    }
    let scene = &*scene;
    let job = &Job { scene, ..job.clone() };
    let result = match &labelled.method {
        Contestant::Ours(method) => search(experiment, job, method, seed, &stopwatch),
        Contestant::Peer(peer) => build(experiment, job, peer, seed, &stopwatch),
    };
    // Cancelling kills the external program, which is not an error.
    if watch.cancelled() {
        return Ok(None);
    }
    let (mut outcome, seconds) = result?;
    outcome.tree.frame = scene.frame;
    let tree = &outcome.tree;
    // A method's defect must not become a published number.
    let valid = match scene.frame {
        // Nothing that divides objects is accepted with frames.
        Some(_) => validate(tree, &scene.boxes),
        None => validate_references(tree, &scene.boxes, &scene.primitives),
    };
    valid.map_err(|source| Error::InvalidTree {
        scene: scene.name.clone(),
        method: labelled.label.clone(),
        source,
    })?;
    let run = run_row(job, seed, &outcome, work.bases[&scene.name]);
    let identity = || (scene.name.clone(), labelled.label.clone(), repetition);
    let mut history = Vec::new();
    let mut clock = Vec::new();
    let event_seconds = stopwatch.seconds();
    for (index, event) in milestones(&outcome.history) {
        let Event { evaluations, work, incumbent, .. } = *event;
        let (scene, method, repetition) = identity();
        if experiment.needs_references() {
            let (scene, method, _) = identity();
            let seconds = event_seconds[index];
            clock.push(ClockRow { scene, method, repetition, event: clock.len(), seconds });
        }
        if experiment.keeps_history() {
            history.push(HistoryRow { scene, method, repetition, evaluations, work, incumbent });
        }
    }
    let mut trials = Vec::new();
    if experiment.trial_methods().contains(&*labelled.label) {
        for event in &outcome.history {
            let Event { evaluations, cost, .. } = *event;
            let (scene, method, repetition) = identity();
            trials.push(TrialRow { scene, method, repetition, evaluations, cost });
        }
    }
    let threads = rayon::current_num_threads();
    let (scene_name, method, _) = identity();
    let timing = TimingRow { scene: scene_name, method, seed, repetition, threads, seconds };
    let rays: Vec<RayRow> =
        experiment.rays.iter().map(|rays| ray_row(experiment, job, seed, tree, rays)).collect();
    let (renders, render_times) = match &experiment.render {
        // Nobody reads the seconds of quick variants.
        Some(config) => {
            let most = if experiment.quick { 1 } else { picture::MOST_REPEATS };
            config.measure(scene, tree, &run, seconds, first_of_scene, most)?
        }
        None => Default::default(),
    };
    let mut finished = FinishedRun::here();
    finished.add(&[run])?;
    finished.add(&history)?;
    finished.add(&trials)?;
    finished.add(&[timing])?;
    finished.add(&rays)?;
    finished.add(&clock)?;
    finished.add(turn_of(&scene.name).filter(|_| first_of_scene).as_slice())?;
    finished.add(&renders)?;
    finished.add(&render_times)?;
    Ok(Some((finished, outcome.tree)))
}

/// Returns the events that `history.csv` keeps, each with its index: the first, every improvement,
/// and the last.
fn milestones(history: &[Event]) -> impl Iterator<Item = (usize, &Event)> {
    history.iter().enumerate().filter(|&(index, event)| {
        let is_end = index == 0 || index + 1 == history.len();
        is_end || event.incumbent < history[index - 1].incumbent
    })
}

/// `base_cost` is the cost of the scene's greedy tree.
fn run_row(job: &Job, seed: u64, outcome: &Outcome, base_cost: f64) -> RunRow {
    let Job { scene, labelled, repetition, .. } = *job;
    let Outcome { ref tree, cost, evaluations, work, stop, .. } = *outcome;
    let internal_area = cost::internal_area(tree);
    RunRow {
        scene: scene.name.clone(),
        scene_kind: scene.kind.to_string(),
        method: labelled.label.clone(),
        seed,
        repetition,
        objects: scene.boxes.len(),
        evaluations,
        work,
        stop,
        cost,
        base_cost,
        cost_over_base: if base_cost > 0.0 { cost / base_cost } else { 1.0 },
        cost_over_root_area: cost::over_root_area(tree, internal_area),
        internal_area,
        goldsmith_salmon: cost::goldsmith_salmon(tree),
        sah: cost::sah(tree, &SahConstants::default()),
        nodes: tree.nodes.len(),
        depth: tree.depth(),
    }
}

fn ray_row(
    experiment: &Experiment,
    job: &Job,
    seed: u64,
    tree: &Bvh,
    config: &RandomRays,
) -> RayRow {
    let Job { scene, labelled, repetition, .. } = *job;
    let (family, stream) = match config.family {
        Family::Inside => ("inside", "rays Inside"),
        Family::Lines => ("lines", "rays Lines"),
    };
    let query = match config.query {
        Query::Any => "any",
        Query::Nearest => "nearest",
        Query::All => "all",
    };
    let straight = turn_of(&scene.name).map_or(scene.name.clone(), |turn| turn.mesh);
    // Every method gets the same rays, at all angles, so that methods differ only in their trees.
    let ray_seed = experiment.seed_of(&straight, stream, 0);
    let cost = empirical_cost(config, &scene.primitives, tree, ray_seed);
    let [boxes_low, boxes_high] = cost.boxes.interval();
    RayRow {
        scene: scene.name.clone(),
        method: labelled.label.clone(),
        seed,
        repetition,
        family: family.into(),
        query: query.into(),
        rays: cost.rays,
        hit_fraction: cost.hit_fraction,
        boxes_per_ray: cost.boxes.mean,
        boxes_standard_error: cost.boxes.standard_error,
        boxes_low,
        boxes_high,
        objects_per_ray: cost.objects.mean,
        objects_standard_error: cost.objects.standard_error,
    }
}

/// Builds the tree of another library or program, as the outcome of a search of one evaluation.
fn build(
    experiment: &Experiment,
    job: &Job,
    peer: &Peer,
    seed: u64,
    stopwatch: &Stopwatch,
) -> Result<(Outcome, f64), Error> {
    let Job { scene, labelled, .. } = *job;
    let cancelled = || stopwatch.watch.cancelled();
    let task =
        Task { boxes: &scene.boxes, objects: &scene.primitives, seed, cancelled: &cancelled };
    let Built { tree, seconds } = peer.build(&task).map_err(|source| Error::Library {
        scene: scene.name.clone(),
        method: labelled.label.clone(),
        source,
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
    let most = options.references.map(|most| (most * scene.boxes.len() as f64) as usize);
    let problem = Problem {
        objective: options.objective.unwrap_or(experiment.objective),
        splits: most.and_then(|most| Splits::at_most(most, &scene.boxes, &scene.primitives)),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_history_keeps_the_first_event_every_improvement_and_the_last() {
        let incumbents = [9.0, 9.0, 7.0, 7.0, 6.0, 6.0, 6.0];
        let history = incumbents.map(|incumbent| Event {
            evaluations: 1,
            work: 1,
            cost: incumbent,
            incumbent,
        });
        let kept: Vec<usize> = milestones(&history).map(|(index, _)| index).collect();
        assert_eq!(kept, [0, 2, 4, 6]);
        assert_eq!(milestones(&history[..1]).count(), 1);
        assert_eq!(milestones(&[]).count(), 0);
    }
}
