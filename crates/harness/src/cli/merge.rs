//! `harness merge`: joins the parts of experiments that ran with `--run`.

use super::terminal::{output_folder, print_line};
use crate::Error;
use crate::rows::store::Existing;
use crate::run::merge::{self, UnlikeProcessors};
use std::path::PathBuf;

/// Join the parts of experiments that ran with --run into the files that one run writes.
#[derive(clap::Args, Clone, Debug)]
pub struct MergeArgs {
    /// Folders that were given as --out to runs with --run.
    #[arg(value_name = "DIR", required = true)]
    pub folders: Vec<PathBuf>,
    /// Folder for the results.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Replace existing results.
    #[arg(long)]
    pub force: bool,
    /// Merge parts from unlike processors, whose seconds do not compare.
    #[arg(long)]
    pub unlike_processors: bool,
}

/// Merges the parts and prints the tables of every experiment.
pub fn merge(args: &MergeArgs) -> Result<(), Error> {
    output_folder("--out", &args.out)?;
    let existing = if args.force { Existing::Replace } else { Existing::Keep };
    let unlike = match args.unlike_processors {
        true => UnlikeProcessors::Merged,
        false => UnlikeProcessors::Rejected,
    };
    for (text, folder) in merge::merge(&args.folders, &args.out, existing, unlike)? {
        print_line(&format!("{text}Results: {}", folder.display()));
    }
    Ok(())
}
