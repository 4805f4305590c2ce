//! `harness jobs`: lists the runs of an experiment, for programs that share them among machines.

use super::terminal::print_line;
use crate::Error;
use crate::run::execute::reject_indivisible;
use crate::run::jobs::{Job, selected};
use crate::spec::{Experiment, Overrides};
use std::cmp::Reverse;
use std::path::PathBuf;

/// List the runs of an experiment, one a line: identifier, number of objects, and description. The
/// runs on the largest scenes come first. `--run` performs one.
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
    let (scenes, _) =
        experiment.load_scenes().map_err(|error| args.overrides.named(&args.spec, error))?;
    let mut jobs = selected(&experiment, &scenes, &[])?;
    // A long run that begins last would leave all other workers idle. Scenes differ most, and specs
    // begin with what is quick.
    jobs.reverse();
    jobs.sort_by_key(|job| Reverse(job.scene.boxes.len()));
    for Job { id, labelled, scene, repetition, .. } in jobs {
        let (label, objects, scene) = (&labelled.label, scene.boxes.len(), &scene.name);
        print_line(&format!("{id} {objects} {label} on {scene}, repetition {repetition}"));
    }
    Ok(())
}
