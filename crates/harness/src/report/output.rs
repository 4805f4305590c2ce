//! The output of a report: CSV files, figures, comparisons with the paper, and text for the
//! terminal.

use super::colours::hue;
use super::paper::PaperRow;
use super::query::Row;
use crate::Error;
use crate::rows::csv_file::{bytes_of, parse, to_bytes};
use comfy_table::{ColumnConstraint, ContentArrangement, Table, Width, presets};
use figures::{Axis, Figure, Layer, Panel};
use serde::Serialize;
use std::path::Path;

/// The output of a report.
#[derive(Clone, Debug, Default)]
pub struct Output {
    /// Source and title of the report: the first line of its text, and the title of its figures.
    pub heading: String,
    /// CSV files: name without extension, and bytes. Names that begin with `timing` hold seconds.
    pub csv: Vec<(String, Vec<u8>)>,
    /// Figures: name without extension, and what they show.
    pub figures: Vec<(String, Figure)>,
    /// Comparisons with the paper.
    pub paper: Vec<PaperRow>,
    /// Tables that are only shown: title, and the bytes of a CSV file.
    pub unwritten: Vec<(String, Vec<u8>)>,
}

/// The greatest number of rows of a CSV file that are shown: nobody reads more.
const MOST_SHOWN: usize = 100;

/// The greatest width of a table, in characters.
const WIDTH: u16 = 100;

/// Columns of sentences, which would not fit beside others.
const SENTENCES: [&str; 2] = ["rule", "reason"];

impl Output {
    /// Makes the empty output of a report with this title. The source may be empty.
    pub fn new(source: &str, title: &str) -> Self {
        let heading =
            if source.is_empty() { title.to_owned() } else { format!("{source}: {title}") };
        Self { heading, ..Self::default() }
    }

    /// Adds the heading, and the source and the reason to comparisons with the paper.
    #[must_use]
    pub fn headed(mut self, source: &str, title: &str, reason: &str) -> Self {
        self.heading = Self::new(source, title).heading;
        for (_, figure) in &mut self.figures {
            figure.title.clone_from(&self.heading);
        }
        for row in &mut self.paper {
            row.source = source.into();
            if row.reason.is_empty() {
                row.reason = reason.into();
            }
        }
        self
    }

    /// Adds the CSV file `name`, without its extension.
    pub fn add_csv(&mut self, name: &str, rows: &[impl Serialize]) -> Result<(), Error> {
        self.csv.push((name.into(), to_bytes(rows, Path::new(name))?));
        Ok(())
    }

    /// Returns the rows of the first CSV file.
    pub fn table(&self) -> Result<Vec<Row>, Error> {
        let bytes = self.csv.first().map_or(&[][..], |(_, bytes)| bytes);
        parse(bytes, Path::new("table"))
    }

    /// Adds a figure of these panels.
    pub fn add_figure(
        &mut self,
        name: impl Into<String>,
        caption: impl Into<String>,
        columns: usize,
        panels: Vec<Panel>,
    ) {
        let title = self.heading.clone();
        let series = panels.iter().flat_map(|panel| &panel.layers).filter_map(Layer::series);
        let hues = series.filter_map(|name| Some((name.to_owned(), hue(name)?))).collect();
        self.figures
            .push((name.into(), Figure { title, caption: caption.into(), columns, panels, hues }));
    }

    /// Returns the tables to show, each with its title, without sentences and with numbers of four
    /// digits. A CSV file of more than 100 rows has their number in its title instead of its rows.
    pub fn tables(&self) -> Result<Vec<(String, Vec<Row>)>, Error> {
        let mut tables: Vec<(String, Vec<Row>)> = Vec::new();
        for (name, bytes) in &self.csv {
            let title = format!("{name}.csv");
            let rows = parse(bytes, Path::new(&title))?;
            match rows.len() {
                0 => {}
                1..=MOST_SHOWN => tables.push((title, rows)),
                count => tables.push((format!("{title}: {count} rows"), vec![])),
            }
        }
        // No file has the other rows of these.
        for (title, bytes) in &self.unwritten {
            tables.push((title.clone(), parse(bytes, Path::new(title))?));
        }
        for row in tables.iter_mut().flat_map(|(_, rows)| rows) {
            row.retain(|column, _| !SENTENCES.contains(&column.as_str()));
            row.values_mut().for_each(|text| *text = four_digits(text));
        }
        for (_, rows) in &mut tables {
            let is_empty = |name: &str| rows.iter().all(|row| row[name].is_empty());
            let empty: Vec<String> = rows
                .first()
                .into_iter()
                .flat_map(Row::keys)
                .filter(|name| is_empty(name))
                .cloned()
                .collect();
            rows.iter_mut().for_each(|row| row.retain(|name, _| !empty.contains(name)));
        }
        Ok(tables)
    }

    /// Returns heading and tables for the terminal, separated by empty lines.
    pub fn text(&self) -> Result<String, Error> {
        let mut text = format!("{}\n\n", self.heading);
        for (title, rows) in self.tables()? {
            let Some(first) = rows.first() else {
                text += &format!("{title}\n\n");
                continue;
            };
            let mut table = Table::new();
            table.load_preset(presets::UTF8_BORDERS_ONLY).set_width(WIDTH);
            table.set_content_arrangement(ContentArrangement::Dynamic);
            table.set_header(first.keys().map(|name| name.replace('_', " ")));
            table.add_rows(rows.iter().map(Row::values));
            // Lines end between words.
            for (column, name) in table.column_iter_mut().zip(first.keys()) {
                let words = rows.iter().flat_map(|row| row[name].split(' ')).chain(name.split('_'));
                let widest = words.map(|word| word.chars().count()).max().unwrap_or_default();
                let width = Width::Fixed(widest as u16 + column.padding_width());
                column.set_constraint(ColumnConstraint::LowerBoundary(width));
            }
            text += &format!("{title}:\n{table}\n\n");
        }
        Ok(text)
    }
}

/// Returns the bytes of a CSV file with these rows, which have the same columns. Without rows there
/// is no header either.
pub fn table_bytes(rows: &[Row]) -> Result<Vec<u8>, Error> {
    let path = Path::new("table");
    let mut writer = csv::Writer::from_writer(Vec::new());
    let header = rows.first().map(|row| row.keys().collect::<Vec<_>>());
    for cells in header.into_iter().chain(rows.iter().map(|row| row.values().collect())) {
        writer.write_record(cells).map_err(Error::csv(path))?;
    }
    bytes_of(writer, path)
}

/// Rounds a number to four digits. Other texts and whole numbers stay unchanged.
fn four_digits(text: &str) -> String {
    // Counts and names stay as they are; only measured numbers are rounded.
    let number = if text.contains('.') { text.parse::<f64>().ok() } else { None };
    match number {
        None => text.into(),
        Some(0.0) => "0".into(),
        Some(number) if !(1e-4..1e6).contains(&number.abs()) => format!("{number:.3e}"),
        Some(number) => {
            let decimals = (3 - number.abs().log10().floor() as i32).max(0) as usize;
            format!("{number:.decimals$}")
        }
    }
}

/// Makes a panel.
pub fn panel(title: impl Into<String>, x: Axis, y: Axis, layers: Vec<Layer>) -> Panel {
    Panel { title: title.into(), x, y, layers }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_tables_are_shown_with_four_digits_and_their_names() {
        let short = b"scene,cost\ns,1.23456\n".to_vec();
        let long = format!("scene\n{}", "many\n".repeat(MOST_SHOWN + 1)).into_bytes();
        let csv = vec![("short".into(), short.clone()), ("long".into(), long.clone())];
        let text = Output { csv, ..Output::default() }.text().unwrap();
        assert!(text.contains("short.csv:\n") && text.contains("│ s       1.235 │"), "{text}");
        assert!(text.contains("long.csv: 101 rows\n") && !text.contains("many"), "{text}");
        // Nothing else has the rows that no file has.
        let unwritten = vec![("Title".into(), short), ("All".into(), long)];
        let text = Output { unwritten, ..Output::default() }.text().unwrap();
        assert!(text.contains("Title:\n") && text.contains("│ s       1.235 │"), "{text}");
        assert_eq!(text.matches("many").count(), MOST_SHOWN + 1, "{text}");
    }

    #[test]
    fn wide_tables_are_shown_within_their_width_without_columns_that_are_empty() {
        let names: Vec<String> = (0..9).map(|at| format!("cost_over_base_{at}")).collect();
        let bytes = format!("{},empty\n{},\n", names.join(","), ["1.5"; 9].join(","));
        let csv = vec![("wide".into(), bytes.into_bytes())];
        let text = Output { csv, ..Output::default() }.text().unwrap();
        let widest = text.lines().map(|line| line.chars().count()).max();
        assert!(widest <= Some(usize::from(WIDTH)) && text.contains("cost"), "{text}");
        assert!(!text.contains("empty") && !text.contains("cost over base 0"), "{text}");
    }

    #[test]
    fn numbers_are_shown_with_four_digits_and_whole_ones_whole() {
        let shown = ["1.23456", "0.0123456", "12345.6", "1.5e-9", "0.0", "123456", "best", "-1.0"]
            .map(four_digits);
        assert_eq!(
            shown,
            ["1.235", "0.01235", "12346", "1.500e-9", "0", "123456", "best", "-1.000"]
        );
    }
}
