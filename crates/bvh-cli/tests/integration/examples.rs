//! The examples in the documentation that call `bvh` or describe rays for it.

#[path = "../program/pages.rs"]
mod pages;
use crate::support::bvh;
use pages::{accepts_printed_commands, blocks_in};
use std::fs;
use std::path::Path;
use std::process::Command;

#[test]
fn a_bake_accepts_every_printed_description_of_rays() {
    let mut descriptions = 0;
    for block in blocks_in("toml").into_iter().filter(|block| block.text.contains("cameras = ")) {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("rays.toml"), &block.text).unwrap();
        bvh(folder.path(), "bake escher:60 --budget=1kwork --rays=rays.toml --out=x.bvh");
        descriptions += 1;
    }
    assert!(descriptions > 0);
}

#[test]
fn the_program_accepts_every_printed_command() {
    assert!(accepts_printed_commands("bvh", "bvh-cli") > 5);
}

/// A court of four walls, each a closed box, that stands obliquely.
fn court() -> String {
    let boxes = [[0, 0, 9, 1], [0, 8, 9, 9], [0, 1, 1, 8], [8, 1, 9, 8]];
    let mut text = String::new();
    for [left, front, right, back] in boxes {
        for corner in 0..8 {
            let [x, y] = [[left, right][corner & 1], [front, back][corner >> 1 & 1]].map(f64::from);
            let [x, y] = [0.6 * x - 0.8 * y, 0.8 * x + 0.6 * y];
            text += &format!("v {x} {y} {}\n", corner >> 2 & 1);
        }
        for face in ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"] {
            let from_end = |corner: &str| (corner.parse::<i32>().unwrap() - 9).to_string();
            text += &format!("f {}\n", face.split(' ').map(from_end).collect::<Vec<_>>().join(" "));
        }
    }
    text
}

#[test]
fn the_commands_of_the_cookbook_run_as_they_are_printed() {
    if cfg!(windows) {
        eprintln!("not tried: this system has no sh");
        return;
    }
    let programs = Path::new(env!("CARGO_BIN_EXE_bvh")).parent().unwrap();
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap());
    let mut recipes = 0;
    for block in blocks_in("sh").into_iter().filter(|block| block.page.ends_with("COOKBOOK.md")) {
        let folder = tempfile::tempdir().unwrap();
        for name in ["city.obj", "house.obj", "scene.obj"] {
            fs::write(folder.path().join(name), court()).unwrap();
        }
        let mut shell = Command::new("sh");
        shell.args(["-ec", &block.text]).env("PATH", &path).current_dir(folder.path());
        let answer = shell.output().unwrap();
        let message = String::from_utf8_lossy(&answer.stderr);
        assert!(answer.status.success(), "{}: {message}", block.place());
        for (_, after) in block.text.lines().filter_map(|line| line.split_once("--out ")) {
            let file = folder.path().join(after.split(' ').next().unwrap());
            assert!(file.is_file(), "{}: {message}", file.display());
        }
        recipes += 1;
    }
    assert!(recipes > 3);
}
