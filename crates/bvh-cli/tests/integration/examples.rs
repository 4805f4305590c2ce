//! The examples in the documentation that call `bvh` or describe rays for it.

#[path = "../program/pages.rs"]
mod pages;
use crate::support::{bvh, obj};
use bvh_scenes::Scene;
use glam::DMat3;
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

#[test]
fn the_commands_of_the_cookbook_run_as_they_are_printed() {
    if cfg!(windows) {
        eprintln!("not tried: this system has no sh");
        return;
    }
    let programs = Path::new(env!("CARGO_BIN_EXE_bvh")).parent().unwrap();
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap());
    // A building that stands obliquely.
    let turn = DMat3::from_rotation_z(0.6);
    let scene = Scene::load("escher:300").unwrap();
    let turned = scene.triangles().unwrap().iter().map(|t| t.0.map(|at| turn * at.as_dvec3()));
    let mesh = obj(turned);
    let mut recipes = 0;
    for block in blocks_in("sh").into_iter().filter(|block| block.page.ends_with("COOKBOOK.md")) {
        let folder = tempfile::tempdir().unwrap();
        for name in ["city.obj", "house.obj", "scene.obj"] {
            fs::write(folder.path().join(name), &mesh).unwrap();
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
