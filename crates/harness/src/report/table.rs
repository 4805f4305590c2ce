//! The paper's tables: ratios to base, scenes by columns, ours beside the paper's.

use super::config::Labels;
use super::output::text_table;
use super::paper::{PaperRow, Verdict};
use super::prelude::*;
use crate::statistics::{expected_best_of, median, minimum, range, spread_of_best};
use bvh_build::config::{Accepts, Itself, above};
use std::collections::BTreeMap;

bvh_build::config! { serde;
    /// A table of cost ratios.
    pub struct Config {
        /// Where the paper has it, such as `Table 4`.
        source: String;
        /// Heading.
        title: String;
        /// Ratios within this relative distance of the paper's agree with it.
        tolerance: f64 = 0.02, in 0.0..=1.0;
        /// The columns; the paper's ratios are to its values in the first.
        columns: Vec<Column>, in Itself;
    }
    check |config: &Self| OneOrMore.faults("columns", &config.columns);
}

bvh_build::config! { serde;
    /// A column.
    pub struct Column {
        /// Heading.
        name: String;
        /// Label of the method.
        method: String;
        /// The best of so many first trials; without it the run's result. Median over repetitions.
        #[serde(skip_serializing_if = "Option::is_none")]
        best_of: Option<usize>, in 1..;
        /// The paper's costs by scene.
        paper: BTreeMap<String, f64>, in above(0.0);
        /// Why ours differs, where it does.
        reason: String;
    }
}

impl Labels for Column {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        self.method.labels(&format!("{key}.method"))
    }
}

/// One cell, as written to `table.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Cell<'a> {
    scene: &'a str,
    scene_kind: &'a str,
    /// Name of the table's column.
    column: &'a str,
    method: &'a str,
    /// Trials of which the best counts; empty for runs as a whole.
    best_of: Option<usize>,
    cost_over_base: f64,
    /// The expected best of so many trials, from all trials run.
    expected_over_base: Option<f64>,
    /// The lower of two numbers between which the best of so many trials lies in nine of ten repetitions; of runs as a whole, in all.
    low_over_base: Option<f64>,
    /// The upper one.
    high_over_base: Option<f64>,
    /// The paper's ratio, where it has one.
    paper_over_base: Option<f64>,
}

/// Bars that are higher than the paper's highest by more than this factor leave the panel.
const MOST_OF_PAPER: f64 = 3.0;

const CAPTION: &str = "Total area of inner nodes over that of the greedy Müller–Fellner tree. Ours on stand-in scenes, \
                       the paper's on the originals: compare ratios within a column, not bar by bar. \
                       Bars that reach the top go on beyond it.";

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let scenes = rows.scenes();
        let row = |&scene: &_| self.columns.iter().filter_map(move |column| self.cell(rows, scene, column));
        let cells: Vec<Cell> = scenes.iter().flat_map(row).collect();
        let mut output = Output::new(&self.source, &self.title);
        output.add_csv("table", &cells)?;
        output.add_figure("table", CAPTION, 1, vec![self.draw(rows, &cells)]);
        for column in self.columns.iter().skip(1) {
            let own: Vec<&Cell> = cells.iter().filter(|cell| cell.column == column.name).collect();
            output.paper.extend(own.iter().filter_map(|cell| self.compare(rows, column, cell)));
            output.paper.extend(self.compare_ranges(rows, column, &own));
        }
        self.add_table(&mut output, rows, &cells);
        output.reading = self.reading(&cells);
        Ok(output)
    }

    fn cell<'a>(&'a self, rows: &'a Rows, scene: &'a str, column: &'a Column) -> Option<Cell<'a>> {
        let trials = rows.trials_over_base(scene, &column.method);
        let pool = trials.concat();
        let results: Vec<f64> = match column.best_of {
            Some(m) => trials.iter().filter_map(|trials| minimum(trials.iter().copied().take(m))).collect(),
            None => rows.final_ratios(scene, &column.method),
        };
        let interval = match column.best_of {
            Some(m) => spread_of_best(&pool, m),
            None => range(results.iter().copied()).filter(|(low, high)| low < high),
        };
        let (low_over_base, high_over_base) = interval.unzip();
        Some(Cell {
            scene,
            scene_kind: rows.kind(scene),
            column: &column.name,
            method: &column.method,
            best_of: column.best_of,
            cost_over_base: median(&results)?,
            expected_over_base: column.best_of.and_then(|m| expected_best_of(&pool, m)),
            low_over_base,
            high_over_base,
            paper_over_base: self.paper_ratio(column, scene),
        })
    }

    fn paper_ratio(&self, column: &Column, scene: &str) -> Option<f64> {
        Some(column.paper.get(scene)? / self.columns.first()?.paper.get(scene)?)
    }

    /// A number of the paper beside ours.
    fn compare(&self, rows: &Rows, column: &Column, cell: &Cell) -> Option<PaperRow> {
        let (paper, ours) = (cell.paper_over_base?, cell.cost_over_base);
        let quantity = format!("{}, cost over base", column.name);
        let row = PaperRow::new(&self.source, rows.shown(cell.scene), quantity, &column.reason);
        let interval = cell.low_over_base.zip(cell.high_over_base);
        Some(row.compare_ratios(paper, ours, interval, self.tolerance))
    }

    /// The paper's range over its scenes beside ours over the same, and beside every scene that the paper does not have.
    fn compare_ranges(&self, rows: &Rows, column: &Column, own: &[&Cell]) -> Vec<PaperRow> {
        let Some(paper) = range(own.iter().filter_map(|cell| cell.paper_over_base)) else { return vec![] };
        let show = |(low, high): (f64, f64)| format!("{low:.3} to {high:.3}");
        let compare = |scene: String, what: &str, cells: &[&Cell]| {
            let ours = range(cells.iter().map(|cell| cell.cost_over_base))?;
            let ends = cells.iter().flat_map(|cell| {
                [cell.low_over_base, cell.high_over_base].map(|end| end.unwrap_or(cell.cost_over_base))
            });
            let inside = |(low, high)| paper.0 <= low && high <= paper.1;
            let outside = |(low, high)| high < paper.0 || paper.1 < low;
            let ends = range(ends)?;
            let verdict = match (inside(ours), inside(ends), cells.len()) {
                (true, true, _) => Verdict::Agrees,
                (false, _, 1) if outside(ends) => Verdict::Differs,
                (false, false, 2..) => Verdict::Differs,
                _ => Verdict::CannotBeTold,
            };
            let ours = if ours.0 < ours.1 { show(ours) } else { format!("{:.3}", ours.0) };
            let quantity = format!("{}, cost over base, {what}", column.name);
            let row = PaperRow::new(&self.source, scene, quantity, &column.reason);
            Some(row.compare(show(paper), ours, verdict, "all of ours in the paper's range"))
        };
        let (of_paper, others): (Vec<&Cell>, _) = own.iter().partition(|cell| cell.paper_over_base.is_some());
        let all = compare("all of these".into(), "lowest and highest of all scenes", &of_paper);
        let what = "in the range over the paper's scenes";
        let each = others.into_iter().filter_map(|cell| compare(rows.shown(cell.scene), what, &[cell]));
        all.into_iter().chain(each).collect()
    }

    fn draw(&self, rows: &Rows, cells: &[Cell]) -> Panel {
        let columns = || self.columns.iter().skip(1);
        let bars = |name: String, column: &Column, value: &dyn Fn(&Cell) -> Option<f64>, spread| {
            let values = rows.scenes().into_iter().map(|scene| find(cells, scene, column).and_then(value));
            let values = values.map(|value| value.unwrap_or(f64::NAN)).collect();
            Layer::new(name, Marks::Bars { values, spread, base: 1.0 })
        };
        // Columns that are readings of one column of the paper share its bars.
        let readings = columns().all(|column| column.paper == self.columns[1].paper);
        let mut layers = Vec::new();
        for (index, column) in columns().enumerate() {
            if !column.paper.is_empty() && (index == 0 || !readings) {
                let name = if readings { "paper".into() } else { format!("{}, paper", column.name) };
                layers.push(bars(name, column, &|cell| cell.paper_over_base, vec![]));
            }
            let own = rows.scenes().into_iter().map(|scene| {
                let cell = find(cells, scene, column);
                let ends = cell.and_then(|cell| cell.low_over_base.zip(cell.high_over_base));
                ends.unwrap_or((f64::NAN, f64::NAN))
            });
            let name = format!("{}, ours", column.name);
            layers.push(bars(name, column, &|cell| Some(cell.cost_over_base), own.collect()));
        }
        layers.push(Layer::new("greedy", Marks::HLine(1.0)));
        // Readings of a heuristic that peel off one object at a time would hide all differences between the others.
        let theirs = cells.iter().filter_map(|cell| cell.paper_over_base).fold(1.0, f64::max);
        let outlying = cells.iter().any(|cell| cell.cost_over_base > MOST_OF_PAPER * theirs);
        let y = Axis::linear("cost / base");
        let y = if outlying && theirs > 1.0 { y.range(0.9, 1.2 * theirs) } else { y };
        panel("", Axis::categories("", rows.all_shown()), y, layers)
    }

    fn add_table(&self, output: &mut Output, rows: &Rows, cells: &[Cell]) {
        let names = self.columns.iter().map(|column| column.name.as_str());
        let mut table = text_table(std::iter::once("scene").chain(names));
        for scene in rows.scenes() {
            let show = |column: &Column| {
                let cell = find(cells, scene, column)?;
                let ours = format!("{:.4}", cell.cost_over_base);
                Some(cell.paper_over_base.map_or(ours.clone(), |paper| format!("{ours}  (paper {paper:.4})")))
            };
            let shown = self.columns.iter().map(|column| show(column).unwrap_or_default());
            table.add_row(std::iter::once(rows.shown(scene)).chain(shown));
        }
        output.add_table("Cost over base, ours (and the paper's, on its own scenes):", table);
    }

    /// On how many scenes each column but the base is below the base, and the least ratio of all.
    fn reading(&self, cells: &[Cell]) -> String {
        let of = |column: &Column| -> Vec<&Cell> {
            cells.iter().filter(|cell| cell.column == column.name).collect()
        };
        let below = |column: &Column| of(column).iter().filter(|cell| cell.cost_over_base < 1.0).count();
        let others = || self.columns.iter().skip(1);
        let counts = others().map(|column| (column.name.as_str(), below(column)));
        let compared = others().flat_map(of);
        let Some(least) = compared.min_by(|a, b| a.cost_over_base.total_cmp(&b.cost_over_base)) else {
            return String::new();
        };
        let scenes = self.columns.first().map_or(0, |base| of(base).len());
        let Cell { column, scene, cost_over_base, .. } = least;
        let counts = tally(counts, scenes, "scenes");
        format!("Below base: {counts}. The least is {cost_over_base:.3} of base, ‘{column}’ on {scene}.")
    }
}

/// The cell of a column on a scene.
fn find<'c, 'a>(cells: &'c [Cell<'a>], scene: &str, column: &Column) -> Option<&'c Cell<'a>> {
    cells.iter().find(|cell| cell.scene == scene && cell.column == column.name)
}
