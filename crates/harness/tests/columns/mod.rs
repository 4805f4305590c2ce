//! The dictionary of columns, `docs/evidence/COLUMNS.md`: what the comments on the fields of rows, and the
//! columns of queries in specs, say of the columns of committed CSV files.

use crate::support::{experiments, top};
use regex_lite::Regex;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

/// The columns of one kind of rows with their meanings, which may be empty.
type Kind = Vec<(String, String)>;

/// Returns the kinds of rows that a program declares.
fn declared(path: PathBuf) -> Vec<Kind> {
    let field = Regex::new(r"^ +(?:pub )?([a-z_0-9]+): [^;]+,$").unwrap();
    let (mut kinds, mut meaning): (Vec<Kind>, String) = Default::default();
    for line in fs::read_to_string(path).unwrap().lines() {
        if let Some(words) = line.trim().strip_prefix("/// ") {
            meaning.extend([words, " "]);
        } else if let Some(found) = field.captures(line).filter(|_| !kinds.is_empty()) {
            let kind = kinds.last_mut().unwrap();
            kind.push((found[1].into(), std::mem::take(&mut meaning).trim().into()));
        } else if !line.trim().starts_with("#[") {
            meaning.clear();
            kinds.extend(line.ends_with('{').then(Kind::new));
        }
    }
    kinds
}

/// Returns the columns of the queries of all specs, by file and name.
fn queried() -> BTreeMap<(String, String), String> {
    let mut found = BTreeMap::new();
    for (_, text) in experiments() {
        let spec: toml::Table = toml::from_str(&text).unwrap();
        let reports = spec.get("reports").and_then(toml::Value::as_array);
        for report in reports.into_iter().flatten().filter(|report| report.get("rows").is_some()) {
            for column in report["columns"].as_array().unwrap() {
                let text = |key| column.get(key).and_then(toml::Value::as_str);
                let ratio = match text("ratio") {
                    Some("over_base") => ", over the base's",
                    Some(_) => ", the base's over it",
                    None => "",
                };
                let meaning = format!("`{}`{ratio}", text("value").unwrap());
                let file = format!("{}.csv", report["file"].as_str().unwrap());
                found.insert((file, text("name").unwrap().into()), meaning);
            }
        }
    }
    found
}

/// Returns the page, given the columns of the committed files by their names.
pub fn page(headers: &BTreeMap<String, Vec<String>>) -> String {
    let source = top().join("crates/harness/src");
    let reports = source.join("report");
    let reports = crate::support::names(&reports).into_iter().map(|name| reports.join(name));
    let runs = declared(source.join("rows/mod.rs"));
    let others = [top().join("attic/src/rows.rs")].into_iter().chain(reports).flat_map(declared);
    let kinds: Vec<Kind> = runs.iter().cloned().chain(others).collect();
    let described = |kind: &Kind, column: &str| {
        kind.iter().find(|(name, meaning)| name == column && !meaning.is_empty()).cloned()
    };
    let queried = queried();
    let mut meanings: BTreeMap<(String, String), BTreeSet<&str>> = BTreeMap::new();
    for (file, columns) in headers {
        // Columns that a kind does not describe, and those that a query groups by, are runs'.
        let is_of =
            |kind: &&Kind| kind.len() > 2 && kind.iter().all(|(name, _)| columns.contains(name));
        let own = kinds.iter().filter(is_of).max_by_key(|kind| kind.len());
        if own.is_none() && queried.keys().all(|(of, _)| of != file) {
            continue;
        }
        for column in columns {
            let query = queried.get(&(file.clone(), column.clone()));
            let query = query.map(|meaning| (column.clone(), meaning.clone()));
            let declared = || own.into_iter().chain(&runs).find_map(|kind| described(kind, column));
            if let Some(meaning) = query.or_else(declared) {
                meanings.entry(meaning).or_default().insert(file);
            } else {
                let is_own = own.is_some_and(|kind| kind.iter().any(|(name, _)| name == column));
                assert!(!is_own, "the rows of {file} have no comment `///` on {column}");
            }
        }
    }
    let mut page = String::from(
        "# Columns

Made by `UPDATE_DOCS=1 cargo test -p harness --test docs` of the comments on rows in the program and
of the queries in specs. Query columns with `_low` and `_high` end the interval of the one without,
`_verdict` judges it, and `paper_` is the paper's number. Files that a script or an experiment by
hand has left have further columns, which the text beside them describes.

| column | meaning | files |
|---|---|---|
",
    );
    for ((column, meaning), files) in meanings {
        let files: Vec<String> = files.iter().map(|file| format!("`{file}`")).collect();
        let files = if files.len() > 6 { "many".into() } else { files.join(", ") };
        page += &format!("| `{column}` | {meaning} | {files} |\n");
    }
    page
}
