//! Arguments of several commands: scenes, and paths, which are checked before any work.

use crate::Error;
use crate::output::print_error;
use bvh_build::{Builder, muller_fellner};
use bvh_core::{Bvh, DWideBvh};
use bvh_scenes::files::{folder_of, regular};
use bvh_scenes::{Precision, Scene, SceneError, tree_file};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::path::{Path, PathBuf};

/// Parses the name of one of these values.
pub fn named<T: Clone + Send + Sync + 'static>(
    values: impl IntoIterator<Item = (&'static str, T)>,
) -> impl TypedValueParser<Value = T> {
    let values: Vec<(&str, T)> = values.into_iter().collect();
    let names = PossibleValuesParser::new(values.iter().map(|(name, _)| *name));
    names.try_map(move |found| {
        let value = values.iter().find(|(name, _)| *name == found);
        value.map(|(_, value)| value.clone()).ok_or("unknown")
    })
}

/// Loads a scene by name or path, and prints the remark on it, if it has one.
pub fn load_scene(name: &str, precision: Precision) -> Result<Scene, SceneError> {
    let scene = Scene::load_as(name, precision)?;
    if let Some(remark) = &scene.remark {
        print_error(remark);
    }
    Ok(scene)
}

/// Loads the scene of a tree file with the precision of its triangles.
pub fn scene_of(tree: &Path, name: &str) -> Result<Scene, Error> {
    let precision = precision_of(tree).map_err(|error| match precision_of(Path::new(name)) {
        Ok(_) => Error::Usage(format!(
            "{name} is a tree file and no scene; accepted: first the tree, then its scene"
        )),
        Err(_) => error,
    })?;
    Ok(load_scene(name, precision)?)
}

pub fn precision_of(tree: &Path) -> Result<Precision, Error> {
    let is_double = tree_file::header(tree)?.is_double;
    Ok(if is_double { Precision::Double } else { Precision::Single })
}

/// Returns the greedy tree over a scene along the file's axes, as other libraries build it, with
/// which every command compares; over triangles in f64 around their middle.
pub fn greedy(scene: &Scene) -> Result<Bvh, Error> {
    let frame = scene.doubles().ok().map(DWideBvh::centred);
    let boxes = scene.primitives.boxes_in(frame.as_ref());
    let greedy = muller_fellner::Config::default().build(&boxes);
    let greedy = greedy.map_err(Error::search(&scene.name, "muller_fellner"))?;
    Ok(Bvh { frame, ..greedy })
}

/// Checks the path of a file to write: its name must have this ending, so that no file of another
/// kind is replaced, such as the command's own input.
pub fn output_file(flag: &str, path: &Path, ending: &str) -> Result<(), Error> {
    let folder = folder_of(path);
    let has_ending = path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending));
    let fault = if !has_ending {
        format!("{}; accepted: a name that ends with .{ending}", path.display())
    } else if path.exists() && !path.is_file() {
        format!("{} is not a regular file; accepted: the path of a file to write", path.display())
    } else if !folder.is_dir() {
        format!("{} is no folder; accepted: a path in a folder that is there", folder.display())
    } else {
        return Ok(());
    };
    Err(Error::Usage(format!("{flag}: {fault}")))
}

/// Returns the output that `--out` gives, or otherwise the `derived` path. A path that nobody gave
/// must be free, because nobody asked to replace a file.
pub fn output_or_free(
    given: Option<&PathBuf>,
    derived: impl FnOnce() -> PathBuf,
) -> Result<PathBuf, Error> {
    if let Some(given) = given {
        return Ok(given.clone());
    }
    let path = derived();
    if path.exists() {
        return Err(Error::Usage(format!(
            "{} exists; accepted: --out {} to replace it, or the name of a new file",
            path.display(),
            quoted(&path.to_string_lossy())
        )));
    }
    Ok(path)
}

/// Returns a name as a shell and the parser read it: in quotes if need be, and no flag.
pub fn quoted(name: &str) -> String {
    let name = if name.starts_with('-') { format!("./{name}") } else { name.into() };
    let separator = std::path::MAIN_SEPARATOR;
    if name.chars().all(|c| c.is_alphanumeric() || c == separator || "_-./:,+=@%".contains(c)) {
        name
    } else if cfg!(windows) {
        format!("\"{name}\"")
    } else {
        format!("'{}'", name.replace('\'', r"'\''"))
    }
}

pub fn input_file(flag: &str, path: &Path) -> Result<(), Error> {
    regular(path).map(drop).map_err(|error| Error::Usage(format!("{flag}: {error}")))
}
