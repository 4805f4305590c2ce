//! Queries of CSV files, in which pages and charts select, group and aggregate rows.
//!
//! ```text
//! CONDITIONS   COLUMN=TEXT, COLUMN!=TEXT or TEXT, …          `*` for all rows; a comma in a text is written `\,`
//! MEASURE      AGGREGATE COLUMN [LOW, HIGH] (COLUMN)         an interval and a further column, both optional
//!              AGGREGATE COLUMN / COLUMN                     the quotient of two columns, row by row
//! AGGREGATE    only (all rows agree), min, max, median, count
//! FORMAT       DECIMALS [below | above | percent]            percent below one, above one, or of a fraction
//!              text                                          cells as they are; all rows have the same one
//! ```

use crate::Error;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A row by column names.
pub type Row = BTreeMap<String, String>;

/// Reasons why a query has no answer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum QueryError {
    /// A part of the query that cannot be read.
    #[error("{found:?} is no {part}; accepted: {accepted}")]
    Malformed { part: &'static str, found: String, accepted: &'static str },
    /// A column that the file lacks.
    #[error("there is no column {column:?}; accepted: {accepted}")]
    Column { column: String, accepted: String },
    /// Rows that were to agree.
    #[error("{column} has several values, {values}; accepted: one")]
    Several { column: String, values: String },
    /// Conditions that no row meets.
    #[error("no row meets {0:?}")]
    NoRow(String),
}

/// Stands for a comma within a text while conditions are divided.
const COMMA: &str = "\u{0}";

/// Reads the rows of a CSV file.
pub fn read(path: &Path) -> Result<Vec<Row>, Error> {
    let mut reader = csv::Reader::from_path(path).map_err(Error::csv(path))?;
    let rows = reader.deserialize::<Row>();
    rows.collect::<Result<_, _>>()
        .map_err(Error::csv(path))
}

/// Returns the text of a cell.
fn cell<'r>(row: &'r Row, column: &str) -> Result<&'r String, QueryError> {
    row.get(column).ok_or_else(|| {
        let names: Vec<&str> = row.keys().map(String::as_str).collect();
        QueryError::Column { column: column.into(), accepted: names.join(", ") }
    })
}

/// A condition on one column.
struct Condition {
    column: String,
    texts: Vec<String>,
    /// Whether the cell is to be one of the texts, or none of them.
    wanted: bool,
}

impl Condition {
    fn parse(text: &str) -> Result<Self, QueryError> {
        let wanted = !text.contains("!=");
        let sign = if wanted { "=" } else { "!=" };
        let (column, texts) = text
            .split_once(sign)
            .ok_or_else(|| QueryError::Malformed {
                part: "condition",
                found: text.into(),
                accepted: "COLUMN=TEXT, COLUMN!=TEXT",
            })?;
        let texts = texts.split(" or ").map(str::to_owned).collect();
        Ok(Self { column: column.into(), texts, wanted })
    }

    fn is_met(&self, row: &Row) -> Result<bool, QueryError> {
        let found = self.texts.contains(cell(row, &self.column)?);
        Ok(found == self.wanted)
    }
}

/// Returns the rows that meet all conditions; at least one.
pub fn select(rows: Vec<Row>, conditions: &str) -> Result<Vec<Row>, QueryError> {
    let mut parsed = Vec::new();
    if conditions != "*" {
        for text in conditions.replace("\\, ", COMMA).split(", ") {
            parsed.push(Condition::parse(&text.replace(COMMA, ", "))?);
        }
    }
    let mut selected = Vec::new();
    for row in rows {
        let mut is_met = true;
        for condition in &parsed {
            is_met &= condition.is_met(&row)?;
        }
        if is_met {
            selected.push(row);
        }
    }
    if selected.is_empty() {
        return Err(QueryError::NoRow(conditions.into()));
    }
    Ok(selected)
}

/// Returns the different values of some columns, in their order in the file.
pub fn distinct(rows: &[Row], columns: &[&str]) -> Result<Vec<Vec<String>>, QueryError> {
    let mut found: Vec<Vec<String>> = Vec::new();
    for row in rows {
        let mut cells = Vec::new();
        for column in columns {
            cells.push(cell(row, column)?.clone());
        }
        if !found.contains(&cells) {
            found.push(cells);
        }
    }
    Ok(found)
}

/// Returns the rows whose cells in these columns have these values.
pub fn group<'r>(rows: &'r [Row], columns: &[&str], values: &[String]) -> Vec<&'r Row> {
    let is_own = |row: &&Row| {
        columns
            .iter()
            .zip(values)
            .all(|(column, value)| row.get(*column) == Some(value))
    };
    rows.iter().filter(is_own).collect()
}

/// Returns one number of the rows' `AGGREGATE COLUMN`; `None` if no row has one.
pub fn aggregate(rows: &[&Row], measure: &str) -> Result<Option<f64>, QueryError> {
    let malformed = || QueryError::Malformed {
        part: "measure",
        found: measure.into(),
        accepted: "only, min, max, median or count, and a column",
    };
    let (how, columns) = measure.split_once(' ').ok_or_else(malformed)?;
    if how == "count" {
        return Ok(Some(rows.len() as f64));
    }
    let mut values = Vec::new();
    for row in rows {
        values.extend(number(row, columns)?);
    }
    values.sort_by(f64::total_cmp);
    let [Some(first), Some(last)] = [values.first().copied(), values.last().copied()] else {
        return Ok(None);
    };
    match how {
        "only" if first == last => Ok(Some(first)),
        "only" => Err(QueryError::Several {
            column: columns.into(),
            values: format!("from {first} to {last}"),
        }),
        "min" => Ok(Some(first)),
        "max" => Ok(Some(last)),
        "median" => Ok(Some(0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2]))),
        _ => Err(malformed()),
    }
}

/// Returns a cell's number, or the quotient of two; `None` where a cell holds none.
fn number(row: &Row, columns: &str) -> Result<Option<f64>, QueryError> {
    let Some((above, below)) = columns.split_once(" / ") else {
        return Ok(cell(row, columns)?.parse().ok());
    };
    let above: Option<f64> = cell(row, above)?.parse().ok();
    let below: Option<f64> = cell(row, below)?.parse().ok();
    Ok(above
        .zip(below)
        .map(|(above, below)| above / below))
}

/// Writes a number in a format.
fn write(value: f64, format: &str) -> Result<String, QueryError> {
    let malformed = || QueryError::Malformed {
        part: "format",
        found: format.into(),
        accepted: "a number of decimals, alone or before below, above or percent",
    };
    let (digits, unit) = format.split_once(' ').unwrap_or((format, ""));
    let digits: usize = digits.parse().map_err(|_| malformed())?;
    let value = match unit {
        "" => value,
        "below" => 100.0 * (1.0 - value),
        "above" => 100.0 * (value - 1.0),
        "percent" => 100.0 * value,
        _ => return Err(malformed()),
    };
    Ok(format!("{value:.digits$}"))
}

/// Returns the one text of a column; `None` if all cells are empty.
fn only_text(rows: &[&Row], column: &str) -> Result<Option<String>, QueryError> {
    let mut texts = BTreeSet::new();
    for row in rows {
        texts.insert(cell(row, column)?.as_str());
    }
    texts.remove("");
    if texts.len() > 1 {
        let values = texts.into_iter().collect::<Vec<_>>().join(", ");
        return Err(QueryError::Several { column: column.into(), values });
    }
    Ok(texts.first().map(|text| (*text).to_owned()))
}

/// Returns the further column of a measure: a number in the format, a text as it is.
fn further(rows: &[&Row], column: &str, format: &str) -> Result<Option<String>, QueryError> {
    let is_number = rows
        .iter()
        .filter_map(|row| row.get(column))
        .any(|text| text.parse::<f64>().is_ok());
    if is_number && format != "text" {
        one(rows, &format!("only {column}"), format)
    } else {
        only_text(rows, column)
    }
}

/// Returns one value of `AGGREGATE COLUMN` in the format.
fn one(rows: &[&Row], measure: &str, format: &str) -> Result<Option<String>, QueryError> {
    if format == "text" {
        return only_text(rows, measure.strip_prefix("only ").unwrap_or(measure));
    }
    aggregate(rows, measure)?
        .map(|value| write(value, format))
        .transpose()
}

/// Returns the text of a whole measure over some rows; empty if they have no value.
pub fn show(rows: &[&Row], measure: &str, format: &str) -> Result<String, QueryError> {
    let (measure, beside) = measure.split_once(" (").unwrap_or((measure, ""));
    let (measure, ends) = measure.split_once(" [").unwrap_or((measure, ""));
    let mut text = one(rows, measure, format)?.unwrap_or_default();
    if let Some((low, high)) = ends.trim_end_matches(']').split_once(", ") {
        let low = one(rows, &format!("min {low}"), format)?;
        let high = one(rows, &format!("max {high}"), format)?;
        if let Some((low, high)) = low.zip(high) {
            text += &format!(" [{low}, {high}]");
        }
    }
    if !beside.is_empty()
        && let Some(beside) = further(rows, beside.trim_end_matches(')'), format)?
    {
        text += &format!(" ({beside})");
    }
    Ok(text)
}

/// Returns a Markdown table of `ROWS × COLUMNS`; ROWS may be several columns, with ` + ` between.
pub fn pivot(rows: &[Row], axes: &str, measure: &str, format: &str) -> Result<String, QueryError> {
    let (down, across) = axes
        .split_once(" × ")
        .ok_or_else(|| QueryError::Malformed {
            part: "pair of axes",
            found: axes.into(),
            accepted: "ROWS × COLUMNS",
        })?;
    let down: Vec<&str> = down.split(" + ").collect();
    let columns = distinct(rows, &[across])?.concat();
    let mut header: Vec<String> = down
        .iter()
        .map(|column| escape(&column.replace('_', " ")))
        .collect();
    header.extend(columns.iter().map(|column| escape(column)));
    let mut lines = vec![format!("| {} |", header.join(" | "))];
    lines.push(format!("|{}", "---|".repeat(header.len())));
    for names in together(distinct(rows, &down)?) {
        let of_line: Vec<Row> = group(rows, &down, &names)
            .into_iter()
            .cloned()
            .collect();
        let mut cells: Vec<String> = down
            .iter()
            .zip(&names)
            .map(|(column, name)| escape(&heading(column, name)))
            .collect();
        if down == ["scene"] {
            cells[0] += &kind_note(&of_line);
        }
        for column in &columns {
            let here = group(&of_line, &[across], std::slice::from_ref(column));
            cells.push(escape(&show(&here, measure, format)?));
        }
        lines.push(format!("| {} |", cells.join(" | ")));
    }
    Ok(lines.join("\n"))
}

/// Sorts names so that those that begin alike follow each other.
fn together(names: Vec<Vec<String>>) -> Vec<Vec<String>> {
    let mut groups: Vec<Vec<Vec<String>>> = Vec::new();
    for name in names {
        let found = groups
            .iter_mut()
            .find(|group| group[0][0] == name[0]);
        match found {
            Some(group) => group.push(name),
            None => groups.push(vec![name]),
        }
    }
    groups.concat()
}

fn escape(text: &str) -> String {
    text.replace('|', "\\|")
}

/// Returns the scene's kind in parentheses, unless it is a file.
fn kind_note(rows: &[Row]) -> String {
    let kind = rows.iter().find_map(|row| row.get("scene_kind"));
    kind.filter(|kind| *kind != "file")
        .map_or_else(String::new, |kind| format!(" ({kind})"))
}

/// Returns the name of a line: seconds with two digits, everything else as it is.
fn heading(column: &str, name: &str) -> String {
    match name.parse::<f64>() {
        Ok(seconds) if column.ends_with("_seconds") && seconds >= 0.01 => format!("{seconds:.2}"),
        Ok(seconds) if column.ends_with("_seconds") => format!("{seconds:.4}"),
        _ => name.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> Vec<Row> {
        let text = "scene,method,cost,rays\na,\"x, y\",2,4\na,z,3,4\nb,z,5,\n";
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        reader.deserialize().map(Result::unwrap).collect()
    }

    fn value(conditions: &str, measure: &str, format: &str) -> Result<String, QueryError> {
        let rows = select(rows(), conditions)?;
        show(&rows.iter().collect::<Vec<_>>(), measure, format)
    }

    #[test]
    fn rows_are_selected_aggregated_and_written() {
        assert_eq!(value("*", "median cost", "1").unwrap(), "3.0");
        assert_eq!(value("method=x\\, y", "only cost", "0").unwrap(), "2");
        assert_eq!(value("scene!=a", "count scene", "0").unwrap(), "1");
        assert_eq!(value("scene=a or b", "max cost [cost, cost]", "0").unwrap(), "5 [2, 5]");
        assert_eq!(value("scene=a", "min cost / rays (rays)", "0 percent").unwrap(), "50 (400)");
        assert_eq!(value("scene=b", "only method (rays)", "text").unwrap(), "z");
    }

    #[test]
    fn a_pivot_has_a_line_for_every_name_and_empty_cells_where_no_row_is() {
        let table = pivot(&rows(), "scene × method", "only cost", "0").unwrap();
        assert_eq!(table, "| scene | x, y | z |\n|---|---|---|\n| a | 2 | 3 |\n| b |  | 5 |");
    }

    #[test]
    fn errors_name_what_was_found_and_what_is_accepted() {
        for (conditions, measure, format, parts) in [
            ("scene", "only cost", "0", &["\"scene\" is no condition", "COLUMN=TEXT"][..]),
            (
                "colour=red",
                "only cost",
                "0",
                &["no column \"colour\"", "cost, method, rays, scene"],
            ),
            ("scene=c", "only cost", "0", &["no row meets \"scene=c\""]),
            ("*", "mean cost", "0", &["\"mean cost\" is no measure", "median"]),
            ("*", "only cost", "0", &["cost has several values, from 2 to 5"]),
            ("*", "only scene", "text", &["scene has several values, a, b"]),
            ("*", "max cost", "two", &["\"two\" is no format"]),
        ] {
            let message = value(conditions, measure, format)
                .unwrap_err()
                .to_string();
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        }
    }
}
