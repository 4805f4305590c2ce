//! Words of the pages that no query writes, each with the committed rows that it rests on.

mod paper;
mod rays;
mod times;

use crate::support::top;
use harness::report::query::{self, Row, number_in};

/// Returns the rows of a committed CSV file that meet all conditions; at least one.
pub fn rows(file: &str, conditions: &str) -> Vec<Row> {
    let all = query::read(&top().join("results").join(file)).unwrap();
    let rows = query::select(all, conditions).unwrap();
    assert!(!rows.is_empty(), "{file}: no row with {conditions}");
    rows
}

/// Returns a column of these rows in ascending order.
fn sorted(file: &str, conditions: &str, column: &str) -> Vec<f64> {
    let mut numbers: Vec<f64> =
        rows(file, conditions).iter().map(|row| number_in(row, column).unwrap()).collect();
    numbers.sort_by(f64::total_cmp);
    numbers
}

/// Returns the cell of a column in the one row that meets all conditions.
fn cell(file: &str, conditions: &str, column: &str) -> f64 {
    let [cell] = sorted(file, conditions, column)[..] else {
        panic!("{file}: one row with {conditions}")
    };
    cell
}
