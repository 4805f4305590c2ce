//! Paths on the command line that are of the wrong kind: refused before any work, with the name of their flag.

use crate::Error;
use std::path::Path;

fn refuse(flag: &str, path: &Path, found: &str, accepted: &str) -> Result<(), Error> {
    Err(Error::Usage(format!("{flag}: {} is {found}; accepted: {accepted}", path.display())))
}

/// A file to be written: a new one or an old one, but no folder and no device, in whose place the file would be put.
pub fn output_file(flag: &str, path: &Path) -> Result<(), Error> {
    let accepted = "the path of a file to write";
    if path.as_os_str().is_empty() {
        refuse(flag, path, "empty", accepted)
    } else if path.is_dir() {
        refuse(flag, path, "a folder", accepted)
    } else if path.exists() && !path.is_file() {
        refuse(flag, path, "not a regular file", accepted)
    } else {
        Ok(())
    }
}

/// A folder to be written into: one that is there, or can be made because nothing on the way to it is a file.
pub fn output_folder(flag: &str, path: &Path) -> Result<(), Error> {
    if path.as_os_str().is_empty() {
        return refuse(flag, path, "empty", "the path of a folder");
    }
    match path.ancestors().find(|above| above.exists()) {
        Some(above) if !above.is_dir() => refuse(flag, above, "a file", "the path of a folder"),
        _ => Ok(()),
    }
}

/// A folder to be read.
pub fn input_folder(flag: &str, path: &Path) -> Result<(), Error> {
    if path.is_dir() { Ok(()) } else { refuse(flag, path, "no folder", "a folder that is there") }
}

/// A file to be read.
pub fn input_file(flag: &str, path: &Path) -> Result<(), Error> {
    match path {
        _ if path.is_dir() => refuse(flag, path, "a folder", "a file that is there"),
        _ if path.exists() => Ok(()),
        _ => Err(Error::Usage(format!("{flag}: {}: no such file", path.display()))),
    }
}
