//! Folders of results.

use crate::Error;
pub use bvh_scenes::files::write;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Returns the names of a folder's entries.
pub fn names(folder: &Path) -> Result<BTreeSet<String>, Error> {
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(folder).map_err(Error::io(folder, "read the folder"))? {
        let entry = entry.map_err(Error::io(folder, "read the folder"))?;
        names.insert(entry.file_name().to_string_lossy().into_owned());
    }
    Ok(names)
}
