//! Carries out the runs of an experiment: in parallel or one by one, with progress, until done or interrupted.

use crate::peers::{Built, Peer};
use crate::provenance::Provenance;
use crate::record::{BoundRow, ClockRow, HistoryRow, RayRow, RunRow, TimingRow, to_bytes};
use crate::report::{self, Report};
use crate::scene::Scene;
use crate::spec::{Contestant, Experiment, Labelled};
use crate::store::{FinishedRun, Store};
use crate::suite::Measure;
use crate::sweep::Shard;
use crate::{Error, rays, reference, store, tracing};
use bvh_build::{Builder, muller_fellner};
use bvh_core::Bvh;
use bvh_core::cost::{self, Objective, SahConstants};
use bvh_search::{Budget, Event, Observer, Outcome, Problem, StopReason, exact, lower_bound, solve};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
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
    /// Whether what is known of the scene alone is this run's to say.
    first_of_scene: bool,
}

/// What a finished experiment leaves to say.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Tables for the terminal.
    pub text: String,
    /// Optional scenes that were not there.
    pub left_out: Vec<String>,
}

/// How much of an experiment is to be done.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extent {
    /// Keep the finished runs of an interrupted experiment.
    pub resume: bool,
    /// Do these runs only, and leave them to be [merged](crate::sweep::merge).
    pub shard: Option<Shard>,
}

/// Runs `experiment` into `out/NAME/`. `interrupted` is watched: when it becomes true, finished runs are kept and the
/// rest is given up.
pub fn execute(
    experiment: &Experiment,
    out: &Path,
    extent: Extent,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    if let Some(measure) = &experiment.suite {
        if extent.shard.is_some() {
            return Err(Error::Usage(format!("{}: the suite of cases is not done in parts", experiment.name)));
        }
        return over_suite(experiment, measure, out, interrupted);
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
    if extent.shard.is_some() && experiment.tracing.is_some() {
        return Err(Error::Usage(format!(
            "{}: rays are timed against each other, not in parts",
            experiment.name
        )));
    }
    let (scenes, left_out) = experiment.load_scenes()?;
    let resolved = resolve(experiment, &scenes);
    let store = Store::open(out, &experiment.name, &to_toml(&resolved)?, extent.resume)?;
    let bases = scenes
        .par_iter()
        .map(|scene| base_cost(scene, &experiment.objective))
        .collect::<Result<Vec<_>, _>>()?;
    let jobs: Vec<Job> = scenes
        .iter()
        .zip(bases)
        .flat_map(|(scene, base)| {
            experiment.runs().map(move |(labelled, repetition, first_of_scene)| Job {
                scene,
                base,
                labelled,
                repetition,
                first_of_scene,
            })
        })
        .collect();

    let own: Vec<usize> =
        (0..jobs.len()).filter(|&index| extent.shard.is_none_or(|shard| shard.has(index))).collect();
    let mut todo: Vec<usize> = own.iter().copied().filter(|&index| !store.has(index)).collect();
    if experiment.sequential {
        let scene = |index: usize| index / (experiment.methods.len() * experiment.repetitions as usize);
        todo.sort_by_key(|&index| (scene(index), jobs[index].repetition));
    }
    // The trees that rays are traced through, by the number of their run.
    let trees = Mutex::new(BTreeMap::new());
    let finished = AtomicUsize::new(own.len() - todo.len());
    let watch = Watch { bar: progress(own.len() as u64, finished.load(Relaxed) as u64), interrupted };
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
    if finished < own.len() {
        return Err(Error::Interrupted { finished, runs: own.len() });
    }
    let provenance = Provenance::gather();
    if let Some(shard) = extent.shard {
        store.keep_shard(&to_toml(&provenance)?)?;
        let text = format!("{finished} runs, part {shard}; `harness merge` joins the parts.\n");
        return Ok(Summary { text, left_out });
    }
    if let Some(config) = &experiment.tracing {
        let trees = trees.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        trace(experiment, config, &jobs, trees, &watch, &store)?;
    }
    let text = conclude(&resolved, out, &provenance, store)?;
    Ok(Summary { text, left_out })
}

/// Joins the kept runs and makes the reports. Returns the text for the terminal.
pub(crate) fn conclude(
    resolved: &Resolved,
    out: &Path,
    provenance: &Provenance,
    store: Store,
) -> Result<String, Error> {
    store.join(resolved.experiment.runs().count() * resolved.scenes.len())?;
    let text = report(resolved, out, provenance, &store)?;
    store.write("provenance.toml", to_toml(provenance)?.as_bytes())?;
    store.finish()?;
    Ok(text)
}

/// Improves the best known costs and makes the reports of joined rows. Returns the text for the terminal.
fn report(resolved: &Resolved, out: &Path, provenance: &Provenance, store: &Store) -> Result<String, Error> {
    store.write("resolved.toml", to_toml(resolved)?.as_bytes())?;
    reference::update(resolved, out, &provenance.revision, store)?;
    report::write_all(&resolved.experiment.reports, store)
}

/// Makes the reports of finished runs again, with the references of now. Nothing is run: the spec must be the one that
/// the rows in `out/NAME/` come from, but for its reports.
pub fn report_again(experiment: &Experiment, out: &Path) -> Result<Summary, Error> {
    let (scenes, left_out) = experiment.load_scenes()?;
    let resolved = resolve(experiment, &scenes);
    let folder = out.join(&experiment.name);
    let refuse = |message: &str| Error::Usage(format!("{}: {message}", folder.display()));
    if store::is_unfinished(&folder) {
        return Err(refuse("the experiment was interrupted; finish it with --resume first"));
    }
    let read = |name: &str| {
        let path = folder.join(name);
        std::fs::read_to_string(&path).map_err(Error::io(&path, "read the file"))
    };
    let found = read("resolved.toml")?;
    let same_runs = toml::from_str(&found).is_ok_and(|found: Resolved| {
        let experiment = Experiment { reports: experiment.reports.clone(), ..found.experiment };
        Resolved { experiment, ..found } == resolved
    });
    if !same_runs {
        return Err(refuse("the rows come from another spec, scene or seed; run it again without --redraw"));
    }
    let store = Store::open(out, &experiment.name, &found, false)?;
    // What the rows have found, their program has found.
    let provenance: Provenance = toml::from_str(&read("provenance.toml")?)
        .map_err(|error| refuse(&format!("provenance.toml: {}", error.message())))?;
    let text = report(&resolved, out, &provenance, &store)?;
    store.finish()?;
    Ok(Summary { text, left_out })
}

/// Measures over the suite of stiff cases; always from the start.
fn over_suite(
    experiment: &Experiment,
    measure: &Measure,
    out: &Path,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    let resolved = to_toml(&resolve(experiment, &[]))?;
    let store = Store::open(out, &experiment.name, &resolved, false)?;
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
    Ok(Summary { text, left_out: vec![] })
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

/// What is proven of the scene's internal area: the exact optimum where gaps are measured from it, else a lower bound if
/// the experiment asks for one.
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
                let Labelled { label, method, .. } = job.labelled;
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
    let history: Vec<HistoryRow> = outcome.history.iter().map(row).collect();
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
    let refused = |message| Error::Scene { name: scene.name.clone(), message };
    let Built { tree, seconds } = peer.build(scene).map_err(refused)?;
    let (cost, work) = (objective.cost(&tree), tree.nodes.len() as u64);
    let event = Event { evaluations: 1, work, cost, incumbent: cost };
    stopwatch.note(seconds);
    let stop = StopReason::Completed;
    Ok((Outcome { tree, cost, evaluations: 1, work, stop, history: vec![event] }, seconds))
}

/// Contents of `resolved.toml`: the spec with every default spelled out, and which scenes it ran on.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Resolved {
    pub experiment: Experiment,
    pub scenes: Vec<LoadedScene>,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct LoadedScene {
    pub name: String,
    pub kind: String,
    pub objects: usize,
    pub checksum: String,
}

fn resolve(experiment: &Experiment, scenes: &[Scene]) -> Resolved {
    let loaded = |scene: &Scene| LoadedScene {
        name: scene.name.clone(),
        kind: scene.kind.into(),
        objects: scene.boxes.len(),
        checksum: format!("{:016x}", scene.checksum()),
    };
    Resolved { experiment: experiment.clone(), scenes: scenes.iter().map(loaded).collect() }
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
