//! Ctrl-C while `bvh bake` searches: the best tree so far is written, and it is a good one. Other
//! commands end at once.
use crate::support::{
    begin, bvh, cost, ended, facts, names, number, obj, program, send, text, wait_until, words,
};
use bvh_core::Triangle;
use bvh_scenes::Scene;
use glam::DMat3;
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

/// Bakes a scene into `a.bvh`, and interrupts the search this long after it has begun.
fn interrupted(folder: &Path, bake: &str, after: Duration) {
    let before = fs::read_dir(folder).unwrap().count();
    let child = begin(folder, &words(&format!("bake --out=a.bvh {bake}")));
    // The file is reserved before the search begins.
    wait_until("the file", || fs::read_dir(folder).unwrap().count() != before);
    std::thread::sleep(after);
    send("-INT", &child);
    ended(&child.wait_with_output().unwrap(), 130, &["`--from a.bvh --out a.bvh` continues"]);
}

#[test]
fn ctrl_c_keeps_the_best_tree_so_far_also_while_a_bake_decides() {
    for bake in ["konistil --budget=1h", "konistil"] {
        let folder = tempfile::tempdir().unwrap();
        interrupted(folder.path(), bake, Duration::ZERO);
        bvh(folder.path(), "verify a.bvh konistil");
        assert_eq!(names(folder.path()), ["a.bvh"]);
    }
}

#[test]
fn ctrl_c_keeps_a_better_tree_in_the_file_and_the_best_one_of_a_decision() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake escher --budget=20Mwork --out=a.bvh");
    let good = fs::read(at.join("a.bvh")).unwrap();
    for bake in ["escher --budget=1h", "escher --budget=1h --rays=default", "escher"] {
        interrupted(at, bake, Duration::from_millis(100));
        assert!(fs::read(at.join("a.bvh")).unwrap() == good, "{bake}");
    }
    // A tree of another scene is replaced.
    bvh(at, "bake escher:100 --budget=0s --out=a.bvh");
    let mut child = begin(at, &words("bake konistil --out=a.bvh"));
    let mut messages = BufReader::new(child.stderr.take().unwrap());
    let mut message = String::new();
    while !message.contains("combinations") {
        assert!(messages.read_line(&mut message).unwrap() > 0, "{message}");
    }
    std::thread::sleep(Duration::from_secs(5));
    send("-INT", &child);
    ended(&child.wait_with_output().unwrap(), 130, &[]);
    assert!(number(at, "inspect a.bvh konistil", "work") > 1e6);
}

#[test]
fn ctrl_c_says_what_was_gained_and_also_while_the_frame_is_chosen_keeps_no_worse_tree_than_greedy()
{
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = Scene::load("escher").unwrap();
    let turn = DMat3::from_rotation_y(0.5);
    let turned = |triangle: &Triangle| triangle.0.map(|corner| turn * corner.as_dvec3());
    let mesh = obj(scene.triangles().unwrap().iter().map(turned));
    // The remark on the last triangle tells that the choice soon begins.
    fs::write(at.join("turned.obj"), mesh + "f 1 1 1\n").unwrap();
    let bake = |after: Duration, more: &str| {
        let args = format!("bake turned.obj --budget=1h --out=a.bvh {more}");
        let mut command = program(at, &words(&args));
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut messages = BufReader::new(child.stderr.take().unwrap());
        let mut message = String::new();
        messages.read_line(&mut message).unwrap();
        std::thread::sleep(after);
        send("-INT", &child);
        messages.read_to_string(&mut message).unwrap();
        (text(&child.wait_with_output().unwrap().stdout), message)
    };
    let mut after = Duration::from_millis(10);
    let (said, message) = loop {
        let found = bake(after, "");
        if at.join("a.bvh").exists() {
            break found;
        }
        after *= 2;
    };
    assert!(!said.contains("budget is too small"), "{said}");
    assert!(message.contains("nothing better was found yet; `--from a.bvh"), "{message}");
    assert!(number(at, "verify a.bvh turned.obj", "saved") >= 0.0);
    fs::remove_file(at.join("a.bvh")).unwrap();
    let (said, message) = bake(Duration::from_secs(4), "--frame=file --json");
    let facts: Value = serde_json::from_str(&said).unwrap();
    let saved = facts["saved"].as_f64().unwrap();
    assert!(saved > 0.0 && message.contains(facts["interrupted"].as_str().unwrap()), "{said}");
    let gain = format!("−{:.1} % area of inner nodes against the greedy tree", 100.0 * saved);
    assert!(message.contains(&gain), "{gain}: {message}");
}

#[test]
fn ctrl_c_before_a_later_bake_has_its_rays_writes_no_tree_that_is_not_for_rays() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake konistil --budget=0work --rays=default --out=rays.bvh");
    let child = begin(at, &words("bake konistil --budget=1h --from=rays.bvh --out=a.bvh"));
    wait_until("the file", || names(at).len() > 1);
    send("-INT", &child);
    ended(&child.wait_with_output().unwrap(), 130, &["interrupted; "]);
    for file in names(at) {
        assert_eq!(facts(at, &format!("inspect {file}"))["method"], "best for rays", "{file}");
    }
}

#[test]
fn ctrl_c_ends_a_command_without_a_result_at_once_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 1 1\n").unwrap();
    for signal in ["-INT", "-TERM"] {
        let render = "render a.obj --accel=brute --size=5000x5000 --out=a.png";
        let mut child = begin(at, &words(render));
        let mut messages = BufReader::new(child.stderr.take().unwrap());
        let mut message = String::new();
        messages.read_line(&mut message).unwrap();
        assert!(message.contains("without area"), "the scene is loaded: {message}");
        send(signal, &child);
        messages.read_to_string(&mut message).unwrap();
        assert!(message.ends_with("error: interrupted\n"), "{message}");
        ended(&child.wait_with_output().unwrap(), 130, &[]);
    }
    assert_eq!(names(at), ["a.obj"]);
}

#[test]
fn a_bake_that_is_interrupted_early_is_not_behind_plain_reinsertion() {
    let folder = tempfile::tempdir().unwrap();
    let cost = |file: &str| cost(folder.path(), file);
    let begin = Instant::now();
    bvh(folder.path(), "bake escher:4000 --method=reinsertion --budget=1000Gwork --out=plain.bvh");
    // The time suffices for reinsertion and the trees built before it, also on a busy machine. The
    // heat of a long search has not paid by then.
    let plain = cost("plain.bvh");
    let after = Duration::from_millis(500) + 12 * begin.elapsed();
    for more in ["--budget=1h", "--budget=1000Gwork", "--budget=1h --references=1.2"] {
        interrupted(folder.path(), &format!("escher:4000 {more}"), after);
        // If leaves may be divided, they are part of the measure, and moves with equal gains come
        // in a different order.
        let most = if more.contains("--references") { 1.0001 } else { 1.0 };
        let found = cost("a.bvh");
        assert!(found <= most * plain, "{more:?}: {found} is above {plain}");
        fs::remove_file(folder.path().join("a.bvh")).unwrap();
    }
}
