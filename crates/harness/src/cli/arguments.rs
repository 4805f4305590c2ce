//! Arguments that several commands have, and the refusal of paths of the wrong kind before any work.

use crate::Error;
use std::path::Path;

/// How many threads the program uses.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct Jobs {
    /// Number of threads, by default one per processor. Changes no result but times and what a budget of time buys.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
}

impl Jobs {
    /// Limits the program to this number of threads; to be called once.
    pub fn apply(self) -> Result<(), Error> {
        let Some(jobs) = self.jobs else { return Ok(()) };
        rayon::ThreadPoolBuilder::new()
            .num_threads(jobs.into())
            .build_global()
            .map_err(|error| Error::Usage(format!("--jobs {jobs}: {error}")))
    }
}

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
