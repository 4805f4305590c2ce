//! The program as its users meet it: what it writes, what it refuses, and what survives a kill.

mod support;

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use support::{harness, reproducible, run, text, wait_for};

const SPEC: &str = "
question = 'Do results survive?'
scenes = ['escher', 'pinecon2']
repetitions = 3
methods = [
    { label = 'greedy', method = 'muller_fellner' },
    { label = 'noise', method = 'grasp', trials = 12, noise = 0.1 },
    { label = 'k', method = 'grasp', trials = 6, candidates = { k_best = 5 } },
]

[[reports]]
kind = 'table'
source = 'Test'
title = 'a table'
[[reports.columns]]
name = 'base'
method = 'greedy'
paper = { escher = 1.0, pinecon2 = 1.0 }
[[reports.columns]]
name = 'best of 5'
method = 'noise'
best_of = 5
paper = { escher = 1.0, pinecon2 = 0.9 }

[quick]
scenes = ['escher']
repetitions = 1
";

/// A folder with the spec in it.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("spec.toml"), SPEC).unwrap();
    folder
}

#[test]
fn a_run_writes_rows_figures_and_provenance_and_prints_the_table() {
    let folder = folder();
    let output = run(folder.path(), &["spec.toml"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("escher (stand-in)"), "{}", text(&output.stdout));
    let results = folder.path().join("results/spec");
    for name in [
        "runs.csv",
        "history.csv",
        "timing.csv",
        "paper.csv",
        "table.csv",
        "table.svg",
        "table.png",
        "provenance.toml",
    ] {
        assert!(results.join(name).is_file(), "{name}");
    }
    assert!(!results.join(".partial").exists());
    let runs = fs::read_to_string(results.join("runs.csv")).unwrap();
    assert_eq!(runs.lines().count(), 1 + 2 * 3 * 3);
    assert!(!reproducible(&results).iter().any(|(_, bytes)| text(bytes).contains("seconds")));
    let provenance: toml::Table = fs::read_to_string(results.join("provenance.toml")).unwrap().parse().unwrap();
    let (build, assertions) = (provenance["build"].as_str().unwrap(), cfg!(debug_assertions));
    let (profile, on) = if assertions { ("debug, opt-level ", "on") } else { ("release, opt-level ", "off") };
    assert!(build.starts_with(profile) && build.contains(&format!("debug assertions {on}")), "{build}");
}

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    let folder = folder();
    let results: Vec<_> = ["1", "2", "3"]
        .map(|jobs| {
            assert!(run(folder.path(), &["spec.toml", "--jobs", jobs, "--out", jobs]).status.success());
            reproducible(&folder.path().join(jobs).join("spec"))
        })
        .into();
    assert!(results[0] == results[1] && results[0] == results[2]);
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_finished_runs_and_says_how_to_go_on() {
    let folder = folder();
    let spec = SPEC.replace("repetitions = 3", "repetitions = 40").replace("trials = 12", "trials = 100");
    fs::write(folder.path().join("spec.toml"), spec).unwrap();
    let child =
        harness(folder.path(), &["spec.toml"]).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for(&folder.path().join("results/spec/.partial/000000"));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("of 240 runs are kept, `--resume` does the rest"));
    assert!(folder.path().join("results/spec/.partial/000000").is_dir());
}

#[cfg(unix)]
#[test]
fn a_signal_ends_a_lower_bound_of_any_effort() {
    let folder = folder();
    let spec = "question = 'q'\nscenes = ['escher']\nlower_bound = 4000000000\nmethods = [{ method = 'median_cut' }]\n";
    fs::write(folder.path().join("spec.toml"), spec).unwrap();
    let child =
        harness(folder.path(), &["spec.toml"]).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for(&folder.path().join("results/spec/.partial"));
    // The tree takes milliseconds; then it is the bound that the signal meets.
    std::thread::sleep(std::time::Duration::from_millis(500));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("0 of 1 runs are kept"), "a bound that was cut short is no result");
}

#[test]
fn check_passes_on_equal_results_and_names_an_altered_number() {
    let folder = folder();
    assert!(run(folder.path(), &["spec.toml"]).status.success());
    let output = run(folder.path(), &["spec.toml", "--check"]);
    assert!(output.status.success(), "{}", text(&output.stdout));
    let path = folder.path().join("results/spec/runs.csv");
    let runs = fs::read_to_string(&path).unwrap();
    let line = runs.lines().find(|line| line.contains("pinecon2,stand-in,noise")).unwrap();
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
    assert!(run(folder.path(), &["spec.toml", "--quick"]).status.success());
    let quick = fs::read_to_string(folder.path().join("results/quick/spec/runs.csv")).unwrap();
    assert_eq!(quick.lines().count(), 1 + 3);
    fs::write(folder.path().join("two.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 1 2 3\nf 2 3 4\n").unwrap();
    let args = ["spec.toml", "--quick", "--scene", "two.obj", "--seed", "9", "--out", "other"];
    assert!(run(folder.path(), &args).status.success());
    let other = fs::read_to_string(folder.path().join("other/quick/spec/runs.csv")).unwrap();
    assert!(other.contains("\ntwo,file,greedy,") && !other.contains("escher"), "{other}");
}

#[test]
fn what_is_wrong_is_named_and_costs_nothing_but_a_message() {
    let folder = folder();
    let spec = |name: &str, text: String| fs::write(folder.path().join(name), text).unwrap();
    spec("key.toml", SPEC.replace("repetitions = 3", "repetition = 3"));
    spec("parameter.toml", SPEC.replace("noise = 0.1", "noise = 2.0"));
    spec("scene.toml", SPEC.replace("'pinecon2'", "'sofa'"));
    spec("label.toml", SPEC.replace("method = 'noise'", "method = 'nose'"));
    fs::write(folder.path().join("nan.obj"), "v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    fs::write(folder.path().join("empty.obj"), "").unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    for (args, code, parts) in [
        (&["missing.toml"][..], 2, &["missing.toml"][..]),
        (&["key.toml"], 2, &["key.toml", "repetition", "repetitions"]),
        (&["parameter.toml"], 2, &["line 7", "methods[1].noise is 2", "0 to 1"]),
        (&["scene.toml"], 2, &["sofa", "accepted: bijou"]),
        (&["label.toml"], 2, &["reports[0]", "nose", "accepted: greedy, noise, k"]),
        (&["spec.toml", "--scene", "nan.obj"], 2, &["nan.obj:2", "nan"]),
        (&["spec.toml", "--scene", "empty.obj"], 2, &["empty.obj is empty"]),
        (&["spec.toml", "--scene", "none.obj"], 2, &["none.obj", "no such file"]),
        (&["spec.toml", "--jobs", "0"], 2, &["--jobs", "1..=1024"]),
        (&["spec.toml", "--sed", "1"], 2, &["--sed", "--seed"]),
        (&["spec.toml", "--out", "file"], 2, &["--out", "file is a file", "a folder"]),
        (&["spec.toml", "--check", "--resume"], 2, &["--check", "--resume"]),
        (&[], 2, &["Usage"]),
    ] {
        let output = run(folder.path(), args);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
        assert!(parts.iter().all(|part| said.contains(part)), "{args:?}: {said}");
    }
    assert!(!folder.path().join("results").exists(), "nothing was written");
}

#[test]
fn scenes_are_listed_with_what_they_stand_in_for() {
    let output = run(Path::new("."), &["scenes"]);
    assert!(output.status.success());
    assert!(text(&output.stdout).contains("stand-in for Cloister"));
}

#[test]
fn parts_made_apart_are_merged_to_the_bytes_of_one_run_and_what_is_missing_or_differs_is_named() {
    let folder = folder();
    let part = |number: &str, out: &str| {
        let output = run(folder.path(), &["spec.toml", "--shard", number, "--out", out]);
        assert!(output.status.success(), "{}", text(&output.stderr));
    };
    let refused = |args: &[&str], code: i32, parts: &[&str]| {
        let output = run(folder.path(), args);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        assert!(!folder.path().join("merged").exists());
    };
    assert!(run(folder.path(), &["spec.toml", "--out", "whole"]).status.success());
    part("1/3", "one");
    part("3/3", "three");
    let missing = ["spec: 6 of 18 runs are missing", "scene escher, method greedy, repetition 1"];
    refused(&["merge", "one", "three", "--out", "merged"], 1, &missing);
    refused(&["merge", "one", "whole", "--out", "merged"], 2, &["whole", "--shard"]);
    refused(&["merge", "one", "nowhere", "--out", "merged"], 1, &["nowhere"]);
    refused(&["spec.toml", "--shard", "4/3", "--out", "merged"], 2, &["--shard", "4/3", "from 1 to N"]);

    // The same runs twice are welcome, as long as they agree.
    part("2/3", "two");
    part("2/3", "again");
    let folders = ["merge", "one", "two", "three", "again", "--out"];
    let output = run(folder.path(), &[&folders[..], &["merged"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let whole = reproducible(&folder.path().join("whole/spec"));
    assert!(whole == reproducible(&folder.path().join("merged/spec")));
    let figure = |out: &str| fs::read(folder.path().join(out).join("spec/table.svg")).unwrap();
    assert!(figure("whole") == figure("merged"));
    let provenance = fs::read_to_string(folder.path().join("merged/spec/provenance.toml")).unwrap();
    assert_eq!(provenance.matches("[[parts]]").count(), 4);
    fs::remove_dir_all(folder.path().join("merged")).unwrap();

    let kept = folder.path().join("again/spec/.partial/000001/runs.csv");
    fs::write(&kept, fs::read_to_string(&kept).unwrap().replace("escher", "esther")).unwrap();
    let differs = ["again/spec/.partial/000001", "runs.csv is damaged"];
    refused(&[&folders[..], &["merged"]].concat(), 1, &differs);
    assert!(
        run(folder.path(), &["spec.toml", "--seed", "9", "--shard", "2/3", "--out", "two", "--force"])
            .status
            .success()
    );
    refused(&["merge", "one", "two", "three", "--out", "merged"], 1, &["different specs"]);
    refused(&["merge", "one", "--out", "one"], 2, &["--out one"]);

    let resolved = folder.path().join("one/spec/.partial/resolved.toml");
    let edited = fs::read_to_string(&resolved).unwrap().replace("repetitions = 3", "repetitions = 4294967295");
    fs::write(&resolved, edited).unwrap();
    refused(&["merge", "one", "--out", "merged"], 1, &["one/spec/.partial/resolved.toml: ", "runs; accepted"]);
}

const GAPS: &str = "
question = 'What are gaps measured from?'
scenes = ['escher:300', 'spheres75:12']
methods = [
    { label = 'greedy', method = 'muller_fellner' },
    { label = 'search', method = 'reinsertion', budget = { max_work = 2000 } },
]
[[reports]]
kind = 'numbers'
title = 'gaps'
methods = ['greedy', 'search']
";

/// The column of the first row of the scene and method.
fn cell(path: &Path, scene: &str, method: &str, column: &str) -> f64 {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let rows = reader.deserialize::<std::collections::BTreeMap<String, String>>().map(Result::unwrap);
    let of =
        |row: &std::collections::BTreeMap<String, String>| row["scene"] == scene && row["method"] == method;
    rows.into_iter().find(of).unwrap()[column].parse().unwrap()
}

#[test]
fn gaps_are_to_the_best_known_cost_and_stay_until_they_are_redrawn() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, work: &str| {
        fs::write(folder.path().join(name), GAPS.replace("max_work = 2000", work)).unwrap();
    };
    let succeeds = |args: &[&str]| {
        let output = run(folder.path(), args);
        assert!(output.status.success(), "{args:?}: {}{}", text(&output.stdout), text(&output.stderr));
    };
    write("short.toml", "max_work = 2000");
    write("long.toml", "max_work = 10000000");
    succeeds(&["short.toml"]);
    let numbers = folder.path().join("results/short/numbers.csv");
    let gap = || cell(&numbers, "escher:300", "search", "gap_median");
    assert_eq!(gap(), 0.0, "its own best is the best known");
    // Small scenes have an exact optimum, whoever finds it.
    assert!(cell(&numbers, "spheres75:12", "greedy", "lower_bound_over_reference") >= 1.0 - 1e-12);
    let best_known = || fs::read(folder.path().join("results/best_known.csv")).unwrap();
    let before = best_known();
    succeeds(&["long.toml"]);
    let after = best_known();
    assert!(before != after && gap() == 0.0);
    succeeds(&["short.toml", "--check"]);
    assert!(best_known() == after, "a check writes nothing");
    succeeds(&["short.toml", "--redraw"]);
    assert!(gap() > 0.0);
    succeeds(&["short.toml", "--check"]);
    // Rows of another spec cannot be redrawn.
    write("short.toml", "max_work = 3000");
    let refused = run(folder.path(), &["short.toml", "--redraw"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("another spec"), "{}", text(&refused.stderr));
}

#[test]
fn without_reports_there_is_a_table_and_without_a_terminal_a_line_for_the_last_run() {
    let folder = tempfile::tempdir().unwrap();
    let spec =
        "question = 'q'\nscenes = ['spheres75']\nrepetitions = 3\nmethods = [{ method = 'median_cut' }]\n";
    fs::write(folder.path().join("plain.toml"), spec).unwrap();
    let output = run(folder.path(), &["plain.toml"]);
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert!(["spheres75", "median_cut", "least_over_base"].iter().all(|part| out.contains(part)), "{out}");
    assert!(err.contains("plain: 3 of 3 runs") && err.contains("median_cut on spheres75"), "{err}");
    let quiet = run(folder.path(), &["plain.toml", "--quiet", "--force"]);
    assert!(quiet.status.success() && quiet.stdout.is_empty() && quiet.stderr.is_empty());
    let verbose = run(folder.path(), &["plain.toml", "--verbose", "--force"]);
    let said = text(&verbose.stderr);
    assert_eq!(said.lines().count(), 3, "a line for every run: {said}");
    let rows = fs::read_to_string(folder.path().join("results/plain/runs.csv")).unwrap();
    for (repetition, row) in rows.lines().skip(1).enumerate() {
        let seed = row.split(',').nth(3).unwrap();
        let part = format!("median_cut on spheres75, repetition {repetition}, seed {seed}, took 0.");
        assert!(said.contains(&part), "{part} in {said}");
    }
}

#[test]
fn every_shell_and_the_manual_get_all_commands() {
    let folder = tempfile::tempdir().unwrap();
    for args in [&["man"][..], &["completions", "bash"], &["completions", "zsh"], &["completions", "fish"]] {
        let output = run(folder.path(), args);
        let said = text(&output.stdout);
        assert!(output.status.success(), "{args:?}");
        for part in ["inspect", "budget", "Number of threads", "merge"] {
            // Bash has no room for explanations.
            assert!(said.contains(part) || (args[1..] == ["bash"] && part.contains(' ')), "{args:?}: {part}");
        }
    }
}

#[test]
fn a_mistyped_command_is_answered_with_the_one_that_is_meant() {
    let folder = folder();
    for (args, meant) in [
        (&["bakee", "escher", "--budget", "0s", "--out", "x.bvh"][..], "`bake`"),
        (&["inspct", "x.bvh"], "`inspect`"),
        (&["scene"], "`scenes`"),
    ] {
        let output = run(folder.path(), args);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(args[0]) && said.contains(meant), "{said}");
    }
    // A spec is none, though it be called alike.
    let output = run(folder.path(), &["bake.toml"]);
    assert!(text(&output.stderr).contains("bake.toml: no such file"), "{}", text(&output.stderr));
    fs::rename(folder.path().join("spec.toml"), folder.path().join("bakee")).unwrap();
    assert!(run(folder.path(), &["bakee"]).status.success());
}

#[test]
fn runs_that_the_clock_ends_leave_rows_among_the_timings_alone_and_checks_do_not_compare_them() {
    let folder = tempfile::tempdir().unwrap();
    let spec = "question = 'How low in a moment?'\nscenes = ['escher']\nsequential = true\nmax_seconds = 0.05\n\
                methods = [{ method = 'best', references = 1.2 }]\ntinybvh = 'nowhere/ray_peers'\n";
    fs::write(folder.path().join("clock.toml"), spec).unwrap();
    let first = run(folder.path(), &["clock.toml"]);
    assert!(first.status.success(), "{}", text(&first.stderr));
    let said = text(&first.stdout);
    assert!(said.contains("collapsed_sah") && said.contains("Without tinybvh: nowhere/ray_peers"), "{said}");
    let results = folder.path().join("results/clock");
    let mut names: Vec<String> = fs::read_dir(&results)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.retain(|name| !name.starts_with('.'));
    names.sort();
    let timings = ["timing_report.txt", "timing_runs.csv", "timing_runs.png", "timing_runs.svg"];
    assert_eq!(names, [&["provenance.toml", "resolved.toml"][..], &timings].concat());
    let rows = fs::read_to_string(results.join("timing_runs.csv")).unwrap();
    let mut reader = csv::Reader::from_reader(rows.as_bytes());
    let column = reader.headers().unwrap().iter().position(|name| name == "seconds").unwrap();
    let seconds: f64 = reader.records().next().unwrap().unwrap()[column].parse().unwrap();
    // However busy the machine is: without the limit, `best` takes hours.
    assert!((0.05..20.0).contains(&seconds), "{seconds}");

    // Other costs are no difference, another spec is.
    fs::write(results.join("timing_runs.csv"), rows.replace('1', "2")).unwrap();
    let check = run(folder.path(), &["--check", "clock.toml"]);
    assert!(check.status.success(), "{}", text(&check.stdout));
    assert!(text(&check.stdout).contains("cannot be compared"), "{}", text(&check.stdout));
    fs::write(folder.path().join("clock.toml"), spec.replace("1.2", "1.3")).unwrap();
    let check = run(folder.path(), &["--check", "clock.toml"]);
    assert_eq!(check.status.code(), Some(1));
    assert!(text(&check.stdout).contains("references is 1.3, committed 1.2"), "{}", text(&check.stdout));
}
