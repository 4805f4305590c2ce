//! Queries of committed CSV files, for tests of pages, in the language of [`harness::report::query`].
//!
//! ```text
//! FILE | CONDITIONS | MEASURE | FORMAT                     one value
//! FILE | CONDITIONS | ROWS × COLUMNS | MEASURE | FORMAT    a table
//! ```
//! A file with `/*/` in its path stands for all such files, one after the other: results by processor.

use super::top;
use harness::report::query::{self, Row};
use std::fs;
use std::path::PathBuf;

/// The paths of a committed CSV; with `/*/` in it, one in every folder in which it is, by name.
fn paths(file: &str) -> Vec<PathBuf> {
    let results = top().join("results");
    let Some((before, after)) = file.split_once("/*/") else { return vec![results.join(file)] };
    let folders =
        fs::read_dir(results.join(before)).unwrap_or_else(|error| panic!("{file}: {error}"));
    let mut paths: Vec<PathBuf> = folders
        .map(|folder| folder.unwrap().path().join(after))
        .collect();
    paths.retain(|path| path.is_file());
    paths.sort();
    paths
}

/// The rows of a committed CSV that meet all conditions; at least one.
fn rows(file: &str, conditions: &str) -> Vec<Row> {
    let mut rows = Vec::new();
    for path in paths(file) {
        rows.extend(query::read(&path).unwrap_or_else(|error| panic!("{file}: {error}")));
    }
    query::select(rows, conditions).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// The answer of a query of four or five parts.
pub fn answer(query: &str) -> String {
    let parts: Vec<&str> = query.split(" | ").collect();
    let answer = match parts[..] {
        [file, conditions, measure, format] => {
            let rows = rows(file, conditions);
            query::show(&rows.iter().collect::<Vec<_>>(), measure, format)
        }
        [file, conditions, axes, measure, format] => {
            query::pivot(&rows(file, conditions), axes, measure, format)
                .map(|table| format!("\n{table}\n"))
        }
        _ => panic!("{query}: expected FILE | CONDITIONS | [ROWS × COLUMNS |] MEASURE | FORMAT"),
    };
    let text = answer.unwrap_or_else(|error| panic!("{query}: {error}"));
    assert!(!text.is_empty(), "{query}: no value");
    text
}
