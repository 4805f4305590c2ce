//! The figure of a table that a query gives.

use super::config::Series;
use super::data::distinct;
use super::prelude::*;
use super::query::{Row, number_in};
use bvh_config::Nested;
use serde::Deserialize;

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
        per_row: usize = 2, in 1..=4;
        /// The column along the horizontal axis: categories for bars.
        x: String;
        /// The column along the vertical axis, with whiskers if the table has the ends of its
        /// intervals.
        y: String;
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
        /// The height at which bars begin.
        bars_from: f64, in 0.0..=1e300;
        /// The power of x with which a line from the first point of every panel falls, for
        /// comparison.
        #[serde(skip_serializing_if = "Option::is_none")]
        falls_by_power: Option<f64>, in 0.0..=10.0;
        /// True for a staircase through the points that are lower than all points to their left.
        front: bool;
    }
}

/// The shape of marks.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// A bar per category.
    #[default]
    Bars,
    /// Points.
    Points,
    /// Points with a line through them.
    Lines,
}

impl Drawing {
    /// Returns one panel for all rows that agree in the columns `panels`.
    pub(super) fn panels(&self, rows: &Rows, table: &[Row]) -> Vec<Panel> {
        let mut panels = Vec::new();
        let titles: Vec<String> = table.iter().map(|row| self.title(rows, row)).collect();
        for title in distinct(titles.iter()) {
            let rows_of_panel: Vec<&Row> = table
                .iter()
                .zip(&titles)
                .filter(|(_, of_row)| *of_row == title)
                .map(|(row, _)| row)
                .collect();
            panels.push(self.panel(rows, title.clone(), &rows_of_panel));
        }
        panels
    }

    fn title(&self, rows: &Rows, row: &Row) -> String {
        let mut names = Vec::new();
        for column in &self.panels {
            let name = text_in(row, column);
            names.push(if column == "scene" { rows.shown(&name) } else { name });
        }
        names.join(": ")
    }

    fn panel(&self, rows: &Rows, title: String, table: &[&Row]) -> Panel {
        let names = distinct(table.iter().map(|row| text_in(row, &self.x)));
        let mut layers = Vec::new();
        for series in distinct(table.iter().map(|row| self.series_of(row))) {
            let rows_of_series: Vec<&Row> =
                table.iter().filter(|row| self.series_of(row) == series).copied().collect();
            // Bars of a category have one place each, also where a series has no value.
            if self.marks == Shape::Bars {
                layers.push(self.bars(series, &names, &rows_of_series));
                continue;
            }
            let points = self.points(&rows_of_series);
            if self.marks == Shape::Lines {
                layers.push(Layer::new(&series, Marks::Line(points.clone())));
            }
            layers.push(Layer::new(series, Marks::Points(points)));
        }
        let points = self.points(table);
        if let (Some(power), Some(&(first, highest))) = (self.falls_by_power, points.first()) {
            let line =
                points.iter().map(|&(x, _)| (x, highest * (first / x).powf(power))).collect();
            layers.push(Layer::new(format!("slope −{power}"), Marks::Line(line)));
        }
        if self.front {
            layers.push(Layer::new("best so far", Marks::Steps(front(points))));
        }
        let x = match self.marks {
            Shape::Bars => {
                let shown = |name: String| if self.x == "scene" { rows.shown(&name) } else { name };
                Axis::categories(&self.x_label, names.into_iter().map(shown).collect())
            }
            _ => axis(&self.x_label, self.log_x),
        };
        panel(title, x, axis(&self.y_label, self.log_y), layers)
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
        values.join(", ")
    }

    fn bars(&self, series: String, names: &[String], table: &[&Row]) -> Layer {
        let mut values = Vec::new();
        let mut spread = Vec::new();
        for name in names {
            let row = table.iter().find(|row| text_in(row, &self.x) == *name);
            let number = |end: &str| {
                let value = row.and_then(|row| number_in(row, &format!("{}{end}", self.y)));
                value.unwrap_or(f64::NAN)
            };
            values.push(number(""));
            spread.push((number("_low"), number("_high")));
        }
        Layer::new(series, Marks::Bars { values, spread, base: self.bars_from })
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

/// Returns the points, which are sorted by x, that have a lower y than all points of no greater x.
fn front(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut lowest = f64::INFINITY;
    points.retain(|point| {
        let is_lower = point.1 < lowest;
        lowest = lowest.min(point.1);
        is_lower
    });
    points
}

#[cfg(test)]
mod tests {
    use super::front;

    #[test]
    fn the_front_has_what_nothing_faster_beats() {
        let points = vec![(1.0, 1.5), (1.0, 2.0), (2.0, 2.0), (3.0, 0.5), (4.0, 0.5), (5.0, 0.4)];
        assert_eq!(front(points), [(1.0, 1.5), (3.0, 0.5), (5.0, 0.4)]);
    }
}
