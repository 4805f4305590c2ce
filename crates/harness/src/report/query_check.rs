//! Rejects queries for files and columns that no run writes, before anything runs.

use super::config::check_file;
use super::query::{self, Conditions, QueryError, Row};
use super::query_measure::filled;
use super::query_report::Config;
use crate::rows;
use bvh_config::OutOfRange;

impl Config {
    /// Rejects parts of the query that cannot be read, and files and columns that no run writes.
    pub(super) fn check_queries(&self) -> Result<(), OutOfRange> {
        check_file(&self.file)?;
        // A row that any number would fit into.
        let mut row = Row::new();
        for (key, name) in [("rows", &self.rows), ("join", &self.join)] {
            if key == "join" && name.is_empty() {
                continue;
            }
            let (_, columns) = rows::files().find(|(file, _)| file == name).ok_or_else(|| {
                let names: Vec<&str> = rows::files().map(|(file, _)| *file).collect();
                OutOfRange::new(key, format!("{name:?}"), names.join(", "))
            })?;
            row.extend(columns.iter().map(|&column| (column.into(), "1".into())));
        }
        for (key, result) in self.attempts(&row) {
            match result {
                Err(QueryError::Malformed { found, accepted, .. }) => {
                    return Err(OutOfRange::new(key, format!("{found:?}"), accepted));
                }
                Err(QueryError::Column { column, accepted }) => {
                    let accepted = format!("the columns {accepted}");
                    return Err(OutOfRange::new(key, format!("{column:?}"), accepted));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Applies every part of the query to a row, and returns the result of each with its key.
    fn attempts(&self, row: &Row) -> Vec<(String, Result<(), QueryError>)> {
        let has = |column: &str| query::cell(row, column).map(|_| ());
        let has_all = |conditions: &str| Conditions::parse(conditions)?.columns().try_for_each(has);
        let mut attempts =
            vec![("select".into(), has_all(&self.select)), ("base".into(), has_all(&self.base))];
        for (index, column) in self.by.iter().enumerate() {
            attempts.push((format!("by[{index}]"), has(column)));
        }
        for (index, column) in self.columns.iter().enumerate() {
            let partners = column.paired_by.iter().try_for_each(|column| has(column));
            attempts.push((format!("columns[{index}].value"), column.try_on(row)));
            attempts.push((format!("columns[{index}].paired_by"), partners));
        }
        let ones = |columns: &mut dyn Iterator<Item = String>| {
            Ok(vec![columns.map(|column| (column, "1".into())).collect()])
        };
        let read = |name: &str| match rows::files().find(|(file, _)| *file == name) {
            Some((_, columns)) => ones(&mut columns.iter().map(|column| (*column).to_owned())),
            None => ones(&mut self.header().into_iter()),
        };
        for part in self.finding.split_inclusive('}') {
            attempts.push(("finding".into(), filled(part, &read).map(|_| ())));
        }
        attempts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_config::Check;

    #[test]
    fn files_and_columns_that_runs_do_not_write_are_rejected_by_key() {
        let fault = |change: &str| {
            let mut config: toml::Table =
                "source = 's'\ntitle = 't'\nfile = 'x'\nrows = 'runs.csv'\n\
                by = ['scene']\ncolumns = [{ name = 'c', value = 'max cost / work' }]"
                    .parse()
                    .unwrap();
            config.extend(change.parse::<toml::Table>().unwrap());
            let config: Config = config.try_into().unwrap();
            config.check().err().map(|fault| fault.key)
        };
        assert_eq!(fault(""), None);
        for (change, key) in [
            ("rows = '../runs.csv'", "rows"),
            // The columns of an unknown file are unknown, too.
            ("join = 'costs.csv'\nbase = 'threads=1'", "join"),
            ("select = 'method=a, seconds=1'", "select"),
            ("by = ['scene', 'rays']", "by[1]"),
            ("columns = [{ name = 'c', value = 'max cost - work' }]", "columns[0].value"),
            ("finding = 'Of {scene=a | max c} to {scene=b | max cost}'", "finding"),
            ("finding = 'Of {max c}'", "finding"),
        ] {
            assert_eq!(fault(change).as_deref(), Some(key), "{change}");
        }
        assert_eq!(fault("join = 'timing.csv'\nbase = 'threads=1'"), None);
    }
}
