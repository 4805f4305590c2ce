//! Traces rays through the trees of finished runs, and by the other libraries beside them.

use super::job::Job;
use super::measurement::{Measurement, Work};
use crate::Error;
use crate::contestant::Contestant;
use crate::measure::layout::own_contenders;
use crate::measure::speed::{self, Traced};
use crate::peers::{comparison, external};
use crate::rows::store::Store;
use crate::rows::{TimingRow, TraceRow, TraceTimeRow};
use crate::spec::Experiment;
use crate::statistics::median;
use bvh_core::Bvh;
use bvh_search::Observer;
use std::collections::{BTreeMap, BTreeSet};

/// Rays through the trees of first runs, timed against each other.
pub(crate) struct Tracing<'a>(pub &'a speed::Config);

impl Measurement for Tracing<'_> {
    fn whole_only(&self) -> Option<&'static str> {
        Some("rays are timed against each other, not in parts")
    }

    fn measure(&self, work: &mut Work) -> Result<String, Error> {
        work.complete_trees(|job| job.repetition == 0)?;
        trace(self.0, work)
    }
}

/// Traces rays through the trees of all first runs, scene by scene. Returns remarks about other libraries.
fn trace(config: &speed::Config, work: &Work) -> Result<String, Error> {
    let Work { experiment, jobs, trees, store, watch, .. } = work;
    let mut text = String::new();
    let mut programs = Vec::new();
    for program in &config.ray_peers {
        if program.exists() {
            programs.push(program);
        } else {
            let program = program.display();
            text +=
                &format!("Without {program}: it is not there; scripts/ray-peers/build makes it.\n");
        }
    }
    let mut traced = Vec::new();
    let first_runs = trees
        .iter()
        .map(|(&index, tree)| (&jobs[index], tree));
    let first_runs: Vec<(&Job, &Bvh)> = first_runs
        .filter(|(job, _)| job.repetition == 0)
        .collect();
    for of_scene in first_runs.chunk_by(|a, b| a.0.scene.name == b.0.scene.name) {
        let scene = of_scene[0].0.scene;
        let failed = |message| Error::Tracing { scene: scene.name.clone(), message };
        let mut contenders = Vec::new();
        for &(job, tree) in of_scene {
            let made = match &job.labelled.method {
                Contestant::Peer(peer) => peer.contenders(scene),
                Contestant::Ours(_) | Contestant::External(_) => {
                    let visits = job.visits(experiment, tree)?;
                    own_contenders(
                        &config.layouts,
                        &config.instructions,
                        scene,
                        tree,
                        visits.as_deref(),
                    )
                }
            };
            let made = made.map_err(failed)?;
            contenders.extend(
                made.into_iter()
                    .map(|contender| (job.labelled.label.clone(), contender)),
            );
        }
        for program in &programs {
            for (library, contender) in external::contenders(program, scene).map_err(failed)? {
                // A processor without AVX-512 makes all programs the same.
                if !contenders
                    .iter()
                    .any(|(known, other)| *known == library && other.is_called_as(&contender))
                {
                    contenders.push((library, contender));
                }
            }
        }
        let seed = experiment.seed_of(&scene.name, "tracing", 0);
        let measured =
            speed::measure(config, scene, of_scene[0].1, &contenders, seed, || watch.cancelled());
        traced.extend(
            measured
                .map_err(failed)?
                .ok_or_else(|| work.interrupted())?,
        );
    }
    if !config.ray_peers.is_empty() {
        let search_seconds = search_seconds(&first_runs, jobs, store)?;
        let seconds_of =
            |scene: &str, label: &str| search_seconds[&(scene.to_owned(), label.to_owned())];
        let speeds = comparison::speeds(&traced, |label| library(experiment, label), seconds_of);
        store.write_rows(&comparison::rows(&speeds))?;
        let ratios = comparison::ratios(&speeds);
        store.write_rows(&ratios)?;
        text += &comparison::text(&ratios);
    }
    // Other rows are compared with committed ones. They must depend neither on a program that may be missing nor on the
    // instruction sets of this processor.
    let is_ours = |traced: &Traced| {
        experiment
            .methods
            .iter()
            .any(|method| method.label == traced.answers.method)
    };
    let mut seen = BTreeSet::new();
    traced.retain(|traced| {
        let TraceRow { scene, method, layout, rays, .. } = &traced.answers;
        is_ours(traced) && seen.insert([scene, method, layout, rays].map(String::clone))
    });
    let (rows, times): (Vec<TraceRow>, Vec<TraceTimeRow>) = traced
        .into_iter()
        .map(|traced| (traced.answers, traced.times))
        .unzip();
    store.write_rows(&rows)?;
    store.write_rows(&times)?;
    Ok(text)
}

/// The median seconds of a method's runs on a scene, by scene and label.
fn search_seconds(
    first_runs: &[(&Job, &Bvh)],
    jobs: &[Job],
    store: &Store,
) -> Result<BTreeMap<(String, String), f64>, Error> {
    let mut seconds: BTreeMap<(String, String), Vec<f64>> = BTreeMap::new();
    for index in 0..jobs.len() {
        for TimingRow { scene, method, seconds: of_run, .. } in store.rows::<TimingRow>(index)? {
            seconds
                .entry((scene, method))
                .or_default()
                .push(of_run);
        }
    }
    let of_run = |(job, _): &(&Job, &Bvh)| {
        let run = (job.scene.name.clone(), job.labelled.label.clone());
        let middle = seconds
            .get(&run)
            .and_then(|seconds| median(seconds))
            .unwrap_or(f64::NAN);
        (run, middle)
    };
    Ok(first_runs.iter().map(of_run).collect())
}

/// The library behind a label: ours, the library of a method, or else a library of the program.
fn library(experiment: &Experiment, label: &str) -> String {
    match experiment
        .methods
        .iter()
        .find(|method| method.label == label)
        .map(|found| &found.method)
    {
        Some(Contestant::Ours(_)) => comparison::OURS.into(),
        Some(Contestant::Peer(peer)) => peer.name().into(),
        Some(Contestant::External(_)) | None => label.into(),
    }
}
