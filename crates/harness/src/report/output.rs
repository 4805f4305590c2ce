//! The output of a report: CSV files, figures, comparisons with the paper, and text for the
//! terminal.

use super::colours::hue;
use super::paper::PaperRow;
use super::query::{Row, cell};
use crate::Error;
use crate::rows::csv_file::{bytes_of, parse, to_bytes};
use comfy_table::{Table, presets};
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
    /// The tables, each under a line that explains it.
    pub tables: Vec<(String, Table)>,
}

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
    pub fn add_csv(
        &mut self,
        name: impl Into<String>,
        rows: &[impl Serialize],
    ) -> Result<(), Error> {
        let name = name.into();
        let bytes = to_bytes(rows, Path::new(&name))?;
        self.csv.push((name, bytes));
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

    /// Adds a table of some columns of a CSV file's rows, numbers with four digits. `columns` are
    /// their names with blanks between them.
    pub fn show(
        &mut self,
        explanation: &str,
        rows: &[impl Serialize],
        columns: &str,
    ) -> Result<(), Error> {
        let bytes = to_bytes(rows, Path::new("table"))?;
        let columns: Vec<&str> = columns.split(' ').collect();
        self.show_csv(explanation, &bytes, &columns)
    }

    /// Adds a table of some columns of a CSV file.
    pub fn show_csv(
        &mut self,
        explanation: &str,
        bytes: &[u8],
        columns: &[impl AsRef<str>],
    ) -> Result<(), Error> {
        let path = Path::new("table");
        let columns: Vec<&str> = columns.iter().map(AsRef::as_ref).collect();
        let mut table = Table::new();
        table.load_preset(presets::UTF8_FULL_CONDENSED).set_header(&columns);
        for row in parse::<Row>(bytes, path)? {
            let cells =
                columns.iter().map(|column| cell(&row, column).map(|text| four_digits(text)));
            let cells: Vec<String> = cells
                .collect::<Result<_, _>>()
                .map_err(|error| Error::Query { path: path.into(), message: error.to_string() })?;
            table.add_row(cells);
        }
        self.tables.push((explanation.into(), table));
        Ok(())
    }

    /// Returns heading and tables for the terminal, separated by empty lines.
    pub fn text(&self) -> String {
        let table = |(explanation, table): &(String, Table)| format!("{explanation}\n{table}\n");
        let tables: String = self.tables.iter().map(table).collect();
        format!("{}\n\n{}\n\n", self.heading, tables.trim_end())
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
    fn a_table_shows_columns_by_name_and_rejects_those_that_its_rows_lack() {
        let mut output = Output::default();
        output.show_csv("All:", b"scene,cost\ns,1.23456\n", &["cost", "scene"]).unwrap();
        assert!(output.text().contains("│ 1.235 ┆ s     │"), "{}", output.text());
        let error = output.show_csv("All:", b"scene\ns\n", &["cost"]).unwrap_err().to_string();
        assert!(error.contains("no column \"cost\"; accepted: scene"), "{error}");
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
