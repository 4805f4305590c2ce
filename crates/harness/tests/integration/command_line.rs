//! The program from its users' view: the files it writes, the arguments it rejects, and the runs
//! that survive a kill.

// Tests that send signals or make links and pipes are left out on Windows, and their imports stay.
#![cfg_attr(windows, allow(unused_imports))]

use crate::support::{
    TABLE, begin, ended, folder_with, names, program, refused, reproducible, rows, run, said, send,
    text, wait_for, wait_until,
};
use std::fs;
use std::path::Path;
use std::process::Stdio;

/// Creates a folder with the spec.
fn folder() -> tempfile::TempDir {
    folder_with("spec.toml", TABLE)
}

#[test]
fn a_run_writes_rows_figures_and_provenance_and_prints_the_table() {
    let folder = folder();
    let said = said(folder.path(), &["spec.toml"]);
    assert!(said.contains("stand-in"), "{said}");
    let results = folder.path().join("results/spec");
    for name in [
        "runs.csv",
        "trial_costs.csv",
        "timing.csv",
        "paper.csv",
        "table.csv",
        "table.svg",
        "provenance.toml",
    ] {
        assert!(results.join(name).is_file(), "{name}");
    }
    assert!(!results.join(".partial").exists());
    let runs = fs::read_to_string(results.join("runs.csv")).unwrap();
    assert_eq!(runs.lines().count(), 1 + 2 * 3 * 3);
    assert!(!reproducible(&results).iter().any(|(_, bytes)| text(bytes).contains("seconds")));
    let provenance: toml::Table =
        fs::read_to_string(results.join("provenance.toml")).unwrap().parse().unwrap();
    let build = provenance["build"].as_str().unwrap();
    let assertions = cfg!(debug_assertions);
    let (profile, on) =
        if assertions { ("debug, opt-level ", "on") } else { ("release, opt-level ", "off") };
    assert!(
        build.starts_with(profile) && build.contains(&format!("debug assertions {on}")),
        "{build}"
    );
}

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    let folder = folder();
    let results: Vec<_> = ["1", "2", "3"]
        .map(|jobs| {
            said(folder.path(), &["spec.toml", "--jobs", jobs, "--out", jobs]);
            reproducible(&folder.path().join(jobs).join("spec"))
        })
        .into();
    assert!(results[0] == results[1] && results[0] == results[2]);
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_finished_runs_and_says_how_to_go_on() {
    let spec =
        TABLE.replace("repetitions = 3", "repetitions = 40").replace("trials = 12", "trials = 100");
    let folder = folder_with("spec.toml", &spec);
    let child = begin(folder.path(), &["spec.toml"]);
    wait_for(&folder.path().join("results/spec/.partial/000000.run"));
    send("-INT", &child);
    ended(
        &child.wait_with_output().unwrap(),
        130,
        &["of 240 runs are kept, `--resume` does the rest"],
    );
    assert!(folder.path().join("results/spec/.partial/000000.run").is_file());
    refused(folder.path(), &["spec.toml"], 2, &["finished runs", "--resume", "--force"]);
    said(folder.path(), &["spec.toml", "--resume"]);
    // A repetition of finished results is in a temporary folder, which goes.
    let results = folder.path().join("results/spec");
    let finished = reproducible(&results);
    let temporary = tempfile::tempdir().unwrap();
    let mut repetition = program(folder.path(), &["spec.toml"]);
    repetition.env("TMPDIR", temporary.path()).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = repetition.spawn().unwrap();
    wait_until("the temporary folder", || !names(temporary.path()).is_empty());
    wait_for(&temporary.path().join(&names(temporary.path())[0]).join("spec/.partial/000000.run"));
    send("-INT", &child);
    ended(&child.wait_with_output().unwrap(), 130, &["interrupted; no run is kept"]);
    assert!(reproducible(&results) == finished && names(temporary.path()).is_empty());
}

#[test]
fn check_passes_on_equal_results_and_names_an_altered_number() {
    let folder = folder();
    said(folder.path(), &["spec.toml"]);
    said(folder.path(), &["spec.toml", "--check"]);
    let path = folder.path().join("results/spec/runs.csv");
    let runs = fs::read_to_string(&path).unwrap();
    let line = runs.lines().find(|line| line.contains("pinecon2:300,stand-in,noise")).unwrap();
    // Column 9 is the cost, which the check must compare to the last digit.
    let cost = line.split(',').nth(9).unwrap();
    fs::write(&path, runs.replace(cost, "12345.5")).unwrap();
    let output = run(folder.path(), &["spec.toml", "--check"]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(1));
    for part in ["scene pinecon2", "method noise", &format!("cost is {cost}, committed 12345.5")] {
        assert!(said.contains(part), "{part} in {said}");
    }
    assert!(fs::read_to_string(&path).unwrap().contains("12345.5"), "a check writes nothing");
}

#[test]
fn quick_seed_and_scene_change_what_is_run() {
    let folder = folder();
    said(folder.path(), &["spec.toml", "--quick"]);
    let quick = fs::read_to_string(folder.path().join("results/quick/spec/runs.csv")).unwrap();
    // One scene, one repetition, three methods, and the header.
    assert_eq!(quick.lines().count(), 1 + 3);
    fs::write(
        folder.path().join("two.obj"),
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 1 2 3\nf 2 3 4\n",
    )
    .unwrap();
    let args = ["spec.toml", "--quick", "--scene", "two.obj", "--seed", "9", "--out", "other"];
    said(folder.path(), &args);
    let other = fs::read_to_string(folder.path().join("other/quick/spec/runs.csv")).unwrap();
    assert!(other.contains("\ntwo,file,greedy,") && !other.contains("escher"), "{other}");
}

#[test]
fn mistakes_are_named_before_any_work() {
    let folder = folder();
    for (name, text) in [
        ("key.toml", &*TABLE.replace("repetitions = 3", "repetition = 3")),
        ("scene.toml", &TABLE.replace("'pinecon2:300'", "'sofa'")),
        ("nan.obj", "v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n"),
        ("empty.obj", ""),
        ("file", ""),
        ("other/spec.toml", TABLE),
    ] {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    for (args, parts) in [
        (&["missing.toml"][..], &["missing.toml"][..]),
        (&["key.toml"], &["key.toml", "repetition", "repetitions"]),
        (
            &["scene.toml"],
            &["scene.toml: scenes: ", "sofa", "accepted: bijou, cloister, escher, konistil"],
        ),
        (&["jobs", "scene.toml"], &["scene.toml: scenes: ", "sofa"]),
        (&["spec.toml", "scene.toml"], &["scene.toml: scenes: ", "sofa"]),
        (&["spec.toml", "--scene", "nan.obj"], &["nan.obj:2", "nan"]),
        (&["spec.toml", "--scene", "empty.obj"], &["empty.obj: empty"]),
        (&["spec.toml", "--scene", "none.obj"], &["none.obj", "no such file"]),
        (&["spec.toml", "--jobs", "0"], &["--jobs", "1..=1024"]),
        (&["spec.toml", "--sed", "1"], &["--sed", "--seed"]),
        (&["spec.toml", "--out", "file"], &["--out", "file is a file", "a folder"]),
        (&["spec.toml", "--check", "--resume"], &["--check", "--resume"]),
        (&["spec.toml", "other/spec.toml"], &["two specs are called spec"]),
        (&[], &["Usage"]),
    ] {
        refused(folder.path(), args, 2, parts);
    }
    assert!(!folder.path().join("results").exists(), "nothing was written");
}

const GAPS: &str = "
question = 'What are gaps measured from?'
scenes = ['escher:300']
methods = [
    { label = 'greedy', method = 'muller_fellner' },
    { label = 'search', method = 'reinsertion', budget = { max_work = 2000 } },
]
[[reports]]
kind = 'query'
file = 'gaps'
rows = 'runs.csv'
join = 'references.csv'
join_by = ['scene']
by = ['method']
columns = [{ name = 'gap', value = 'median cost / references.cost - 1' }]
";

#[test]
fn gaps_are_to_the_best_known_cost_and_stay_until_they_are_redrawn() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("short.toml"), GAPS).unwrap();
    let long = GAPS.replace("max_work = 2000", "max_work = 10000000");
    fs::write(path.join("long.toml"), long).unwrap();
    said(path, &["short.toml"]);
    assert_eq!(gap(path), 0.0, "its own best is the best known");
    let best_known = path.join("results/best_known.csv");
    let before = fs::read(&best_known).unwrap();
    said(path, &["long.toml"]);
    let after = fs::read(&best_known).unwrap();
    assert!(before != after);
    assert_eq!(gap(path), 0.0, "later finds do not change recorded gaps");
    said(path, &["short.toml", "--check"]);
    assert!(fs::read(&best_known).unwrap() == after, "a check writes nothing");
    said(path, &["short.toml", "--redraw"]);
    assert!(gap(path) > 0.0);
    said(path, &["short.toml", "--check"]);
    // Rows of another spec cannot be redrawn.
    let other = GAPS.replace("max_work = 2000", "max_work = 3000");
    fs::write(path.join("short.toml"), other).unwrap();
    refused(path, &["short.toml", "--redraw"], 2, &["another spec"]);
}

fn gap(folder: &Path) -> f64 {
    let rows = rows(&folder.join("results/short/gaps.csv"));
    rows.iter().find(|row| row["method"] == "search").unwrap()["gap"].parse().unwrap()
}

#[test]
fn without_reports_there_is_a_table_and_on_request_nothing_is_printed() {
    let spec = "question = 'q'\nscenes = ['spheres75']\nmethods = [{ method = 'median_cut' }]\n";
    let folder = folder_with("plain.toml", spec);
    let output = run(folder.path(), &["plain.toml"]);
    let out = text(&output.stdout);
    let parts = ["Runs:", "spheres75", "median_cut", "least over base"];
    assert!(parts.iter().all(|part| out.contains(part)), "{out}");
    assert!(output.stderr.is_empty());
    let quiet = run(folder.path(), &["plain.toml", "--quiet", "--force"]);
    assert!(quiet.status.success() && quiet.stdout.is_empty() && quiet.stderr.is_empty());
}

#[test]
fn reports_that_fail_leave_finished_results() {
    let spec = "question = 'q'\nscenes = ['spheres75']\nmethods = [{ method = 'median_cut' }]\n";
    let report = "[[reports]]\nkind = 'query'\nfile = 'x'\nrows = 'runs.csv'\nby = ['scene']\n\
                  select = 'scene=SCENE'\ncolumns = [{ name = 'a', value = 'only objects' }]\n";
    let wrong = format!("{spec}{report}");
    let folder = folder_with("plain.toml", &wrong);
    let path = folder.path();
    let parts = ["results/plain/runs.csv", "no row meets \"scene=SCENE\"", "--redraw"];
    refused(path, &["plain.toml"], 1, &parts);
    fs::write(path.join("plain.toml"), spec).unwrap();
    said(path, &["plain.toml", "--redraw"]);
    let resolved = path.join("results/plain/resolved.toml");
    let before = fs::read(&resolved).unwrap();
    fs::write(path.join("plain.toml"), &wrong).unwrap();
    refused(path, &["plain.toml", "--redraw"], 1, &parts);
    assert!(!path.join("results/plain/.partial").exists());
    // A repetition names the results, not its temporary folder.
    refused(path, &["plain.toml"], 1, &parts);
    assert!(fs::read(&resolved).unwrap() == before);
    fs::write(path.join("plain.toml"), wrong.replace("SCENE", "spheres75")).unwrap();
    said(path, &["plain.toml", "--redraw"]);
    let table = fs::read_to_string(path.join("results/plain/x.csv")).unwrap();
    assert_eq!(table, "scene,a\nspheres75,75\n");
}
