//! Queries of committed CSV files, for tests of pages.
//!
//! ```text
//! FILE | COLUMN=TEXT, … | AGGREGATE COLUMN | FORMAT                              one value
//! FILE | COLUMN=TEXT, … | ROWS × COLUMNS | AGGREGATE COLUMN [(COLUMN)] | FORMAT  a table; the column in parentheses is
//!                                                                               shown behind each value
//! ```
//! `[LOW, HIGH]` after the column shows an interval behind each value. With the format `text`, all rows have one text in the
//! column, which is shown as it is, and the column in parentheses likewise. An aggregate is `only` (all rows agree), `min`, `max`, `median` or `count`; a format is a number of decimals, with
//! `below` behind it for percent below one, `above` for percent above one, `percent` for a fraction. Conditions compare
//! whole cells, a comma in which is written `\,`; `TEXT or TEXT` accepts both, `COLUMN!=TEXT` excludes, `*` stands for no
//! condition. ROWS may be several columns, with ` + ` between. A file with `/*/` in
//! its path stands for all such files, one after the other: results by processor.

use super::top;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

/// Stands for a comma within a cell while conditions are divided.
const COMMA: &str = "\u{0}";

/// A row by column names.
pub type Row = BTreeMap<String, String>;

/// The paths of a committed CSV; with `/*/` in it, one in every folder in which it is, by name.
fn paths(file: &str) -> Vec<PathBuf> {
    let results = top().join("results");
    let Some((before, after)) = file.split_once("/*/") else { return vec![results.join(file)] };
    let folders =
        fs::read_dir(results.join(before)).unwrap_or_else(|error| panic!("{file}: {error}"));
    let mut paths: Vec<PathBuf> = folders
        .map(|folder| folder.unwrap().path().join(after))
        .collect();
    paths.retain(|path| path.is_file());
    paths.sort();
    paths
}

/// The rows of a committed CSV that meet all conditions; at least one.
pub fn rows(file: &str, conditions: &str) -> Vec<Row> {
    let mut rows = Vec::new();
    for path in paths(file) {
        let mut reader =
            csv::Reader::from_path(&path).unwrap_or_else(|error| panic!("{file}: {error}"));
        rows.extend(reader.deserialize::<Row>().map(Result::unwrap));
    }
    let meets = |row: &Row| {
        conditions == "*"
            || conditions
                .replace("\\, ", COMMA)
                .split(", ")
                .all(|condition| {
                    let condition = condition.replace(COMMA, ", ");
                    let (column, text, wanted) = match condition.split_once("!=") {
                        Some((column, text)) => (column, text, false),
                        None => condition
                            .split_once('=')
                            .map(|(column, text)| (column, text, true))
                            .expect(conditions),
                    };
                    let cell = row
                        .get(column)
                        .unwrap_or_else(|| panic!("{file} has no column {column}"));
                    text.split(" or ").any(|text| cell == text) == wanted
                })
    };
    rows.retain(meets);
    assert!(!rows.is_empty(), "{file}: no row with {conditions}");
    rows
}

/// One number of the rows' `AGGREGATE COLUMN`; nothing if no row has one.
fn aggregate(rows: &[&Row], what: &str) -> Option<f64> {
    let (how, column) = what.split_once(' ').expect(what);
    if how == "count" {
        return Some(rows.len() as f64);
    }
    let cell = |row: &&Row| {
        row.get(column)
            .unwrap_or_else(|| panic!("no column {column}"))
            .parse()
            .ok()
    };
    let mut values: Vec<f64> = rows.iter().filter_map(cell).collect();
    values.sort_by(f64::total_cmp);
    let first = *values.first()?;
    let last = *values.last()?;
    match how {
        "only" => {
            assert!(first == last, "{column} is from {first} to {last}, not one value");
            Some(first)
        }
        "min" => Some(first),
        "max" => Some(last),
        "median" => Some(0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2])),
        _ => panic!("{how}: accepted: only, min, max, median, count"),
    }
}

/// Writes a number as a format says.
fn write(value: f64, format: &str) -> String {
    let (digits, unit) = format.split_once(' ').unwrap_or((format, ""));
    let value = match unit {
        "" => value,
        "below" => 100.0 * (1.0 - value),
        "above" => 100.0 * (value - 1.0),
        "percent" => 100.0 * value,
        _ => panic!("{unit}: accepted: below, above, percent"),
    };
    format!("{value:.*}", digits.parse().expect(format))
}

/// The different values of some columns, in their order in the file.
fn distinct(rows: &[Row], columns: &[&str]) -> Vec<Vec<String>> {
    let mut found: Vec<Vec<String>> = Vec::new();
    for row in rows {
        let cells: Vec<String> = columns
            .iter()
            .map(|column| row[*column].clone())
            .collect();
        if !found.contains(&cells) {
            found.push(cells);
        }
    }
    found
}

/// The one value of a column, a number in the format and a text as it is; nothing if all cells are empty.
fn beside_of(rows: &[&Row], column: &str, format: &str) -> Option<String> {
    let texts: BTreeSet<&String> = rows
        .iter()
        .map(|row| &row[column])
        .filter(|text| !text.is_empty())
        .collect();
    let text = texts.first()?;
    match text.parse::<f64>() {
        Ok(_) if format != "text" => {
            aggregate(rows, &format!("only {column}")).map(|value| write(value, format))
        }
        _ => {
            assert!(texts.len() == 1, "{column} is not one text: {texts:?}");
            Some((*text).clone())
        }
    }
}

/// What `AGGREGATE COLUMN [LOW, HIGH] (COLUMN)` shows of some rows, in the format; empty if they have nothing.
fn show(rows: &[&Row], what: &str, format: &str) -> String {
    let one = |what: &str| {
        if format == "text" {
            let column = what
                .strip_prefix("only ")
                .expect("texts are not aggregated");
            let texts: BTreeSet<&String> = rows.iter().map(|row| &row[column]).collect();
            assert!(texts.len() <= 1, "{column} is not one text: {texts:?}");
            return texts
                .first()
                .filter(|text| !text.is_empty())
                .map(|text| (*text).clone());
        }
        aggregate(rows, what).map(|value| write(value, format))
    };
    let (what, beside) = match what.split_once(" (") {
        Some((what, beside)) => (what, beside_of(rows, beside.trim_end_matches(')'), format)),
        None => (what, None),
    };
    let (what, ends) = match what.split_once(" [") {
        Some((what, ends)) => (what, ends.trim_end_matches(']').split_once(", ")),
        None => (what, None),
    };
    let mut text = one(what).unwrap_or_default();
    if let Some((low, high)) = ends
        .and_then(|(low, high)| Some((one(&format!("min {low}"))?, one(&format!("max {high}"))?)))
    {
        text += &format!(" [{low}, {high}]");
    }
    match beside {
        Some(beside) => format!("{text} ({beside})"),
        None => text,
    }
}

/// A Markdown table of rows.
pub fn pivot(rows: &[Row], axes: &str, what: &str, format: &str) -> String {
    let (down, across) = axes.split_once(" × ").expect(axes);
    let down: Vec<&str> = down.split(" + ").collect();
    let escape = |text: &str| text.replace('|', "\\|");
    let columns = distinct(rows, &[across]).concat();
    let header: Vec<String> = down
        .iter()
        .map(|column| column.replace('_', " "))
        .chain(columns.clone())
        .collect();
    let mut lines = vec![format!(
        "| {} |",
        header
            .iter()
            .map(|cell| escape(cell))
            .collect::<Vec<_>>()
            .join(" | ")
    )];
    lines.push(format!("|{}", "---|".repeat(header.len())));
    // Lines that begin alike stand together.
    let groups = distinct(rows, &down[..1]);
    let mut names_of_lines = distinct(rows, &down);
    names_of_lines.sort_by_key(|names| {
        groups
            .iter()
            .position(|group| group[0] == names[0])
    });
    for names in names_of_lines {
        let of_line: Vec<&Row> = rows
            .iter()
            .filter(|row| {
                down.iter()
                    .zip(&names)
                    .all(|(column, name)| row[*column] == *name)
            })
            .collect();
        let cell = |column: &String| {
            let here: Vec<&Row> = of_line
                .iter()
                .copied()
                .filter(|row| row[across] == *column)
                .collect();
            show(&here, what, format)
        };
        let kind = of_line
            .iter()
            .find_map(|row| row.get("scene_kind"));
        let note = match kind {
            Some(kind) if down == ["scene"] && kind != "file" => format!(" ({kind})"),
            _ => String::new(),
        };
        let names: Vec<String> = down
            .iter()
            .zip(&names)
            .map(|(column, name)| escape(&heading(column, name)))
            .collect();
        let cells: Vec<String> = columns
            .iter()
            .map(|column| escape(&cell(column)))
            .collect();
        lines.push(format!("| {}{note} | {} |", names.join(" | "), cells.join(" | ")));
    }
    lines.join("\n")
}

/// The name of a line: seconds with two digits, everything else as it is.
fn heading(column: &str, name: &str) -> String {
    match name.parse::<f64>() {
        Ok(seconds) if column.ends_with("_seconds") && seconds >= 0.01 => format!("{seconds:.2}"),
        Ok(seconds) if column.ends_with("_seconds") => format!("{seconds:.4}"),
        _ => name.into(),
    }
}

/// The value of a query of four parts.
pub fn value(query: &str) -> String {
    let [file, conditions, what, format] = query.split(" | ").collect::<Vec<_>>()[..] else {
        panic!("{query}: expected FILE | CONDITIONS | AGGREGATE COLUMN | FORMAT");
    };
    let rows = rows(file, conditions);
    let text = show(&rows.iter().collect::<Vec<_>>(), what, format);
    assert!(!text.is_empty(), "{query}: no value");
    text
}
