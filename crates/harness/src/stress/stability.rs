//! The experiment `stability`: every case with every method, traversal and part, as rows.

use super::child;
use crate::Error;
use crate::contestant::{Contestant, Labelled};
use crate::report::output::Output;
use crate::rows::store::Store;
use crate::rows::{read, to_bytes};
use bvh_config::config;
use bvh_stress::examine::Examined;
use bvh_stress::{CASES, Case, Cell, Effort, LargerScenes, Part, Size, is_builder, tracing};
use serde::{Deserialize, Serialize};
use std::path::Path;

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
}

/// One cell, as written to `cells.csv`.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    /// The case.
    scene: String,
    /// The method, traversal or part.
    method: String,
    /// The outcome.
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
}

impl Config {
    /// Runs the cases (all if none are named) and writes rows and times.
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
        for (done, case) in cases.iter().enumerate() {
            if interrupted() {
                return Err(Error::Interrupted { finished: done, runs: cases.len() });
            }
            for Labelled { label, method, .. } in methods {
                // Specs accept only methods of ours here.
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
            let traversals = tracing::TRAVERSALS.iter().filter_map(|(name, traversal)| {
                Some(Row::new(case, name, case.of_traversal(*traversal, self.rays)?).0)
            });
            rows.extend(traversals);
            rows.extend(
                Part::ALL
                    .iter()
                    .filter_map(|&part| Some(Row::new(case, part.name(), case.of_part(part)?).0)),
            );
        }
        store.write("cells.csv", &to_bytes(&rows, Path::new("cells.csv"))?)?;
        store.write("timing_cells.csv", &to_bytes(&times, Path::new("timing_cells.csv"))?)?;
        Ok(output(store.folder())?.text())
    }
}

const HEADING: &str = "Stiff and extreme cases";

/// Makes the summary and the table of broken promises from the CSV files in the folder.
pub fn output(folder: &Path) -> Result<Output, Error> {
    let rows: Vec<Row> = read(&folder.join("cells.csv"))?;
    let cells_with = |outcome| {
        let cells = rows.iter().filter(|row| row.outcome == outcome);
        cells.collect::<Vec<&Row>>()
    };
    let broken = cells_with(Class::Broken);
    let worst = rows.iter().filter_map(|row| row.relative_error).fold(0.0, f64::max);
    let title = format!(
        "{} cells: {} as promised, {} with the error promised, {} broken. Largest error of a cost: \
         {worst:.1e}.",
        rows.len(),
        cells_with(Class::Kept).len(),
        cells_with(Class::Refused).len(),
        broken.len(),
    );
    let mut output = Output::new(HEADING, &title);
    if !broken.is_empty() {
        output.show("Broken promises:", &broken, "scene method outcome note")?;
    }
    Ok(output)
}
