//! The folder that a run writes to. Finished results are replaced only on request.

use crate::Error;
use crate::rows::store::{Existing, is_unfinished};
use crate::run::resolved::Resolved;
use std::path::{Path, PathBuf};

/// A folder for results.
#[derive(Clone, Debug)]
pub struct Target {
    /// The folder.
    pub folder: PathBuf,
    /// The folder with finished results of the same runs, if this run repeats them.
    pub previous: Option<PathBuf>,
    /// True if the folder already holds all requested results.
    pub is_finished: bool,
}

impl Target {
    /// Returns `out/NAME`, or `out/NAME.new` if the former holds finished results of the same runs.
    ///
    /// Finished results may also cover optional scenes that are missing now. Resuming them leaves
    /// nothing to do.
    ///
    /// # Errors
    ///
    /// If the folder holds finished results of other runs. For a part, if it holds any.
    pub(crate) fn choose(
        out: &Path,
        resolved: &Resolved,
        existing: Existing,
        is_part: bool,
    ) -> Result<Self, Error> {
        let folder = out.join(resolved.experiment.folder());
        let recorded = folder.join("resolved.toml");
        if existing == Existing::Replace || is_unfinished(&folder) || !recorded.is_file() {
            return Ok(Self { folder, previous: None, is_finished: false });
        }
        let text = bvh_scenes::files::read_text(&recorded)?;
        let found = if is_part {
            Some("has finished results")
        } else if !toml::from_str(&text).is_ok_and(|found| resolved.repeats(&found)) {
            Some("has the results of another spec, scene or seed")
        } else {
            None
        };
        if let Some(found) = found {
            return Err(Error::Usage(format!(
                "{} {found}; --force replaces them, another --out keeps them",
                folder.display()
            )));
        }
        // `with_extension` would replace the part of the name after a dot, as in `v1.2`.
        let mut repetition = folder.as_os_str().to_owned();
        repetition.push(".new");
        let repetition = PathBuf::from(repetition);
        if existing == Existing::Resume && !is_unfinished(&repetition) {
            return Ok(Self { folder, previous: None, is_finished: true });
        }
        Ok(Self { folder: repetition, previous: Some(folder), is_finished: false })
    }
}
