//! Executes an experiment: opens its folder, carries out its measurements, and concludes.

use super::clocked::ClockedPeers;
use super::finish::{Summary, conclude};
use super::job::Job;
use super::measurement::{Measurement, Trees, Work};
use super::perform::Watch;
use super::provenance::Provenance;
use super::ray_cost::Judging;
use super::reference::BestKnown;
use super::resolved::{Resolved, load_scenes, to_toml};
use super::runs::Runs;
use super::shard::Shard;
use super::suite::Suite;
use super::target::Target;
use super::trace::Tracing;
use crate::Error;
use crate::rows::store::{Existing, Store};
use crate::spec::Experiment;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::Path;
use std::sync::atomic::AtomicBool;

pub use super::measurement::Said;

/// How much of an experiment is to be done.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extent {
    /// What happens to the results that are there already.
    pub existing: Existing,
    /// Do these runs only, and leave them to be [merged](crate::run::merge::merge).
    pub shard: Option<Shard>,
    /// What is said of the runs on standard error.
    pub said: Said,
}

/// Runs `experiment` into `out/NAME/`. As soon as `interrupted` becomes true, the unfinished runs are given up and the
/// finished ones are kept.
pub fn execute(
    experiment: &Experiment,
    out: &Path,
    extent: Extent,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    let measurements = measurements(experiment);
    let whole_only = measurements
        .iter()
        .find_map(|measurement| measurement.whole_only());
    if let Some(why) = whole_only.filter(|_| extent.shard.is_some()) {
        return Err(Error::Usage(format!("{}: {why}", experiment.name)));
    }
    let run = || run(experiment, &measurements, out, extent, interrupted);
    let Some(threads) = experiment.threads else { return run() };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.into())
        .build();
    let pool = pool.map_err(|error| Error::Usage(format!("threads = {threads}: {error}")))?;
    pool.install(run)
}

/// The measurements that an experiment asks for, in their order: later ones use the runs of the first.
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
    if let Some(program) = &experiment.tinybvh {
        measurements.push(Box::new(ClockedPeers(program)));
    }
    measurements
}

fn run(
    experiment: &Experiment,
    measurements: &[Box<dyn Measurement + Sync + '_>],
    out: &Path,
    extent: Extent,
    interrupted: &AtomicBool,
) -> Result<Summary, Error> {
    let Extent { existing, shard, said } = extent;
    let (scenes, left_out) = load_scenes(experiment)?;
    let resolved = Resolved::new(experiment, &scenes);
    let Target { folder, beside, is_finished } =
        Target::choose(out, &resolved, existing, shard.is_some())?;
    if is_finished {
        return Ok(Summary { left_out, ..Summary::finished(folder) });
    }
    let store = Store::open(&folder, &to_toml(&resolved)?, existing)?;
    let jobs = Job::all(experiment, &scenes)?;
    let is_own = |index: &usize| shard.is_none_or(|shard| shard.has(*index));
    let own: Vec<usize> = (0..jobs.len()).filter(is_own).collect();
    let runs = own.len();
    let mut remarks: Vec<String> = scenes
        .iter()
        .filter_map(|scene| scene.remark.clone())
        .collect();
    remarks.dedup();
    let mut work = Work {
        experiment,
        scenes: &scenes,
        jobs: &jobs,
        own,
        store: &store,
        watch: Watch { bar: progress(runs as u64), interrupted },
        said,
        trees: Trees::new(),
        remarks,
    };
    let mut text = String::new();
    for measurement in measurements {
        text += &measurement.measure(&mut work)?;
    }
    let remarks = work.remarks;
    let provenance = Provenance::gather();
    if let Some(shard) = shard {
        store.keep_shard(&to_toml(&provenance)?)?;
        let text = format!("{runs} runs, part {shard}; `harness merge` joins the parts.\n");
        return Ok(Summary { text, left_out, remarks, folder, beside });
    }
    let best_known = if beside.is_some() { BestKnown::Read(out) } else { BestKnown::Improve(out) };
    let text = conclude(&resolved, best_known, &provenance, store)? + &text;
    Ok(Summary { text, left_out, remarks, folder, beside })
}

/// A bar with the time left; hidden unless standard error is a terminal.
fn progress(runs: u64) -> ProgressBar {
    let bar = ProgressBar::new(runs);
    let template = "{msg} {wide_bar} {pos}/{len} runs, {eta} left";
    bar.set_style(
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar
}
