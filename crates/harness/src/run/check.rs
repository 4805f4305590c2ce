//! Compares fresh results with committed ones: the resolved spec line by line, and CSV files row by
//! row. Files with times and figures are not compared; `--redraw` makes figures again.

use crate::files::{self, read_toml};
use crate::report::query::Row;
use crate::{Error, rows};
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
                let found = row_differences(now, then, skipped_scenes);
                differences.extend(shortened(name, found));
            }
            (Some(_), None) => {
                differences.push(format!("{name} is not among the committed results"));
            }
            _ => differences.push(format!("{name} is committed but is no longer written")),
        }
    }
    Ok(differences)
}

fn spec(folder: &Path, skipped_scenes: &[String]) -> Result<String, Error> {
    let mut spec: Table = read_toml(&folder.join("resolved.toml"))?;
    if let Some(Value::Array(scenes)) = spec.get_mut("scenes") {
        let is_kept = |name: &str| skipped_scenes.iter().all(|skipped| skipped != name);
        scenes.retain(|scene| scene.get("name").and_then(Value::as_str).is_none_or(is_kept));
    }
    Ok(spec.to_string())
}

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

/// Reads the tables in a folder that hold no seconds, by their names, without the skipped scenes.
fn tables(folder: &Path, skipped_scenes: &[String]) -> Result<BTreeMap<String, Vec<Row>>, Error> {
    let mut tables = BTreeMap::new();
    for name in files::names(folder)? {
        if !name.ends_with(".csv") || name.starts_with("timing") {
            continue;
        }
        let mut rows: Vec<Row> = rows::read(&folder.join(&name))?;
        rows.retain(|row| row.get("scene").is_none_or(|scene| !skipped_scenes.contains(scene)));
        tables.insert(name, rows);
    }
    Ok(tables)
}

/// Compares the rows of a file cell by cell.
fn row_differences(fresh: &[Row], committed: &[Row], skipped_scenes: &[String]) -> Vec<String> {
    let mut differences = Vec::new();
    if let Some((now, then)) = fresh.first().zip(committed.first()) {
        // Rows that name no scene are about all scenes, and some are missing here.
        if !skipped_scenes.is_empty() && !now.contains_key("scene") {
            return differences;
        }
        // Cells under different columns cannot be compared one by one.
        if !now.keys().eq(then.keys()) {
            let [now, then] = [now, then].map(|row| row.keys().collect::<Vec<_>>());
            return vec![format!("columns are {now:?}, committed {then:?}")];
        }
    }
    for (now, then) in fresh.iter().zip(committed) {
        for ((column, now), then_is) in now.iter().zip(then.values()) {
            if now != then_is {
                let row = identity(then);
                differences.push(format!("{row}: {column} is {now}, committed {then_is}"));
            }
        }
    }
    let (now, then) = (fresh.len(), committed.len());
    if now != then {
        differences.push(format!("{now} rows, committed {then}"));
    }
    differences
}

/// Returns the columns that identify a row: its scene, method and so on.
fn identity(row: &Row) -> String {
    let keys = ["scene", "method", "quantity", "repetition", "trials", "evaluations"];
    let values = row.iter().filter(|(column, _)| keys.contains(&column.as_str()));
    values.map(|(column, value)| format!("{column} {value}")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

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
