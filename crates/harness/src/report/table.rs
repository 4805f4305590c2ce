//! The paper's tables: ratios to base, scenes by columns, ours beside the paper's.

use super::statistics::{expected_best_of, median, minimum, range};
use super::{Output, Rows, display_name, over, text_table, verdict};
use crate::Error;
use crate::figures::{Axis, Figure, Layer, Panel};
use crate::run::rows::{PaperRow, to_bytes};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// A table of cost ratios.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the paper has it, such as `Table 4`.
    pub source: String,
    /// Heading.
    pub title: String,
    /// Ratios within this relative distance of the paper's agree with it. Default 0.02.
    #[serde(default = "two_percent")]
    pub tolerance: f64,
    /// The columns; the paper's ratios are to its values in the first.
    pub columns: Vec<Column>,
}

fn two_percent() -> f64 {
    0.02
}

/// A column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Column {
    /// Heading.
    pub name: String,
    /// Label of the method.
    pub method: String,
    /// The best of the first so many trials; without it the run's result. Median over repetitions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub best_of: Option<usize>,
    /// The paper's costs by scene.
    #[serde(default)]
    pub paper: BTreeMap<String, f64>,
    /// Why ours differs, where it does.
    #[serde(default)]
    pub reason: String,
}

/// One cell, as written to `table.csv`.
#[derive(Serialize)]
struct Cell<'a> {
    scene: &'a str,
    scene_kind: &'a str,
    column: &'a str,
    method: &'a str,
    best_of: Option<usize>,
    cost_over_base: f64,
    /// The expected best of so many trials, from all trials run.
    expected_over_base: Option<f64>,
    paper_over_base: Option<f64>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let scenes = rows.scenes();
        let cells: Vec<Cell> = scenes
            .iter()
            .flat_map(|&(scene, kind)| {
                self.columns.iter().filter_map(move |column| self.cell(rows, scene, kind, column))
            })
            .collect();
        let title = format!("{}: {}", self.source, self.title);
        let figure = Figure {
            title,
            caption: self.caption(),
            columns: 1,
            panels: vec![self.panel(&scenes, &cells)],
            ..Default::default()
        };
        Ok(Output {
            csv: vec![("table".into(), to_bytes(&cells, Path::new("table.csv"))?)],
            figures: vec![("table".into(), figure)],
            paper: self.comparisons(&cells, rows),
            text: self.text(&scenes, &cells),
            reading: self.reading(&cells),
        })
    }

    fn reading(&self, cells: &[Cell]) -> String {
        let of = |column: &Column| {
            let own = || cells.iter().filter(|cell| cell.column == column.name).map(|cell| cell.cost_over_base);
            let (low, high) = range(own())?;
            let below = own().filter(|&ratio| ratio < 1.0).count();
            let scenes = own().count();
            Some(format!(
                "{}: {low:.3} to {high:.3} of base, below it on {below} of {scenes} scenes",
                column.name
            ))
        };
        self.columns.iter().filter_map(of).collect::<Vec<_>>().join("; ") + "."
    }

    fn cell<'a>(&'a self, rows: &Rows, scene: &'a str, kind: &'a str, column: &'a Column) -> Option<Cell<'a>> {
        let trials = rows.trials_over_base(scene, &column.method);
        let results: Vec<f64> = match column.best_of {
            Some(m) => trials.iter().filter_map(|trials| minimum(trials.iter().copied().take(m))).collect(),
            None => {
                let runs = rows.runs.iter().filter(|run| run.scene == scene && run.method == column.method);
                runs.map(|run| over(run.cost, run.base_cost)).collect()
            }
        };
        Some(Cell {
            scene,
            scene_kind: kind,
            column: &column.name,
            method: &column.method,
            best_of: column.best_of,
            cost_over_base: median(&results)?,
            expected_over_base: column.best_of.and_then(|m| expected_best_of(&trials.concat(), m)),
            paper_over_base: self.paper_ratio(column, scene),
        })
    }

    fn paper_ratio(&self, column: &Column, scene: &str) -> Option<f64> {
        Some(column.paper.get(scene)? / self.columns.first()?.paper.get(scene)?)
    }

    /// One row per number of the paper, and one per column for its range over scenes.
    fn comparisons(&self, cells: &[Cell], rows: &Rows) -> Vec<PaperRow> {
        let mut comparisons = Vec::new();
        for column in self.columns.iter().skip(1) {
            let own = || cells.iter().filter(|cell| cell.column == column.name);
            let row = |scene: &str, quantity: String| PaperRow {
                source: self.source.clone(),
                scene: scene.into(),
                quantity,
                paper: String::new(),
                ours: String::new(),
                paper_over_base: None,
                ours_over_base: None,
                verdict: String::new(),
                reason: column.reason.clone(),
            };
            for cell in own() {
                let Some(paper) = cell.paper_over_base else { continue };
                let base =
                    rows.runs.iter().find(|run| run.scene == cell.scene).map_or(f64::NAN, |run| run.base_cost);
                comparisons.push(PaperRow {
                    paper: column.paper.get(cell.scene).map_or_else(String::new, |cost| format!("{cost:e}")),
                    ours: format!("{:.5e}", cell.cost_over_base * base),
                    paper_over_base: Some(paper),
                    ours_over_base: Some(cell.cost_over_base),
                    verdict: verdict(paper, cell.cost_over_base, self.tolerance),
                    ..row(&display_name(cell.scene, cell.scene_kind), format!("{} cost", column.name))
                });
            }
            let both: Vec<_> =
                own().filter_map(|cell| Some((cell.paper_over_base?, cell.cost_over_base))).collect();
            let range = |values: &mut dyn Iterator<Item = f64>| {
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
            };
            let paper = range(&mut both.iter().map(|pair| pair.0));
            let ours = range(&mut both.iter().map(|pair| pair.1));
            if !both.is_empty() {
                let inside =
                    ours.0 >= paper.0 * (1.0 - self.tolerance) && ours.1 <= paper.1 * (1.0 + self.tolerance);
                let show = |(low, high): (f64, f64)| format!("{low:.3} to {high:.3}");
                comparisons.push(PaperRow {
                    paper: show(paper),
                    ours: show(ours),
                    verdict: if inside { "inside the paper's range" } else { "outside the paper's range" }
                        .into(),
                    ..row("all of these", format!("{} cost over base, range", column.name))
                });
            }
        }
        comparisons
    }

    fn caption(&self) -> String {
        "Total area of inner nodes over that of the greedy Müller–Fellner tree. Ours on stand-in scenes, the paper's \
         on the originals: compare ratios within a column, not bar by bar."
            .into()
    }

    fn panel(&self, scenes: &[(&str, &str)], cells: &[Cell]) -> Panel {
        let names = scenes.iter().map(|&(scene, kind)| display_name(scene, kind)).collect();
        let columns = || self.columns.iter().skip(1);
        let values = |column: &Column, value: &dyn Fn(&Cell) -> Option<f64>| -> Vec<f64> {
            let of = |scene: &str| cells.iter().find(|cell| cell.scene == scene && cell.column == column.name);
            scenes.iter().map(|&(scene, _)| of(scene).and_then(value).unwrap_or(f64::NAN)).collect()
        };
        let bars = |name: String, values| Layer::Bars { name, values, spread: vec![], base: 1.0 };
        // Columns that are readings of one column of the paper share its bars.
        let readings = columns().all(|column| column.paper == self.columns[1].paper);
        let mut layers = Vec::new();
        for (index, column) in columns().enumerate() {
            if !column.paper.is_empty() && (index == 0 || !readings) {
                let name = if readings { "paper".into() } else { format!("{}, paper", column.name) };
                layers.push(bars(name, values(column, &|cell| cell.paper_over_base)));
            }
            layers.push(bars(
                format!("{}, ours", column.name),
                values(column, &|cell| Some(cell.cost_over_base)),
            ));
        }
        let label = "cost / base";
        let wide = cells.iter().any(|cell| cell.cost_over_base > 10.0);
        let y = if wide { Axis::log(label) } else { Axis::linear(label) };
        layers.push(Layer::HLine { y: 1.0, label: "greedy".into() });
        Panel { title: String::new(), x: Axis::categories("", names), y, layers }
    }

    fn text(&self, scenes: &[(&str, &str)], cells: &[Cell]) -> String {
        let mut table =
            text_table(std::iter::once("scene").chain(self.columns.iter().map(|column| column.name.as_str())));
        for &(scene, kind) in scenes {
            let mut row = vec![display_name(scene, kind)];
            for column in &self.columns {
                let cell = cells.iter().find(|cell| cell.scene == scene && cell.column == column.name);
                row.push(cell.map_or_else(String::new, |cell| {
                    let ours = format!("{:.4}", cell.cost_over_base);
                    cell.paper_over_base.map_or(ours.clone(), |paper| format!("{ours}  (paper {paper:.4})"))
                }));
            }
            table.add_row(row);
        }
        format!(
            "{}: {}\nCost over base, ours (and the paper's, on its own scenes):\n{table}\n",
            self.source, self.title
        )
    }
}
