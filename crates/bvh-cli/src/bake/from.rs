//! The tree of `--from`, which a bake improves.

use super::plan::Start;
use crate::Error;
use bvh_core::Bvh;
use bvh_scenes::{Scene, tree_file};
use std::path::Path;

/// Returns the tree in a file over the scene. Rejects a tree that the bake could not improve.
pub(super) fn start(from: &Path, scene: &Scene, most_references: f64) -> Result<Start, Error> {
    let (tree, header) = tree_file::load(from, scene)?;
    check_references(from, tree.prim_ids.len(), scene.boxes.len(), most_references)?;
    check_binary(from, &tree)?;
    Ok(Start { tree, work: header.work })
}

/// Rejects a start with more references than the bake may keep.
fn check_references(from: &Path, found: usize, objects: usize, most: f64) -> Result<(), Error> {
    if found <= objects || found <= (most * objects as f64) as usize {
        return Ok(());
    }
    let percent = (100 * found).div_ceil(objects);
    Err(Error::Usage(format!(
        "--from {}: the tree has {found} references to {objects} objects; accepted: --references \
         {}.{:02} or more",
        from.display(),
        percent / 100,
        percent % 100
    )))
}

/// Rejects a start that no search can improve.
fn check_binary(from: &Path, tree: &Bvh) -> Result<(), Error> {
    let wide = tree.nodes.iter().position(|node| !node.is_leaf() && node.children().len() != 2);
    let Some(node) = wide else { return Ok(()) };
    Err(Error::Usage(format!(
        "--from {}: inner node {node} has {} children; accepted: a tree of nodes with two",
        from.display(),
        tree.nodes[node].children().len()
    )))
}
