//! Another library's trees beside runs that the clock ends.

use super::measurement::{Measurement, Work};
use crate::Error;
use crate::measure::layout::collapsed_sah;
use crate::peers::external;
use crate::rows::ClockedPeerRow;
use crate::rows::store::Store;
use bvh_scenes::Scene;
use std::path::Path;

/// The costs of tinybvh's trees with spatial splits, by this program.
pub(crate) struct ClockedPeers<'a>(pub &'a Path);

impl Measurement for ClockedPeers<'_> {
    fn measure(&self, work: &mut Work) -> Result<String, Error> {
        cost_peers(self.0, work.scenes, work.store)
    }
}

/// Costs tinybvh's tree over every scene. Returns a remark if its program is not there.
fn cost_peers(program: &Path, scenes: &[Scene], store: &Store) -> Result<String, Error> {
    if !program.exists() {
        let program = program.display();
        return Ok(format!(
            "Without tinybvh: {program} is not there; scripts/ray-peers/build makes it.\n"
        ));
    }
    let row = |scene: &Scene| {
        let failed =
            |message| Error::Library { scene: scene.name.clone(), library: "tinybvh", message };
        let (tree, seconds) = external::split_tree(program, scene).map_err(failed)?;
        Ok(ClockedPeerRow {
            scene: scene.name.clone(),
            method: "tinybvh, splits".into(),
            seconds,
            references_per_object: tree.prim_ids.len() as f64 / scene.boxes.len() as f64,
            collapsed_sah: collapsed_sah(&tree),
        })
    };
    let rows = scenes
        .iter()
        .map(row)
        .collect::<Result<Vec<_>, Error>>()?;
    store.write_rows(&rows)?;
    Ok(String::new())
}
