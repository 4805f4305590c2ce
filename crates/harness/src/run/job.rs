//! One run of an experiment: solves a scene by a method under observation, and makes the rows of its measurements.

use crate::Error;
use crate::measure::empirical_cost;
use crate::measure::rays::Family;
use crate::peers::Built;
use crate::report::Report;
use crate::run::judge::RayJudge;
use crate::run::rows::{BoundRow, ClockRow, ClockedRow, HistoryRow, RayRow, RunRow, TimingRow};
use crate::run::store::FinishedRun;
use crate::scenes::Scene;
use crate::spec::{Contestant, Experiment, Labelled};
use bvh_build::{Builder, Query, muller_fellner};
use bvh_core::cost::{self, Measure, Objective, SahConstants};
use bvh_core::{Bvh, RayDensity, collapse_leaves, validate_references};
use bvh_search::{
    Budget, Deadline, Event, Judge, Observer, Outcome, Problem, SearchError, Splits, StopReason, exact,
    lower_bound, solve,
};
use indicatif::ProgressBar;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// One run of an experiment.
pub(crate) struct Job<'a> {
    pub scene: &'a Scene,
    /// The cost of the scene's greedy Müller–Fellner tree.
    pub base: f64,
    pub labelled: &'a Labelled,
    pub repetition: u32,
    /// Whether this run also measures what depends on the scene alone.
    pub first_of_scene: bool,
}

impl Job<'_> {
    /// The seed of the run.
    pub fn seed(&self, experiment: &Experiment) -> u64 {
        let seeds = self.labelled.own.seed_as.as_ref().unwrap_or(&self.labelled.label);
        experiment.seed_of(&self.scene.name, seeds, self.repetition)
    }
}

/// The cost of the scene's greedy Müller–Fellner tree, the base of all ratios.
pub(crate) fn base_cost(scene: &Scene, objective: &Objective) -> Result<f64, Error> {
    let tree = muller_fellner::Config::default().build(&scene.boxes);
    Ok(objective.cost(&tree.map_err(Error::search(&scene.name, "muller_fellner, the base"))?))
}

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
    let limit = experiment.max_seconds_of(labelled).map(Duration::from_secs_f64);
    let stopwatch = Stopwatch {
        watch,
        start: Instant::now(),
        deadline: limit.map(Deadline::after),
        events: Mutex::default(),
    };
    let solved = solve_or_build(experiment, job, seed, &stopwatch);
    // That an external program was ended is no failure then.
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
    finished.add(&[solved.timing_row()])?;
    finished.add(&solved.ray_rows())?;
    finished.add(&solved.clock_rows(&stopwatch))?;
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
            let judge = labelled.own.judge.as_ref().map(|rays| RayJudge { rays, scene, seed: ray_seed });
            let density = density(experiment, job)?;
            let problem = Problem {
                objective: labelled.own.objective.unwrap_or(experiment.objective),
                splits: splits(labelled, scene),
                measure: density.as_ref().map(|density| density as &dyn Measure),
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
            let (scene_name, library) = (scene.name.clone(), peer.name());
            let refused = |message| Error::Library { scene: scene_name, library, message };
            let Built { tree, seconds } = peer.build(scene).map_err(refused)?;
            Ok(built(tree, seconds, &experiment.objective, stopwatch))
        }
        Contestant::External(program) => {
            let cancelled = || stopwatch.watch.cancelled();
            let (tree, seconds) =
                program.build(&scene.boxes, &scene.primitives, seed, &cancelled).map_err(|source| {
                    Error::External {
                        scene: scene.name.clone(),
                        method: labelled.label.clone(),
                        command: program.command.join(" "),
                        source,
                    }
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

/// The density of the rays that the job's method minimises the visits of, if it does; every repetition has its own rays.
pub(crate) fn density(experiment: &Experiment, job: &Job) -> Result<Option<RayDensity>, Error> {
    let (Some(config), Some(trained)) = (&experiment.ray_cost, job.labelled.own.for_rays) else {
        return Ok(None);
    };
    let seed = experiment.seed_of(&job.scene.name, "rays that trees are trained on", job.repetition);
    let failed = |message| Error::Tracing { scene: job.scene.name.clone(), message };
    config.density(trained, job.scene, seed).map(Some).map_err(failed)
}

/// How often those rays enter the nodes of the job's tree, which decides how it is laid out.
pub(crate) fn visits(experiment: &Experiment, job: &Job, tree: &Bvh) -> Result<Option<Vec<f32>>, Error> {
    Ok(density(experiment, job)?.map(|density| density.visits(tree)))
}

/// The surface area heuristic with both constants 1, after the best collapse of leaves.
pub(crate) fn collapsed_sah(tree: &Bvh) -> f64 {
    let constants = SahConstants::default();
    cost::sah(&collapse_leaves(tree, &constants), &constants)
}

/// A tree by others, as a search of one evaluation, and the seconds of the building alone.
fn built(tree: Bvh, seconds: f64, objective: &Objective, stopwatch: &Stopwatch) -> (Outcome, f64) {
    let (cost, work) = (objective.cost(&tree), tree.nodes.len() as u64);
    let event = Event { evaluations: 1, work, cost, incumbent: cost };
    stopwatch.note(seconds);
    let stop = StopReason::Completed;
    (Outcome { tree, cost, evaluations: 1, work, stop, proof: None, history: vec![event] }, seconds)
}

/// A job whose tree is found: makes the rows.
struct Solved<'a> {
    experiment: &'a Experiment,
    job: &'a Job<'a>,
    seed: u64,
    outcome: &'a Outcome,
    seconds: f64,
}

impl Solved<'_> {
    /// What begins nearly every row: scene, method and repetition.
    fn identity(&self) -> (String, String, u32) {
        (self.job.scene.name.clone(), self.job.labelled.label.clone(), self.job.repetition)
    }

    fn run_row(&self) -> RunRow {
        let Self { job: &Job { scene, base, .. }, seed, outcome, .. } = *self;
        let tree = &outcome.tree;
        let (scene_name, method, repetition) = self.identity();
        let internal_area = cost::internal_area(tree);
        RunRow {
            scene: scene_name,
            scene_kind: scene.kind.to_string(),
            method,
            seed,
            repetition,
            objects: scene.boxes.len(),
            evaluations: outcome.evaluations,
            work: outcome.work,
            stop: outcome.stop,
            cost: outcome.cost,
            base_cost: base,
            cost_over_base: if base > 0.0 { outcome.cost / base } else { 1.0 },
            cost_over_root_area: cost::over_root_area(tree, internal_area),
            internal_area,
            goldsmith_salmon: cost::goldsmith_salmon(tree),
            sah: cost::sah(tree, &SahConstants::default()),
            nodes: tree.nodes.len(),
            depth: tree.depth(),
        }
    }

    fn history_rows(&self) -> Vec<HistoryRow> {
        let row = |event: &Event| {
            let Event { evaluations, work, cost, incumbent } = *event;
            let (scene, method, repetition) = self.identity();
            HistoryRow { scene, method, seed: self.seed, repetition, evaluations, work, cost, incumbent }
        };
        self.outcome.history.iter().map(row).collect()
    }

    fn timing_row(&self) -> TimingRow {
        let (scene, method, repetition) = self.identity();
        let threads = rayon::current_num_threads();
        TimingRow { scene, method, seed: self.seed, repetition, threads, seconds: self.seconds }
    }

    fn clocked_row(&self, run: RunRow) -> ClockedRow {
        let tree = &self.outcome.tree;
        ClockedRow {
            scene: run.scene,
            method: run.method,
            seed: run.seed,
            repetition: run.repetition,
            threads: rayon::current_num_threads(),
            seconds: self.seconds,
            evaluations: run.evaluations,
            work: run.work,
            cost: run.cost,
            cost_over_base: run.cost_over_base,
            references_per_object: tree.prim_ids.len() as f64 / run.objects as f64,
            collapsed_sah: collapsed_sah(tree),
        }
    }

    /// When each event happened, if a report asks for it.
    fn clock_rows(&self, stopwatch: &Stopwatch) -> Vec<ClockRow> {
        if !self.experiment.reports.iter().any(Report::needs_clock) {
            return vec![];
        }
        let row = |(event, seconds)| {
            let (scene, method, repetition) = self.identity();
            ClockRow { scene, method, repetition, event, seconds }
        };
        stopwatch.seconds().into_iter().enumerate().map(row).collect()
    }

    fn ray_rows(&self) -> Vec<RayRow> {
        let Self { experiment, job: &Job { scene, .. }, seed, .. } = *self;
        let row = |config: &empirical_cost::Config| {
            let (family, of_family) = match config.family {
                Family::Inside => ("inside", "rays Inside"),
                Family::Lines => ("lines", "rays Lines"),
            };
            let query = match config.query {
                Query::Any => "any",
                Query::Nearest => "nearest",
                Query::All => "all",
            };
            let (scene_name, method, repetition) = self.identity();
            // Every method gets the same rays, so that differences between methods come from their trees.
            let ray_seed = experiment.seed_of(&scene_name, of_family, 0);
            let named = RayRow {
                scene: scene_name,
                method,
                seed,
                repetition,
                family: family.into(),
                query: query.into(),
                ..Default::default()
            };
            empirical_cost::measure(config, scene, &self.outcome.tree, ray_seed, named)
        };
        experiment.rays.iter().map(row).collect()
    }
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
        self.events.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(seconds);
    }

    /// When each event so far happened, in seconds since the start.
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
        self.watch.cancelled() || self.deadline.is_some_and(|deadline| deadline.has_passed())
    }

    fn progress(&self) -> Option<f64> {
        self.deadline.map(|deadline| deadline.fraction())
    }
}
