//! Traces rays through the trees of finished runs and, for comparison, with third-party libraries.

use super::job::{Job, tracing_error};
use super::work::Work;
use crate::Error;
use crate::contestant::Contestant;
use crate::measure::layout::own_contenders;
use crate::measure::speed::{self, Traced};
use crate::peers::{OURS, Race, Raced, race};
use crate::rows::{TimingRow, TraceRow, TraceTimeRow};
use crate::spec::Experiment;
use crate::statistics::median;
use bvh_core::Bvh;
use bvh_search::Observer;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Traces rays through the trees of first runs, timed in interleaved rounds. Returns the text for
/// the terminal.
pub(crate) fn measure(config: &speed::Config, work: &mut Work) -> Result<String, Error> {
    work.complete_trees(|job| job.repetition == 0)?;
    let (programs, mut text) = ray_programs(config);
    let first_runs: Vec<Run> = work
        .trees
        .iter()
        .map(|(&index, tree)| (&work.jobs[index], tree))
        .filter(|(job, _)| job.repetition == 0)
        .collect();
    let mut traced = Vec::new();
    for runs in first_runs.chunk_by(|a, b| a.0.scene.name == b.0.scene.name) {
        traced.extend(trace_scene(config, work, runs, &programs)?);
    }
    if let Some(race) = race().filter(|_| !config.ray_peers.is_empty()) {
        text += &compare_libraries(race, work, &first_runs, &traced)?;
    }
    write_rows(work, traced)?;
    Ok(text)
}

/// A run and its tree.
type Run<'a> = (&'a Job<'a>, &'a Bvh);

/// Returns the ray programs of other libraries that exist, and remarks on the missing ones.
fn ray_programs(config: &speed::Config) -> (Vec<&PathBuf>, String) {
    let (found, missing): (Vec<_>, Vec<_>) = config
        .ray_peers
        .iter()
        // A missing program must not end hours of measurements, so a remark names it.
        .partition(|program| program.exists());
    let remarks = missing.iter().map(|program| {
        let program = program.display();
        format!("Without {program}: it does not exist; scripts/ray-peers/build makes it.\n")
    });
    (found, remarks.collect())
}

/// Traces rays through the first trees of all methods on a scene, and with the ray programs.
fn trace_scene(
    config: &speed::Config,
    work: &Work,
    runs: &[Run],
    programs: &[&PathBuf],
) -> Result<Vec<Traced>, Error> {
    let experiment = work.experiment;
    let (first_job, first_tree) = runs[0];
    let scene = first_job.scene;
    let triangles = || scene.triangles().map_err(|error| error.to_string());
    let mut contenders = Vec::new();
    for &(job, tree) in runs {
        let made = match &job.labelled.method {
            Contestant::Peer(peer) => triangles().and_then(|all| peer.contenders(all)),
            Contestant::Ours(_) | Contestant::External(_) => {
                let visits = job.visits(experiment, tree)?;
                let visits = visits.as_deref();
                own_contenders(&config.layouts, &config.instructions, scene, tree, visits)
            }
        };
        let made = made.map_err(tracing_error(scene))?;
        contenders
            .extend(made.into_iter().map(|contender| (job.labelled.label.clone(), contender)));
    }
    if let Some(race) = race() {
        for program in programs {
            let made = triangles().and_then(|all| race.start(program, all));
            for (library, contender) in made.map_err(tracing_error(scene))? {
                // A processor without AVX-512 makes all programs the same.
                let is_known = contenders
                    .iter()
                    .any(|(known, other)| *known == library && other.is_called_as(&contender));
                if !is_known {
                    contenders.push((library, contender));
                }
            }
        }
    }
    // All methods of a scene get the same rays.
    let seed = experiment.seed_of(&scene.name, "tracing", 0);
    speed::measure(config, scene, first_tree, &contenders, seed, || work.watch.cancelled())
        .map_err(tracing_error(scene))?
        .ok_or_else(|| work.interrupted())
}

/// Writes the speeds of all libraries and the ratios between them. Returns the ratios' table.
fn compare_libraries(
    race: &dyn Race,
    work: &Work,
    first_runs: &[Run],
    traced: &[Traced],
) -> Result<String, Error> {
    let seconds = search_seconds(first_runs, work)?;
    let raced: Vec<Raced> = traced
        .iter()
        .map(|traced| {
            let TraceRow { scene, method, .. } = &traced.answers;
            let search_seconds = seconds.get(&(scene.clone(), method.clone()));
            Raced {
                library: library(work.experiment, method),
                search_seconds: search_seconds.copied().unwrap_or(f64::NAN),
                traced,
            }
        })
        .collect();
    let (files, text) = race.compare(&raced)?;
    for (name, bytes) in files {
        work.store.write(name, &bytes)?;
    }
    Ok(text)
}

/// Writes the rows of the experiment's methods.
fn write_rows(work: &Work, traced: Vec<Traced>) -> Result<(), Error> {
    // These rows are compared with committed ones. They must depend neither on a program that may
    // be missing nor on the instruction sets of this processor.
    let labels: Vec<&str> =
        work.experiment.methods.iter().map(|method| method.label.as_str()).collect();
    let mut seen = BTreeSet::new();
    let mut rows = Vec::new();
    let mut times = Vec::new();
    for Traced { answers, times: row_times, .. } in traced {
        let TraceRow { scene, method, layout, rays, .. } = &answers;
        let key = [scene, method, layout, rays].map(String::clone);
        if labels.contains(&method.as_str()) && seen.insert(key) {
            rows.push(answers);
            times.push(row_times);
        }
    }
    work.store.write_rows::<TraceRow>(&rows)?;
    work.store.write_rows::<TraceTimeRow>(&times)
}

/// Returns the median seconds of a method's runs on a scene, by scene and label.
fn search_seconds(
    first_runs: &[Run],
    work: &Work,
) -> Result<BTreeMap<(String, String), f64>, Error> {
    let mut seconds: BTreeMap<(String, String), Vec<f64>> = BTreeMap::new();
    for index in 0..work.jobs.len() {
        for row in work.store.rows::<TimingRow>(index)? {
            seconds.entry((row.scene, row.method)).or_default().push(row.seconds);
        }
    }
    let medians = first_runs.iter().map(|(job, _)| {
        let key = (job.scene.name.clone(), job.labelled.label.clone());
        let median = seconds.get(&key).and_then(|seconds| median(seconds)).unwrap_or(f64::NAN);
        (key, median)
    });
    Ok(medians.collect())
}

/// Returns the library behind a label: ours, a method's library, or a library of a ray program.
fn library(experiment: &Experiment, label: &str) -> String {
    let labelled = experiment.methods.iter().find(|method| method.label == label);
    match labelled.map(|labelled| &labelled.method) {
        Some(Contestant::Ours(_)) => OURS.into(),
        Some(Contestant::Peer(peer)) => peer.name().into(),
        Some(Contestant::External(_)) | None => label.into(),
    }
}
