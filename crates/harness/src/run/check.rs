//! Compares fresh results with committed ones: the resolved spec key by key, every CSV file but the timing ones row by row,
//! and every figure but the timing ones byte by byte.

use crate::Error;
use bvh_scenes::read_text;
use bvh_terminal::files;
use csv::StringRecord;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use toml::{Table, Value};

/// Differences beyond this many per file are only counted.
const SHOWN: usize = 5;

/// Lists how the resolved spec, the CSV files and, if they are kept, the figures in `fresh` differ from those in `committed`,
/// one line each. Rows of the scenes in `left_out` are not compared. If any scene is left out, neither are figures and the
/// rows of files without a column `scene`, which summarise all scenes.
pub fn compare(
    fresh: &Path,
    committed: &Path,
    left_out: &[String],
    has_figures: bool,
) -> Result<Vec<String>, Error> {
    let mut names = results(fresh, ".csv")?;
    if !committed.is_dir() {
        return Ok(vec![format!("{}: no committed results to compare with", committed.display())]);
    }
    names.extend(results(committed, ".csv")?);
    let mut differences = compare_specs(fresh, committed, left_out)?;
    for name in names {
        let paths = [fresh.join(&name), committed.join(&name)];
        match [paths[0].is_file(), paths[1].is_file()] {
            [true, true] => {
                differences.extend(compare_files(&name, &paths[0], &paths[1], left_out)?)
            }
            [true, false] => differences.push(format!("{name} is not among the committed results")),
            _ => differences.push(format!("{name} is committed but is no longer written")),
        }
    }
    if has_figures && left_out.is_empty() {
        differences.extend(compare_figures(fresh, committed)?);
    }
    Ok(differences)
}

/// How the figures differ: those of the committed results that hold no seconds are to have the same bytes.
fn compare_figures(fresh: &Path, committed: &Path) -> Result<Vec<String>, Error> {
    let mut all = results(fresh, ".svg")?;
    all.extend(results(committed, ".svg")?);
    let difference = |name: String| {
        let read = |folder: &Path| fs::read(folder.join(&name)).ok();
        match (read(fresh), read(committed)) {
            (Some(now), Some(then)) if now == then => None,
            (Some(_), Some(_)) => {
                Some(format!("{name} is drawn otherwise than the committed figure"))
            }
            (Some(_), None) => Some(format!("{name} is not among the committed results")),
            (None, _) => Some(format!("{name} is committed but is no longer drawn")),
        }
    };
    Ok(all.into_iter().filter_map(difference).collect())
}

/// How the resolved specs differ.
fn compare_specs(
    fresh: &Path,
    committed: &Path,
    left_out: &[String],
) -> Result<Vec<String>, Error> {
    let read = |folder: &Path| -> Result<Value, Error> {
        let path = folder.join("resolved.toml");
        let mut table: Table = toml::from_str(&read_text(&path)?).map_err(Error::toml(&path))?;
        if let Some(Value::Array(scenes)) = table.get_mut("scenes") {
            let name = |scene: &Value| {
                scene
                    .get("name")
                    .and_then(Value::as_str)
                    .unwrap_or_default()
                    .to_owned()
            };
            scenes.retain(|scene| !left_out.contains(&name(scene)));
        }
        Ok(Value::Table(table))
    };
    let mut differences = Vec::new();
    compare_values("", &read(fresh)?, &read(committed)?, &mut differences);
    Ok(shortened("resolved.toml", differences))
}

fn compare_values(key: &str, fresh: &Value, committed: &Value, differences: &mut Vec<String>) {
    match (fresh, committed) {
        (Value::Table(fresh), Value::Table(committed)) => {
            let names: BTreeSet<&String> = fresh.keys().chain(committed.keys()).collect();
            for name in names {
                let key = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
                match (fresh.get(name), committed.get(name)) {
                    (Some(fresh), Some(committed)) => {
                        compare_values(&key, fresh, committed, differences)
                    }
                    (Some(fresh), None) => {
                        differences.push(format!("{key} is {fresh}, not committed"))
                    }
                    (None, _) => {
                        differences.push(format!("{key} is committed, but is no key any more"))
                    }
                }
            }
        }
        (Value::Array(fresh), Value::Array(committed)) if fresh.len() == committed.len() => {
            for (at, (fresh, committed)) in fresh.iter().zip(committed).enumerate() {
                compare_values(&format!("{key}[{at}]"), fresh, committed, differences);
            }
        }
        _ if fresh == committed => {}
        _ => differences.push(format!("{key} is {fresh}, committed {committed}")),
    }
}

/// The first differences in a file, and how many more there are.
fn shortened(file: &str, mut differences: Vec<String>) -> Vec<String> {
    let more = differences.len().saturating_sub(SHOWN);
    differences.truncate(SHOWN);
    if more > 0 {
        differences.push(format!("and {more} more"));
    }
    differences
        .into_iter()
        .map(|difference| format!("{file}: {difference}"))
        .collect()
}

/// The files of a folder whose names end so, without those that hold seconds, as their names say.
fn results(folder: &Path, end: &str) -> Result<BTreeSet<String>, Error> {
    let mut names = files::names(folder)?;
    names.retain(|name| name.ends_with(end) && !name.starts_with("timing"));
    Ok(names)
}

fn compare_files(
    name: &str,
    fresh: &Path,
    committed: &Path,
    left_out: &[String],
) -> Result<Vec<String>, Error> {
    let (header, fresh) = read(fresh, left_out)?;
    let (committed_header, committed) = read(committed, left_out)?;
    // Rows that name no scene are about all scenes, of which some are missing here.
    if !left_out.is_empty() && !header.iter().any(|column| column == "scene") {
        return Ok(Vec::new());
    }
    if header != committed_header {
        return Ok(vec![format!("{name}: columns are {header:?}, committed {committed_header:?}")]);
    }
    if !left_out.is_empty() && !header.iter().any(|column| column == "scene") {
        return Ok(Vec::new());
    }
    let mut differences: Vec<String> = fresh
        .iter()
        .zip(&committed)
        .flat_map(|(fresh, committed)| {
            let columns = header.iter().zip(fresh.iter().zip(committed));
            columns
                .filter(|(_, (now, then))| now != then)
                .map(|(column, (now, then))| {
                    format!("{}: {column} is {now}, committed {then}", identity(&header, committed))
                })
        })
        .collect();
    if fresh.len() != committed.len() {
        differences.push(format!("{} rows, committed {}", fresh.len(), committed.len()));
    }
    Ok(shortened(name, differences))
}

/// What a row is about: its scene, method and so on.
fn identity(header: &StringRecord, row: &StringRecord) -> String {
    let keys = ["scene", "method", "column", "quantity", "repetition", "trials", "evaluations"];
    let values = header
        .iter()
        .zip(row)
        .filter(|(column, _)| keys.contains(column));
    values
        .map(|(column, value)| format!("{column} {value}"))
        .collect::<Vec<_>>()
        .join(", ")
}

fn read(path: &Path, left_out: &[String]) -> Result<(StringRecord, Vec<StringRecord>), Error> {
    let mut reader = csv::ReaderBuilder::new()
        .flexible(true)
        .from_path(path)
        .map_err(Error::csv(path))?;
    let header = reader
        .headers()
        .map_err(Error::csv(path))?
        .clone();
    let scene = header.iter().position(|column| column == "scene");
    let rows: Vec<StringRecord> = reader
        .records()
        .collect::<Result<_, _>>()
        .map_err(Error::csv(path))?;
    let is_left_out = |row: &StringRecord| {
        scene
            .and_then(|at| row.get(at))
            .is_some_and(|name| left_out.iter().any(|out| out == name))
    };
    Ok((
        header,
        rows.into_iter()
            .filter(|row| !is_left_out(row))
            .collect(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn differences(fresh: &str, committed: &str, left_out: &[String]) -> Vec<String> {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        fs::write(folders[0].path().join("runs.csv"), fresh).unwrap();
        fs::write(folders[1].path().join("runs.csv"), committed).unwrap();
        fs::write(folders[0].path().join("timing.csv"), "seconds\n1\n").unwrap();
        for folder in &folders {
            fs::write(folder.path().join("resolved.toml"), "").unwrap();
        }
        compare(folders[0].path(), folders[1].path(), left_out, true).unwrap()
    }

    const COMMITTED: &str = "scene,method,cost\na,m,1.5\nb,m,2.5\n";

    #[test]
    fn a_summary_of_all_scenes_is_compared_only_if_all_scenes_are_there() {
        let fresh = "answer\nlower on 1 of 1 scenes\n";
        let committed = "answer\nlower on 2 of 2 scenes\n";
        assert_eq!(differences(fresh, committed, &["b".to_owned()]), Vec::<String>::new());
        assert_eq!(differences(fresh, committed, &[]).len(), 1);
    }

    #[test]
    fn equal_rows_do_not_differ() {
        assert_eq!(differences(COMMITTED, COMMITTED, &[]), Vec::<String>::new());
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
        let answers = ["answer\nyes\n", "answer\nno\n"];
        assert_eq!(differences(answers[0], answers[1], &[]).len(), 1);
        assert!(differences(answers[0], answers[1], &["b".into()]).is_empty());
    }

    #[test]
    fn a_figure_that_is_drawn_otherwise_is_named_unless_it_shows_seconds_or_lacks_a_scene() {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        for (folder, text) in folders.iter().zip(["<svg/>", "<svg></svg>"]) {
            fs::write(folder.path().join("resolved.toml"), "").unwrap();
            for name in ["trials.svg", "timing_trials.svg"] {
                fs::write(folder.path().join(name), text).unwrap();
            }
        }
        let found = |left_out: &[String], has_figures| {
            compare(folders[0].path(), folders[1].path(), left_out, has_figures).unwrap()
        };
        assert_eq!(found(&[], true), ["trials.svg is drawn otherwise than the committed figure"]);
        assert!(found(&["sponza".into()], true).is_empty() && found(&[], false).is_empty());
        fs::write(folders[1].path().join("trials.svg"), "<svg/>").unwrap();
        assert!(found(&[], true).is_empty());
        fs::remove_file(folders[0].path().join("trials.svg")).unwrap();
        assert_eq!(found(&[], true), ["trials.svg is committed but is no longer drawn"]);
    }

    #[test]
    fn a_stale_resolved_spec_is_named_by_its_keys() {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let write = |at: usize, text: &str| {
            fs::write(folders[at].path().join("resolved.toml"), text).unwrap()
        };
        write(0, "[experiment]\nseed = 1\nm = [{ a = 1 }]\n[[scenes]]\nname = 'x'\n");
        write(
            1,
            "[experiment]\nold = 1\nm = [{ a = 2 }]\n[[scenes]]\nname = 'x'\n[[scenes]]\nname = 'y'\n",
        );
        let found = compare(folders[0].path(), folders[1].path(), &["y".into()], true).unwrap();
        assert_eq!(
            found,
            [
                "resolved.toml: experiment.m[0].a is 1, committed 2",
                "resolved.toml: experiment.old is committed, but is no key any more",
                "resolved.toml: experiment.seed is 1, not committed",
            ]
        );
    }
}
