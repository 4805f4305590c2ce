//! The page of the columns of all CSV files, docs/COLUMNS.md: what is written wherever a file's rows are declared, in one place.

use crate::report::Report;
use crate::rows;
use crate::rows::columns::Columns;
use crate::stress::Measure;

/// Every CSV file that the program writes.
pub fn all() -> Vec<Columns> {
    [rows::columns(), Report::columns(), Measure::columns()].concat()
}

/// The page, in Markdown.
pub fn page() -> String {
    let sections: String = all().iter().map(Columns::to_string).collect();
    format!(
        "# Columns of CSV files\n\nEvery column of every CSV file that the harness writes; made by `UPDATE_DOCS=1 cargo test -p \
         harness --test docs` from the declarations of the rows.\nFiles whose names begin with `timing` hold what differs from run to \
         run; an empty cell is a number that there is not. FILE stands for a name that is chosen.\n{sections}"
    )
}
