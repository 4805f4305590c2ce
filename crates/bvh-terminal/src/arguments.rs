//! Arguments that several commands have, and the refusal of paths of the wrong kind before any work.

use crate::Error;
use std::fs::File;
use std::io::Read;
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

/// A kind of files that a command writes.
#[derive(Clone, Copy, Debug)]
pub struct FileKind {
    /// Its name in messages, with an article.
    pub name: &'static str,
    /// The bytes with which every file of this kind begins.
    pub beginning: &'static [u8],
    /// How their names end.
    pub extension: &'static str,
}

/// A file to be written: a new one, or one of the same kind to be replaced. Anything else stays: folders, devices, and
/// files that somebody needs otherwise, such as the command's own input.
pub fn output_file(flag: &str, path: &Path, kind: &FileKind) -> Result<(), Error> {
    let accepted = "the path of a file to write";
    if path.as_os_str().is_empty() {
        return refuse(flag, path, "empty", accepted);
    }
    match std::fs::metadata(path) {
        Err(_) if !folder_of(path).is_dir() => {
            refuse(flag, folder_of(path), "no folder", "a path in a folder that is there")
        }
        Err(_) => match path.extension() {
            // A file under the name of another kind would be taken for one.
            Some(found) if !found.eq_ignore_ascii_case(kind.extension) => {
                let accepted = format!(
                    "{}, by a name that ends with `.{}` or has no ending",
                    kind.name, kind.extension
                );
                refuse(
                    flag,
                    path,
                    &format!("a name that ends with `.{}`", found.display()),
                    &accepted,
                )
            }
            _ => Ok(()),
        },
        Ok(found) if found.is_dir() => refuse(flag, path, "a folder", accepted),
        Ok(found) if !found.is_file() => refuse(flag, path, "not a regular file", accepted),
        Ok(_) => {
            let mut beginning = Vec::new();
            let length = kind.beginning.len() as u64;
            let file =
                File::open(path).and_then(|file| file.take(length).read_to_end(&mut beginning));
            file.map_err(Error::io(path, "read the file"))?;
            if beginning.is_empty() || beginning == kind.beginning {
                return Ok(());
            }
            refuse(
                flag,
                path,
                &format!("a file, but not {}", kind.name),
                "a new file, or one of that kind",
            )
        }
    }
}

/// The folder that a file is in.
fn folder_of(path: &Path) -> &Path {
    path.parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
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
