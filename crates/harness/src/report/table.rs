//! Tables of the paper: ratios to base, scenes by columns, with the paper's ratios.

use super::config::Labels;
use super::paper::{PaperRow, Verdict};
use super::prelude::*;
use crate::statistics::best_of::predicted_best;
use crate::statistics::{expected_best_of, median, minimum, range};
use bvh_config::{Accepts, Nested, above};
use std::collections::BTreeMap;

report! {
    /// A table of cost ratios.
    pub struct Config {
        /// Ratios within this relative distance of the paper's agree with it.
        tolerance: f64 = 0.02, in 0.0..=1.0;
        /// The columns; the paper's ratios are to its values in the first.
        columns: Vec<Column>, in Nested;
    }
    check |config: &Self| OneOrMore.check("columns", &config.columns);
}

bvh_config::config! { serde;
    /// A column.
    pub struct Column {
        /// Heading.
        name: String;
        /// Label of the method.
        method: String;
        /// Number of first trials whose best counts; without it, the run's result counts. Median
        /// over repetitions.
        #[serde(skip_serializing_if = "Option::is_none")]
        best_of: Option<usize>, in 1..;
        /// The paper's costs by scene.
        paper: BTreeMap<String, f64>, in above(0.0);
        /// Reason for differences from the paper.
        reason: String;
    }
}

impl Labels for Column {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        self.method.labels(&format!("{key}.method"))
    }
}

/// One cell, as written to `table.csv`.
#[derive(Serialize)]
pub(super) struct Cell<'a> {
    scene: &'a str,
    scene_kind: &'a str,
    /// Name of the table's column.
    column: &'a str,
    method: &'a str,
    /// Trials of which the best counts; empty for runs as a whole.
    best_of: Option<usize>,
    cost_over_base: f64,
    /// Expected best of `best_of` trials, from all trials run.
    expected_over_base: Option<f64>,
    /// Lower end of the interval that has the best of as many new trials in at least nine of ten
    /// repetitions, predicted from the order statistics of all trials, or from an exponential tail
    /// below the lowest. For full runs, the lowest of the repetitions.
    low_over_base: Option<f64>,
    /// Upper end of this interval.
    high_over_base: Option<f64>,
    /// The paper's ratio, where it has one.
    paper_over_base: Option<f64>,
    #[serde(skip)]
    reason: &'a str,
}

impl Cell<'_> {
    fn interval(&self) -> Option<(f64, f64)> {
        self.low_over_base.zip(self.high_over_base)
    }

    /// The factor between our ratio and the paper's, as a logarithm.
    fn distance(&self) -> f64 {
        self.paper_over_base.map_or(f64::INFINITY, |paper| (self.cost_over_base / paper).ln().abs())
    }
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut cells = Vec::new();
        for scene in rows.scenes() {
            cells.extend(self.columns.iter().filter_map(|column| self.cell(rows, scene, column)));
        }
        let mut output = Output::default();
        output.add_csv("table", &cells)?;
        output.paper = if self.are_readings() {
            let scenes = rows.scenes().into_iter();
            scenes.filter_map(|scene| self.compare_readings(rows, scene, &cells)).collect()
        } else {
            let others = self.columns.iter().skip(1);
            let cells = others.flat_map(|column| of_column(&cells, column));
            cells.filter_map(|cell| self.compare(rows, cell)).collect()
        };
        Ok(output)
    }

    /// Returns the labels of the methods whose trials some column reads.
    pub(super) fn trial_methods(&self) -> Vec<&str> {
        let with_trials = self.columns.iter().filter(|column| column.best_of.is_some());
        with_trials.map(|column| column.method.as_str()).collect()
    }

    fn cell<'a>(&'a self, rows: &'a Rows, scene: &'a str, column: &'a Column) -> Option<Cell<'a>> {
        let trials = rows.trials_over_base(scene, &column.method);
        let pool = trials.concat();
        let (results, interval) = match column.best_of {
            Some(m) => {
                let best = |trials: &Vec<f64>| minimum(trials.iter().copied().take(m));
                let results: Vec<f64> = trials.iter().filter_map(best).collect();
                (results, predicted_best(&pool, m))
            }
            None => {
                let results = rows.final_ratios(scene, &column.method);
                let interval = range(results.iter().copied()).filter(|(low, high)| low < high);
                (results, interval)
            }
        };
        let (low_over_base, high_over_base) = interval.unzip();
        let paper = column.paper.get(scene).zip(self.columns.first()?.paper.get(scene));
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
            paper_over_base: paper.map(|(cost, base)| cost / base),
            reason: &column.reason,
        })
    }

    /// Compares a number of the paper with ours.
    fn compare(&self, rows: &Rows, cell: &Cell) -> Option<PaperRow> {
        let quantity = format!("{}, cost over base", cell.column);
        let (paper, ours) = (cell.paper_over_base?, cell.cost_over_base);
        let row = PaperRow::new(rows.shown(cell.scene), quantity);
        let row = row.compare_ratios(paper, ours, cell.interval(), self.tolerance);
        Some(PaperRow { reason: cell.reason.into(), ..row })
    }

    /// Compares a number of the paper with the closest of the columns that read it in different
    /// ways.
    fn compare_readings(&self, rows: &Rows, scene: &str, cells: &[Cell]) -> Option<PaperRow> {
        let of_scene = self.columns.iter().skip(1).flat_map(|column| of_column(cells, column));
        let of_scene = of_scene.filter(|cell| cell.scene == scene);
        let closest = of_scene.min_by(|a, b| a.distance().total_cmp(&b.distance()))?;
        let (paper, ours) = (closest.paper_over_base?, closest.cost_over_base);
        let percent = 100.0 * self.tolerance;
        // The paper prints no formula, so the closest reading is the most favourable to it.
        let is_close = (ours / paper - 1.0).abs() <= self.tolerance;
        let quantity = "cost over base, the closest reading";
        let row = PaperRow::new(rows.shown(scene), quantity).compare(
            format!("{paper:.4}"),
            format!("{ours:.4}, by {}", closest.column),
            if is_close { Verdict::Inconclusive } else { Verdict::Differs },
            format!(
                "differs if no reading is within {percent} % of the paper's; the paper prints no \
                 formula, so that a reading which is within cannot be distinguished from the paper's"
            ),
        );
        Some(PaperRow {
            paper_over_base: Some(paper),
            ours_over_base: Some(ours),
            reason: closest.reason.into(),
            ..row
        })
    }

    /// Returns true if all columns except the base are readings of one column of the paper.
    fn are_readings(&self) -> bool {
        match &self.columns[..] {
            [_, first, others @ ..] if !others.is_empty() && !first.paper.is_empty() => {
                others.iter().all(|column| column.paper == first.paper)
            }
            _ => false,
        }
    }
}

/// Returns the cells of a column.
fn of_column<'c, 'a>(
    cells: &'c [Cell<'a>],
    column: &'c Column,
) -> impl Iterator<Item = &'c Cell<'a>> {
    cells.iter().filter(|cell| cell.column == column.name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::data::run;
    use crate::rows::RunRow;

    /// Compares columns, each with the paper's cost and ours on one scene, with the paper.
    fn compared(columns: &[(&str, f64, f64)]) -> Vec<(String, Verdict)> {
        let mut rows = Rows::default();
        let mut config = Config { tolerance: 0.1, ..Config::default() };
        for &(name, paper, cost) in columns {
            rows.runs.push(RunRow { cost, base_cost: 1.0, ..run(name, 0, 1, 0) });
            let paper = BTreeMap::from([("s".into(), paper)]);
            let (name, method) = (name.into(), name.into());
            config.columns.push(Column { name, method, paper, ..Column::default() });
        }
        let paper = config.write(&rows).unwrap().paper.into_iter();
        paper.map(|row| (row.ours, row.verdict)).collect()
    }

    #[test]
    fn several_readings_of_a_number_of_the_paper_are_one_row_by_the_closest() {
        let readings = |ours| compared(&[("base", 1.0, 1.0), ("a", 2.0, 500.0), ("b", 2.0, ours)]);
        // A reading that comes close may still not be the paper's.
        assert_eq!(readings(1.9), [("1.9000, by b".into(), Verdict::Inconclusive)]);
        assert_eq!(readings(3.0), [("3.0000, by b".into(), Verdict::Differs)]);
    }

    #[test]
    fn columns_of_their_own_have_a_row_each() {
        let rows = compared(&[("base", 1.0, 1.0), ("10", 1.1, 1.15), ("100", 1.2, 0.9)]);
        let verdicts: Vec<Verdict> = rows.into_iter().map(|(_, verdict)| verdict).collect();
        assert_eq!(verdicts, [Verdict::Agrees, Verdict::DiffersLower]);
    }
}
