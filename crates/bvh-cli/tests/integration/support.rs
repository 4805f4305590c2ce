//! The program `bvh` as a child process, and its reports on trees.
#![allow(dead_code, unused_imports)] // each test file uses some of it

#[path = "../../../bvh-scenes/tests/integration/glb.rs"]
mod glb;
#[path = "../program/mod.rs"]
mod program;

pub use glb::glb;
pub use program::*;
use std::collections::BTreeMap;
use std::path::Path;

const PROGRAM: &str = env!("CARGO_BIN_EXE_bvh");

/// Parses the facts that `inspect` and the readers print.
pub fn facts(text: &str) -> BTreeMap<String, String> {
    text.lines()
        .filter_map(|line| line.split_once(": "))
        .map(|(name, value)| (name.into(), value.into()))
        .collect()
}

/// Returns the internal area of the tree in a file, which `inspect` reports.
pub fn cost(folder: &Path, file: &str) -> f64 {
    facts(&said(folder, &["inspect", file]))["internal area"].parse().unwrap()
}

/// Returns a fact that is a number.
pub fn number(facts: &BTreeMap<String, String>, name: &str) -> f64 {
    facts[name].parse().unwrap()
}
