//! Compares fresh results with committed ones: the resolved spec key by key, CSV files row by row,
//! and figures byte by byte. Files with times are not compared.

use super::resolved::read_toml;
use crate::Error;
use crate::files;
use crate::report::overview;
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
/// The rows of `skipped_scenes` are not compared. If any scene was skipped, neither are figures,
/// nor the rows of files without a column `scene`, which summarise all scenes.
pub fn compare(
    fresh: &Path,
    committed: &Path,
    skipped_scenes: &[String],
    has_figures: bool,
) -> Result<Vec<String>, Error> {
    let mut names = untimed_files(fresh, ".csv")?;
    if !committed.is_dir() {
        return Ok(vec![format!("{}: no committed results to compare with", committed.display())]);
    }
    names.extend(untimed_files(committed, ".csv")?);
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
    if has_figures && skipped_scenes.is_empty() {
        differences.extend(compare_figures(fresh, committed)?);
    }
    Ok(differences)
}

/// Compares the bytes of all figures that show no seconds.
fn compare_figures(fresh: &Path, committed: &Path) -> Result<Vec<String>, Error> {
    let mut names = untimed_files(fresh, ".svg")?;
    names.extend(untimed_files(committed, ".svg")?);
    let mut differences = Vec::new();
    for name in names {
        let fresh_bytes = bvh_scenes::files::read(&fresh.join(&name)).ok();
        let committed_bytes = bvh_scenes::files::read(&committed.join(&name)).ok();
        if fresh_bytes == committed_bytes {
            continue;
        }
        differences.push(if fresh_bytes.is_none() {
            format!("{name} is committed but is no longer drawn")
        } else if committed_bytes.is_none() {
            format!("{name} is not among the committed results")
        } else {
            format!("{name} differs from the committed figure")
        });
    }
    Ok(differences)
}

/// Compares the resolved specs key by key.
fn compare_specs(
    fresh: &Path,
    committed: &Path,
    skipped_scenes: &[String],
) -> Result<Vec<String>, Error> {
    let fresh_spec = Value::Table(read_spec(fresh, skipped_scenes)?);
    let committed_spec = Value::Table(read_spec(committed, skipped_scenes)?);
    let mut differences = Vec::new();
    compare_values("", &fresh_spec, &committed_spec, &mut differences);
    Ok(shortened("resolved.toml", differences))
}

fn read_spec(folder: &Path, skipped_scenes: &[String]) -> Result<Table, Error> {
    let mut spec: Table = read_toml(&folder.join("resolved.toml"))?;
    if let Some(Value::Array(scenes)) = spec.get_mut("scenes") {
        scenes.retain(|scene| {
            let name = scene.get("name").and_then(Value::as_str);
            !skipped_scenes.iter().any(|skipped| Some(skipped.as_str()) == name)
        });
    }
    Ok(spec)
}

fn compare_values(key: &str, fresh: &Value, committed: &Value, differences: &mut Vec<String>) {
    match (fresh, committed) {
        (Value::Table(fresh_table), Value::Table(committed_table)) => {
            let names: BTreeSet<&String> =
                fresh_table.keys().chain(committed_table.keys()).collect();
            for name in names {
                // The full path of a key is what its author searches for.
                let key = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
                match (fresh_table.get(name), committed_table.get(name)) {
                    (Some(fresh), Some(committed)) => {
                        compare_values(&key, fresh, committed, differences)
                    }
                    (Some(fresh), None) => {
                        differences.push(format!("{key} is {fresh}, not committed"))
                    }
                    (None, _) => {
                        differences.push(format!("{key} is committed but is no longer a key"))
                    }
                }
            }
        }
        (Value::Array(fresh_values), Value::Array(committed_values))
            if fresh_values.len() == committed_values.len() =>
        {
            for (index, fresh) in fresh_values.iter().enumerate() {
                let key = format!("{key}[{index}]");
                compare_values(&key, fresh, &committed_values[index], differences);
            }
        }
        _ if fresh == committed => {}
        _ => differences.push(format!("{key} is {fresh}, committed {committed}")),
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

/// Returns the names in a folder that end with `suffix`, without the files that hold seconds.
fn untimed_files(folder: &Path, suffix: &str) -> Result<BTreeSet<String>, Error> {
    let mut names = files::names(folder)?;
    let overview = format!("{}.svg", overview::FIGURE);
    let is_timed = |name: &str| name.starts_with("timing") || name == overview;
    names.retain(|name| name.ends_with(suffix) && !is_timed(name));
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

    fn differences(fresh: &str, committed: &str, skipped_scenes: &[String]) -> Vec<String> {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        fs::write(folders[0].path().join("runs.csv"), fresh).unwrap();
        fs::write(folders[1].path().join("runs.csv"), committed).unwrap();
        fs::write(folders[0].path().join("timing.csv"), "seconds\n1\n").unwrap();
        for folder in &folders {
            fs::write(folder.path().join("resolved.toml"), "").unwrap();
        }
        compare(folders[0].path(), folders[1].path(), skipped_scenes, true).unwrap()
    }

    const COMMITTED: &str = "scene,method,cost\na,m,1.5\nb,m,2.5\n";

    #[test]
    fn a_summary_of_all_scenes_is_compared_only_without_skipped_scenes() {
        let fresh = "lower\n1\n";
        let committed = "lower\n2\n";
        assert_eq!(differences(fresh, committed, &["b".to_owned()]), Vec::<String>::new());
        assert_eq!(differences(fresh, committed, &[]).len(), 1);
    }

    #[test]
    fn an_altered_number_is_named_with_scene_method_and_both_values() {
        let altered = COMMITTED.replace("2.5", "2.6");
        assert_eq!(
            differences(&altered, COMMITTED, &[]),
            ["runs.csv: scene b, method m: cost is 2.6, committed 2.5"]
        );
    }

    #[test]
    fn missing_rows_and_columns_are_named() {
        let fewer = "scene,method,cost\na,m,1.5\n";
        assert_eq!(differences(fewer, COMMITTED, &[]), ["runs.csv: 1 rows, committed 2"]);
        assert_eq!(differences(fewer, COMMITTED, &["b".into()]), Vec::<String>::new());
        assert!(differences("scene\na\n", COMMITTED, &[])[0].contains("columns"));
    }

    #[test]
    fn an_altered_figure_is_named_unless_it_shows_seconds_or_lacks_a_scene() {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        for (folder, text) in folders.iter().zip(["<svg/>", "<svg></svg>"]) {
            fs::write(folder.path().join("resolved.toml"), "").unwrap();
            for name in ["trials.svg", "timing_trials.svg"] {
                fs::write(folder.path().join(name), text).unwrap();
            }
        }
        let found = |skipped_scenes: &[String], has_figures| {
            compare(folders[0].path(), folders[1].path(), skipped_scenes, has_figures).unwrap()
        };
        assert_eq!(found(&[], true), ["trials.svg differs from the committed figure"]);
        assert!(found(&["sponza".into()], true).is_empty() && found(&[], false).is_empty());
        fs::write(folders[1].path().join("trials.svg"), "<svg/>").unwrap();
        assert!(found(&[], true).is_empty());
        fs::remove_file(folders[0].path().join("trials.svg")).unwrap();
        assert_eq!(found(&[], true), ["trials.svg is committed but is no longer drawn"]);
    }

    #[test]
    fn a_stale_resolved_spec_is_named_by_its_keys() {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let specs = [
            "[experiment]\nseed = 1\nm = [{ a = 1 }]\n[[scenes]]\nname = 'x'\n",
            "[experiment]\nold = 1\nm = [{ a = 2 }]\n\
             [[scenes]]\nname = 'x'\n[[scenes]]\nname = 'y'\n",
        ];
        for (folder, spec) in folders.iter().zip(specs) {
            fs::write(folder.path().join("resolved.toml"), spec).unwrap();
        }
        let found = compare(folders[0].path(), folders[1].path(), &["y".into()], true).unwrap();
        assert_eq!(
            found,
            [
                "resolved.toml: experiment.m[0].a is 1, committed 2",
                "resolved.toml: experiment.old is committed but is no longer a key",
                "resolved.toml: experiment.seed is 1, not committed",
            ]
        );
    }
}
