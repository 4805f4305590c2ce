//! Carries out the runs of an experiment: in parallel or one by one, with progress, until done or interrupted.

use crate::Error;
use crate::peers::{Built, Peer};
use crate::provenance::Provenance;
use crate::record::{BoundRow, ClockRow, HistoryRow, RayRow, RunRow, TimingRow, to_bytes};
use crate::report::{self, Report};
use crate::scene::Scene;
use crate::spec::{Contestant, Experiment, Labelled};
use crate::store::{FinishedRun, Store};
use crate::{rays, tracing};
use bvh_build::{Builder, muller_fellner};
use bvh_core::Bvh;
use bvh_core::cost::{self, Objective, SahConstants};
use bvh_search::{Event, Observer, Outcome, Problem, StopReason, lower_bound, solve};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::time::Instant;

/// One run of an experiment.
struct Job<'a> {
    scene: &'a Scene,
    /// The cost of the scene's greedy Müller–Fellner tree.
    base: f64,
    labelled: &'a Labelled,
    repetition: u32,
}

/// What a finished experiment leaves to say.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Tables for the terminal.
    pub text: String,
    /// Optional scenes that were not there.
    pub left_out: Vec<String>,
}

/// Runs `experiment` into `out/NAME/`. `interrupted` is watched: when it becomes true, finished runs are kept and the
/// rest is given up.
pub fn execute(
    experiment: &Experiment,
    out: &Path,
    resume: bool,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    let Some(threads) = experiment.threads else { return run(experiment, out, resume, interrupted) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build();
    let pool = pool.map_err(|error| Error::Usage(format!("threads = {threads}: {error}")))?;
    pool.install(|| run(experiment, out, resume, interrupted))
}

fn run(experiment: &Experiment, out: &Path, resume: bool, interrupted: &AtomicBool) -> Result<Summary, Error> {
    let (scenes, left_out) = experiment.load_scenes()?;
    let resolved = resolve(experiment, &scenes)?;
    let store = Store::open(out, &experiment.name, &resolved, resume)?;
    let bases = scenes
        .par_iter()
        .map(|scene| base_cost(scene, &experiment.objective))
        .collect::<Result<Vec<_>, _>>()?;
    let jobs: Vec<Job> = scenes
        .iter()
        .zip(bases)
        .flat_map(|(scene, base)| experiment.methods.iter().map(move |labelled| (scene, base, labelled)))
        .flat_map(|(scene, base, labelled)| {
            (0..experiment.repetitions).map(move |repetition| Job { scene, base, labelled, repetition })
        })
        .collect();

    let mut todo: Vec<usize> = (0..jobs.len()).filter(|&index| !store.has(index)).collect();
    if experiment.sequential {
        let scene = |index: usize| index / (experiment.methods.len() * experiment.repetitions as usize);
        todo.sort_by_key(|&index| (scene(index), jobs[index].repetition));
    }
    // The trees that rays are traced through, by the number of their run.
    let trees = Mutex::new(BTreeMap::new());
    let finished = AtomicUsize::new(jobs.len() - todo.len());
    let watch = Watch { bar: progress(jobs.len() as u64, finished.load(Relaxed) as u64), interrupted };
    watch.bar.set_message(experiment.name.clone());
    let work = |&index: &usize| -> Result<(), Error> {
        if let Some((run, tree)) = perform(experiment, &jobs[index], &watch)? {
            store.keep(index, &run)?;
            if experiment.tracing.is_some() && jobs[index].repetition == 0 {
                trees.lock().unwrap_or_else(std::sync::PoisonError::into_inner).insert(index, tree);
            }
            finished.fetch_add(1, Relaxed);
            watch.bar.inc(1);
        }
        Ok(())
    };
    let result =
        if experiment.sequential { todo.iter().try_for_each(work) } else { todo.par_iter().try_for_each(work) };
    watch.bar.finish_and_clear();
    result?;
    let finished = finished.load(Relaxed);
    if finished < jobs.len() {
        return Err(Error::Interrupted { finished, runs: jobs.len() });
    }
    store.join(jobs.len())?;
    store.write("resolved.toml", resolved.as_bytes())?;
    if let Some(effort) = experiment.lower_bound {
        let bounds = scenes.iter().map(|scene| bound(scene, effort)).collect::<Result<Vec<_>, _>>()?;
        store.write("bounds.csv", &to_bytes(&bounds, Path::new("bounds.csv"))?)?;
    }
    if let Some(config) = &experiment.tracing {
        let trees = trees.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        trace(experiment, config, &jobs, trees, &watch, &store)?;
    }
    let text = report::write_all(&experiment.reports, &store)?;
    store.write("provenance.toml", to_toml(&Provenance::gather())?.as_bytes())?;
    store.finish()?;
    Ok(Summary { text, left_out })
}

/// The cost of the scene's greedy Müller–Fellner tree, the base of all ratios.
fn base_cost(scene: &Scene, objective: &Objective) -> Result<f64, Error> {
    let refused = |source| Error::Search {
        scene: scene.name.clone(),
        method: "muller_fellner, the base".into(),
        source: bvh_search::SearchError::Build(source),
    };
    Ok(objective.cost(&muller_fellner::Config::default().build(&scene.boxes).map_err(refused)?))
}

/// A lower bound of the scene's internal area.
fn bound(scene: &Scene, effort: u32) -> Result<BoundRow, Error> {
    let refused = |source| Error::Search {
        scene: scene.name.clone(),
        method: "the lower bound".into(),
        source: bvh_search::SearchError::Build(source),
    };
    let lower_bound = lower_bound::internal_area(&scene.boxes, effort).map_err(refused)?;
    Ok(BoundRow { scene: scene.name.clone(), objects: scene.boxes.len(), lower_bound })
}

/// Traces rays through the trees of all first runs, scene by scene. Trees of runs that were kept from an interrupted
/// experiment are made again.
fn trace(
    experiment: &Experiment,
    config: &tracing::Config,
    jobs: &[Job],
    mut trees: BTreeMap<usize, Bvh>,
    watch: &Watch,
    store: &Store,
) -> Result<(), Error> {
    let interrupted = || Error::Interrupted { finished: jobs.len(), runs: jobs.len() };
    for (index, job) in jobs.iter().enumerate().filter(|(_, job)| job.repetition == 0) {
        if let Entry::Vacant(missing) = trees.entry(index) {
            missing.insert(perform(experiment, job, watch)?.ok_or_else(interrupted)?.1);
        }
    }
    let (mut rows, mut times) = (Vec::new(), Vec::new());
    let first_runs: Vec<(&Job, &Bvh)> = trees.iter().map(|(&index, tree)| (&jobs[index], tree)).collect();
    for of_scene in first_runs.chunk_by(|a, b| a.0.scene.name == b.0.scene.name) {
        let scene = of_scene[0].0.scene;
        let entries: Vec<tracing::Entry> = of_scene
            .iter()
            .map(|&(job, tree)| {
                let Labelled { label, method } = job.labelled;
                let peer = if let Contestant::Peer(peer) = method { Some(peer) } else { None };
                tracing::Entry { method: label, tree, peer }
            })
            .collect();
        let seed = experiment.seed_of(&scene.name, "tracing", 0);
        let measured = tracing::measure(config, scene, &entries, seed, || watch.cancelled())
            .map_err(|message| Error::Scene { name: scene.name.clone(), message })?;
        let (scene_rows, scene_times) = measured.ok_or_else(interrupted)?;
        rows.extend(scene_rows);
        times.extend(scene_times);
    }
    store.write("traversal.csv", &to_bytes(&rows, Path::new("traversal.csv"))?)?;
    store.write("timing_traversal.csv", &to_bytes(&times, Path::new("timing_traversal.csv"))?)
}

/// One run and its tree; `None` if it was interrupted.
fn perform(experiment: &Experiment, job: &Job, watch: &Watch) -> Result<Option<(FinishedRun, Bvh)>, Error> {
    let Job { scene, base, labelled: Labelled { label, method }, repetition } = *job;
    if watch.cancelled() {
        return Ok(None);
    }
    let seed = experiment.seed_of(&scene.name, label, repetition);
    let problem = Problem { boxes: &scene.boxes, objective: experiment.objective };
    let stopwatch = Stopwatch { watch, start: Instant::now(), events: Mutex::default() };
    let names = || (scene.name.clone(), label.clone());
    let (outcome, seconds) = match method {
        Contestant::Ours(method) => {
            let outcome = solve(method, &problem, seed, experiment.budget, &stopwatch);
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
        scene_kind: scene.kind.into(),
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
    let history = outcome.history.iter().map(row).collect();
    let ray_row = |config: &rays::Config| {
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
        rays::measure(config, scene, tree, ray_seed, named)
    };
    let rays = experiment.rays.iter().map(ray_row).collect();
    let clock = if experiment.reports.iter().any(Report::needs_clock) { stopwatch.seconds() } else { vec![] };
    let clock_row = |(event, seconds)| ClockRow {
        scene: scene_name.clone(),
        method: method.clone(),
        repetition,
        event,
        seconds,
    };
    let clock = clock.into_iter().enumerate().map(clock_row).collect();
    let threads = rayon::current_num_threads();
    let timing = TimingRow { scene: scene_name, method, seed, repetition, threads, seconds };
    Ok(Some((FinishedRun { run, history, timing, rays, clock }, outcome.tree)))
}

/// A tree by another library, as a search of one evaluation, and the seconds of the building alone.
fn build_by(
    peer: &Peer,
    scene: &Scene,
    objective: &Objective,
    stopwatch: &Stopwatch,
) -> Result<(Outcome, f64), Error> {
    let refused = |message| Error::Scene { name: scene.name.clone(), message };
    let Built { tree, seconds } = peer.build(scene).map_err(refused)?;
    let (cost, work) = (objective.cost(&tree), tree.nodes.len() as u64);
    let event = Event { evaluations: 1, work, cost, incumbent: cost };
    stopwatch.note(seconds);
    let stop = StopReason::Completed;
    Ok((Outcome { tree, cost, evaluations: 1, work, stop, history: vec![event] }, seconds))
}

/// The spec with every default spelled out, and which scenes it ran on.
fn resolve(experiment: &Experiment, scenes: &[Scene]) -> Result<String, Error> {
    #[derive(Serialize)]
    struct LoadedScene<'a> {
        name: &'a str,
        kind: &'a str,
        objects: usize,
        checksum: String,
    }
    #[derive(Serialize)]
    struct Resolved<'a> {
        experiment: &'a Experiment,
        scenes: Vec<LoadedScene<'a>>,
    }
    let scenes = scenes
        .iter()
        .map(|scene| LoadedScene {
            name: &scene.name,
            kind: scene.kind,
            objects: scene.boxes.len(),
            checksum: format!("{:016x}", scene.checksum()),
        })
        .collect();
    to_toml(&Resolved { experiment, scenes })
}

fn to_toml(value: &impl Serialize) -> Result<String, Error> {
    toml::to_string(value).map_err(|error| Error::Usage(format!("cannot be written as TOML: {error}")))
}

/// A bar with the time left; hidden unless standard error is a terminal.
fn progress(runs: u64, finished: u64) -> ProgressBar {
    let bar = ProgressBar::new(runs).with_position(finished);
    let template = "{msg} {wide_bar} {pos}/{len} runs, {eta} left";
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.reset_eta();
    bar
}

/// Follows all runs: moves the bar, passes an interruption on.
struct Watch<'a> {
    bar: ProgressBar,
    interrupted: &'a AtomicBool,
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
