//! The archive of the best known trees: a folder with one tree file per scene and a table of them.

use crate::Error;
use crate::files;
use crate::rows::lock::wait_for_folder;
use crate::rows::{ROUNDING, Row, TreeRow, read, to_bytes};
use crate::run::reference::{best_known, improve};
use crate::run::resolved::checksum;
use bvh_core::cost;
use bvh_scenes::Scene;
use bvh_scenes::tree_file;
use std::fs;
use std::path::{Path, PathBuf};

/// The archive's folder in the results.
const FOLDER: &str = "trees";

/// Returns the rows of the archive in a folder of results; none if there is no archive.
pub fn rows(results: &Path) -> Result<Vec<TreeRow>, Error> {
    let path = results.join(FOLDER).join(TreeRow::FILE);
    if path.is_file() { read(&path) } else { Ok(vec![]) }
}

/// Returns the path of a scene's tree in the archive.
pub fn path(results: &Path, scene: &str) -> PathBuf {
    results.join(FOLDER).join(format!("{}.bvh", scene.replace(':', "-")))
}

/// Keeps the tree in `file`, which `command` produced, and records its cost in the archive and
/// among the best known costs. Returns the tree's new path.
///
/// # Errors
///
/// If the scene's tree in the archive costs no more, or if a lower cost is known.
pub fn keep(results: &Path, scene: &Scene, file: &Path, command: &str) -> Result<PathBuf, Error> {
    let bytes = tree_file::read(file)?;
    let (tree, header) = tree_file::load(file, scene)?;
    let objects = scene.boxes.len();
    // Wider nodes and leaves would make every cost beatable.
    if tree.nodes.len() + 1 != 2 * objects {
        return Err(rejected(file, "not a binary tree with one object per leaf"));
    }
    let internal_area = cost::internal_area(&tree);
    // Held until both tables are written, so that no other harness archives a better tree
    // meanwhile.
    let _lock = wait_for_folder(results)?;
    let best = best_known(results, scene)?;
    if let Some(best) = &best
        && internal_area > best.cost * (1.0 + ROUNDING)
    {
        let message = format!("its cost is {internal_area}, the best known cost is {}", best.cost);
        return Err(rejected(file, &message));
    }
    let mut rows = rows(results)?;
    let row_checksum = checksum(scene);
    if let Some(index) = rows.iter().position(|row| row.scene == scene.name) {
        let archived = rows.remove(index);
        // A tree over other boxes is no competitor: the scene has changed since.
        if archived.checksum == row_checksum
            && internal_area >= archived.internal_area * (1.0 - ROUNDING)
        {
            let archived_area = archived.internal_area;
            let message =
                format!("its cost is {internal_area}, the archived tree's is {archived_area}");
            return Err(rejected(file, &message));
        }
    }
    let path = path(results, &scene.name);
    rows.push(TreeRow {
        scene: scene.name.clone(),
        objects,
        checksum: row_checksum,
        internal_area,
        lower_bound: best.and_then(|best| best.lower_bound),
        command: command.into(),
    });
    // Sorted rows keep the differences between commits small.
    rows.sort_by(|a, b| a.scene.cmp(&b.scene));
    let folder = results.join(FOLDER);
    fs::create_dir_all(&folder).map_err(Error::io(&folder, "create the folder"))?;
    files::write(&path, &bytes)?;
    let table = folder.join(TreeRow::FILE);
    files::write(&table, &to_bytes(&rows, &table)?)?;
    improve(results, scene, &tree, &header)?;
    Ok(path)
}

fn rejected(file: &Path, message: &str) -> Error {
    Error::Usage(format!("--keep: {}: {message}", file.display()))
}
