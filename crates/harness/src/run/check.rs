//! Compares fresh results with committed ones: the resolved spec line by line, and CSV files row by
//! row. Files with times and figures are not compared; `--redraw` makes figures again.

use crate::Error;
use crate::files::{self, read_toml, to_toml};
use csv::StringRecord;
use std::collections::BTreeSet;
use std::path::Path;
use toml::{Table, Value};

/// The number of differences per file that are listed; further ones are only counted.
const SHOWN: usize = 5;

/// A parsed CSV file.
struct Rows {
    header: StringRecord,
    records: Vec<StringRecord>,
}

/// Lists the differences between the folders `fresh` and `committed`, one line each.
///
/// The rows of `skipped_scenes` are not compared. If any scene was skipped, neither are the rows of
/// files without a column `scene`, which summarise all scenes.
pub fn compare(
    fresh: &Path,
    committed: &Path,
    skipped_scenes: &[String],
) -> Result<Vec<String>, Error> {
    let mut names = untimed_tables(fresh)?;
    if !committed.is_dir() {
        return Ok(vec![format!("{}: no committed results to compare with", committed.display())]);
    }
    names.extend(untimed_tables(committed)?);
    let mut differences = compare_specs(fresh, committed, skipped_scenes)?;
    for name in names {
        let fresh_file = fresh.join(&name);
        let committed_file = committed.join(&name);
        if !committed_file.is_file() {
            differences.push(format!("{name} is not among the committed results"));
        } else if !fresh_file.is_file() {
            differences.push(format!("{name} is committed but is no longer written"));
        } else {
            let fresh_rows = read_rows(&fresh_file, skipped_scenes)?;
            let committed_rows = read_rows(&committed_file, skipped_scenes)?;
            let all_scenes = skipped_scenes.is_empty();
            differences.extend(compare_rows(&name, &fresh_rows, &committed_rows, all_scenes));
        }
    }
    Ok(differences)
}

/// Compares the resolved specs line by line.
fn compare_specs(
    fresh: &Path,
    committed: &Path,
    skipped_scenes: &[String],
) -> Result<Vec<String>, Error> {
    let [fresh, committed] =
        [read_spec(fresh, skipped_scenes)?, read_spec(committed, skipped_scenes)?];
    let [now, then] = [&fresh, &committed].map(|text| text.lines().collect::<BTreeSet<_>>());
    let added = now.difference(&then).map(|line| format!("not committed: {line}"));
    let removed = then.difference(&now).map(|line| format!("only committed: {line}"));
    let mut differences: Vec<String> = added.chain(removed).collect();
    if differences.is_empty() && fresh != committed {
        differences.push("the same lines in another order or number".into());
    }
    Ok(shortened("resolved.toml", differences))
}

/// Returns the text of a resolved spec without the skipped scenes.
fn read_spec(folder: &Path, skipped_scenes: &[String]) -> Result<String, Error> {
    let mut spec: Table = read_toml(&folder.join("resolved.toml"))?;
    if let Some(Value::Array(scenes)) = spec.get_mut("scenes") {
        scenes.retain(|scene| {
            let name = scene.get("name").and_then(Value::as_str);
            !skipped_scenes.iter().any(|skipped| Some(skipped.as_str()) == name)
        });
    }
    to_toml(&spec)
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

/// Returns the names of the tables in a folder that hold no seconds.
fn untimed_tables(folder: &Path) -> Result<BTreeSet<String>, Error> {
    let mut names = files::names(folder)?;
    names.retain(|name| name.ends_with(".csv") && !name.starts_with("timing"));
    Ok(names)
}

fn compare_rows(name: &str, fresh: &Rows, committed: &Rows, all_scenes: bool) -> Vec<String> {
    let header = &fresh.header;
    // Rows that name no scene are about all scenes, and some are missing here.
    if !all_scenes && !header.iter().any(|column| column == "scene") {
        return vec![];
    }
    // Cells under different columns cannot be compared one by one.
    if *header != committed.header {
        let committed_header = &committed.header;
        return vec![format!("{name}: columns are {header:?}, committed {committed_header:?}")];
    }
    let mut differences = Vec::new();
    for (fresh_row, committed_row) in fresh.records.iter().zip(&committed.records) {
        for (column, (now, then)) in header.iter().zip(fresh_row.iter().zip(committed_row)) {
            if now != then {
                let row = identity(header, committed_row);
                differences.push(format!("{row}: {column} is {now}, committed {then}"));
            }
        }
    }
    let fresh_count = fresh.records.len();
    let committed_count = committed.records.len();
    if fresh_count != committed_count {
        differences.push(format!("{fresh_count} rows, committed {committed_count}"));
    }
    shortened(name, differences)
}

/// Returns the columns that identify a row: its scene, method and so on.
fn identity(header: &StringRecord, row: &StringRecord) -> String {
    let keys = ["scene", "method", "column", "quantity", "repetition", "trials", "evaluations"];
    let values = header.iter().zip(row).filter(|(column, _)| keys.contains(column));
    values.map(|(column, value)| format!("{column} {value}")).collect::<Vec<_>>().join(", ")
}

fn read_rows(path: &Path, skipped_scenes: &[String]) -> Result<Rows, Error> {
    // A row of another length is a difference to report, not an error.
    let bytes = bvh_scenes::files::read(path)?;
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(&bytes[..]);
    let header = reader.headers().map_err(Error::csv(path))?.clone();
    let mut records: Vec<StringRecord> =
        reader.records().collect::<Result<_, _>>().map_err(Error::csv(path))?;
    if let Some(scene_column) = header.iter().position(|column| column == "scene") {
        records.retain(|record| {
            let scene = record.get(scene_column);
            !skipped_scenes.iter().any(|skipped| Some(skipped.as_str()) == scene)
        });
    }
    Ok(Rows { header, records })
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
