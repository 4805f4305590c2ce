//! The examples in the documentation that call `bvh` or describe rays for it.

#[path = "../program/pages.rs"]
mod pages;
use crate::support::{run, said, text};
use pages::{Called, UNREADABLE, blocks_in};
use std::fs;

#[test]
fn a_bake_accepts_every_printed_description_of_rays() {
    let mut descriptions = 0;
    for block in blocks_in("toml").into_iter().filter(|block| block.text.contains("cameras = ")) {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("rays.toml"), &block.text).unwrap();
        said(
            folder.path(),
            &["bake", "escher:60", "--budget=1kwork", "--rays=rays.toml", "--out=x.bvh"],
        );
        descriptions += 1;
    }
    assert!(descriptions > 0);
}

#[test]
fn the_program_accepts_every_printed_command() {
    let bvh = Called { name: "bvh", package: "bvh-cli" };
    assert!(bvh.reads_blocks() > 2 && bvh.knows_sentences() > 3);
}

#[test]
fn an_invalid_command_is_found() {
    let folder = tempfile::tempdir().unwrap();
    for wrong in [
        &["bake", "scene.obj", "--budgett", "10s"][..],
        &["bake", "scene.obj", "--budget", "ten", "--out", "x.bvh"],
        &["bake", "--budget", "10s"],
    ] {
        assert!(text(&run(folder.path(), wrong).stderr).contains(UNREADABLE), "{wrong:?}");
    }
}
