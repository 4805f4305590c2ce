//! The references of gaps: the best known costs of all experiments.
//!
//! `best_known.csv` in the results folder has one row per scene and objective. Every experiment
//! that finds a lower cost improves it when it ends. Reports that measure gaps read
//! `references.csv` in the experiment's folder, a copy of the rows at that time, which keeps
//! recorded gaps independent of later finds. `--check` starts from the recorded references instead
//! of the best known costs; `--redraw` updates the references and the gaps.
//!
//! Only binary trees with one object per leaf count: wider nodes and leaves would make every cost
//! beatable.

use crate::Error;
use crate::files;
use crate::rows::lock::wait_for_folder;
use crate::rows::store::Store;
use crate::rows::{ROUNDING, ReferenceRow, Row, RunRow, read, read_if_any, to_bytes};
use crate::run::resolved::{LoadedScene, Resolved};
use bvh_core::cost::Objective;
use bvh_search::exact;
use std::fs;
use std::path::Path;

/// The file in the results folder.
pub const BEST_KNOWN: &str = "best_known.csv";
/// The file in the folder of an experiment.
pub const REFERENCES: &str = ReferenceRow::FILE;

/// Improves the best known costs in `out` by the rows in the store's folder, and records the references
/// there if a report needs them.
///
/// Only one harness at a time does this, and the file is replaced atomically.
pub(crate) fn update(
    resolved: &Resolved,
    out: &Path,
    revision: &str,
    store: &Store,
) -> Result<(), Error> {
    // The boxes of best known trees lie along the axes of the scene's file.
    if resolved.experiment.has_frames() {
        return Ok(());
    }
    let runs: Vec<RunRow> = read_if_any(store.folder())?;
    let _lock = wait_for_folder(out)?;
    let path = out.join(BEST_KNOWN);
    let before: Vec<ReferenceRow> = if path.is_file() { read(&path)? } else { vec![] };
    let mut known = before.clone();
    let experiment = &resolved.experiment;
    let objective = objective_name(&experiment.objective);
    let mut references = Vec::new();
    for scene in &resolved.scenes {
        // Experiments solve small scenes by the hundred, and nothing reads their costs later.
        if scene.objects > exact::MOST_OBJECTS || experiment.needs_references() {
            let eligible = runs
                .iter()
                .filter(|run| run.scene == scene.name && run.nodes + 1 == 2 * run.objects);
            for found in eligible.flat_map(|run| references_of(scene, &objective, run)) {
                let found = ReferenceRow { revision: revision.to_owned(), ..found };
                offer(&mut known, found);
            }
        }
        let key = (scene.name.as_str(), scene.objects, scene.checksum.as_str(), objective.as_str());
        let reference = known.iter().find(|row| key_of(row) == key);
        references.extend(reference.cloned());
    }
    known.sort_by(|a, b| key_of(a).cmp(&key_of(b)));
    // An unchanged file keeps its time stamp and needs no commit.
    if known != before {
        files::write(&path, &to_bytes(&known, &path)?)?;
    }
    if experiment.needs_references() {
        store.write_rows(&references)?;
    }
    Ok(())
}

/// Copies the references recorded in `folder`, if any, to the best known costs in `out`.
pub fn adopt(folder: &Path, out: &Path) -> Result<(), Error> {
    let recorded = folder.join(REFERENCES);
    if recorded.is_file() {
        let path = out.join(BEST_KNOWN);
        fs::copy(&recorded, &path).map_err(Error::io(&path, "write the file"))?;
    }
    Ok(())
}

/// The key of a reference: scene, number of objects, checksum of the boxes, and objective.
fn key_of(row: &ReferenceRow) -> (&str, usize, &str, &str) {
    (&row.scene, row.objects, &row.checksum, &row.objective)
}

/// The objective's name, as in [`ReferenceRow::objective`].
fn objective_name(objective: &Objective) -> String {
    match objective {
        Objective::InternalArea => "internal_area".into(),
        Objective::GoldsmithSalmon => "goldsmith_salmon".into(),
        Objective::Layout => "layout".into(),
        Objective::Sah(constants) => format!("{constants:?}"),
    }
}

/// Returns the costs of one run: under the experiment's objective, and under the objectives that
/// are columns of every run.
fn references_of(
    scene: &LoadedScene,
    objective: &str,
    run: &RunRow,
) -> impl Iterator<Item = ReferenceRow> {
    let costs = [
        (objective_name(&Objective::InternalArea), run.internal_area),
        (objective_name(&Objective::GoldsmithSalmon), run.goldsmith_salmon),
        (objective.to_owned(), run.cost),
    ];
    costs.into_iter().map(|(objective, cost)| ReferenceRow {
        scene: scene.name.clone(),
        objects: scene.objects,
        checksum: scene.checksum.clone(),
        objective,
        cost,
        method: run.method.clone(),
        seed: run.seed,
        revision: String::new(),
    })
}

/// Adds a row, or keeps the better of it and the known row with the same key.
fn offer(known: &mut Vec<ReferenceRow>, found: ReferenceRow) {
    let Some(old) = known.iter_mut().find(|row| key_of(row) == key_of(&found)) else {
        return known.push(found);
    };
    if found.cost < old.cost * (1.0 - ROUNDING) {
        *old = found;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(scene: &str, cost: f64) -> ReferenceRow {
        ReferenceRow {
            scene: scene.into(),
            objects: 100,
            checksum: "0".into(),
            objective: "internal_area".into(),
            cost,
            method: format!("{cost}"),
            seed: 1,
            revision: String::new(),
        }
    }

    #[test]
    fn the_lower_cost_is_kept_unless_only_rounding_is_lower() {
        let mut known = Vec::new();
        for cost in [9.0, 7.0, 8.0, 7.0 - 1e-14] {
            offer(&mut known, row("a", cost));
        }
        assert_eq!(known, [row("a", 7.0)]);
    }

    #[test]
    fn scenes_are_identified_by_their_boxes() {
        let mut known = vec![row("a", 1.0)];
        offer(&mut known, ReferenceRow { checksum: "1".into(), ..row("a", 9.0) });
        offer(&mut known, ReferenceRow { objects: 99, ..row("a", 8.0) });
        let costs: Vec<f64> = known.iter().map(|row| row.cost).collect();
        assert_eq!(costs, [1.0, 9.0, 8.0]);
    }
}
