//! The measures of the query language: an aggregate of a value that is computed row by row.

use super::query::{QueryError, Row, cell};
use crate::statistics::{
    geometric_mean, mean, pearson, pearson_interval, quantile, range, spearman, variance,
};
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::{Error, StrDeserializer};

/// The reduction of the values of some rows to one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Aggregate {
    /// The value in which all rows agree.
    Only,
    /// The value of the first row.
    First,
    /// The least value.
    Min,
    /// The greatest value.
    Max,
    /// The sum.
    Sum,
    /// The mean.
    Mean,
    /// The median.
    Median,
    /// The quantile of so many per cent.
    #[serde(skip)]
    Quantile(u8),
    /// The geometric mean.
    Geomean,
    /// The standard deviation over the mean.
    Variation,
    /// The number of rows, whatever they hold.
    Count,
    /// Pearson's correlation of two values.
    Pearson,
    /// Lower end of its 95 % interval.
    PearsonLow,
    /// The upper end.
    PearsonHigh,
    /// Spearman's rank correlation of two values.
    Spearman,
}

impl Aggregate {
    fn parse(name: &str) -> Option<Self> {
        let percent = name.strip_prefix('q').and_then(|percent| percent.parse().ok());
        if let Some(percent @ 1..=99) = percent {
            return Some(Self::Quantile(percent));
        }
        let name: StrDeserializer<Error> = name.into_deserializer();
        Self::deserialize(name).ok()
    }

    /// Returns true for correlations, which need two values of every row.
    fn is_of_pairs(self) -> bool {
        matches!(self, Self::Pearson | Self::PearsonLow | Self::PearsonHigh | Self::Spearman)
    }
}

/// An aggregate of a value, computed row by row from columns and numbers.
pub struct Measure<'t> {
    /// The reduction of the values to one number.
    pub how: Aggregate,
    values: Vec<&'t str>,
    text: &'t str,
}

impl<'t> Measure<'t> {
    /// Reads `AGGREGATE VALUE`.
    pub fn parse(text: &'t str) -> Result<Self, QueryError> {
        let malformed = || QueryError::Malformed {
            part: "measure",
            found: text.into(),
            accepted: "only, first, min, max, sum, mean, median, q25, geomean, variation, count, \
                       and a column; pearson, pearson_low, pearson_high, spearman, and two",
        };
        let (name, rest) = text.split_once(' ').ok_or_else(malformed)?;
        let how = Aggregate::parse(name).ok_or_else(malformed)?;
        let values: Vec<&str> =
            if how.is_of_pairs() { rest.split(", ").collect() } else { vec![rest] };
        if values.len() != 1 + usize::from(how.is_of_pairs()) {
            return Err(malformed());
        }
        Ok(Self { how, values, text })
    }

    /// Returns the first value of a row; `None` where a cell holds no number.
    pub fn of_row(&self, row: &Row) -> Result<Option<f64>, QueryError> {
        number(row, self.values[0])
    }

    /// Returns one number of the rows; `None` if no row has one.
    pub fn of_rows(&self, rows: &[&Row]) -> Result<Option<f64>, QueryError> {
        if self.how == Aggregate::Count {
            return Ok(Some(rows.len() as f64));
        }
        let mut numbers = Vec::new();
        for row in rows {
            let of_row = self.values.iter().map(|value| number(row, value));
            numbers.push(of_row.collect::<Result<Option<Vec<f64>>, _>>()?);
        }
        let numbers = numbers.into_iter().flatten();
        if self.how.is_of_pairs() {
            let pairs: Vec<_> = numbers.map(|numbers| (numbers[0], numbers[1])).collect();
            let interval = || pearson_interval(pearson(&pairs)?, pairs.len());
            return Ok(match self.how {
                Aggregate::Pearson => pearson(&pairs),
                Aggregate::PearsonLow => interval().map(|ends| ends.0),
                Aggregate::PearsonHigh => interval().map(|ends| ends.1),
                _ => spearman(&pairs),
            });
        }
        self.of_values(&numbers.flatten().collect::<Vec<_>>())
    }

    /// Returns one number of some values; `None` if there are none.
    pub fn of_values(&self, values: &[f64]) -> Result<Option<f64>, QueryError> {
        let Some((least, most)) = range(values.iter().copied()) else { return Ok(None) };
        Ok(match self.how {
            Aggregate::Only if least < most => {
                let values = format!("from {least} to {most}");
                return Err(QueryError::Several { column: self.values[0].into(), values });
            }
            Aggregate::Only | Aggregate::First => values.first().copied(),
            Aggregate::Min => Some(least),
            Aggregate::Max => Some(most),
            Aggregate::Sum => Some(values.iter().sum()),
            Aggregate::Mean => Some(mean(values.iter().copied())),
            Aggregate::Median => quantile(values, 0.5),
            Aggregate::Quantile(percent) => quantile(values, f64::from(percent) / 100.0),
            Aggregate::Geomean => Some(geometric_mean(values)),
            Aggregate::Variation => {
                variance(values).map(|variance| variance.sqrt() / mean(values.iter().copied()))
            }
            _ => {
                let accepted = "an aggregate of one value of every row";
                let found = self.text.into();
                return Err(QueryError::Malformed { part: "ratio", found, accepted });
            }
        })
    }
}

/// Returns a value of a row, computed from left to right; `None` where a cell holds no number.
fn number(row: &Row, value: &str) -> Result<Option<f64>, QueryError> {
    let mut words = value.split(' ');
    let mut result = operand(row, words.next().unwrap_or_default())?;
    while let Some(operator) = words.next() {
        let other = operand(row, words.next().unwrap_or_default())?;
        let Some((left, right)) = result.zip(other) else { return Ok(None) };
        result = Some(match operator {
            "+" => left + right,
            "-" => left - right,
            "*" => left * right,
            "/" => left / right,
            "<" => f64::from(left < right),
            _ => {
                let found = value.into();
                let accepted = "columns and numbers with +, -, *, / or < between blanks";
                return Err(QueryError::Malformed { part: "value", found, accepted });
            }
        });
    }
    Ok(result)
}

/// Returns the number of a column, or the number itself.
fn operand(row: &Row, word: &str) -> Result<Option<f64>, QueryError> {
    match word.parse() {
        Ok(number) => Ok(Some(number)),
        Err(_) => Ok(cell(row, word)?.parse().ok()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::query::select;
    use super::*;

    fn rows() -> Vec<Row> {
        let text = "scene,method,cost,rays\na,\"x, y\",2,4\na,z,3,4\nb,z,5,\n";
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        reader.deserialize().map(Result::unwrap).collect()
    }

    fn value(conditions: &str, measure: &str) -> Result<Option<f64>, QueryError> {
        let rows = select(rows(), conditions)?;
        Measure::parse(measure)?.of_rows(&rows.iter().collect::<Vec<_>>())
    }

    #[test]
    fn rows_are_selected_and_aggregated() {
        assert_eq!(value("*", "median cost"), Ok(Some(3.0)));
        assert_eq!(value("method=x\\, y", "only cost"), Ok(Some(2.0)));
        assert_eq!(value("scene!=a", "count scene"), Ok(Some(1.0)));
        assert_eq!(value("scene=a or b", "max cost"), Ok(Some(5.0)));
        assert_eq!(value("cost>2, cost<5", "only cost"), Ok(Some(3.0)));
        assert_eq!(value("scene=a", "min cost / rays"), Ok(Some(0.5)));
        assert_eq!(value("scene=b", "only rays"), Ok(None));
        assert_eq!(value("*", "q25 cost - 1"), Ok(Some(1.5)));
        assert_eq!(value("*", "mean cost < 5 * 3"), Ok(Some(2.0)));
        assert_eq!(value("cost<5", "variation cost"), Ok(Some(0.5f64.sqrt() / 2.5)));
        assert_eq!(value("*", "pearson_low cost, cost"), Ok(None));
    }

    #[test]
    fn errors_name_what_was_found_and_what_is_accepted() {
        for (conditions, measure, parts) in [
            ("scene", "only cost", &["\"scene\" is no condition", "COLUMN=TEXT"][..]),
            ("colour=red", "only cost", &["no column \"colour\"", "scene, method, cost, rays"]),
            ("scene=c", "only cost", &["no row meets \"scene=c\""]),
            ("*", "modal cost", &["\"modal cost\" is no measure", "median"]),
            ("*", "only cost", &["cost has several values, from 2 to 5"]),
        ] {
            let message = value(conditions, measure).unwrap_err().to_string();
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        }
    }
}
