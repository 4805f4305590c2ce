//! The folder that a run writes to. Finished results are replaced only on request.

use crate::Error;
use crate::rows::store::{Existing, is_unfinished};
use crate::run::resolved::Resolved;
use std::path::{Path, PathBuf};

/// Returns the folder of an experiment in `out`, and true if it already holds all requested results.
///
/// Finished results may also cover optional scenes that are missing now. Resuming them leaves
/// nothing to do.
///
/// # Errors
///
/// If the folder holds finished results that are neither replaced nor resumed.
pub(crate) fn choose(
    out: &Path,
    resolved: &Resolved,
    existing: Existing,
    is_part: bool,
) -> Result<(PathBuf, bool), Error> {
    let folder = out.join(resolved.experiment.folder());
    let recorded = folder.join("resolved.toml");
    if existing == Existing::Replace || is_unfinished(&folder) || !recorded.is_file() {
        return Ok((folder, false));
    }
    let text = bvh_scenes::files::read_text(&recorded)?;
    let is_same = toml::from_str(&text).is_ok_and(|found| resolved.repeats(&found));
    let found = match (is_same, existing == Existing::Resume && !is_part) {
        (true, true) => return Ok((folder, true)),
        (true, false) => "finished results; --check compares a repetition with them",
        (false, _) => "the results of another spec, scene or seed",
    };
    let folder = folder.display();
    let message = format!("{folder} has {found}, --force replaces them, another --out keeps them");
    Err(Error::Usage(message))
}
