//! Tables of numbers in CSV files that others wrote.

use std::str::FromStr;

/// The numbers of a file, line by line.
#[derive(Clone, Debug)]
pub struct Table<T> {
    /// The names of the columns, if there is a header.
    pub names: Vec<String>,
    /// The number of columns; 0 if there are no numbers.
    pub width: usize,
    /// The rows one after the other.
    pub numbers: Vec<T>,
    /// The line of each row, counted from 1 as editors do.
    pub lines: Vec<usize>,
}

impl<T: FromStr> Table<T> {
    /// Reads lines of as many numbers each, separated by commas, semicolons or blanks. The first
    /// line may be a header, which has no number, and lines may be blank. Faults name the line, and
    /// what is `accepted` instead.
    pub fn read(
        bytes: &[u8],
        is_accepted: impl Fn(usize) -> bool,
        accepted: &str,
    ) -> Result<Self, String> {
        let text = str::from_utf8(bytes).map_err(|_| "the file is not UTF-8".to_owned())?;
        // Spreadsheets begin UTF-8 with this mark, which would make the first number a word.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut table =
            Self { names: Vec::new(), width: 0, numbers: Vec::new(), lines: Vec::new() };
        for (line_number, line) in
            (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty())
        {
            let fields = || fields(line);
            if line_number == 1 && fields().all(|field| field.parse::<T>().is_err()) {
                table.names = fields().map(str::to_owned).collect();
                continue;
            }
            let row: Option<Vec<T>> = fields().map(|field| field.parse().ok()).collect();
            let is_row =
                |row: &Vec<T>| is_accepted(row.len()) && [0, row.len()].contains(&table.width);
            let Some(row) = row.filter(is_row) else {
                return Err(format!("line {line_number} is {line:?}; accepted: {accepted}"));
            };
            table.width = row.len();
            table.numbers.extend(row);
            table.lines.push(line_number);
        }
        Ok(table)
    }

    /// Rejects a header whose names do not begin with these, or that has another number of them than
    /// there are columns.
    pub fn check_names(&self, first: &[&str]) -> Result<(), String> {
        let begins = self.names.iter().zip(first).all(|(name, first)| name == first);
        if self.names.is_empty() || (begins && self.names.len() == self.width) {
            return Ok(());
        }
        Err(format!(
            "line 1 is {:?}, and there are {} columns; accepted: a name for each, of which the first \
             are {}, or no header",
            self.names.join(","),
            self.width,
            first.join(",")
        ))
    }
}

/// Returns the fields of a line, between the first of its separators that there is.
fn fields(line: &str) -> impl Iterator<Item = &str> {
    let separator = [',', ';'].into_iter().find(|&separator| line.contains(separator));
    let is_end = move |c: char| separator.map_or(c.is_whitespace(), |separator| c == separator);
    // Of several blanks, only the first separates.
    line.trim()
        .split(is_end)
        .filter(move |field| separator.is_some() || !field.is_empty())
        .map(str::trim)
}
