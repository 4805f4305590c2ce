//! Experiments that outgrow one machine: which runs a part has, and joining the parts into what one machine would
//! write.

use crate::Error;
use crate::run::execute::{Resolved, conclude};
use crate::run::provenance::Provenance;
use crate::run::store::{self, FinishedRun, Store};
use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// The part `number` of `of`, both from 1; written `number/of`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    of: usize,
}

impl Shard {
    /// Whether run `index` of the experiment belongs to this part. Neighbours go to different parts, so that a large
    /// scene or a slow method is spread over all of them.
    pub fn has(&self, index: usize) -> bool {
        index % self.of == self.number - 1
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text
            .split_once('/')
            .and_then(|(number, of)| Some(Self { number: number.parse().ok()?, of: of.parse().ok()? }));
        parsed
            .filter(|shard| (1..=shard.of).contains(&shard.number))
            .ok_or_else(|| "accepted: I/N with I from 1 to N, as 2/8".into())
    }
}

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
                locks.push(store::lock(&entry.path())?);
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
        .check_runs()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_belongs_to_one_part() {
        for of in 1..=7 {
            let parts: Vec<Shard> = (1..=of).map(|number| Shard { number, of }).collect();
            for index in 0..30 {
                assert_eq!(parts.iter().filter(|part| part.has(index)).count(), 1);
            }
        }
    }

    #[test]
    fn parts_are_written_as_they_are_read_and_wrong_ones_are_refused() {
        assert_eq!("2/8".parse::<Shard>().unwrap().to_string(), "2/8");
        for wrong in ["0/3", "4/3", "1/0", "1", "a/b", "-1/2", ""] {
            assert!(wrong.parse::<Shard>().unwrap_err().contains("I/N"), "{wrong}");
        }
    }
}
