//! One run of an experiment: a method on a scene, watched, and the rows of all that is measured of it.

use crate::peers::{Built, Peer};
use crate::report::Report;
use crate::run::rows::{BoundRow, ClockRow, HistoryRow, RayRow, RunRow, TimingRow};
use crate::run::store::FinishedRun;
use crate::scenes::Scene;
use crate::spec::{Contestant, Experiment, Labelled};
use crate::{Error, measure::empirical_cost};
use bvh_build::{Builder, muller_fellner};
use bvh_core::Bvh;
use bvh_core::cost::{self, Objective, SahConstants};
use bvh_search::{Budget, Event, Observer, Outcome, Problem, StopReason, exact, lower_bound, solve};
use indicatif::ProgressBar;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

/// One run of an experiment.
pub(crate) struct Job<'a> {
    pub scene: &'a Scene,
    /// The cost of the scene's greedy Müller–Fellner tree.
    pub base: f64,
    pub labelled: &'a Labelled,
    pub repetition: u32,
    /// Whether what is known of the scene alone is this run's to say.
    pub first_of_scene: bool,
}

/// The cost of the scene's greedy Müller–Fellner tree, the base of all ratios.
pub(crate) fn base_cost(scene: &Scene, objective: &Objective) -> Result<f64, Error> {
    let refused = |source| Error::Search {
        scene: scene.name.clone(),
        method: "muller_fellner, the base".into(),
        source: bvh_search::SearchError::Build(source),
    };
    Ok(objective.cost(&muller_fellner::Config::default().build(&scene.boxes).map_err(refused)?))
}

/// What is proven of the scene's internal area: the exact optimum where gaps are measured from it, else a lower bound
/// if the experiment asks for one.
fn bound(experiment: &Experiment, scene: &Scene) -> Result<Option<BoundRow>, Error> {
    let refused =
        |source| Error::Search { scene: scene.name.clone(), method: "the lower bound".into(), source };
    let lower_bound = if experiment.needs_optimum(scene.boxes.len()) {
        solve(&exact::Config {}, &Problem::new(&scene.boxes), 0, Budget::default(), &()).map_err(refused)?.cost
    } else if let Some(effort) = experiment.lower_bound {
        let bound = lower_bound::internal_area(&scene.boxes, effort);
        bound.map_err(bvh_search::SearchError::Build).map_err(refused)?
    } else {
        return Ok(None);
    };
    Ok(Some(BoundRow { scene: scene.name.clone(), objects: scene.boxes.len(), lower_bound }))
}

/// One run and its tree; `None` if it was interrupted.
pub(crate) fn perform(
    experiment: &Experiment,
    job: &Job,
    watch: &Watch,
) -> Result<Option<(FinishedRun, Bvh)>, Error> {
    let Job { scene, base, labelled, repetition, .. } = *job;
    let Labelled { label, method, .. } = labelled;
    if watch.cancelled() {
        return Ok(None);
    }
    let seed = experiment.seed_of(&scene.name, labelled.seed_as.as_ref().unwrap_or(label), repetition);
    let problem =
        Problem { objective: experiment.objective, keep: &labelled.keep, ..Problem::new(&scene.boxes) };
    let stopwatch = Stopwatch { watch, start: Instant::now(), events: Mutex::default() };
    let names = || (scene.name.clone(), label.clone());
    let (outcome, seconds) = match method {
        Contestant::Ours(method) => {
            let outcome = solve(method, &problem, seed, experiment.budget_of(labelled), &stopwatch);
            let seconds = stopwatch.start.elapsed().as_secs_f64();
            let outcome = outcome.map_err(|source| {
                let (scene, method) = names();
                Error::Search { scene, method, source }
            })?;
            (outcome, seconds)
        }
        Contestant::Peer(peer) => build_by(peer, scene, &experiment.objective, &stopwatch)?,
    };
    if watch.cancelled() {
        return Ok(None);
    }
    let tree = &outcome.tree;
    bvh_core::validate(tree, &scene.boxes).map_err(|source| {
        let (scene, method) = names();
        Error::InvalidTree { scene, method, source }
    })?;
    let (scene_name, method) = names();
    let internal_area = cost::internal_area(tree);
    let run = RunRow {
        scene: scene_name.clone(),
        scene_kind: scene.kind.to_string(),
        method: method.clone(),
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
    };
    let row = |event: &Event| HistoryRow {
        scene: scene_name.clone(),
        method: method.clone(),
        seed,
        repetition,
        evaluations: event.evaluations,
        work: event.work,
        cost: event.cost,
        incumbent: event.incumbent,
    };
    let history: Vec<HistoryRow> = outcome.history.iter().map(row).collect();
    let ray_row = |config: &empirical_cost::Config| {
        let (family, query) = (format!("{:?}", config.family), format!("{:?}", config.query));
        // The same rays for all methods: their differences are then the trees'.
        let ray_seed = experiment.seed_of(&scene_name, &format!("rays {family}"), 0);
        let [family, query] = [family, query].map(|name| name.to_lowercase());
        let named = RayRow {
            scene: scene_name.clone(),
            method: method.clone(),
            seed,
            repetition,
            family,
            query,
            ..Default::default()
        };
        empirical_cost::measure(config, scene, tree, ray_seed, named)
    };
    let rays: Vec<RayRow> = experiment.rays.iter().map(ray_row).collect();
    let clock = if experiment.reports.iter().any(Report::needs_clock) { stopwatch.seconds() } else { vec![] };
    let clock_row = |(event, seconds)| ClockRow {
        scene: scene_name.clone(),
        method: method.clone(),
        repetition,
        event,
        seconds,
    };
    let clock: Vec<ClockRow> = clock.into_iter().enumerate().map(clock_row).collect();
    let bounds = if job.first_of_scene { bound(experiment, scene)? } else { None };
    let (renders, render_times) = match &experiment.render {
        Some(config) => config.measure(scene, tree, &run, seconds, job.first_of_scene)?,
        None => Default::default(),
    };
    let threads = rayon::current_num_threads();
    let timing = TimingRow { scene: scene_name, method, seed, repetition, threads, seconds };
    let mut finished = FinishedRun::default();
    finished.add(&[run])?;
    finished.add(&history)?;
    finished.add(&[timing])?;
    finished.add(&rays)?;
    finished.add(&clock)?;
    finished.add(bounds.as_slice())?;
    finished.add(&renders)?;
    finished.add(&render_times)?;
    Ok(Some((finished, outcome.tree)))
}

/// A tree by another library, as a search of one evaluation, and the seconds of the building alone.
fn build_by(
    peer: &Peer,
    scene: &Scene,
    objective: &Objective,
    stopwatch: &Stopwatch,
) -> Result<(Outcome, f64), Error> {
    let refused = |message| Error::Library { scene: scene.name.clone(), library: peer.name(), message };
    let Built { tree, seconds } = peer.build(scene).map_err(refused)?;
    let (cost, work) = (objective.cost(&tree), tree.nodes.len() as u64);
    let event = Event { evaluations: 1, work, cost, incumbent: cost };
    stopwatch.note(seconds);
    let stop = StopReason::Completed;
    Ok((Outcome { tree, cost, evaluations: 1, work, stop, history: vec![event] }, seconds))
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

/// Notes when the events of one run happen.
struct Stopwatch<'a> {
    watch: &'a Watch<'a>,
    start: Instant,
    events: Mutex<Vec<f64>>,
}

impl Stopwatch<'_> {
    fn note(&self, seconds: f64) {
        self.events.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(seconds);
    }

    /// The seconds of all events so far.
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
