//! Rays through the trees of first runs, timed by the program in `attic/`.

use super::job::Job;
use super::perform::Work;
use crate::Error;
use crate::contestant::Contestant;
use crate::peers::{self, FirstRun};
use crate::rows::TimingRow;
use crate::statistics::median;
use bvh_search::Observer;
use toml::Table;

/// Writes the files of the times, and returns the text for the terminal.
pub(crate) fn measure(keys: &Table, work: &mut Work) -> Result<String, Error> {
    let others = peers::others("tracing").map_err(|fault| Error::Usage(fault.to_string()))?;
    work.complete_trees(|job| job.repetition == 0)?;
    let mut runs = Vec::new();
    for (&index, tree) in &work.trees {
        let job = &work.jobs[index];
        if job.repetition > 0 {
            continue;
        }
        let peer = match &job.labelled.method {
            Contestant::Peer(peer) => Some(peer),
            Contestant::Ours(_) => None,
        };
        runs.push(FirstRun {
            scene: job.scene,
            label: &job.labelled.label,
            peer,
            tree,
            visits: job.visits(work.experiment, tree)?,
            search_seconds: search_seconds(job, work)?,
            seed: work.experiment.seed_of(&job.scene.name, "tracing", 0),
        });
    }
    let traced = others.tracing.trace(keys, &runs, &|| work.watch.cancelled())?;
    let (files, text) = traced.ok_or_else(|| work.interrupted())?;
    for (name, bytes) in files {
        work.store.write(name, &bytes)?;
    }
    Ok(text)
}

/// Returns the median seconds of a method's runs on a scene.
fn search_seconds(job: &Job, work: &Work) -> Result<f64, Error> {
    let mut seconds = Vec::new();
    for (index, other) in work.jobs.iter().enumerate() {
        if other.scene.name == job.scene.name && other.labelled.label == job.labelled.label {
            let rows: Vec<TimingRow> = match work.store.kept(index, &other.name())? {
                Some(run) => run.rows()?,
                None => vec![],
            };
            seconds.extend(rows.iter().map(|row| row.seconds));
        }
    }
    Ok(median(&seconds).unwrap_or(f64::NAN))
}
