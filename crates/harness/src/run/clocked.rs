//! Another library's trees beside runs that the clock ends.

use crate::Error;
use crate::peers::external;
use crate::run::job::collapsed_sah;
use crate::run::rows::ClockedPeerRow;
use crate::run::store::Store;
use crate::scenes::Scene;
use std::path::Path;

/// Costs tinybvh's tree with spatial splits over every scene. Returns what is to be said where its program is not there.
pub(crate) fn cost_peers(program: &Path, scenes: &[Scene], store: &Store) -> Result<String, Error> {
    if !program.exists() {
        let program = program.display();
        return Ok(format!("Without tinybvh: {program} is not there; scripts/ray-peers/build makes it.\n"));
    }
    let row = |scene: &Scene| {
        let failed = |message| Error::Library { scene: scene.name.clone(), library: "tinybvh", message };
        let (tree, seconds) = external::split_tree(program, scene).map_err(failed)?;
        Ok(ClockedPeerRow {
            scene: scene.name.clone(),
            method: "tinybvh, splits".into(),
            seconds,
            references_per_object: tree.prim_ids.len() as f64 / scene.boxes.len() as f64,
            collapsed_sah: collapsed_sah(&tree),
        })
    };
    let rows = scenes.iter().map(row).collect::<Result<Vec<_>, Error>>()?;
    store.write_rows(&rows)?;
    Ok(String::new())
}
