//! `harness SPEC.toml...`: runs experiments, compares them with committed results, or makes their
//! reports again.

use super::terminal::{Threads, output_folder, print_error, print_line};
use crate::Error;
use crate::rows::store::Existing;
use crate::run::execute::{Extent, execute};
use crate::run::finish::Summary;
use crate::run::{check, finish, forecast, reference};
use crate::spec::{Experiment, Overrides};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Run experiments.
#[derive(clap::Args, Clone, Debug)]
pub struct RunArgs {
    /// Experiment specs, run one after another.
    #[arg(value_name = "SPEC.toml", required = true)]
    pub specs: Vec<PathBuf>,
    /// Folder for the results; each experiment writes to a separate folder in it.
    #[arg(long, value_name = "DIR", default_value = "results")]
    pub out: PathBuf,
    /// Replaces parts of the specs.
    #[command(flatten)]
    pub overrides: Overrides,
    /// Limits the threads.
    #[command(flatten)]
    pub threads: Threads,
    /// Only compare with the committed results; exit code 1 on a difference.
    #[arg(long, conflicts_with = "resume")]
    pub check: bool,
    /// Make the tables and figures again from existing rows, with the current best known costs; run
    /// nothing.
    #[arg(long, conflicts_with_all = ["check", "resume", "runs"])]
    pub redraw: bool,
    /// Keep the finished runs of an interrupted experiment, and perform the missing ones.
    #[arg(long)]
    pub resume: bool,
    /// Replace existing results.
    #[arg(long, conflicts_with_all = ["check", "redraw", "resume"])]
    pub force: bool,
    /// Perform only the run that `harness jobs` lists with this identifier, and keep it for `harness
    /// merge`; may be repeated. Every process needs a different --out.
    #[arg(long = "run", value_name = "ID", conflicts_with = "check")]
    pub runs: Vec<String>,
    /// Print only errors and differences.
    #[arg(long)]
    pub quiet: bool,
}

/// Runs all experiments and prints their tables.
pub fn run(args: &RunArgs, interrupted: &AtomicBool) -> Result<(), Error> {
    // A wrong folder is found before hours of work, not after them.
    output_folder("--out", &args.out)?;
    args.threads.apply()?;
    // A mistake in the last spec must not surface after hours of runs of the first.
    let experiments = args
        .specs
        .iter()
        .map(|path| Experiment::read(path, &args.overrides))
        .collect::<Result<Vec<_>, _>>()?;
    // Two specs with one name would write into one folder.
    let mut folders = HashSet::new();
    if let Some(twice) = experiments.iter().find(|experiment| !folders.insert(experiment.folder()))
    {
        let message =
            format!("two specs are called {}; run them one by one, each with an --out", twice.name);
        return Err(Error::Usage(message));
    }
    let existing = match (args.resume, args.force) {
        (true, _) => Existing::Resume,
        (_, true) => Existing::Replace,
        _ => Existing::Keep,
    };
    let extent = Extent { existing, runs: args.runs.clone(), ..Extent::default() };
    // A missing scene of a later spec is an error now, not after the hours of the specs before it.
    // Resumed and selected runs are too short for every scene to be loaded twice.
    if !args.redraw && !args.resume && args.runs.is_empty() {
        for (path, experiment) in args.specs.iter().zip(&experiments).skip(1) {
            experiment.load_scenes().map_err(|error| args.overrides.named(path, error))?;
        }
    }
    let mut differences = 0;
    for (path, experiment) in args.specs.iter().zip(&experiments) {
        differences += perform(args, experiment, &extent, interrupted)
            .map_err(|error| args.overrides.named(path, error))?;
    }
    Error::differs(differences)
}

/// Runs one experiment, or does with it what the flags say. Returns the number of differences from
/// earlier results.
fn perform(
    args: &RunArgs,
    experiment: &Experiment,
    extent: &Extent,
    interrupted: &AtomicBool,
) -> Result<usize, Error> {
    if !args.redraw && !args.quiet && args.runs.is_empty() {
        let times = forecast::line(experiment, &args.out.join(experiment.folder()))?;
        times.iter().for_each(|line| print_error(line));
    }
    let is_new = args.redraw || args.force || args.resume || !args.runs.is_empty();
    if args.check || !is_new && finish::has_results_of(experiment, &args.out)? {
        return repeat(experiment, &args.out, &[], interrupted, args.quiet || args.check);
    }
    let summary = if args.redraw {
        finish::redraw(experiment, &args.out)?
    } else {
        execute(experiment, &args.out, extent, interrupted)?
    };
    print_outcome(experiment, &summary, "Results:", &summary.folder, args.quiet);
    Ok(0)
}

/// Prints the remarks and, unless `quiet`, the tables and a folder with its label.
pub(super) fn print_outcome(
    experiment: &Experiment,
    summary: &Summary,
    label: &str,
    folder: &Path,
    quiet: bool,
) {
    summary.remarks.iter().for_each(|remark| print_error(remark));
    if quiet {
        return;
    }
    print_line(&experiment.question);
    for name in &summary.skipped_scenes {
        print_line(&format!("(without {name}: scripts/fetch-scenes brings it)"));
    }
    print_line(&format!("\n{}{label} {}", summary.text, folder.display()));
}

/// Runs into a temporary folder what has results in `out`, with the runs of the parts, and prints
/// how its rows differ from those; unless `quiet`, also the tables. Returns the number of
/// differences.
pub(super) fn repeat(
    experiment: &Experiment,
    out: &Path,
    parts: &[PathBuf],
    interrupted: &AtomicBool,
    quiet: bool,
) -> Result<usize, Error> {
    // A repetition must not touch the committed results, not even for a moment.
    let temporary =
        tempfile::tempdir().map_err(Error::io(&std::env::temp_dir(), "create a folder"))?;
    let committed = out.join(experiment.folder());
    // Gaps are measured from the references of the committed run, not from later finds.
    reference::adopt(&committed, temporary.path())?;
    let extent = Extent { parts: parts.to_vec(), ..Extent::default() };
    let summary = execute(experiment, temporary.path(), &extent, interrupted)
        .map_err(|error| error.without_kept_runs(&committed))?;
    let differences = check::compare(&summary.folder, &committed, &summary.skipped_scenes)?;
    print_outcome(experiment, &summary, "Compared with", &committed, quiet);
    let name = &experiment.name;
    // The tables say it otherwise.
    for scene in summary.skipped_scenes.iter().filter(|_| quiet) {
        print_line(&format!("{name}: scene {scene} is not fetched; its rows are not compared"));
    }
    for difference in &differences {
        print_line(&format!("{name}: {difference}"));
    }
    if differences.is_empty() {
        print_line(&format!("{name}: as committed"));
    }
    Ok(differences.len())
}
