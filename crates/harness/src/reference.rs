//! What gaps are measured from: the exact optimum of small scenes, else the best known cost, kept over all experiments.
//!
//! `best_known.csv` in the results folder has one row per scene and objective, improved at the end of every experiment
//! that beats it. A report that measures gaps reads `references.csv` in the experiment's own folder instead: the rows as
//! they were then. So later finds change no committed gap; `--check` begins with the recorded references in place
//! of the best known ones, and `--reports` brings them, and the gaps, up to date.
//!
//! Only binary trees with one object per leaf count: wider nodes and leaves would make every cost beatable.

use crate::Error;
use crate::record::{BoundRow, ReferenceRow, RunRow, read_if_any, to_bytes};
use crate::scene::Scene;
use crate::store::write_whole;
use bvh_core::cost::Objective;
use bvh_search::{Budget, Problem, exact, solve};
use std::cmp::Ordering;
use std::fs::{self, File};
use std::path::Path;

/// The file in the results folder.
pub const BEST_KNOWN: &str = "best_known.csv";
/// The file in the folder of an experiment.
pub const REFERENCES: &str = "references.csv";
/// `method` of the rows of exact optima.
pub const EXACT: &str = "exact";

/// Costs less apart than this, relatively, are equal: the rest is rounding.
const ROUNDING: f64 = 1e-12;

/// The objective's name, as in [`ReferenceRow::objective`].
pub fn name(objective: &Objective) -> String {
    match objective {
        Objective::InternalArea => "internal_area".into(),
        Objective::GoldsmithSalmon => "goldsmith_salmon".into(),
        Objective::Sah(constants) => format!("{constants:?}"),
    }
}

/// Improves `out/best_known.csv` by what these runs under `objective`, and bounds, have found, and returns all of it. One
/// harness at a time does so; at any moment the file is the old one or the whole new one.
pub fn improve(
    out: &Path,
    scenes: &[Scene],
    objective: &Objective,
    runs: &[RunRow],
    bounds: &[BoundRow],
    revision: &str,
) -> Result<Vec<ReferenceRow>, Error> {
    let lock_path = out.join(".lock");
    let lock = File::create(&lock_path).map_err(Error::io(&lock_path, "create the file"))?;
    lock.lock().map_err(Error::io(&lock_path, "lock the file"))?;
    let path = out.join(BEST_KNOWN);
    let mut known: Vec<ReferenceRow> = read_if_any(&path)?;
    let before = known.clone();
    for scene in scenes.iter().filter(|scene| scene.boxes.len() > exact::MOST_OBJECTS) {
        let own = runs.iter().filter(|run| run.scene == scene.name);
        for run in own.filter(|run| run.nodes + 1 == 2 * run.objects) {
            let bound = bounds.iter().find(|bound| bound.scene == scene.name).map(|bound| bound.lower_bound);
            for found in finds(scene, objective, run, bound, revision) {
                offer(&mut known, found);
            }
        }
    }
    known.sort_by(order);
    if known != before {
        write_whole(&path, &to_bytes(&known, &path)?)?;
    }
    Ok(known)
}

/// What one run found, under its objective and under those that are columns of every run.
fn finds(
    scene: &Scene,
    objective: &Objective,
    run: &RunRow,
    bound: Option<f64>,
    revision: &str,
) -> Vec<ReferenceRow> {
    let root_area = run.internal_area / run.cost_over_root_area;
    let costs = [
        (name(&Objective::InternalArea), run.internal_area, bound),
        (name(&Objective::GoldsmithSalmon), run.goldsmith_salmon, bound.map(|bound| 2.0 * bound / root_area)),
        (name(objective), run.cost, None),
    ];
    let row = |(objective, cost, lower_bound): (String, f64, Option<f64>)| ReferenceRow {
        scene: scene.name.clone(),
        objects: scene.boxes.len(),
        checksum: scene.checksum_text(),
        objective,
        cost,
        method: run.method.clone(),
        seed: run.seed,
        revision: revision.into(),
        lower_bound: lower_bound.filter(|bound| bound.is_finite()),
    };
    costs.into_iter().map(row).collect()
}

/// Keeps what is better of a row and the one known, if there is one.
fn offer(known: &mut Vec<ReferenceRow>, found: ReferenceRow) {
    let Some(old) = known.iter_mut().find(|old| order(old, &found).is_eq()) else {
        return known.push(found);
    };
    let bounds = old.lower_bound.into_iter().chain(found.lower_bound);
    let lower_bound = bounds.reduce(f64::max);
    if found.cost < old.cost * (1.0 - ROUNDING) {
        *old = found;
    }
    old.lower_bound = lower_bound;
}

/// By scene and objective.
fn order(a: &ReferenceRow, b: &ReferenceRow) -> Ordering {
    let key =
        |row: &ReferenceRow| (row.scene.clone(), row.objects, row.checksum.clone(), row.objective.clone());
    key(a).cmp(&key(b))
}

/// The references of these scenes: of `known`, or the exact optimum of those that are small enough.
pub fn select(
    known: &[ReferenceRow],
    scenes: &[Scene],
    objective: &Objective,
) -> Result<Vec<ReferenceRow>, Error> {
    let mut selected = Vec::new();
    for scene in scenes {
        if scene.boxes.len() <= exact::MOST_OBJECTS {
            selected.push(optimum(scene, objective)?);
            continue;
        }
        let (objects, checksum, objective) = (scene.boxes.len(), scene.checksum_text(), name(objective));
        let same = |row: &&ReferenceRow| {
            row.scene == scene.name
                && row.objects == objects
                && row.checksum == checksum
                && row.objective == objective
        };
        selected.extend(known.iter().find(same).cloned());
    }
    Ok(selected)
}

/// The scene's exact optimum.
fn optimum(scene: &Scene, objective: &Objective) -> Result<ReferenceRow, Error> {
    let problem = Problem { boxes: &scene.boxes, objective: *objective };
    let refused = |source| Error::Search { scene: scene.name.clone(), method: EXACT.into(), source };
    let outcome = solve(&exact::Config {}, &problem, 0, Budget::default(), &()).map_err(refused)?;
    Ok(ReferenceRow {
        scene: scene.name.clone(),
        objects: scene.boxes.len(),
        checksum: scene.checksum_text(),
        objective: name(objective),
        cost: outcome.cost,
        method: EXACT.into(),
        seed: 0,
        revision: String::new(),
        lower_bound: Some(outcome.cost),
    })
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
