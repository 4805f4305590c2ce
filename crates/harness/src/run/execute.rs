//! Executes an experiment: opens its folder, takes its measurements and concludes with its reports.

use super::finish::{Summary, conclude};
use super::jobs::{Job, Jobs};
use super::measurement::Measurement;
use super::resolved::Resolved;
use crate::Error;
use crate::rows::kept_run::RunName;
use crate::rows::store::{Existing, Store};
use crate::spec::Experiment;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// The part of an experiment to execute.
#[derive(Clone, Debug, Default)]
pub struct Extent {
    /// The treatment of existing results.
    pub existing: Existing,
    /// The identifiers of the runs to perform, which are kept for a harness that joins the parts;
    /// none for all runs.
    pub runs: Vec<String>,
    /// The `--out` of harnesses that have performed parts of the experiment, whose runs are taken.
    pub parts: Vec<PathBuf>,
}

/// Runs `experiment` into `out/NAME/`. Once `interrupted` is true, unfinished runs are abandoned
/// and finished ones are kept.
pub fn execute(
    experiment: &Experiment,
    out: &Path,
    extent: &Extent,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    if !extent.runs.is_empty() {
        reject_indivisible(experiment)?;
    }
    let run = || run(experiment, out, extent, interrupted);
    // Without the key the program's pool serves, which `--jobs` has sized.
    let Some(threads) = experiment.threads else { return run() };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.into())
        .build()
        .map_err(|error| Error::Usage(format!("threads = {threads}: {error}")))?;
    pool.install(run)
}

/// Returns an error if several processes cannot share the experiment.
pub fn reject_indivisible(experiment: &Experiment) -> Result<(), Error> {
    match experiment.measurements().iter().find_map(Measurement::indivisible) {
        Some(reason) => {
            Err(Error::Usage(format!("{}: {reason}; run it without --run", experiment.name)))
        }
        None => Ok(()),
    }
}

fn run(
    experiment: &Experiment,
    out: &Path,
    extent: &Extent,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    let Extent { existing, runs: ref ids, ref parts } = *extent;
    let is_part = !ids.is_empty();
    let (scenes, skipped_scenes) = experiment.load_scenes()?;
    let resolved = Resolved::new(experiment, &scenes);
    let folder = out.join(experiment.folder());
    let mut summary = Summary { skipped_scenes, folder, ..Summary::default() };
    if resolved.is_finished(&summary.folder, existing, is_part)? {
        summary.text = "All runs are finished; nothing was done. \
                        --force repeats them, --redraw makes the reports again.\n"
            .into();
        return Ok(summary);
    }
    // Neither an unknown identifier nor a base that cannot be built leaves a folder.
    let jobs = Jobs::new(experiment, &scenes, ids, interrupted)?;
    let parts: Vec<PathBuf> = parts.iter().map(|part| part.join(experiment.folder())).collect();
    reject_own_part(&summary.folder, out, &parts)?;
    let store = Store::open(&summary.folder, &resolved, existing)?;
    let names: Vec<RunName> = jobs.list.iter().map(Job::name).collect();
    for part in &parts {
        store.adopt(part, &names)?;
    }
    summary.remarks.extend(scenes.iter().filter_map(|scene| scene.remark.clone()));
    // The subsets of one mesh share its remark.
    summary.remarks.dedup();
    for measurement in experiment.measurements() {
        measurement.take(&jobs, &store, &mut summary)?;
    }
    if is_part {
        summary.text = format!("{} runs; `harness merge` joins the parts.\n", jobs.list.len());
        return Ok(summary);
    }
    conclude(&resolved, out, store, &mut summary)?;
    Ok(summary)
}

/// Returns an error if a part, which would lose its runs if it is discarded or finished, is also the
/// experiment's folder in `out`. Symbolic links and `..` may hide that two paths are the same folder.
fn reject_own_part(folder: &Path, out: &Path, parts: &[PathBuf]) -> Result<(), Error> {
    if let Ok(folder) = folder.canonicalize()
        && parts.iter().any(|part| part.canonicalize().is_ok_and(|part| part == folder))
    {
        let out = out.display();
        return Err(Error::Usage(format!("--out {out} is also one of the parts; choose another")));
    }
    Ok(())
}
