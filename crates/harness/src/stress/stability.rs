//! The experiment `stability`: every case with every method, traversal and part, as rows and a heat map.

use super::case::{Case, Effort, LargerScenes, Part, SceneCase, Size, is_builder};
use super::cell::Cell;
use super::examine::Examined;
use super::peers::{self, Found};
use super::promise::{Broken, Promise};
use super::table::CASES;
use super::{child, tracing};
use crate::Error;
use crate::contestant::{Contestant, Labelled};
use crate::report::output::Output;
use crate::rows::columns::{Columns, read, to_bytes};
use crate::rows::store::Store;
use bvh_config::config;
use figures::HeatMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

config! {
    serde;
    /// What is run.
    pub struct Config {
        /// Size of the scenes that builders get.
        builders: Size = Size::Many;
        /// Budget of a search: nodes per object that it may make or visit.
        work_per_object: u64 = 1000, in 1..;
        /// Scenes for searches beyond those of few objects, each built once more. Default none.
        larger_searches: Option<LargerScenes>;
        /// Rays per scene and traversal.
        rays: usize = 5000, in 1..=100_000_000;
        /// Seconds after which the build of another library, if any is compiled in, counts as hanging.
        seconds_per_peer: u64 = 20, in 1..;
    }
}

/// How a cell ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
enum Class {
    #[serde(rename = "as promised")]
    Kept,
    #[serde(rename = "error, as promised")]
    Refused,
    #[serde(rename = "promise broken")]
    Broken,
    #[serde(rename = "crash or hang")]
    Dead,
}

const CLASSES: [&str; 4] =
    ["as promised", "typed error, as promised", "promise broken", "crash or hang"];

/// One cell, as written to `cells.csv`, and for other libraries to `timing_third_party_cells.csv`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
struct Row {
    /// The case.
    scene: String,
    /// The method, traversal, part or library.
    method: String,
    /// What came of it:
    outcome: Class,
    /// 0 where nothing is built.
    objects: usize,
    depth: Option<usize>,
    /// Internal area, world units squared.
    cost: Option<f64>,
    /// Of the cost against exact arithmetic.
    relative_error: Option<f64>,
    /// The error, or the promises that are broken.
    note: String,
}

/// The time of a method on a case's scene, as written to `timing_cells.csv`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
struct Timing {
    scene: String,
    method: String,
    objects: usize,
    /// Wall time.
    seconds: f64,
    /// The same per object.
    nanoseconds_per_object: f64,
    /// Of builders on S36, beyond the boxes, where the system tells.
    peak_bytes_per_object: Option<f64>,
}

/// The columns of the files that a measurement leaves.
pub fn columns() -> Vec<Columns> {
    vec![Columns::of::<Row>(), Columns::of::<Timing>()]
}

/// The case whose memory is measured.
const MEMORY: &str = "S36";

impl Row {
    /// A row without numbers.
    fn bare(case: &Case, method: &str, outcome: Class, note: String) -> Self {
        Self {
            scene: format!("{} {}", case.id, case.name),
            method: method.into(),
            outcome,
            objects: 0,
            depth: None,
            cost: None,
            relative_error: None,
            note,
        }
    }

    fn new(case: &Case, method: &str, cell: Cell) -> (Self, Option<Examined>) {
        let row = |outcome, note| Self::bare(case, method, outcome, note);
        match cell {
            Cell::Refused(error) => (row(Class::Refused, error), None),
            Cell::Broken(broken) => (row(Class::Broken, broken.to_string()), None),
            Cell::Kept(examined) if case.scene().is_some() && examined.seconds > 0.0 => {
                let Examined { objects, depth, cost, relative_error, .. } = examined;
                let depth = Some(depth);
                let cost = Some(cost);
                let relative_error = Some(relative_error);
                let kept = row(Class::Kept, examined.note.clone());
                (Self { objects, depth, cost, relative_error, ..kept }, Some(examined))
            }
            Cell::Kept(examined) => (row(Class::Kept, examined.note), None),
        }
    }

    /// A row of another library, whose note lists broken promises.
    fn of_peer(
        case: &Case,
        peer: &str,
        outcome: Class,
        objects: usize,
        found: Option<&Found>,
        broken: &[String],
    ) -> Self {
        let depth = found.map(|found| found.depth);
        let cost = found.map(|found| found.cost);
        let cost = cost.filter(|cost| cost.is_finite());
        Self { objects, depth, cost, ..Self::bare(case, peer, outcome, broken.join(BETWEEN)) }
    }

    /// What the heat map shows: the broken promises, or the depth.
    fn text(&self) -> String {
        match self.outcome {
            Class::Kept | Class::Refused => self
                .depth
                .map_or_else(String::new, |depth| depth.to_string()),
            Class::Broken | Class::Dead => {
                let broken = self.note.split(BETWEEN).map(Broken::from);
                let promises: BTreeSet<Promise> = broken
                    .filter_map(|broken| broken.promise)
                    .collect();
                let names: Vec<String> = promises.iter().map(Promise::to_string).collect();
                if names.is_empty() { "!".into() } else { names.join(" ") }
            }
        }
    }
}

/// Separates broken promises in a note.
const BETWEEN: &str = "; ";

impl Config {
    /// Runs the cases (all if none are named) and writes rows, times and the heat map.
    pub fn execute(
        &self,
        cases: &[String],
        methods: &[Labelled],
        store: &Store,
        interrupted: &dyn Fn() -> bool,
    ) -> Result<String, Error> {
        let chosen = |case: &&Case| cases.is_empty() || cases.iter().any(|id| id == case.id);
        let cases: Vec<&Case> = CASES.iter().filter(chosen).collect();
        let effort = Effort {
            builders: self.builders,
            work_per_object: self.work_per_object,
            larger: self.larger_searches,
        };
        let mut rows = Vec::new();
        let mut times = Vec::new();
        let mut peers = Vec::<Row>::new();
        for (done, case) in cases.iter().enumerate() {
            if interrupted() {
                return Err(Error::Interrupted { finished: done, runs: cases.len() });
            }
            for Labelled { label, method, .. } in methods {
                let Contestant::Ours(method) = method else { continue };
                let cell = case.of_method(method, &effort);
                let Some((row, examined)) = cell.map(|cell| Row::new(case, label, cell)) else {
                    continue;
                };
                times.extend(examined.map(|Examined { objects, seconds, .. }| {
                    Timing {
                        scene: row.scene.clone(),
                        method: label.clone(),
                        objects,
                        seconds,
                        nanoseconds_per_object: seconds * 1e9 / objects.max(1) as f64,
                        peak_bytes_per_object: (case.id == MEMORY && is_builder(method))
                            .then(|| child::peak_bytes(method, case.id, objects))
                            .flatten()
                            .map(|bytes| bytes as f64 / objects.max(1) as f64),
                    }
                }));
                rows.push(row);
            }
            let traversals = tracing::TRAVERSALS
                .iter()
                .filter_map(|(name, traversal)| {
                    Some(Row::new(case, name, case.of_traversal(*traversal, self.rays)?).0)
                });
            rows.extend(traversals);
            rows.extend(
                Part::ALL
                    .iter()
                    .filter_map(|&part| Some(Row::new(case, part.name(), case.of_part(part)?).0)),
            );
            for peer in peers::NAMES {
                peers.extend(
                    case.scene()
                        .map(|scene| self.peer(case, scene, peer)),
                );
            }
        }
        store.write("cells.csv", &to_bytes(&rows, Path::new("cells.csv"))?)?;
        store.write("timing_cells.csv", &to_bytes(&times, Path::new("timing_cells.csv"))?)?;
        if !peers.is_empty() {
            store.write(
                "timing_third_party_cells.csv",
                &to_bytes(&peers, Path::new("timing_third_party_cells.csv"))?,
            )?;
        }
        // Like the file of the other libraries: what is drawn depends on which are compiled in.
        let map = heat_map(&self::rows(store.folder())?.concat());
        store.write("timing_stability.svg", figures::svg(&map)?.as_bytes())?;
        Ok(output(store.folder())?.text())
    }

    /// Another library on a case: few objects with all checks, then many.
    fn peer(&self, case: &Case, scene: &SceneCase, peer: &str) -> Row {
        let limit = Duration::from_secs(self.seconds_per_peer.max(1));
        let mut last = None;
        let mut broken = Vec::new();
        let [few, many, _] = scene.sizes;
        for objects in [few, many] {
            match child::examine(peer, case.id, objects, limit) {
                Ok(found) => {
                    broken.extend_from_slice(&found.broken);
                    last = Some(found);
                }
                Err(end) => {
                    broken.push(
                        Promise::P1
                            .broken(format!("{end} on {objects} objects"))
                            .to_string(),
                    );
                    return Row::of_peer(case, peer, Class::Dead, objects, last.as_ref(), &broken);
                }
            }
        }
        let outcome = if broken.is_empty() { Class::Kept } else { Class::Broken };
        Row::of_peer(case, peer, outcome, many, last.as_ref(), &broken)
    }
}

/// The rows of the CSV files in the folder, our own and the other libraries'. The latter may be those of an earlier run:
/// without the feature `peers` none are written.
fn rows(folder: &Path) -> Result<[Vec<Row>; 2], Error> {
    let peers = folder.join("timing_third_party_cells.csv");
    Ok([read(&folder.join("cells.csv"))?, if peers.is_file() { read(&peers)? } else { vec![] }])
}

/// Every case by everything that was asked of it.
fn heat_map(rows: &[Row]) -> HeatMap {
    let names = |name: fn(&Row) -> &String| {
        let mut names: Vec<String> = Vec::new();
        for row in rows {
            if !names.contains(name(row)) {
                names.push(name(row).clone());
            }
        }
        names
    };
    let scenes = names(|row| &row.scene);
    let columns = names(|row| &row.method);
    let cell = |scene: &String, column: &String| {
        let row = rows
            .iter()
            .find(|row| (&row.scene, &row.method) == (scene, column));
        let shown =
            |row: &Row| figures::Cell { class: Some(row.outcome as usize), text: row.text() };
        row.map(shown).unwrap_or_default()
    };
    let cells = scenes
        .iter()
        .flat_map(|scene| {
            columns
                .iter()
                .map(move |column| cell(scene, column))
        })
        .collect();
    HeatMap {
        title: HEADING.into(),
        caption:
            "Every case with all that can be asked: methods, traversals, readers, and other libraries. Numbers \
             are depths of trees; where a promise was broken, which: P1 no crash or hang, P2 boxes contain, P3 no hit is missed, P4 the \
             same bytes for any number of threads, P5 scaling by 2^k changes no tree (other libraries promise none of this, least of \
             all P5), P6 depth is reported, P7 costs are finite. Grey: not asked."
                .into(),
        row_label: "case".into(),
        rows: scenes,
        columns,
        cells,
        classes: CLASSES.map(String::from).into(),
    }
}

const HEADING: &str = "Stiff and extreme cases";

/// The summary and the broken promises, from the CSV files in the folder.
pub fn output(folder: &Path) -> Result<Output, Error> {
    let [own, peers] = rows(folder)?;
    let is_bad = |row: &&Row| matches!(row.outcome, Class::Broken | Class::Dead);
    let count = |class| {
        own.iter()
            .filter(|row| row.outcome == class)
            .count()
    };
    let worst = own
        .iter()
        .filter_map(|row| row.relative_error)
        .fold(0.0, f64::max);
    let mut output = Output::new("", HEADING);
    output.reading = format!(
        "{} cells: {} as promised, {} with the error promised, {} broken. Largest error of a cost: {worst:.1e}. Other \
         libraries: {} of {} cells break a promise, crash or hang.",
        own.len(),
        count(Class::Kept),
        count(Class::Refused),
        own.iter().filter(is_bad).count(),
        peers.iter().filter(is_bad).count(),
        peers.len(),
    );
    let bad: Vec<&Row> = own.iter().chain(&peers).filter(is_bad).collect();
    if !bad.is_empty() {
        output.show("Broken promises:", &bad, "scene method outcome note")?;
    }
    Ok(output)
}
