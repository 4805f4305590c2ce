//! The folder of one experiment's results: one writer at a time, finished runs kept one by one,
//! files replaced whole.
//!
//! Until all runs are finished, each finished one is a folder `.partial/NNNNNN/` with its own rows.
//! The folder is written under another name, synced, and renamed, so that every finished run
//! survives a crash, a full disk or `kill -9`. At the end the rows of all runs are joined in the
//! order of the spec, so that their bytes do not depend on the order in which runs finish.

use super::lock::lock_folder;
use super::{Row, read_if_any, to_bytes};
use crate::Error;
use bvh_scenes::fnv1a;
use bvh_terminal::files;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// The file in which a kept run lists its other files, one a line: name, number of bytes and
/// checksum.
const CONTENTS: &str = "contents.txt";

/// The rows of one finished run: one CSV file for every kind of rows that it has.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FinishedRun {
    files: BTreeMap<String, Vec<u8>>,
}

impl FinishedRun {
    /// Adds rows of one kind, once per kind; none leave no file.
    pub fn add<R: Row>(&mut self, rows: &[R]) -> Result<(), Error> {
        if !rows.is_empty() {
            self.files
                .insert(R::FILE.into(), to_bytes(rows, Path::new(R::FILE))?);
        }
        Ok(())
    }

    /// Reads a kept run. Rejects a run whose files differ from the written ones.
    pub fn read(part: &Path) -> Result<Self, Error> {
        let damaged = |file: &str| Error::Damaged { part: part.to_owned(), file: file.to_owned() };
        let contents = fs::read_to_string(part.join(CONTENTS)).map_err(|_| damaged(CONTENTS))?;
        let mut files = BTreeMap::new();
        for name in files::names(part)?
            .into_iter()
            .filter(|name| name != CONTENTS)
        {
            let path = part.join(&name);
            files.insert(name, fs::read(&path).map_err(Error::io(&path, "read the file"))?);
        }
        let run = Self { files };
        let found = run.contents();
        let [expected, found] =
            [&contents, &found].map(|text| text.lines().collect::<BTreeSet<&str>>());
        match expected.symmetric_difference(&found).next() {
            Some(line) => Err(damaged(line.split(' ').next().unwrap_or_default())),
            // Every run has rows.
            None if expected.is_empty() => Err(damaged(CONTENTS)),
            None => Ok(run),
        }
    }

    /// Returns the text of the file [`CONTENTS`].
    fn contents(&self) -> String {
        let line = |(name, bytes): (&String, &Vec<u8>)| {
            format!("{name} {} {:016x}\n", bytes.len(), fnv1a(bytes.iter().copied()))
        };
        self.files.iter().map(line).collect()
    }

    /// Returns the first file without seconds in which two runs differ.
    pub fn difference<'a>(&'a self, other: &'a Self) -> Option<&'a str> {
        let names = self
            .files
            .keys()
            .chain(other.files.keys())
            .map(String::as_str);
        names
            .filter(|name| !name.starts_with("timing"))
            .find(|&name| self.files.get(name) != other.files.get(name))
    }
}

/// The treatment of results that exist already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Existing {
    /// They stay. A repetition of the same runs goes into a folder next to them; other runs are
    /// rejected.
    #[default]
    Keep,
    /// They stay, and those of an interrupted experiment are completed.
    Resume,
    /// They are replaced.
    Replace,
}

/// The file in the folder of a part that tells where its runs come from.
pub const PART_PROVENANCE: &str = "provenance.toml";

/// The name of `.partial/` while it is removed.
const REMOVED: &str = ".removed";

/// An experiment's folder, locked until dropped.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    partial: PathBuf,
    _lock: File,
}

impl Store {
    /// Creates and locks `folder`. If it has finished runs of an interrupted experiment, `existing`
    /// decides: they are resumed, which requires the same resolved spec, or discarded, or the
    /// folder is rejected.
    pub fn open(folder: &Path, resolved: &str, existing: Existing) -> Result<Self, Error> {
        let (folder, partial) = (folder.to_owned(), folder.join(".partial"));
        fs::create_dir_all(&folder).map_err(Error::io(&folder, "create the folder"))?;
        let lock = lock_folder(&folder)?;
        let removed = folder.join(REMOVED);
        if removed.exists() {
            remove(&removed)?;
        }
        // The spec is kept with the runs, because a run of another spec must never be resumed.
        let spec = partial.join("resolved.toml");
        let found = fs::read_to_string(&spec).ok();
        let rejected = |what: &str| Err(Error::Usage(format!("{}: {what}", folder.display())));
        match (existing, found) {
            (Existing::Resume, Some(found)) if found == resolved => {}
            (Existing::Resume, Some(_)) => {
                return rejected(
                    "the interrupted experiment had another spec, scene or seed; --force discards it",
                );
            }
            (Existing::Keep, Some(_)) if has_finished_runs(&partial)? => {
                return rejected(
                    "there are finished runs of an interrupted experiment; --resume does the rest, --force \
                     discards them",
                );
            }
            _ => {
                if partial.is_dir() {
                    fs::rename(&partial, &removed)
                        .map_err(Error::io(&partial, "rename the folder"))?;
                    remove(&removed)?;
                }
                fs::create_dir_all(&partial).map_err(Error::io(&partial, "create the folder"))?;
                files::write(&spec, resolved.as_bytes())?;
            }
        }
        Ok(Self { folder, partial, _lock: lock })
    }

    /// The folder of the results.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn part(&self, index: usize) -> PathBuf {
        self.partial.join(part_name(index))
    }

    /// Returns true if run `index` has been kept.
    ///
    /// # Errors
    ///
    /// If its files are damaged.
    pub fn has(&self, index: usize) -> Result<bool, Error> {
        let part = self.part(index);
        if part.is_dir() { FinishedRun::read(&part).map(|_| true) } else { Ok(false) }
    }

    /// Keeps run `index`. Replaces a damaged copy of it.
    pub fn keep(&self, index: usize, run: &FinishedRun) -> Result<(), Error> {
        let part = self.part(index);
        let unfinished = part.with_extension("unfinished");
        // A killed harness may have left half a folder under either name.
        for old in [&unfinished, &part] {
            if old.exists() {
                fs::remove_dir_all(old).map_err(Error::io(old, "remove the folder"))?;
            }
        }
        fs::create_dir(&unfinished).map_err(Error::io(&unfinished, "create the folder"))?;
        for (name, bytes) in &run.files {
            files::write_synced(&unfinished.join(name), bytes)?;
        }
        files::write_synced(&unfinished.join(CONTENTS), run.contents().as_bytes())?;
        fs::rename(&unfinished, &part).map_err(Error::io(&part, "rename the folder"))
    }

    /// Returns the rows of one kind of the kept run `index`; none if it has no such rows.
    pub fn rows<R: Row>(&self, index: usize) -> Result<Vec<R>, Error> {
        read_if_any(&self.part(index))
    }

    /// Joins all `runs` kept runs into the CSV files.
    pub fn join(&self, runs: usize) -> Result<(), Error> {
        let parts: Vec<(PathBuf, BTreeSet<String>)> = (0..runs)
            .map(|index| self.part(index))
            .map(|part| Ok((part.clone(), files::names(&part)?)))
            .collect::<Result<_, Error>>()?;
        let names: BTreeSet<&String> = parts
            .iter()
            .flat_map(|(_, names)| names)
            .collect();
        let names = names.into_iter().filter(|name| *name != CONTENTS);
        for name in names {
            let mut joined = Vec::new();
            for (part, _) in parts
                .iter()
                .filter(|(_, names)| names.contains(name))
            {
                let path = part.join(name);
                let bytes = fs::read(&path).map_err(Error::io(&path, "read the file"))?;
                // Every part begins with the same header line.
                let header = bytes
                    .iter()
                    .position(|&byte| byte == b'\n')
                    .map_or(bytes.len(), |end| end + 1);
                // A header in the middle would be read as a row.
                joined.extend_from_slice(if joined.is_empty() { &bytes } else { &bytes[header..] });
            }
            files::write(&self.folder.join(name), &joined)?;
        }
        Ok(())
    }

    /// Writes the file of one kind of rows.
    pub fn write_rows<R: Row>(&self, rows: &[R]) -> Result<(), Error> {
        self.write(R::FILE, &to_bytes(rows, Path::new(R::FILE))?)
    }

    /// Writes another file of the results.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        Ok(files::write(&self.folder.join(name), bytes)?)
    }

    /// The file next to the finished runs of a part that has their provenance.
    pub fn part_provenance(&self) -> PathBuf {
        self.partial.join(PART_PROVENANCE)
    }

    /// Removes the kept runs, which only an interrupted experiment needs. The lock file stays:
    /// removing it would race.
    pub fn finish(self) -> Result<(), Error> {
        // Renamed first, so that an interrupted removal leaves nothing that looks like finished
        // runs.
        let removed = self.folder.join(REMOVED);
        fs::rename(&self.partial, &removed)
            .map_err(Error::io(&self.partial, "rename the folder"))?;
        remove(&removed)
    }
}

/// Removes the runs of a harness that was killed after its results were complete.
pub fn remove_leftovers(folder: &Path) -> Result<(), Error> {
    let removed = folder.join(REMOVED);
    if !removed.exists() {
        return Ok(());
    }
    match lock_folder(folder) {
        Ok(_lock) => remove(&removed),
        // The other harness is removing them.
        Err(Error::Busy(_)) => Ok(()),
        Err(error) => Err(error),
    }
}

fn remove(folder: &Path) -> Result<(), Error> {
    fs::remove_dir_all(folder).map_err(Error::io(folder, "remove the folder"))
}

/// Returns the name of the folder of the kept run `index`.
pub fn part_name(index: usize) -> String {
    format!("{index:06}")
}

/// Returns true if an interrupted experiment, or a shard, has left finished runs in its folder.
pub fn is_unfinished(folder: &Path) -> bool {
    folder.join(".partial").exists()
}

fn has_finished_runs(partial: &Path) -> Result<bool, Error> {
    let is_run = |name: &String| !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_digit());
    Ok(files::names(partial)?.iter().any(is_run))
}

#[cfg(test)]
mod tests {
    use super::*;

    // The tests `faults` and `protection` run the program on folders that are in use, unfinished or
    // blocked.

    fn run() -> FinishedRun {
        let file = |name: &str, text: &str| (name.to_owned(), text.as_bytes().to_vec());
        FinishedRun {
            files: [file("runs.csv", "a,b\n1,2\n"), file("history.csv", "a\n1\n")].into(),
        }
    }

    #[test]
    fn a_kept_run_whose_files_are_missing_cut_emptied_or_edited_is_refused_by_name() {
        let out = tempfile::tempdir().unwrap();
        let store = Store::open(&out.path().join("x"), "", Existing::Keep).unwrap();
        type Damage = fn(&Path);
        let damages: [(&str, Damage); 6] = [
            ("runs.csv", |part| fs::remove_file(part.join("runs.csv")).unwrap()),
            ("runs.csv", |part| fs::write(part.join("runs.csv"), "").unwrap()),
            ("runs.csv", |part| fs::write(part.join("runs.csv"), "a,b\n").unwrap()),
            ("history.csv", |part| fs::write(part.join("history.csv"), "a\n2\n").unwrap()),
            ("rays.csv", |part| fs::write(part.join("rays.csv"), "a\n").unwrap()),
            (CONTENTS, |part| fs::remove_file(part.join(CONTENTS)).unwrap()),
        ];
        for (file, damage) in damages {
            store.keep(0, &run()).unwrap();
            assert!(store.has(0).unwrap());
            damage(&store.part(0));
            let message = store.has(0).unwrap_err().to_string();
            assert!(message.contains(file) && message.contains("000000"), "{message}");
        }
        // The run is done again, and what was damaged is replaced.
        store.keep(0, &run()).unwrap();
        assert!(store.has(0).unwrap());
    }
}
