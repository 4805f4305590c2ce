//! Carries out the runs of an experiment: in parallel or one by one, with progress, until done or interrupted.

use crate::report;
use crate::run::job::{Job, Watch, base_cost, perform};
use crate::run::merge::Shard;
use crate::run::provenance::Provenance;
use crate::run::rows::to_bytes;
use crate::run::store::Store;
use crate::scenes::Scene;
use crate::spec::{Contestant, Experiment, Labelled};
use crate::stress::Measure;
use crate::{Error, measure, run::reference, run::store};
use bvh_core::Bvh;
use bvh_search::Observer;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};

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
    /// Do these runs only, and leave them to be [merged](crate::run::merge::merge).
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

/// Traces rays through the trees of all first runs, scene by scene. Trees of runs that were kept from an interrupted
/// experiment are made again.
fn trace(
    experiment: &Experiment,
    config: &measure::Config,
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
        let entries: Vec<measure::Entry> = of_scene
            .iter()
            .map(|&(job, tree)| {
                let Labelled { label, method, .. } = job.labelled;
                let peer = if let Contestant::Peer(peer) = method { Some(peer) } else { None };
                measure::Entry { method: label, tree, peer }
            })
            .collect();
        let seed = experiment.seed_of(&scene.name, "tracing", 0);
        let measured = measure::measure(config, scene, &entries, seed, || watch.cancelled())
            .map_err(|message| Error::Scene { name: scene.name.clone(), message })?;
        let (scene_rows, scene_times) = measured.ok_or_else(interrupted)?;
        rows.extend(scene_rows);
        times.extend(scene_times);
    }
    store.write("traversal.csv", &to_bytes(&rows, Path::new("traversal.csv"))?)?;
    store.write("timing_traversal.csv", &to_bytes(&times, Path::new("timing_traversal.csv"))?)
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
