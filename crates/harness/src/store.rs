//! The folder of one experiment's results: one writer at a time, finished runs kept one by one, files replaced whole.
//!
//! While runs go on, each finished one is a folder `.partial/NNNNNN/` with the rows of its own, written under
//! another name, synced, and renamed: after a crash, a full disk or `kill -9` every finished run is there. When all are,
//! their rows are joined in the order of the spec, so the bytes do not depend on the order of finishing.

use crate::Error;
use crate::record::{ClockRow, HistoryRow, RayRow, RenderRow, RenderTimeRow, RunRow, TimingRow, to_bytes};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The rows of one finished run.
#[derive(Clone, Debug)]
pub struct FinishedRun {
    /// For `runs.csv`.
    pub run: RunRow,
    /// For `history.csv`.
    pub history: Vec<HistoryRow>,
    /// For `timing.csv`.
    pub timing: TimingRow,
    /// For `rays.csv`, which is written if there are any.
    pub rays: Vec<RayRow>,
    /// For `timing_history.csv`, likewise.
    pub clock: Vec<ClockRow>,
    /// For `renders.csv`, likewise.
    pub renders: Vec<RenderRow>,
    /// For `timing_renders.csv`, likewise.
    pub render_times: Vec<RenderTimeRow>,
}

/// The files that are joined from those of the runs.
const JOINED: [&str; 7] = [
    "runs.csv",
    "history.csv",
    "timing.csv",
    "rays.csv",
    "timing_history.csv",
    "renders.csv",
    "timing_renders.csv",
];

/// An experiment's folder, locked until dropped.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    partial: PathBuf,
    _lock: File,
}

impl Store {
    /// Creates and locks `out/name`. With `resume`, keeps the finished runs of an interrupted experiment, which must
    /// have had the same resolved spec; without, discards them.
    pub fn open(out: &Path, name: &str, resolved: &str, resume: bool) -> Result<Self, Error> {
        let folder = out.join(name);
        let partial = folder.join(".partial");
        fs::create_dir_all(&folder).map_err(Error::io(&folder, "create the folder"))?;
        let lock_path = folder.join(".lock");
        let lock = File::create(&lock_path).map_err(Error::io(&lock_path, "create the file"))?;
        lock.try_lock().map_err(|error| match error {
            fs::TryLockError::WouldBlock => Error::Busy(folder.clone()),
            fs::TryLockError::Error(source) => Error::Io { path: lock_path, action: "lock the file", source },
        })?;
        let spec = partial.join("resolved.toml");
        let found = fs::read_to_string(&spec).ok();
        match found {
            Some(found) if resume && found != resolved => {
                return Err(Error::Usage(format!(
                    "{}: the interrupted experiment had another spec, scene or seed; start over without --resume",
                    folder.display()
                )));
            }
            Some(_) if resume => {}
            _ => {
                if partial.exists() {
                    fs::remove_dir_all(&partial).map_err(Error::io(&partial, "remove the folder"))?;
                }
                fs::create_dir_all(&partial).map_err(Error::io(&partial, "create the folder"))?;
                write_whole(&spec, resolved.as_bytes())?;
            }
        }
        Ok(Self { folder, partial, _lock: lock })
    }

    /// Where the results go.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn part(&self, index: usize) -> PathBuf {
        self.partial.join(format!("{index:06}"))
    }

    /// Whether run `index` has been kept.
    pub fn has(&self, index: usize) -> bool {
        self.part(index).is_dir()
    }

    /// Keeps run `index`.
    pub fn keep(&self, index: usize, run: &FinishedRun) -> Result<(), Error> {
        let part = self.part(index);
        let unfinished = part.with_extension("unfinished");
        if unfinished.exists() {
            fs::remove_dir_all(&unfinished).map_err(Error::io(&unfinished, "remove the folder"))?;
        }
        fs::create_dir(&unfinished).map_err(Error::io(&unfinished, "create the folder"))?;
        let contents = [
            to_bytes(std::slice::from_ref(&run.run), &part)?,
            to_bytes(&run.history, &part)?,
            to_bytes(std::slice::from_ref(&run.timing), &part)?,
            to_bytes(&run.rays, &part)?,
            to_bytes(&run.clock, &part)?,
            to_bytes(&run.renders, &part)?,
            to_bytes(&run.render_times, &part)?,
        ];
        for (name, bytes) in JOINED.iter().zip(contents) {
            write_synced(&unfinished.join(name), &bytes)?;
        }
        fs::rename(&unfinished, &part).map_err(Error::io(&part, "rename the folder"))
    }

    /// Joins all `runs` kept runs into the CSV files.
    pub fn join(&self, runs: usize) -> Result<(), Error> {
        for name in JOINED {
            let mut joined = Vec::new();
            for index in 0..runs {
                let path = self.part(index).join(name);
                let bytes = fs::read(&path).map_err(Error::io(&path, "read the file"))?;
                // Every part begins with the same header line.
                let header = bytes.iter().position(|&byte| byte == b'\n').map_or(bytes.len(), |end| end + 1);
                joined.extend_from_slice(if joined.is_empty() { &bytes } else { &bytes[header..] });
            }
            if !joined.is_empty() {
                write_whole(&self.folder.join(name), &joined)?;
            }
        }
        Ok(())
    }

    /// Writes another file of the results.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        write_whole(&self.folder.join(name), bytes)
    }

    /// Removes what only an interrupted experiment needs. The lock file stays: removing it would race.
    pub fn finish(self) -> Result<(), Error> {
        fs::remove_dir_all(&self.partial).map_err(Error::io(&self.partial, "remove the folder"))
    }
}

/// Replaces the file at `path` by `bytes`: at any moment it is the old file or the whole new one.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let mut unfinished = path.as_os_str().to_owned();
    unfinished.push(".unfinished");
    let unfinished = PathBuf::from(unfinished);
    write_synced(&unfinished, bytes)?;
    fs::rename(&unfinished, path).map_err(Error::io(path, "replace the file"))
}

fn write_synced(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let write = |path: &Path| {
        let mut file = File::create(path)?;
        file.write_all(bytes)?;
        file.sync_all()
    };
    write(path).map_err(Error::io(path, "write the file"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_writer_is_refused() {
        let out = tempfile::tempdir().unwrap();
        let first = Store::open(out.path(), "x", "", false).unwrap();
        assert!(matches!(Store::open(out.path(), "x", "", false), Err(Error::Busy(_))));
        drop(first);
        assert!(Store::open(out.path(), "x", "", false).is_ok());
    }

    #[test]
    fn only_the_same_spec_can_be_resumed() {
        let out = tempfile::tempdir().unwrap();
        drop(Store::open(out.path(), "x", "a", false).unwrap());
        assert!(matches!(Store::open(out.path(), "x", "b", true), Err(Error::Usage(_))));
        assert!(Store::open(out.path(), "x", "a", true).is_ok());
    }

    #[test]
    fn a_file_where_the_folder_should_be_is_named() {
        let out = tempfile::tempdir().unwrap();
        fs::write(out.path().join("x"), "").unwrap();
        let message = Store::open(out.path(), "x", "", false).unwrap_err().to_string();
        assert!(message.contains("cannot create the folder"), "{message}");
    }
}
