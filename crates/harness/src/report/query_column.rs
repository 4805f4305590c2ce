//! A column of the table that a query gives: an aggregate of each group of rows, or its quotient
//! with a base.

use super::query::{Conditions, QueryError, Row};
use super::query_measure::{Aggregate, Measure};
use crate::statistics::{median_interval, range, student};
use bvh_config::{Nested, above};
use serde::{Deserialize, Serialize};

bvh_config::config! { serde;
    /// A column of the table.
    pub struct Column {
        /// Name of the column.
        name: String;
        /// The quantity in words, for axes and sentences; by default the name with blanks.
        label: String;
        /// The aggregate, such as `median cost`.
        value: String;
        /// Which quotient with the base the column is, if any. Quotients of medians have further
        /// columns: the ends of an interval, which is between the extremes of all pairs of runs or,
        /// for paired runs, encloses the median with a probability of 95 %.
        #[serde(skip_serializing_if = "Option::is_none")]
        ratio: Option<Ratio>;
        /// Columns by which rows are paired with rows of the base, if quotients are computed pair
        /// by pair. A further column then holds the verdict of the interval.
        paired_by: Vec<String>;
        /// For the quotient of two means, each of one row: the columns of their standard errors and
        /// of the numbers of values, which give the quotient a 95 % interval and a verdict.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<[String; 2]>;
        /// The paper's numbers, for a further column. Quotients of a file without seconds are also
        /// compared with them in `paper.csv`.
        paper: Vec<OfPaper>, in Nested;
    }
}

bvh_config::config! { serde;
    /// A number or words of the paper.
    pub struct OfPaper {
        /// Conditions on the row of the table that they belong to.
        row: String;
        /// The number.
        value: f64 = 1.0, in above(0.0);
        /// The paper's number for the base, which it is divided by.
        over: f64 = 1.0, in above(0.0);
        /// True if all rows that meet the conditions are readings of one number, of which the
        /// closest counts.
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        readings: bool;
        /// The words, if there is no number.
        #[serde(skip_serializing_if = "String::is_empty")]
        says: String;
        /// The least value for which the words hold.
        #[serde(skip_serializing_if = "Option::is_none")]
        from: Option<f64>, in 0.0..=1e300;
    }
}

/// A quotient of a group and its base.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ratio {
    /// The group's value over the base's.
    OverBase,
    /// The base's value over the group's.
    BaseOver,
}

impl Ratio {
    /// Returns the quotient; 1 for equal values, two zeros included.
    fn of(self, own: f64, base: f64) -> f64 {
        match self {
            _ if own == base => 1.0,
            Self::OverBase => own / base,
            Self::BaseOver => base / own,
        }
    }
}

/// Rows that agree in the columns by which a query groups them.
pub(super) struct Group<'r> {
    /// Their values in these columns, and the label that `against` names.
    pub key: Row,
    pub rows: Vec<&'r Row>,
    /// The rows that they are compared with.
    pub base: Vec<&'r Row>,
}

/// A quotient, and the ends of its interval.
type Compared = (Option<f64>, Option<(f64, f64)>);

impl Column {
    pub(super) fn label(&self) -> String {
        if self.label.is_empty() { self.name.replace('_', " ") } else { self.label.clone() }
    }

    /// Adds the cells of this column, and of those that belong to it, to the row of a group.
    pub(super) fn fill(&self, group: &Group, row: &mut Row) -> Result<(), QueryError> {
        let measure = Measure::parse(&self.value)?;
        let (value, interval) = match self.ratio {
            None => (measure.of_rows(&group.rows)?, None),
            Some(ratio) => self.quotient(group, &measure, ratio)?,
        };
        let mut cells = vec![("", text_of(value))];
        let has_error = self.error.is_some();
        if self.ratio.is_some() && (measure.how == Aggregate::Median || has_error) {
            let (low, high) = interval.unzip();
            cells.extend([("_low", text_of(low)), ("_high", text_of(high))]);
            if has_error || !self.paired_by.is_empty() {
                cells.push(("_verdict", verdict(interval).into()));
            }
        }
        for (end, text) in cells {
            put(row, format!("{}{end}", self.name), text)?;
        }
        if self.paper.iter().any(|of_paper| of_paper.says.is_empty()) {
            let mut paper = None;
            for OfPaper { row, value, over, .. } in &self.paper {
                if Conditions::parse(row)?.are_met(&group.key)? {
                    paper = Some(value / over);
                }
            }
            put(row, format!("paper_{}", self.name), text_of(paper))?;
        }
        Ok(())
    }

    fn quotient(
        &self,
        group: &Group,
        measure: &Measure,
        ratio: Ratio,
    ) -> Result<Compared, QueryError> {
        if self.paired_by.is_empty() {
            let own = measure.of_rows(&group.rows)?;
            let base = measure.of_rows(&group.base)?;
            let value = own.zip(base).map(|(own, base)| ratio.of(own, base));
            if let Some(columns) = &self.error {
                let error = relative_error(columns, &group.rows, own)?;
                let both = error.zip(relative_error(columns, &group.base, base)?);
                let half = both.map(|(own, base)| own.hypot(base));
                let ends = |(value, half)| (value - value * half, value + value * half);
                return Ok((value, value.zip(half).map(ends)));
            }
            let of_all = |rows: &[&Row]| {
                let values: Result<Vec<_>, _> =
                    rows.iter().map(|row| measure.of_row(row)).collect();
                Ok(range(values?.into_iter().flatten()))
            };
            // Runs are not paired, so any run of the group may meet any run of the base.
            let ends = of_all(&group.rows)?.zip(of_all(&group.base)?);
            let interval = ends.map(|(own, base)| {
                let ends = [ratio.of(own.0, base.1), ratio.of(own.1, base.0)];
                (ends[0].min(ends[1]), ends[0].max(ends[1]))
            });
            return Ok((value, interval));
        }
        let mut quotients = Vec::new();
        for row in &group.rows {
            let is_partner = |other: &&&Row| {
                let mut columns = self.paired_by.iter();
                columns.all(|column| row.get(column) == other.get(column))
            };
            // A run without a partner, such as one on a scene that the base lacks, has no quotient.
            let Some(partner) = group.base.iter().find(is_partner) else { continue };
            let own = measure.of_row(row)?;
            let base = measure.of_row(partner)?;
            quotients.extend(own.zip(base).map(|(own, base)| ratio.of(own, base)));
        }
        let value = measure.of_values(&quotients)?;
        // Fewer than six pairs enclose the median with a lower probability.
        let interval = median_interval(&quotients).filter(|_| quotients.len() >= 6);
        Ok((value, interval))
    }
}

/// Returns half the width of the 95 % interval of a mean, over the mean.
fn relative_error(
    [error, count]: &[String; 2],
    rows: &[&Row],
    mean: Option<f64>,
) -> Result<Option<f64>, QueryError> {
    let only = |column: &str| Measure::parse(&format!("only {column}"))?.of_rows(rows);
    let factor = only(count)?.and_then(|count| student(count as usize));
    let error = only(error)?.zip(mean).map(|(error, mean)| error / mean);
    Ok(factor.zip(error).map(|(factor, error)| factor * error))
}

fn put(row: &mut Row, name: String, text: String) -> Result<(), QueryError> {
    let accepted = "a name of a column that no other has";
    match row.insert(name.clone(), text) {
        Some(_) => Err(QueryError::Malformed { part: "name", found: name, accepted }),
        None => Ok(()),
    }
}

fn verdict(interval: Option<(f64, f64)>) -> &'static str {
    match interval {
        Some((_, high)) if high < 1.0 => "lower",
        Some((low, _)) if low > 1.0 => "higher",
        _ => "inconclusive",
    }
}

fn text_of(number: Option<f64>) -> String {
    let Some(number) = number else { return String::new() };
    // Counts stay integers, as in the files that rows are read from.
    if number.fract() == 0.0 && number.abs() < 1e15 {
        return format!("{number:.0}");
    }
    format!("{number:?}")
}
