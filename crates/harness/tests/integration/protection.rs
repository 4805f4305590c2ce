//! No arguments make the program damage its user's files: it never writes results elsewhere, loses
//! finished runs, writes through links, waits forever for a pipe, or replaces files of others.

// Tests that send signals or make links and pipes are left out on Windows, and their imports stay.
#![cfg_attr(windows, allow(unused_imports))]

use crate::support::{
    ended, folder_with, names, of_part, part, program, reproducible, run, said, text, top,
};
use std::fs;
use std::path::Path;

const SPEC: &str = "
question = 'What stays?'
scenes = ['spheres75']
repetitions = 3
methods = [{ method = 'muller_fellner' }, { method = 'grasp', trials = 3 }]
";

/// Creates a folder with a spec of this name.
fn folder(spec: &str) -> tempfile::TempDir {
    folder_with(spec, SPEC)
}

/// Asserts that the arguments are rejected as a usage error with these parts of the message.
fn refused(folder: &Path, args: &[&str], parts: &[&str]) {
    crate::support::refused(folder, args, 2, parts);
}

#[test]
fn finished_results_are_replaced_by_force_only() {
    let folder = folder("spec.toml");
    let dir = folder.path();
    said(dir, &["spec.toml"]);
    let results = dir.join("results/spec");
    let first = reproducible(&results);
    let first_timing = fs::read(results.join("timing.csv")).unwrap();
    // A repetition prints its tables and compares them, and writes nothing.
    let repetition = said(dir, &["spec.toml"]);
    assert!(repetition.contains("What stays?") && repetition.contains("spec: as committed"));
    let rows = fs::read(results.join("runs.csv")).unwrap();
    fs::write(results.join("runs.csv"), rows.repeat(2)).unwrap();
    ended(&run(dir, &["spec.toml"]), 1, &["1 difference(s)", "--force", "--out"]);
    fs::write(results.join("runs.csv"), rows).unwrap();
    // Parts are compared as it is.
    let part = of_part(dir, "spec.toml", 0, 1000);
    said(dir, &["spec.toml", &part[0], "--out=one"]);
    assert!(said(dir, &["merge", "one", "--out=results"]).contains("spec: as committed"));
    assert_eq!(names(&dir.join("results")), [".lock", "best_known.csv", "spec"]);
    for other in ["--scene=spheres750", "--seed=2", part[0].as_str()] {
        refused(dir, &["spec.toml", other], &["results/spec", "--force", "--out"]);
    }
    assert!(reproducible(&results) == first);
    assert!(fs::read(results.join("timing.csv")).unwrap() == first_timing);
    said(dir, &["spec.toml", "--seed=2", "--force"]);
    assert!(reproducible(&results) != first);
}

#[test]
fn resuming_what_is_finished_does_nothing() {
    let folder = folder("spec.toml");
    let dir = folder.path();
    said(dir, &["spec.toml", "--resume"]);
    let written = || {
        let files = names(&dir.join("results/spec"))
            .into_iter()
            .map(|name| dir.join("results/spec").join(name));
        files
            .map(|file| (fs::metadata(&file).unwrap().modified().unwrap(), file))
            .collect::<Vec<_>>()
    };
    let first = written();
    let resumed = run(dir, &["spec.toml", "--resume"]);
    ended(&resumed, 0, &[]);
    assert!(text(&resumed.stdout).contains("nothing was done"), "{}", text(&resumed.stdout));
    assert_eq!(
        (names(&dir.join("results")), written()),
        (vec![".lock".into(), "best_known.csv".into(), "spec".into()], first)
    );
    // The suite of cases is no exception.
    let suite = top().canonicalize().unwrap().join("experiments/stability.toml");
    let suite = [suite.to_str().unwrap(), "--quick", "--scene=S01"];
    said(dir, &suite);
    assert!(said(dir, &[&suite[..], &["--resume"]].concat()).contains("nothing was done"));
}

/// Returns the names of the runs that the results of an interrupted experiment keep.
fn kept_runs(results: &Path) -> Vec<String> {
    let mut kept = names(&results.join(".partial"));
    kept.retain(|name| name.ends_with(".run"));
    kept
}

#[test]
fn a_damaged_finished_run_or_one_with_another_name_is_named_and_repeated_or_rejected() {
    let folder = folder("spec.toml");
    let dir = folder.path();
    said(dir, &["spec.toml", "--out=whole"]);
    let whole = reproducible(&dir.join("whole/spec"));
    part(dir, "spec.toml", 1, 2, &["--out=two"]);
    // The unit tests of the store try all kinds of damage.
    for (one, is_renamed, fault) in [("cut", false, "damaged"), ("renamed", true, "repetition 2")] {
        part(dir, "spec.toml", 0, 2, &[&format!("--out={one}")]);
        let kept = kept_runs(&dir.join(one).join("spec"));
        let wrong = kept.last().unwrap();
        let [first, last] =
            [&kept[0], wrong].map(|name| dir.join(one).join("spec/.partial").join(name));
        let contents = if is_renamed { fs::read(first).unwrap() } else { vec![] };
        fs::write(last, contents).unwrap();
        let out = format!("--out=joined {one}");
        crate::support::refused(dir, &["merge", one, "two", &out], 1, &[wrong, fault]);
        assert!(!dir.join(format!("joined {one}/spec/runs.csv")).exists());
        let resumed = run(dir, &["spec.toml", "--resume", &format!("--out={one}")]);
        ended(&resumed, 0, &["done again", wrong, fault]);
        assert!(reproducible(&dir.join(one).join("spec")) == whole);
    }
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_rejected_as_inputs_and_links_are_not_written_through() {
    use std::os::unix::fs::symlink;
    let folder = folder("spec.toml");
    let dir = folder.path();
    let made =
        std::process::Command::new("mkfifo").args(["p.toml", "p.obj"]).current_dir(dir).status();
    // Opening a pipe that nobody writes to would block forever.
    assert!(made.unwrap().success());
    refused(dir, &["p.toml"], &["p.toml", "not a regular file"]);
    refused(dir, &["spec.toml", "--scene=p.obj"], &["p.obj"]);
    fs::write(dir.join("precious"), "precious").unwrap();
    fs::create_dir_all(dir.join("results/spec")).unwrap();
    for lock in ["results/.lock", "results/spec/.lock"] {
        let _ = fs::remove_file(dir.join(lock));
        symlink(dir.join("precious"), dir.join(lock)).unwrap();
        let output = run(dir, &["spec.toml", "--force"]);
        assert!(
            !output.status.success() && text(&output.stderr).contains(lock),
            "{}",
            text(&output.stderr)
        );
        fs::remove_file(dir.join(lock)).unwrap();
    }
    assert_eq!(fs::read_to_string(dir.join("precious")).unwrap(), "precious");
}

#[cfg(unix)]
#[test]
fn arguments_need_not_be_utf_8() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = folder("spec.toml");
    let out = OsStr::from_bytes(b"out\xff");
    let output = program(folder.path(), &["spec.toml", "--out"]).arg(out).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let provenance =
        fs::read_to_string(folder.path().join(out).join("spec/provenance.toml")).unwrap();
    assert!(provenance.contains("harness spec.toml --out out"), "{provenance}");
}
