//! What gaps are measured from: the exact optimum of small scenes, else the best known cost, kept over all experiments.
//!
//! `best_known.csv` in the results folder has one row per scene and objective, improved at the end of every experiment
//! that beats it. Reports that measure gaps read `references.csv` in the experiment's own folder: the rows as they were
//! then. So later finds change no gap that was written; `--check` begins with the recorded references in place of the
//! best known ones, and `--redraw` brings them, and the gaps, up to date.
//!
//! Only binary trees with one object per leaf count: wider nodes and leaves would make every cost beatable.

use crate::Error;
use crate::files;
use crate::report::Report;
use crate::run::resolved::{LoadedScene, Resolved};
use crate::run::rows::{BoundRow, ROUNDING, ReferenceRow, Row, RunRow, read, read_if_any, to_bytes};
use crate::run::store::Store;
use bvh_core::cost::Objective;
use bvh_search::exact;
use std::fs::{self, File};
use std::path::Path;

/// The file in the results folder.
pub const BEST_KNOWN: &str = "best_known.csv";
/// The file in the folder of an experiment.
pub const REFERENCES: &str = ReferenceRow::FILE;

/// The folder with the best known costs.
#[derive(Clone, Copy, Debug)]
pub enum BestKnown<'a> {
    /// They are read, and improved where a run was better.
    Improve(&'a Path),
    /// They are only read.
    Read(&'a Path),
}

/// Improves `out/best_known.csv` by the rows in the store's folder, and records the references there if a report needs
/// them. One harness at a time does so; at any moment the file is the old one or the whole new one.
pub(crate) fn update(
    resolved: &Resolved,
    best_known: BestKnown,
    revision: &str,
    store: &Store,
) -> Result<(), Error> {
    let (BestKnown::Improve(out) | BestKnown::Read(out)) = best_known;
    let runs: Vec<RunRow> = read(&store.folder().join("runs.csv"))?;
    let bounds: Vec<BoundRow> = read_if_any(store.folder())?;
    let lock_path = out.join(".lock");
    let lock = File::create(&lock_path).map_err(Error::io(&lock_path, "create the file"))?;
    lock.lock().map_err(Error::io(&lock_path, "lock the file"))?;
    let path = out.join(BEST_KNOWN);
    let before: Vec<ReferenceRow> = if path.is_file() { read(&path)? } else { vec![] };
    let mut known = before.clone();
    let experiment = &resolved.experiment;
    let mut references = Vec::new();
    for scene in &resolved.scenes {
        let small = experiment.needs_optimum(scene.objects);
        // Hundreds of small scenes, as experiments on optimality have, are no news.
        if scene.objects > exact::MOST_OBJECTS || small {
            let bound = bounds.iter().find(|row| row.scene == scene.name).map(|row| row.lower_bound);
            let own = runs.iter().filter(|run| run.scene == scene.name && run.nodes + 1 == 2 * run.objects);
            for found in own.flat_map(|run| finds(scene, &experiment.objective, run, bound)) {
                let revision = revision.to_owned();
                offer(&mut known, ReferenceRow { revision, ..found }, small);
            }
        }
        let objective = name(&experiment.objective);
        references.extend(known.iter().find(|row| is_of(row, scene) && row.objective == objective).cloned());
    }
    known.sort_by_cached_key(|row| {
        (row.scene.clone(), row.objects, row.checksum.clone(), row.objective.clone())
    });
    if known != before && matches!(best_known, BestKnown::Improve(_)) {
        files::write(&path, &to_bytes(&known, &path)?)?;
    }
    if experiment.reports.iter().any(Report::needs_references) {
        store.write(REFERENCES, &to_bytes(&references, Path::new(REFERENCES))?)?;
    }
    Ok(())
}

/// Makes the references recorded in `folder`, if any, the best known ones in `out`.
pub fn adopt(folder: &Path, out: &Path) -> Result<(), Error> {
    let recorded = folder.join(REFERENCES);
    if recorded.is_file() {
        let path = out.join(BEST_KNOWN);
        fs::copy(&recorded, &path).map_err(Error::io(&path, "write the file"))?;
    }
    Ok(())
}

/// The objective's name, as in [`ReferenceRow::objective`].
fn name(objective: &Objective) -> String {
    match objective {
        Objective::InternalArea => "internal_area".into(),
        Objective::GoldsmithSalmon => "goldsmith_salmon".into(),
        Objective::Sah(constants) => format!("{constants:?}"),
    }
}

fn is_of(row: &ReferenceRow, scene: &LoadedScene) -> bool {
    row.scene == scene.name && row.objects == scene.objects && row.checksum == scene.checksum
}

/// What one run found, under its objective and under those that are columns of every run. `bound` is of the internal
/// area.
fn finds(
    scene: &LoadedScene,
    objective: &Objective,
    run: &RunRow,
    bound: Option<f64>,
) -> impl Iterator<Item = ReferenceRow> {
    let root_area = run.internal_area / run.cost_over_root_area;
    let costs = [
        (name(&Objective::InternalArea), run.internal_area, bound),
        (name(&Objective::GoldsmithSalmon), run.goldsmith_salmon, bound.map(|bound| 2.0 * bound / root_area)),
        (name(objective), run.cost, None),
    ];
    costs.into_iter().map(|(objective, cost, lower_bound)| ReferenceRow {
        scene: scene.name.clone(),
        objects: scene.objects,
        checksum: scene.checksum.clone(),
        objective,
        cost,
        method: run.method.clone(),
        seed: run.seed,
        revision: String::new(),
        lower_bound: lower_bound.filter(|bound| bound.is_finite()),
    })
}

/// Keeps what is better of a row and the one known, if there is one. If the bound is the `optimum`, it is the cost.
fn offer(known: &mut Vec<ReferenceRow>, mut found: ReferenceRow, optimum: bool) {
    if let Some(least) = found.lower_bound.filter(|&bound| optimum && bound < found.cost * (1.0 - ROUNDING)) {
        (found.cost, found.method, found.seed) = (least, "exact".into(), 0);
    }
    let same = |row: &ReferenceRow| {
        (&row.scene, row.objects, &row.checksum, &row.objective)
            == (&found.scene, found.objects, &found.checksum, &found.objective)
    };
    let Some(old) = known.iter_mut().find(|row| same(row)) else {
        return known.push(found);
    };
    let lower_bound = old.lower_bound.into_iter().chain(found.lower_bound).reduce(f64::max);
    if found.cost < old.cost * (1.0 - ROUNDING) {
        *old = found;
    }
    old.lower_bound = lower_bound;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(scene: &str, cost: f64, lower_bound: Option<f64>) -> ReferenceRow {
        ReferenceRow {
            scene: scene.into(),
            objects: 100,
            checksum: "0".into(),
            objective: "internal_area".into(),
            cost,
            method: format!("{cost}"),
            seed: 1,
            revision: String::new(),
            lower_bound,
        }
    }

    #[test]
    fn the_lower_cost_and_the_higher_bound_are_kept() {
        let mut known = Vec::new();
        for (cost, bound) in [(9.0, None), (7.0, Some(3.0)), (8.0, Some(4.0)), (7.0 - 1e-14, Some(2.0))] {
            offer(&mut known, row("a", cost, bound), false);
        }
        assert_eq!(known, [row("a", 7.0, Some(4.0))]);
    }

    #[test]
    fn scenes_are_told_apart_by_their_boxes() {
        let mut known = vec![row("a", 1.0, None)];
        offer(&mut known, ReferenceRow { checksum: "1".into(), ..row("a", 9.0, None) }, false);
        offer(&mut known, ReferenceRow { objects: 99, ..row("a", 8.0, None) }, false);
        assert_eq!(known.iter().map(|row| row.cost).collect::<Vec<_>>(), [1.0, 9.0, 8.0]);
    }

    #[test]
    fn an_optimum_that_no_run_has_found_is_the_reference() {
        let mut known = Vec::new();
        offer(&mut known, row("a", 9.0, Some(6.0)), true);
        assert!(known[0].cost == 6.0 && known[0].method == "exact" && known[0].is_optimum());
        offer(&mut known, row("a", 6.0 + 1e-14, Some(6.0)), true);
        assert_eq!((known.len(), known[0].cost), (1, 6.0));
        assert!(!row("a", 6.0, Some(5.0)).is_optimum());
    }
}
