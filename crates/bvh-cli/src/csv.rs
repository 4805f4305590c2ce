//! Tables of numbers as CSV, in the same form as the tables of the experiments.

use std::fmt::{Display, Write as _};

/// A table whose cells are numbers and words that need no quotes.
pub struct Table {
    text: String,
    /// True if the current row has a cell.
    begun: bool,
}

impl Table {
    /// Creates a table without rows. Commas separate the names of the columns.
    pub fn new(columns: &str) -> Self {
        Self { text: format!("{columns}\n"), begun: false }
    }

    /// Adds a cell to the current row.
    pub fn cell(&mut self, value: impl Display) {
        if self.begun {
            self.text.push(',');
        }
        self.begun = true;
        // Writing to a string cannot fail.
        let _ = write!(self.text, "{value}");
    }

    /// Adds a cell for each number, with the fewest digits that read back as the same number.
    pub fn numbers(&mut self, values: &[f32]) {
        for &value in values {
            self.cell(ryu::Buffer::new().format(value));
        }
    }

    /// Ends the current row.
    pub fn end_row(&mut self) {
        self.text.push('\n');
        self.begun = false;
    }

    /// Returns the table as text.
    pub fn text(&self) -> &str {
        &self.text
    }
}
