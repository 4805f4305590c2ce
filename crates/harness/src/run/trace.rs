//! The measurement of rays through the trees of first runs, timed by the program in `attic/`.

use super::finish::Summary;
use super::jobs::{Job, Jobs};
use super::runs::with_trees;
use crate::Error;
use crate::contestant::Contestant;
use crate::peers::{self, FirstRun};
use crate::rows::TimingRow;
use crate::rows::store::Store;
use crate::statistics::median;
use bvh_search::Observer;
use toml::Table;

/// Writes the files of the times.
pub(crate) fn measure(
    keys: &Table,
    jobs: &Jobs,
    store: &Store,
    summary: &mut Summary,
) -> Result<(), Error> {
    let others = peers::others("tracing").map_err(|fault| Error::Usage(fault.to_string()))?;
    let first_runs = with_trees(jobs, |job| job.repetition == 0)?;
    let mut runs = Vec::new();
    for (job, tree) in &first_runs {
        let peer = match &job.labelled.method {
            Contestant::Peer(peer) => Some(peer),
            Contestant::Ours(_) => None,
        };
        runs.push(FirstRun {
            scene: job.scene,
            label: &job.labelled.label,
            peer,
            tree,
            visits: job.visits(jobs.experiment, tree)?,
            search_seconds: search_seconds(job, jobs, store)?,
            seed: jobs.experiment.seed_of(&job.scene.name, "tracing", 0),
        });
    }
    let traced = (others.tracing.trace)(keys, &runs, &|| jobs.watch.cancelled())?;
    let (files, text) = traced.ok_or_else(|| jobs.interrupted())?;
    for (name, bytes) in files {
        store.write(name, &bytes)?;
    }
    summary.text += &text;
    Ok(())
}

/// Returns the median seconds of a method's runs on a scene.
fn search_seconds(job: &Job, jobs: &Jobs, store: &Store) -> Result<f64, Error> {
    let mut seconds = Vec::new();
    for other in &jobs.list {
        let name = other.name();
        if (&name.scene, &name.method) == (&job.scene.name, &job.labelled.label)
            && let Some(run) = store.kept(other.index, &name)?
        {
            seconds.extend(run.rows::<TimingRow>()?.iter().map(|row| row.seconds));
        }
    }
    Ok(median(&seconds).unwrap_or(f64::NAN))
}
