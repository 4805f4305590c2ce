//! The rows of one finished run, and the folder in which a run is kept.

use super::{Row, to_bytes};
use crate::Error;
use crate::files;
use bvh_scenes::files::read_text;
use bvh_scenes::fnv1a;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// The file in which a kept run lists its other files, one a line: name, number of bytes and
/// checksum.
pub(super) const CONTENTS: &str = "contents.txt";

/// The rows of one finished run: one CSV file for every kind of rows that it has.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FinishedRun {
    files: BTreeMap<String, Vec<u8>>,
}

impl FinishedRun {
    /// Returns a run that has these files.
    #[cfg(test)]
    pub(super) fn of_texts<const N: usize>(files: [(&str, &str); N]) -> Self {
        let files = files.map(|(name, text)| (name.to_owned(), text.as_bytes().to_vec()));
        Self { files: files.into() }
    }

    /// Adds rows of one kind, once per kind. An empty slice adds no file.
    pub fn add<R: Row>(&mut self, rows: &[R]) -> Result<(), Error> {
        if !rows.is_empty() {
            self.files.insert(R::FILE.into(), to_bytes(rows, Path::new(R::FILE))?);
        }
        Ok(())
    }

    /// Reads the kept run in `folder`.
    ///
    /// # Errors
    ///
    /// If a file of the run is missing, was added or differs from the written one.
    pub fn read(folder: &Path) -> Result<Self, Error> {
        let damaged = |file: &str| Error::Damaged { run: folder.to_owned(), file: file.to_owned() };
        let contents = read_text(&folder.join(CONTENTS)).map_err(|_| damaged(CONTENTS))?;
        let mut names = files::names(folder)?;
        names.remove(CONTENTS);
        let mut files = BTreeMap::new();
        for name in names {
            let bytes = bvh_scenes::files::read(&folder.join(&name)).map_err(|_| damaged(&name))?;
            files.insert(name, bytes);
        }
        let run = Self { files };
        let found = run.contents();
        let lines_found: BTreeSet<&str> = found.lines().collect();
        let lines_written: BTreeSet<&str> = contents.lines().collect();
        if let Some(line) = lines_written.symmetric_difference(&lines_found).next() {
            return Err(damaged(line.split(' ').next().unwrap_or_default()));
        }
        // Every run has rows, so an empty list of files was cut off.
        if run.files.is_empty() {
            return Err(damaged(CONTENTS));
        }
        Ok(run)
    }

    /// Writes the run to the new folder `folder`, and waits until all files are on the disk.
    pub fn write(&self, folder: &Path) -> Result<(), Error> {
        fs::create_dir(folder).map_err(Error::io(folder, "create the folder"))?;
        for (name, bytes) in &self.files {
            files::write_synced(&folder.join(name), bytes)?;
        }
        files::write_synced(&folder.join(CONTENTS), self.contents().as_bytes())?;
        Ok(())
    }

    /// Returns the text of the file [`CONTENTS`].
    fn contents(&self) -> String {
        let mut text = String::new();
        for (name, bytes) in &self.files {
            let checksum = fnv1a(bytes.iter().copied());
            text += &format!("{name} {} {checksum:016x}\n", bytes.len());
        }
        text
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
