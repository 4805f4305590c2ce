//! Numbers and tables of pages, from queries of committed CSV files in the language of
//! [`harness::report::query`].
//!
//! ```text
//! FILE | CONDITIONS | MEASURE                               one value
//! FILE | CONDITIONS | ROWS × COLUMNS | SHOWN | DECIMALS     a table
//!
//! MEASURE  over CONDITIONS by COLUMNS           of one value: each row's first number over the
//!                                               least of other rows that agree in the columns
//! SHOWN    MEASURE [LOW, HIGH] (COLUMN)         an interval and a further column, both optional
//! ```

#![allow(dead_code)] // numbers and tables use a part each

use super::support::top;
use harness::report::query::{self, Row, grouped, number_in};
use harness::report::query_measure::Measure;
use std::collections::BTreeSet;

/// The rows of a committed CSV that meet all conditions; at least one.
fn rows(file: &str, conditions: &str) -> Vec<Row> {
    let rows = harness::rows::read(&top().join("results").join(file));
    let rows = rows.unwrap_or_else(|error| panic!("{file}: {error}"));
    query::select(rows, conditions).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// The value of a query of three parts.
pub fn value(query: &str) -> f64 {
    let parts: Vec<&str> = query.split(" | ").collect();
    let [file, conditions, measure] = parts[..] else {
        panic!("{query}: expected FILE | CONDITIONS | MEASURE")
    };
    let mut rows = rows(file, conditions);
    let measure = match measure.split_once(" over ") {
        Some((measure, others)) => {
            divide(&mut rows, measure, file, others);
            measure
        }
        None => measure,
    };
    let rows: Vec<&Row> = rows.iter().collect();
    let value = Measure::parse(measure).and_then(|measure| measure.of_rows(&rows));
    let value = value.unwrap_or_else(|error| panic!("{query}: {error}"));
    value.unwrap_or_else(|| panic!("{query}: no value"))
}

/// The table of a query of five parts.
pub fn table(query: &str) -> String {
    let parts: Vec<&str> = query.split(" | ").collect();
    let [file, conditions, axes, measure, decimals] = parts[..] else {
        panic!("{query}: expected FILE | CONDITIONS | ROWS × COLUMNS | SHOWN | DECIMALS")
    };
    let decimals = decimals.parse().unwrap();
    format!("\n{}\n", pivot(&rows(file, conditions), axes, measure, decimals))
}

/// Divides the number of each row by the least one among other rows of the file, `CONDITIONS by
/// COLUMNS`, that agree in the columns.
fn divide(rows: &mut [Row], measure: &str, file: &str, others: &str) {
    let (conditions, columns) = others
        .rsplit_once(" by ")
        .unwrap_or_else(|| panic!("over {others}: expected over CONDITIONS by COLUMNS"));
    let columns: Vec<&str> = columns.split(" + ").collect();
    let column =
        measure.split(' ').nth(1).unwrap_or_else(|| panic!("{measure}: expected AGGREGATE COLUMN"));
    divide_by_least(rows, column, &self::rows(file, conditions), &columns);
}

fn divide_by_least(rows: &mut [Row], column: &str, others: &[Row], columns: &[&str]) {
    let others = grouped(others, columns).unwrap();
    for row in rows {
        let names: Vec<String> = columns.iter().map(|name| row[*name].clone()).collect();
        let numbers = others[&names].iter().filter_map(|other| number_in(other, column));
        let least = numbers.reduce(f64::min).expect("a number to divide by");
        if let Some(value) = number_in(row, column) {
            row.insert(column.into(), (value / least).to_string());
        }
    }
}

/// Returns one value of `AGGREGATE COLUMN`: a number with so many decimals, or the text in which all
/// rows agree.
fn one(rows: &[&Row], measure: &str, decimals: usize) -> Option<String> {
    if let Some(value) = Measure::parse(measure).unwrap().of_rows(rows).unwrap() {
        return Some(format!("{value:.decimals$}"));
    }
    let column = measure.strip_prefix("only ")?;
    let texts: BTreeSet<&String> = rows.iter().filter_map(|row| row.get(column)).collect();
    let mut texts = texts.into_iter().filter(|text| !text.is_empty());
    let text = texts.next().cloned();
    assert_eq!(texts.next(), None, "{column} has several values");
    text
}

/// Returns the text of a whole measure over some rows; empty if they have no value.
fn show(rows: &[&Row], measure: &str, decimals: usize) -> String {
    let (measure, beside) = measure.split_once(" (").unwrap_or((measure, ""));
    let (measure, ends) = measure.split_once(" [").unwrap_or((measure, ""));
    let mut text = one(rows, measure, decimals).unwrap_or_default();
    if let Some((low, high)) = ends.trim_end_matches(']').split_once(", ") {
        let low = one(rows, &format!("min {low}"), decimals);
        let high = one(rows, &format!("max {high}"), decimals);
        if let Some((low, high)) = low.zip(high) {
            text += &format!(" [{low}, {high}]");
        }
    }
    if let Some(column) = beside.strip_suffix(')')
        && let Some(beside) = one(rows, &format!("only {column}"), decimals)
    {
        text += &format!(" ({beside})");
    }
    text
}

/// Returns a Markdown table of `ROWS × COLUMNS`; ROWS may be several columns, with ` + ` between.
fn pivot(rows: &[Row], axes: &str, measure: &str, decimals: usize) -> String {
    let (down, across) =
        axes.split_once(" × ").unwrap_or_else(|| panic!("{axes}: expected ROWS × COLUMNS"));
    let down: Vec<&str> = down.split(" + ").collect();
    let columns = grouped(rows, &[across]).unwrap().into_keys().collect::<Vec<_>>().concat();
    let mut header: Vec<String> =
        down.iter().map(|column| escape(&column.replace('_', " "))).collect();
    header.extend(columns.iter().map(|column| escape(column)));
    let mut lines = vec![format!("| {} |", header.join(" | "))];
    lines.push(format!("|{}", "---|".repeat(header.len())));
    // Names that begin alike follow each other.
    let by_first = grouped(rows, &down[..1]).unwrap().into_values();
    for (names, of_line) in by_first.flat_map(|rows| grouped(rows, &down).unwrap()) {
        let mut cells: Vec<String> =
            down.iter().zip(&names).map(|(column, name)| escape(&heading(column, name))).collect();
        // Readers must see which scenes are stand-ins wherever a table names them.
        if down == ["scene"] {
            cells[0] += &kind_note(&of_line);
        }
        let of_cells = grouped(of_line, &[across]).unwrap();
        for column in &columns {
            let here = of_cells.get(std::slice::from_ref(column)).map_or(&[][..], Vec::as_slice);
            cells.push(escape(&show(here, measure, decimals)));
        }
        lines.push(format!("| {} |", cells.join(" | ")));
    }
    lines.join("\n")
}

fn escape(text: &str) -> String {
    text.replace('|', "\\|")
}

/// Returns the scene's kind in parentheses, unless it is a file.
fn kind_note(rows: &[&Row]) -> String {
    let kind = rows.iter().find_map(|row| row.get("scene_kind"));
    kind.filter(|kind| *kind != "file").map_or_else(String::new, |kind| format!(" ({kind})"))
}

/// Returns the name of a line: seconds with two digits, everything else as it is.
fn heading(column: &str, name: &str) -> String {
    match name.parse::<f64>() {
        Ok(seconds) if column.ends_with("_seconds") && seconds >= 0.01 => format!("{seconds:.2}"),
        Ok(seconds) if column.ends_with("_seconds") => format!("{seconds:.4}"),
        _ => name.into(),
    }
}

#[test]
fn values_are_rounded_and_divided_and_a_table_has_empty_cells_where_no_row_is() {
    let text = "scene,method,cost,rays\na,\"x, y\",2,4\na,z,3,4\nb,z,5,\n";
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let mut rows: Vec<Row> = reader.deserialize().map(Result::unwrap).collect();
    let all: Vec<&Row> = rows.iter().collect();
    let shown = |measure: &str, decimals| show(&all, measure, decimals);
    assert_eq!(shown("median cost", 1), "3.0");
    assert_eq!(shown("max cost [cost, cost]", 0), "5 [2, 5]");
    assert_eq!(shown("min cost / rays (rays)", 1), "0.5 (4.0)");
    let table = pivot(&rows, "scene × method", "only cost", 0);
    assert_eq!(table, "| scene | x, y | z |\n|---|---|---|\n| a | 2 | 3 |\n| b |  | 5 |");
    let others = rows.clone();
    divide_by_least(&mut rows, "cost", &others, &["scene"]);
    assert_eq!(rows.iter().map(|row| &row["cost"]).collect::<Vec<_>>(), ["1", "1.5", "1"]);
}
