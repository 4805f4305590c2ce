//! External faults during a run: full disks, read-only folders, kills, a second harness.
//!
//! `KILLS=100 cargo test -p harness faults::` kills the harness 100 times.

use crate::support::{
    ended, folder_with, program, refused, reproducible, run_on_a_small_disk, said, wait_for,
};
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const SPEC: &str = "
question = 'What survives?'
scenes = ['spheres75', 'escher:300', 'spheres750']
repetitions = 12
methods = [
    { label = 'greedy', method = 'muller_fellner' },
    { label = 'noise', method = 'grasp', trials = 60, noise = 0.1 },
    { label = 'orders', method = 'random_orders', trials = 10 },
]
";

/// Creates a folder with the spec.
fn folder() -> tempfile::TempDir {
    folder_with("spec.toml", SPEC)
}

/// Prepares a harness that is killed or runs in the background, without output.
fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = program(folder, args);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// Returns the files that every run must reproduce.
fn results(out: &Path) -> Vec<(String, Vec<u8>)> {
    let files = reproducible(&out.join("spec"));
    // Comparing no files would always succeed.
    assert!(files.len() >= 3, "{files:?}");
    files
}

/// Returns the files of one uninterrupted run.
fn whole(folder: &Path) -> Vec<(String, Vec<u8>)> {
    said(folder, &["spec.toml", "--out", "whole"]);
    results(&folder.join("whole"))
}

#[test]
fn killed_at_random_moments_and_resumed_the_bytes_are_the_same() {
    let folder = folder();
    let whole = whole(folder.path());
    let kills: u32 = std::env::var("KILLS").ok().and_then(|kills| kills.parse().ok()).unwrap_or(20);
    let mut killed = 0;
    let mut finished = 0;
    let mut state = 1u32;
    let mut out = "out0".to_owned();
    while killed < kills {
        let mut child =
            command(folder.path(), &["spec.toml", "--resume", "--jobs=2", "--out", &out])
                .spawn()
                .unwrap();
        // A fixed sequence of moments makes a failure repeatable.
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        std::thread::sleep(Duration::from_micros(u64::from(state >> 8) % 60_000));
        if child.try_wait().unwrap().is_none() {
            child.kill().unwrap();
            killed += 1;
            child.wait().unwrap();
        } else if child.wait().unwrap().success() {
            assert!(results(&folder.path().join(&out)) == whole, "after {killed} kills");
            finished += 1;
            out = format!("out{finished}");
        } else {
            panic!("after {killed} kills --resume fails");
        }
    }
    said(folder.path(), &["spec.toml", "--resume", "--out", &out]);
    let found = results(&folder.path().join(&out));
    let differing: Vec<&String> =
        found.iter().filter(|file| !whole.contains(file)).map(|(name, _)| name).collect();
    assert!(found == whole, "{differing:?}");
    eprintln!("{killed} kills, {} experiments finished", finished + 1);
}

#[test]
fn a_second_harness_on_the_same_folder_is_rejected_and_disturbs_nothing() {
    struct Killed(Child);
    impl Drop for Killed {
        fn drop(&mut self) {
            let _ = self.0.kill();
            let _ = self.0.wait();
        }
    }
    let folder = folder();
    let long = SPEC.replace("trials = 60", "trials = 1000000");
    fs::write(folder.path().join("long.toml"), long).unwrap();
    let first = Killed(command(folder.path(), &["long.toml"]).spawn().unwrap());
    wait_for(&folder.path().join("results/long/.partial/000000.run"));
    for more in [&[][..], &["--resume"], &["--seed=3"]] {
        let args = [&["long.toml"], more].concat();
        refused(folder.path(), &args, 1, &["results/long is in use by another harness", "--out"]);
    }
    // Other folders are free, and the kept run still exists.
    said(folder.path(), &["spec.toml"]);
    assert!(folder.path().join("results/long/.partial/000000.run").is_file());
    // The first harness must be alive until here, otherwise its lock proves nothing.
    drop(first);
    // The lock died with its owner.
    refused(
        folder.path(),
        &["long.toml", "--resume", "--seed=3"],
        2,
        &["results/long", "another spec"],
    );
}

#[test]
fn a_full_disk_is_reported_and_finished_runs_are_kept() {
    let folder = folder_with("spec.toml", &SPEC.replace("repetitions = 12", "repetitions = 3"));
    let whole = whole(folder.path());
    for blocks in [0, 1, 8] {
        let out = format!("full{blocks}");
        let args = format!("spec.toml --jobs 2 --out {out}");
        let Some(output) = run_on_a_small_disk(folder.path(), &args, blocks) else { return };
        ended(&output, 1, &[&format!("{out}/spec"), "cannot write the file"]);
        assert!(!folder.path().join(&out).join("spec/runs.csv").exists());
        said(folder.path(), &["spec.toml", "--resume", "--out", &out]);
        assert!(results(&folder.path().join(&out)) == whole);
    }
}
