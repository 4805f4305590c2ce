//! The figure of a table that a query gives.

use super::config::Series;
use super::data::{distinct, grouped};
use super::prelude::*;
use super::query::{Row, number_in};
use bvh_config::Nested;
use serde::Deserialize;
use std::collections::BTreeMap;

bvh_config::config! { serde;
    /// A figure of the table.
    pub struct Drawing {
        /// Explains the figure.
        caption: String;
        /// The shape of the marks.
        marks: Shape;
        /// Columns whose values are the panels; by default there is one panel.
        panels: Vec<String>;
        /// Panels per row.
        per_row: usize = 2, in 1..=2;
        /// The column along the horizontal axis. In rows, values have lines from end to end of
        /// their intervals, if the table has those.
        x: String;
        /// The column along the vertical axis; names for rows.
        y: String;
        /// True for the same ranges in all panels.
        same_axes: bool;
        /// Columns whose values are the series.
        series: Vec<String>;
        /// Series of several methods each, by name.
        lines: Vec<Series>, in Nested;
        /// Label of the horizontal axis.
        x_label: String;
        /// Label of the vertical axis.
        y_label: String;
        /// True for a logarithmic horizontal axis.
        log_x: bool;
        /// True for a logarithmic vertical axis.
        log_y: bool;
        /// True for fractions along the vertical axis, which are written in per cent.
        percent_y: bool;
        /// Names in words for scenes, rows and series, by what they are called in the table.
        names: BTreeMap<String, String>;
        /// Label of a method that is compared with itself: rows of scenes and methods where it
        /// differs from itself are not drawn.
        control: String;
        /// The value of a line across all rows, such as 1 for ratios, or at this height.
        #[serde(skip_serializing_if = "Option::is_none")]
        line_at: Option<f64>, in 0.0..=1e300;
    }
}

/// The shape of marks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Named rows with a dot per value.
    #[default]
    Rows,
    /// Points with a line through them.
    Lines,
}

impl Drawing {
    /// Returns one panel for all rows that agree in the columns `panels`.
    pub(super) fn panels(&self, rows: &Rows, table: &[Row]) -> Vec<Panel> {
        let by_title = grouped(self.sound(table), |row| self.title(rows, row)).into_iter();
        let mut panels: Vec<Panel> =
            by_title.map(|(title, table)| self.panel(rows, title, &table)).collect();
        if self.same_axes {
            figures::share_axes(&mut panels);
        }
        panels
    }

    fn title(&self, rows: &Rows, row: &Row) -> String {
        let name = |column: &String| self.shown(rows, column, &text_in(row, column));
        self.panels.iter().map(name).collect::<Vec<_>>().join(": ")
    }

    fn panel(&self, rows: &Rows, title: String, table: &[&Row]) -> Panel {
        if self.marks == Shape::Rows {
            return self.rows(rows, title, table);
        }
        let mut layers = Vec::new();
        for (series, table) in grouped(table.iter().copied(), |row| self.series_of(row)) {
            let points = self.points(&table);
            layers.push(Layer::new(&series, Marks::Line(points.clone())));
            layers.push(Layer::new(series, Marks::Points(points)));
        }
        layers.extend(self.line_at.map(|at| Layer::new("", Marks::HLine(at))));
        let unit = if self.percent_y { Unit::Percent } else { Unit::Number };
        let (x, y) = (axis(&self.x_label, self.log_x), axis(&self.y_label, self.log_y));
        panel(title, x, y.unit(unit), layers)
    }

    fn rows(&self, rows: &Rows, title: String, table: &[&Row]) -> Panel {
        let name = |row: &Row| self.shown(rows, &self.y, &text_in(row, &self.y));
        let dot = |row: &&Row| {
            let number = |end: &str| number_in(row, &format!("{}{end}", self.x));
            let ends = number("_low").zip(number("_high"));
            Some(Dot { row: name(row), series: self.series_of(row), value: number("")?, ends })
        };
        let all: Vec<Dot> = table.iter().filter_map(dot).collect();
        let names = distinct(table.iter().map(|row| name(row)));
        let mut panel = dots(title, axis(&self.x_label, self.log_x), names, &all);
        panel.layers.extend(self.line_at.map(|at| Layer::new("", Marks::VLine(at))));
        panel
    }

    /// Returns the series of a row: the line that its method belongs to, or the values of its
    /// columns.
    fn series_of(&self, row: &Row) -> String {
        let method = row.get("method");
        let line = self
            .lines
            .iter()
            .find(|line| method.is_some_and(|method| line.methods.contains(method)));
        if let Some(line) = line {
            return line.name.clone();
        }
        let values: Vec<String> = self.series.iter().map(|column| text_in(row, column)).collect();
        let name = values.join(", ");
        self.names.get(&name).cloned().unwrap_or(name)
    }

    /// Returns the name in words of a text in a column.
    fn shown(&self, rows: &Rows, column: &str, text: &str) -> String {
        let own = self.names.get(text).cloned();
        own.unwrap_or_else(|| if column == "scene" { rows.shown(text) } else { text.into() })
    }

    /// Returns the rows of the table without those whose noise the control shows to be biased.
    fn sound<'t>(&self, table: &'t [Row]) -> Vec<&'t Row> {
        let is_control = |row: &&Row| text_in(row, "against") == self.control;
        let key = |row: &Row| ["scene", "method"].map(|column| text_in(row, column));
        let verdict = format!("{}_verdict", self.x);
        let is_biased = |row: &&Row| ["lower", "higher"].contains(&text_in(row, &verdict).as_str());
        let controls = table.iter().filter(|_| !self.control.is_empty()).filter(is_control);
        let biased: Vec<_> = controls.filter(is_biased).map(key).collect();
        table.iter().filter(|row| !biased.contains(&key(row))).collect()
    }

    /// Returns the points of some rows, by x.
    fn points(&self, table: &[&Row]) -> Vec<(f64, f64)> {
        let mut points: Vec<(f64, f64)> = table
            .iter()
            .filter_map(|row| number_in(row, &self.x).zip(number_in(row, &self.y)))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        points
    }
}

fn text_in(row: &Row, column: &str) -> String {
    row.get(column).cloned().unwrap_or_default()
}

fn axis(label: &str, is_log: bool) -> Axis {
    if is_log { Axis::log(label) } else { Axis::linear(label) }
}
