//! The harness as a child process, its specs, and what it leaves in a folder.
#![allow(dead_code, unused_imports)] // each test file uses some of it

#[path = "../../../bvh-cli/tests/program/mod.rs"]
mod program;

use bvh_core::Bvh;
use bvh_core::file::{self, Origin};
use bvh_scenes::Scene;
use harness::report::query::Row;
pub use program::*;
use std::fs;
use std::path::Path;

const PROGRAM: &str = env!("CARGO_BIN_EXE_harness");

/// A spec whose report is a table of the paper.
pub const TABLE: &str = "
question = 'Do results survive?'
scenes = ['escher:300', 'pinecon2:300']
repetitions = 3
methods = [
    { label = 'greedy', method = 'muller_fellner' },
    { label = 'noise', method = 'grasp', trials = 12, noise = 0.1 },
    { label = 'k', method = 'grasp', trials = 6, candidates = { k_best = 5 } },
]

[[reports]]
kind = 'trials'
methods = ['noise']
best_of = 5
counts = [5]

[[reports]]
kind = 'query'
source = 'Test'
title = 'a table'
file = 'table'
rows = 'trials.csv'
by = ['scene', 'trials']
columns = [
    { name = 'cost', value = 'only median_over_base', paper = [{ row = 'scene=pinecon2:300', value = 0.9 }] },
]
[reports.figure]
x = 'cost'
y = 'scene'

[quick]
scenes = ['escher:300']
repetitions = 1
";

/// Performs every `of`-th run that the harness lists for a spec, from the `number`-th on, as one
/// of several processes would.
pub fn part(dir: &Path, spec: &str, number: usize, of: usize, more: &[&str]) {
    let part = of_part(dir, spec, number, of);
    let part = part.iter().map(String::as_str);
    said(dir, &[spec].into_iter().chain(part).chain(more.iter().copied()).collect::<Vec<_>>());
}

/// The arguments that select this part.
pub fn of_part(dir: &Path, spec: &str, number: usize, of: usize) -> Vec<String> {
    let list = said(dir, &["jobs", spec]);
    let ids = list.lines().filter_map(|line| line.split(' ').next());
    ids.skip(number).step_by(of).map(|id| format!("--run={id}")).collect()
}

/// The committed specs, each with its name and text, in the order of their names.
pub fn experiments() -> Vec<(String, String)> {
    let folder = top().join("experiments");
    let read = |file: String| {
        (file.trim_end_matches(".toml").into(), fs::read_to_string(folder.join(file)).unwrap())
    };
    names(&folder).into_iter().map(read).collect()
}

/// A page of the documentation is what it is made to be by the test `by`, which rewrites it where
/// `UPDATE_DOCS` is set.
pub fn assert_current(path: &Path, made: &str, by: &str) {
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(path, made).unwrap();
    }
    let text = fs::read_to_string(path).unwrap_or_default();
    let differs = text.lines().zip(made.lines()).find(|(now, then)| now != then);
    let stale = path.display();
    assert!(
        text == made,
        "{stale} is stale: {differs:?}; UPDATE_DOCS=1 cargo test -p harness --test {by} rewrites it"
    );
}

/// The CSV files without seconds, by name, and the resolved spec.
pub fn reproducible(folder: &Path) -> Vec<(String, Vec<u8>)> {
    names(folder)
        .into_iter()
        .filter(|name| {
            (name.ends_with(".csv") && !name.starts_with("timing")) || name == "resolved.toml"
        })
        .map(|name| (name.clone(), fs::read(folder.join(name)).unwrap()))
        .collect()
}

/// The rows of a CSV file by column names.
pub fn rows(path: &Path) -> Vec<Row> {
    harness::rows::read(path).unwrap()
}

/// Saves a tree over the scene's objects in a file.
pub fn save(tree: &Bvh, scene: &Scene, path: &Path) {
    let origin = Origin { method: "test", ..Origin::default() };
    fs::write(path, file::save(tree, &scene.boxes, &origin).unwrap()).unwrap();
}
