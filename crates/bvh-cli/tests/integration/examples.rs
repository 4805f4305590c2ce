//! The examples in the documentation that call `bvh` or describe rays for it.

#[path = "../program/pages.rs"]
mod pages;
use crate::support::bvh;
use pages::{accepts_printed_commands, blocks_in};
use std::fs;

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
