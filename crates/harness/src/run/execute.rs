//! Executes an experiment: opens its folder, performs its measurements and makes its reports.

use super::finish::{Summary, conclude};
use super::job::{Job, base_costs, selected};
use super::perform::{Trees, Watch, Work};
use super::resolved::{Resolved, finished, load_scenes, to_toml};
use super::runs;
use super::{ray_cost, trace};
use crate::Error;
use crate::rows::finished_run::RunName;
use crate::rows::store::{Existing, Store};
use crate::spec::Experiment;
use crate::stress;
use bvh_search::Observer;
use indicatif::{ProgressBar, ProgressStyle};
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
    // Without the key the program's pool serves, which `--jobs` has sized.
    let Some(threads) = experiment.threads else {
        return run(experiment, out, extent, interrupted);
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.into())
        .build()
        .map_err(|error| Error::Usage(format!("threads = {threads}: {error}")))?;
    pool.install(|| run(experiment, out, extent, interrupted))
}

/// Returns an error if several processes cannot share the experiment.
pub fn reject_indivisible(experiment: &Experiment) -> Result<(), Error> {
    let reason = if experiment.suite.is_some() {
        "the suite of cases cannot be split"
    } else if experiment.tracing.is_some() {
        "ray times are compared within one process"
    } else if experiment.judges().is_some() {
        "rays judge all trees of a scene together"
    } else {
        return Ok(());
    };
    Err(Error::Usage(format!("{}: {reason}; run it without --run", experiment.name)))
}

fn run(
    experiment: &Experiment,
    out: &Path,
    extent: &Extent,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    let Extent { existing, runs: ref ids, ref parts } = *extent;
    let is_part = !ids.is_empty();
    let (scenes, skipped_scenes) = load_scenes(experiment)?;
    let resolved = Resolved::new(experiment, &scenes);
    let folder = out.join(experiment.folder());
    if is_finished(&folder, &resolved, existing, is_part)? {
        let text = "All runs are finished; nothing was done. \
                    --force repeats them, --redraw makes the reports again.\n";
        return Ok(Summary { text: text.into(), skipped_scenes, folder, ..Summary::default() });
    }
    // Neither an unknown identifier nor a base that cannot be built leaves a folder.
    let jobs = selected(experiment, &scenes, ids)?;
    let bases = base_costs(&experiment.objective, &jobs)?;
    let parts: Vec<PathBuf> = parts.iter().map(|out| out.join(experiment.folder())).collect();
    // A part that is discarded or finished would lose its runs. Symbolic links and `..` may hide
    // that two paths are the same folder.
    if let Ok(folder) = folder.canonicalize()
        && parts.iter().any(|part| part.canonicalize().is_ok_and(|part| part == folder))
    {
        let out = out.display();
        return Err(Error::Usage(format!("--out {out} is also one of the parts; choose another")));
    }
    let store = Store::open(&folder, &to_toml(&resolved)?, existing)?;
    let runs = jobs.len();
    let mut remarks: Vec<String> = scenes.iter().filter_map(|scene| scene.remark.clone()).collect();
    // The subsets of one mesh share its remark.
    remarks.dedup();
    let names: Vec<RunName> = jobs.iter().map(Job::name).collect();
    for part in &parts {
        store.adopt(part, &names)?;
    }
    let mut work = Work {
        experiment,
        bases,
        jobs: &jobs,
        store: &store,
        watch: Watch { bar: progress(runs as u64), interrupted },
        trees: Trees::new(),
        remarks,
    };
    let mut text = String::new();
    if let Some(effort) = &experiment.suite {
        let cancelled = || work.watch.cancelled();
        stress::execute(effort, &experiment.scenes, &experiment.methods, &store, &cancelled)?;
    } else {
        runs::measure(&mut work)?;
        if let Some(config) = &experiment.tracing {
            text += &trace::measure(config, &mut work)?;
        }
        if let Some(config) = experiment.judges() {
            ray_cost::measure(config, &mut work)?;
        }
    }
    let mut remarks = work.remarks;
    if is_part {
        let text = format!("{runs} runs; `harness merge` joins the parts.\n");
        return Ok(Summary { text, skipped_scenes, remarks, folder });
    }
    let (tables, remark) = conclude(&resolved, out, store)?;
    let text = tables + &text;
    remarks.extend(remark);
    Ok(Summary { text, skipped_scenes, remarks, folder })
}

/// Returns true if a folder already holds all requested results.
///
/// Finished results may also cover optional scenes that are missing now. Resuming them leaves
/// nothing to do.
///
/// # Errors
///
/// If the folder holds finished results that are neither replaced nor resumed.
fn is_finished(
    folder: &Path,
    resolved: &Resolved,
    existing: Existing,
    is_part: bool,
) -> Result<bool, Error> {
    let recorded = if existing == Existing::Replace { None } else { finished(folder)? };
    let Some(text) = recorded else { return Ok(false) };
    let is_same = toml::from_str(&text).is_ok_and(|found| resolved.repeats(&found));
    let found = match (is_same, existing == Existing::Resume && !is_part) {
        (true, true) => return Ok(true),
        (true, false) => "finished results",
        (false, _) => "the results of another spec, scene or seed",
    };
    let folder = folder.display();
    let message = format!("{folder} has {found}, --force replaces them, another --out keeps them");
    Err(Error::Usage(message))
}

/// Creates a bar that shows the time left; it is hidden unless standard error is a terminal.
fn progress(runs: u64) -> ProgressBar {
    let bar = ProgressBar::new(runs);
    let template = "{msg} {wide_bar} {pos}/{len} runs, {eta} left";
    bar.set_style(
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar
}
