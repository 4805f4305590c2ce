//! Folders of results, and files in them that must be on the disk.

use crate::Error;
pub use bvh_scenes::files::write;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

/// Writes a new file and waits until it is on the disk.
pub fn write_synced(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    create_synced(path, bytes).map_err(Error::io(path, "write the file"))
}

fn create_synced(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

/// Returns the names of a folder's entries.
pub fn names(folder: &Path) -> Result<BTreeSet<String>, Error> {
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(folder).map_err(Error::io(folder, "read the folder"))? {
        let entry = entry.map_err(Error::io(folder, "read the folder"))?;
        names.insert(entry.file_name().to_string_lossy().into_owned());
    }
    Ok(names)
}
