//! Traces rays through the trees of finished runs, and by the other libraries beside them.

use crate::Error;
use crate::measure::speed;
use crate::peers::{comparison, external};
use crate::run::job::{Job, Watch, perform, visits};
use crate::run::store::Store;
use crate::spec::{Contestant, Experiment};
use bvh_core::Bvh;
use bvh_search::Observer;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// The trees that rays are traced through, by the number of their run.
pub(crate) type Trees = BTreeMap<usize, Bvh>;

/// Traces rays through the trees of all first runs, scene by scene. Rebuilds the trees of runs that were kept from an
/// interrupted experiment. Returns what there is to say about other libraries.
pub(crate) fn trace(
    experiment: &Experiment,
    config: &speed::Config,
    jobs: &[Job],
    trees: &mut Trees,
    watch: &Watch,
    store: &Store,
) -> Result<String, Error> {
    let interrupted = || Error::Interrupted { finished: jobs.len(), runs: jobs.len() };
    complete(trees, experiment, jobs, watch, |job| job.repetition == 0)?;
    let mut text = String::new();
    let program = config.ray_peers.as_deref().filter(|program| {
        if !program.exists() {
            text = format!(
                "Without Embree and tinybvh: {} is not there; scripts/ray-peers/build makes it.\n",
                program.display()
            );
        }
        program.exists()
    });
    let (mut rows, mut times) = (Vec::new(), Vec::new());
    let first_runs = trees.iter().map(|(&index, tree)| (&jobs[index], tree));
    let first_runs: Vec<(&Job, &Bvh)> = first_runs.filter(|(job, _)| job.repetition == 0).collect();
    for of_scene in first_runs.chunk_by(|a, b| a.0.scene.name == b.0.scene.name) {
        let scene = of_scene[0].0.scene;
        let failed = |message| Error::Tracing { scene: scene.name.clone(), message };
        let mut contenders = Vec::new();
        for &(job, tree) in of_scene {
            let made = match &job.labelled.method {
                Contestant::Peer(peer) => peer.contenders(scene),
                Contestant::Ours(_) | Contestant::External(_) => {
                    let visits = visits(experiment, job, tree)?;
                    speed::own_contenders(&config.layouts, scene, tree, visits.as_deref())
                }
            };
            let made = made.map_err(failed)?;
            contenders.extend(made.into_iter().map(|contender| (job.labelled.label.clone(), contender)));
        }
        if let Some(program) = program {
            contenders.extend(external::contenders(program, scene).map_err(failed)?);
        }
        let seed = experiment.seed_of(&scene.name, "tracing", 0);
        let measured = speed::measure(config, scene, of_scene[0].1, &contenders, seed, || watch.cancelled());
        let (scene_rows, scene_times) = measured.map_err(failed)?.ok_or_else(interrupted)?;
        rows.extend(scene_rows);
        times.extend(scene_times);
    }
    if config.ray_peers.is_some() {
        let compared = comparison::rows(&rows, &times, |label| library(experiment, label));
        store.write_rows(&compared)?;
        let ratios = comparison::ratios(&compared);
        store.write_rows(&ratios)?;
        text += &comparison::text(&ratios);
    }
    // The other rows are compared with committed ones, so they must not depend on a program that may be missing.
    rows.retain(|row| experiment.methods.iter().any(|method| method.label == row.method));
    store.write_rows(&rows)?;
    store.write_rows(&times)?;
    Ok(text)
}

/// Rebuilds those of the wanted trees that are missing, because their runs were kept from an interrupted experiment.
pub(crate) fn complete(
    trees: &mut Trees,
    experiment: &Experiment,
    jobs: &[Job],
    watch: &Watch,
    wanted: impl Fn(&Job) -> bool,
) -> Result<(), Error> {
    let interrupted = || Error::Interrupted { finished: jobs.len(), runs: jobs.len() };
    for (index, job) in jobs.iter().enumerate().filter(|(_, job)| wanted(job)) {
        if let Entry::Vacant(missing) = trees.entry(index) {
            missing.insert(perform(experiment, job, watch)?.ok_or_else(interrupted)?.1);
        }
    }
    Ok(())
}

/// The library behind a label: ours, the library of a method, or else a library of the program.
fn library(experiment: &Experiment, label: &str) -> String {
    match experiment.methods.iter().find(|method| method.label == label).map(|found| &found.method) {
        Some(Contestant::Ours(_)) => comparison::OURS.into(),
        Some(Contestant::Peer(peer)) => peer.name().into(),
        Some(Contestant::External(_)) | None => label.into(),
    }
}
