//! The folder of one experiment's results: one writer at a time, finished runs kept one by one,
//! files replaced whole.
//!
//! Until all runs are finished, each finished one is *kept* as a file `.partial/NNNNNN.run` with its
//! own rows. The file is written under another name, synced, and renamed, so that every finished
//! run survives a crash, a full disk or `kill -9`. At the end the rows of all runs are joined in
//! the order of the spec, so that their bytes do not depend on the order in which runs finish.

use super::kept_run::{KeptRun, RunName};
use super::lock::lock_folder;
use super::{Row, to_bytes};
use crate::Error;
use crate::files;
use bvh_scenes::files::read_text;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
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

/// The file with the resolved spec, of finished results or, in `.partial/`, of kept runs, which do not
/// count without it.
const SPEC: &str = "resolved.toml";

/// How the names of files of kept runs end.
const RUN: &str = ".run";

/// An experiment's folder, locked until dropped.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    partial: PathBuf,
    _lock: File,
}

impl Store {
    /// Creates and locks `folder`, whatever it has.
    ///
    /// # Errors
    ///
    /// If another harness has locked the folder, or if it cannot be written.
    pub fn lock(folder: &Path) -> Result<Self, Error> {
        let (folder, partial) = (folder.to_owned(), folder.join(".partial"));
        fs::create_dir_all(&folder).map_err(Error::io(&folder, "create the folder"))?;
        let lock = lock_folder(&folder)?;
        Ok(Self { folder, partial, _lock: lock })
    }

    /// Creates and locks `folder` for the experiment with this resolved spec. If the folder has
    /// finished runs of an interrupted experiment, `existing` decides: they are resumed, which
    /// requires the same resolved spec, or discarded, or the folder is rejected.
    ///
    /// # Errors
    ///
    /// If another harness has locked the folder, if its finished runs may be neither resumed nor
    /// discarded, or if the folder cannot be read or written.
    pub fn open(
        folder: &Path,
        resolved: &impl Serialize,
        existing: Existing,
    ) -> Result<Self, Error> {
        let resolved = to_toml(resolved)?;
        let store = Self::lock(folder)?;
        // The spec is kept with the runs, because a run of another spec must never be resumed.
        let spec = store.partial.join(SPEC);
        // Where it cannot be told whether there is one, reading says why.
        if existing != Existing::Replace && spec.try_exists().unwrap_or(true) {
            let is_same = read_text(&spec)? == resolved;
            let has_runs = files::names(&store.partial)?.iter().any(|name| name.ends_with(RUN));
            let reason = match existing {
                Existing::Resume if is_same => return Ok(store),
                Existing::Resume => Some(
                    "the interrupted experiment had another spec, scene or seed; --force discards it",
                ),
                _ => has_runs.then_some(
                    "there are finished runs of an interrupted experiment; --resume does the rest, \
                     --force discards them",
                ),
            };
            if let Some(reason) = reason {
                return Err(Error::Usage(format!("{}: {reason}", folder.display())));
            }
        }
        store.discard_runs()?;
        fs::create_dir_all(&store.partial)
            .map_err(Error::io(&store.partial, "create the folder"))?;
        files::write(&spec, resolved.as_bytes())?;
        Ok(store)
    }

    fn discard_runs(&self) -> Result<(), Error> {
        if !self.partial.is_dir() {
            return Ok(());
        }
        // The spec first, so that an interrupted removal leaves nothing that looks like finished
        // runs.
        let spec = self.partial.join(SPEC);
        if spec.exists() {
            fs::remove_file(&spec).map_err(Error::io(&spec, "remove the file"))?;
        }
        fs::remove_dir_all(&self.partial).map_err(Error::io(&self.partial, "remove the folder"))
    }

    /// The folder of the results.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn run_file(&self, index: usize) -> PathBuf {
        self.partial.join(run_file_name(index))
    }

    /// Returns run `index`, which has this name, if it has been kept.
    ///
    /// # Errors
    ///
    /// If its file is damaged or that of another run.
    pub fn kept(&self, index: usize, name: &RunName) -> Result<Option<KeptRun>, Error> {
        let file = self.run_file(index);
        if file.exists() { KeptRun::read_named(&file, name).map(Some) } else { Ok(None) }
    }

    /// Keeps run `index`. Replaces a damaged copy of it.
    pub fn keep(&self, index: usize, run: &KeptRun) -> Result<(), Error> {
        let file = self.run_file(index);
        // What stands there may be a link, which a new file must not be written through.
        if file.symlink_metadata().is_ok() {
            fs::remove_file(&file).map_err(Error::io(&file, "remove the file"))?;
        }
        run.write(&file)
    }

    /// Keeps those of the runs with these names, in the order of the spec, that a part of the
    /// experiment in the folder `part` has and this folder has not.
    ///
    /// # Errors
    ///
    /// If the part is of another spec, scene or seed, if a run of it is damaged or another one, or
    /// if it has another result than the run that this folder has.
    pub fn adopt(&self, part: &Path, names: &[RunName]) -> Result<(), Error> {
        let spec = spec_of_part(part);
        if read_text(&spec)? != read_text(&self.partial.join(SPEC))? {
            let spec = spec.display();
            return Err(Error::Usage(format!("{spec} has another spec, scene or seed")));
        }
        for (index, name) in names.iter().enumerate() {
            let file = spec.with_file_name(run_file_name(index));
            if !file.exists() {
                continue;
            }
            let run = KeptRun::read_named(&file, name)?;
            match self.kept(index, name)? {
                None => self.keep(index, &run)?,
                Some(kept) => {
                    if let Some(name) = kept.difference(&run) {
                        let file = file.display();
                        return Err(Error::Usage(format!(
                            "{file}: an earlier part, or --out, has this run with another {name}"
                        )));
                    }
                }
            }
        }
        Ok(())
    }

    /// Joins the CSV files of runs 0 to `runs` − 1, which have been kept, in this order. Returns the
    /// names of the processors that performed them.
    pub fn join(&self, runs: usize) -> Result<BTreeSet<String>, Error> {
        let mut joined: BTreeMap<String, String> = BTreeMap::new();
        let mut processors = BTreeSet::new();
        for index in 0..runs {
            let run = KeptRun::read(&self.run_file(index))?;
            processors.insert(run.processor);
            for (name, text) in run.files {
                match joined.get_mut(&name) {
                    // All runs have the same header, which would be a row in the middle of the file.
                    Some(rows) => *rows += text.split_once('\n').map_or("", |(_, rows)| rows),
                    None => _ = joined.insert(name, text),
                }
            }
        }
        for (name, text) in joined {
            self.write(&name, text.as_bytes())?;
        }
        Ok(processors)
    }

    /// Writes the file of one kind of rows.
    pub fn write_rows<R: Row>(&self, rows: &[R]) -> Result<(), Error> {
        self.write(R::FILE, &to_bytes(rows, Path::new(R::FILE))?)
    }

    /// Writes a value as a TOML file.
    pub fn write_toml(&self, name: &str, value: &impl Serialize) -> Result<(), Error> {
        self.write(name, to_toml(value)?.as_bytes())
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

/// The file of a part in this folder with the resolved spec of its runs.
pub fn spec_of_part(folder: &Path) -> PathBuf {
    folder.join(".partial").join(SPEC)
}

fn to_toml(value: &impl Serialize) -> Result<String, Error> {
    toml::to_string(value)
        .map_err(|error| Error::Usage(format!("cannot be written as TOML: {error}")))
}

fn run_file_name(index: usize) -> String {
    format!("{index:06}{RUN}")
}

/// Returns true if an interrupted experiment, or a part of one, has left its spec in the folder, with
/// finished runs or before the first one was finished. Other results in the folder then do not count:
/// some of their files may be replaced already.
pub fn is_unfinished(folder: &Path) -> bool {
    spec_of_part(folder).exists()
}

/// Returns the text of the resolved spec of the finished results in a folder, if it has any.
pub fn finished_spec(folder: &Path) -> Result<Option<String>, Error> {
    let recorded = folder.join(SPEC);
    if is_unfinished(folder) || !recorded.is_file() {
        return Ok(None);
    }
    Ok(Some(read_text(&recorded)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::ErrorKind;
    use toml::Table;

    // The tests `faults` and `protection` run the program on folders that are in use, unfinished or
    // blocked.

    /// The file and the name of a run.
    fn named(cost: u32) -> (String, RunName) {
        let [scene, method] = ["s", "m"].map(String::from);
        let rows = format!("scene,method,repetition,cost\ns,m,0,{cost}\n");
        (rows, RunName { scene, method, repetition: 0 })
    }

    fn run<const N: usize>(files: [(&str, &str); N]) -> KeptRun {
        let files = files.map(|(name, text)| (name.to_owned(), text.to_owned()));
        KeptRun { files: files.into(), ..KeptRun::here() }
    }

    #[test]
    fn a_part_with_another_result_of_a_kept_run_is_rejected_and_other_seconds_are_not() {
        let folders = ["a", "b"].map(|_| tempfile::tempdir().unwrap());
        let [kept, part] =
            [0, 1].map(|i| Store::open(folders[i].path(), &Table::new(), Existing::Keep).unwrap());
        let run = |cost, seconds| run([("runs.csv", &*named(cost).0), ("timing.csv", seconds)]);
        let names = [named(1).1];
        kept.keep(0, &run(1, "0.1\n")).unwrap();
        part.keep(0, &run(1, "0.2\n")).unwrap();
        kept.adopt(part.folder(), &names).unwrap();
        part.keep(0, &run(2, "0.1\n")).unwrap();
        let error = kept.adopt(part.folder(), &names).unwrap_err().to_string();
        assert!(error.ends_with("has this run with another runs.csv"), "{error}");
    }

    #[test]
    fn a_kept_run_that_is_emptied_cut_edited_or_no_file_is_refused_and_done_again() {
        let out = tempfile::tempdir().unwrap();
        let store = Store::open(&out.path().join("x"), &Table::new(), Existing::Keep).unwrap();
        let (rows, name) = named(12);
        let run = run([("runs.csv", &*rows), ("history.csv", "a\n1\n")]);
        let file = store.run_file(0);
        type Damage = fn(&Path, &str);
        let mut damages: Vec<Damage> = vec![
            |file, _| fs::write(file, "").unwrap(),
            |file, text| fs::write(file, &text[..text.len() - 1]).unwrap(),
            |file, text| fs::write(file, text.replace(",12", ",13")).unwrap(),
        ];
        #[cfg(unix)]
        damages.push(|file, _| {
            // A device that never ends.
            fs::remove_file(file).unwrap();
            std::os::unix::fs::symlink("/dev/zero", file).unwrap();
        });
        for damage in damages {
            store.keep(0, &run).unwrap();
            assert_eq!(store.kept(0, &name).unwrap().as_ref(), Some(&run));
            damage(&file, &fs::read_to_string(&file).unwrap());
            let message = store.kept(0, &name).unwrap_err().to_string();
            assert!(message.contains("000000.run is damaged"), "{message}");
        }
    }

    #[test]
    fn finished_runs_are_not_discarded_because_their_spec_cannot_be_read() {
        let out = tempfile::tempdir().unwrap();
        let folder = out.path().join("x");
        Store::open(&folder, &Table::new(), Existing::Keep)
            .unwrap()
            .keep(0, &run([("runs.csv", "a\n1\n")]))
            .unwrap();
        let spec = folder.join(".partial").join(SPEC);
        fs::write(&spec, [0xff]).unwrap();
        for existing in [Existing::Keep, Existing::Resume] {
            let error = Store::open(&folder, &Table::new(), existing).unwrap_err();
            let Error::Read(error) = error else { panic!("{error}") };
            assert_eq!((error.kind(), error.path), (ErrorKind::InvalidData, spec.clone()));
        }
        assert!(folder.join(".partial/000000.run").is_file());
        Store::open(&folder, &Table::new(), Existing::Replace).unwrap();
        assert!(!folder.join(".partial/000000.run").exists());
    }
}
