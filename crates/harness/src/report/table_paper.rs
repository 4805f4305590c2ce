//! Compares the ratios of a table with the paper's.

use super::paper::{PaperRow, Verdict};
use super::prelude::*;
use super::table::{Cell, Column, Config, of_column};
use std::cmp::Ordering;

impl Config {
    /// Compares a number of the paper with ours.
    fn compare(&self, rows: &Rows, column: &Column, cell: &Cell) -> Option<PaperRow> {
        let paper = cell.paper_over_base?;
        let ours = cell.cost_over_base;
        let quantity = format!("{}, cost over base", column.name);
        let row = PaperRow::new(&self.source, rows.shown(cell.scene), quantity, &column.reason);
        let interval = cell.low_over_base.zip(cell.high_over_base);
        Some(row.compare_ratios(paper, ours, interval, self.tolerance))
    }

    /// Compares a number of the paper with the closest of the columns that read it in different
    /// ways.
    fn compare_readings(&self, rows: &Rows, scene: &str, cells: &[Cell]) -> Option<PaperRow> {
        let distance = |cell: &&Cell| {
            cell.paper_over_base.map(|paper| (cell.cost_over_base / paper).ln().abs())
        };
        let base = &self.columns.first()?.name;
        let read = cells.iter().filter(|cell| {
            cell.scene == scene && cell.column != base && cell.paper_over_base.is_some()
        });
        let closest =
            read.min_by(|a, b| distance(a).partial_cmp(&distance(b)).unwrap_or(Ordering::Equal))?;
        let paper = closest.paper_over_base?;
        // The paper prints no formula, so the closest reading is the most favourable to it.
        let close = is_close(closest, self.tolerance);
        let column = self.columns.iter().find(|column| column.name == closest.column)?;
        let row = PaperRow::new(
            &self.source,
            rows.shown(scene),
            "cost over base, the closest reading",
            &column.reason,
        );
        let row = row.compare(
            format!("{paper:.4}"),
            format!("{:.4}, by {}", closest.cost_over_base, closest.column),
            if close { Verdict::Inconclusive } else { Verdict::Differs },
            format!(
                "differs if no reading is within {} % of the paper's; the paper prints no formula, so that a reading which is within cannot \
                 be distinguished from the paper's",
                100.0 * self.tolerance
            ),
        );
        Some(PaperRow {
            paper_over_base: Some(paper),
            ours_over_base: Some(closest.cost_over_base),
            ..row
        })
    }

    /// Returns true if all columns except the base are readings of one column of the paper.
    pub(super) fn are_readings(&self) -> bool {
        let mut others = self.columns.iter().skip(1);
        match others.next() {
            Some(first) => {
                !first.paper.is_empty()
                    && others.len() > 0
                    && others.all(|column| column.paper == first.paper)
            }
            None => false,
        }
    }

    /// Returns the rows of `paper.csv`, one for each number of the paper.
    pub(super) fn compare_all(&self, rows: &Rows, cells: &[Cell]) -> Vec<PaperRow> {
        if self.are_readings() {
            let scenes = rows.scenes().into_iter();
            return scenes.filter_map(|scene| self.compare_readings(rows, scene, cells)).collect();
        }
        let mut compared = Vec::new();
        for column in self.columns.iter().skip(1) {
            compared.extend(
                of_column(cells, column).filter_map(|cell| self.compare(rows, column, cell)),
            );
        }
        compared
    }
}

/// Returns true if the ratio is within the tolerance of the paper's.
fn is_close(cell: &Cell, tolerance: f64) -> bool {
    cell.paper_over_base.is_some_and(|paper| (cell.cost_over_base / paper - 1.0).abs() <= tolerance)
}
