//! Arguments of several commands: scenes, and paths, which are checked before any work.

use crate::Error;
use crate::output::print_error;
use bvh_scenes::files::{Reserved, WriteError, folder_of};
use bvh_scenes::{Scene, SceneError};
use std::path::{Path, PathBuf};

/// The limit on the program's threads.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct Jobs {
    /// Number of threads; the default is one per processor. It changes only times, and the results
    /// of budgets of time.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
}

impl Jobs {
    /// Limits the program to this number of threads. Call it once.
    pub fn apply(self) -> Result<(), Error> {
        // By default rayon starts one thread per processor when it is first used.
        let Some(jobs) = self.jobs else { return Ok(()) };
        rayon::ThreadPoolBuilder::new()
            .num_threads(jobs.into())
            .build_global()
            .map_err(|error| Error::Usage(format!("--jobs {jobs}: {error}")))
    }
}

/// Loads a scene by name or path, and prints the remark on it, if it has one.
pub fn load_scene(name: &str) -> Result<Scene, SceneError> {
    let scene = Scene::load(name)?;
    if let Some(remark) = &scene.remark {
        print_error(remark);
    }
    Ok(scene)
}

fn reject(flag: &str, path: &Path, found: &str, accepted: &str) -> Result<(), Error> {
    Err(Error::Usage(format!("{flag}: {} is {found}; accepted: {accepted}", path.display())))
}

/// Checks the path of a file to write: its name must have this ending, so that no file of another
/// kind is replaced, such as the command's own input.
pub fn output_file(flag: &str, path: &Path, ending: &str) -> Result<(), Error> {
    let has_ending = path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending));
    match std::fs::metadata(path) {
        _ if !has_ending => {
            let accepted = format!("a name that ends with .{ending}");
            Err(Error::Usage(format!("{flag}: {}; accepted: {accepted}", path.display())))
        }
        Ok(found) if !found.is_file() => {
            reject(flag, path, "not a regular file", "the path of a file to write")
        }
        Err(_) if !folder_of(path).is_dir() => {
            reject(flag, folder_of(path), "no folder", "a path in a folder that is there")
        }
        _ => Ok(()),
    }
}

/// Returns the output that the flag gives, or otherwise the `derived` path. A path that nobody gave
/// must be free, because nobody asked to replace a file.
pub fn output_or_free(
    flag: &str,
    given: Option<&PathBuf>,
    derived: impl FnOnce() -> PathBuf,
) -> Result<PathBuf, Error> {
    if let Some(given) = given {
        return Ok(given.clone());
    }
    let path = derived();
    if path.exists() {
        return Err(Error::Usage(format!(
            "{0} exists; accepted: {flag} {0} to replace it, or the name of a new file",
            path.display()
        )));
    }
    Ok(path)
}

/// Reserves bytes of the file to write. At a path that is not `given` by the user, a file that
/// somebody creates meanwhile stays.
pub fn reserve(path: &Path, given: bool, bytes: usize) -> Result<Reserved, WriteError> {
    let reserve = if given { Reserved::new } else { Reserved::new_file };
    reserve(path, bytes)
}

/// Checks the path of a folder to write into: an existing folder, or one that can be created
/// because no part of its path is a file.
pub fn output_folder(flag: &str, path: &Path) -> Result<(), Error> {
    if path.as_os_str().is_empty() {
        return reject(flag, path, "empty", "the path of a folder");
    }
    // The nearest existing ancestor decides whether the rest of the path can be created.
    match path.ancestors().find(|above| above.exists()) {
        Some(above) if !above.is_dir() => reject(flag, above, "a file", "the path of a folder"),
        _ => Ok(()),
    }
}

/// Checks the path of a file to read.
pub fn input_file(flag: &str, path: &Path) -> Result<(), Error> {
    if path.is_dir() {
        return reject(flag, path, "a folder", "a file that is there");
    }
    if !path.exists() {
        return Err(Error::Usage(format!("{flag}: {}: no such file", path.display())));
    }
    Ok(())
}
