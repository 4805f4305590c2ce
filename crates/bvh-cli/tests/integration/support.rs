//! The program `bvh` as a child process, by its command lines.
#![allow(dead_code, unused_imports)] // each test file uses some of it

#[path = "../program/mod.rs"]
mod program;

use glam::DVec3;
pub use program::*;
use serde_json::{Map, Value};
use std::path::Path;

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_bvh");

pub fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// Runs a command that must succeed, and returns its standard output.
pub fn bvh(at: &Path, line: &str) -> String {
    said(at, &words(line))
}

/// Runs a command that must be rejected with each of the parts on standard error and no result.
pub fn wrong(at: &Path, line: &str, parts: &[&str]) {
    let output = run(at, &words(line));
    ended(&output, 2, parts);
    assert!(output.stdout.is_empty(), "{line}: {}", text(&output.stdout));
}

/// Returns an OBJ file of triangles.
pub fn obj(triangles: impl IntoIterator<Item = [DVec3; 3]>) -> String {
    let mut text = String::new();
    for corners in triangles {
        for DVec3 { x, y, z } in corners {
            text += &format!("v {x} {y} {z}\n");
        }
        text += "f -3 -2 -1\n";
    }
    text
}

/// Returns the results of a command, with all digits.
pub fn facts(at: &Path, line: &str) -> Map<String, Value> {
    serde_json::from_str(&bvh(at, &format!("{line} --json"))).unwrap()
}

pub fn number(at: &Path, line: &str, name: &str) -> f64 {
    facts(at, line)[name].as_f64().unwrap()
}

pub fn cost(at: &Path, file: &str) -> f64 {
    number(at, &format!("inspect {file}"), "area")
}
