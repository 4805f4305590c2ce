//! Joins the parts of an experiment that was run on several machines into what one machine would have written.

use crate::Error;
use crate::files;
use crate::run::finish::conclude;
use crate::run::provenance::Provenance;
use crate::run::resolved::Resolved;
use crate::run::store::{self, FinishedRun, Store};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// One part of an experiment, as `--shard` left it.
struct Part {
    partial: PathBuf,
    resolved: String,
}

/// At most so many missing runs are named one by one.
const NAMED: usize = 5;

/// Joins every experiment of which there is a part in one of `folders`, each the `--out` of a harness with `--shard`,
/// into `out/NAME/`: but for seconds and provenance, the bytes that one machine would have written. The parts stay.
/// Returns name and tables of every experiment.
///
/// Refuses parts of different specs, scenes or seeds, runs that two parts have with different results, parts that
/// are being written, and names the runs that are missing.
pub fn merge(folders: &[PathBuf], out: &Path) -> Result<Vec<(String, String)>, Error> {
    // Held until the end, so that no part changes meanwhile.
    let mut locks = Vec::new();
    let mut experiments: BTreeMap<String, Vec<Part>> = BTreeMap::new();
    for folder in folders {
        let mut names = Vec::new();
        for entry in fs::read_dir(folder).map_err(Error::io(folder, "read the folder"))? {
            let entry = entry.map_err(Error::io(folder, "read the folder"))?;
            let partial = entry.path().join(".partial");
            let spec = partial.join("resolved.toml");
            if spec.is_file() {
                locks.push(files::lock_folder(&entry.path())?);
                let resolved = fs::read_to_string(&spec).map_err(Error::io(&spec, "read the file"))?;
                let name = entry.file_name().to_string_lossy().into_owned();
                experiments.entry(name.clone()).or_default().push(Part { partial, resolved });
                names.push(name);
            }
        }
        if names.is_empty() {
            return Err(Error::Usage(format!(
                "{} holds no part of an experiment; accepted: folders given as --out to runs with --shard",
                folder.display()
            )));
        }
    }
    experiments.into_iter().map(|(name, parts)| Ok((name.clone(), join(&name, &parts, out)?))).collect()
}

/// Joins the parts of one experiment.
fn join(name: &str, parts: &[Part], out: &Path) -> Result<String, Error> {
    let fail = |message: String| Error::Merge { experiment: name.to_owned(), message };
    let Some(first) = parts.first() else { return Ok(String::new()) };
    let target = out.join(name).join(".partial");
    if parts.iter().any(|part| same_folder(&part.partial, &target)) {
        return Err(Error::Usage(format!("--out {} is also one of the parts; choose another", out.display())));
    }
    if let Some(other) = parts.iter().find(|part| part.resolved != first.resolved) {
        return Err(fail(format!(
            "{} and {} are parts of different specs, scenes or seeds",
            first.partial.display(),
            other.partial.display()
        )));
    }
    let resolved: Resolved = toml::from_str(&first.resolved)
        .map_err(|error| fail(format!("{}/resolved.toml: {error}", first.partial.display())))?;
    // Somebody may have edited it: no more runs are looked for than a spec could ask for.
    resolved
        .experiment
        .check_run_count()
        .map_err(|message| fail(format!("{}/resolved.toml: {message}", first.partial.display())))?;
    let of_scene: Vec<_> = resolved.experiment.runs().collect();
    let runs = of_scene.len() * resolved.scenes.len();
    let named = |index: usize| {
        let (labelled, repetition, _) = of_scene[index % of_scene.len()];
        let scene = &resolved.scenes[index / of_scene.len()].name;
        format!("scene {scene}, method {}, repetition {repetition}", labelled.label)
    };
    let (mut owners, mut missing) = (Vec::new(), Vec::new());
    for index in 0..runs {
        let kept = parts.iter().map(|part| part.partial.join(store::part_name(index)));
        let kept: Vec<PathBuf> = kept.filter(|kept| kept.is_dir()).collect();
        let Some((owner, others)) = kept.split_first() else {
            missing.push(index);
            continue;
        };
        for other in others {
            if let Some(file) = FinishedRun::read(owner)?.difference(&FinishedRun::read(other)?) {
                let (owner, other) = (owner.display(), other.display());
                return Err(fail(format!("{owner} and {other} have different {file} of {}", named(index))));
            }
        }
        owners.push(owner.clone());
    }
    if !missing.is_empty() {
        let first: Vec<String> = missing.iter().take(NAMED).copied().map(named).collect();
        let more = if missing.len() > NAMED { "; and more" } else { "" };
        return Err(fail(format!("{} of {runs} runs are missing: {}{more}", missing.len(), first.join("; "))));
    }

    let store = Store::open(out, name, &first.resolved, false)?;
    for (index, owner) in owners.iter().enumerate() {
        store.keep(index, &FinishedRun::read(owner)?)?;
    }
    let mut provenance = Provenance::gather();
    for part in parts {
        let path = part.partial.join("provenance.toml");
        if let Ok(text) = fs::read_to_string(&path) {
            let own = toml::from_str(&text).map_err(|error| fail(format!("{}: {error}", path.display())))?;
            provenance.parts.push(own);
        }
    }
    conclude(&resolved, out, &provenance, store)
}

/// Whether both paths are one existing folder.
fn same_folder(a: &Path, b: &Path) -> bool {
    a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b)
}
