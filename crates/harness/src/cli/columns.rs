//! docs/COLUMNS.md: the columns of all CSV files, collected from the declarations of their rows.

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
        "# Columns of CSV files\n\n\
         Every column of every CSV file that the harness writes; generated from the declarations of\n\
         the rows by `UPDATE_DOCS=1 cargo test -p harness --test docs`. Files whose names begin with\n\
         `timing` hold numbers that differ from run to run. An empty cell means that the number does\n\
         not exist. FILE is a placeholder for a name that the spec chooses. The columns of a report of the\n\
         kind `query` are in its spec.\n{sections}"
    )
}
