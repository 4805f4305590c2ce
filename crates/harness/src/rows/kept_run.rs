//! The rows of one finished run, and the file in which they are kept.

use super::RunRow;
use super::csv_file::{Row, parse, to_bytes};
use crate::processor::PROCESSOR;
use crate::{Error, files};
use bvh_scenes::{files::read_text, fnv1a};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

/// What tells the runs of an experiment apart.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[allow(missing_docs, reason = "columns of `runs.csv`")]
pub struct RunName {
    pub scene: String,
    pub method: String,
    pub repetition: u32,
}

impl fmt::Display for RunName {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { scene, method, repetition } = self;
        write!(f, "scene {scene}, method {method}, repetition {repetition}")
    }
}

/// The rows of one finished run: one CSV file for every kind of rows that it has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeptRun {
    /// The processor that performed it.
    pub(super) processor: String,
    /// The texts of the files by their names.
    pub(super) files: BTreeMap<String, String>,
}

impl KeptRun {
    /// Makes a run of this processor without rows.
    pub fn here() -> Self {
        Self { processor: PROCESSOR.name(), files: BTreeMap::new() }
    }

    /// Adds rows of one kind, once per kind. An empty slice adds no file.
    pub fn add<R: Row>(&mut self, rows: &[R]) -> Result<(), Error> {
        if !rows.is_empty() {
            let text = to_bytes(rows, Path::new(R::FILE))?;
            self.files.insert(R::FILE.into(), String::from_utf8_lossy(&text).into_owned());
        }
        Ok(())
    }

    /// Returns the rows of one kind; none if the run has no such rows.
    pub fn rows<R: Row>(&self) -> Result<Vec<R>, Error> {
        let text = self.files.get(R::FILE).map_or("", String::as_str);
        parse(text.as_bytes(), Path::new(R::FILE))
    }

    /// Reads a kept run, which must have this name.
    ///
    /// # Errors
    ///
    /// If the file differs from the written one, or if it is that of another run.
    pub fn read_named(path: &Path, name: &RunName) -> Result<Self, Error> {
        let run = Self::read(path)?;
        let text = run.files.get(RunRow::FILE).map_or("", String::as_str);
        let names: Vec<RunName> = parse(text.as_bytes(), path)?;
        if names == [name.clone()] {
            return Ok(run);
        }
        let found = names.first().map_or("no run".into(), RunName::to_string);
        Err(Error::OtherRun { path: path.to_owned(), found, accepted: name.to_string() })
    }

    /// Reads a kept run.
    ///
    /// # Errors
    ///
    /// If the file differs from the written one.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let damaged = || Error::Damaged(path.to_owned());
        let text = read_text(path).map_err(|_| damaged())?;
        let (sum, run) = text.split_once('\n').ok_or_else(damaged)?;
        if sum != checksum(run) {
            return Err(damaged());
        }
        serde_json::from_str(run).map_err(|_| damaged())
    }

    /// Writes the run whole or not at all, and waits until it is on the disk.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let run = serde_json::json!(self).to_string();
        let text = format!("{}\n{run}", checksum(&run));
        Ok(files::write(path, text.as_bytes())?)
    }

    /// Returns the name of the first file in which two runs differ. Files of seconds, whose names
    /// begin with `timing`, are not compared: they differ always.
    pub fn difference<'a>(&'a self, other: &'a Self) -> Option<&'a str> {
        let names = self.files.keys().chain(other.files.keys()).map(String::as_str);
        names
            .filter(|name| !name.starts_with("timing"))
            .find(|&name| self.files.get(name) != other.files.get(name))
    }
}

fn checksum(text: &str) -> String {
    format!("{:016x}", fnv1a(text.bytes()))
}
