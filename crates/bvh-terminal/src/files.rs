//! Files that `bvh_files` replaces as a whole, and folders.

use crate::Error;
pub use bvh_files::{Reserved, WriteError, write};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

/// Reserves bytes of the file to write. At a path that is not `given` by the user, a file that
/// somebody creates meanwhile stays.
pub fn reserve(path: &Path, given: bool, bytes: usize) -> Result<Reserved, WriteError> {
    let reserve = if given { Reserved::new } else { Reserved::new_file };
    reserve(path, bytes)
}

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
