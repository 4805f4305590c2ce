//! Joins the parts of an experiment that ran on several machines into the files that one machine
//! writes.

use crate::Error;
use crate::files;
use crate::rows::finished_run::FinishedRun;
use crate::rows::lock::lock_folder;
use crate::rows::store::{self, Existing, Store};
use crate::run::finish::conclude;
use crate::run::provenance::Provenance;
use crate::run::reference::BestKnown;
use crate::run::resolved::Resolved;
use crate::run::target::Target;
use bvh_scenes::files::read_text;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};

/// One part of an experiment, made with `--run`. Its folder stays locked as long as
/// this lives.
struct Part {
    partial: PathBuf,
    resolved: String,
    provenance: Option<Provenance>,
    _lock: File,
}

/// The maximum number of missing runs that an error names.
const NAMED: usize = 5;

/// Parts of one experiment from processors of several models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnlikeProcessors {
    /// Their seconds are rows of the same tables.
    Merged,
    /// They are rejected: nothing can be concluded from their seconds.
    Rejected,
}

/// Joins every experiment that has a part in one of `folders`, each the `--out` of a harness with
/// `--run`, into its folder in `out`.
///
/// Except for seconds and provenance, the bytes are the same as from one machine. The parts stay.
/// Returns the tables of every experiment and the folder of its results.
///
/// # Errors
///
/// If parts come from different specs, scenes or seeds, if two parts have different results of a
/// run, if a part is being written, if runs are missing, or if parts come from `unlike` processors
/// and are not to be merged then.
pub fn merge(
    folders: &[PathBuf],
    out: &Path,
    existing: Existing,
    unlike: UnlikeProcessors,
) -> Result<Vec<(String, PathBuf)>, Error> {
    let mut experiments: BTreeMap<PathBuf, Vec<Part>> = BTreeMap::new();
    for folder in folders {
        let found = parts(folder)?;
        if found.is_empty() {
            return Err(Error::Usage(format!(
                "{} holds no part of an experiment; accepted: folders given as --out to runs with \
                 --run",
                folder.display()
            )));
        }
        for (name, part) in found {
            experiments.entry(name).or_default().push(part);
        }
    }
    experiments.iter().map(|(name, parts)| join(name, parts, out, existing, unlike)).collect()
}

/// Returns the parts in one `--out`, full and quick, by the names of their folders in it.
fn parts(out: &Path) -> Result<Vec<(PathBuf, Part)>, Error> {
    let mut names: Vec<PathBuf> = files::names(out)?.into_iter().map(PathBuf::from).collect();
    let quick = out.join("quick");
    if quick.is_dir() {
        let quick_names = files::names(&quick)?;
        names.extend(quick_names.iter().map(|name| Path::new("quick").join(name)));
    }
    let mut parts = Vec::new();
    for name in names {
        let folder = out.join(&name);
        let partial = folder.join(".partial");
        let spec = partial.join("resolved.toml");
        if spec.is_file() {
            // Locked until the end, so that no part changes meanwhile.
            let lock = lock_folder(&folder)?;
            let resolved = read_text(&spec)?;
            let provenance = Provenance::of_part(&partial.join(store::PART_PROVENANCE))?;
            parts.push((name, Part { partial, resolved, provenance, _lock: lock }));
        }
    }
    Ok(parts)
}

/// Joins the parts of the experiment whose folder is called `name`.
fn join(
    name: &Path,
    parts: &[Part],
    out: &Path,
    existing: Existing,
    unlike: UnlikeProcessors,
) -> Result<(String, PathBuf), Error> {
    let merge_error = |message| Error::Merge { experiment: name.display().to_string(), message };
    // Symbolic links and `..` may hide that two paths are the same folder.
    if let Ok(target) = out.join(name).join(".partial").canonicalize()
        && parts.iter().any(|part| part.partial.canonicalize().is_ok_and(|path| path == target))
    {
        let out = out.display();
        return Err(Error::Usage(format!("--out {out} is also one of the parts; choose another")));
    }
    let resolved = common_spec(name, parts).map_err(merge_error)?;
    let owners = owners(&resolved, parts, merge_error)?;
    if unlike == UnlikeProcessors::Rejected {
        check_processors(parts).map_err(merge_error)?;
    }
    let Target { folder, previous, .. } = Target::choose(out, &resolved, existing, false)?;
    let store = Store::open(&folder, &parts[0].resolved, existing)?;
    for (index, owner) in owners.iter().enumerate() {
        store.keep(index, &FinishedRun::read(owner)?)?;
    }
    let mut provenance = Provenance::gather();
    provenance.parts = parts.iter().filter_map(|part| part.provenance.clone()).collect();
    let best_known = match previous {
        Some(_) => BestKnown::Read(out),
        None => BestKnown::Improve(out),
    };
    Ok((conclude(&resolved, best_known, &provenance, store)?, folder))
}

/// Returns an error if the seconds of the parts come from unlike processors.
fn check_processors(parts: &[Part]) -> Result<(), String> {
    let processors: BTreeSet<&str> = parts
        .iter()
        .filter_map(|part| part.provenance.as_ref())
        .flat_map(Provenance::processors)
        .collect();
    if processors.len() <= 1 {
        return Ok(());
    }
    let processors = Vec::from_iter(processors).join("; ");
    Err(format!(
        "the seconds come from unlike processors: {processors}; accepted: parts from one model, or \
         --unlike-processors, which merges them all the same"
    ))
}

/// Returns the resolved spec that all parts share. Somebody may have edited it, so everything that
/// merging relies on is checked.
fn common_spec(name: &Path, parts: &[Part]) -> Result<Resolved, String> {
    let (first, others) = parts.split_first().ok_or("no parts")?;
    if let Some(other) = others.iter().find(|part| part.resolved != first.resolved) {
        let first = first.partial.display();
        let other = other.partial.display();
        return Err(format!("{first} and {other} are parts of different specs, scenes or seeds"));
    }
    checked_spec(name, &first.resolved)
        .map_err(|message| format!("{}/resolved.toml: {message}", first.partial.display()))
}

fn checked_spec(name: &Path, text: &str) -> Result<Resolved, String> {
    let resolved: Resolved = toml::from_str(text).map_err(|error| error.to_string())?;
    if resolved.experiment.folder() != name {
        return Err(format!("name is {:?}; accepted: the folder's", resolved.experiment.name));
    }
    resolved.experiment.check_run_count().map_err(|error| error.to_string())?;
    Ok(resolved)
}

/// Returns a finished folder for every run.
///
/// # Errors
///
/// If a run is missing or damaged, or if two folders of a run differ.
fn owners(
    resolved: &Resolved,
    parts: &[Part],
    merge_error: impl Fn(String) -> Error,
) -> Result<Vec<PathBuf>, Error> {
    let mut owners = Vec::new();
    let mut missing = Vec::new();
    for index in 0..resolved.run_count() {
        let mut copies = parts
            .iter()
            .map(|part| part.partial.join(store::run_folder_name(index)))
            .filter(|copy| copy.is_dir());
        let Some(owner) = copies.next() else {
            missing.push(index);
            continue;
        };
        // Reading verifies the checksums, so a damaged run is never merged.
        let run = FinishedRun::read(&owner)?;
        // Two machines may both have performed a run; the copies must agree.
        for copy in copies {
            if let Some(file) = run.difference(&FinishedRun::read(&copy)?) {
                let owner = owner.display();
                let copy = copy.display();
                let run = resolved.run_name(index);
                return Err(merge_error(format!(
                    "{owner} and {copy} have different {file} of {run}"
                )));
            }
        }
        owners.push(owner);
    }
    if missing.is_empty() {
        return Ok(owners);
    }
    let names: Vec<String> = missing
        .iter()
        // A part that never ran misses thousands of runs.
        .take(NAMED)
        .map(|&index| resolved.run_name(index))
        .collect();
    let names = names.join("; ");
    let more = if missing.len() > NAMED { "; and more" } else { "" };
    let count = missing.len();
    let all = resolved.run_count();
    Err(merge_error(format!("{count} of {all} runs are missing: {names}{more}")))
}
