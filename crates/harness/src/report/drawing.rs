//! Figures of tables: named rows with a dot per value, or lines through values.

use super::config::{Series, accept};
use super::data::{distinct, grouped};
use super::prelude::*;
use super::query::{self, Conditions, QueryError, Row, cell, number_in};
use bvh_config::{Nested, OutOfRange};
use serde::Deserialize;
use std::collections::BTreeMap;

bvh_config::config! { serde;
    /// A figure of the table.
    pub struct Drawing {
        /// Explains the figure.
        caption: String;
        /// Conditions on the rows that are drawn.
        #[serde(skip_serializing_if = "String::is_empty")]
        select: String;
        /// The shape of the marks.
        marks: Shape;
        /// Columns whose values are the panels; by default there is one panel.
        panels: Vec<String>;
        /// Panels per row.
        per_row: usize = 2, in 1..=2;
        /// The column along the horizontal axis; values for rows.
        x: String;
        /// The column along the vertical axis, or several with `, ` between them: of names for
        /// rows, and with a panel each for lines.
        y: String;
        /// The columns of the ends of the intervals that values have, those of the last column
        /// `y`; by default that of the values with `_low` and `_high`, if the table has those.
        #[serde(skip_serializing_if = "Option::is_none")]
        ends: Option<[String; 2]>;
        /// For rows: a column of further values, such as the paper's, which have a dot beside.
        #[serde(skip_serializing_if = "String::is_empty")]
        beside: String;
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
        /// Names in words for scenes, rows and series, by what they are called in the table; for
        /// lines also labels of the vertical axis by the column `y`, in place of `y_label`.
        names: BTreeMap<String, String>;
        /// The value of a line across all rows, such as 1 for ratios, or at this height.
        #[serde(skip_serializing_if = "Option::is_none")]
        line_at: Option<f64>, in 0.0..=1e300;
    }
    check Self::check_conditions;
}

/// The shape of marks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Named rows with a dot per value.
    #[default]
    Rows,
    /// Points alone.
    Points,
    /// Points with a line through them.
    Lines,
    /// Staircases: each value holds until the next.
    Steps,
}

/// A value and its interval.
#[derive(Clone, Copy)]
struct Point {
    x: f64,
    y: f64,
    ends: Option<(f64, f64)>,
}

impl Drawing {
    fn check_conditions(&self) -> Result<(), OutOfRange> {
        accept("select", Conditions::parse(&self.select))
    }

    /// Adds the figure of a report's first table, in place of the report's own of this name.
    pub(super) fn draw(&self, rows: &Rows, output: &mut Output) -> Result<(), Error> {
        let table = output.table()?;
        let table = self.selected(table).map_err(|error| Error::Query {
            path: rows.folder.clone(),
            message: format!("figure: {error}"),
        })?;
        let name = output.csv[0].0.clone();
        output.figures.retain(|(own, _)| *own != name);
        output.add_figure(name, &self.caption, self.per_row, self.panels(rows, &table));
        Ok(())
    }

    fn selected(&self, table: Vec<Row>) -> Result<Vec<Row>, QueryError> {
        let of_lists = self.panels.iter().chain(&self.series).chain(self.ends.iter().flatten());
        let columns = self.y.split(", ").chain([self.x.as_str(), &self.beside]);
        let columns = columns.chain(of_lists.map(String::as_str));
        if let Some(row) = table.first() {
            let mut named = columns.filter(|name| !name.is_empty());
            named.try_for_each(|name| cell(row, name).map(drop))?;
        }
        match query::select(table, &self.select) {
            // A figure may be of rows that these runs lack, such as those of quick variants.
            Err(QueryError::NoRow(_)) => Ok(vec![]),
            selected => selected,
        }
    }

    /// Returns one panel for all rows that agree in the columns `panels`.
    pub(super) fn panels(&self, rows: &Rows, table: &[Row]) -> Vec<Panel> {
        let mut panels = Vec::new();
        for (title, table) in grouped(table, |row| self.title(rows, row)) {
            if self.marks == Shape::Rows {
                panels.push(self.rows(rows, title, &table));
            } else {
                panels.extend(self.y.split(", ").map(|y| self.lines(&title, y, &table)));
            }
        }
        if self.same_axes {
            figures::share_axes(&mut panels);
        }
        panels
    }

    fn title(&self, rows: &Rows, row: &Row) -> String {
        let name =
            |column: &String| self.shown(rows, column, row.get(column).map_or("", |text| text));
        self.panels.iter().map(name).collect::<Vec<_>>().join(": ")
    }

    fn lines(&self, title: &str, y: &str, table: &[&Row]) -> Panel {
        let mut layers = Vec::new();
        for (series, table) in grouped(table.iter().copied(), |row| self.series_of(row)) {
            layers.extend(curve(&series, &self.points(y, &table), self.marks));
        }
        layers.extend(self.line_at.map(|at| Layer::new("", Marks::HLine(at))));
        let unit = if self.percent_y { Unit::Percent } else { Unit::Number };
        let label = self.names.get(y).unwrap_or(&self.y_label);
        let y = axis(label, self.log_y).unit(unit);
        panel(title, axis(&self.x_label, self.log_x), y, layers)
    }

    /// Draws a row per name, in which the series are below each other.
    fn rows(&self, rows: &Rows, title: String, table: &[&Row]) -> Panel {
        let columns: Vec<String> = self.y.split(", ").map(str::to_owned).collect();
        let name = |row: &Row| self.shown(rows, &self.y, &texts_in(row, &columns));
        let names = distinct(table.iter().map(|row| name(row)));
        let by_series = grouped(table.iter().copied(), |row| self.series_of(row));
        let count = by_series.len() as f64;
        let mut layers = Vec::new();
        let mut beside: BTreeMap<usize, Vec<(f64, f64)>> = BTreeMap::new();
        for (number, (series, table)) in (0..).zip(by_series) {
            let mut points = Vec::new();
            let mut spans = Vec::new();
            for row in table {
                let Some(value) = number_in(row, &self.x) else { continue };
                let place = names.iter().position(|known| *known == name(row)).unwrap_or_default();
                let height = place as f64 + 0.8 * ((f64::from(number) + 0.5) / count - 0.5);
                points.push((value, height));
                let ends = self.ends_in(row, &self.x);
                spans.extend(ends.map(|(low, high)| [(low, height), (high, height)]));
                let value = number_in(row, &self.beside);
                beside.entry(place).or_default().extend(value.map(|value| (value, height)));
            }
            layers.push(Layer::new(&series, Marks::Spans(spans)));
            layers.push(Layer::new(series, Marks::Points(points)));
        }
        let one_if_equal = |(place, points): (usize, Vec<(f64, f64)>)| {
            let values = distinct(points.iter().map(|point| point.0));
            if let [value] = values[..] { vec![(value, place as f64)] } else { points }
        };
        let beside: Vec<(f64, f64)> = beside.into_iter().flat_map(one_if_equal).collect();
        if !beside.is_empty() {
            layers.push(Layer::new("paper", Marks::Points(beside)));
        }
        layers.extend(self.line_at.map(|at| Layer::new("", Marks::VLine(at))));
        let y = Axis::rows(names, (10.0 * count + 6.0).max(24.0));
        panel(title, axis(&self.x_label, self.log_x), y, layers)
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
        let name = texts_in(row, &self.series);
        self.names.get(&name).cloned().unwrap_or(name)
    }

    fn shown(&self, rows: &Rows, column: &str, text: &str) -> String {
        let own = self.names.get(text).cloned();
        let is_scene = ["scene", "mesh"].contains(&column);
        own.unwrap_or_else(|| if is_scene { rows.shown(text) } else { text.into() })
    }

    fn points(&self, column: &str, table: &[&Row]) -> Vec<Point> {
        let point = |row: &&Row| {
            let (x, y) = (number_in(row, &self.x)?, number_in(row, column)?);
            Some(Point { x, y, ends: self.ends_in(row, column) })
        };
        let mut points: Vec<Point> = table.iter().filter_map(point).collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        points
    }

    fn ends_in(&self, row: &Row, column: &str) -> Option<(f64, f64)> {
        let end = |end: &str| number_in(row, &format!("{column}{end}"));
        let is_last = self.y.split(", ").last() == Some(column);
        match &self.ends {
            Some(_) if self.marks != Shape::Rows && !is_last => None,
            Some([low, high]) => number_in(row, low).zip(number_in(row, high)),
            None => end("_low").zip(end("_high")),
        }
    }
}

/// Draws a line through points, x ascending, on the band between the ends of their intervals. A
/// single point, and every one of points alone, has a mark and a line from end to end.
fn curve(series: &str, points: &[Point], shape: Shape) -> Vec<Layer> {
    let path = match shape {
        Shape::Steps => stairs(points),
        _ => points.to_vec(),
    };
    let places = |points: &[Point]| points.iter().map(|at| (at.x, at.y)).collect();
    let ends = path.iter().filter_map(|at| at.ends.map(|(low, high)| (at.x, low, high)));
    let mut marks = vec![if shape == Shape::Points || points.len() == 1 {
        Marks::Spans(ends.map(|(x, low, high)| [(x, low), (x, high)]).collect())
    } else {
        Marks::Band(ends.collect())
    }];
    if shape != Shape::Points {
        marks.push(Marks::Line(places(&path)));
    }
    if shape != Shape::Steps || points.len() == 1 {
        marks.push(Marks::Points(places(points)));
    }
    marks.into_iter().map(|marks| Layer::new(series, marks)).collect()
}

/// Returns the staircase that holds each value until the next x.
fn stairs(points: &[Point]) -> Vec<Point> {
    let corners = points.windows(2).flat_map(|ends| [ends[0], Point { x: ends[1].x, ..ends[0] }]);
    corners.chain(points.last().copied()).collect()
}

/// Returns the texts of some columns, without those that say that something is missing.
fn texts_in(row: &Row, columns: &[String]) -> String {
    let texts = columns.iter().filter_map(|column| row.get(column));
    texts.filter(|text| *text != "none").cloned().collect::<Vec<_>>().join(", ")
}

fn axis(label: &str, is_log: bool) -> Axis {
    if is_log { Axis::log(label) } else { Axis::linear(label) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::csv_file::parse;
    use std::path::Path;

    const TABLE: &str = "scene,method,cost,cost_low,cost_high,base_cost,least,paper,seconds
a,x,2,1,3,4,0.5,2.5,1
a,y,4,,,4,,,2
b,x,8,7,9,16,6,,1
";

    /// Returns the panels of a figure of the table.
    fn panels(config: &str) -> Vec<Panel> {
        let config: Drawing = toml::from_str(config).unwrap();
        let table = config.selected(parse(TABLE.as_bytes(), Path::new("table")).unwrap());
        config.panels(&Rows::default(), &table.unwrap())
    }

    /// Returns the title, the label and the marks of each panel, without layers that have none.
    fn drawn(config: &str) -> Vec<String> {
        let layer = |layer: &Layer| format!("; {} {:?}", layer.name, layer.marks);
        let in_words = |panel: Panel| {
            let layers = panel.layers.iter().map(layer).filter(|text| !text.ends_with("([])"));
            format!("{} {}{}", panel.title, panel.y.label, layers.collect::<String>())
        };
        panels(config).into_iter().map(in_words).collect()
    }

    #[test]
    fn a_figure_has_the_panels_series_and_intervals_that_its_keys_say() {
        for (config, expected) in [
            (
                "x = 'cost'\ny = 'scene'\nseries = ['method']\nselect = 'scene=a'\nbeside = 'paper'",
                &[" ; x Spans([[(1.0, -0.2), (3.0, -0.2)]]); x Points([(2.0, -0.2)]); \
                   y Points([(4.0, 0.2)]); paper Points([(2.5, 0.0)])"][..],
            ),
            (
                "x = 'cost'\ny = 'scene, method'\nselect = 'scene=b'\nends = ['least', 'cost']\nline_at = 1.0",
                &[" ;  Spans([[(6.0, 0.0), (8.0, 0.0)]]);  Points([(8.0, 0.0)]);  VLine(1.0)"],
            ),
            (
                "marks = 'lines'\nx = 'seconds'\ny = 'cost'\nselect = 'scene=a'\ny_label = 'c'",
                &[" c;  Band([(1.0, 1.0, 3.0)]);  Line([(1.0, 2.0), (2.0, 4.0)]);  \
                   Points([(1.0, 2.0), (2.0, 4.0)])"],
            ),
            (
                "marks = 'steps'\nx = 'seconds'\ny = 'cost'\nselect = 'scene=a'\nends = ['paper', 'paper']",
                &[" ;  Band([(1.0, 2.5, 2.5), (2.0, 2.5, 2.5)]);  \
                   Line([(1.0, 2.0), (2.0, 2.0), (2.0, 4.0)])"],
            ),
            (
                "marks = 'points'\nx = 'seconds'\ny = 'cost'\nselect = 'method=x'",
                &[" ;  Spans([[(1.0, 1.0), (1.0, 3.0)], [(1.0, 7.0), (1.0, 9.0)]]);  \
                   Points([(1.0, 2.0), (1.0, 8.0)])"],
            ),
            // Ends belong to the last column, also where its name ends in that of another.
            (
                "marks = 'points'\nx = 'seconds'\ny = 'cost, base_cost'\nends = ['least', 'cost']\n\
                 select = 'scene=b'\ny_label = 'c'\nnames = { base_cost = 'greedy' }",
                &[
                    " c;  Points([(1.0, 8.0)])",
                    " greedy;  Spans([[(1.0, 6.0), (1.0, 8.0)]]);  Points([(1.0, 16.0)])",
                ],
            ),
            (
                "marks = 'points'\nx = 'seconds'\ny = 'base_cost'\npanels = ['scene']",
                &["a ;  Points([(1.0, 4.0), (2.0, 4.0)])", "b ;  Points([(1.0, 16.0)])"],
            ),
            (
                "marks = 'points'\nx = 'cost'\ny = 'base_cost'\nselect = 'seconds=max'",
                &[" ;  Points([(4.0, 4.0)])"],
            ),
            ("marks = 'points'\nx = 'cost'\ny = 'base_cost'\nselect = 'scene=c'", &[]),
        ] {
            assert_eq!(drawn(config), expected, "{config}");
        }
    }

    #[test]
    fn panels_have_the_same_axes_if_asked() {
        let common = "marks = 'points'\nx = 'seconds'\npanels = ['scene']\n";
        let axes = |config: &str| -> Vec<_> {
            let panels = panels(&format!("{common}{config}")).into_iter();
            panels.map(|panel| (panel.x.range, panel.y.range)).collect()
        };
        let shared = axes("y = 'cost'\nsame_axes = true");
        let (low, high) = shared[0].1.unwrap();
        assert!(shared.len() == 2 && shared[0] == shared[1] && low < 2.0 && high > 8.0);
        assert_eq!(axes("y = 'cost'"), [(None, None); 2]);
    }
}
