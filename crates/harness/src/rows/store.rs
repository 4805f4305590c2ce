//! The folder of one experiment's results: one writer at a time, finished runs kept one by one,
//! files replaced whole.
//!
//! Until all runs are finished, each finished one is *kept* as a folder `.partial/NNNNNN/` with its
//! own rows. The folder is written under another name, synced, and renamed, so that every finished
//! run survives a crash, a full disk or `kill -9`. At the end the rows of all runs are joined in
//! the order of the spec, so that their bytes do not depend on the order in which runs finish.

use super::finished_run::{CONTENTS, FinishedRun};
use super::lock::lock_folder;
use super::{Row, read_if_any, to_bytes};
use crate::Error;
use crate::files;
use bvh_scenes::files::{ReadError, read_text};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// The treatment of results that are in the folder already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Existing {
    /// They stay, and a run that would replace them is rejected.
    #[default]
    Keep,
    /// They stay, and those of an interrupted experiment are completed.
    Resume,
    /// They are replaced.
    Replace,
}

/// The file in `.partial/` with the resolved spec of its runs.
const SPEC: &str = "resolved.toml";

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
    /// Creates and locks `folder` for the experiment whose resolved spec is the text `resolved`. If
    /// the folder has finished runs of an interrupted experiment, `existing` decides: they are
    /// resumed, which requires the same resolved spec, or discarded, or the folder is rejected.
    ///
    /// # Errors
    ///
    /// If another harness has locked the folder, if its finished runs may be neither resumed nor
    /// discarded, or if the folder cannot be read or written.
    pub fn open(folder: &Path, resolved: &str, existing: Existing) -> Result<Self, Error> {
        let folder = folder.to_owned();
        let partial = folder.join(".partial");
        fs::create_dir_all(&folder).map_err(Error::io(&folder, "create the folder"))?;
        let lock = lock_folder(&folder)?;
        remove_if_any(&folder.join(REMOVED))?;
        let store = Self { folder, partial, _lock: lock };
        // The spec is kept with the runs, because a run of another spec must never be resumed.
        let spec = store.partial.join(SPEC);
        let found = match existing {
            Existing::Replace => None,
            Existing::Keep | Existing::Resume => read_text_if_any(&spec)?,
        };
        match (existing, found) {
            (Existing::Resume, Some(found)) if found == resolved => return Ok(store),
            (Existing::Resume, Some(_)) => {
                return Err(store.rejected(
                    "the interrupted experiment had another spec, scene or seed; --force discards it",
                ));
            }
            (Existing::Keep, Some(_)) if has_finished_runs(&store.partial)? => {
                return Err(store.rejected(
                    "there are finished runs of an interrupted experiment; --resume does the rest, \
                     --force discards them",
                ));
            }
            _ => {}
        }
        store.discard_runs()?;
        fs::create_dir_all(&store.partial)
            .map_err(Error::io(&store.partial, "create the folder"))?;
        files::write(&spec, resolved.as_bytes())?;
        Ok(store)
    }

    /// Returns the error that the folder is rejected, with the reason.
    fn rejected(&self, reason: &str) -> Error {
        Error::Usage(format!("{}: {reason}", self.folder.display()))
    }

    /// Removes `.partial/`, if there is one.
    fn discard_runs(&self) -> Result<(), Error> {
        if !self.partial.is_dir() {
            return Ok(());
        }
        // Renamed first, so that an interrupted removal leaves nothing that looks like finished
        // runs.
        let removed = self.folder.join(REMOVED);
        fs::rename(&self.partial, &removed)
            .map_err(Error::io(&self.partial, "rename the folder"))?;
        remove(&removed)
    }

    /// The folder of the results.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns the folder that run `index` has once it is kept.
    fn run_folder(&self, index: usize) -> PathBuf {
        self.partial.join(run_folder_name(index))
    }

    /// Returns true if run `index` has been kept.
    ///
    /// # Errors
    ///
    /// If its files are damaged.
    pub fn has(&self, index: usize) -> Result<bool, Error> {
        let run_folder = self.run_folder(index);
        if !run_folder.is_dir() {
            return Ok(false);
        }
        FinishedRun::read(&run_folder)?;
        Ok(true)
    }

    /// Keeps run `index`. Replaces a damaged copy of it.
    pub fn keep(&self, index: usize, run: &FinishedRun) -> Result<(), Error> {
        let run_folder = self.run_folder(index);
        let unfinished = run_folder.with_extension("unfinished");
        // A killed harness may have left half a folder under either name.
        remove_if_any(&unfinished)?;
        remove_if_any(&run_folder)?;
        run.write(&unfinished)?;
        fs::rename(&unfinished, &run_folder).map_err(Error::io(&run_folder, "rename the folder"))
    }

    /// Keeps those of the runs 0 to `runs` − 1 that a part of the experiment in the folder `part` has
    /// and this folder has not.
    ///
    /// # Errors
    ///
    /// If the part is of another spec, scene or seed, if a run of it is damaged, or if it has
    /// another result than the run that this folder has.
    pub fn adopt(&self, part: &Path, runs: usize) -> Result<(), Error> {
        let spec = spec_of_part(part);
        if read_text(&spec)? != read_text(&self.partial.join(SPEC))? {
            let spec = spec.display();
            return Err(Error::Usage(format!("--from: {spec} has another spec, scene or seed")));
        }
        for index in 0..runs {
            let run_folder = spec.with_file_name(run_folder_name(index));
            if !run_folder.is_dir() {
                continue;
            }
            let run = FinishedRun::read(&run_folder)?;
            let kept = self.run_folder(index);
            if !kept.is_dir() {
                self.keep(index, &run)?;
            } else if let Some(file) = FinishedRun::read(&kept)?.difference(&run) {
                let (found, kept) = (run_folder.display(), kept.display());
                return Err(Error::Usage(format!("{found} and {kept} have different {file}")));
            }
        }
        Ok(())
    }

    /// Returns an error that names some of the runs 0 to `runs` − 1 that are not kept.
    pub fn check_complete(&self, runs: usize, name: impl Fn(usize) -> String) -> Result<(), Error> {
        let mut missing = Vec::new();
        for index in 0..runs {
            if !self.has(index)? {
                missing.push(index);
            }
        }
        if missing.is_empty() {
            return Ok(());
        }
        // A part that never ran misses thousands of runs.
        let names: Vec<String> = missing.iter().take(5).map(|&index| name(index)).collect();
        let (count, names) = (missing.len(), names.join("; "));
        Err(Error::Usage(format!("{count} of {runs} runs are missing: {names}")))
    }

    /// Returns the rows of one kind of the kept run `index`; none if it has no such rows.
    pub fn rows<R: Row>(&self, index: usize) -> Result<Vec<R>, Error> {
        read_if_any(&self.run_folder(index))
    }

    /// Joins the CSV files of runs 0 to `runs` − 1, which have been kept, in this order.
    pub fn join(&self, runs: usize) -> Result<(), Error> {
        // By name, the folders of the runs that have such a file.
        let mut folders_by_name: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
        for index in 0..runs {
            let run_folder = self.run_folder(index);
            for name in files::names(&run_folder)? {
                folders_by_name.entry(name).or_default().push(run_folder.clone());
            }
        }
        folders_by_name.remove(CONTENTS);
        for (name, run_folders) in folders_by_name {
            let mut joined = Vec::new();
            for run_folder in run_folders {
                let path = run_folder.join(&name);
                let bytes = bvh_scenes::files::read(&path)?;
                // All runs have the same header, which would be a row in the middle of the file.
                let added = if joined.is_empty() { &bytes } else { without_header(&bytes) };
                joined.extend_from_slice(added);
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

    /// Removes the kept runs, which only an interrupted experiment needs. The lock file stays:
    /// removing it would race.
    pub fn finish(self) -> Result<(), Error> {
        self.discard_runs()
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

/// Returns the text of a file; `None` if there is no such file.
fn read_text_if_any(path: &Path) -> Result<Option<String>, Error> {
    match read_text(path) {
        Ok(text) => Ok(Some(text)),
        Err(ReadError::NotFound { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Removes a folder and everything in it, if there is one.
fn remove_if_any(folder: &Path) -> Result<(), Error> {
    if folder.exists() { remove(folder) } else { Ok(()) }
}

/// Returns the lines of a CSV file below its header.
fn without_header(bytes: &[u8]) -> &[u8] {
    match bytes.iter().position(|&byte| byte == b'\n') {
        Some(end) => &bytes[end + 1..],
        None => &[],
    }
}

/// The file of a part in this folder with the resolved spec of its runs.
pub fn spec_of_part(folder: &Path) -> PathBuf {
    folder.join(".partial").join(SPEC)
}

/// Returns the name of the folder of the kept run `index`.
fn run_folder_name(index: usize) -> String {
    format!("{index:06}")
}

/// Returns true if an interrupted experiment, or a part of one, has left finished runs in its folder.
pub fn is_unfinished(folder: &Path) -> bool {
    folder.join(".partial").exists()
}

/// Returns true if a folder `.partial/` has kept runs.
fn has_finished_runs(partial: &Path) -> Result<bool, Error> {
    let names = files::names(partial)?;
    Ok(names.iter().any(|name| is_run_folder_name(name)))
}

/// Returns true if a name is one of [`run_folder_name`].
fn is_run_folder_name(name: &str) -> bool {
    !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    // The tests `faults` and `protection` run the program on folders that are in use, unfinished or
    // blocked.

    fn run() -> FinishedRun {
        FinishedRun::of_texts([("runs.csv", "a,b\n1,2\n"), ("history.csv", "a\n1\n")])
    }

    #[test]
    fn a_part_with_another_result_of_a_kept_run_is_rejected_and_other_seconds_are_not() {
        let folders = ["a", "b"].map(|_| tempfile::tempdir().unwrap());
        let [kept, part] =
            [0, 1].map(|i| Store::open(folders[i].path(), "", Existing::Keep).unwrap());
        let run = |cost: &'static str, seconds: &'static str| {
            FinishedRun::of_texts([("runs.csv", cost), ("timing.csv", seconds)])
        };
        kept.keep(0, &run("1\n", "0.1\n")).unwrap();
        part.keep(0, &run("1\n", "0.2\n")).unwrap();
        kept.adopt(part.folder(), 1).unwrap();
        part.keep(0, &run("2\n", "0.1\n")).unwrap();
        let error = kept.adopt(part.folder(), 1).unwrap_err().to_string();
        assert!(error.ends_with("have different runs.csv"), "{error}");
    }

    /// Puts a device that never ends in the place of a file.
    #[cfg(unix)]
    fn replace_by_device(path: &Path) {
        fs::remove_file(path).unwrap();
        std::os::unix::fs::symlink("/dev/zero", path).unwrap();
    }

    #[test]
    fn a_kept_run_whose_files_are_missing_cut_emptied_or_edited_is_refused_by_name() {
        let out = tempfile::tempdir().unwrap();
        let store = Store::open(&out.path().join("x"), "", Existing::Keep).unwrap();
        type Damage = fn(&Path);
        let mut damages: Vec<(&str, Damage)> = vec![
            ("runs.csv", |run| fs::remove_file(run.join("runs.csv")).unwrap()),
            ("runs.csv", |run| fs::write(run.join("runs.csv"), "").unwrap()),
            ("runs.csv", |run| fs::write(run.join("runs.csv"), "a,b\n").unwrap()),
            ("history.csv", |run| fs::write(run.join("history.csv"), "a\n2\n").unwrap()),
            ("rays.csv", |run| fs::write(run.join("rays.csv"), "a\n").unwrap()),
            (CONTENTS, |run| fs::remove_file(run.join(CONTENTS)).unwrap()),
        ];
        #[cfg(unix)]
        damages.extend([
            ("runs.csv", (|run| replace_by_device(&run.join("runs.csv"))) as Damage),
            (CONTENTS, |run| replace_by_device(&run.join(CONTENTS))),
        ]);
        for (file, damage) in damages {
            store.keep(0, &run()).unwrap();
            assert!(store.has(0).unwrap());
            damage(&store.run_folder(0));
            let message = store.has(0).unwrap_err().to_string();
            assert!(message.contains(file) && message.contains("000000"), "{message}");
        }
        // The run is done again, and what was damaged is replaced.
        store.keep(0, &run()).unwrap();
        assert!(store.has(0).unwrap());
    }

    #[test]
    fn finished_runs_are_not_discarded_because_their_spec_cannot_be_read() {
        let out = tempfile::tempdir().unwrap();
        let folder = out.path().join("x");
        Store::open(&folder, "", Existing::Keep).unwrap().keep(0, &run()).unwrap();
        let spec = folder.join(".partial").join(SPEC);
        fs::write(&spec, [0xff]).unwrap();
        for existing in [Existing::Keep, Existing::Resume] {
            let error = Store::open(&folder, "", existing).unwrap_err();
            assert!(matches!(error, Error::Read(ReadError::NotUtf8 { path, .. }) if path == spec));
        }
        assert!(folder.join(".partial/000000/runs.csv").is_file());
        Store::open(&folder, "", Existing::Replace).unwrap();
        assert!(!folder.join(".partial/000000").exists());
    }
}
