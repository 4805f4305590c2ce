//! The experiment `stability`: every case with every method, traversal and part, as rows and a heat
//! map.

use super::child;
use super::peers::{self, Found};
use crate::Error;
use crate::contestant::{Contestant, Labelled};
use crate::report::data::distinct;
use crate::report::output::Output;
use crate::rows::store::Store;
use crate::rows::{read, to_bytes};
use bvh_config::config;
use bvh_stress::examine::Examined;
use bvh_stress::{
    Broken, CASES, Case, Cell, Effort, LargerScenes, Part, Promise, SceneCase, Size, is_builder,
    tracing,
};
use figures::HeatMap;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

config! {
    serde;
    /// Parameters of the measurement.
    pub struct Config {
        /// Size of the scenes for builders.
        builders: Size = Size::Many;
        /// Budget of a search: nodes per object that it may make or visit.
        work_per_object: u64 = 1000, in 1..;
        /// Larger scenes for searches, in addition to the scenes of few objects. Default none.
        larger_searches: Option<LargerScenes>;
        /// Rays per scene and traversal.
        rays: usize = 5000, in 1..=100_000_000;
        /// Seconds after which the build of another library counts as hanging.
        seconds_per_peer: u64 = 20, in 1..;
    }
}

/// The outcome of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    /// The case.
    scene: String,
    /// The method, traversal, part or library.
    method: String,
    /// The outcome:
    outcome: Class,
    /// Number of objects; 0 if nothing is built.
    objects: usize,
    depth: Option<usize>,
    /// Internal area, world units squared.
    cost: Option<f64>,
    /// The cost's relative error against exact arithmetic.
    relative_error: Option<f64>,
    /// The error, or the broken promises.
    note: String,
}

/// The time of a method on a case's scene, as written to `timing_cells.csv`.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Timing {
    scene: String,
    method: String,
    objects: usize,
    /// Wall time.
    seconds: f64,
    /// Wall time per object, in nanoseconds.
    nanoseconds_per_object: f64,
    /// Peak memory of builders on S36, beyond the boxes, if the system reports it.
    peak_bytes_per_object: Option<f64>,
}

/// The case whose memory is measured.
const MEMORY: &str = "S36";

impl Row {
    /// Makes a row without numbers.
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
        let examined = match cell {
            Cell::Refused(error) => return (Self::bare(case, method, Class::Refused, error), None),
            Cell::Broken(broken) => {
                return (Self::bare(case, method, Class::Broken, broken.to_string()), None);
            }
            Cell::Kept(examined) => examined,
        };
        let row = Self::bare(case, method, Class::Kept, examined.note.clone());
        // Checks that build nothing have no numbers.
        if case.scene().is_none() || examined.seconds <= 0.0 {
            return (row, None);
        }
        let row = Self {
            objects: examined.objects,
            depth: Some(examined.depth),
            cost: Some(examined.cost),
            relative_error: Some(examined.relative_error),
            ..row
        };
        (row, Some(examined))
    }

    /// Returns true for a cell that breaks a promise, crashes or hangs.
    fn is_bad(&self) -> bool {
        matches!(self.outcome, Class::Broken | Class::Dead)
    }

    /// Makes a row of another library, whose note lists broken promises.
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
        // CSV has no spelling of infinity that all readers share.
        let cost = cost.filter(|cost| cost.is_finite());
        Self { objects, depth, cost, ..Self::bare(case, peer, outcome, broken.join(BETWEEN)) }
    }

    /// The text in the heat map: the broken promises, or the depth.
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

/// The separator of broken promises in a note.
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
        let cases: Vec<&Case> = CASES
            .iter()
            .filter(|case| cases.is_empty() || cases.iter().any(|id| id == case.id))
            .collect();
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
                // Specs accept only methods of ours here; libraries run in child processes below.
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

    /// Examines another library on a case: few objects with all checks, then many.
    fn peer(&self, case: &Case, scene: &SceneCase, peer: &str) -> Row {
        let limit = Duration::from_secs(self.seconds_per_peer.max(1));
        let mut last = None;
        let mut broken = Vec::new();
        let [few, many, _] = scene.sizes;
        // Few objects are checked thoroughly, many for crashes and time.
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

/// Reads the rows of the CSV files in the folder: ours and other libraries'.
///
/// Without the feature `peers`, the latter come from an earlier run, if there was one.
fn rows(folder: &Path) -> Result<[Vec<Row>; 2], Error> {
    let peers = folder.join("timing_third_party_cells.csv");
    Ok([read(&folder.join("cells.csv"))?, if peers.is_file() { read(&peers)? } else { vec![] }])
}

/// Draws the outcomes of all cases (rows) by method, traversal, part or library (columns).
fn heat_map(rows: &[Row]) -> HeatMap {
    let scenes = distinct(rows.iter().map(|row| row.scene.clone()));
    let columns = distinct(rows.iter().map(|row| row.method.clone()));
    let mut cells = Vec::new();
    for scene in &scenes {
        for column in &columns {
            let row = rows
                .iter()
                .find(|row| row.scene == *scene && row.method == *column);
            cells.push(row.map_or_else(figures::Cell::default, |row| figures::Cell {
                class: Some(row.outcome as usize),
                text: row.text(),
            }));
        }
    }
    HeatMap {
        title: HEADING.into(),
        caption:
            "Every case with all methods, traversals, readers, and other libraries. Numbers are \
             depths of trees; letters are broken promises: P1 no crash or hang, P2 boxes contain, P3 \
             no hit is missed, P4 the same bytes for any number of threads, P5 scaling by 2^k changes \
             no tree (other libraries make none of these promises, least of all P5), P6 depth is \
             reported, P7 costs are finite. Grey: no check."
                .into(),
        row_label: "case".into(),
        rows: scenes,
        columns,
        cells,
        classes: CLASSES.map(String::from).into(),
    }
}

const HEADING: &str = "Stiff and extreme cases";

/// Makes the summary and the table of broken promises from the CSV files in the folder.
pub fn output(folder: &Path) -> Result<Output, Error> {
    let [own, peers] = rows(folder)?;
    let [kept, refused] = [Class::Kept, Class::Refused].map(|class| {
        let rows = own.iter().filter(|row| row.outcome == class);
        rows.count()
    });
    let broken = own.iter().filter(|row| row.is_bad()).count();
    let bad_peers = peers.iter().filter(|row| row.is_bad()).count();
    let worst = own
        .iter()
        .filter_map(|row| row.relative_error)
        .fold(0.0, f64::max);
    let mut output = Output::new("", HEADING);
    output.reading = format!(
        "{} cells: {kept} as promised, {refused} with the error promised, {broken} broken. \
         Largest error of a cost: {worst:.1e}. Other libraries: {bad_peers} of {} cells break a \
         promise, crash or hang.",
        own.len(),
        peers.len(),
    );
    let rows = own.iter().chain(&peers);
    let bad: Vec<&Row> = rows.filter(|row| row.is_bad()).collect();
    if !bad.is_empty() {
        output.show("Broken promises:", &bad, "scene method outcome note")?;
    }
    Ok(output)
}
