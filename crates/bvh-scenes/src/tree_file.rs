//! Tree files of scenes, read completely and checked against the scene's objects.

use crate::Scene;
use bvh_core::file::{FileError, Header};
use bvh_core::{Bvh, validate_references};
pub use bvh_files::tree_file::{TreeFileError, open, read};
use std::path::Path;

/// Reads the tree over a scene's objects from the file at `path`, and the file's header.
///
/// # Errors
///
/// [`TreeFileError`] if the file is damaged or was saved for another scene, or if its tree is not
/// [valid](validate_references) over these objects.
pub fn load(path: &Path, scene: &Scene) -> Result<(Bvh, Header), TreeFileError> {
    let bytes = read(path)?;
    let file = open(path, &bytes)?.for_boxes(&scene.boxes).map_err(TreeFileError::of(path))?;
    let tree = file.tree().map_err(TreeFileError::of(path))?;
    let header = file.header().clone();
    // The checksums prove only that the file is intact: a forged tree can have right ones.
    validate_references(&tree, &scene.boxes, &scene.primitives)
        .map_err(FileError::Tree)
        .map_err(TreeFileError::of(path))?;
    Ok((tree, header))
}
