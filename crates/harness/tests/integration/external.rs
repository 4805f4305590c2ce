//! External methods: their input, the use of their trees, and the errors when they fail.
use crate::support::{folder_with, program, refused, rows, run, said, save, send, wait_for};
use bvh_build::{Builder, muller_fellner};
use bvh_scenes::Scene;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Creates a folder with a spec whose second method is the shell script, and with a valid tree
/// file.
fn folder(script: &str, more: &str) -> tempfile::TempDir {
    let spec = format!(
        "question = 'Is theirs better?'\nscenes = ['spheres75']\nrepetitions = 2\nmethods = [\n\
         {{ method = 'muller_fellner' }},\n\
         {{ label = 'theirs', method = 'external', command = ['sh', 'peer.sh'], {more} }},\n]\n"
    );
    let folder = folder_with("spec.toml", &spec);
    fs::write(folder.path().join("peer.sh"), script).unwrap();
    let scene = Scene::load("spheres75").unwrap();
    let tree = muller_fellner::Config::default().build(&scene.boxes).unwrap();
    save(&tree, &scene, &folder.path().join("good.bvh"));
    folder
}

/// Returns these columns of a finished run's rows.
fn columns(dir: &Path, columns: [&str; 4]) -> Vec<[String; 4]> {
    let rows = rows(&dir.join("results/spec/runs.csv"));
    rows.iter().map(|row| columns.map(|column| row[column].clone())).collect()
}

#[test]
fn the_tree_of_a_program_is_costed_by_us_and_every_run_has_its_seed_and_the_boxes() {
    // 75 boxes of six numbers of four bytes.
    let script = "echo $BVH_SEED >> seeds; test $(wc -c < \"$1\") -eq 1800 && cp good.bvh \"$2\"";
    let folder = folder(script, "timeout_seconds = 60");
    let dir = folder.path();
    said(dir, &["spec.toml", "--jobs=1"]);
    let rows = columns(dir, ["method", "cost", "work", "seed"]);
    let (ours, theirs) = rows.split_at(2);
    assert!(theirs.iter().all(|row| row[0] == "theirs" && row[1..3] == ours[0][1..3]), "{rows:?}");
    // Equal seeds would make repetitions meaningless.
    assert!(theirs[0][3] != theirs[1][3]);
    let seeds = fs::read_to_string(dir.join("seeds")).unwrap();
    assert!(seeds.lines().eq(theirs.iter().map(|row| &row[3])), "{seeds} for {theirs:?}");
    // A repetition has the same rows.
    said(dir, &["spec.toml", "--check"]);
}

#[test]
fn runs_whose_times_are_the_result_alternate_between_methods_one_at_a_time() {
    let folder = folder("echo $1 >> order; cp good.bvh \"$3\"", "");
    let method = |name| {
        let command = format!("command = ['sh', 'peer.sh', '{name}']");
        format!("{{ label = '{name}', method = 'external', {command} }}")
    };
    let [a, b] = ["a", "b"].map(method);
    let spec = format!(
        "question = 'Which is faster?'\nscenes = ['spheres75']\nrepetitions = 3\n\
         sequential = true\nmethods = [{a}, {b}]\n"
    );
    fs::write(folder.path().join("spec.toml"), spec).unwrap();
    said(folder.path(), &["spec.toml"]);
    assert_eq!(fs::read_to_string(folder.path().join("order")).unwrap(), "a\nb\n".repeat(3));
}

#[test]
fn errors_of_programs_name_the_method_and_the_command() {
    for (script, more, parts) in [
        ("echo first >&2; echo 'no license' >&2; exit 3", "", &["exit status: 3: no license"][..]),
        ("exit 4", "", &["exit status: 4: it printed nothing"]),
        ("kill -9 $$", "", &["signal: 9"]),
        ("true", "", &["wrote no file"]),
        ("mkfifo \"$2\"", "", &["wrote no file"]),
        ("echo tree > \"$2\"", "", &["its tree is invalid", "not a tree file"]),
        ("head -c 1000 good.bvh > \"$2\"", "", &["its tree is invalid", "cut or extended"]),
        ("sleep 60", "timeout_seconds = 0.1", &["did not end within 0.1 s"]),
    ] {
        let folder = folder(script, more);
        let place = "scene spheres75, method theirs, command `sh peer.sh`: ";
        refused(folder.path(), &["spec.toml"], 1, &[&[place], parts].concat());
    }
}

#[test]
fn missing_and_empty_commands_are_rejected() {
    let folder = folder("", "");
    let spec = fs::read_to_string(folder.path().join("spec.toml")).unwrap();
    for (command, code, part) in [
        ("['no-such-program', 'x']", 1, "command `no-such-program x`: it cannot be started"),
        ("[]", 2, "methods[1].command is empty; accepted: a list of a program"),
        ("['']", 2, "methods[1].command is empty"),
        ("['a'], timeout_seconds = 0", 2, "methods[1].timeout_seconds is 0; accepted: above 0"),
        ("['a'], objective = 'layout'", 2, "methods[1].objective is set for external"),
        (
            "['a'], budget = { max_work = 1 }",
            2,
            "methods[1].budget is set for external; accepted: with a method of ours",
        ),
        ("['a'], comand = 'b'", 2, "comand"),
    ] {
        fs::write(folder.path().join("spec.toml"), spec.replace("['sh', 'peer.sh']", command))
            .unwrap();
        refused(folder.path(), &["spec.toml"], code, &[part]);
    }
}

#[test]
fn a_signal_ends_a_program_and_what_it_has_started_within_a_second() {
    let folder = folder("sleep 60 & echo $! > pid.new; mv pid.new pid; wait", "");
    let dir = folder.path();
    let mut child = program(dir, &["spec.toml", "--jobs=1"]).stderr(Stdio::null()).spawn().unwrap();
    wait_for(&dir.join("pid"));
    let start = Instant::now();
    send("-TERM", &child);
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
    assert_ended(dir, "SIGTERM");
}

/// Asserts that the process whose number is in the folder's file `pid` has ended.
fn assert_ended(dir: &Path, how: &str) {
    let pid = fs::read_to_string(dir.join("pid")).unwrap();
    let start = Instant::now();
    // What has ended is a zombie (Z) until the process that inherits it looks.
    let lives = || {
        let state = Command::new("ps").args(["-o", "stat=", "-p", pid.trim()]).output().unwrap();
        !state.stdout.is_empty() && !state.stdout.starts_with(b"Z")
    };
    while lives() {
        assert!(start.elapsed() < Duration::from_secs(5), "{how}: {pid} lives on");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn what_a_program_has_started_ends_with_it_however_the_program_ends() {
    let begin = "sh -c 'echo $$ > pid.new; mv pid.new pid; exec sleep 124' & while ! test -f pid; do sleep 0.01; done;";
    // A child of the program, and one whose parent has ended.
    for begin in [begin, &format!("({begin});")] {
        for (end, more, code) in [
            ("cp good.bvh \"$2\"", "", 0),
            ("exit 3", "", 1),
            ("kill -9 $$", "", 1),
            ("sleep 60", "timeout_seconds = 0.5", 1),
        ] {
            let folder = folder(&format!("rm -f pid; {begin} {end}"), more);
            let output = run(folder.path(), &["spec.toml", "--jobs=1"]);
            let how = format!("{begin} {end}");
            assert_eq!(output.status.code(), Some(code), "{how}");
            assert_ended(folder.path(), &how);
        }
    }
}
