//! A test runs every example in the documentation: the harness runs specs as printed; the doctests
//! of a crate run Rust; the tests of the bindings run C and Python; and the programs parse the
//! arguments of commands. The commands of `bvh` are in the tests of that crate.

#[path = "../../../bvh-cli/tests/program/pages.rs"]
mod pages;
use crate::support::{said, top};
use bvh_scenes::Scene;
use pages::{accepts_printed_commands, blocks, blocks_in, commands};
use std::collections::BTreeSet;
use std::fs;

#[test]
fn every_block_has_a_language_whose_examples_are_run() {
    for block in blocks() {
        // The layers are read by the test `circles`.
        let languages =
            ["c", "js", "layers", "python", "rust", "rust,no_run", "sh", "text", "toml"];
        assert!(
            languages.contains(&block.language.as_str()),
            "{}: `{}`",
            block.place(),
            block.language
        );
        // `scripts/languages` compiles and runs the C example, pytest and node run the others, also
        // those of the cookbook. Two lines in the README show what the page of the npm package
        // explains.
        for language in ["c", "python", "js"] {
            let page = fs::canonicalize(&block.page).unwrap();
            let is_run = page.ends_with(format!("crates/bvh-{language}/README.md"))
                || language != "c" && page == fs::canonicalize(top().join("README.md")).unwrap()
                || language != "c" && page.ends_with("docs/use/COOKBOOK.md");
            assert!(block.language != language || is_run, "{}", block.place());
        }
    }
}

#[test]
fn every_block_of_rust_is_a_doctest() {
    let mut tested = BTreeSet::new();
    for entry in fs::read_dir(top().join("crates")).unwrap() {
        let library = entry.unwrap().path().join("src/lib.rs");
        let Ok(text) = fs::read_to_string(&library) else { continue };
        for (page, _) in
            text.split("include_str!(\"").skip(1).filter_map(|rest| rest.split_once('"'))
        {
            tested.insert(fs::canonicalize(library.with_file_name(page)).unwrap());
        }
    }
    for block in blocks_in("rust") {
        assert!(
            tested.contains(&fs::canonicalize(&block.page).unwrap()),
            "{}: not a doctest",
            block.place()
        );
    }
}

/// A scene with fewer triangles than the scenes of examples.
const SMALL: &str = "escher:60";

#[test]
fn every_spec_runs_as_it_is_printed() {
    let mut specs = 0;
    for block in blocks_in("toml") {
        let table: toml::Table =
            block.text.parse().unwrap_or_else(|error| panic!("{}: {error}", block.place()));
        let folder = tempfile::tempdir().unwrap();
        let dir = folder.path();
        if table.contains_key("cameras") {
            continue; // `bvh` runs it.
        }
        // A table without a question is a part of a spec.
        let around = if table.contains_key("question") {
            ""
        } else {
            "question = 'q'\nscenes = ['escher']\n"
        };
        fs::write(dir.join("spec.toml"), format!("{around}{}", block.text)).unwrap();
        for name in table.get("scenes").and_then(toml::Value::as_array).into_iter().flatten() {
            // The run below uses a small scene, so the printed names are checked here.
            let loaded = Scene::load(name.as_str().unwrap());
            assert!(loaded.is_ok(), "{}: {}", block.place(), loaded.unwrap_err());
        }
        if block.text.contains("peer.py") {
            fs::copy(top().join("scripts/external_method.py"), dir.join("peer.py")).unwrap();
            if !run_python() {
                eprintln!("{} is skipped: there is no python3", block.place());
                continue;
            }
        }
        said(dir, &["spec.toml", "--scene", SMALL]);
        specs += 1;
    }
    assert!(specs > 0);
}

fn run_python() -> bool {
    let version = std::process::Command::new("python3").arg("--version").output();
    version.is_ok_and(|output| output.status.success())
}

#[test]
fn every_command_of_a_block_names_what_is_there_and_is_read_by_the_program() {
    for block in blocks_in("sh") {
        commands(&block.text, &block.place())
            .iter()
            .for_each(|command| check_files(command, &block.place()));
    }
    assert!(accepts_printed_commands("harness", "harness") > 6);
}

/// Asserts that the files in a command of the project exist.
fn check_files(command: &[String], place: &str) {
    let known =
        ["bvh", "c++", "cargo", "cd", "cmake", "cmp", "export", "harness", "node", "npm", "rustup"];
    let program = &command[0];
    let is_there = known.contains(&program.as_str()) || top().join(program).is_file();
    assert!(is_there, "{place}: `{program}`");
    for word in command {
        let of_project =
            ["scripts/", "experiments/", "crates/"].iter().any(|folder| word.starts_with(folder));
        assert!(
            !of_project || word.contains("/target/") || top().join(word).exists(),
            "{place}: no {word}"
        );
    }
    for (flag, package) in command.iter().zip(&command[1..]) {
        let is_there = flag != "-p" || top().join("crates").join(package).is_dir();
        assert!(is_there, "{place}: no package {package}");
    }
}
