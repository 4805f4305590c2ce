//! `harness jobs`: lists the runs of an experiment, for programs that share them among machines.

use super::terminal::print_line;
use crate::Error;
use crate::run::execute::reject_indivisible;
use crate::run::job::listed;
use crate::run::resolved::load_scenes;
use crate::spec::{Experiment, Overrides};
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
    for run in listed(&experiment, &scenes) {
        print_line(&format!(
            "{} {} {} on {}, repetition {}",
            run.id, run.work, run.label, run.scene, run.repetition
        ));
    }
    Ok(())
}
