//! `harness merge`: joins the parts of experiments that ran with `--run`.

use super::run::{print_outcome, repeat};
use super::terminal::{Threads, input_folder, output_folder};
use crate::rows::store::{Existing, spec_of_part};
use crate::run::execute::{Extent, execute};
use crate::run::finish;
use crate::run::resolved::Resolved;
use crate::spec::Overrides;
use crate::{Error, files};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Join the parts of experiments that ran with --run into the files that one process writes, and
/// perform the runs that no part has.
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
    /// Limits the threads.
    #[command(flatten)]
    pub threads: Threads,
}

/// Merges the parts and prints the tables of every experiment.
pub fn merge(args: &MergeArgs, interrupted: &AtomicBool) -> Result<(), Error> {
    output_folder("--out", &args.out)?;
    args.threads.apply()?;
    let mut parts: BTreeMap<PathBuf, Vec<PathBuf>> = BTreeMap::new();
    for out in &args.folders {
        input_folder("DIR", out)?;
        for name in names_of_parts(out)? {
            parts.entry(name).or_default().push(out.clone());
        }
    }
    if parts.is_empty() {
        let message = "DIR: no part of an experiment; accepted: --out of runs with --run";
        return Err(Error::Usage(message.into()));
    }
    let mut differences = 0;
    for (name, parts) in parts {
        let spec = spec_of_part(&parts[0].join(name));
        let Resolved { experiment, .. } = files::read_toml(&spec)?;
        // Somebody may have edited it.
        experiment
            .check_run_count()
            .map_err(|fault| Error::Usage(format!("{}: {fault}", spec.display())))?;
        let named = |error| Overrides::default().named(&spec, error);
        if !args.force && finish::has_results_of(&experiment, &args.out)? {
            differences +=
                repeat(&experiment, &args.out, &parts, interrupted, false).map_err(named)?;
            continue;
        }
        // What an earlier merge has taken is kept.
        let existing = if args.force { Existing::Replace } else { Existing::Resume };
        let extent = Extent { existing, parts, ..Extent::default() };
        let summary = execute(&experiment, &args.out, &extent, interrupted).map_err(named)?;
        print_outcome(&experiment, &summary, "Results:", &summary.folder, false);
    }
    Error::differs(differences)
}

/// Returns the folders of the experiments, full and quick, of which `out` has a part.
fn names_of_parts(out: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut names: Vec<PathBuf> = files::names(out)?.into_iter().map(PathBuf::from).collect();
    let quick = out.join("quick");
    if quick.is_dir() {
        let quick_names = files::names(&quick)?;
        names.extend(quick_names.iter().map(|name| Path::new("quick").join(name)));
    }
    names.retain(|name| spec_of_part(&out.join(name)).is_file());
    Ok(names)
}
