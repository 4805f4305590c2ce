//! `harness SPEC.toml...`: runs experiments, compares them with committed results, or makes their reports again.

use crate::Error;
use crate::cli::explain;
use crate::rows::store::Existing;
use crate::run::execute::{Extent, Said, execute};
use crate::run::shard::Shard;
use crate::run::{check, finish, reference};
use crate::spec::{Experiment, Overrides};
use bvh_terminal::arguments::{Jobs, output_folder};
use bvh_terminal::output::{print_error, print_line};
use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// Run experiments.
#[derive(clap::Args, Clone, Debug)]
pub struct RunArgs {
    /// Experiment specs, run one after the other.
    #[arg(value_name = "SPEC.toml", required = true)]
    pub specs: Vec<PathBuf>,
    /// Folder for the results; each experiment has a folder of its own in it.
    #[arg(long, value_name = "DIR", default_value = "results")]
    pub out: PathBuf,
    /// Scene to run on in place of the spec's, by name or path of a mesh file; may be repeated.
    #[arg(long = "scene", value_name = "NAME|PATH")]
    pub scenes: Vec<String>,
    /// Let a glTF file name buffers outside its own folder. Whoever made the file then says which files are read.
    #[arg(long)]
    pub outside_files: bool,
    /// Limits the threads.
    #[command(flatten)]
    pub jobs: Jobs,
    /// Seed in place of the spec's.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Run the spec's smaller variant, into the folder `quick` among the results.
    #[arg(long)]
    pub quick: bool,
    /// Compare with the committed results instead of writing any; exit code 1 on a difference.
    #[arg(long, conflicts_with = "resume")]
    pub check: bool,
    /// Make the tables and figures again from the rows there are, with the best known costs of now; run nothing.
    #[arg(long, conflicts_with_all = ["check", "resume", "shard"])]
    pub redraw: bool,
    /// Keep the finished runs of an interrupted experiment and do the rest, which is nothing if all are finished.
    #[arg(long)]
    pub resume: bool,
    /// Replace the results that are there already. Without it, finished results stay, and those of a repetition go
    /// beside them, into a folder whose name ends with `.new`.
    #[arg(long, conflicts_with_all = ["check", "redraw", "resume"])]
    pub force: bool,
    /// Do only the I-th of N parts of the runs, from 1, and leave them for `harness merge`. Every part needs an --out
    /// of its own.
    #[arg(long, value_name = "I/N", conflicts_with = "check")]
    pub shard: Option<Shard>,
    /// Say nothing but errors, and differences under --check.
    #[arg(long)]
    pub quiet: bool,
    /// Say of every run, on standard error, what was done: method, scene, repetition, seed, seconds.
    #[arg(long, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Print first what each scene does not need and is left out, and why.
    #[arg(long)]
    pub explain: bool,
}

/// Runs all experiments, and prints their tables.
pub fn run(args: &RunArgs, interrupted: &AtomicBool) -> Result<(), Error> {
    output_folder("--out", &args.out)?;
    args.jobs.apply()?;
    let overrides = Overrides {
        scenes: args.scenes.clone(),
        outside_files: args.outside_files,
        seed: args.seed,
        quick: args.quick,
    };
    // All specs are checked before the first one is run.
    let experiments = args
        .specs
        .iter()
        .map(|path| Experiment::read(path, &overrides))
        .collect::<Result<Vec<_>, _>>()?;
    let mut folders = HashSet::new();
    if let Some(twice) = experiments
        .iter()
        .find(|experiment| !folders.insert(experiment.folder()))
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
    let extent = Extent { existing, shard: args.shard, said: said(args) };
    let mut differences = 0;
    for experiment in &experiments {
        if args.explain {
            print_line(&explain::experiment(experiment)?);
        }
        if args.check {
            differences += compare(args, experiment, interrupted)?;
            continue;
        }
        let summary = if args.redraw {
            finish::redraw(experiment, &args.out)?
        } else {
            execute(experiment, &args.out, extent, interrupted)?
        };
        summary
            .remarks
            .iter()
            .for_each(|remark| print_error(remark));
        if args.quiet {
            continue;
        }
        print_line(&experiment.question);
        for name in &summary.left_out {
            print_line(&format!("(without {name}: scripts/fetch-scenes brings it)"));
        }
        print_line(&format!("\n{}Results: {}", summary.text, summary.folder.display()));
        if let Some(kept) = &summary.beside {
            let same = check::compare(&summary.folder, kept, &summary.left_out, !experiment.quick)?
                .is_empty();
            let has = match same {
                true if experiment.is_by_the_clock() => "is of the same spec",
                true => "has the same rows",
                false => "has other rows",
            };
            let kept = kept.display();
            print_line(&format!("({kept} is kept and {has}; --force would replace it)"));
        }
    }
    if differences > 0 { Err(Error::Differs { differences }) } else { Ok(()) }
}

/// What is said while the runs are carried out.
fn said(args: &RunArgs) -> Said {
    match (args.quiet, args.verbose) {
        (true, _) => Said::Bar,
        (_, true) => Said::EveryRun,
        _ => Said::Progress,
    }
}

/// Runs into a temporary folder and prints how the rows differ from the committed ones. Returns the number of
/// differences.
fn compare(
    args: &RunArgs,
    experiment: &Experiment,
    interrupted: &AtomicBool,
) -> Result<usize, Error> {
    let temporary =
        tempfile::tempdir().map_err(Error::io(&std::env::temp_dir(), "create a folder"))?;
    let fresh = temporary.path().join(experiment.folder());
    let committed = args.out.join(experiment.folder());
    reference::adopt(&committed, temporary.path())?;
    let extent = Extent { said: said(args), ..Extent::default() };
    let summary = execute(experiment, temporary.path(), extent, interrupted)?;
    let found = check::compare(&fresh, &committed, &summary.left_out, !experiment.quick)?;
    let name = &experiment.name;
    for scene in &summary.left_out {
        print_line(&format!("{name}: scene {scene} is not fetched; its rows are not compared"));
    }
    for difference in &found {
        print_line(&format!("{name}: {difference}"));
    }
    if experiment.is_by_the_clock() {
        let what = "the clock ends runs, so their rows cannot be compared; their trees are valid";
        print_line(&format!("{name}: {what}"));
    }
    if found.is_empty() {
        print_line(&format!("{name}: as committed"));
    }
    Ok(found.len())
}
