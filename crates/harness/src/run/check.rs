//! Compares fresh results with committed ones: every CSV file but the timing ones, row by row.

use crate::Error;
use csv::StringRecord;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Differences beyond this many per file are only counted.
const SHOWN: usize = 5;

/// Lists how the CSV files in `fresh` differ from those in `committed`, one line each. Rows of the scenes in
/// `left_out` are not compared.
pub fn compare(fresh: &Path, committed: &Path, left_out: &[String]) -> Result<Vec<String>, Error> {
    let mut names = csv_names(fresh)?;
    if !committed.is_dir() {
        return Ok(vec![format!("{}: no committed results to compare with", committed.display())]);
    }
    names.extend(csv_names(committed)?);
    let mut differences = Vec::new();
    for name in names {
        let paths = [fresh.join(&name), committed.join(&name)];
        match [paths[0].is_file(), paths[1].is_file()] {
            [true, true] => differences.extend(compare_files(&name, &paths[0], &paths[1], left_out)?),
            [true, false] => differences.push(format!("{name} is not among the committed results")),
            _ => differences.push(format!("{name} is committed but is no longer written")),
        }
    }
    Ok(differences)
}

/// The CSV files of a folder that do not hold seconds.
fn csv_names(folder: &Path) -> Result<BTreeSet<String>, Error> {
    let entries = fs::read_dir(folder).map_err(Error::io(folder, "read the folder"))?;
    let names = entries.filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()));
    Ok(names.filter(|name| name.ends_with(".csv") && !name.starts_with("timing")).collect())
}

fn compare_files(
    name: &str,
    fresh: &Path,
    committed: &Path,
    left_out: &[String],
) -> Result<Vec<String>, Error> {
    let (header, fresh) = read(fresh, left_out)?;
    let (committed_header, committed) = read(committed, left_out)?;
    if header != committed_header {
        return Ok(vec![format!("{name}: columns are {header:?}, committed {committed_header:?}")]);
    }
    let mut differences: Vec<String> = fresh
        .iter()
        .zip(&committed)
        .flat_map(|(fresh, committed)| {
            let columns = header.iter().zip(fresh.iter().zip(committed));
            columns.filter(|(_, (now, then))| now != then).map(|(column, (now, then))| {
                format!("{name}: {}: {column} is {now}, committed {then}", identity(&header, committed))
            })
        })
        .collect();
    if fresh.len() != committed.len() {
        differences.push(format!("{name}: {} rows, committed {}", fresh.len(), committed.len()));
    }
    if differences.len() > SHOWN {
        let more = differences.len() - SHOWN;
        differences.truncate(SHOWN);
        differences.push(format!("{name}: and {more} more"));
    }
    Ok(differences)
}

/// What a row is about: its scene, method and so on.
fn identity(header: &StringRecord, row: &StringRecord) -> String {
    let keys = ["scene", "method", "column", "quantity", "repetition", "trials", "evaluations"];
    let values = header.iter().zip(row).filter(|(column, _)| keys.contains(column));
    values.map(|(column, value)| format!("{column} {value}")).collect::<Vec<_>>().join(", ")
}

fn read(path: &Path, left_out: &[String]) -> Result<(StringRecord, Vec<StringRecord>), Error> {
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_path(path).map_err(Error::csv(path))?;
    let header = reader.headers().map_err(Error::csv(path))?.clone();
    let scene = header.iter().position(|column| column == "scene");
    let rows: Vec<StringRecord> = reader.records().collect::<Result<_, _>>().map_err(Error::csv(path))?;
    let is_left_out = |row: &StringRecord| {
        scene.and_then(|at| row.get(at)).is_some_and(|name| left_out.iter().any(|out| out == name))
    };
    Ok((header, rows.into_iter().filter(|row| !is_left_out(row)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn differences(fresh: &str, committed: &str, left_out: &[String]) -> Vec<String> {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        fs::write(folders[0].path().join("runs.csv"), fresh).unwrap();
        fs::write(folders[1].path().join("runs.csv"), committed).unwrap();
        fs::write(folders[0].path().join("timing.csv"), "seconds\n1\n").unwrap();
        compare(folders[0].path(), folders[1].path(), left_out).unwrap()
    }

    const COMMITTED: &str = "scene,method,cost\na,m,1.5\nb,m,2.5\n";

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
    }
}
