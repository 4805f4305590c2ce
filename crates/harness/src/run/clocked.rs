//! Another library's trees for comparison with time-limited runs.

use super::measurement::{Measurement, Work};
use crate::Error;
use crate::measure::layout::collapsed_sah;
use crate::peers::external;
use crate::rows::ClockedPeerRow;
use bvh_scenes::Scene;
use std::path::Path;

/// The costs of tinybvh's trees with spatial splits, which the program at this path builds.
pub(crate) struct ClockedPeers<'a>(pub &'a Path);

impl Measurement for ClockedPeers<'_> {
    fn measure(&self, work: &mut Work) -> Result<String, Error> {
        let program = self.0;
        // A checkout without the third-party libraries can still run the experiment.
        if !program.exists() {
            let program = program.display();
            return Ok(format!(
                "Without tinybvh: {program} does not exist; scripts/ray-peers/build makes it.\n"
            ));
        }
        let rows = work
            .scenes
            .iter()
            .map(|scene| peer_row(program, scene))
            .collect::<Result<Vec<_>, Error>>()?;
        work.store.write_rows(&rows)?;
        Ok(String::new())
    }
}

fn peer_row(program: &Path, scene: &Scene) -> Result<ClockedPeerRow, Error> {
    let (tree, seconds) = external::split_tree(program, scene).map_err(|message| {
        Error::Library { scene: scene.name.clone(), library: "tinybvh", message }
    })?;
    Ok(ClockedPeerRow {
        scene: scene.name.clone(),
        method: "tinybvh, splits".into(),
        seconds,
        references_per_object: tree.prim_ids.len() as f64 / scene.boxes.len() as f64,
        collapsed_sah: collapsed_sah(&tree),
    })
}
