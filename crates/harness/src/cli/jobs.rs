//! `harness jobs`: lists the runs of an experiment, for programs that share them among machines.

use super::terminal::print_line;
use crate::Error;
use crate::run::execute::reject_indivisible;
use crate::run::job::{Job, estimated_work, jobs as jobs_of};
use crate::run::resolved::load_scenes;
use crate::spec::{Experiment, Overrides};
use std::cmp::Reverse;
use std::path::PathBuf;

/// List the runs of an experiment, one a line: identifier, estimated work, and description. The
/// runs with most work come first. `--run` performs one.
#[derive(clap::Args, Clone, Debug)]
pub struct JobsArgs {
    /// The experiment's spec.
    #[arg(value_name = "SPEC.toml")]
    pub spec: PathBuf,
    /// Replaces parts of the spec, as in the commands that perform the runs.
    #[command(flatten)]
    pub overrides: Overrides,
}

/// Prints the list.
pub fn jobs(args: &JobsArgs) -> Result<(), Error> {
    let experiment = Experiment::read(&args.spec, &args.overrides)?;
    reject_indivisible(&experiment)?;
    let (scenes, _) = load_scenes(&experiment)?;
    let mut listed: Vec<(u64, Job)> = jobs_of(&experiment, &scenes)
        .into_iter()
        .map(|job| (estimated_work(&experiment, &job), job))
        .collect();
    // A long run that begins last would leave all other workers idle.
    listed.sort_by_key(|(work, _)| Reverse(*work));
    for (work, Job { id, labelled, scene, repetition, .. }) in listed {
        let (label, scene) = (&labelled.label, &scene.name);
        print_line(&format!("{id} {work} {label} on {scene}, repetition {repetition}"));
    }
    Ok(())
}
