//! The archive of the best known trees: a folder with a tree file per scene and a row per file, which anyone can beat.

use crate::Error;
use crate::rows::lock::wait_for_folder;
use crate::rows::{ROUNDING, Row, TreeRow, read, to_bytes};
use crate::run::reference::{best_known, improve};
use crate::run::resolved::checksum;
use bvh_core::cost;
use bvh_scenes::Scene;
use bvh_scenes::tree_file;
use bvh_terminal::files;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder among the results.
const FOLDER: &str = "trees";

/// The rows of the archive in a folder of results; none if there is no archive.
pub fn rows(results: &Path) -> Result<Vec<TreeRow>, Error> {
    let path = results.join(FOLDER).join(TreeRow::FILE);
    if path.is_file() { read(&path) } else { Ok(vec![]) }
}

/// Where the archive keeps the tree of a scene.
pub fn path(results: &Path, scene: &str) -> PathBuf {
    results
        .join(FOLDER)
        .join(format!("{}.bvh", scene.replace(':', "-")))
}

/// Keeps the tree `file` of a scene, which the `command` has made, and records its cost there and among the best known ones. Refuses
/// one that another of the archive, or the best known cost, is better than or equal to. Returns where it is kept.
pub fn keep(results: &Path, scene: &Scene, file: &Path, command: &str) -> Result<PathBuf, Error> {
    let refused =
        |message: String| Err(Error::Usage(format!("--keep: {}: {message}", file.display())));
    let bytes = tree_file::read(file)?;
    let (tree, header) = tree_file::load(file, scene)?;
    let objects = scene.boxes.len();
    if tree.nodes.len() + 1 != 2 * objects {
        return refused("not a binary tree with one object per leaf".into());
    }
    let internal_area = cost::internal_area(&tree);
    let _lock = wait_for_folder(results)?;
    let known = best_known(results, scene)?;
    if let Some(known) = known
        .as_ref()
        .filter(|known| internal_area > known.cost * (1.0 + ROUNDING))
    {
        return refused(format!(
            "its cost is {internal_area}, and the best known is {}",
            known.cost
        ));
    }
    let mut rows = rows(results)?;
    let row_checksum = checksum(scene);
    let old = rows
        .iter()
        .position(|row| row.scene == scene.name);
    if let Some(old) = old
        .map(|at| rows.remove(at))
        .filter(|old| old.checksum == row_checksum)
        && internal_area >= old.internal_area * (1.0 - ROUNDING)
    {
        return refused(format!(
            "its cost is {internal_area}, and that in the archive is {}",
            old.internal_area
        ));
    }
    let path = path(results, &scene.name);
    rows.push(TreeRow {
        scene: scene.name.clone(),
        objects,
        checksum: row_checksum,
        internal_area,
        lower_bound: known.and_then(|known| known.lower_bound),
        command: command.into(),
    });
    rows.sort_by(|a, b| a.scene.cmp(&b.scene));
    let folder = results.join(FOLDER);
    fs::create_dir_all(&folder).map_err(Error::io(&folder, "create the folder"))?;
    files::write(&path, &bytes)?;
    let table = folder.join(TreeRow::FILE);
    files::write(&table, &to_bytes(&rows, &table)?)?;
    improve(results, scene, &tree, &header)?;
    Ok(path)
}
