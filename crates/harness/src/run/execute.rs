//! Executes an experiment: opens its folder, performs its measurements and makes its reports.

use super::finish::{Summary, conclude};
use super::job::Job;
use super::measurement::{Measurement, Trees, Work};
use super::perform::Watch;
use super::provenance::Provenance;
use super::ray_cost::Judging;
use super::resolved::{Resolved, load_scenes, to_toml};
use super::runs::Runs;
use super::selection::Selection;
use super::suite::Suite;
use super::target;
use super::trace::Tracing;
use crate::Error;
use crate::rows::store::{self, Existing, Store};
use crate::spec::Experiment;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// The part of an experiment to execute.
#[derive(Clone, Debug, Default)]
pub struct Extent {
    /// The treatment of existing results.
    pub existing: Existing,
    /// The runs to perform. Those of a part are kept for a harness that joins the parts.
    pub selection: Selection,
    /// The `--out` of harnesses that have performed parts of the experiment.
    pub parts: Vec<PathBuf>,
    /// True for a line on standard error about every run.
    pub verbose: bool,
}

/// Runs `experiment` into `out/NAME/`. Once `interrupted` is true, unfinished runs are abandoned
/// and finished ones are kept.
pub fn execute(
    experiment: &Experiment,
    out: &Path,
    extent: &Extent,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    if extent.selection.is_part() {
        reject_indivisible(experiment)?;
    }
    let measurements = measurements(experiment);
    // Without the key the program's pool serves, which `--jobs` has sized.
    let Some(threads) = experiment.threads else {
        return run(experiment, &measurements, out, extent, interrupted);
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.into())
        .build()
        .map_err(|error| Error::Usage(format!("threads = {threads}: {error}")))?;
    pool.install(|| run(experiment, &measurements, out, extent, interrupted))
}

/// Returns an error if several processes cannot share the experiment.
pub fn reject_indivisible(experiment: &Experiment) -> Result<(), Error> {
    let reason = measurements(experiment).iter().find_map(|measurement| measurement.indivisible());
    match reason {
        Some(reason) => Err(Error::Usage(format!("{}: {reason}", experiment.name))),
        None => Ok(()),
    }
}

/// Returns the measurements of an experiment in their order: later ones use the trees of the runs.
fn measurements(experiment: &Experiment) -> Vec<Box<dyn Measurement + Sync + '_>> {
    if let Some(measure) = &experiment.suite {
        return vec![Box::new(Suite(measure))];
    }
    let mut measurements: Vec<Box<dyn Measurement + Sync>> = vec![Box::new(Runs)];
    if let Some(config) = &experiment.tracing {
        measurements.push(Box::new(Tracing(config)));
    }
    if let Some(config) = experiment.judges() {
        measurements.push(Box::new(Judging(config)));
    }
    measurements
}

fn run(
    experiment: &Experiment,
    measurements: &[Box<dyn Measurement + Sync + '_>],
    out: &Path,
    extent: &Extent,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    let Extent { existing, ref selection, ref parts, verbose } = *extent;
    let is_part = selection.is_part();
    let (scenes, skipped_scenes) = load_scenes(experiment)?;
    let resolved = Resolved::new(experiment, &scenes);
    let (folder, is_finished) = target::choose(out, &resolved, existing, is_part)?;
    if is_finished {
        store::remove_leftovers(&folder)?;
        return Ok(Summary { skipped_scenes, ..Summary::finished(folder) });
    }
    // An unknown identifier must not leave a folder.
    let jobs = Job::selected(experiment, &scenes, selection)?;
    let store = Store::open(&folder, &to_toml(&resolved)?, existing)?;
    let runs = jobs.len();
    if is_part {
        // Before the runs, because a killed part may be resumed on another machine.
        Provenance::add_to_part(&folder)?;
    }
    let mut remarks: Vec<String> = scenes.iter().filter_map(|scene| scene.remark.clone()).collect();
    // The subsets of one mesh share its remark.
    remarks.dedup();
    let mut provenance = Provenance::gather();
    for part in parts.iter().map(|out| out.join(experiment.folder())) {
        store.adopt(&part, runs)?;
        provenance.parts.extend(Provenance::of_part(&part)?);
    }
    remarks.extend(provenance.unlike_processors());
    let mut work = Work {
        experiment,
        jobs: &jobs,
        store: &store,
        watch: Watch { bar: progress(runs as u64), interrupted },
        verbose,
        trees: Trees::new(),
        remarks,
    };
    let mut text = String::new();
    for measurement in measurements {
        text += &measurement.measure(&mut work)?;
    }
    let remarks = work.remarks;
    if is_part {
        let text = format!("{runs} runs; `--from` joins the parts.\n");
        return Ok(Summary { text, skipped_scenes, remarks, folder });
    }
    let text = conclude(&resolved, out, &provenance, store)? + &text;
    Ok(Summary { text, skipped_scenes, remarks, folder })
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
