//! Which folder a run writes to, so that no finished results are replaced unless the user says so.

use crate::Error;
use crate::rows::store::{Existing, is_unfinished};
use crate::run::resolved::Resolved;
use std::path::{Path, PathBuf};

/// A folder for results.
#[derive(Clone, Debug)]
pub struct Target {
    /// The folder.
    pub folder: PathBuf,
    /// The finished results of the same runs beside which it lies.
    pub beside: Option<PathBuf>,
    /// Whether the finished results of these runs are in it, and are all that was asked for.
    pub is_finished: bool,
}

impl Target {
    /// `out/NAME`, or `out/NAME.new` where the former has finished results of the same runs; those may cover optional
    /// scenes that are not there now, and are what an experiment to be resumed comes to. Refuses a folder with the finished results of other runs, and, for a `part`
    /// that is to be merged, with any.
    pub(crate) fn choose(
        out: &Path,
        resolved: &Resolved,
        existing: Existing,
        part: bool,
    ) -> Result<Self, Error> {
        let folder = out.join(resolved.experiment.folder());
        let recorded = folder.join("resolved.toml");
        if existing == Existing::Replace || is_unfinished(&folder) || !recorded.is_file() {
            return Ok(Self { folder, beside: None, is_finished: false });
        }
        let text =
            std::fs::read_to_string(&recorded).map_err(Error::io(&recorded, "read the file"))?;
        if part || !toml::from_str(&text).is_ok_and(|found| resolved.repeats(&found)) {
            let found = if part {
                "has finished results"
            } else {
                "has the results of another spec, scene or seed"
            };
            return Err(Error::Usage(format!(
                "{} {found}; --force replaces them, and with another --out they stay",
                folder.display()
            )));
        }
        let mut repetition = folder.as_os_str().to_owned();
        repetition.push(".new");
        let repetition = PathBuf::from(repetition);
        if existing == Existing::Resume && !is_unfinished(&repetition) {
            return Ok(Self { folder, beside: None, is_finished: true });
        }
        Ok(Self { folder: repetition, beside: Some(folder), is_finished: false })
    }
}
