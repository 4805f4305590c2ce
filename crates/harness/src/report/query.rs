//! The query language of reports and documentation: selects, groups and aggregates rows of CSV
//! files.
//!
//! ```text
//! CONDITIONS   COLUMN=TEXT, COLUMN!=TEXT or TEXT, …   `*` for all rows; a comma in a text is `\,`
//!              COLUMN<NUMBER, COLUMN>NUMBER           rows with a number in the column
//!              COLUMN=max                             rows with the greatest number of the column
//! MEASURE      AGGREGATE VALUE
//!              spearman VALUE, VALUE                  the rank correlation; also pearson, and the
//!                                                     ends of its interval, pearson_low and _high
//! AGGREGATE    only (all rows agree), first, min, max, sum, mean, median, q25 (and other quantiles in
//!              per cent), geomean, variation (standard deviation / mean), count
//! VALUE        COLUMN, COLUMN / COLUMN * 1e-6, …      computed row by row, from left to right, with
//!              + - * / and <, which is 1 or 0
//! ```

use indexmap::IndexMap;
use std::cmp::Ordering;

/// A row: the texts of its cells by the names of their columns, in the order of the file.
pub type Row = IndexMap<String, String>;

/// Reasons why a query has no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "each message names its fields")]
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

/// Replaces commas within texts while conditions are split at commas.
const COMMA: &str = "\u{0}";

/// Returns the text of a cell.
pub fn cell<'r>(row: &'r Row, column: &str) -> Result<&'r String, QueryError> {
    row.get(column).ok_or_else(|| {
        let names: Vec<&str> = row.keys().map(String::as_str).collect();
        QueryError::Column { column: column.into(), accepted: names.join(", ") }
    })
}

/// Returns the number in a cell, if it holds one.
pub fn number_in(row: &Row, column: &str) -> Option<f64> {
    row.get(column)?.parse().ok()
}

/// A condition on one column.
struct Condition {
    column: String,
    sign: &'static str,
    texts: Vec<String>,
}

/// `=` if the cell must be one of the texts, `!=` if it must be none of them.
const SIGNS: [&str; 4] = ["!=", "=", "<", ">"];

impl Condition {
    fn parse(text: &str) -> Result<Self, QueryError> {
        let malformed = || QueryError::Malformed {
            part: "condition",
            found: text.into(),
            accepted: "COLUMN=TEXT, COLUMN!=TEXT, COLUMN<NUMBER, COLUMN>NUMBER",
        };
        // The first sign ends the column; texts may hold others.
        let signs = SIGNS.iter().filter_map(|sign| Some((text.find(sign)?, *sign)));
        let (at, sign) = signs.min_by_key(|(at, _)| *at).ok_or_else(malformed)?;
        let texts: Vec<String> = text[at + sign.len()..].split(" or ").map(str::to_owned).collect();
        if "<>".contains(sign) && (texts.len() > 1 || texts[0].parse::<f64>().is_err()) {
            return Err(malformed());
        }
        Ok(Self { column: text[..at].into(), sign, texts })
    }

    /// Replaces the text `max` by the greatest number of the column, if it holds numbers.
    fn resolve(&mut self, rows: &[Row]) -> Result<(), QueryError> {
        if self.texts != ["max"] || self.sign != "=" {
            return Ok(());
        }
        let texts = rows.iter().map(|row| cell(row, &self.column));
        let texts = texts.collect::<Result<Vec<&String>, _>>()?.into_iter();
        let numbers = texts.filter_map(|text| Some((text.parse::<f64>().ok()?, text)));
        let numbers = numbers.filter(|(number, _)| !number.is_nan());
        if let Some((_, text)) = numbers.max_by(|one, other| one.0.total_cmp(&other.0)) {
            self.texts = vec![text.clone()];
        }
        Ok(())
    }

    fn is_met(&self, row: &Row) -> Result<bool, QueryError> {
        let found = cell(row, &self.column)?;
        let number = |text: &str| text.parse::<f64>().ok();
        let order = number(found).zip(number(&self.texts[0])).and_then(|(a, b)| a.partial_cmp(&b));
        Ok(match self.sign {
            "=" => self.texts.contains(found),
            "!=" => !self.texts.contains(found),
            "<" => order == Some(Ordering::Less),
            _ => order == Some(Ordering::Greater),
        })
    }
}

/// Conditions on the columns of a row, all of which have to be met.
pub struct Conditions(Vec<Condition>);

impl Conditions {
    /// Reads conditions; `*` and an empty text are none.
    pub fn parse(text: &str) -> Result<Self, QueryError> {
        let mut conditions = Vec::new();
        // An empty text is the default of specs, and `*` its visible form in documentation.
        if !["", "*"].contains(&text) {
            for text in text.replace("\\, ", COMMA).split(", ") {
                conditions.push(Condition::parse(&text.replace(COMMA, ", "))?);
            }
        }
        Ok(Self(conditions))
    }

    /// Returns the columns of the conditions.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|condition| condition.column.as_str())
    }

    /// Returns the texts that a column must have one of; none if any will do.
    pub fn texts_of(&self, column: &str) -> &[String] {
        let is_own = |condition: &&Condition| condition.column == column && condition.sign == "=";
        self.0.iter().find(is_own).map_or(&[], |condition| &condition.texts)
    }

    /// Returns the texts of the conditions.
    pub fn texts(&self) -> Vec<&str> {
        let texts = self.0.iter().flat_map(|condition| &condition.texts);
        texts.map(String::as_str).collect()
    }

    /// Returns true if the row meets all conditions.
    pub fn are_met(&self, row: &Row) -> Result<bool, QueryError> {
        self.0.iter().try_fold(true, |all, condition| Ok(condition.is_met(row)? && all))
    }
}

/// Returns the rows that meet all conditions; at least one.
pub fn select(rows: Vec<Row>, conditions: &str) -> Result<Vec<Row>, QueryError> {
    let mut parsed = Conditions::parse(conditions)?;
    for condition in &mut parsed.0 {
        condition.resolve(&rows)?;
    }
    let mut selected = Vec::new();
    for row in rows {
        selected.extend(parsed.are_met(&row)?.then_some(row));
    }
    if selected.is_empty() {
        return Err(QueryError::NoRow(conditions.into()));
    }
    Ok(selected)
}

/// Returns each row with the columns of every row of the file `name` that agrees with it in the
/// columns `by`, or in all common columns if there are none. A column of both files that they need
/// not agree in is called `name.COLUMN`. The rows of either list have the same columns.
pub fn join(
    rows: &[Row],
    name: &str,
    others: &[Row],
    by: &[String],
) -> Result<Vec<Row>, QueryError> {
    let Some((row, other)) = rows.first().zip(others.first()) else { return Ok(vec![]) };
    let mut common: Vec<&str> = by.iter().map(String::as_str).collect();
    if by.is_empty() {
        common.extend(other.keys().map(String::as_str).filter(|column| row.contains_key(*column)));
    }
    let others = grouped(others, &common)?;
    let mut joined = Vec::new();
    for row in rows {
        let values = common.iter().map(|column| cell(row, column).cloned());
        let agreeing = others.get(&values.collect::<Result<Vec<_>, _>>()?);
        for other in agreeing.into_iter().flatten() {
            let mut both = row.clone();
            for (column, text) in *other {
                let is_other = both.contains_key(column) && !common.contains(&column.as_str());
                let column = if is_other { format!("{name}.{column}") } else { column.clone() };
                both.insert(column, text.clone());
            }
            joined.push(both);
        }
    }
    Ok(joined)
}

/// Returns the rows by their values in some columns, in the order of the file.
pub fn grouped<'r>(
    rows: impl IntoIterator<Item = &'r Row>,
    columns: &[&str],
) -> Result<IndexMap<Vec<String>, Vec<&'r Row>>, QueryError> {
    let mut groups: IndexMap<_, Vec<&Row>> = IndexMap::new();
    for row in rows {
        let values = columns.iter().map(|column| cell(row, column).cloned());
        groups.entry(values.collect::<Result<_, _>>()?).or_default().push(row);
    }
    Ok(groups)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::csv_file::parse;
    use std::path::Path;

    #[test]
    fn a_row_is_joined_with_all_that_agree_in_every_common_column() {
        let rows = |text: &str| parse::<Row>(text.as_bytes(), Path::new("rows")).unwrap();
        let texts = |rows: Vec<Row>| {
            let texts = rows.iter().map(|row| row.values().cloned().collect::<Vec<_>>().join(" "));
            texts.collect::<Vec<_>>()
        };
        let runs = rows("scene,method,cost\nb,x,1\na,x,2\nb,y,3\nc,x,4\n");
        for (others, expected) in [
            (
                "method,rays,scene\nx,7,a\nx,8,b\nx,9,b\nz,6,b\n",
                &["b x 1 8", "b x 1 9", "a x 2 7"][..],
            ),
            ("scene\nb\n", &["b x 1", "b y 3"]),
            (
                "light\non\noff\n",
                &[
                    "b x 1 on",
                    "b x 1 off",
                    "a x 2 on",
                    "a x 2 off",
                    "b y 3 on",
                    "b y 3 off",
                    "c x 4 on",
                    "c x 4 off",
                ],
            ),
            ("scene\n", &[]),
        ] {
            let joined = join(&runs, "others", &rows(others), &[]).unwrap();
            assert_eq!(texts(joined), expected, "{others}");
        }
        let exact = rows("scene,method,cost\na,exact,1\n");
        let joined = join(&runs, "exact", &exact, &["scene".to_owned()]).unwrap();
        assert!(joined[0].keys().eq(["scene", "method", "cost", "exact.method", "exact.cost"]));
        assert_eq!(texts(joined), ["a x 2 exact 1"]);
    }
}
