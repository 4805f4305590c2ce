//! Compares fresh results with committed ones: the resolved spec line by line, and CSV files row by
//! row. Files with times and figures are not compared; `--redraw` makes figures again.

use crate::Error;
use crate::files::{self, read_toml, to_toml};
use csv::StringRecord;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use toml::{Table, Value};

/// The number of differences per file that are listed; further ones are only counted.
const SHOWN: usize = 5;

/// Lists the differences between the folders `fresh` and `committed`, one line each.
///
/// The rows of `skipped_scenes` are not compared. If any scene was skipped, neither are the rows of
/// files without a column `scene`, which summarise all scenes.
pub fn compare(
    fresh: &Path,
    committed: &Path,
    skipped_scenes: &[String],
) -> Result<Vec<String>, Error> {
    if !committed.is_dir() {
        return Ok(vec![format!("{}: no committed results to compare with", committed.display())]);
    }
    let [now, then] = [spec(fresh, skipped_scenes)?, spec(committed, skipped_scenes)?];
    let mut differences = shortened("resolved.toml", spec_differences(&now, &then));
    let [now, then] = [tables(fresh, skipped_scenes)?, tables(committed, skipped_scenes)?];
    let names: BTreeSet<&String> = now.keys().chain(then.keys()).collect();
    for name in names {
        match (now.get(name), then.get(name)) {
            (Some(now), Some(then)) => {
                differences.extend(shortened(name, now.differences(then, skipped_scenes)));
            }
            (Some(_), None) => {
                differences.push(format!("{name} is not among the committed results"));
            }
            _ => differences.push(format!("{name} is committed but is no longer written")),
        }
    }
    Ok(differences)
}

/// Returns the text of a resolved spec without the skipped scenes.
fn spec(folder: &Path, skipped_scenes: &[String]) -> Result<String, Error> {
    let mut spec: Table = read_toml(&folder.join("resolved.toml"))?;
    if let Some(Value::Array(scenes)) = spec.get_mut("scenes") {
        let is_kept = |name: &str| skipped_scenes.iter().all(|skipped| skipped != name);
        scenes.retain(|scene| scene.get("name").and_then(Value::as_str).is_none_or(is_kept));
    }
    to_toml(&spec)
}

/// Compares resolved specs line by line.
fn spec_differences(fresh: &str, committed: &str) -> Vec<String> {
    let [now, then] = [fresh, committed].map(|text| text.lines().collect::<BTreeSet<_>>());
    let added = now.difference(&then).map(|line| format!("not committed: {line}"));
    let removed = then.difference(&now).map(|line| format!("only committed: {line}"));
    let differences: Vec<String> = added.chain(removed).collect();
    match differences.is_empty() && fresh != committed {
        true => vec!["the same lines in another order or number".into()],
        false => differences,
    }
}

/// Returns the first differences in a file and the number of further ones.
fn shortened(file: &str, mut differences: Vec<String>) -> Vec<String> {
    // One changed column would otherwise print a line for every row.
    let more = differences.len().saturating_sub(SHOWN);
    differences.truncate(SHOWN);
    if more > 0 {
        differences.push(format!("and {more} more"));
    }
    differences.into_iter().map(|difference| format!("{file}: {difference}")).collect()
}

/// The rows of a CSV file, which may differ in length: that is a difference and no error.
struct Rows {
    header: StringRecord,
    records: Vec<StringRecord>,
}

/// Reads the tables in a folder that hold no seconds, by their names, without the skipped scenes.
fn tables(folder: &Path, skipped_scenes: &[String]) -> Result<BTreeMap<String, Rows>, Error> {
    let mut tables = BTreeMap::new();
    for name in files::names(folder)? {
        if !name.ends_with(".csv") || name.starts_with("timing") {
            continue;
        }
        let path = folder.join(&name);
        let bytes = bvh_scenes::files::read(&path)?;
        let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(&bytes[..]);
        let header = reader.headers().map_err(Error::csv(&path))?.clone();
        let records = reader.records().collect::<Result<Vec<StringRecord>, _>>();
        let mut records = records.map_err(Error::csv(&path))?;
        if let Some(scene) = header.iter().position(|column| column == "scene") {
            let is_skipped = |name: &str| skipped_scenes.iter().any(|skipped| skipped == name);
            records.retain(|record| !record.get(scene).is_some_and(is_skipped));
        }
        tables.insert(name, Rows { header, records });
    }
    Ok(tables)
}

impl Rows {
    fn differences(&self, committed: &Self, skipped_scenes: &[String]) -> Vec<String> {
        let Self { header, records } = self;
        // Rows that name no scene are about all scenes, and some are missing here.
        if !skipped_scenes.is_empty() && !header.iter().any(|column| column == "scene") {
            return vec![];
        }
        // Cells under different columns cannot be compared one by one.
        if *header != committed.header {
            return vec![format!("columns are {header:?}, committed {:?}", committed.header)];
        }
        let mut differences = Vec::new();
        for (now, then) in records.iter().zip(&committed.records) {
            for (column, (now, then_is)) in header.iter().zip(now.iter().zip(then)) {
                if now != then_is {
                    let row = identity(header, then);
                    differences.push(format!("{row}: {column} is {now}, committed {then_is}"));
                }
            }
        }
        let (now, then) = (records.len(), committed.records.len());
        if now != then {
            differences.push(format!("{now} rows, committed {then}"));
        }
        differences
    }
}

/// Returns the columns that identify a row: its scene, method and so on.
fn identity(header: &StringRecord, row: &StringRecord) -> String {
    let keys = ["scene", "method", "column", "quantity", "repetition", "trials", "evaluations"];
    let values = header.iter().zip(row).filter(|(column, _)| keys.contains(column));
    values.map(|(column, value)| format!("{column} {value}")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Compares folders that differ in the text of one file.
    fn differences(file: &str, texts: [&str; 2], skipped: &[&str]) -> Vec<String> {
        let folders = texts.map(|text| {
            let folder = tempfile::tempdir().unwrap();
            fs::write(folder.path().join("resolved.toml"), "").unwrap();
            fs::write(folder.path().join(file), text).unwrap();
            folder
        });
        // Seconds are not compared.
        fs::write(folders[0].path().join("timing.csv"), "seconds\n1\n").unwrap();
        let skipped: Vec<String> = skipped.iter().map(|scene| (*scene).to_owned()).collect();
        compare(folders[0].path(), folders[1].path(), &skipped).unwrap()
    }

    #[test]
    fn differences_are_named_except_those_of_skipped_scenes() {
        let rows = "scene,method,cost\na,m,1.5\nb,m,2.5\n";
        let fewer = "scene,method,cost\na,m,1.5\n";
        for (texts, skipped, expected) in [
            ([fewer, rows], &[][..], &["runs.csv: 1 rows, committed 2"][..]),
            ([fewer, rows], &["b"], &[]),
            // A summary of all scenes.
            (["lower\n1\n", "lower\n2\n"], &[], &["runs.csv: : lower is 1, committed 2"]),
            (["lower\n1\n", "lower\n2\n"], &["b"], &[]),
        ] {
            assert_eq!(differences("runs.csv", texts, skipped), expected, "{texts:?}");
        }
        assert!(differences("runs.csv", ["scene\na\n", rows], &[])[0].contains("columns"));
    }

    #[test]
    fn a_stale_resolved_spec_is_named_by_its_lines() {
        let [x, y, z] = ["x", "y", "z"].map(|name| format!("[[scenes]]\nname = '{name}'\n"));
        let texts = [format!("seed = 1\n{x}"), format!("seed = 2\n{x}{y}")];
        assert_eq!(
            differences("resolved.toml", texts.each_ref().map(String::as_str), &["y"]),
            ["resolved.toml: not committed: seed = 1", "resolved.toml: only committed: seed = 2"]
        );
        // Values exchanged between two tables are the same lines.
        let texts = [format!("{x}{z}"), format!("{z}{x}")];
        assert_eq!(
            differences("resolved.toml", texts.each_ref().map(String::as_str), &[]),
            ["resolved.toml: the same lines in another order or number"]
        );
    }
}
