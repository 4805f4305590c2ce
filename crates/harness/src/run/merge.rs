//! Joins the parts of an experiment that was run on several machines into what one machine would have written.

use crate::Error;
use crate::rows::lock::lock_folder;
use crate::rows::store::{self, Existing, FinishedRun, Store};
use crate::run::finish::conclude;
use crate::run::provenance::Provenance;
use crate::run::reference::BestKnown;
use crate::run::resolved::Resolved;
use crate::run::target::Target;
use bvh_terminal::files;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// One part of an experiment, as `--shard` left it, locked.
struct Part {
    partial: PathBuf,
    resolved: String,
    _lock: File,
}

/// At most this many missing runs are named one by one.
const NAMED: usize = 5;

/// Joins every experiment of which there is a part in one of `folders`, each the `--out` of a harness with `--shard`,
/// into its folder in `out`: except for seconds and provenance, the bytes that one machine would have written. The
/// parts stay. Returns the tables of every experiment and where its results are.
///
/// Refuses parts of different specs, scenes or seeds, runs that two parts have with different results, parts that
/// are being written, and missing runs, which it names.
pub fn merge(
    folders: &[PathBuf],
    out: &Path,
    existing: Existing,
) -> Result<Vec<(String, PathBuf)>, Error> {
    let mut experiments: BTreeMap<PathBuf, Vec<Part>> = BTreeMap::new();
    for folder in folders {
        let found = parts(folder)?;
        if found.is_empty() {
            return Err(Error::Usage(format!(
                "{} holds no part of an experiment; accepted: folders given as --out to runs with --shard",
                folder.display()
            )));
        }
        for (name, part) in found {
            experiments.entry(name).or_default().push(part);
        }
    }
    experiments
        .iter()
        .map(|(name, parts)| join(name, parts, out, existing))
        .collect()
}

/// The parts in one `--out`, of whole experiments and of quick ones, by the names of their folders in it.
fn parts(out: &Path) -> Result<Vec<(PathBuf, Part)>, Error> {
    let quick = out.join("quick");
    let mut parts = Vec::new();
    for folder in [Some(out), quick.is_dir().then_some(quick.as_path())]
        .into_iter()
        .flatten()
    {
        for path in files::names(folder)?
            .into_iter()
            .map(|name| folder.join(name))
        {
            let partial = path.join(".partial");
            let spec = partial.join("resolved.toml");
            if spec.is_file() {
                // Locked until the end, so that no part changes meanwhile.
                let lock = lock_folder(&path)?;
                let resolved =
                    fs::read_to_string(&spec).map_err(Error::io(&spec, "read the file"))?;
                let name = path.strip_prefix(out).unwrap_or(&path).to_owned();
                parts.push((name, Part { partial, resolved, _lock: lock }));
            }
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
) -> Result<(String, PathBuf), Error> {
    let fail = |message| Error::Merge { experiment: name.display().to_string(), message };
    let own = out
        .join(name)
        .join(".partial")
        .canonicalize()
        .ok();
    if parts
        .iter()
        .any(|part| own.is_some() && part.partial.canonicalize().ok() == own)
    {
        return Err(Error::Usage(format!(
            "--out {} is also one of the parts; choose another",
            out.display()
        )));
    }
    let resolved = common_spec(name, parts).map_err(fail)?;
    let owners = owners(&resolved, parts, fail)?;
    let Target { folder, beside, .. } = Target::choose(out, &resolved, existing, false)?;
    let store = Store::open(&folder, &parts[0].resolved, existing)?;
    for (index, owner) in owners.iter().enumerate() {
        store.keep(index, &FinishedRun::read(owner)?)?;
    }
    let mut provenance = Provenance::gather();
    for part in parts {
        let path = part.partial.join("provenance.toml");
        if let Ok(text) = fs::read_to_string(&path) {
            provenance
                .parts
                .push(toml::from_str(&text).map_err(Error::toml(&path))?);
        }
    }
    let best_known = if beside.is_some() { BestKnown::Read(out) } else { BestKnown::Improve(out) };
    Ok((conclude(&resolved, best_known, &provenance, store)?, folder))
}

/// What all parts were made of. Somebody may have edited it, so it is checked as far as the merging relies on it.
fn common_spec(name: &Path, parts: &[Part]) -> Result<Resolved, String> {
    let (first, others) = parts.split_first().ok_or("no parts")?;
    if let Some(other) = others
        .iter()
        .find(|part| part.resolved != first.resolved)
    {
        let first = first.partial.display();
        let other = other.partial.display();
        return Err(format!("{first} and {other} are parts of different specs, scenes or seeds"));
    }
    let bad = |message: String| format!("{}/resolved.toml: {message}", first.partial.display());
    let resolved: Resolved =
        toml::from_str(&first.resolved).map_err(|error| bad(error.to_string()))?;
    if resolved.experiment.folder() != name {
        return Err(bad(format!("name is {:?}; accepted: the folder's", resolved.experiment.name)));
    }
    resolved
        .experiment
        .check_run_count()
        .map_err(|error| bad(error.to_string()))?;
    Ok(resolved)
}

/// For every run a kept folder of it. Refuses runs of which there is none, of which one is damaged, or two differ.
fn owners(
    resolved: &Resolved,
    parts: &[Part],
    fail: impl Fn(String) -> Error,
) -> Result<Vec<PathBuf>, Error> {
    let of_scene: Vec<_> = resolved.experiment.runs().collect();
    let named = |index: usize| {
        let (labelled, repetition, _) = of_scene[index % of_scene.len()];
        let scene = &resolved.scenes[index / of_scene.len()].name;
        format!("scene {scene}, method {}, repetition {repetition}", labelled.label)
    };
    let mut owners = Vec::new();
    let mut missing = Vec::new();
    for index in 0..resolved.run_count() {
        let kept = parts
            .iter()
            .map(|part| part.partial.join(store::part_name(index)));
        let kept: Vec<PathBuf> = kept.filter(|kept| kept.is_dir()).collect();
        let Some((owner, others)) = kept.split_first() else {
            missing.push(index);
            continue;
        };
        let run = FinishedRun::read(owner)?;
        for other in others {
            if let Some(file) = run.difference(&FinishedRun::read(other)?) {
                let owner = owner.display();
                let other = other.display();
                return Err(fail(format!(
                    "{owner} and {other} have different {file} of {}",
                    named(index)
                )));
            }
        }
        owners.push(owner.clone());
    }
    if missing.is_empty() {
        return Ok(owners);
    }
    let first: Vec<String> = missing
        .iter()
        .take(NAMED)
        .copied()
        .map(named)
        .collect();
    let more = if missing.len() > NAMED { "; and more" } else { "" };
    let count = missing.len();
    let all = resolved.run_count();
    Err(fail(format!("{count} of {all} runs are missing: {}{more}", first.join("; "))))
}
